//! What samples see of an environment: rows per group of objects and cube face, and edits of them.
//!
//! A row holds what is hidden, not what is seen: the shadow `S = H - V` of a sample, the directions `H` above its horizon
//! without those `V` that it sees. A sample that nothing hides from costs nothing, the horizon (which the normal tells)
//! is stored nowhere, and groups go together as `S = 1 - product of (1 - S_group)`.

use super::ShadowEdit;
use super::haar::{self, HaarBasis, Truncation};
use super::horizon;
use crate::device::Array;
use crate::scene::cube::FACES;
use crate::stored::{SectionReader, SectionWriter, Stored};
use crate::transport::Samples;
use crate::transport::runs::Runs;
use crate::transport::sparse::{EntryFormat, SparseRows};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How rows are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// Runs of hidden texels, exact.
    #[default]
    Runs,
    /// The heaviest coefficients of the 2D Haar basis, non-standard decomposition (thesis 6.5).
    Haar2d,
    /// The heaviest coefficients of the 1D Haar basis along the face's texels in reading order, for comparison.
    Haar1d,
}

impl Basis {
    /// `None` for runs.
    pub fn haar(self) -> Option<HaarBasis> {
        match self {
            Self::Runs => None,
            Self::Haar2d => Some(HaarBasis::Square),
            Self::Haar1d => Some(HaarBasis::Line),
        }
    }
}

#[derive(Clone, Debug)]
pub struct Visibility {
    pub samples: Arc<Samples>,
    /// Texels along a side of each face.
    pub size: usize,
    pub basis: Basis,
    /// Of rows in a Haar basis.
    pub truncation: Truncation,
    /// Directions without light were left out, as if nothing hid them.
    pub lit_only: bool,
    /// A sample sees what no group hides. The last group holds all objects that no other does.
    pub groups: Vec<Group>,
    /// In order.
    pub edits: Vec<ShadowEdit>,
}

/// Objects that cast shadows together.
#[derive(Clone, Debug)]
pub struct Group {
    pub name: String,
    /// Indices into `Geometry::objects`, rising.
    pub objects: Vec<u32>,
    /// What they hide of each face; `None` for a face that was not asked for, where they are taken to hide nothing.
    pub faces: [Option<Arc<Rows>>; FACES],
}

/// Shadows of all samples on one face.
#[derive(Clone, Debug)]
pub struct Rows {
    pub size: usize,
    pub data: Data,
}

#[derive(Clone, Debug)]
pub enum Data {
    Runs(Runs),
    /// `size * size` columns.
    Haar(HaarBasis, SparseRows),
}

impl Rows {
    pub fn rows(&self) -> usize {
        match &self.data {
            Data::Runs(runs) => runs.rows(),
            Data::Haar(_, rows) => rows.rows(),
        }
    }

    pub fn bytes(&self) -> u64 {
        match &self.data {
            Data::Runs(runs) => runs.bytes(),
            Data::Haar(_, rows) => rows.bytes(),
        }
    }

    /// Toggles or coefficients of a row.
    pub fn count(&self, row: usize) -> usize {
        let offsets = match &self.data {
            Data::Runs(runs) => runs.offsets(),
            Data::Haar(_, rows) => rows.offsets(),
        };
        (offsets[row + 1] - offsets[row]) as usize
    }

    /// Never the same for two sets of rows made in one process.
    pub fn id(&self) -> u64 {
        match &self.data {
            Data::Runs(runs) => runs.words().id(),
            Data::Haar(_, rows) => rows.entries().id(),
        }
    }

    /// The shadow `S` of a row, n n values: 0 or 1 for runs, about that for a truncated row.
    pub fn decode(&self, row: usize, scratch: &mut Scratch, face: &mut [f32]) {
        match &self.data {
            Data::Runs(runs) => {
                face.fill(0.0);
                runs.spans(row).for_each(|span| face[span].fill(1.0));
            }
            Data::Haar(_, rows) if self.count(row) == 0 => face[..rows.columns()].fill(0.0),
            Data::Haar(basis, rows) => {
                scratch.coefficients.clear();
                scratch.coefficients.resize(self.size * self.size, 0.0);
                rows.row(row).for_each(|(place, value)| scratch.coefficients[place] = value);
                haar::decode(*basis, self.size, &scratch.coefficients, &mut scratch.face, face);
            }
        }
    }

