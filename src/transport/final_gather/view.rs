//! What the camera sees, pass by pass: one sample of each pixel, its direct light, and what goes on film.

use super::crossing::Crossing;
use super::eye::at_eye;
use super::film::Film;
use super::incident::Incident;
use crate::Result;
use crate::device::Array;
use crate::kernels::direct_light::{View, direct_light};
use crate::scene::{Camera, Material, SurfacePoint};
use crate::transport::lighting::{Shading, sum};
use crate::transport::samples::reflectance;
use crate::transport::sampling;
use crate::transport::{Edits, Samples};
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// A camera, and what lies in front of it.
pub struct Seen<'a> {
    pub camera: &'a Camera,
    /// Pixels across and down.
    pub size: (u32, u32),
    pub materials: &'a [Material],
    /// `Material::gloss` of each.
    pub gloss: Array<[f32; 4]>,
    /// For those that act on the way to the camera.
    pub edits: &'a Edits,
    /// Shadow rays of a pass towards surfaces and rectangles that emit.
    pub light_samples: u32,
}

/// One sample of each pixel.
pub struct Pass {
    pub samples: Samples,
    /// Those that shine, `NOWHERE` for the others; empty where nothing shines.
    pub shining: Vec<SurfacePoint>,
    /// `Crossing::weights` of the samples.
    pub receivers: Vec<f32>,
    pub reflectance: Vec<[f32; 4]>,
    /// Radiance over irradiance, of diffuse reflection.
    pub diffuse: Vec<[f32; 4]>,
    /// Straight from lights, W/m².
    pub irradiance: Vec<[f32; 4]>,
    /// W/(sr m²); empty where nothing shines.
    pub highlight: Vec<[f32; 4]>,
}

/// Where the samples of a pass lie in their pixels: the first in the middle, any number of them spread evenly (Roberts
/// 2018).
fn offset(pass: usize) -> [f32; 2] {
    [0.754_877_666_246_692_8_f64, 0.569_840_290_998_053_3].map(|step| (0.5 + step * pass as f64).fract() as f32)
}

fn shines(gloss: &[f32; 4]) -> bool {
    gloss[..3].iter().any(|f0| *f0 > 0.0)
}

impl Seen<'_> {
    pub fn pass(&self, incident: &Incident, crossing: &Crossing, number: usize) -> Result<Pass> {
        let Incident { device, geometry, materials, .. } = *incident;
        let samples = Samples::through(device, geometry, self.camera, self.size, &[offset(number)])?;
        let shines = self.shines();
        let eye = View { eye: self.camera.position, gloss: &self.gloss };
        let (mut irradiance, mut highlight) = (Vec::new(), Vec::new());
        for source in incident.sources() {
            let mut record = source.record;
            record.seed ^= sampling::hash(number as u32);
            let emitters = source.emitters.clone().into();
            let view = shines.then_some(&eye);
            let points = &samples.points;
            let lit = direct_light(device, geometry, points, &record, &emitters, self.light_samples, view)?;
            irradiance.push(lit.irradiance);
            highlight.push(lit.highlight);
        }
        let count = samples.points.len();
        let all = |parts: Vec<Vec<[f32; 4]>>| sum(count, &parts.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let reflectance = reflectance(geometry, materials, &samples.points, &samples.barycentrics);
        let highlight = if shines { all(highlight) } else { Vec::new() };
        let receivers = crossing.weights(&samples.points);
        let diffuse = reflectance.iter().map(|r| r.map(|r| r * FRAC_1_PI)).collect();
        let shining = match shines {
            true => samples.points.par_iter().with_min_len(4096).map(|point| self.shining(point)).collect(),
            false => Vec::new(),
        };
        Ok(Pass { samples, shining, receivers, reflectance, diffuse, irradiance: all(irradiance), highlight })
    }

    /// Some material shines.
    pub fn shines(&self) -> bool {
        self.gloss.iter().any(shines)
    }

    fn shining(&self, point: &SurfacePoint) -> SurfacePoint {
        let is_shining = point.exists() && shines(&self.gloss[point.material as usize]);
        if is_shining { *point } else { SurfacePoint::NOWHERE }
    }

    /// Adds a pass to a film; `radiance`: indirect, of its samples, W/(sr m²).
    pub fn expose(&self, film: &mut Film, pass: &Pass, crossing: &Crossing, mut radiance: Vec<[f32; 4]>) {
        at_eye(self.edits, crossing.sampled.as_ref(), &pass.samples.points, &mut radiance);
        let emission = |i: usize| match pass.samples.points[i] {
            point if point.exists() => Vec3::from(self.materials[point.material as usize].emission),
            _ => Vec3::ZERO,
        };
        let shading = Shading {
            samples: &pass.samples,
            reflectance: &pass.reflectance,
            direct: &pass.irradiance,
            indirect: &radiance,
            highlight: &pass.highlight,
            emission: &emission,
        };
        film.add(&pass.samples, &shading);
    }
}
