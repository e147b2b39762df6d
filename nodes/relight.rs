//! Lights a view through its transfer, with edits: the interactive preview (thesis 4.5, Algorithms 3 and 4).
//!
//! Light is kept by source: when one lamp moves, only its own light is computed again. What an edit changes is only its
//! own pixels' colour, unless it names a new caster.

use crate::device::Array;
use crate::image::{Image, Layer};
use crate::kernels::direct_light::{Lit, View, direct_light};
use crate::node::{Facet, Info, Inputs, Job, Key, Node, Port};
use crate::scene::light::{Source, surfaces};
use crate::scene::{Geometry, Light, Material, SurfacePoint};
use crate::transport::glossy::{GlossyTransfer, gloss_key, glossy_transfer};
use crate::transport::lighting::{
    self, Between, Gains, GlossyLanes, Lane, Leaving, Shading, indirect_radiance, leaving, sum, surface_layers,
};
use crate::transport::samples::reflectance;
use crate::transport::{Edits, Transfer};
use crate::value::{Kind, Value};
use crate::{Error, Result, memory};
use glam::{Vec3, Vec4};
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
        let key = |facet| inputs.key("scene", facet).expect("the scene is connected");
        let transfer_key = inputs.key("transfer", Facet::Geometry).expect("the transfer is connected");
        let stage = Stage {
            job,
            geometry: &geometry,
            materials: &materials,
            transfer,
            place: Key::of(&[b"relight", &key(Facet::Geometry).0, &transfer_key.0]),
            stuff: key(Facet::Materials),
            light_samples: self.light_samples,
        };
        let none = Arc::new(Edits::default());
        let edits = inputs.edits("edits").unwrap_or(&none);
        check(&geometry, &materials, transfer, edits)?;
        Ok(vec![Value::Image(Arc::new(stage.image(&inputs.lights("scene")?, edits)?))])
    }
}

fn check(geometry: &Geometry, materials: &[Material], transfer: &Transfer, edits: &Edits) -> Result<()> {
    transfer.samples.check(geometry)?;
    edits.check(&geometry.fingerprint)?;
    if geometry.material_names.len() != materials.len() {
        let message =
            format!("{} materials for geometry that names {}", materials.len(), geometry.material_names.len());
        return Err(Error::compute(message, "connect the same scene to transfer and relight"));
    }
    Ok(())
}

struct Stage<'a> {
    job: &'a Job<'a>,
    geometry: &'a Geometry,
    materials: &'a [Material],
    transfer: &'a Transfer,
    /// Key of where things are: geometry, view and gather samples.
    place: Key,
    /// Key of what things are made of.
    stuff: Key,
    light_samples: u32,
}

const VEC4: u64 = 16;

