//! Casts the rows of a transfer, and packs what they see.

use crate::Result;
use crate::device::{Array, Device};
use crate::kernels::transfer_points::transfer_points;
use crate::kernels::transfer_rows::{Before, Starts, transfer_rows};
use crate::memo::Memo;
use crate::progress::Stage;
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::blocks::{Kind, Known};
use crate::transport::compress::{count_nodes, leaves, merge_siblings};
use crate::transport::gather::Gather;
use crate::transport::met::Remembered;
use crate::transport::pack::RowPacker;
use crate::transport::precompute::{Cost, Estimator, Quality, Settings};
use crate::transport::sampling;
use crate::transport::sparse::SparseRows;
use crate::transport::transfer::Basis;
use rayon::prelude::*;

/// Rays cast before rows are packed: bounds the memory between the two.
const BATCH_RAYS: usize = 4 << 20;

pub struct Caster<'a> {
    device: &'a Device,
    geometry: &'a Geometry,
    gather: &'a Gather,
    settings: &'a Settings,
    quality: Quality,
    packer: RowPacker,
    remembered: Remembered<'a>,
    /// Of point-to-point rows: of `Gather::area`, what each gather sample stands for in this pose. Empty: all of it.
    shares: Vec<f32>,
    cost: Cost,
}

impl<'a> Caster<'a> {
    /// `memo`: where to look for what rays met in other frames.
    pub fn new(
        (device, memo): (&'a Device, &'a dyn Memo),
        geometry: &'a Geometry,
        gather: &'a Gather,
        settings: &'a Settings,
        kind: Kind,
    ) -> Result<Self> {
        let quality = match kind {
            Kind::View => settings.quality,
            Kind::Between => between(settings),
        };
        let packer = RowPacker::new(settings, gather.count())?;
        let remembered = Remembered::new(memo, geometry, &[kind as u8], quality.rays as usize);
        let shares = match settings.estimator {
            Estimator::Points => gather.shares(geometry),
            Estimator::Rays => Vec::new(),
        };
        Ok(Self { device, geometry, gather, settings, quality, packer, remembered, shares, cost: Cost::default() })
    }

    /// Appends the rows of these points, known ones as they are; their distances.
    pub fn take_or_cast(
        &mut self,
        points: &[SurfacePoint],
        samples: &[usize],
        known: &Known,
        stage: &Stage,
        resolved: u64,
    ) -> Result<Vec<[f32; 2]>> {
        if known.is_empty() {
            return self.cast(points, samples, stage, resolved);
        }
        let mut distances = Vec::with_capacity(samples.len());
        let is_known = |sample: &usize| known.row(*sample).is_some();
        for run in samples.chunk_by(|a, b| is_known(a) == is_known(b)) {
            if !is_known(&run[0]) {
                distances.extend(self.cast(points, run, stage, 0)?);
                continue;
            }
            for (entries, scale, distance) in run.iter().filter_map(|sample| known.row(*sample)) {
                self.packer.push_packed(entries, scale)?;
                distances.push(distance);
                self.cost.found += 1;
            }
        }
        stage.advance(resolved)?;
        Ok(distances)
    }

    /// Appends the rows of these points; their distances.
    pub fn cast(
        &mut self,
        points: &[SurfacePoint],
        samples: &[usize],
        stage: &Stage,
        resolved: u64,
    ) -> Result<Vec<[f32; 2]>> {
        let mut distances = Vec::with_capacity(samples.len());
        let looks = match self.settings.estimator {
            Estimator::Rays => self.quality.rays as usize,
            Estimator::Points => self.gather.count(),
        };
        for part in samples.chunks((BATCH_RAYS / looks).max(1)) {
            self.packer.require_memory(part.len(), looks, 4, "transfer rows")?;
            let chosen: Array<SurfacePoint> = part.iter().map(|&i| points[i]).collect::<Vec<_>>().into();
            distances.append(&mut match self.settings.estimator {
                Estimator::Rays => self.shoot(&chosen, part)?,
                Estimator::Points => self.connect(&chosen)?,
            });
            self.cost.rays += (part.len() * looks) as u64;
            stage.advance(0)?;
        }
        stage.advance(resolved)?;
        Ok(distances)
    }

    fn shoot(&mut self, points: &Array<SurfacePoint>, samples: &[usize]) -> Result<Vec<[f32; 2]>> {
        let seeds: Array<u32> = samples.iter().map(|&i| sampling::hash(i as u32)).collect::<Vec<_>>().into();
        let Quality { rays, credit, .. } = self.quality;
        let before = self.remembered.before(samples, points);
        let before = before.as_ref().map(|(change, met)| Before { change, met });
        let starts = Starts { points, seeds: &seeds, before };
        let mut cast = transfer_rows(self.device, self.geometry, self.gather, &starts, rays, credit)?;
        self.remembered.take(samples, points, &cast.met);
        self.cost.kept += cast.kept;
        self.packer.push(cast.nodes.par_chunks_mut(rays as usize), |nodes, row| count_nodes(nodes, rays, row))?;
        Ok(cast.distances)
    }

    fn connect(&mut self, points: &Array<SurfacePoint>) -> Result<Vec<[f32; 2]>> {
        let mut connected = transfer_points(self.device, self.geometry, self.gather, points)?;
        let count = self.gather.count();
        if !self.shares.is_empty() {
            let scale = |row: &mut [f32]| row.iter_mut().zip(&self.shares).for_each(|(weight, share)| *weight *= share);
            connected.weights.par_chunks_mut(count).for_each(scale);
        }
        let (basis, slack) = (self.settings.basis, self.settings.quality.slack);
        self.packer.push(connected.weights.par_chunks(count), |weights, row| match basis {
            Basis::Cut => merge_siblings(weights, slack, row),
            Basis::Haar => leaves(weights, row),
        })?;
        Ok(connected.distances)
    }

    pub fn finish(self) -> Result<(SparseRows, Cost)> {
        self.remembered.keep();
        let rows = self.packer.finish()?;
        let cost = Cost { rows: rows.rows(), entries: rows.entries().len(), ..self.cost };
        Ok((rows, cost))
    }
}

/// Rows between gather samples carry light that is scattered again: a quarter of the rays does.
fn between(settings: &Settings) -> Quality {
    Quality { rays: settings.quality.rays.div_ceil(4).max(16), ..settings.quality }
}
