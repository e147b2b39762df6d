//! The offline renderer (thesis 5.5.3): any resolution, any samples a pixel, indirect light by final gathering.

use crate::device::{Array, Device};
use crate::image::Image;
use crate::node::{Info, Inputs, Job, Key, Node, Port};
use crate::nodes::camera;
use crate::scene::Material;
use crate::transport::final_gather::{
    Bounces, Crossing, Gatherer, Incident, Light, Renderer, Seen, Settings, SourceEdits,
};
use crate::transport::{Edits, Samples};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::sync::Arc;

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FinalGather {
    /// Of the picture.
    #[schemars(range(min = 1, max = 65536), extend("unit" = "pixels"))]
    pub width: u32,
    /// Of the picture.
    #[schemars(range(min = 1, max = 65536), extend("unit" = "pixels"))]
    pub height: u32,
    /// Rays through each pixel, spread evenly over it.
    #[schemars(range(min = 1, max = 4096))]
    pub samples_per_pixel: u32,
    /// Asked relative error of indirect light (root mean square over the mean): places and rays of the cache follow from
    /// it.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub tolerance: f32,
    /// Most rays that gather the light of one place, whatever the tolerance.
    #[schemars(range(min = 64, max = 1048576))]
    pub rays: u32,
    /// Times that light is reflected before it reaches the view.
    #[schemars(range(min = 1, max = 64))]
    pub bounces: u32,
    /// Greatest error that a place of the irradiance cache may have where it counts (`a` of Ward et al. 1988) in the first
    /// picture; finer ones follow. At 0.01, about every pixel gathers for itself.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub cache_error: f32,
    /// Shadow rays a pixel towards surfaces and rectangles that emit.
    #[schemars(range(min = 1, max = 4096))]
    pub light_samples: u32,
}

impl Default for FinalGather {
    fn default() -> Self {
        Self {
            width: 640,
            height: 480,
            samples_per_pixel: 16,
            tolerance: 0.02,
            rays: 8192,
            bounces: 1,
            cache_error: 0.5,
            light_samples: 64,
        }
    }
}

