//! Which gather sample stands for a place of a surface: each live triangle side is cut into k² equal small triangles, and
//! each of these has its nearest sample, so that a ray's hit costs one look-up.

use crate::scene::bvh::Ray;
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::cluster;
use crate::transport::feature::feature;
use crate::transport::gather::{Live, largest_area, live_list};
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;
use std::sync::atomic::{AtomicU32, Ordering};

/// Says that a side of a triangle is dead.
pub const DEAD: u32 = u32::MAX;
/// Cells of triangles to a sample.
const CELLS: f32 = 8.0;
/// Of those that are found while they are asked for, by someone who takes single places from them.
const FEWER_CELLS: f32 = 1.0;
/// Samples that are looked through for one in the same light.
const CANDIDATES: usize = 16;

/// Cells of a triangle cut `k` times an edge: rows of `u`, cells up and down by turns.
#[derive(Clone, Copy)]
struct Cell {
    row: u32,
    column: u32,
    /// 1 for the half whose corner is away from the triangle's first.
    upper: u32,
}

impl Cell {
    /// That holds barycentrics `u`, `v`.
    fn of(u: f32, v: f32, k: u32) -> Self {
        let (x, y) = (u * k as f32, v * k as f32);
        let row = (x as u32).min(k - 1);
        let column = (y as u32).min(k - 1 - row);
        let upper = u32::from((x - row as f32) + (y - column as f32) > 1.0 && row + column + 1 < k);
        Self { row, column, upper }
    }

    /// All of them, by their index.
    fn all(k: u32) -> impl Iterator<Item = Self> {
        (0..k).flat_map(move |row| (0..2 * (k - row) - 1).map(move |i| Self { row, column: i / 2, upper: i % 2 }))
    }

    fn index(self, k: u32) -> u32 {
        self.row * (2 * k - self.row) + 2 * self.column + self.upper
    }

    /// Barycentrics of its middle.
    fn centroid(self, k: u32) -> [f32; 2] {
        let (step, third) = (1.0 / k as f32, if self.upper == 1 { 2.0 / 3.0 } else { 1.0 / 3.0 });
        [(self.row as f32 + third) * step, (self.column as f32 + third) * step]
    }
}

/// Which way the front of a triangle looks, as the axis along which it does most, and 4 more where that is down it.
fn facing(area_vector: Vec3) -> u32 {
    let axis = area_vector.abs().max_position();
    axis as u32 + if area_vector[axis] < 0.0 { 4 } else { 0 }
}

/// Where the cells of a side start, and cells along an edge; nothing on a dead side.
fn first_and_cut(side: &[u32; 4], front: bool) -> Option<(u32, u32)> {
    let first = side[usize::from(!front)];
    (first != DEAD).then_some((first, side[2]))
}

/// The number of the cell of a place, by `Gather::sides`; `None` on a dead side.
pub fn cell(sides: &[[u32; 4]], triangle: u32, [u, v]: [f32; 2], front: bool) -> Option<usize> {
    let (first, k) = first_and_cut(&sides[triangle as usize], front)?;
    Some((first + Cell::of(u, v, k).index(k)) as usize)
}

/// How the sides are cut, `each` cells to a sample that stands for `area`; and how many cells there are.
fn cut(geometry: &Geometry, live: &Live, area: f32, each: f32) -> (Vec<[u32; 4]>, usize) {
    let mut total = 0;
    let side = |triangle: usize| {
        let k = (geometry.area(triangle) * each / area).sqrt().ceil().clamp(1.0, 4096.0) as u32;
        let [front, back] = [1, 2].map(|bit| {
            let is_live = live[triangle] & bit != 0;
            let first = if is_live { total } else { DEAD };
            total += if is_live { k * k } else { 0 };
            first
        });
        [front, back, k, facing(geometry.area_vector(triangle))]
    };
    let sides = (0..geometry.corners.len()).map(side).collect();
    (sides, total as usize)
}

/// The sides as in `Gather::sides`, and the nearest of samples for each cell.
pub fn nearest_of_all(
    geometry: &Geometry,
    live: &Live,
    points: &[SurfacePoint],
    area: f32,
) -> (Vec<[u32; 4]>, Vec<u32>) {
    let (sides, _) = cut(geometry, live, area, CELLS);
    let cells = nearest_of_sides(geometry, points, area, &sides);
    (sides, cells)
}

