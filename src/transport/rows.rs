//! Where transfer rows are computed, and how view samples interpolate the light between them.
//!
//! Indirect light varies slowly on open surfaces and fast near contacts (Ward et al. 1988). The view samples form a
//! grid (pixels, or parts of pixels). Square cells whose samples lie on one smooth surface interpolate bilinearly
//! between rows at their corners, if the cell is small against the distance to what the corners see; other cells are cut
//! in four. Samples left over at silhouettes share a row with near samples of the same surface. So rows are few on
//! walls and dense in corners, and never mix surfaces.

use crate::scene::SurfacePoint;
use crate::scene::geometry::NONE;
use glam::Vec3;
use std::ops::Range;

/// How finely rows are placed; all from the tolerance.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Spacing {
    /// Largest cell, in pixels; a power of two. 1: a row for every sample.
    pub largest: usize,
    /// Largest cell edge over the distance to the surroundings.
    pub relative: f32,
}

/// View samples seen as a grid of `width` x `height`.
pub struct Grid<'a> {
    pub points: &'a [SurfacePoint],
    pub width: usize,
    pub height: usize,
    /// Samples across and down a pixel.
    pub across: usize,
    pub down: usize,
}

impl Grid<'_> {
    /// Index of a grid position in the samples' own order (samples of a pixel together).
    pub fn index(&self, x: usize, y: usize) -> usize {
        let (px, py) = (x / self.across, y / self.down);
        let pixel = py * (self.width / self.across) + px;
        pixel * self.across * self.down + (y % self.down) * self.across + x % self.across
    }

    fn point(&self, x: usize, y: usize) -> &SurfacePoint {
        &self.points[self.index(x, y)]
    }
}

/// Up to four rows and their weights, for one view sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stencil {
    pub rows: [u32; 4],
    pub weights: [f32; 4],
}

impl Stencil {
    pub const NOTHING: Self = Self { rows: [0; 4], weights: [0.0; 4] };

    pub fn one(row: u32) -> Self {
        Self { rows: [row; 4], weights: [1.0, 0.0, 0.0, 0.0] }
    }
}

/// Computes rows at grid samples and says how far away their surroundings are: per index harmonic mean and least
/// distance. The planner asks in batches, each sample once, and says how many samples have got their rows since.
pub type Measure<'a> = dyn FnMut(&[usize], u64) -> crate::Result<Vec<[f32; 2]>> + 'a;

pub struct Layout {
    /// Sample index of each row, in the order in which `Measure` was asked for them.
    pub row_samples: Vec<usize>,
    pub stencils: Vec<Stencil>,
}

#[derive(Clone, Copy)]
struct Cell {
    x: usize,
    y: usize,
    size: usize,
}

struct Planner<'a, 'm> {
    grid: &'a Grid<'a>,
    spacing: Spacing,
    measure: &'m mut Measure<'m>,
    /// Row of each sample that has one.
    row: Vec<u32>,
    row_samples: Vec<usize>,
    /// Per row: the distance that cell sizes are held against.
    reach: Vec<f32>,
    stencils: Vec<Stencil>,
    /// Samples given a stencil since the last measurement.
    resolved: u64,
}

impl Spacing {
    /// Rows of the grid that make a band: what is asked for in a band does not depend on others.
    pub fn band(&self, grid: &Grid) -> usize {
        16 * self.finest(grid)
    }

    /// Samples across a pixel, rounded down to a power of two: finer cells follow its surroundings, not its silhouette.
    /// 1 where every sample has a row.
    fn finest(&self, grid: &Grid) -> usize {
        match self.largest {
            1 => 1,
            _ => 1 << grid.across.min(grid.down).ilog2(),
        }
    }
}

/// Places rows over the whole grid.
pub fn place<'m>(grid: &Grid, spacing: Spacing, measure: &'m mut Measure<'m>) -> crate::Result<Layout> {
    place_within(grid, spacing, 0..grid.height, measure)
}

/// Places rows over some rows of the grid; both ends are multiples of `Spacing::band`, or the last is the grid's.
pub fn place_within<'m>(
    grid: &Grid,
    spacing: Spacing,
    lines: Range<usize>,
    measure: &'m mut Measure<'m>,
) -> crate::Result<Layout> {
    let count = grid.points.len();
    let mut planner = Planner {
        grid,
        spacing,
        measure,
        row: vec![NONE; count],
        row_samples: Vec::new(),
        reach: Vec::new(),
        stencils: vec![Stencil::NOTHING; count],
        resolved: 0,
    };
    let loose = planner.subdivide(lines)?;
    planner.share(loose)?;
    Ok(Layout { row_samples: planner.row_samples, stencils: planner.stencils })
}

