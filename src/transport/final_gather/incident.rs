//! Light that leaves what rays meet: direct light found there, light of later bounces as it is known, source edits.

use super::bounces::Bounces;
use super::photons::luminance;
use super::source::SourceEdits;
use crate::Result;
use crate::device::{Array, Device};
use crate::kernels::direct_light::direct_light;
use crate::scene::light::{EMITTERS, Source, surfaces};
use crate::scene::{Geometry, Light, Material, SurfacePoint};
use crate::transport::samples::reflectance;
use crate::transport::sampling;
use glam::Vec4;
use rayon::prelude::*;

/// The lights and materials of a scene, and what changes the light of its surfaces.
pub struct Incident<'a> {
    pub device: &'a Device,
    pub geometry: &'a Geometry,
    pub materials: &'a [Material],
    pub source: SourceEdits,
    /// Light of later bounces; `None` where there is one.
    pub bounces: Option<Bounces>,
    sources: Vec<Source>,
}

/// Light that leaves N places, W/m².
pub struct Leaving {
    /// What lamps light at once; the fourth element is the luminance of their irradiance.
    pub from_lamps: Vec<Vec4>,
    /// All other light.
    pub from_others: Vec<Vec4>,
}

/// Shadow rays from a hit towards surfaces and rectangles that emit: other hits of the same place take others.
const SHADOW_RAYS: u32 = 1;

impl<'a> Incident<'a> {
    pub fn new(
        device: &'a Device,
        geometry: &'a Geometry,
        materials: &'a [Material],
        lights: &[Light],
        source: SourceEdits,
    ) -> Self {
        let sources = lights.iter().map(Light::source).chain(surfaces(geometry, materials)).collect();
        Self { device, geometry, materials, source, bounces: None, sources }
    }

    pub fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// Diffuse reflectance of N places.
    pub fn reflectance(&self, points: &[SurfacePoint], barycentrics: &[[f32; 2]]) -> Vec<[f32; 4]> {
        reflectance(self.geometry, self.materials, points, barycentrics)
    }

    /// Light that leaves N places: of all bounces, with the brushes there. `seed`: another one for every call.
    pub fn light(&self, points: Vec<SurfacePoint>, barycentrics: &[[f32; 2]], seed: u32) -> Result<Leaving> {
        let more = self.bounces.as_ref().map(|bounces| {
            let reflectance = self.reflectance(&points, barycentrics);
            let each = points.par_iter().zip(barycentrics).zip(reflectance).with_min_len(4096);
            let light = |((point, at), reflectance): ((&SurfacePoint, &[f32; 2]), [f32; 4])| {
                (bounces.at(self.geometry, point, *at) * Vec4::from_array(reflectance)).with_w(0.0)
            };
            each.map(light).collect::<Vec<Vec4>>()
        });
        let change = self.source.at(&points);
        let mut leaving = self.direct(points, barycentrics, seed)?;
        if let Some(more) = more {
            leaving.from_others.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
        for (i, (scale, offset)) in change.scale.iter().zip(&change.offset).enumerate() {
            let bright = leaving.from_lamps[i].w;
            leaving.from_lamps[i] = (leaving.from_lamps[i] * *scale).with_w(bright);
            leaving.from_others[i] = leaving.from_others[i] * *scale + offset.extend(0.0);
        }
        Ok(leaving)
    }

    /// Direct light that leaves N places, without edits.
    pub fn direct(&self, points: Vec<SurfacePoint>, barycentrics: &[[f32; 2]], seed: u32) -> Result<Leaving> {
        let reflectance = self.reflectance(&points, barycentrics);
        let points: Array<SurfacePoint> = points.into();
        let [mut from_lamps, mut from_others] = [0, 1].map(|_| vec![Vec4::ZERO; points.len()]);
        for source in &self.sources {
            let mut record = source.record;
            record.seed ^= sampling::hash(seed);
            let emitters = source.emitters.clone().into();
            let lit = direct_light(self.device, self.geometry, &points, &record, &emitters, SHADOW_RAYS, None)?;
            let sum = if record.kind == EMITTERS { &mut from_others } else { &mut from_lamps };
            let add = |(sum, more): (&mut Vec4, &[f32; 4])| *sum += Vec4::from_array(*more);
            sum.par_iter_mut().zip(&lit.irradiance).with_min_len(4096).for_each(add);
        }
        let reflect = |((lamps, others), reflectance): ((&mut Vec4, &mut Vec4), &[f32; 4])| {
            let (bright, reflectance) = (luminance(*lamps), Vec4::from_array(*reflectance));
            *lamps *= reflectance;
            lamps.w = bright;
            *others *= reflectance;
            others.w = 0.0;
        };
        let both = from_lamps.par_iter_mut().zip(&mut from_others);
        both.zip(&reflectance).with_min_len(4096).for_each(reflect);
        Ok(Leaving { from_lamps, from_others })
    }
}
