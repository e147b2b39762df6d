//! What each view sample sees: one camera ray, the nearest surface, and the point there on the side that is seen.
//!
//! `samples_per_pixel` rays a pixel pass through fixed offsets of the pixel's square (`offsets`, each in [0, 1)²).
//! Output: W x H x samples `SurfacePoint`s, row-major, samples of a pixel together; `NOWHERE` where the ray leaves.
//! Beside each: barycentrics of the hit, for textures.

use super::SURFACE_SHADERS;
#[cfg(feature = "gpu")]
use super::{RAYS, fits_the_shader, pages};
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::scene::bvh::{Facet, Node, Ray};
use crate::scene::{Camera, Geometry, SurfacePoint};
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;

uniform! {
    struct Params {
        position: [f32; 3],
        width: u32,
        /// Camera axes scaled so that `right * x + up * y - back` with x, y in [-1, 1] spans the picture.
        right: [f32; 3],
        height: u32,
        up: [f32; 3],
        samples: u32,
        back: [f32; 3],
        /// Number of a page's first sample, and how many samples it has.
        first: u32,
        count: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "primary_visibility",
    shared: SURFACE_SHADERS,
    source: include_str!("../../shaders/primary_visibility.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Node>("nodes"),
        Binding::read::<Facet>("facets"),
        Binding::read::<f32>("corners"),
        Binding::read::<f32>("normals"),
        Binding::read::<u32>("object"),
        Binding::read::<u32>("material"),
        Binding::read::<[f32; 2]>("offsets"),
        Binding::write::<SurfacePoint>("points"),
        Binding::write::<[f32; 2]>("barycentrics"),
    ],
};

impl Params {
    fn new(camera: &Camera, width: u32, height: u32, samples: u32) -> Self {
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
            first: 0,
            count: width * height * samples,
            pad0: 0,
            pad1: 0,
            pad2: 0,
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
    let params = Params::new(camera, size.0, size.1, offsets.len() as u32);
    match device {
        Device::Cpu => Ok(cpu(geometry, &params, offsets)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, geometry, &params, offsets),
    }
}

fn cpu(geometry: &Geometry, params: &Params, offsets: &[[f32; 2]]) -> Visible {
    let samples = offsets.len();
    let count = params.width as usize * params.height as usize * samples;
    let mut points = vec![SurfacePoint::NOWHERE; count];
    let mut barycentrics = vec![[0.0; 2]; count];
    let row = params.width as usize * samples;
    let rows = points.par_chunks_mut(row).zip(barycentrics.par_chunks_mut(row)).enumerate();
    rows.for_each(|(y, (points, barycentrics))| {
        for i in 0..row {
            let offset = offsets[i % samples];
            let ray = params.ray((i / samples) as f32 + offset[0], y as f32 + offset[1]);
            let hit = geometry.bvh.closest(&ray);
            if hit.triangle != SurfacePoint::NOWHERE.triangle {
                points[i] = geometry.surface_point(hit.triangle as usize, hit.u, hit.v, hit.front);
                barycentrics[i] = [hit.u, hit.v];
            }
        }
    });
    Visible { points, barycentrics }
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, geometry: &Geometry, params: &Params, offsets: &[[f32; 2]]) -> Result<Visible> {
    fits_the_shader(geometry)?;
    let count = params.count as usize;
    let mut visible = Visible { points: Vec::with_capacity(count), barycentrics: Vec::with_capacity(count) };
    let offsets = gpu.upload(offsets);
    for range in pages(count, gpu.page(size_of::<SurfacePoint>()).min(RAYS)) {
        let params = Params { first: range.start as u32, count: range.len() as u32, ..*params };
        let points = gpu.storage::<SurfacePoint>(range.len());
        let barycentrics = gpu.storage::<[f32; 2]>(range.len());
        let buffers = [
            &gpu.whole(&geometry.bvh.nodes),
            &gpu.whole(&geometry.bvh.facets),
            &gpu.whole(&geometry.corners),
            &gpu.whole(&geometry.normals),
            &gpu.whole(&geometry.object),
            &gpu.whole(&geometry.material),
            &offsets,
            &points,
            &barycentrics,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(64))?;
        let [points, barycentrics] = batch.read([&points, &barycentrics])?;
        visible.points.extend_from_slice(points.get());
        visible.barycentrics.extend_from_slice(barycentrics.get());
    }
    Ok(visible)
}
