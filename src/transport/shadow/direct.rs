//! What an environment would do to samples if nothing cast a shadow (thesis 6.3: all of the integral but visibility).
//!
//! Surfaces are diffuse, so no sample needs a row of its own: `L = reflectance / pi (n . sum of E w d over what it sees)`,
//! and `E w d` is the same for all (`tables`).

use crate::device::Array;
use crate::scene::{Environment, Material, SurfacePoint};
use crate::transport::Samples;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub struct DirectTransport {
    pub environment: Arc<Environment>,
    pub samples: Arc<Samples>,
    /// Diffuse reflectance of the samples, RGB and a 1 where there is a surface.
    pub reflectance: Array<[f32; 4]>,
    /// Radiance that the samples' surfaces emit, RGB; empty when none does.
    pub emission: Array<[f32; 4]>,
}

impl DirectTransport {
    pub fn bytes(&self) -> u64 {
        self.environment.bytes() + 16 * (self.reflectance.len() + self.emission.len()) as u64
    }
}

/// How many points lie on surfaces that reflect more than diffuse light.
pub fn glossy(materials: &[Material], points: &[SurfacePoint]) -> usize {
    let polished: Vec<bool> = materials.iter().map(|found| found.gloss()[..3].iter().any(|x| *x > 0.0)).collect();
    points.iter().filter(|point| polished.get(point.material as usize) == Some(&true)).count()
}

/// What surfaces at points emit; empty when none of the materials there emits anything.
pub fn emission(materials: &[Material], points: &[SurfacePoint]) -> Vec<[f32; 4]> {
    let of = |point: &SurfacePoint| materials.get(point.material as usize).map_or([0.0; 3], |found| found.emission);
    let with_alpha = |point: &SurfacePoint| {
        let [r, g, b] = of(point);
        [r, g, b, 0.0]
    };
    match points.iter().any(|point| of(point) != [0.0; 3]) {
        true => points.iter().map(with_alpha).collect(),
        false => Vec::new(),
    }
}
