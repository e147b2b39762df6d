//! The light sources of a scene at the view and gather samples of a transfer. Light is kept by source: when one lamp
//! moves, only its own light is computed again.

use super::{Stage, VEC4, sum};
use crate::device::Array;
use crate::kernels::direct_light::{Lit, View, direct_light};
use crate::memo::Key;
use crate::scene::light::{Source, surfaces};
use crate::scene::{Light, Material, SurfacePoint};
use crate::transport::samples::reflectance;
use crate::{Error, Result, memory};
use std::sync::Arc;

pub struct SceneLight<'a> {
    pub stage: &'a Stage<'a>,
    pub materials: &'a [Material],
    /// Names the materials.
    pub stuff: Key,
    /// `Material::gloss` of each.
    pub gloss: Array<[f32; 4]>,
    sources: Vec<Source>,
    /// Shadow rays towards surfaces and rectangles that emit.
    light_samples: u32,
}

/// Light of all sources at N samples, W/m² and W/(sr m²); `highlight` is empty where nothing shines.
pub struct Direct {
    pub irradiance: Vec<[f32; 4]>,
    pub highlight: Vec<[f32; 4]>,
}

impl<'a> SceneLight<'a> {
    /// # Errors
    /// A scene without light; materials that are not the geometry's; too little memory.
    pub fn new(
        stage: &'a Stage<'a>,
        materials: &'a [Material],
        stuff: Key,
        lights: &[Light],
        light_samples: u32,
    ) -> Result<Self> {
        let (geometry, transfer) = (stage.geometry, stage.transfer);
        if geometry.material_names.len() != materials.len() {
            let message =
                format!("{} materials for geometry that names {}", materials.len(), geometry.material_names.len());
            return Err(Error::compute(message, "connect the same scene to the transfer and to this node"));
        }
        let sources: Vec<Source> = lights.iter().map(Light::source).chain(surfaces(geometry, materials)).collect();
        if sources.is_empty() {
            let help = "add a light node and connect it to the scene, or give a material emission";
            return Err(Error::compute("the scene has no light: no lamp, and no surface that emits", help));
        }
        // Of each source at view and gather samples, twice where it shines; and about eight layers.
        let samples = transfer.samples.points.len() + transfer.gather.count();
        let bytes = VEC4 * (2 * sources.len() as u64 + 8) * samples as u64;
        memory::require(bytes, "light at view and gather samples", "lower width, height or samples_per_pixel")?;
        let gloss = materials.iter().map(Material::gloss).collect::<Vec<_>>().into();
        Ok(Self { stage, materials, stuff, gloss, sources, light_samples })
    }

    pub fn sources(&self) -> usize {
        self.sources.len()
    }

    /// Names the light that leaves the gather samples before any edit.
    pub fn key(&self) -> Key {
        let keys: Vec<[u8; 16]> = self.sources.iter().map(|source| self.light_key(source).0).collect();
        Key::of(&[&self.stage.place.0, &self.stuff.0, bytemuck::cast_slice(&keys)])
    }

    /// Light at the view samples, highlights included.
    pub fn at_view(&self) -> Result<Direct> {
        let samples = &self.stage.transfer.samples;
        let shines = self.gloss.iter().any(|gloss| gloss[..3].iter().any(|&f0| f0 > 0.0));
        let view = View { eye: samples.camera.position, gloss: &self.gloss };
        let lit = self.each(b"view", &samples.points, shines.then_some(&view))?;
        let highlight = match shines {
            true => sum(samples.points.len(), &lit.iter().map(|lit| &lit.highlight[..]).collect::<Vec<_>>()),
            false => Vec::new(),
        };
        Ok(Direct { irradiance: irradiance(samples.points.len(), &lit), highlight })
    }

    /// Irradiance at the gather samples.
    pub fn at_gather(&self) -> Result<Vec<[f32; 4]>> {
        let points = &self.stage.transfer.gather.points;
        Ok(irradiance(points.len(), &self.each(b"gather", points, None)?))
    }

    /// Diffuse reflectance of the view samples.
    pub fn view_reflectance(&self) -> Result<Arc<Vec<[f32; 4]>>> {
        let samples = &self.stage.transfer.samples;
        self.reflectance(b"view", &samples.points, &samples.barycentrics)
    }

    /// Diffuse reflectance of the gather samples.
    pub fn gather_reflectance(&self) -> Result<Arc<Vec<[f32; 4]>>> {
        let gather = &self.stage.transfer.gather;
        self.reflectance(b"gather", &gather.points, &gather.barycentrics)
    }

    fn reflectance(&self, what: &[u8], points: &[SurfacePoint], at: &[[f32; 2]]) -> Result<Arc<Vec<[f32; 4]>>> {
        let key = Key::of(&[b"reflectance", what, &self.stage.place.0, &self.stuff.0]);
        let bytes = |r: &Vec<[f32; 4]>| VEC4 * r.len() as u64;
        self.stage.memo.remember(key, bytes, || Ok(reflectance(self.stage.geometry, self.materials, points, at)))
    }

    fn light_key(&self, source: &Source) -> Key {
        let record = bytemuck::bytes_of(&source.record);
        Key::of(&[record, bytemuck::cast_slice(&source.emitters), &self.light_samples.to_le_bytes()])
    }

    fn each(&self, what: &[u8], points: &Array<SurfacePoint>, view: Option<&View>) -> Result<Vec<Arc<Lit>>> {
        let progress = self.stage.progress.stage("lights", self.sources.len() as u64);
        let gloss: &[u8] = if view.is_some() { &self.stuff.0 } else { b"" };
        let lit = |source: &Source| {
            let key = Key::of(&[b"light", what, &self.stage.place.0, &self.light_key(source).0, gloss]);
            let bytes = |lit: &Lit| VEC4 * (lit.irradiance.len() + lit.highlight.len()) as u64;
            let lit = self.stage.memo.remember(key, bytes, || {
                let (record, emitters) = (&source.record, source.emitters.clone().into());
                let Stage { device, geometry, .. } = *self.stage;
                direct_light(device, geometry, points, record, &emitters, self.light_samples, view)
            });
            progress.advance(1)?;
            lit
        };
        self.sources.iter().map(lit).collect()
    }
}

fn irradiance(count: usize, lit: &[Arc<Lit>]) -> Vec<[f32; 4]> {
    sum(count, &lit.iter().map(|lit| &lit.irradiance[..]).collect::<Vec<_>>())
}
