//! Gather samples: points that stand for all surfaces as sources of indirect light (thesis 5.3.1, DESIGN section 7).
//!
//! They lie uniformly by area over the live sides of all surfaces, number a power of two, are addressed by triangle and
//! barycentrics, and are ordered by hierarchical clustering, so that sample `i` is leaf `count + i` of a complete binary
//! tree: node `n` has children `2n` and `2n + 1`, node 1 is the whole scene. Addresses and order are found in
//! `Geometry::over_time`, so they are the same in all frames of an animation (thesis 5.3.4): only the places change.

use crate::device::Array;
use crate::scene::bvh::Ray;
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::cluster;
use crate::transport::feature::feature;
use crate::transport::sampling;
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Which sides of each triangle are live (see `sides`). Bit 0: its front; bit 1: its back.
pub type Live = Vec<u8>;

/// Says that a side of a triangle is dead, in `Gather::sides`.
pub const DEAD: u32 = u32::MAX;

/// The gather samples of a scene with what kernels need to credit a ray's hit to one of them.
#[derive(Clone, Debug, Default)]
pub struct Gather {
    /// M, in tree order.
    pub points: Array<SurfacePoint>,
    /// Barycentrics (second, third corner) of each sample on its triangle.
    pub barycentrics: Array<[f32; 2]>,
    /// Square metres that one sample stands for, where surfaces are largest.
    pub area: f32,
    /// Squared bounding radius of each of the 2M tree nodes, m²; 0 for leaves, infinite where normals differ too much
    /// for the node to stand for its samples.
    pub radius2: Array<f32>,
    /// Per triangle: offsets into `cells` for its front and back (`DEAD` for none), and cells along an edge.
    pub sides: Array<[u32; 4]>,
    /// The nearest sample of each small cell of each live triangle side.
    pub cells: Array<u32>,
}

impl Gather {
    pub fn count(&self) -> usize {
        self.points.len()
    }

    pub fn bytes(&self) -> u64 {
        (48 + 8 + 8) * self.points.len() as u64 + 16 * self.sides.len() as u64 + 4 * self.cells.len() as u64
    }

    /// Of `area`, what each sample stands for in this pose: less where surfaces are smaller than at other times. Empty when
    /// nothing moves.
    pub fn shares(&self, geometry: &Geometry) -> Vec<f32> {
        if geometry.poses.is_empty() {
            return Vec::new();
        }
        let share = |point: &SurfacePoint| {
            let triangle = point.triangle as usize;
            geometry.area(triangle) / largest_area(&geometry.poses, triangle)
        };
        self.points.iter().map(share).collect()
    }

    /// About the distance from a sample to the next, metres.
    pub fn spacing(&self) -> f32 {
        self.area.sqrt()
    }

    /// The sample nearest to a place of a triangle's side; `None` on a dead one.
    pub fn nearest(&self, triangle: u32, [u, v]: [f32; 2], front: bool) -> Option<u32> {
        let side = self.sides[triangle as usize];
        let cells = if front { side[0] } else { side[1] };
        (cells != DEAD).then(|| self.cells[(cells + cell_index(u, v, side[2])) as usize])
    }

    /// Places `count` samples (a power of two, 2 to 2^20) on the live sides.
    pub fn place(geometry: &Geometry, live: &Live, count: usize) -> Result<Self> {
        if !count.is_power_of_two() || !(2..=1 << 20).contains(&count) {
            return Err(Error::compute(
                format!("gather_samples is {count}; it must be a power of two from 2 to 1048576"),
                format!("use {}", count.clamp(2, 1 << 20).next_power_of_two().min(1 << 20)),
            ));
        }
        let poses = geometry.over_time();
        // What is folded up in one pose may be spread out in another.
        let areas: Vec<f32> = (0..geometry.corners.len()).map(|triangle| largest_area(poses, triangle)).collect();
        let area = live_list(&poses[0], live).map(|(triangle, _)| f64::from(areas[triangle])).sum::<f64>();
        if area.is_nan() || area <= 0.0 {
            return Err(Error::compute(
                "no surface is in view, so there is nothing to gather light from",
                "turn the camera towards the scene",
            ));
        }
        let addresses = scatter(&poses[0], live, &areas, count, area);
        let point = |geometry: &Geometry, at: &Address| geometry.surface_point(at.triangle, at.u, at.v, at.front);
        let order = cluster::order(&addresses.iter().map(|at| point(&poses[0], at)).collect::<Vec<_>>());
        let addresses: Vec<Address> = order.iter().map(|&i| addresses[i as usize]).collect();
        let points: Vec<SurfacePoint> = addresses.iter().map(|at| point(geometry, at)).collect();
        let barycentrics: Vec<[f32; 2]> = addresses.iter().map(|at| [at.u, at.v]).collect();
        let area = (area / count as f64) as f32;
        let (sides, cells) = cells(geometry, live, &points, (area, CELLS));
        let radius2 = cluster::squared_radii(&points);
        Ok(Self {
            points: points.into(),
            barycentrics: barycentrics.into(),
            area,
            radius2: radius2.into(),
            sides: sides.into(),
            cells: cells.into(),
        })
    }
}

