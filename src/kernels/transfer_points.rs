//! Transfer rows point to point, as the thesis evaluates them (eq. 5.1): the weight of gather sample g in the row of v is
//!
//! ```text
//! T(v, g) = cos_v cos_g / (pi r^2) * area * V(v, g),    at most 1
//! ```
//!
//! with one shadow ray for V, so that the irradiance at v is `sum_g B(g) T(v, g)`. In corners r goes to zero and the
//! estimate blows up; a form factor is never above 1, which bounds it. Kept for comparison: `transfer_rows` needs fewer
//! rays and has no singularity.
//! Output: rows x samples weights, and per row the harmonic mean of the distances, by weight, and the least.

use super::RAY_SHADERS;
#[cfg(feature = "gpu")]
use super::{RAYS, fits_the_shader, pages};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::scene::bvh::{Facet, Node, Ray};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::gather::Gather;
use crate::transport::sampling;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

uniform! {
    struct Params {
        rows: u32,
        /// Gather samples.
        gather: u32,
        /// Square metres a sample.
        area: f32,
        lift: f32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "transfer_points",
    shared: RAY_SHADERS,
    source: include_str!("../../shaders/transfer_points.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Node>("nodes"),
        Binding::read::<Facet>("facets"),
        Binding::read::<SurfacePoint>("points"),
        Binding::read::<SurfacePoint>("samples"),
        Binding::write::<f32>("weights"),
    ],
};

pub struct RowPoints {
    /// Rows x samples.
    pub weights: Vec<f32>,
    /// Per row: harmonic mean distance by weight, and least distance, metres; infinite where nothing is seen.
    pub distances: Vec<[f32; 2]>,
}

pub fn transfer_points(
    device: &Device,
    geometry: &Geometry,
    gather: &Gather,
    points: &Array<SurfacePoint>,
) -> Result<RowPoints> {
    let params =
        Params { rows: points.len() as u32, gather: gather.count() as u32, area: gather.area, lift: geometry.lift() };
    let weights = match device {
        Device::Cpu => cpu(geometry, gather, points, &params),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, geometry, gather, points, &params)?,
    };
    let rows = points.par_iter().zip(weights.par_chunks(gather.count()));
    let distances = rows.map(|(point, weights)| distances(point, &gather.points, weights)).collect();
    Ok(RowPoints { weights, distances })
}

fn cpu(geometry: &Geometry, gather: &Gather, points: &[SurfacePoint], params: &Params) -> Vec<f32> {
    let mut weights = vec![0.0; points.len() * gather.count()];
    weights.par_chunks_mut(gather.count()).zip(points).for_each(|(weights, point)| {
        for (weight, sample) in weights.iter_mut().zip(&gather.points) {
            *weight = connect(geometry, point, sample, params);
        }
    });
    weights
}

fn connect(geometry: &Geometry, point: &SurfacePoint, sample: &SurfacePoint, params: &Params) -> f32 {
    if !point.exists() {
        return 0.0;
    }
    let lifted = |p: &SurfacePoint| sampling::lifted(p.position.into(), p.geometric_normal.into(), params.lift);
    let (from, to) = (lifted(point), lifted(sample));
    let between = to - from;
    let r2 = between.length_squared();
    let cos_v = between.dot(point.normal.into());
    let cos_g = -between.dot(sample.geometric_normal.into());
    if cos_v <= 0.0 || cos_g <= 0.0 || between.dot(point.geometric_normal.into()) <= 0.0 {
        return 0.0;
    }
    if geometry.bvh.any(&Ray { origin: from, direction: between, t_max: 1.0 }) {
        return 0.0;
    }
    // The cosines are still multiplied by r each.
    (cos_v * cos_g / (r2 * r2) * FRAC_1_PI * params.area).min(1.0)
}

#[cfg(feature = "gpu")]
fn gpu(
    gpu: &Gpu,
    geometry: &Geometry,
    gather: &Gather,
    points: &Array<SurfacePoint>,
    params: &Params,
) -> Result<Vec<f32>> {
    fits_the_shader(geometry)?;
    let mut found = Vec::with_capacity(points.len() * gather.count());
    for range in pages(points.len(), gpu.page(4 * gather.count()).min((RAYS / gather.count()).max(1))) {
        let params = Params { rows: range.len() as u32, ..*params };
        let weights = gpu.storage::<f32>(range.len() * gather.count());
        let buffers = [
            &gpu.whole(&geometry.bvh.nodes),
            &gpu.whole(&geometry.bvh.facets),
            &gpu.upload(&points[range.clone()]),
            &gpu.whole(&gather.points),
            &weights,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, (range.len() * gather.count()).div_ceil(64))?;
        let [page] = batch.read([&weights])?;
        found.extend_from_slice(page.get());
    }
    Ok(found)
}

fn distances(point: &SurfacePoint, samples: &[SurfacePoint], weights: &[f32]) -> [f32; 2] {
    let (mut total, mut inverse, mut least) = (0.0, 0.0, f32::INFINITY);
    for (&weight, sample) in weights.iter().zip(samples).filter(|(weight, _)| **weight > 0.0) {
        let distance = (Vec3::from(sample.position) - Vec3::from(point.position)).length();
        total += weight;
        inverse += weight / distance;
        least = least.min(distance);
    }
    if total > 0.0 { [total / inverse, least] } else { [f32::INFINITY; 2] }
}
