//! Packs rows of (node, weight) pairs in the basis of a transfer, side by side, and puts them together in order.

use crate::transport::compress::HaarScratch;
use crate::transport::precompute::Settings;
use crate::transport::sparse::{EntryFormat, SparseRows, SparseRowsBuilder};
use crate::transport::transfer::Basis;
use crate::{Result, memory};
use rayon::prelude::*;

pub struct RowPacker {
    basis: Basis,
    coefficients: usize,
    /// Gather samples.
    gather: usize,
    format: EntryFormat,
    builder: SparseRowsBuilder,
}

impl RowPacker {
    /// For rows over `gather` samples.
    pub fn new(settings: &Settings, gather: usize) -> Result<Self> {
        let Settings { basis, coefficients, .. } = *settings;
        let format = EntryFormat::new(basis.index_bits(gather), basis == Basis::Haar)?;
        Ok(Self { basis, coefficients, gather, format, builder: SparseRowsBuilder::new(format)? })
    }

    /// So far.
    pub fn rows(&self) -> usize {
        self.builder.rows()
    }

    /// Asks for the memory of a batch of rows of `looks` looks of so many bytes, and for the entries to come of it if its
    /// rows are like those before; rows double as they grow.
    pub fn require_memory(&self, rows: usize, looks: usize, bytes: usize, what: &str) -> Result<()> {
        let per_row = self.builder.entries().div_ceil(self.builder.rows().max(1)).min(looks);
        let growth = 2 * self.builder.entries() + rows * per_row.max(looks / 4);
        let bytes = (bytes * rows * looks + 4 * growth) as u64;
        memory::require(bytes, what, "raise the tolerance, lower gather_samples, or render fewer pixels")
    }

    /// Appends rows; `spell` writes one as (node, weight) pairs.
    pub fn push<T: Send>(
        &mut self,
        rows: impl IndexedParallelIterator<Item = T>,
        spell: impl Fn(T, &mut Vec<(u32, f32)>) + Sync + Send,
    ) -> Result<()> {
        let Self { basis, coefficients, format, .. } = *self;
        let scratch = HaarScratch::new(if basis == Basis::Haar { self.gather } else { 0 });
        let packed: Vec<Result<(Vec<u32>, f32)>> = rows
            .map_init(
                || (Vec::new(), scratch.clone()),
                |(row, scratch), what| {
                    spell(what, row);
                    if basis == Basis::Haar {
                        scratch.haar_row(row, coefficients);
                    }
                    let mut entries = Vec::with_capacity(row.len());
                    let scale = format.pack_row(row, &mut entries)?;
                    Ok((entries, scale))
                },
            )
            .collect();
        for row in packed {
            let (entries, scale) = row?;
            self.builder.push_packed(&entries, scale)?;
        }
        Ok(())
    }

    /// Appends a row that was packed before, by a packer for the same settings.
    pub fn push_packed(&mut self, entries: &[u32], scale: f32) -> Result<()> {
        self.builder.push_packed(entries, scale)
    }

    /// Appends empty rows until there are `rows`.
    pub fn fill(&mut self, rows: usize) -> Result<()> {
        (self.rows()..rows).try_for_each(|_| self.builder.push_packed(&[], 0.0))
    }

    pub fn finish(self) -> Result<SparseRows> {
        self.builder.finish()
    }
}
