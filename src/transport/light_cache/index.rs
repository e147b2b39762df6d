//! Which records of an irradiance cache may hold at a place: a hierarchy of grids, each with cells half as wide as the one
//! before, of which only those that hold something exist (Ward et al. 1988 use an octree).
//!
//! A record lies in the grid whose cells are at least as wide as the sphere that it holds in, so in at most eight cells;
//! a place lies in one cell of each grid. Deterministic: it depends on the spheres and their order alone.

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Bits of a cell's number along an axis; one grid a bit, and one more.
const BITS: u32 = 19;

/// A cell (16 bytes; same layout in WGSL).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Cell {
    /// Grid and number in it, low word first; 0: no cell.
    key: [u32; 2],
    /// Of those in `records`.
    first: u32,
    count: u32,
}

#[derive(Clone, Debug, Default)]
pub struct Index {
    pub low: Vec3,
    /// Of the only cell of the first grid, metres.
    pub width: f32,
    /// Grids that hold something, from wide to narrow.
    levels: Vec<u32>,
    /// Open addressing, at most half full; a power of two, or empty.
    pub cells: Vec<Cell>,
    /// Cell by cell: centre and squared radius, by themselves so that those that do not reach a place cost little.
    pub spheres: Vec<Vec4>,
    /// Of each sphere.
    pub records: Vec<u32>,
}

impl Index {
    /// `spheres`: centre and radius, metres.
    pub fn new(spheres: &[(Vec3, f32)]) -> Self {
        let Some(low) = spheres.iter().map(|sphere| sphere.0).reduce(Vec3::min) else { return Self::default() };
        let high = spheres.iter().fold(low, |high, sphere| high.max(sphere.0));
        let width = (high - low).max_element().max(1e-6) * 1.001;
        let mut index = Self { low, width, ..Self::default() };
        let mut cells: Vec<(u64, u32)> = spheres
            .par_iter()
            .enumerate()
            .flat_map_iter(|(record, sphere)| index.keys(sphere).map(move |key| (key, record as u32)))
            .collect();
        cells.par_sort_unstable();
        let runs: Vec<&[(u64, u32)]> = cells.chunk_by(|a, b| a.0 == b.0).collect();
        index.cells = vec![Cell::default(); (2 * runs.len()).next_power_of_two()];
        let (mut first, mut seen) = (0, 0u32);
        for run in runs {
            let key = run[0].0;
            seen |= 1 << level_of(key);
            let mut slot = index.slot(words(key));
            while index.cells[slot] != Cell::default() {
                slot = (slot + 1) & (index.cells.len() - 1);
            }
            index.cells[slot] = Cell { key: words(key), first, count: run.len() as u32 };
            first += run.len() as u32;
        }
        let sphere = |cell: &(u64, u32)| {
            let (centre, radius) = spheres[cell.1 as usize];
            centre.extend(radius * radius)
        };
        index.spheres = cells.par_iter().with_min_len(4096).map(sphere).collect();
        index.records = cells.into_iter().map(|cell| cell.1).collect();
        index.levels = (0..=BITS).filter(|level| seen >> level & 1 == 1).collect();
        index
    }

    /// Calls `visit` with every record whose sphere holds the place, each once. False ends it.
    #[inline]
    pub fn near(&self, place: Vec3, mut visit: impl FnMut(u32) -> bool) {
        for &level in &self.levels {
            let key = words(key(level, self.cell(level, place)));
            let mut slot = self.slot(key);
            loop {
                let cell = self.cells[slot];
                if cell.key == key {
                    let range = cell.first as usize..(cell.first + cell.count) as usize;
                    for (sphere, record) in self.spheres[range.clone()].iter().zip(&self.records[range]) {
                        if sphere.truncate().distance_squared(place) < sphere.w && !visit(*record) {
                            return;
                        }
                    }
                }
                if cell.key == key || cell == Cell::default() {
                    break;
                }
                slot = (slot + 1) & (self.cells.len() - 1);
            }
        }
    }

    /// What lies outside of the grid counts as in its outermost cells.
    #[inline]
    fn cell(&self, level: u32, place: Vec3) -> [u64; 3] {
        let cells = (1u64 << level) as f32;
        let cell = (place - self.low) * (cells / self.width);
        cell.clamp(Vec3::ZERO, Vec3::splat(cells - 1.0)).to_array().map(|x| x as u64)
    }

