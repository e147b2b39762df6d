//! Rays of transfer rows: from each row's point, cosine-distributed rays, each credited to the node of the gather tree
//! that covers its hit.
//!
//! The irradiance at a row's point is `E = (1/rays) sum_r B(node_r)`, with `B` the mean radiant exitance of a node's
//! samples: `integral B(g)/pi V cos dw` with density `cos/pi` (thesis eq. 5.1 without the singular geometry term).
//! The node is the largest one above the hit's nearest sample whose radius squared is below `credit` times that of the
//! patch that one ray stands for, so that far and dim light costs few entries (DESIGN section 7).
//! Output: rows x rays node numbers (0: the ray met nothing that sends light), and per row the harmonic mean and the
//! least of the distances, which say how fast indirect light may change there (Ward et al. 1988).

use super::RAY_SHADERS;
#[cfg(feature = "gpu")]
use super::{RAYS, fits_the_shader, pages};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::scene::bvh::{Facet, Hit, Node, Ray};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::gather::{DEAD, Gather, cell_index};
use crate::transport::sampling;
use glam::{Vec2, Vec3};
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
    shared: RAY_SHADERS,
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

/// A cosine-distributed ray about the point's shading normal, lifted off its surface.
pub fn unit_ray(point: &SurfacePoint, at: Vec2, lift: f32) -> Ray {
    let normal = Vec3::from(point.normal);
    let (x, y) = sampling::frame(normal);
    let local = sampling::cosine_direction(at);
    let origin = sampling::lifted(point.position.into(), point.geometric_normal.into(), lift);
    Ray { origin, direction: x * local.x + y * local.y + normal * local.z, t_max: f32::INFINITY }
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
    let side = gather.sides[hit.triangle as usize];
    let cells = if hit.front { side[0] } else { side[1] };
    if cells == DEAD {
        return (0, hit.t);
    }
    let mut leaf = gather.cells[(cells + cell_index(hit.u, hit.v, side[2])) as usize];
    if behind(point, &gather.points[leaf as usize]) {
        // The cell straddles the row's own surface: look again half a sample further out.
        let (u, v) = nudged(geometry, &hit, Vec3::from(point.geometric_normal) * params.spacing);
        let other = gather.cells[(cells + cell_index(u, v, side[2])) as usize];
        if !behind(point, &gather.points[other as usize]) {
            leaf = other;
        }
    }
    let area_vector = geometry.area_vector(hit.triangle as usize);
    let facing = (area_vector.dot(ray.direction).abs() / area_vector.length()).max(0.1);
    let cosine = ray.direction.dot(point.normal.into()).max(0.05);
    // The patch's radius squared: solid angle pi / (rays cosine), times t² / facing, over pi.
    let patch = hit.t * hit.t / (params.rays as f32 * cosine * facing);
    let mut node = params.gather + leaf;
    while node > 1 && gather.radius2[(node >> 1) as usize] <= params.credit * patch {
        node >>= 1;
    }
    (node, hit.t)
}

/// The row's point cannot see a sample below its own surface.
fn behind(point: &SurfacePoint, sample: &SurfacePoint) -> bool {
    (Vec3::from(sample.position) - Vec3::from(point.position)).dot(point.geometric_normal.into()) < 0.0
}

/// Barycentrics of a hit moved along its triangle, clamped to stay on it.
fn nudged(geometry: &Geometry, hit: &Hit, by: Vec3) -> (f32, f32) {
    let [a, b, c] = geometry.corners[hit.triangle as usize].map(Vec3::from);
    let (edge_u, edge_v) = (b - a, c - a);
    let (uu, uv, vv) = (edge_u.dot(edge_u), edge_u.dot(edge_v), edge_v.dot(edge_v));
    let (du, dv) = (by.dot(edge_u), by.dot(edge_v));
    let determinant = uu * vv - uv * uv;
    // A sliver has no room to move in.
    if determinant.is_nan() || determinant <= 1e-6 * uu * vv {
        return (hit.u, hit.v);
    }
    let u = (hit.u + (du * vv - dv * uv) / determinant).clamp(0.0, 1.0);
    let v = (hit.v + (dv * uu - du * uv) / determinant).clamp(0.0, 1.0 - u);
    (u, v)
}
