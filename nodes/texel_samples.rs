//! The surface points of an atlas: every surface of a scene, laid out flat (thesis 6.4, per-texel sampling).

use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::atlas;
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Shadows baked at texels can be seen from any camera (`view_texels`). The file's own texture coordinates are used where
/// they overlap nowhere and stay inside of the unit square; otherwise surfaces are laid out anew. Texels lie on the front
/// sides of triangles.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TexelSamples {
    /// Along a side of the square atlas.
    #[schemars(range(min = 16, max = 8192), extend("unit" = "texels"))]
    pub size: u32,
}

impl Default for TexelSamples {
    fn default() -> Self {
        Self { size: 1024 }
    }
}

impl Node for TexelSamples {
    const INFO: Info = Info {
        name: "texel_samples",
        category: "in and out",
        summary: "The surface points of an atlas of the whole scene, for a free camera",
        inputs: &[Port::new("scene", Kind::Scene, "What is laid out").reads(&[Facet::Geometry])],
        outputs: &[Port::new("samples", Kind::Samples, "Size x size points")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let geometry = inputs.geometry("scene")?;
        let samples = atlas::texel_samples(&geometry, self.size as usize, job.progress)?;
        let covered = samples.points.iter().filter(|point| point.exists()).count();
        job.note("coverage", covered as f64 / samples.points.len() as f64);
        let own = samples.atlas.as_ref().is_some_and(|atlas| atlas.from_file);
        job.note("texture_coordinates", if own { "of the file" } else { "laid out anew" });
        Ok(vec![Value::Samples(Arc::new(samples))])
    }
}
