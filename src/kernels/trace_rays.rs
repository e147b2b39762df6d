//! What rays meet: the nearest surface point on the side that each ray comes from, as the surface is there.
//!
//! For rays that were made elsewhere: of final gathering, of reflections. Input: R rays; output: R `SurfacePoint`s
//! (`NOWHERE` where a ray leaves the scene), barycentrics of the hits for textures, and distances in lengths of the
//! direction (3e38 for none). A ray with `t_max` of 0 meets nothing.

use super::SURFACE_SHADERS;
#[cfg(feature = "gpu")]
use super::{RAYS, fits_the_shader, pages};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::scene::bvh::{Facet, Node, Ray};
use crate::scene::{Geometry, SurfacePoint};
use rayon::prelude::*;

uniform! {
    struct Params {
        /// Of this page.
        rays: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "trace_rays",
    shared: SURFACE_SHADERS,
    source: include_str!("../../shaders/trace_rays.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Node>("nodes"),
        Binding::read::<Facet>("facets"),
        Binding::read::<f32>("corners"),
        Binding::read::<f32>("normals"),
        Binding::read::<u32>("object"),
        Binding::read::<u32>("material"),
        Binding::read::<RayRecord>("rays"),
        Binding::write::<SurfacePoint>("points"),
        Binding::write::<[f32; 4]>("hits"),
    ],
};

/// A ray as kernels see it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct RayRecord {
    pub origin: [f32; 3],
    /// At most `FAR`; what lies farther is not met.
    pub t_max: f32,
    /// Need not be unit.
    pub direction: [f32; 3],
    /// What lies nearer, or as near, is not met.
    pub t_min: f32,
}

/// Stands for infinity, which WGSL does not have.
pub const FAR: f32 = 3e38;

impl RayRecord {
    /// Meets nothing.
    pub const NONE: Self = Self { origin: [0.0; 3], t_max: 0.0, direction: [0.0; 3], t_min: 0.0 };

    pub fn new(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.to_array(),
            t_max: ray.t_max.min(FAR),
            direction: ray.direction.to_array(),
            t_min: 0.0,
        }
    }

    pub fn ray(&self) -> Ray {
        Ray { origin: self.origin.into(), direction: self.direction.into(), t_max: self.t_max }
    }
}

/// R of each.
pub struct Traced {
    pub points: Vec<SurfacePoint>,
    /// Weights of the second and third corner.
    pub barycentrics: Vec<[f32; 2]>,
    /// `FAR` for none.
    pub distances: Vec<f32>,
}

pub fn trace_rays(device: &Device, geometry: &Geometry, rays: &[RayRecord]) -> Result<Traced> {
    match device {
        Device::Cpu => Ok(cpu(geometry, rays)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, geometry, rays),
    }
}

fn cpu(geometry: &Geometry, rays: &[RayRecord]) -> Traced {
    let mut points = vec![SurfacePoint::NOWHERE; rays.len()];
    let mut barycentrics = vec![[0.0; 2]; rays.len()];
    let mut distances = vec![FAR; rays.len()];
    const TILE: usize = 256;
    let out = points.par_chunks_mut(TILE).zip(barycentrics.par_chunks_mut(TILE)).zip(distances.par_chunks_mut(TILE));
    out.zip(rays.par_chunks(TILE)).for_each(|(((points, barycentrics), distances), rays)| {
        for (i, ray) in rays.iter().enumerate().filter(|(_, ray)| ray.t_max > 0.0) {
            let hit = geometry.bvh.closest_beyond(&ray.ray(), ray.t_min);
            if hit.triangle != SurfacePoint::NOWHERE.triangle {
                points[i] = geometry.surface_point(hit.triangle as usize, hit.u, hit.v, hit.front);
                barycentrics[i] = [hit.u, hit.v];
                distances[i] = hit.t;
            }
        }
    });
    Traced { points, barycentrics, distances }
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, geometry: &Geometry, rays: &[RayRecord]) -> Result<Traced> {
    fits_the_shader(geometry)?;
    let count = rays.len();
    let mut traced = Traced {
        points: Vec::with_capacity(count),
        barycentrics: Vec::with_capacity(count),
        distances: Vec::with_capacity(count),
    };
    for range in pages(count, gpu.page(size_of::<SurfacePoint>()).min(RAYS)) {
        let params = Params { rays: range.len() as u32, pad0: 0, pad1: 0, pad2: 0 };
        let points = gpu.storage::<SurfacePoint>(range.len());
        let hits = gpu.storage::<[f32; 4]>(range.len());
        let buffers = [
            &gpu.whole(&geometry.bvh.nodes),
            &gpu.whole(&geometry.bvh.facets),
            &gpu.whole(&geometry.corners),
            &gpu.whole(&geometry.normals),
            &gpu.whole(&geometry.object),
            &gpu.whole(&geometry.material),
            &gpu.upload(&rays[range.clone()]),
            &points,
            &hits,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(64))?;
        let [points, hits] = batch.read([&points, &hits])?;
        traced.points.extend_from_slice(points.get());
        for [u, v, t, _] in hits.get::<[f32; 4]>() {
            traced.barycentrics.push([*u, *v]);
            traced.distances.push(*t);
        }
    }
    Ok(traced)
}
