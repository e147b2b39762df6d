//! The surface points that a picture is made of, as a camera sees them.

use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::nodes::camera;
use crate::transport::Samples;
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ViewSamples {
    /// Of the picture.
    #[schemars(range(min = 1, max = 65536), extend("unit" = "pixels"))]
    pub width: u32,
    /// Of the picture.
    #[schemars(range(min = 1, max = 65536), extend("unit" = "pixels"))]
    pub height: u32,
    /// Rays through each pixel, on a regular grid.
    #[schemars(range(min = 1, max = 1024))]
    pub samples_per_pixel: u32,
}

impl Default for ViewSamples {
    fn default() -> Self {
        Self { width: 640, height: 480, samples_per_pixel: 1 }
    }
}

impl Node for ViewSamples {
    const INFO: Info = Info {
        name: "view_samples",
        category: "in and out",
        summary: "The surface points that a camera sees through each pixel",
        inputs: &[
            Port::new("scene", Kind::Scene, "What is seen").reads(&[Facet::Geometry, Facet::Cameras]),
            Port::new("camera", Kind::Camera, "Where from; without it, the scene's first camera").optional(),
        ],
        outputs: &[Port::new("samples", Kind::Samples, "Width x height x samples_per_pixel points")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let geometry = inputs.geometry("scene")?;
        let cameras = inputs.cameras("scene")?;
        let camera = match inputs.camera("camera") {
            Some(camera) => camera,
            None => camera::first(&cameras)?,
        };
        let samples = Samples::view(job.device, &geometry, camera, (self.width, self.height), self.samples_per_pixel)?;
        let hits = samples.points.iter().filter(|point| point.exists()).count();
        job.note("rays", samples.points.len());
        job.note("coverage", hits as f64 / samples.points.len() as f64);
        Ok(vec![Value::Samples(Arc::new(samples))])
    }
}