fn nearest_of_sides(geometry: &Geometry, points: &[SurfacePoint], area: f32, sides: &[[u32; 4]]) -> Vec<u32> {
    let finder = Finder::new(geometry, points, area);
    let both = (0..sides.len()).into_par_iter().flat_map_iter(|triangle| [(triangle, true), (triangle, false)]);
    let found = both.flat_map_iter(|(triangle, front)| {
        let k = first_and_cut(&sides[triangle], front).map_or(0, |(_, k)| k);
        let finder = &finder;
        let nearest = move |cell: Cell| {
            let [u, v] = cell.centroid(k);
            finder.nearest(geometry, points, &geometry.surface_point(triangle, u, v, front))
        };
        Cell::all(k).map(nearest)
    });
    found.collect()
}

/// Finds the nearest sample, of the same object and material if it can be, that no surface hides.
struct Finder {
    tree: ImmutableKdTree<f32, 6>,
    centre: Vec3,
    normal_scale: f32,
    /// Of the test ray above surfaces, m.
    height: f32,
}

impl Finder {
    fn new(geometry: &Geometry, points: &[SurfacePoint], area: f32) -> Self {
        let normal_scale = 4.0 * area.sqrt();
        // The same in all frames: what stands still keeps its cells.
        let (low, high) = geometry.bounds_over_time();
        let centre = 0.5 * (low + high);
        let place = |p: &SurfacePoint| feature(p.position.into(), p.geometric_normal.into(), centre, normal_scale);
        let features: Vec<[f32; 6]> = points.iter().map(place).collect();
        let tree = ImmutableKdTree::new_from_slice(&features);
        Self { tree, centre, normal_scale, height: 0.25 * area.sqrt() }
    }

    fn nearest(&self, geometry: &Geometry, points: &[SurfacePoint], at: &SurfacePoint) -> u32 {
        let query = feature(at.position.into(), at.geometric_normal.into(), self.centre, self.normal_scale);
        let first = self.tree.nearest_one::<SquaredEuclidean>(&query).item as u32;
        // A sample beyond a surface is near but in other light: under the box, behind the wall, inside the head.
        let above = |p: &SurfacePoint| Vec3::from(p.position) + Vec3::from(p.geometric_normal) * self.height;
        let from = above(at);
        let apart = |sample: u32| {
            let direction = above(&points[sample as usize]) - from;
            geometry.bvh.any(&Ray { origin: from, direction, t_max: 1.0 })
        };
        let good = |sample: u32| cluster::same_stuff(at, &points[sample as usize]) && !apart(sample);
        if good(first) {
            return first;
        }
        let count = NonZero::new(CANDIDATES).expect("some");
        let few = self.tree.nearest_n::<SquaredEuclidean>(&query, count);
        let few = || few.iter().map(|found| found.item as u32);
        few().find(|&sample| good(sample)).or_else(|| few().find(|&sample| !apart(sample))).unwrap_or(first)
    }
}

/// Which of given gather samples is the nearest, anywhere on the live sides of a scene; cells as `Gather` has them, but
/// fewer, and found when they are first asked for.
pub struct NearestSample {
    points: Vec<SurfacePoint>,
    finder: Finder,
    sides: Vec<[u32; 4]>,
    cells: Vec<AtomicU32>,
}

/// Of a cell that was not asked for.
const UNKNOWN: u32 = u32::MAX;

impl NearestSample {
    /// `addresses`: side (see `sampled::ViewPlaces`) and barycentrics of each sample.
    pub fn new(geometry: &Geometry, live: &Live, sides: &[u32], barycentrics: &[[f32; 2]]) -> Self {
        let poses = geometry.over_time();
        let areas = live_list(&poses[0], live).map(|(triangle, _)| f64::from(largest_area(poses, triangle)));
        let area = (areas.sum::<f64>() / sides.len().max(1) as f64) as f32;
        let point =
            |(side, at): (&u32, &[f32; 2])| geometry.surface_point((side / 2) as usize, at[0], at[1], side % 2 == 0);
        let points: Vec<SurfacePoint> = sides.iter().zip(barycentrics).map(point).collect();
        let (sides, count) = cut(geometry, live, area, FEWER_CELLS);
        let cells = (0..count).map(|_| AtomicU32::new(UNKNOWN)).collect();
        Self { finder: Finder::new(geometry, &points, area), points, sides, cells }
    }

