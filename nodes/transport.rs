//! What an environment would do to a view if nothing cast a shadow (thesis 6.3).

use crate::Result;
use crate::device::Array;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::samples::reflectance;
use crate::transport::shadow::{DirectTransport, direct};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Surfaces are taken to be diffuse; what polished ones reflect of the environment is left out, with a warning.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Transport {}

impl Node for Transport {
    const INFO: Info = Info {
        name: "transport",
        category: "shadows",
        summary: "What an environment would do to a view if nothing cast a shadow",
        inputs: &[
            Port::new("scene", Kind::Scene, "What surfaces are made of").reads(&[Facet::Geometry, Facet::Materials]),
            Port::new("samples", Kind::Samples, "The view").reads(&[Facet::Geometry]),
            Port::new("environment", Kind::Environment, "The light"),
        ],
        outputs: &[Port::new("transport", Kind::Transport, "Light and reflectance, without visibility")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (geometry, materials) = (inputs.geometry("scene")?, inputs.materials("scene")?);
        let samples = inputs.need_whole_samples("samples")?;
        samples.check(&geometry)?;
        let environment = inputs.need_environment("environment")?;
        let reflectance = reflectance(&geometry, &materials, &samples.points, &samples.barycentrics);
        let energy = environment.energy(0..environment.radiance.len());
        job.note("energy", energy.to_vec());
        let glossy = direct::glossy(&materials, &samples.points);
        if glossy > 0 {
            job.note("glossy_samples", glossy);
            job.warn(format!("{glossy} samples lie on polished surfaces; what these reflect is left out"));
        }
        Ok(vec![Value::Transport(Arc::new(DirectTransport {
            environment: environment.clone(),
            samples: samples.clone(),
            reflectance: reflectance.into(),
            emission: Array::from(direct::emission(&materials, &samples.points)),
        }))])
    }
}