impl Stage<'_> {
    fn image(&self, lights: &[Light], edits: &Edits) -> Result<Image> {
        let samples = &self.transfer.samples;
        let gather = &self.transfer.gather;
        let sources: Vec<Source> =
            lights.iter().map(Light::source).chain(surfaces(self.geometry, self.materials)).collect();
        if sources.is_empty() {
            let help = "add a light node and connect it to the scene, or give a material emission";
            return Err(Error::compute("the scene has no light: no lamp, and no surface that emits", help));
        }
        // Of each source at view and gather samples, twice where it shines; and about eight layers.
        let bytes = VEC4 * (2 * sources.len() as u64 + 8) * (samples.points.len() + gather.count()) as u64;
        memory::require(bytes, "light at view and gather samples", "lower width, height or samples_per_pixel")?;
        let view_reflectance = self.reflectance(b"view", &samples.points, &samples.barycentrics)?;
        let gather_reflectance = self.reflectance(b"gather", &gather.points, &gather.barycentrics)?;

        let gloss: Array<[f32; 4]> = self.materials.iter().map(Material::gloss).collect::<Vec<_>>().into();
        let glossy = gloss.iter().any(|g| g[..3].iter().any(|&f0| f0 > 0.0));
        let view = View { eye: samples.camera.position, gloss: &gloss };
        let progress = self.job.progress.stage("lights", sources.len() as u64);
        let (mut at_view, mut at_gather, mut light_keys) = (Vec::new(), Vec::new(), Vec::new());
        for source in &sources {
            at_view.push(self.lit(b"view", &samples.points, source, glossy.then_some(&view))?);
            at_gather.push(self.lit(b"gather", &gather.points, source, None)?);
            light_keys.push(self.light_key(source).0);
            progress.advance(1)?;
        }
        drop(progress);
        let direct = total(samples.points.len(), &at_view, |lit| &lit.irradiance);
        let highlight = if glossy { total(samples.points.len(), &at_view, |lit| &lit.highlight) } else { vec![] };

        let stage = self.stage();
        let between = Between::new(&stage, edits)?;
        if between.empty_casters() > 0 {
            let empty = between.empty_casters();
            tracing::warn!(
                "{empty} casters hold no gather sample, so their edits change nothing: raise gather_samples"
            );
            self.job.note("casters_without_gather_samples", empty);
        }
        let leaving_key = Key::of(&[&self.place.0, &self.stuff.0, bytemuck::cast_slice(&light_keys)]);
        let received = || total(gather.count(), &at_gather, |lit| &lit.irradiance);
        let leaving = leaving(&stage, received, &gather_reflectance, edits.source(), leaving_key)?;
        let diffuse = between.arriving(&Lane::diffuse(&stage), &leaving, None)?;
        let reflection = self.reflection(&between, &leaving, &gloss, &diffuse.gains)?;
        let indirect = indirect_radiance(&stage, &view_reflectance, &diffuse.light, &reflection, edits.eye())?;
        self.job.note("lights", sources.len());
        self.job.note("edits", edits.0.len());
        self.job.note("parts_of_light", between.parts());

        let emission = |i: usize| match samples.points[i] {
            point if point.exists() => Vec3::from(self.materials[point.material as usize].emission),
            _ => Vec3::ZERO,
        };
        let shading = Shading {
            samples,
            reflectance: &view_reflectance,
            direct: &direct,
            indirect: &indirect,
            highlight: &highlight,
            emission: &emission,
        };
        let key = Key::of(&[b"surface", &self.place.0, &self.stuff.0]);
        let bytes = |layers: &Vec<Layer>| layers.iter().map(|layer| 4 * layer.data.len() as u64).sum();
        let fixed = self.job.memo(key, bytes, || Ok(surface_layers(samples, &view_reflectance)))?;
        let layers = shading.layers().into_iter().chain(fixed.iter().cloned()).collect();
        let (width, height) = (samples.width, samples.height);
        Ok(Image { width, height, layers, metadata: vec![] })
    }

    /// Radiance that glossy surfaces reflect, at all view samples; empty when there are none.
    fn reflection(
        &self,
        between: &Between,
        leaving: &Leaving,
        gloss: &[[f32; 4]],
        gains: &Gains,
    ) -> Result<Vec<[f32; 4]>> {
        let model = self.transfer.settings.glossy;
        let key = Key::of(&[b"glossy", &self.place.0, &gloss_key(gloss, model)]);
        let bytes = |glossy: &Option<GlossyTransfer>| glossy.as_ref().map_or(1, GlossyTransfer::bytes);
        let glossy = self.job.keep(key, bytes, || {
            glossy_transfer(self.job.device, self.geometry, self.transfer, gloss, model, self.job.progress)
        })?;
        let Some(glossy) = glossy.as_ref() else { return Ok(Vec::new()) };
        self.job.note("glossy_places", glossy.places());
        self.job.note("glossy_rays", glossy.rays);
        self.job.note("glossy_entries", glossy.rows.entries().len());
        let lanes = GlossyLanes::new(glossy, key);
        let [facing, grazing] =
            lanes.lanes().map(|lane| between.arriving(&lane, leaving, Some(gains)).map(|arriving| arriving.light));
        let (facing, grazing) = (facing?, grazing?);
        let samples = &self.transfer.samples.points;
        let mut reflection = vec![[0.0; 4]; samples.len()];
        for ((&sample, facing), grazing) in glossy.samples.iter().zip(facing).zip(grazing) {
            let [r, g, b, _] = gloss[samples[sample as usize].material as usize];
            let light = Vec4::new(r, g, b, 0.0) * Vec4::from_array(facing) + Vec4::from_array(grazing);
            reflection[sample as usize] = light.to_array();
        }
        Ok(reflection)
    }

    fn stage(&self) -> lighting::Stage<'_> {
        let Job { device, memo, progress, .. } = *self.job;
        lighting::Stage { device, memo, progress, geometry: self.geometry, transfer: self.transfer, place: self.place }
    }

    fn reflectance(&self, what: &[u8], points: &[SurfacePoint], at: &[[f32; 2]]) -> Result<Arc<Vec<[f32; 4]>>> {
        let key = Key::of(&[b"reflectance", what, &self.place.0, &self.stuff.0]);
        self.job.memo(
            key,
            |r: &Vec<_>| VEC4 * r.len() as u64,
            || Ok(reflectance(self.geometry, self.materials, points, at)),
        )
    }

    fn light_key(&self, source: &Source) -> Key {
        let record = bytemuck::bytes_of(&source.record);
        Key::of(&[record, bytemuck::cast_slice(&source.emitters), &self.light_samples.to_le_bytes()])
    }

    /// Light of one source at view or gather samples.
    fn lit(&self, what: &[u8], points: &Array<SurfacePoint>, source: &Source, view: Option<&View>) -> Result<Arc<Lit>> {
        let gloss: &[u8] = if view.is_some() { &self.stuff.0 } else { b"" };
        let key = Key::of(&[b"light", what, &self.place.0, &self.light_key(source).0, gloss]);
        let bytes = |lit: &Lit| VEC4 * (lit.irradiance.len() + lit.highlight.len()) as u64;
        self.job.memo(key, bytes, || {
            let emitters = source.emitters.clone().into();
            direct_light(self.job.device, self.geometry, points, &source.record, &emitters, self.light_samples, view)
        })
    }
}

/// The light of all sources at N samples.
fn total(count: usize, lit: &[Arc<Lit>], part: impl Fn(&Lit) -> &Vec<[f32; 4]>) -> Vec<[f32; 4]> {
    sum(count, &lit.iter().map(|lit| &part(lit)[..]).collect::<Vec<_>>())
}