impl Node for FinalGather {
    const INFO: Info = Info {
        name: "final_gather",
        category: "indirect light",
        summary: "Direct and indirect light at final quality, with edits: the offline renderer",
        inputs: &[
            Port::new("scene", Kind::Scene, "What is seen, and what lights it"),
            Port::new("camera", Kind::Camera, "Where from; without it, the scene's first camera").optional(),
            Port::new("edits", Kind::Edits, "What to change").optional(),
        ],
        outputs: &[Port::new("image", Kind::Image, "beauty, and layers direct, indirect, albedo, P, N, Z")],
        stored: true,
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (geometry, materials) = (inputs.geometry("scene")?, inputs.materials("scene")?);
        let (lights, cameras) = (inputs.lights("scene")?, inputs.cameras("scene")?);
        let camera = match inputs.camera("camera") {
            Some(camera) => camera,
            None => camera::first(&cameras)?,
        };
        let none = Arc::new(Edits::default());
        let edits = inputs.edits("edits").unwrap_or(&none);
        let glows = edits.source().any(|brush| brush.offset != glam::Vec3::ZERO) || edits.sampled().next().is_some();
        if lights.is_empty() && !materials.iter().any(Material::emits) && !glows {
            let help = "add a light node and connect it to the scene, or give a material emission";
            return Err(Error::compute("the scene has no light: no lamp, and no surface that emits", help));
        }
        let mut incident = Incident::new(job.device, &geometry, &materials, &lights, SourceEdits::new(edits));
        if self.bounces > 1 {
            // Where the camera is says which sides of surfaces matter; a small picture does.
            let seen = Samples::view(job.device, &geometry, camera, (128, 96), 1)?;
            let key = Key::of(&[b"bounces", &geometry.fingerprint]);
            incident.bounces =
                Some(Bounces::new(&incident, &seen.points, self.bounces, (job.memo, key), job.progress)?);
        }
        let crossing = Crossing::new(&incident, edits, job.memo)?;
        let gloss: Array<[f32; 4]> = materials.iter().map(Material::gloss).collect::<Vec<_>>().into();
        let seen = Seen {
            camera,
            edits,
            size: (self.width, self.height),
            materials: &materials,
            gloss: gloss.clone(),
            light_samples: self.light_samples.div_ceil(self.samples_per_pixel),
        };
        let settings = Settings {
            samples_per_pixel: self.samples_per_pixel,
            tolerance: self.tolerance,
            rays: self.rays,
            cache_error: self.cache_error,
        };
        let irradiance = Gatherer::new(&incident, &crossing)?;
        let light = Light::new(&irradiance, &seen, &gloss);
        let mut renderer = Renderer::new(&light, seen, settings)?;
        let (width, height) = (self.width as usize, self.height as usize);
        let picture = |renderer: &Renderer| {
            let layers = renderer.layers()?.unwrap_or_default();
            Ok::<_, Error>(vec![Value::Image(Arc::new(Image { width, height, layers, ..Image::default() }))])
        };
        let stage = job.progress.stage("final gathering", DONE);
        let mut done = 0;
        // Samples of a pixel in the last picture that was shown.
        let mut shown = 0;
        loop {
            match renderer.step(&job.progress) {
                Ok(false) => break,
                Ok(true) => {
                    let now = (renderer.done() * DONE as f64) as u64;
                    // Whether to stop is for the next step to say: it leaves the picture whole.
                    let _ = stage.advance(now.saturating_sub(done));
                    done = done.max(now);
                    let passes = renderer.passes();
                    // What few more samples change is not worth the time to show it.
                    let is_due = passes == 1 || 2 * passes >= 3 * shown;
                    if let Some(show) = job.show.filter(|_| is_due) {
                        show(picture(&renderer)?);
                        shown = passes;
                    }
                }
                Err(Error::Cancelled) if job.keeps_best && renderer.passes() > 0 => {
                    let error = match renderer.estimate().error() {
                        error if error.is_finite() => format!("at an error of {:.1} %", 100.0 * error),
                        _ => "before its error was known".to_owned(),
                    };
                    let (passes, asked) = (renderer.passes(), 100.0 * self.tolerance);
                    let all = self.samples_per_pixel;
                    job.stopped_short(format!(
                        "stopped {error} ({asked:.1} % asked), at {passes} of {all} samples a pixel"
                    ));
                    break;
                }
                Err(error) => return Err(error),
            }
        }
        drop(stage);
        if let Some(dark) = renderer.is_dark()? {
            return Err(Error::compute(
                format!(
                    "no light reaches what the camera sees, most of which is \"{}\"",
                    geometry.objects[dark as usize]
                ),
                "move the camera, which may be inside of it, or a light",
            ));
        }
        let cache = renderer.cache();
        if let Some(glossy) = renderer.glossy_cache() {
            job.note("glossy_records", glossy.records.len());
            job.note("glossy_rays", glossy.records.iter().map(|record| u64::from(record.rays)).sum::<u64>());
        }
        let (kernels, cpu) = (job.device.name(), Device::Cpu.name());
        job.note(
            "ran_on",
            json!({ "gather_rays": kernels, "direct_light": kernels, "cached_light": kernels, "placement": cpu, "estimate": cpu }),
        );
        job.note("records", cache.records.len());
        job.note("rays", cache.records.iter().map(|record| u64::from(record.rays)).sum::<u64>());
        job.note("cache_error", cache.error());
        job.note("error", renderer.estimate().error());
        job.note("noise", renderer.estimate().noise);
        job.note("interpolation", renderer.estimate().interpolation);
        picture(&renderer)
    }
}

/// Steps of the bar.
const DONE: u64 = 1000;
