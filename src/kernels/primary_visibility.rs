//! What each view sample sees: one camera ray, the nearest surface, and the point there on the side that is seen.
//!
//! `samples_per_pixel` rays a pixel pass through fixed offsets of the pixel's square (`offsets`, each in [0, 1)²).
//! Output: W x H x samples `SurfacePoint`s, row-major, samples of a pixel together; `NOWHERE` where the ray leaves.
//! Beside each: barycentrics of the hit, for textures.

use crate::device::Device;
use crate::scene::bvh::Ray;
use crate::scene::{Camera, Geometry, SurfacePoint};
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;

#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Uniforms {
    pub position: [f32; 3],
    pub width: u32,
    /// Camera axes scaled so that `right * x + up * y - back` with x, y in [-1, 1] spans the picture.
    pub right: [f32; 3],
    pub height: u32,
    pub up: [f32; 3],
    pub samples: u32,
    pub back: [f32; 3],
    pub pad: u32,
}

impl Uniforms {
    pub fn new(camera: &Camera, width: u32, height: u32, samples: u32) -> Self {
        let half = (0.5 * camera.fov_y).tan();
        let axes = camera.world_from_camera;
        Self {
            position: camera.position.to_array(),
            width,
            right: (axes.x_axis * half * (width as f32 / height as f32)).to_array(),
            height,
            up: (axes.y_axis * half).to_array(),
            samples,
            back: axes.z_axis.to_array(),
            pad: 0,
        }
    }

    fn ray(&self, x: f32, y: f32) -> Ray {
        let sx = 2.0 * x / self.width as f32 - 1.0;
        let sy = 1.0 - 2.0 * y / self.height as f32;
        let direction = Vec3::from(self.right) * sx + Vec3::from(self.up) * sy - Vec3::from(self.back);
        Ray { origin: self.position.into(), direction, t_max: f32::INFINITY }
    }
}

pub struct Visible {
    pub points: Vec<SurfacePoint>,
    pub barycentrics: Vec<[f32; 2]>,
}

/// Fails when `offsets` is empty or the picture has no pixels.
pub fn primary_visibility(
    device: &Device,
    geometry: &Geometry,
    camera: &Camera,
    size: (u32, u32),
    offsets: &[[f32; 2]],
) -> Result<Visible> {
    if offsets.is_empty() || size.0 == 0 || size.1 == 0 {
        return Err(Error::compute("a picture needs pixels and samples", "set width, height and samples_per_pixel"));
    }
    let uniforms = Uniforms::new(camera, size.0, size.1, offsets.len() as u32);
    match device {
        _ => Ok(cpu(geometry, &uniforms, offsets)),
    }
}

fn cpu(geometry: &Geometry, uniforms: &Uniforms, offsets: &[[f32; 2]]) -> Visible {
    let samples = offsets.len();
    let count = uniforms.width as usize * uniforms.height as usize * samples;
    let mut points = vec![SurfacePoint::NOWHERE; count];
    let mut barycentrics = vec![[0.0; 2]; count];
    let row = uniforms.width as usize * samples;
    let rows = points.par_chunks_mut(row).zip(barycentrics.par_chunks_mut(row)).enumerate();
    rows.for_each(|(y, (points, barycentrics))| {
        for i in 0..row {
            let offset = offsets[i % samples];
            let ray = uniforms.ray((i / samples) as f32 + offset[0], y as f32 + offset[1]);
            let hit = geometry.bvh.closest(&ray);
            if hit.triangle != SurfacePoint::NOWHERE.triangle {
                points[i] = geometry.surface_point(hit.triangle as usize, hit.u, hit.v, hit.front);
                barycentrics[i] = [hit.u, hit.v];
            }
        }
    });
    Visible { points, barycentrics }
}
