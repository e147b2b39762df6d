//! Parts of a transfer that were computed on their own: rows of some view samples, or of some gather samples.
//!
//! Where rows are needed is found by computing rows, so who computes a part cannot know exactly what the whole will ask
//! for. A block holds what one band of the picture asks for by itself; the whole takes from blocks what it finds there, and
//! computes the rest. Rows follow from their sample alone, so both are the same bit by bit.

use crate::Result;
use crate::memo::{Key, Memo, NoMemo, Part};
use crate::stored::{SectionReader, SectionWriter, Stored};
use crate::transport::SparseRows;
use crate::transport::stored::{read_rows, write_rows};
use std::collections::HashMap;
use std::sync::Arc;

/// Rows, the samples that they are of, and how far away the surroundings of each are (see `rows::Measure`).
#[derive(Clone, Debug)]
pub struct Block {
    /// Rising.
    pub samples: Vec<u32>,
    pub distances: Vec<[f32; 2]>,
    pub rows: SparseRows,
}

impl Stored for Block {
    fn write<'a>(&'a self, sections: &mut SectionWriter<'a>) {
        sections.slice(&self.samples);
        sections.slice(&self.distances);
        write_rows(&self.rows, sections);
    }

    fn read(sections: &mut SectionReader) -> Option<Self> {
        let (samples, distances) = (sections.vec::<u32>()?, sections.vec()?);
        let block = Self { samples, distances, rows: read_rows(sections)? };
        let count = block.samples.len();
        (block.distances.len() == count && block.rows.rows() == count).then_some(block)
    }
}

/// The blocks of one transfer.
pub struct Blocks<'a> {
    pub memo: &'a dyn Memo,
    /// Of the transfer.
    pub key: Key,
}

/// What the columns of rows belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    View,
    Between,
}

impl Blocks<'static> {
    /// Nothing is there, and nothing is kept.
    pub fn none() -> Self {
        Self { memo: &NoMemo, key: Key::of(&[]) }
    }
}

impl Blocks<'_> {
    fn key(&self, kind: Kind, number: usize) -> Key {
        Key::of(&[b"transfer block", &self.key.0, &[kind as u8], &number.to_le_bytes()])
    }

    /// Computes and lays down those of `count` blocks that are this run's to do and are not there yet; how many those
    /// were.
    ///
    /// # Errors
    /// That of `compute`, and as `Memo::save`.
    pub fn fill(
        &self,
        kind: Kind,
        count: usize,
        part: Part,
        mut compute: impl FnMut(usize) -> Result<Block>,
    ) -> Result<usize> {
        let mut computed = 0;
        for number in (0..count).filter(|number| part.has(*number)) {
            let key = self.key(kind, number);
            if self.memo.find::<Block>(key).is_none() {
                self.memo.lay_down(key, &compute(number)?)?;
                computed += 1;
            }
        }
        Ok(computed)
    }

    /// What there is of `count` blocks.
    pub fn find(&self, kind: Kind, count: usize) -> Known {
        let mut known = Known::default();
        for block in (0..count).filter_map(|number| self.memo.find::<Block>(self.key(kind, number))) {
            let block = Arc::new(block);
            known.rows.extend((0u32..).zip(&block.samples).map(|(row, sample)| (*sample, (block.clone(), row))));
        }
        known
    }
}

/// Rows that are there already, by sample.
#[derive(Default)]
pub struct Known {
    rows: HashMap<u32, (Arc<Block>, u32)>,
}

impl Known {
    /// Packed entries and their scale, and the distances.
    pub fn row(&self, sample: usize) -> Option<(&[u32], f32, [f32; 2])> {
        let (block, row) = self.rows.get(&(sample as u32))?;
        let (row, rows) = (*row as usize, &block.rows);
        let range = rows.offsets()[row] as usize..rows.offsets()[row + 1] as usize;
        Some((&rows.entries()[range], rows.scale()[row], block.distances[row]))
    }

    pub fn len(&self) -> usize {
        self.rows.len()
    }

    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}