/// Cells of triangles to a sample.
const CELLS: f32 = 8.0;

/// Which of given gather samples is the nearest, anywhere on the live sides; cells as `Gather` has them, fewer.
pub struct NearestSample(Gather);

impl NearestSample {
    /// `addresses`: side (see `sampled::ViewPlaces`) and barycentrics of each sample.
    pub fn new(geometry: &Geometry, live: &Live, sides: &[u32], barycentrics: &[[f32; 2]]) -> Self {
        let poses = geometry.over_time();
        let areas = live_list(&poses[0], live).map(|(triangle, _)| f64::from(largest_area(poses, triangle)));
        let area = (areas.sum::<f64>() / sides.len().max(1) as f64) as f32;
        let point =
            |(side, at): (&u32, &[f32; 2])| geometry.surface_point((side / 2) as usize, at[0], at[1], side % 2 == 0);
        let points: Vec<SurfacePoint> = sides.iter().zip(barycentrics).map(point).collect();
        let (sides, cells) = cells(geometry, live, &points, (area, 0.125 * CELLS));
        Self(Gather { points: points.into(), sides: sides.into(), cells: cells.into(), area, ..Gather::default() })
    }

    pub fn points(&self) -> &[SurfacePoint] {
        &self.0.points
    }

    /// See `Gather::nearest`.
    pub fn at(&self, triangle: u32, barycentrics: [f32; 2], front: bool) -> Option<u32> {
        self.0.nearest(triangle, barycentrics, front)
    }
}

/// Of a triangle at any time, square metres.
fn largest_area(poses: &[Geometry], triangle: usize) -> f32 {
    poses.iter().map(|pose| pose.area(triangle)).fold(0.0, f32::max)
}

/// A place on a surface, whatever becomes of the surface.
#[derive(Clone, Copy)]
struct Address {
    triangle: usize,
    front: bool,
    u: f32,
    v: f32,
}

/// Triangle sides that are live, in the order of BVH leaves: neighbours in the list are neighbours in space. Triangles
/// without area in this pose come last.
fn live_list<'a>(geometry: &'a Geometry, live: &'a Live) -> impl Iterator<Item = (usize, bool)> + 'a {
    let facets = &geometry.bvh.facets;
    let flat = (facets.len() < geometry.corners.len())
        .then(|| (0..geometry.corners.len()).filter(|triangle| geometry.is_flat(*triangle)));
    let triangles = facets.iter().map(|facet| facet.triangle as usize).chain(flat.into_iter().flatten());
    triangles.flat_map(move |triangle| {
        [(1, true), (2, false)]
            .into_iter()
            .filter(move |(bit, _)| live[triangle] & bit != 0)
            .map(move |(_, front)| (triangle, front))
    })
}

/// Walks the cumulated area in equal steps; a triangle's share gets a lattice of its own.
fn scatter(geometry: &Geometry, live: &Live, areas: &[f32], count: usize, total: f64) -> Vec<Address> {
    let step = total / count as f64;
    let mut addresses = Vec::with_capacity(count);
    // Half a step in: the walk then takes `count` steps whatever the rounding.
    let (mut walked, mut next) = (0.0, 0.5 * step);
    let mut put = |triangle: usize, front: bool, here: u32| {
        let shift = sampling::shift(triangle as u32 * 2 + u32::from(front));
        for i in 0..here {
            let at = if here == 1 { shift } else { sampling::lattice(i, here, Vec2::new(0.0, shift.y)) };
            let at = sampling::triangle(at);
            addresses.push(Address { triangle, front, u: at.x, v: at.y });
        }
    };
    let mut placed = 0;
    let mut last = (0, true);
    for (triangle, front) in live_list(geometry, live) {
        walked += f64::from(areas[triangle]);
        let mut here = 0;
        while next < walked && placed < count {
            here += 1;
            placed += 1;
            next += step;
        }
        if here > 0 {
            put(triangle, front, here);
            last = (triangle, front);
        }
    }
    put(last.0, last.1, (count - placed) as u32);
    addresses
}

