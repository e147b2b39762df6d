//! Lights a view through its transfer, with edits: the interactive preview (thesis 4.5, Algorithms 3 and 4).
//!
//! Light is kept by source: when one lamp moves, only its own light is computed again. What an edit changes is only its
//! own pixels' colour, unless it names a new caster.

use crate::Result;
use crate::image::{Image, Layer};
use crate::node::{Facet, Info, Inputs, Job, Key, Node, Port};
use crate::scene::Geometry;
use crate::transport::lighting::{Indirect, SceneLight, Shading, Stage, Told, surface_layers};
use crate::transport::{Edits, Transfer};
use crate::value::{Kind, Value};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Relight {
    /// Shadow rays a point towards surfaces and rectangles that emit.
    #[schemars(range(min = 1, max = 4096))]
    pub light_samples: u32,
}

impl Default for Relight {
    fn default() -> Self {
        Self { light_samples: 16 }
    }
}

impl Node for Relight {
    const INFO: Info = Info {
        name: "relight",
        category: "indirect light",
        summary: "Direct and indirect light of a view, with edits",
        inputs: &[
            Port::new("scene", Kind::Scene, "Lights and materials, and what casts shadows").reads(&[
                Facet::Geometry,
                Facet::Materials,
                Facet::Lights,
            ]),
            Port::new("transfer", Kind::Transfer, "How light gets from surfaces to the view"),
            Port::new("edits", Kind::Edits, "What to change").optional(),
        ],
        outputs: &[Port::new("image", Kind::Image, "beauty, and layers direct, indirect, albedo, P, N, Z")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (geometry, materials) = (inputs.geometry("scene")?, inputs.materials("scene")?);
        let transfer = inputs.need_transfer("transfer")?;
        transfer.samples.check(&geometry)?;
        let stage = stage(inputs, job, &geometry, transfer);
        let stuff = inputs.key("scene", Facet::Materials).expect("the scene is connected");
        let light = SceneLight::new(&stage, &materials, stuff, &inputs.lights("scene")?, self.light_samples)?;
        let none = Arc::new(Edits::default());
        let edits = inputs.edits("edits").unwrap_or(&none);
        let indirect = Indirect::new(&light, edits)?;
        tell(job, &light, edits, &indirect.told);

        let samples = &transfer.samples;
        let (reflectance, direct) = (light.view_reflectance()?, light.at_view()?);
        let emission = |i: usize| match samples.points[i] {
            point if point.exists() => Vec3::from(materials[point.material as usize].emission),
            _ => Vec3::ZERO,
        };
        let shading = Shading {
            samples,
            reflectance: &reflectance,
            direct: &direct.irradiance,
            indirect: &indirect.radiance,
            highlight: &direct.highlight,
            emission: &emission,
        };
        let key = Key::of(&[b"surface", &stage.place.0, &stuff.0]);
        let bytes = |layers: &Vec<Layer>| layers.iter().map(|layer| 4 * layer.data.len() as u64).sum();
        let fixed = job.memo(key, bytes, || Ok(surface_layers(samples, &reflectance)))?;
        let layers = shading.layers().into_iter().chain(fixed.iter().cloned()).collect();
        let (width, height) = (samples.width, samples.height);
        Ok(vec![Value::Image(Arc::new(Image { width, height, layers, ..Image::default() }))])
    }
}

/// What nodes that light a transfer work with; both ports must be called `scene` and `transfer`.
pub fn stage<'a>(inputs: &Inputs, job: &'a Job, geometry: &'a Geometry, transfer: &'a Transfer) -> Stage<'a> {
    let key = |port| inputs.key(port, Facet::Geometry).expect("it is connected");
    let place = Key::of(&[b"stage", &key("scene").0, &key("transfer").0]);
    Stage { device: job.device, memo: job.memo, progress: job.progress, geometry, transfer, place }
}

fn tell(job: &Job, light: &SceneLight, edits: &Edits, told: &Told) {
    told.idle.iter().for_each(|line| job.warn(line));
    if !told.idle.is_empty() {
        job.note("edits_without_effect", told.idle.clone());
    }
    if let Some([places, rays, entries]) = told.glossy {
        job.note("glossy_places", places);
        job.note("glossy_rays", rays);
        job.note("glossy_entries", entries);
    }
    job.note("lights", light.sources());
    job.note("edits", edits.0.len());
    job.note("parts_of_light", told.parts);
}
