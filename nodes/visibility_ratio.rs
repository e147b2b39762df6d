//! The shadow between two pictures, as a picture of factors (thesis 6.7.1, eq. 6.1).

use super::merge::same_size;
use crate::image::components::{self, Part};
use crate::image::{Image, Layer};
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::shadow::Ratio;
use crate::transport::shadow::ratio::quotient::{Met, divide, of_pass};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// `v = original / removed` for each pixel and channel: 1 where there is no shadow, below where there is, above where
/// removal darkened. Light below a millionth of the picture's mean is none to compare with: the ratio goes over into 1
/// there, and the report counts such pixels (`undefined`). Pixels with NaN or infinity in either picture have ratio 1
/// (`not_finite`). Without `removed`, `layer` is a renderer's shadow pass, and is the ratio.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct VisibilityRatio {
    /// The layer to compare. Empty: direct light where both pictures have it, by the names that renderers give it, the
    /// beauty otherwise.
    pub layer: String,
    /// The shadow pass is 1 in the shadow and 0 in the light.
    pub inverted: bool,
}

impl Node for VisibilityRatio {
    const INFO: Info = Info {
        name: "visibility_ratio",
        category: "shadows",
        version: 2,
        summary: "The shadow that one picture has and another has not, as a ratio",
        inputs: &[
            Port::new("original", Kind::Image, "With the shadow; or a picture with a shadow pass"),
            Port::new("removed", Kind::Image, "Without it; not connected for a shadow pass").optional(),
        ],
        outputs: &[Port::new("ratio", Kind::Ratio, "Original over removed, or the pass")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let original = inputs.need_image("original")?;
        let (values, met) = match inputs.image("removed") {
            Some(removed) => self.quotient(original, removed, job)?,
            None => self.pass(original, job)?,
        };
        if met.not_finite > 0 {
            job.note("not_finite", met.not_finite);
            let count = met.not_finite;
            job.warn(format!("{count} pixels hold NaN or infinity; their ratio is 1"));
        }
        if met.limited > 0 {
            job.note("limited", met.limited);
        }
        let values = values.into();
        Ok(vec![Value::Ratio(Arc::new(Ratio {
            width: original.width,
            height: original.height,
            values,
            colour_space: original.colour_space,
        }))])
    }
}

impl VisibilityRatio {
    fn quotient(&self, original: &Image, removed: &Image, job: &Job) -> Result<(Vec<[f32; 4]>, Met)> {
        if self.inverted {
            let help = "take inverted off, or take the wire of removed off to read a shadow pass";
            return Err(Error::compute("inverted is for shadow passes, but removed is connected", help));
        }
        same_size(original, removed, ["original", "removed"])?;
        let removed = &removed.to_space(original.colour_space);
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
        Ok((values, met))
    }

    fn pass(&self, image: &Image, job: &Job) -> Result<(Vec<[f32; 4]>, Met)> {
        if self.layer.is_empty() {
            let help = "connect the picture without the shadow to removed, or name the shadow pass with layer";
            return Err(Error::compute("one picture, and no layer named", help));
        }
        let layer = image.find(&self.layer).map_err(|e| Error::compute(e.message, e.help))?;
        let channels = if layer.channels.len() == 1 { [0; 3] } else { layer.need_rgb()? };
        job.note("layer", layer.title());
        let (values, met) = of_pass(layer, channels, self.inverted);
        let least = values.iter().flat_map(|value| &value[..3]).fold(f32::INFINITY, |least, x| least.min(*x));
        if least < 0.0 {
            job.warn(format!("\"{}\" falls to {least}: is it a shadow pass from 0 to 1?", layer.title()));
        }
        Ok((values, met))
    }

    /// The layer of one picture, and where its red, green and blue are.
    fn layer<'a>(&self, image: &'a Image, other: &Image, port: &str) -> Result<(&'a Layer, [usize; 3])> {
        let direct = |image: &Image| components::known(image).into_iter().find(|known| known.light == Part::Direct);
        let found = match (direct(image), direct(other)) {
            (Some(own), Some(other)) if self.layer.is_empty() && own.colour.is_some() == other.colour.is_some() => {
                Ok(&image.layers[own.layer])
            }
            _ => image.find(&self.layer),
        };
        let layer = found.map_err(|e| Error::compute(format!("input \"{port}\": {}", e.message), e.help))?;
        Ok((layer, layer.need_rgb()?))
    }
}