/// Cuts each live triangle side into k² equal small triangles, about `each` to a sample, and finds the nearest sample of
/// each, of the same object and material if it can be, that no surface hides; a ray's hit then costs one look-up.
fn cells(
    geometry: &Geometry,
    live: &Live,
    points: &[SurfacePoint],
    (area, each): (f32, f32),
) -> (Vec<[u32; 4]>, Vec<u32>) {
    let normal_scale = 4.0 * area.sqrt();
    // The same in all frames: what stands still keeps its cells.
    let (low, high) = geometry.bounds_over_time();
    let centre = 0.5 * (low + high);
    let features: Vec<[f32; 6]> = points
        .iter()
        .map(|point| feature(point.position.into(), point.geometric_normal.into(), centre, normal_scale))
        .collect();
    let tree: ImmutableKdTree<f32, 6> = ImmutableKdTree::new_from_slice(&features);
    let mut sides = vec![[DEAD, DEAD, 1, 0]; geometry.corners.len()];
    let mut jobs = Vec::new();
    let mut total = 0u32;
    for (triangle, side) in sides.iter_mut().enumerate() {
        let k = (geometry.area(triangle) * each / area).sqrt().ceil().clamp(1.0, 4096.0) as u32;
        side[2] = k;
        for (bit, front) in [(1, true), (2, false)] {
            if live[triangle] & bit != 0 {
                side[usize::from(!front)] = total;
                jobs.push((triangle, front, k));
                total += k * k;
            }
        }
    }
    // A sample beyond a surface is near but in other light: under the box, behind the wall, inside the head. The test
    // ray runs a little above the surface.
    let height = 0.25 * area.sqrt();
    let above = |point: &SurfacePoint| Vec3::from(point.position) + Vec3::from(point.geometric_normal) * height;
    let apart = |a: &SurfacePoint, b: &SurfacePoint| {
        let direction = above(b) - above(a);
        geometry.bvh.any(&Ray { origin: above(a), direction, t_max: 1.0 })
    };
    let nearest = |triangle: usize, front: bool, u: f32, v: f32| {
        let at = geometry.surface_point(triangle, u, v, front);
        let query = feature(at.position.into(), at.geometric_normal.into(), centre, normal_scale);
        let first = tree.nearest_one::<SquaredEuclidean>(&query).item as u32;
        let good = |i: u32| cluster::same_stuff(&at, &points[i as usize]) && !apart(&at, &points[i as usize]);
        if good(first) {
            return first;
        }
        let few = tree.nearest_n::<SquaredEuclidean>(&query, NonZero::new(16).expect("16"));
        let few = || few.iter().map(|found| found.item as u32);
        few().find(|&i| good(i)).or_else(|| few().find(|&i| !apart(&at, &points[i as usize]))).unwrap_or(first)
    };
    let found = jobs.par_iter().flat_map_iter(|&(triangle, front, k)| {
        centroids(k)
            .map(move |(u, v)| (triangle, front, u, v))
            .map(|(triangle, front, u, v)| nearest(triangle, front, u, v))
    });
    (sides, found.collect())
}

/// Barycentrics of the centroids of the k² cells, in the order of `cell_index`.
fn centroids(k: u32) -> impl Iterator<Item = (f32, f32)> {
    let step = 1.0 / k as f32;
    (0..k).flat_map(move |i| {
        (0..2 * (k - i) - 1).map(move |c| {
            let (j, upper) = (c / 2, c % 2);
            let third = if upper == 1 { 2.0 / 3.0 } else { 1.0 / 3.0 };
            ((i as f32 + third) * step, (j as f32 + third) * step)
        })
    })
}

/// The cell of a triangle cut k times an edge that holds barycentrics `u`, `v`: rows of `u`, cells up and down by turns.
pub fn cell_index(u: f32, v: f32, k: u32) -> u32 {
    let (x, y) = (u * k as f32, v * k as f32);
    let i = (x as u32).min(k - 1);
    let j = (y as u32).min(k - 1 - i);
    let upper = u32::from((x - i as f32) + (y - j as f32) > 1.0 && i + j + 1 < k);
    i * (2 * k - i) + 2 * j + upper
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_numbered_as_their_centroids_are_listed() {
        for k in [1, 2, 3, 7, 64] {
            let all: Vec<_> = centroids(k).collect();
            assert_eq!(all.len(), (k * k) as usize);
            for (index, (u, v)) in all.into_iter().enumerate() {
                assert_eq!(cell_index(u, v, k), index as u32, "k {k}, ({u}, {v})");
            }
        }
    }

    #[test]
    fn a_cell_index_never_leaves_its_triangle() {
        for k in [1, 2, 5, 33] {
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (1.0, 1.0)] {
                assert!(cell_index(u, v, k) < k * k, "k {k}, ({u}, {v})");
            }
        }
    }
}
