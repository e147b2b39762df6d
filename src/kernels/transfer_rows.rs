//! Rays of transfer rows: from each row's point, cosine-distributed rays, each credited to the node of the gather tree
//! that covers its hit.
//!
//! The irradiance at a row's point is `E = (1/rays) sum_r B(node_r)`, with `B` the mean radiant exitance of a node's
//! samples: `integral B(g)/pi V cos dw` with density `cos/pi` (thesis eq. 5.1 without the singular geometry term).
//! The node is the largest one above the hit's nearest sample whose radius squared is below `credit` times that of the
//! patch that one ray stands for, so that far and dim light costs few entries (DESIGN section 7).
//! Output: rows x rays node numbers (0: the ray met nothing that sends light), and per row the harmonic mean and the
//! least of the distances, which say how fast indirect light may change there (Ward et al. 1988).
//! The CPU body also says what the rays met, and casts them anew only as far as something moved since (`Before`); the
//! rows are the same bit by bit. The GPU casts all.

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
use crate::scene::bvh::{Facet, Hit, Node};
use crate::scene::geometry::NONE;
use crate::scene::{Change, Geometry, SurfacePoint};
use crate::transport::gather::Gather;
use crate::transport::sampling;
use glam::Vec3;
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
    /// Rows x rays: the triangle met, `NONE` for none. Empty from a GPU.
    pub met: Vec<u32>,
    /// Rays that were only held against what moved since `Before`.
    pub kept: u64,
}

/// What the same rays met at another moment.
pub struct Before<'a> {
    /// What moved since.
    pub change: &'a Change,
    /// Of each row the triangles that its rays met; `None` for a row that is new, or moved itself.
    pub met: &'a [Option<&'a [u32]>],
}

/// Where rows start.
pub struct Starts<'a> {
    pub points: &'a Array<SurfacePoint>,
    /// One per point, so that a row is the same whatever else is computed with it.
    pub seeds: &'a Array<u32>,
    pub before: Option<Before<'a>>,
}

pub fn transfer_rows(
    device: &Device,
    geometry: &Geometry,
    gather: &Gather,
    starts: &Starts,
    rays: u32,
    credit: f32,
) -> Result<RowRays> {
    let params = Params {
        rows: starts.points.len() as u32,
        rays,
        gather: gather.count() as u32,
        credit,
        lift: geometry.lift(),
        spacing: gather.spacing(),
        pad0: 0,
        pad1: 0,
    };
    match device {
        Device::Cpu => Ok(cpu(geometry, gather, starts, &params)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, geometry, gather, starts, &params),
    }
}

fn cpu(geometry: &Geometry, gather: &Gather, starts: &Starts, params: &Params) -> RowRays {
    let Starts { points, seeds, before } = starts;
    let rays = params.rays as usize;
    let mut nodes = vec![0; points.len() * rays];
    let mut met = vec![NONE; points.len() * rays];
    let mut distances = vec![[f32::INFINITY; 2]; points.len()];
    let rows = nodes.par_chunks_mut(rays).zip(met.par_chunks_mut(rays)).zip(&mut distances);
    let rows = rows.zip(points.par_iter().zip(&seeds[..])).enumerate();
    let kept = rows.map_init(Vec::new, |hits, (row, (((nodes, met), distances), (point, &seed)))| {
        if !point.exists() {
            return 0;
        }
        let known = before.as_ref().and_then(|before| Some((before.change, before.met[row]?)));
        let shift = sampling::shift(seed);
        let (mut inverse_sum, mut least, mut kept) = (0.0, f32::INFINITY, 0);
        hits.clear();
        for (i, met) in met.iter_mut().enumerate() {
            let ray = unit_ray(point, sampling::lattice(i as u32, params.rays, shift), params.lift);
            // Interpolated normals tilt some rays below the triangle itself.
            let hit = match known {
                _ if ray.direction.dot(point.geometric_normal.into()) <= 0.0 => Hit::MISS,
                Some((change, met)) => {
                    kept += u64::from(change.keeps(met[i]));
                    change.closest(geometry, &ray, met[i])
                }
                None => geometry.bvh.closest(&ray),
            };
            *met = hit.triangle;
            inverse_sum += 1.0 / hit.t;
            least = least.min(hit.t);
            hits.push((hit, ray.direction));
        }
        // A loop of its own: the processor waits for many samples at once.
        for (node, (hit, direction)) in nodes.iter_mut().zip(hits) {
            *node = credited(geometry, gather, point, *direction, hit, params);
        }
        *distances = [params.rays as f32 / inverse_sum, least];
        kept
    });
    let kept = kept.sum();
    RowRays { nodes, distances, met, kept }
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, geometry: &Geometry, gather: &Gather, starts: &Starts, params: &Params) -> Result<RowRays> {
    let Starts { points, seeds, .. } = starts;
    fits_the_shader(geometry)?;
    let rays = params.rays as usize;
    let (nodes, distances) = (Vec::with_capacity(points.len() * rays), Vec::with_capacity(points.len()));
    let mut found = RowRays { nodes, distances, met: Vec::new(), kept: 0 };
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

/// The node to credit; 0 for none.
fn credited(
    geometry: &Geometry,
    gather: &Gather,
    point: &SurfacePoint,
    direction: Vec3,
    hit: &Hit,
    params: &Params,
) -> u32 {
    if hit.triangle == NONE {
        return 0;
    }
    let Some(leaf) = credit::leaf(geometry, gather, point, hit, params.spacing) else { return 0 };
    let share = params.rays as f32 * direction.dot(point.normal.into()).max(0.05);
    let limit = params.credit * credit::patch(geometry, hit, direction, share);
    credit::climb(gather, leaf, limit)
}