    pub fn points(&self) -> &[SurfacePoint] {
        &self.points
    }

    pub fn bytes(&self) -> u64 {
        // The tree holds six numbers and an item of each sample.
        (48 + 28) * self.points.len() as u64 + 16 * self.sides.len() as u64 + 4 * self.cells.len() as u64
    }

    /// The sample nearest to a hit; `None` on a dead side, and for none. `geometry`: that of `new`.
    pub fn at(&self, geometry: &Geometry, hit: &SurfacePoint, [u, v]: [f32; 2]) -> Option<u32> {
        if !hit.exists() {
            return None;
        }
        let side = &self.sides[hit.triangle as usize];
        // The geometry itself would say so, too, from farther away in memory.
        let front = (hit.geometric_normal[(side[3] & 3) as usize] < 0.0) == (side[3] >= 4);
        let (first, k) = first_and_cut(side, front)?;
        let cell = Cell::of(u, v, k);
        let known = &self.cells[(first + cell.index(k)) as usize];
        let mut sample = known.load(Ordering::Relaxed);
        if sample == UNKNOWN {
            // Whoever else finds it meanwhile finds the same.
            let [u, v] = cell.centroid(k);
            sample = self.finder.nearest(
                geometry,
                &self.points,
                &geometry.surface_point(hit.triangle as usize, u, v, front),
            );
            known.store(sample, Ordering::Relaxed);
        }
        Some(sample)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;
    use crate::transport::gather::Gather;
    use crate::transport::sampling::{hash, unit};

    /// In whatever order cells are asked for, each has what all at once would have; dead sides have nothing.
    #[test]
    fn samples_that_are_found_late_are_the_same() {
        let geometry = &builtin::scene("room").unwrap().geometry;
        let live: Live = (0..geometry.corners.len()).map(|triangle| (triangle % 4) as u8).collect();
        let gather = Gather::place(geometry, &live, 1024).unwrap();
        let is_front =
            |p: &SurfacePoint| geometry.area_vector(p.triangle as usize).dot(p.geometric_normal.into()) >= 0.0;
        let addresses: Vec<u32> = gather.points.iter().map(|p| 2 * p.triangle + u32::from(!is_front(p))).collect();
        let nearest = NearestSample::new(geometry, &live, &addresses, &gather.barycentrics);
        let all = nearest_of_sides(geometry, nearest.points(), gather.area, &nearest.sides);
        assert_eq!(all.len(), nearest.cells.len());
        let mut dead = 0;
        for i in 0..20_000 {
            let [which, u, v, front] = [0, 1, 2, 3].map(|n| unit(hash(4 * i + n)));
            let triangle = (which * geometry.corners.len() as f32) as u32;
            let (front, at) = (front < 0.5, [u, v * (1.0 - u)]);
            let hit = geometry.surface_point(triangle as usize, at[0], at[1], front);
            let found = nearest.at(geometry, &hit, at);
            assert_eq!(found, cell(&nearest.sides, triangle, at, front).map(|cell| all[cell]));
            let is_live = live[triangle as usize] & if front { 1 } else { 2 } != 0;
            assert_eq!(found.is_some(), is_live);
            dead += u32::from(!is_live);
        }
        assert!((1000..19_000).contains(&dead));
    }

    #[test]
    fn cells_are_numbered_in_their_order() {
        for k in [1, 2, 3, 7, 64] {
            let all: Vec<Cell> = Cell::all(k).collect();
            assert_eq!(all.len(), (k * k) as usize);
            for (index, cell) in all.into_iter().enumerate() {
                let [u, v] = cell.centroid(k);
                assert_eq!(cell.index(k), index as u32);
                assert_eq!(Cell::of(u, v, k).index(k), index as u32, "k {k}, ({u}, {v})");
            }
        }
    }

    #[test]
    fn a_cell_index_never_leaves_its_triangle() {
        for k in [1, 2, 5, 33] {
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (1.0, 1.0)] {
                assert!(Cell::of(u, v, k).index(k) < k * k, "k {k}, ({u}, {v})");
            }
        }
    }
}
