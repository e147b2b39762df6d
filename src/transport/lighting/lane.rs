//! One transfer matrix and the samples that its rows give light to, and cut-outs of it: the rows that some samples need,
//! with the entries that one part of the light takes. What an edit does not touch it does not multiply.

use super::positions::Positions;
use super::shares::Shares;
use super::sums::Given;
use super::{Stage, VEC4};
use crate::device::Array;
use crate::kernels::{average_pyramid, entry_ways};
use crate::memo::Key;
use crate::transport::SparseRows;
use crate::transport::glossy::GlossyTransfer;
use crate::transport::hidden::Hidden;
use crate::transport::sparse::EntryFormat;
use crate::transport::transfer::Basis;
use crate::{Error, Result, memory};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

pub struct Lane<'a> {
    pub rows: &'a SparseRows,
    /// View sample of each row.
    pub row_samples: &'a [u32],
    /// View sample of each sample of the lane; `None`: all of them, in order.
    pub samples: Option<&'a [u32]>,
    /// Rows that each sample interpolates between, and their weights.
    pub indices: Array<[u32; 4]>,
    pub weights: Array<[f32; 4]>,
    /// Shadows on its samples can be weakened: hidden rows are laid out as its rows.
    pub sees_through: bool,
    /// Names all of that.
    pub key: Key,
}

impl<'a> Lane<'a> {
    /// Irradiance at all view samples.
    pub fn diffuse(stage: &Stage<'a>) -> Self {
        let transfer = stage.transfer;
        Self {
            rows: &transfer.rows,
            row_samples: &transfer.row_samples,
            samples: None,
            indices: transfer.indices.clone(),
            weights: transfer.weights.clone(),
            sees_through: true,
            key: Key::of(&[b"diffuse", &stage.place.0]),
        }
    }

    /// Samples of the lane.
    pub fn count(&self) -> usize {
        self.indices.len()
    }

    /// View sample of a sample of the lane.
    pub fn view_sample(&self, sample: usize) -> usize {
        self.samples.map_or(sample, |samples| samples[sample] as usize)
    }
}

/// The two lanes of glossy receivers: light to be multiplied by F0, and light of the Fresnel part.
pub struct GlossyLanes<'a> {
    glossy: &'a GlossyTransfer,
    key: Key,
    row_samples: Vec<u32>,
}

impl<'a> GlossyLanes<'a> {
    /// `key` names the glossy transfer.
    pub fn new(glossy: &'a GlossyTransfer, key: Key) -> Self {
        // Two rows a place.
        let row_samples = glossy.place_samples.iter().flat_map(|&sample| [sample, sample]).collect();
        Self { glossy, key, row_samples }
    }

    pub fn lanes(&self) -> [Lane<'_>; 2] {
        [0, 1].map(|part| {
            let rows: Vec<[u32; 4]> =
                self.glossy.indices.iter().map(|four| four.map(|place| 2 * place + part)).collect();
            Lane {
                rows: &self.glossy.rows,
                row_samples: &self.row_samples,
                samples: Some(&self.glossy.samples),
                indices: rows.into(),
                weights: self.glossy.weights.clone(),
                sees_through: false,
                key: Key::of(&[b"glossy lane", &self.key.0, &part.to_le_bytes()]),
            }
        })
    }
}

/// Rows of a lane that some of its samples need, without the entries that carry no light.
pub struct CutOut {
    pub rows: SparseRows,
    /// Row of the lane that each row is.
    lane_rows: Vec<u32>,
    pub indices: Array<[u32; 4]>,
    pub weights: Array<[f32; 4]>,
    pub key: Key,
}

impl CutOut {
    /// `positions`: samples of the lane, `None` for all. `senders`: gather samples whose light is asked for, `None` for all.
    pub fn new(
        stage: &Stage,
        lane: &Lane,
        positions: Option<&Positions>,
        senders: Option<&Shares>,
    ) -> Result<Arc<Self>> {
        let light = senders.map_or([0; 16], |senders| senders.key.0);
        let key = Key::of(&[b"cut out", &lane.key.0, &Positions::name(positions), &light]);
        let bytes = |cut: &Self| cut.rows.bytes() + 36 * cut.indices.len() as u64;
        stage.memo.remember(key, bytes, || {
            let (lane_rows, indices, weights) = match positions {
                None => ((0..lane.rows.rows() as u32).collect(), lane.indices.clone(), lane.weights.clone()),
                Some(positions) => compact(lane, positions),
            };
            let largest = indices.par_iter().flatten().max();
            if let Some(index) = largest.filter(|&&index| index as usize >= lane_rows.len().max(1)) {
                let message = format!("samples lie between {} rows, one of them number {index}", lane_rows.len());
                return Err(Error::compute(message, "the transfer is damaged: clear the cache"));
            }
            let rows = select(lane.rows, &lane_rows, columns(stage, senders).as_deref())?;
            Ok(Self { rows, lane_rows, indices, weights, key })
        })
    }

    /// The same rows of what is hidden of `senders`, which this was made for; `hidden` makes what is laid out as the
    /// lane's rows.
    pub fn hidden(
        &self,
        stage: &Stage,
        senders: Option<&Shares>,
        hidden: impl FnOnce() -> Result<Arc<Hidden>>,
    ) -> Result<Arc<SparseRows>> {
        stage.memo.remember(Key::of(&[b"hidden of", &self.key.0]), SparseRows::bytes, || {
            select(&hidden()?.rows, &self.lane_rows, columns(stage, senders).as_deref())
        })
    }