    /// Of the cells that a sphere reaches.
    fn keys(&self, (centre, radius): &(Vec3, f32)) -> impl Iterator<Item = u64> {
        // Cells of places are found by other roundings.
        let reach = radius + 1e-6 * self.width;
        let fits = (self.width / (2.0 * radius).max(1e-30)).log2().floor();
        let level = fits.clamp(0.0, BITS as f32) as u32;
        let (first, last) = (self.cell(level, *centre - reach), self.cell(level, *centre + reach));
        let within = move |axis: usize| first[axis]..=last[axis];
        let all = within(2).flat_map(move |z| within(1).flat_map(move |y| within(0).map(move |x| [x, y, z])));
        // What lies outside of the grid belongs to its outermost cells: these are never left out.
        let (side, edge) = (self.width / (1u64 << level) as f32, (1u64 << level) - 1);
        let (centre, reach2) = (*centre - self.low, reach * reach);
        let touches = move |cell: &[u64; 3]| {
            let low = Vec3::from(cell.map(|x| x as f32)) * side;
            let by = centre - centre.clamp(low, low + side);
            by.length_squared() <= reach2 || cell.iter().any(|x| *x == 0 || *x == edge)
        };
        all.filter(touches).map(move |cell| key(level, cell))
    }

    /// Where a cell is looked for first.
    #[inline]
    fn slot(&self, [low, high]: [u32; 2]) -> usize {
        let mixed = (low.wrapping_mul(0x9e37_79b1) ^ high).wrapping_mul(0x85eb_ca6b);
        (mixed ^ mixed >> 15) as usize & (self.cells.len() - 1)
    }

    /// Bit l: grid l holds something.
    pub fn level_bits(&self) -> u32 {
        self.levels.iter().fold(0, |bits, level| bits | 1 << level)
    }
}

/// Low word first.
#[inline]
fn words(key: u64) -> [u32; 2] {
    [key as u32, (key >> 32) as u32]
}

/// The highest bit tells keys from empty slots; the level's own bits tell grids apart.
fn key(level: u32, [x, y, z]: [u64; 3]) -> u64 {
    1 << 63 | u64::from(level) << (3 * BITS) | z << (2 * BITS) | y << BITS | x
}

fn level_of(key: u64) -> u32 {
    (key >> (3 * BITS)) as u32 & 31
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sampling::{hash, unit};

    #[test]
    fn every_sphere_is_found_from_all_that_it_holds() {
        let random = |i: u32| unit(hash(i));
        let spheres: Vec<(Vec3, f32)> = (0..3000)
            .map(|i| {
                let at = Vec3::new(random(5 * i), 3.0 * random(5 * i + 1), 0.01 * random(5 * i + 2));
                (at, 10f32.powf(-8.0 * random(5 * i + 3)))
            })
            .collect();
        for spheres in [&spheres[..], &spheres[..1], &[]] {
            let index = Index::new(spheres);
            let place =
                |i: u32| Vec3::new(1.2 * random(!(3 * i)), 3.2 * random(!(3 * i + 1)), 0.02 * random(!(3 * i + 2)));
            let centres = spheres.iter().map(|sphere| sphere.0);
            for place in (0..4000).map(place).chain(centres) {
                let mut found = Vec::new();
                index.near(place, |record| {
                    found.push(record);
                    true
                });
                let count = found.len();
                found.sort_unstable();
                found.dedup();
                assert_eq!(found.len(), count, "each once");
                for (record, (centre, radius)) in spheres.iter().enumerate() {
                    let holds = centre.distance(place) < *radius;
                    assert!(!holds || found.contains(&(record as u32)), "{record} at {place}");
                }
            }
        }
    }

    /// Spheres far smaller than what roundings move the borders of cells by are found from their middles and rims.
    #[test]
    fn spheres_smaller_than_roundings_are_found() {
        let random = |i: u32| unit(hash(i));
        let spheres: Vec<(Vec3, f32)> = (0..50_000)
            .map(|i| {
                let at = 3.0 * Vec3::new(random(5 * i), random(5 * i + 1), random(5 * i + 2));
                (at, 10f32.powf(-5.0 - 5.0 * random(5 * i + 3)))
            })
            .collect();
        let index = Index::new(&spheres);
        for (record, (centre, radius)) in spheres.iter().enumerate() {
            let rims = Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]).map(|way| *centre + way * *radius * 0.999);
            for place in rims.chain([*centre]).filter(|place| place.distance_squared(*centre) < radius * radius) {
                let mut found = false;
                index.near(place, |near| {
                    found |= near == record as u32;
                    true
                });
                assert!(found, "{record} at {place}, of radius {radius}");
            }
        }
    }
}
