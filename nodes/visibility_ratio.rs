//! The shadow between two pictures, as a picture of factors (thesis 6.7.1, eq. 6.1).

use super::merge::same_size;
use crate::image::{Image, Layer};
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::shadow::Ratio;
use crate::transport::shadow::ratio::quotient::divide;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// `v = original / removed` for each pixel and channel: 1 where there is no shadow, below where there is, above where
/// removal darkened. Light below a millionth of the picture's mean is none to compare with: the ratio goes over into 1
/// there, and the report counts such pixels (`undefined`). Pixels with NaN or infinity in either picture have ratio 1
/// (`not_finite`).
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct VisibilityRatio {
    /// The layer to compare. Empty: `direct` where both pictures have it, the beauty otherwise.
    pub layer: String,
}

impl Node for VisibilityRatio {
    const INFO: Info = Info {
        name: "visibility_ratio",
        category: "shadows",
        summary: "The shadow that one picture has and another has not, as a ratio",
        inputs: &[
            Port::new("original", Kind::Image, "With the shadow"),
            Port::new("removed", Kind::Image, "Without it"),
        ],
        outputs: &[Port::new("ratio", Kind::Ratio, "Original over removed")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (original, removed) = (inputs.need_image("original")?, inputs.need_image("removed")?);
        same_size(original, removed, ["original", "removed"])?;
        let (a, b) = (self.layer(original, removed, "original")?, self.layer(removed, original, "removed")?);
        let (values, met) = divide(a, b);
        if b.0.title() != a.0.title() {
            job.warn(format!("{} over {}", a.0.title(), b.0.title()));
        }
        job.note("layer", a.0.title());
        job.note("undefined", met.undefined);
        if 2 * met.undefined > removed.width * removed.height {
            let count = met.undefined;
            job.warn(format!("`removed` is dark in {count} pixels, more than half: no shadow shows there"));
        }
        if met.not_finite > 0 {
            job.note("not_finite", met.not_finite);
            let count = met.not_finite;
            job.warn(format!("{count} pixels hold NaN or infinity; their ratio is 1"));
        }
        if met.limited > 0 {
            job.note("limited", met.limited);
        }
        let values = values.into();
        Ok(vec![Value::Ratio(Arc::new(Ratio { width: original.width, height: original.height, values }))])
    }
}

impl VisibilityRatio {
    /// The layer of one picture, and where its red, green and blue are.
    fn layer<'a>(&self, image: &'a Image, other: &Image, port: &str) -> Result<(&'a Layer, [usize; 3])> {
        let both_direct = image.layer("direct").filter(|_| other.layer("direct").is_some());
        let found = match both_direct {
            Some(direct) if self.layer.is_empty() => Ok(direct),
            _ => image.find(&self.layer),
        };
        let layer = found.map_err(|e| Error::compute(format!("input \"{port}\": {}", e.message), e.help))?;
        Ok((layer, colours(layer)?))
    }
}

/// Where a layer has red, green and blue.
///
/// # Errors
/// `Compute` for a layer that has other channels.
pub(super) fn colours(layer: &Layer) -> Result<[usize; 3]> {
    layer.rgb().ok_or_else(|| {
        let message = format!("layer \"{}\" has {}, not R G B", layer.title(), layer.channels.join(" "));
        Error::compute(message, "name a colour layer")
    })
}