    /// Which of the lane's rows are its.
    pub fn is_of(&self, rows: usize) -> Vec<bool> {
        let mut is = vec![false; rows];
        self.lane_rows.iter().for_each(|&row| is[row as usize] = true);
        is
    }

    /// The ways of the entries of `rows`, which are this cut-out's rows or laid out as they are.
    pub fn ways(&self, stage: &Stage, lane: &Lane, rows: &SparseRows, name: &[u8]) -> Result<Arc<Array<u32>>> {
        let key = Key::of(&[b"ways", name, &self.key.0]);
        stage.memo.remember(
            key,
            |ways: &Array<u32>| 4 * ways.len() as u64,
            || {
                memory::require(
                    4 * rows.entries().len() as u64,
                    "distances and directions of an edit",
                    "narrow its selections",
                )?;
                let places = stage.memo.remember(
                    Key::of(&[b"places", &stage.place.0]),
                    |places: &Vec<[f32; 4]>| VEC4 * places.len() as u64,
                    || {
                        let points = stage.transfer.gather.points.iter();
                        let leaves: Vec<[f32; 4]> = points.map(|p| with_zero(p.position)).collect();
                        average_pyramid(stage.device, &leaves, 1)
                    },
                )?;
                let points: Vec<[f32; 4]> = self
                    .lane_rows
                    .iter()
                    .map(|&row| {
                        with_zero(stage.transfer.samples.points[lane.row_samples[row as usize] as usize].position)
                    })
                    .collect();
                Ok(entry_ways(stage.device, rows, &points, &places)?.into())
            },
        )
    }

    /// Light at the samples from light at the rows.
    pub fn between<'a>(&'a self, rows: &'a [[f32; 4]]) -> Given<'a> {
        Given::Between { rows, indices: &self.indices, weights: &self.weights }
    }
}

fn with_zero([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 0.0]
}

/// Rows that the samples use, numbered anew.
fn compact(lane: &Lane, positions: &[u32]) -> (Vec<u32>, Array<[u32; 4]>, Array<[f32; 4]>) {
    let weights: Vec<[f32; 4]> = positions.iter().map(|&p| lane.weights[p as usize]).collect();
    let mut used = vec![false; lane.rows.rows()];
    for (&p, weights) in positions.iter().zip(&weights) {
        let four = lane.indices[p as usize];
        (0..4).filter(|&j| weights[j] != 0.0).for_each(|j| used[four[j] as usize] = true);
    }
    let rows: Vec<u32> = (0..used.len() as u32).filter(|&row| used[row as usize]).collect();
    let mut number = vec![0; used.len()];
    rows.iter().enumerate().for_each(|(new, &row)| number[row as usize] = new as u32);
    let indices: Vec<[u32; 4]> =
        positions.iter().map(|&p| lane.indices[p as usize].map(|row| number[row as usize])).collect();
    (rows, indices.into(), weights.into())
}

/// The columns of light that is asked for, where columns are places; `None` is all.
fn columns(stage: &Stage, senders: Option<&Shares>) -> Option<Vec<bool>> {
    senders.filter(|_| stage.transfer.settings.basis == Basis::Cut).map(|senders| heap(&senders.weights))
}

/// Per tree node, whether light from a gather sample below it is asked for.
fn heap(leaves: &[f32]) -> Vec<bool> {
    let count = leaves.len();
    let mut nodes = vec![false; 2 * count];
    nodes[count..].iter_mut().zip(leaves).for_each(|(node, &leaf)| *node = leaf != 0.0);
    (1..count).rev().for_each(|node| nodes[node] = nodes[2 * node] || nodes[2 * node + 1]);
    nodes
}

/// Some rows of a matrix, with only the entries in admitted columns.
fn select(matrix: &SparseRows, rows: &[u32], admitted: Option<&[bool]>) -> Result<SparseRows> {
    if admitted.is_none() && rows.len() == matrix.rows() {
        return Ok(matrix.clone());
    }
    let format: EntryFormat = matrix.format();
    let entries = |row: u32| {
        &matrix.entries()[matrix.offsets()[row as usize] as usize..matrix.offsets()[row as usize + 1] as usize]
    };
    let passes = |entry: &u32| admitted.is_none_or(|admitted| admitted[format.unpack(*entry).0]);
    let chosen: Vec<Cow<[u32]>> = rows
        .par_iter()
        .with_min_len(64)
        .map(|&row| match admitted {
            None => Cow::Borrowed(entries(row)),
            Some(_) => Cow::Owned(entries(row).iter().copied().filter(passes).collect()),
        })
        .collect();
    let mut offsets = Vec::with_capacity(rows.len() + 1);
    offsets.push(0);
    let mut end = 0;
    offsets.extend(chosen.iter().map(|row| {
        end += row.len() as u32;
        end
    }));
    let scale: Vec<f32> = rows.iter().map(|&row| matrix.scale()[row as usize]).collect();
    SparseRows::new(offsets, chosen.concat(), scale, format)
}
