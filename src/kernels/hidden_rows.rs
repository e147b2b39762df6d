//! What the rays of transfer rows would meet behind their first hit: where light would come from if what lies in between
//! let it through (thesis 5.4.2, removing indirect shadows).
//!
//! The rays are those of `transfer_rows`, bit by bit, so what a row sees and what is hidden from it add up to what it
//! would see without the occluder. Every further hit that falls on a live side which faces the ray is credited to a node
//! of the gather tree by the rule of `transfer_rows` with the distance of that hit, if a sample below the node is
//! admitted. Dead sides are passed through.
//! Output: rows x rays x layers node numbers, front to back, 0 after the last; per row how many hits there was no room
//! for.

use super::CREDIT_SHADERS;
use super::shared::credit::{self, unit_ray};
#[cfg(feature = "gpu")]
use super::{RAYS, fits_the_shader, pages};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::scene::bvh::{Facet, Hit, Node, Ray};
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
        /// Credited hits a ray at most.
        layers: u32,
        /// Hits looked at a ray at most.
        walk: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "hidden_rows",
    shared: CREDIT_SHADERS,
    source: include_str!("../../shaders/hidden_rows.wgsl"),
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
        Binding::read::<u32>("admitted"),
        Binding::write::<u32>("credited"),
        Binding::write::<u32>("dropped"),
    ],
};

/// How rays are followed.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    /// Rays a row, and the credit rule: as the rows were computed.
    pub rays: u32,
    pub credit: f32,
    /// Credited hits a ray at most.
    pub layers: u32,
}

/// Hits looked at a ray at most: what lies behind so many surfaces counts as dropped.
const MOST_HITS: u32 = 64;

pub struct HiddenRays {
    /// Rows x rays x layers.
    pub nodes: Vec<u32>,
    /// Per row: credited hits beyond the last layer, and rays that were given up.
    pub dropped: Vec<u32>,
}

/// `points` and `seeds` as for `transfer_rows`; `admitted`: 1 for each of the 2M tree nodes that counts, 0 for others.
pub fn hidden_rows(
    device: &Device,
    geometry: &Geometry,
    gather: &Gather,
    points: &Array<SurfacePoint>,
    seeds: &Array<u32>,
    admitted: &Array<u32>,
    walk: Walk,
) -> Result<HiddenRays> {
    let params = Params {
        rows: points.len() as u32,
        rays: walk.rays,
        gather: gather.count() as u32,
        credit: walk.credit,
        lift: geometry.lift(),
        spacing: gather.spacing(),
        layers: walk.layers,
        walk: MOST_HITS,
    };
    match device {
        Device::Cpu => Ok(cpu(geometry, gather, points, seeds, admitted, &params)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, geometry, gather, points, seeds, admitted, &params),
    }
}

fn cpu(
    geometry: &Geometry,
    gather: &Gather,
    points: &[SurfacePoint],
    seeds: &[u32],
    admitted: &[u32],
    params: &Params,
) -> HiddenRays {
    let layers = params.layers as usize;
    let per_row = params.rays as usize * layers;
    let mut nodes = vec![0; points.len() * per_row];
    let mut dropped = vec![0; points.len()];
    let rows = nodes.par_chunks_mut(per_row).zip(&mut dropped).zip(points.par_iter().zip(seeds));
    rows.for_each(|((nodes, dropped), (point, &seed))| {
        if !point.exists() {
            return;
        }
        let shift = sampling::shift(seed);
        for (i, nodes) in nodes.chunks_exact_mut(layers).enumerate() {
            let ray = unit_ray(point, sampling::lattice(i as u32, params.rays, shift), params.lift);
            *dropped += follow(geometry, gather, admitted, point, &ray, params, nodes);
        }
    });
    HiddenRays { nodes, dropped }
}

#[cfg(feature = "gpu")]
fn gpu(
    gpu: &Gpu,
    geometry: &Geometry,
    gather: &Gather,
    points: &Array<SurfacePoint>,
    seeds: &Array<u32>,
    admitted: &Array<u32>,
    params: &Params,
) -> Result<HiddenRays> {
    fits_the_shader(geometry)?;
    let per_row = (params.rays * params.layers) as usize;
    let mut found =
        HiddenRays { nodes: Vec::with_capacity(points.len() * per_row), dropped: Vec::with_capacity(points.len()) };
    let page = gpu.page(4 * per_row.max(12)).min((RAYS / per_row.max(1)).max(1));
    for range in pages(points.len(), page) {
        let params = Params { rows: range.len() as u32, ..*params };
        let credited = gpu.storage::<u32>(range.len() * per_row);
        let dropped = gpu.storage::<u32>(range.len());
        let buffers = [
            &gpu.whole(&geometry.bvh.nodes),
            &gpu.whole(&geometry.bvh.facets),
            &gpu.upload(&points[range.clone()]),
            &gpu.upload(&seeds[range.clone()]),
            &gpu.whole(&gather.points),
            &gpu.whole(&gather.sides),
            &gpu.whole(&gather.cells),
            &gpu.whole(&gather.radius2),
            &gpu.whole(admitted),
            &credited,
            &dropped,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len())?;
        let [credited, dropped] = batch.read([&credited, &dropped])?;
        found.nodes.extend_from_slice(credited.get());
        found.dropped.extend_from_slice(dropped.get());
    }
    Ok(found)
}

/// Writes the nodes of a ray; how many there was no room for.
fn follow(
    geometry: &Geometry,
    gather: &Gather,
    admitted: &[u32],
    point: &SurfacePoint,
    ray: &Ray,
    params: &Params,
    nodes: &mut [u32],
) -> u32 {
    // Interpolated normals tilt some rays below the triangle itself.
    if ray.direction.dot(point.geometric_normal.into()) <= 0.0 {
        return 0;
    }
    let share = params.rays as f32 * ray.direction.dot(point.normal.into()).max(0.05);
    let (mut layer, mut dropped) = (0, 0);
    let mut hit = geometry.bvh.closest(ray);
    for _ in 0..params.walk {
        if hit.triangle == Hit::MISS.triangle {
            return dropped;
        }
        // Surfaces that coincide count once, and so does one that is hit on the edge between its triangles.
        hit = geometry.bvh.closest_beyond(ray, hit.t * 1.00001 + params.lift);
        if hit.triangle == Hit::MISS.triangle {
            return dropped;
        }
        let Some(leaf) = credit::leaf(geometry, gather, point, &hit, params.spacing) else { continue };
        let limit = params.credit * credit::patch(geometry, &hit, ray.direction, share);
        let node = credit::climb(gather, leaf, limit);
        if admitted[node as usize] == 0 {
            continue;
        }
        if layer < nodes.len() {
            nodes[layer] = node;
            layer += 1;
        } else {
            dropped += 1;
        }
    }
    dropped + 1
}
