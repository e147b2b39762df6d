//! Computes a `Transfer`: places rows, casts their rays, packs what they see.

use crate::Result;
use crate::device::Device;
use crate::memo::{Key, NoMemo, Part};
use crate::progress::Progress;
use crate::scene::Geometry;
use crate::transport::Samples;
use crate::transport::blocks::{Block, Blocks, Kind};
use crate::transport::caster::Caster;
use crate::transport::gather::{Gather, Live};
use crate::transport::glossy::Gloss;
use crate::transport::rows::{self, Spacing};
use crate::transport::sides::live_sides;
use crate::transport::sparse::SparseRows;
use crate::transport::transfer::{Basis, Transfer};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How the weight of a gather sample in a row is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Estimator {
    /// Stratified cosine-distributed rays, credited where they land: no singularity, hundreds of rays a row.
    #[default]
    Rays,
    /// The geometry term and one shadow ray to every gather sample (thesis eq. 5.1).
    Points,
}

/// Where rows are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Placement {
    /// Dense near contacts and edges, sparse on open walls.
    #[default]
    Adaptive,
    /// At every view sample.
    Every,
}

/// Counts that follow from the tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Rays a row.
    pub rays: u32,
    /// Tree nodes credited, by squared radius over that of a ray's patch.
    pub credit: f32,
    pub spacing: Spacing,
    /// Share of a point-to-point row that merging its entries may move.
    pub slack: f32,
}

impl Quality {
    /// Measured in stage.glb against a path tracer: 1,024 rays and cells of a fifth of the distance to the surroundings
    /// reach 1.4 %. Ray noise falls with the power 3/4 of their number, the error of interpolation with the square of
    /// the cell.
    pub fn of(tolerance: f32, placement: Placement) -> Self {
        let finer = 0.02 / tolerance.max(1e-4);
        let rays = (1024.0 * finer.powf(4.0 / 3.0)).round().clamp(64.0, 16384.0) as u32;
        let relative = (0.2 * finer.sqrt().recip()).clamp(0.01, 0.6);
        let largest = if placement == Placement::Every { 1 } else { 16 };
        // A sixteenth of a ray's patch at the default; patches shrink as rays grow, nodes need not.
        let credit = (rays as f32 / 1024.0 / 16.0).min(1.0);
        Self { rays, credit, spacing: Spacing { largest, relative }, slack: tolerance }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    pub gather_samples: usize,
    pub bounces: u32,
    pub basis: Basis,
    /// Haar coefficients kept a row.
    pub coefficients: usize,
    pub estimator: Estimator,
    /// Of glossy rows, which are computed when they are needed (`transport::glossy`).
    pub glossy: Gloss,
    pub quality: Quality,
}

/// What the report says of a transfer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    pub rows: usize,
    pub rays: u64,
    pub entries: usize,
    /// Entries of the rows between gather samples.
    pub between: usize,
    /// Rows that were there already.
    pub found: usize,
    /// Rays that were only held against what moved since another frame.
    pub kept: u64,
}

/// Gather samples whose rows to each other are computed together.
const BETWEEN: usize = 4096;

/// The whole, out of what `blocks` holds already and what is computed now.
pub fn precompute(
    device: &Device,
    geometry: &Geometry,
    samples: &Arc<Samples>,
    settings: &Settings,
    blocks: &Blocks,
    progress: Progress,
) -> Result<(Transfer, Cost)> {
    let grid = samples.grid();
    let spacing = settings.quality.spacing;
    let live = live_sides(geometry, grid.points, blocks.memo)?;
    let gather = Gather::place(geometry, &live, settings.gather_samples)?;
    let known = blocks.find(Kind::View, grid.height.div_ceil(spacing.band(&grid)));
    let mut caster = Caster::new((device, blocks.memo), geometry, &gather, settings, Kind::View)?;
    let stage = progress.stage("transfer rows", grid.points.len() as u64);
    let layout = {
        let mut measure =
            |samples: &[usize], resolved: u64| caster.take_or_cast(grid.points, samples, &known, &stage, resolved);
        rows::place(&grid, spacing, &mut measure)?
    };
    drop(stage);
    let (rows, mut cost) = caster.finish()?;
    let between = match settings.bounces {
        1 => None,
        _ => Some(rows_between(device, geometry, (&gather, &live), settings, blocks, progress)?),
    };
    let between = between.map(|(rows, more)| {
        cost.rays += more.rays;
        cost.found += more.found;
        cost.kept += more.kept;
        cost.between = more.entries;
        rows
    });
    let indices: Vec<[u32; 4]> = layout.stencils.iter().map(|stencil| stencil.rows).collect();
    let weights: Vec<[f32; 4]> = layout.stencils.iter().map(|stencil| stencil.weights).collect();
    let row_samples: Vec<u32> = layout.row_samples.iter().map(|&sample| sample as u32).collect();
    let transfer = Transfer {
        samples: samples.clone(),
        gather,
        settings: *settings,
        rows,
        row_samples: row_samples.into(),
        indices: indices.into(),
        weights: weights.into(),
        between,
    };
    Ok((transfer, cost))
}

