//! Finds the light that a painted shadow is made by (thesis 6.7.2).

use crate::Result;
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::scene::cube;
use crate::transport::shadow::localize::{Settings, Spot, localize};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};
use std::sync::Arc;

/// What the selected samples miss of the environment, on average, is held against a threshold.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LocalizeLight {
    /// Share of the missed energy that is left out, dimmest directions first: 0 keeps all that is missed, 1 nothing, and
    /// the light shrinks without jumps between. Null: found, so that lamps part from what surrounds them.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub threshold: Option<f32>,
    /// 0: all light above the threshold, as one; 1: the connected part of it that the shadow misses most of, 2: the next,
    /// ... Where the threshold is found, it is found anew for each, in what those before it left.
    #[schemars(range(min = 0, max = 1000))]
    pub which: u32,
    /// All other light instead.
    pub residual: bool,
}

impl Node for LocalizeLight {
    const INFO: Info = Info {
        name: "localize_light",
        category: "shadows",
        summary: "Finds the light that painted samples miss: the one that their shadow belongs to",
        inputs: &[
            Port::new("visibility", Kind::Visibility, "What samples see, before edits"),
            Port::new("environment", Kind::Environment, "The light, with as many texels a face"),
            Port::new("selection", Kind::Selection, "Painted inside of the shadow; a dab is enough"),
            Port::new("except", Kind::Light, "Light that was found before, not to be found again").optional(),
        ],
        outputs: &[Port::new("light", Kind::Light, "How much of each direction belongs to the light")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (visibility, environment) =
            (inputs.need_visibility("visibility")?, inputs.need_environment("environment")?);
        let selection = inputs.need_selection("selection")?;
        selection.check(&visibility.samples.geometry)?;
        let weights = selection.weights(&visibility.samples.points);
        let samples = weights.iter().filter(|weight| **weight > 0.0).count();
        let blocked = visibility.blocked(&weights)?;
        let except = inputs.light("except").map(|lamp| &**lamp);
        let settings =
            Settings { threshold: self.threshold, which: self.which, residual: self.residual, except, samples };
        let found = localize(environment, &blocked, &settings)?;
        job.note("samples", samples);
        job.note("missed_share", found.missed);
        job.note("threshold", found.threshold);
        job.note("texels", found.texels);
        job.note("steradians", found.steradians);
        job.note("share", found.share);
        let lamp = |spot: &Spot| json!({ "direction": spot.direction.to_array(), "steradians": spot.steradians, "share": spot.share });
        job.note("lamps", found.lamps.iter().map(lamp).collect::<Vec<Json>>());
        if let Some((texel, share)) = found.brightest {
            let direction = cube::texel_point(texel, environment.size).normalize().to_array();
            job.note("brightest", json!({ "texel": texel, "direction": direction, "share": share }));
        }
        found.warnings.iter().for_each(|warning| job.warn(warning));
        Ok(vec![Value::Light(Arc::new(found.lamp))])
    }
}