    /// Sets the bits of a row's shadow (bit `i % 32` of word `i / 32`) and leaves the others; of a truncated row those
    /// of at least one half.
    pub fn hidden(&self, row: usize, scratch: &mut Scratch, mask: &mut [u32]) {
        match &self.data {
            Data::Runs(runs) => runs.fill(row, mask),
            Data::Haar(..) => {
                let mut face = std::mem::take(&mut scratch.values);
                face.resize(self.size * self.size, 0.0);
                self.decode(row, scratch, &mut face);
                for (word, values) in mask.iter_mut().zip(face.chunks(32)) {
                    *word |= values.iter().rev().fold(0, |bits, value| bits << 1 | u32::from(*value >= 0.5));
                }
                scratch.values = face;
            }
        }
    }
}

/// Memory that decoding rows reuses.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    pub(super) coefficients: Vec<f32>,
    face: Vec<f32>,
    values: Vec<f32>,
}

impl Visibility {
    pub fn bytes(&self) -> u64 {
        self.groups.iter().flat_map(|group| group.faces.iter().flatten()).map(|rows| rows.bytes()).sum()
    }

    /// The groups' rows of a face; empty for a face that was not asked for.
    pub fn face(&self, face: usize) -> Vec<&Arc<Rows>> {
        self.groups.iter().filter_map(|group| group.faces[face].as_ref()).collect()
    }

    /// The directions of a face above the horizon of a sample, as bits (`H`).
    pub fn horizon(&self, sample: usize, face: usize, mask: &mut [u32]) {
        horizon::mask(Vec3::from(self.samples.points[sample].normal), face, self.size, mask);
    }

    /// The directions of a face that a sample sees past all groups, before edits, as bits (`V`).
    pub fn open(&self, sample: usize, face: usize, scratch: &mut Scratch, mask: &mut [u32]) {
        self.horizon(sample, face, mask);
        let mut hidden = vec![0; mask.len()];
        self.face(face).iter().for_each(|rows| rows.hidden(sample, scratch, &mut hidden));
        mask.iter_mut().zip(&hidden).for_each(|(open, hidden)| *open &= !hidden);
    }

    /// The shadow `S` of a sample on a face by all groups together, before edits, n n values.
    pub fn shadow(&self, sample: usize, face: usize, scratch: &mut Scratch, values: &mut [f32]) {
        match self.face(face).as_slice() {
            [] => values.fill(0.0),
            [rows] => rows.decode(sample, scratch, values),
            groups => {
                let mut one = std::mem::take(&mut scratch.values);
                one.resize(values.len(), 0.0);
                values.fill(1.0);
                for rows in groups.iter().filter(|rows| rows.count(sample) > 0) {
                    rows.decode(sample, scratch, &mut one);
                    // What truncation rings beyond 0 and 1 would grow from group to group.
                    values.iter_mut().zip(&one).for_each(|(seen, hidden)| *seen *= 1.0 - hidden.clamp(0.0, 1.0));
                }
                values.iter_mut().for_each(|value| *value = 1.0 - *value);
                scratch.values = one;
            }
        }
    }
}

impl Stored for Rows {
    fn write<'a>(&'a self, sections: &mut SectionWriter<'a>) {
        match &self.data {
            Data::Runs(runs) => {
                sections.value(&(self.size, None::<HaarBasis>, 0u32, false));
                sections.slice(runs.offsets());
                sections.slice(runs.words());
            }
            Data::Haar(basis, rows) => {
                sections.value(&(self.size, Some(*basis), rows.format().index_bits, rows.format().signed));
                sections.slice(rows.offsets());
                sections.slice(rows.entries());
                sections.slice(rows.scale());
            }
        }
    }

    fn read(sections: &mut SectionReader) -> Option<Self> {
        let (size, basis, index_bits, signed): (usize, Option<HaarBasis>, u32, bool) = sections.value()?;
        let (offsets, words) = (sections.vec::<u32>()?, Array::<u32>::read(sections)?);
        let data = match basis {
            None => Data::Runs(Runs::new(size, offsets, words).ok()?),
            Some(basis) => {
                let format = EntryFormat { index_bits, signed };
                let scale: Vec<f32> = sections.vec()?;
                let rows = SparseRows::new(offsets, words, scale, format).ok()?;
                Data::Haar(basis, (rows.columns() == size.checked_mul(size)?).then_some(rows)?)
            }
        };
        Some(Self { size, data })
    }
}
