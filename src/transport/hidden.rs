//! Rows of what a view cannot see of some caster because something lies in between (thesis 5.4.2, removing indirect
//! shadows): visibility `V` becomes `V + amount (1 - V)`, so light becomes `E + amount H`, with `H` from these rows.

use crate::device::{Array, Device};
use crate::kernels::hidden_rows::{Walk, hidden_rows as cast};
use crate::progress::Progress;
use crate::scene::{Geometry, SurfacePoint};
use crate::stored::{SectionReader, SectionWriter, Stored};
use crate::transport::compress::count_nodes;
use crate::transport::pack::RowPacker;
use crate::transport::sparse::SparseRows;
use crate::transport::stored::{read_rows, write_rows};
use crate::transport::{Transfer, sampling};
use crate::{Error, Result};
use rayon::prelude::*;

/// Surfaces of the caster that one ray can find behind each other.
pub const LAYERS: u32 = 4;

/// Rays times layers before rows are packed: bounds the memory between the two.
const BATCH: usize = 4 << 20;

#[derive(Clone, Debug)]
pub struct Hidden {
    /// As many rows as the transfer has, in its basis; empty where not wanted.
    pub rows: SparseRows,
    /// Hits on the caster that were left out, because a ray had met `LAYERS` before.
    pub dropped: u64,
}

impl Hidden {
    pub fn bytes(&self) -> u64 {
        self.rows.bytes()
    }
}

/// What the first hits of the `wanted` rows' rays hide of the `admitted` gather samples (weights; above 0 is admitted).
///
/// A node of the gather tree that has admitted samples is credited whole: the rows are meant for light that is itself
/// weighted by the caster.
///
/// # Errors
/// Lists of other lengths than gather samples and rows; too little memory; `Cancelled`.
pub fn hidden_rows(
    device: &Device,
    geometry: &Geometry,
    transfer: &Transfer,
    admitted: &[f32],
    wanted: &[bool],
    progress: Progress,
) -> Result<Hidden> {
    let (gather, quality) = (&transfer.gather, transfer.settings.quality);
    for (what, found, expected) in
        [("gather samples", admitted.len(), gather.count()), ("rows", wanted.len(), transfer.rows.rows())]
    {
        if found != expected {
            let message = format!("hidden rows asked for {found} {what} of a transfer that has {expected}");
            return Err(Error::compute(message, "connect the same scene to transfer and relight"));
        }
    }
    let admitted: Array<u32> = nodes_above(admitted).into();
    let wanted: Vec<usize> = (0..wanted.len()).filter(|&row| wanted[row] && admitted[1] != 0).collect();
    let stage = progress.stage("hidden rows", wanted.len() as u64);
    let mut packer = RowPacker::new(&transfer.settings, gather.count())?;
    let mut dropped = 0;
    let looks = (quality.rays * LAYERS) as usize;
    for part in wanted.chunks((BATCH / looks).max(1)) {
        packer.require_memory(part.len(), looks, 4, "hidden rows")?;
        let sample = |row: &usize| transfer.row_samples[*row];
        let points: Vec<SurfacePoint> = part.iter().map(|row| transfer.samples.points[sample(row) as usize]).collect();
        let seeds: Vec<u32> = part.iter().map(|row| sampling::hash(sample(row))).collect();
        let walk = Walk { rays: quality.rays, credit: quality.credit, layers: LAYERS };
        let mut found = cast(device, geometry, gather, &points.into(), &seeds.into(), &admitted, walk)?;
        dropped += found.dropped.iter().map(|&dropped| u64::from(dropped)).sum::<u64>();
        // Rows between the wanted ones are empty: each run of neighbours is packed at once.
        let mut nodes = &mut found.nodes[..];
        for run in part.chunk_by(|a, b| a + 1 == *b) {
            packer.fill(run[0])?;
            let (here, rest) = nodes.split_at_mut(run.len() * looks);
            packer.push(here.par_chunks_mut(looks), |nodes, row| count_nodes(nodes, quality.rays, row))?;
            nodes = rest;
        }
        stage.advance(part.len() as u64)?;
    }
    packer.fill(transfer.rows.rows())?;
    Ok(Hidden { rows: packer.finish()?, dropped })
}

/// 1 for each of the 2M tree nodes below which a gather sample is admitted.
fn nodes_above(admitted: &[f32]) -> Vec<u32> {
    let count = admitted.len();
    let mut nodes = vec![0; count];
    nodes.extend(admitted.iter().map(|&weight| u32::from(weight > 0.0)));
    for node in (1..count).rev() {
        nodes[node] = nodes[2 * node] | nodes[2 * node + 1];
    }
    nodes
}

impl Stored for Hidden {
    fn write<'a>(&'a self, sections: &mut SectionWriter<'a>) {
        sections.value(&self.dropped);
        write_rows(&self.rows, sections);
    }

    fn read(sections: &mut SectionReader) -> Option<Self> {
        Some(Self { dropped: sections.value()?, rows: read_rows(sections)? })
    }
}
