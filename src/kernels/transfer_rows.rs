//! Rays of transfer rows: from each row's point, cosine-distributed rays, each credited to the node of the gather tree
//! that covers its hit.
//!
//! The irradiance at a row's point is `E = (1/rays) sum_r B(node_r)`, with `B` the mean radiant exitance of a node's
//! samples: `integral B(g)/pi V cos dw` with density `cos/pi` (thesis eq. 5.1 without the singular geometry term).
//! The node is the largest one above the hit's nearest sample whose radius squared is below `credit` times that of the
//! patch that one ray stands for, so that far and dim light costs few entries (DESIGN section 7).
//! Output: rows x rays node numbers (0: the ray met nothing that sends light), and per row the harmonic mean and the
//! least of the distances, which say how fast indirect light may change there (Ward et al. 1988).

use super::CREDIT_SHADERS;
use super::shared::credit;
pub use super::shared::credit::unit_ray;
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
use rayon::prelude::*;

uniform! {
    struct Params {
        rows: u32,
        /// Rays a row.
        rays: u32,
        /// Gather samples.
        gather: u32,
        /// Largest node radius squared over that of a ray's patch.
        credit: f32,
        lift: f32,
        /// Distance between gather samples, metres.
        spacing: f32,
        pad0: u32,
        pad1: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "transfer_rows",
    shared: CREDIT_SHADERS,
    source: include_str!("../../shaders/transfer_rows.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Node>("nodes"),
        Binding::read::<Facet>("facets"),
        Binding::read::<SurfacePoint>("points"),
        Binding::read::<u32>("seeds"),
        Binding::read::<SurfacePoint>("samples"),
        Binding::read::<[u32; 4]>("sides"),
        Binding::read::<u32>("cells"),
        Binding::read::<f32>("radius2"),
        Binding::write::<u32>("credited"),
        Binding::write::<[f32; 2]>("distances"),
    ],
};

pub struct RowRays {
    /// Rows x rays.
    pub nodes: Vec<u32>,
    /// Per row: harmonic mean distance and least distance, metres (infinite when nothing is hit).
    pub distances: Vec<[f32; 2]>,
}

/// `seeds`: one per point, so that a row is the same whatever else is computed with it.
pub fn transfer_rows(
    device: &Device,
    geometry: &Geometry,
    gather: &Gather,
    points: &Array<SurfacePoint>,
    seeds: &Array<u32>,
    rays: u32,
    credit: f32,
) -> Result<RowRays> {
    let params = Params {
        rows: points.len() as u32,
        rays,
        gather: gather.count() as u32,
        credit,
        lift: geometry.lift(),
        spacing: gather.spacing(),
        pad0: 0,
        pad1: 0,
    };
    match device {
        Device::Cpu => Ok(cpu(geometry, gather, points, seeds, &params)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, geometry, gather, points, seeds, &params),
    }
}

fn cpu(geometry: &Geometry, gather: &Gather, points: &[SurfacePoint], seeds: &[u32], params: &Params) -> RowRays {
    let rays = params.rays as usize;
    let mut nodes = vec![0; points.len() * rays];
    let mut distances = vec![[f32::INFINITY; 2]; points.len()];
    let rows = nodes.par_chunks_mut(rays).zip(&mut distances).zip(points.par_iter().zip(seeds));
    rows.for_each(|((nodes, distances), (point, &seed))| {
        if !point.exists() {
            return;
        }
        let shift = sampling::shift(seed);
        let (mut inverse_sum, mut least) = (0.0, f32::INFINITY);
        for (i, node) in nodes.iter_mut().enumerate() {
            let ray = unit_ray(point, sampling::lattice(i as u32, params.rays, shift), params.lift);
            let (credited, distance) = follow(geometry, gather, point, &ray, params);
            *node = credited;
            inverse_sum += 1.0 / distance;
            least = least.min(distance);
        }
        *distances = [params.rays as f32 / inverse_sum, least];
    });
    RowRays { nodes, distances }
}

#[cfg(feature = "gpu")]
fn gpu(
    gpu: &Gpu,
    geometry: &Geometry,
    gather: &Gather,
    points: &Array<SurfacePoint>,
    seeds: &Array<u32>,
    params: &Params,
) -> Result<RowRays> {
    fits_the_shader(geometry)?;
    let rays = params.rays as usize;
    let mut found =
        RowRays { nodes: Vec::with_capacity(points.len() * rays), distances: Vec::with_capacity(points.len()) };
    for range in pages(points.len(), gpu.page(4 * rays.max(12)).min((RAYS / rays.max(1)).max(1))) {
        let params = Params { rows: range.len() as u32, ..*params };
        let credited = gpu.storage::<u32>(range.len() * rays);
        let distances = gpu.storage::<[f32; 2]>(range.len());
        // Points and seeds are new with every call: not worth keeping.
        let buffers = [
            &gpu.whole(&geometry.bvh.nodes),
            &gpu.whole(&geometry.bvh.facets),
            &gpu.upload(&points[range.clone()]),
            &gpu.upload(&seeds[range.clone()]),
            &gpu.whole(&gather.points),
            &gpu.whole(&gather.sides),
            &gpu.whole(&gather.cells),
            &gpu.whole(&gather.radius2),
            &credited,
            &distances,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len())?;
        // Infinity does not exist in WGSL; 3e38 stands for it.
        let finite = |x: f32| if x < 3e38 { x } else { f32::INFINITY };
        let [credited, distances] = batch.read([&credited, &distances])?;
        found.nodes.extend_from_slice(credited.get());
        found.distances.extend(distances.get::<[f32; 2]>().iter().map(|pair| pair.map(finite)));
    }
    Ok(found)
}

/// The node to credit (0 for none), and the distance to the hit (infinite for none).
fn follow(geometry: &Geometry, gather: &Gather, point: &SurfacePoint, ray: &Ray, params: &Params) -> (u32, f32) {
    // Interpolated normals tilt some rays below the triangle itself.
    if ray.direction.dot(point.geometric_normal.into()) <= 0.0 {
        return (0, f32::INFINITY);
    }
    let hit = geometry.bvh.closest(ray);
    if hit.triangle == SurfacePoint::NOWHERE.triangle {
        return (0, f32::INFINITY);
    }
    let Some(leaf) = credit::leaf(geometry, gather, point, &hit, params.spacing) else { return (0, hit.t) };
    let share = params.rays as f32 * ray.direction.dot(point.normal.into()).max(0.05);
    let limit = params.credit * credit::patch(geometry, &hit, ray.direction, share);
    (credit::climb(gather, leaf, limit), hit.t)
}