/// The rows between gather samples, and what they cost. When only the camera moves, they stay.
pub fn rows_between(
    device: &Device,
    geometry: &Geometry,
    (gather, live): (&Gather, &Live),
    settings: &Settings,
    blocks: &Blocks,
    progress: Progress,
) -> Result<(SparseRows, Cost)> {
    if !geometry.poses.is_empty() {
        return between(device, geometry, gather, settings, blocks, progress);
    }
    let settled = serde_json::to_vec(settings).expect("settings are plain data");
    let key = Key::of(&[b"between gather samples", &geometry.fingerprint, live, &settled]);
    let bytes = |(rows, _): &(SparseRows, Cost)| rows.bytes();
    let mut is_new = false;
    let make = || {
        is_new = true;
        between(device, geometry, gather, settings, blocks, progress)
    };
    let (rows, cost) = &*blocks.memo.remember(key, bytes, make)?;
    let found = if is_new { *cost } else { Cost { rays: 0, found: rows.rows(), ..*cost } };
    Ok((rows.clone(), found))
}

fn between(
    device: &Device,
    geometry: &Geometry,
    gather: &Gather,
    settings: &Settings,
    blocks: &Blocks,
    progress: Progress,
) -> Result<(SparseRows, Cost)> {
    let stage = progress.stage("rows between gather samples", gather.count() as u64);
    let known = blocks.find(Kind::Between, gather.count().div_ceil(BETWEEN));
    let mut caster = Caster::new((device, blocks.memo), geometry, gather, settings, Kind::Between)?;
    let all: Vec<usize> = (0..gather.count()).collect();
    for part in all.chunks(BETWEEN) {
        caster.take_or_cast(&gather.points, part, &known, &stage, part.len() as u64)?;
    }
    caster.finish()
}

/// Leaves a part of the rows in `blocks`; how many blocks were computed for that.
pub fn precompute_part(
    device: &Device,
    geometry: &Geometry,
    samples: &Arc<Samples>,
    settings: &Settings,
    (blocks, part): (&Blocks, Part),
    progress: Progress,
) -> Result<usize> {
    let grid = samples.grid();
    let live = live_sides(geometry, grid.points, blocks.memo)?;
    let gather = Gather::place(geometry, &live, settings.gather_samples)?;
    let (spacing, band) = (settings.quality.spacing, settings.quality.spacing.band(&grid));
    let stage = progress.stage("a part of the transfer rows", (grid.points.len() / part.count) as u64);
    let view = blocks.fill(Kind::View, grid.height.div_ceil(band), part, |number| {
        let mut caster = Caster::new((device, &NoMemo), geometry, &gather, settings, Kind::View)?;
        let (mut asked, mut distances) = (Vec::new(), Vec::new());
        let mut measure = |samples: &[usize], resolved: u64| {
            let found = caster.cast(grid.points, samples, &stage, resolved)?;
            asked.extend(samples.iter().map(|sample| *sample as u32));
            distances.extend_from_slice(&found);
            Ok(found)
        };
        let lines = number * band..grid.height.min((number + 1) * band);
        rows::place_within(&grid, spacing, lines, &mut measure)?;
        Ok(Block { samples: asked, distances, rows: caster.finish()?.0 })
    })?;
    drop(stage);
    if settings.bounces == 1 {
        return Ok(view);
    }
    let stage = progress.stage("a part of the rows between gather samples", (gather.count() / part.count) as u64);
    let all = blocks.fill(Kind::Between, gather.count().div_ceil(BETWEEN), part, |number| {
        let mut caster = Caster::new((device, &NoMemo), geometry, &gather, settings, Kind::Between)?;
        let samples: Vec<usize> = (number * BETWEEN..gather.count().min((number + 1) * BETWEEN)).collect();
        let distances = caster.cast(&gather.points, &samples, &stage, samples.len() as u64)?;
        let samples = samples.into_iter().map(|sample| sample as u32).collect();
        Ok(Block { samples, distances, rows: caster.finish()?.0 })
    })?;
    Ok(view + all)
}
