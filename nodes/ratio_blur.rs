//! Softens a shadow (thesis 6.7.5).

use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Key, Node, Port};
use crate::transport::shadow::ratio::blur::{Links, blur};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A Gaussian blur of the ratio. With samples, it stays on the surfaces that they lie on: shadows do not leak over
/// silhouettes and creases.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RatioBlur {
    /// Standard deviation.
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "heights"))]
    pub radius: f64,
}

impl Node for RatioBlur {
    const INFO: Info = Info {
        name: "ratio_blur",
        category: "shadows",
        summary: "Softens a shadow, on the screen or along surfaces",
        inputs: &[
            Port::new("ratio", Kind::Ratio, "The shadow"),
            Port::new("samples", Kind::Samples, "Surfaces to stay on").optional().reads(&[Facet::Geometry]),
        ],
        outputs: &[Port::new("ratio", Kind::Ratio, "The soft shadow")],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.radius == 0.0).then_some("ratio")
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let ratio = inputs.need_ratio("ratio")?;
        let links = match inputs.whole_samples("samples") {
            Some(samples) => {
                ratio.check("samples have", samples.width, samples.height)?;
                let key = inputs.key("samples", Facet::Geometry).expect("it is connected");
                let links = || Ok(Links::new(samples));
                Some(job.memo(Key::of(&[b"ratio links", &key.0]), Links::bytes, links)?)
            }
            None => None,
        };
        let soft = blur(job.device, ratio, self.radius * ratio.height as f64, links.as_deref())?;
        Ok(vec![Value::Ratio(Arc::new(soft))])
    }
}
