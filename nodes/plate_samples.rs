//! A renderer's plate as the view that is edited: its own position and normal passes are the surface samples.

use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::plate::passes::UpAxis;
use crate::transport::plate::samples::{FITS, Layers, Told, plate_samples};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Edits line up with the plate to the pixel; no camera is needed, it is found from the positions.
/// Antialiased edges, where averaged positions lie on no surface, are found, put on the surface that they show most of,
/// and counted.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlateSamples {
    /// World positions. Empty: the layer called `P` or `Position`.
    pub position_layer: String,
    /// World normals. Empty: the layer called `N` or `Normal`.
    pub normal_layer: String,
    /// The axis that points up in the plate: `z` for Blender.
    pub up_axis: UpAxis,
    /// Metres to the plate's unit: 0.01 for centimetres.
    #[schemars(range(min = 1e-6, max = 1e6), extend("unit" = "m"))]
    pub scale: f32,
    /// With a scene: 4 and more draw the edges of surfaces and shadows as smoothly as the plate does.
    #[schemars(range(min = 1, max = 256))]
    pub samples_per_pixel: u32,
}

impl Default for PlateSamples {
    fn default() -> Self {
        let (position_layer, normal_layer) = (String::new(), String::new());
        Self { position_layer, normal_layer, up_axis: UpAxis::Y, scale: 1.0, samples_per_pixel: 1 }
    }
}

impl Node for PlateSamples {
    const INFO: Info = Info {
        name: "plate_samples",
        category: "in and out",
        summary: "The surface points that a plate shows, from its own position and normal passes",
        inputs: &[
            Port::new("image", Kind::Image, "The plate"),
            Port::new("scene", Kind::Scene, "What it shows; without it, the points serve ratios and mattes alone")
                .reads(&[Facet::Geometry])
                .optional(),
            Port::new("camera", Kind::Camera, "Where it was seen from; without it, found from the positions")
                .optional(),
        ],
        outputs: &[
            Port::new("samples", Kind::Samples, "samples_per_pixel points a pixel"),
            Port::new("camera", Kind::Camera, "The camera that was found, or given"),
        ],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let image = inputs.need_image("image")?;
        let geometry = match inputs.get("scene") {
            Some(_) => Some(inputs.geometry("scene")?),
            None => None,
        };
        let layers = Layers {
            position: &self.position_layer,
            normal: &self.normal_layer,
            up: self.up_axis,
            scale: self.scale,
            per_pixel: self.samples_per_pixel,
        };
        let camera = inputs.camera("camera");
        let (samples, told) =
            plate_samples(job.device, image, &layers, camera.map(|camera| &**camera), geometry.as_deref())?;
        tell(job, &told, camera.is_some());
        let camera = samples.camera.clone();
        Ok(vec![Value::Samples(Arc::new(samples)), Value::Camera(Arc::new(camera))])
    }
}

fn tell(job: &Job, told: &Told, given: bool) {
    job.note("surface_pixels", told.surface);
    job.note("edge_pixels_filled", told.filled);
    job.note("edge_pixels_lost", told.lost);
    job.note("camera_residual", told.residual);
    job.note("off_the_scene", told.off);
    if told.not_finite > 0 {
        job.note("not_finite", told.not_finite);
        job.warn(format!(
            "{} pixels have positions or normals that are NaN or infinite; they show nothing",
            told.not_finite
        ));
    }
    if told.residual > FITS {
        let whose = if given { "the camera that is connected" } else { "any pinhole looking through the middle" };
        let off = told.residual;
        job.warn(format!("positions are {off:.1} pixels off from where {whose} sees them; free views may be off, too"));
    }
    if 50 * told.off > told.surface {
        let (off, all) = (told.off, told.surface);
        job.warn(format!(
            "{off} of {all} positions are farther from the scene than pixels are large: is it the same state?"
        ));
    }
}