impl Planner<'_, '_> {
    fn subdivide(&mut self, lines: Range<usize>) -> crate::Result<Vec<(usize, usize)>> {
        let finest = self.finest();
        let mut size = self.spacing.largest * finest;
        let mut cells: Vec<Cell> = lines
            .step_by(size)
            .flat_map(|y| (0..self.grid.width).step_by(size).map(move |x| Cell { x, y, size }))
            .collect();
        let mut loose = Vec::new();
        while !cells.is_empty() {
            if size == 1 {
                loose.extend(cells.iter().map(|cell| (cell.x, cell.y)));
                break;
            }
            // What varies within a pixel is averaged away: cells need not be smaller than one.
            let (smooth, mut broken): (Vec<Cell>, Vec<Cell>) = cells.into_iter().partition(|cell| self.is_smooth(cell));
            if size <= finest {
                loose.extend(broken.drain(..).flat_map(|cell| self.within(&cell)));
            }
            let wanted: Vec<usize> = smooth.iter().flat_map(|cell| self.corners(cell)).collect();
            self.compute(wanted)?;
            for cell in smooth {
                if size <= finest && finest > 1 || self.is_small(&cell) {
                    self.interpolate(&cell)
                } else {
                    broken.push(cell)
                }
            }
            size /= 2;
            cells = broken
                .iter()
                .flat_map(|cell| {
                    [(0, 0), (size, 0), (0, size), (size, size)].map(|(dx, dy)| Cell {
                        x: cell.x + dx,
                        y: cell.y + dy,
                        size,
                    })
                })
                .filter(|cell| cell.x < self.grid.width && cell.y < self.grid.height)
                .collect();
        }
        Ok(loose)
    }

    fn finest(&self) -> usize {
        self.spacing.finest(self.grid)
    }

    fn within(&self, cell: &Cell) -> Vec<(usize, usize)> {
        let (x1, y1) = ((cell.x + cell.size).min(self.grid.width), (cell.y + cell.size).min(self.grid.height));
        (cell.y..y1).flat_map(|y| (cell.x..x1).map(move |x| (x, y))).collect()
    }

    /// The far edge of a cell's corners, which may lie in the next cell.
    fn far(&self, cell: &Cell) -> (usize, usize) {
        ((cell.x + cell.size).min(self.grid.width - 1), (cell.y + cell.size).min(self.grid.height - 1))
    }

    fn corners(&self, cell: &Cell) -> [usize; 4] {
        let (x1, y1) = self.far(cell);
        [(cell.x, cell.y), (x1, cell.y), (cell.x, y1), (x1, y1)].map(|(x, y)| self.grid.index(x, y))
    }

    /// All samples, corners included, lie on one surface that hardly bends.
    fn is_smooth(&self, cell: &Cell) -> bool {
        let (x1, y1) = self.far(cell);
        let corners = self.corners(cell).map(|index| &self.grid.points[index]);
        if corners.iter().any(|corner| !corner.exists()) {
            return false;
        }
        let extent = corners
            .map(|c| Vec3::from(c.position) - Vec3::from(corners[0].position))
            .iter()
            .fold(0.0f32, |a, d| a.max(d.length()));
        let straight = self.straight();
        (cell.y..=y1).all(|y| (cell.x..=x1).all(|x| same_surface(corners[0], self.grid.point(x, y), extent, straight)))
    }

    /// Light on a bent surface varies with the normal as it does with place over distance.
    fn straight(&self) -> f32 {
        self.spacing.relative.min(1.0).cos()
    }

    fn is_small(&self, cell: &Cell) -> bool {
        let corners = self.corners(cell);
        let position = |i: usize| Vec3::from(self.grid.points[corners[i]].position);
        let extent = (position(3) - position(0)).length().max((position(2) - position(1)).length());
        let reach = corners.iter().map(|&i| self.reach[self.row[i] as usize]).fold(f32::INFINITY, f32::min);
        extent <= self.spacing.relative * reach
    }

    fn interpolate(&mut self, cell: &Cell) {
        let (x1, y1) = self.far(cell);
        let rows = self.corners(cell).map(|i| self.row[i]);
        for (x, y) in self.within(cell) {
            let fx = if x1 > cell.x { (x - cell.x) as f32 / (x1 - cell.x) as f32 } else { 0.0 };
            let fy = if y1 > cell.y { (y - cell.y) as f32 / (y1 - cell.y) as f32 } else { 0.0 };
            let weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
            self.stencils[self.grid.index(x, y)] = Stencil { rows, weights };
            self.resolved += 1;
        }
    }

