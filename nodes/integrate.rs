//! Visibility times transport: the picture under an environment (thesis 6.4).

use crate::Result;
use crate::image::Image;
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::shadow::edited::chain::unbaked;
use crate::transport::shadow::integrate::Stage;
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Integrate {}

impl Node for Integrate {
    const INFO: Info = Info {
        name: "integrate",
        category: "shadows",
        summary: "Lights a view with an environment, through what each sample sees of it",
        inputs: &[
            Port::new("visibility", Kind::Visibility, "What hides light from the samples"),
            Port::new("transport", Kind::Transport, "The light, and what it falls on"),
            Port::new("samples", Kind::Samples, "The view that both were made for"),
        ],
        outputs: &[Port::new("image", Kind::Image, "beauty, and layers direct, albedo, P, N, Z")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (visibility, transport) = (inputs.need_visibility("visibility")?, inputs.need_transport("transport")?);
        let samples = inputs.need_whole_samples("samples")?;
        let stage = Stage { device: job.device, memo: job.memo, visibility, transport };
        stage.check()?;
        stage.check_samples(samples)?;
        let without = stage.faces_without_shadows();
        if !without.is_empty() {
            job.warn(format!("light from {} casts no shadows: visibility has no such faces", without.join(", ")));
            job.note("faces_without_shadows", without);
        }
        let unbaked = unbaked(visibility, &transport.environment);
        if unbaked > 0 {
            job.warn(format!(
                "edits look at {unbaked} directions that no light comes from; shadows there were not baked. Disconnect \
                 `environment` from the visibility node to bake them"
            ));
            job.note("directions_not_baked", unbaked);
        }
        job.note("edits", visibility.edits.len());
        let layers = stage.layers(job.progress)?;
        let (width, height) = (samples.width, samples.height);
        Ok(vec![Value::Image(Arc::new(Image { width, height, layers, ..Image::default() }))])
    }
}
