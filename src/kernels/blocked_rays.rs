//! Whether anything lies on the way of rays: R rays, and of each 1 when a surface is met before `t_max`, else 0. A ray with
//! `t_max` of 0 counts as blocked.

use super::RAY_SHADERS;
use super::trace_rays::RayRecord;
#[cfg(feature = "gpu")]
use super::{RAYS, fits_the_shader, pages};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::scene::Geometry;
use crate::scene::bvh::{Facet, Node};
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
    name: "blocked_rays",
    shared: RAY_SHADERS,
    source: include_str!("../../shaders/blocked_rays.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Node>("nodes"),
        Binding::read::<Facet>("facets"),
        Binding::read::<RayRecord>("rays"),
        Binding::write::<u32>("blocked"),
    ],
};

pub fn blocked_rays(device: &Device, geometry: &Geometry, rays: &[RayRecord]) -> Result<Vec<u32>> {
    match device {
        Device::Cpu => Ok(cpu(geometry, rays)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, geometry, rays),
    }
}

fn cpu(geometry: &Geometry, rays: &[RayRecord]) -> Vec<u32> {
    let blocked = |ray: &RayRecord| u32::from(ray.t_max <= 0.0 || geometry.bvh.any(&ray.ray()));
    rays.par_iter().with_min_len(256).map(blocked).collect()
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, geometry: &Geometry, rays: &[RayRecord]) -> Result<Vec<u32>> {
    fits_the_shader(geometry)?;
    let mut found = Vec::with_capacity(rays.len());
    for range in pages(rays.len(), gpu.page(size_of::<RayRecord>()).min(RAYS)) {
        let params = Params { rays: range.len() as u32, pad0: 0, pad1: 0, pad2: 0 };
        let blocked = gpu.storage::<u32>(range.len());
        let buffers = [
            &gpu.whole(&geometry.bvh.nodes),
            &gpu.whole(&geometry.bvh.facets),
            &gpu.upload(&rays[range.clone()]),
            &blocked,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(64))?;
        let [blocked] = batch.read([&blocked])?;
        found.extend_from_slice(blocked.get::<u32>());
    }
    Ok(found)
}
