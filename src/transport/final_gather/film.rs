//! Sums of what the passes over a picture see, and the layers that they make.

use crate::image::Layer;
use crate::scene::Camera;
use crate::transport::Samples;
use crate::transport::lighting::{Shading, light_layers, place_layers, resolved_surface};
use glam::Vec4;
use rayon::prelude::*;

/// Pixels that one task works on.
const TILE: usize = 4096;

#[derive(Clone, Debug)]
pub struct Film {
    camera: Camera,
    passes: usize,
    /// Direct and indirect radiance; the fourth element of direct light is coverage.
    light: [Vec<Vec4>; 2],
    /// Reflectance, position, normal.
    surface: [Vec<Vec4>; 3],
}

impl Film {
    pub fn new(camera: &Camera, pixels: usize) -> Self {
        let dark = || vec![Vec4::ZERO; pixels];
        Self { camera: camera.clone(), passes: 0, light: [dark(), dark()], surface: [dark(), dark(), dark()] }
    }

    /// Bytes of a pixel: the sums, one pass, and the layers.
    pub const BYTES: u64 = 5 * 16 + 4 * 16 + 5 * 16 + 4 * 21;

    pub fn passes(&self) -> usize {
        self.passes
    }

    /// One more pass; `samples` has one of each pixel.
    pub fn add(&mut self, samples: &Samples, shading: &Shading) {
        let add = |sum: &mut [Vec<Vec4>], more: &[Vec<Vec4>]| {
            sum.iter_mut().zip(more).for_each(|(sum, more)| {
                let add = |(sum, more): (&mut Vec4, &Vec4)| *sum += *more;
                sum.par_iter_mut().zip(more).with_min_len(TILE).for_each(add);
            });
        };
        add(&mut self.light, &shading.resolved());
        add(&mut self.surface, &resolved_surface(samples, shading.reflectance));
        self.passes += 1;
    }

    /// Layers of the mean of all passes.
    pub fn layers(&self) -> Vec<Layer> {
        let share = 1.0 / self.passes.max(1) as f32;
        let mean = |sum: &Vec<Vec4>| sum.par_iter().with_min_len(TILE).map(|sum| *sum * share).collect::<Vec<_>>();
        let mut layers = light_layers(&[mean(&self.light[0]), mean(&self.light[1])]);
        layers.extend(place_layers(&self.camera, &self.surface.each_ref().map(mean)));
        layers
    }
}