    /// Groups left-over samples by surface in 4 x 4 blocks, one row a group; groups too wide for their surroundings are
    /// cut again.
    fn share(&mut self, loose: Vec<(usize, usize)>) -> crate::Result<()> {
        let mut todo: Vec<Vec<(usize, usize)>> = Vec::new();
        let mut loose: Vec<(usize, usize)> =
            loose.into_iter().filter(|&(x, y)| self.grid.point(x, y).exists()).collect();
        let mut size = self.spacing.largest.min(4) * self.finest();
        loose.sort_unstable_by_key(|&(x, y)| (y / size, x / size, y, x));
        for block in loose.chunk_by(|a, b| (a.1 / size, a.0 / size) == (b.1 / size, b.0 / size)) {
            todo.extend(self.groups(block));
        }
        while !todo.is_empty() {
            let chosen: Vec<usize> = todo.iter().map(|group| self.middle(group)).collect();
            self.compute(chosen.clone())?;
            let mut wide = Vec::new();
            for (group, &middle) in todo.iter().zip(&chosen) {
                let row = self.row[middle];
                let centre = Vec3::from(self.grid.points[middle].position);
                let limit = 0.5 * self.spacing.relative * self.reach[row as usize];
                let fits =
                    |&(x, y): &(usize, usize)| (Vec3::from(self.grid.point(x, y).position) - centre).length() <= limit;
                if size <= self.finest() || group.iter().all(fits) {
                    for &(x, y) in group {
                        self.stencils[self.grid.index(x, y)] = Stencil::one(row);
                        self.resolved += 1;
                    }
                } else {
                    wide.extend_from_slice(group);
                }
            }
            size = (size / 2).max(1);
            wide.sort_unstable_by_key(|&(x, y)| (y / size, x / size, y, x));
            todo = wide
                .chunk_by(|a, b| (a.1 / size, a.0 / size) == (b.1 / size, b.0 / size))
                .flat_map(|block| self.groups(block))
                .collect();
        }
        Ok(())
    }

    fn groups(&self, block: &[(usize, usize)]) -> Vec<Vec<(usize, usize)>> {
        // A group has one light for all: it may bend half as much as a cell that interpolates.
        let straight = (0.5 * self.spacing.relative.min(1.0)).cos();
        let mut groups: Vec<Vec<(usize, usize)>> = Vec::new();
        for &(x, y) in block {
            let point = self.grid.point(x, y);
            let fits = |group: &&mut Vec<(usize, usize)>| {
                let first = self.grid.point(group[0].0, group[0].1);
                let apart = (Vec3::from(first.position) - Vec3::from(point.position)).length();
                same_surface(first, point, apart, straight)
            };
            match groups.iter_mut().find(fits) {
                Some(group) => group.push((x, y)),
                None => groups.push(vec![(x, y)]),
            }
        }
        groups
    }

    /// The member nearest to the group's centre.
    fn middle(&self, group: &[(usize, usize)]) -> usize {
        let count = group.len() as f32;
        let sum = group.iter().fold((0.0, 0.0), |s, &(x, y)| (s.0 + x as f32, s.1 + y as f32));
        let centre = (sum.0 / count, sum.1 / count);
        let distance = |&&(x, y): &&(usize, usize)| (x as f32 - centre.0).powi(2) + (y as f32 - centre.1).powi(2);
        let &(x, y) = group.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("groups are not empty");
        self.grid.index(x, y)
    }

    /// Computes the rows of these samples that are not there yet.
    fn compute(&mut self, mut samples: Vec<usize>) -> crate::Result<()> {
        samples.sort_unstable();
        samples.dedup();
        samples.retain(|&sample| self.row[sample] == NONE);
        let distances = (self.measure)(&samples, std::mem::take(&mut self.resolved))?;
        for (&sample, [harmonic, least]) in samples.iter().zip(distances) {
            self.row[sample] = self.row_samples.len() as u32;
            self.row_samples.push(sample);
            self.reach.push(harmonic.min(LEAST * least));
        }
        Ok(())
    }
}

/// A near edge matters before it lowers the harmonic mean.
const LEAST: f32 = 3.0;

/// Same object and material, normals whose cosine is at least `straight`, and hardly off each other's plane for their distance.
fn same_surface(a: &SurfacePoint, b: &SurfacePoint, extent: f32, straight: f32) -> bool {
    let between = Vec3::from(b.position) - Vec3::from(a.position);
    let off = between.dot(a.geometric_normal.into()).abs();
    a.object == b.object
        && a.material == b.material
        && Vec3::from(a.normal).dot(b.normal.into()) >= straight
        && off <= 0.25 * extent + 1e-6
}
