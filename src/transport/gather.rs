//! Gather samples: points that stand for all surfaces as sources of indirect light (thesis 5.3.1, DESIGN section 7).
//!
//! They lie uniformly by area over the live sides of all surfaces, number a power of two, are addressed by triangle and
//! barycentrics, and are ordered by hierarchical clustering, so that sample `i` is leaf `count + i` of a complete binary
//! tree: node `n` has children `2n` and `2n + 1`, node 1 is the whole scene. Addresses and order are found in
//! `Geometry::over_time`, so they are the same in all frames of an animation (thesis 5.3.4): only the places change.

use crate::device::Array;
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::{cluster, sample_cells, sampling};
use crate::{Error, Result};
use glam::Vec2;

/// Which sides of each triangle are live (see `sides`). Bit 0: its front; bit 1: its back.
pub type Live = Vec<u8>;

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
    /// Per triangle: offsets into `cells` for its front and back (`sample_cells::DEAD` for none), cells along an edge,
    /// and which way it looks.
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
        sample_cells::cell(&self.sides, triangle, [u, v], front).map(|cell| self.cells[cell])
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
        let (sides, cells) = sample_cells::nearest_of_all(geometry, live, &points, area);
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

/// Of a triangle at any time, square metres.
pub(super) fn largest_area(poses: &[Geometry], triangle: usize) -> f32 {
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
pub(super) fn live_list<'a>(geometry: &'a Geometry, live: &'a Live) -> impl Iterator<Item = (usize, bool)> + 'a {
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
