//! Applies sampled edits to light on its way from gather samples to the view: see the module above for what they mean.

use super::{Sampled, UNTOUCHED, Vectors};
use crate::device::{Array, Device};
use crate::kernels::scaled_product::{Pair, scaled_product};
use crate::kernels::{haar_encode, sparse_product};
use crate::transport::{Basis, SparseRows, Transfer};
use crate::{Error, Result};
use glam::Vec4;
use rayon::prelude::*;
use std::borrow::Cow;

/// Samples that one task works on.
const TILE: usize = 4096;

impl Vectors {
    /// `scale light + offset`, for `count` vectors of light one after another; `offset` is added to each.
    pub fn apply(&self, light: &mut [[f32; 4]], count: usize) {
        let length = light.len() / count.max(1);
        for light in light.chunks_exact_mut(length.max(1)) {
            light.par_chunks_mut(TILE).enumerate().for_each(|(tile, light)| {
                for (i, light) in light.iter_mut().enumerate() {
                    let mut value = Vec4::from_array(*light);
                    let at = |vector: &Array<[f32; 4]>| Vec4::from_array(vector[tile * TILE + i]);
                    value *= self.scale.as_ref().map_or(Vec4::ONE, at);
                    value += self.offset.as_ref().map_or(Vec4::ZERO, at);
                    *light = value.to_array();
                }
            });
        }
    }
}

/// A matrix of rows, the samples that interpolate between them, and which scale rows belong to which of those.
pub struct Slots<'a> {
    pub rows: &'a SparseRows,
    /// Of each sample: four rows and their weights.
    pub indices: &'a [[u32; 4]],
    pub weights: &'a [[f32; 4]],
    /// Numbers of the samples that have scale rows, increasing.
    touched: Cow<'a, [u32]>,
    /// Of each of those: the scale row that goes with each of its four rows, and what that counts.
    slots: Cow<'a, [[u32; 4]]>,
    factors: Cow<'a, [[f32; 4]]>,
}

impl<'a> Slots<'a> {
    /// View samples and the rows of the transfer.
    pub fn diffuse(sampled: &'a Sampled, transfer: &'a Transfer) -> Self {
        Self {
            rows: &transfer.rows,
            indices: &transfer.indices,
            weights: &transfer.weights,
            touched: Cow::Borrowed(&sampled.touched),
            slots: Cow::Borrowed(&sampled.slots),
            factors: Cow::Borrowed(&sampled.weights),
        }
    }

    /// Some view samples, `samples`, and other rows for them: reflections. They are no interpolation between the rows that
    /// the edits were sampled at, so each takes its heaviest slot for all.
    pub fn other(
        sampled: &'a Sampled,
        rows: &'a SparseRows,
        samples: &[u32],
        indices: &'a [[u32; 4]],
        weights: &'a [[f32; 4]],
    ) -> Self {
        let (mut touched, mut slots, mut factors) = (Vec::new(), Vec::new(), Vec::new());
        for (place, sample) in samples.iter().enumerate() {
            let Ok(at) = sampled.touched.binary_search(sample) else { continue };
            let given = sampled.slots[at].iter().zip(sampled.weights[at]).filter(|(slot, _)| **slot != UNTOUCHED);
            let Some((slot, _)) = given.clone().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())) else { continue };
            let all: f32 = given.map(|(_, weight)| weight).sum();
            touched.push(place as u32);
            slots.push([*slot; 4]);
            factors.push(weights[place].map(|weight| weight * all));
        }
        let (touched, slots, factors) = (Cow::Owned(touched), Cow::Owned(slots), Cow::Owned(factors));
        Self { rows, indices, weights, touched, slots, factors }
    }
}

/// The distinct pairs of a row and a scale row that touched samples need, and which of them each needs.
pub struct Plan {
    pairs: Vec<Pair>,
    /// By touched sample and slot; `UNTOUCHED` for none.
    of_slot: Vec<[u32; 4]>,
    /// Some touched sample needs unedited rows, too.
    plain: bool,
}

impl Plan {
    /// `sampled` must have been checked against the transfer.
    ///
    /// # Errors
    /// `Compute` when the transfer is of basis `haar`.
    pub fn new(slots: &Slots, transfer: &Transfer) -> Result<Self> {
        if transfer.settings.basis != Basis::Cut {
            let message = "sampled edits multiply transfers of basis cut, this one is of basis haar";
            return Err(Error::compute(message, "set the transfer's basis to cut"));
        }
        // By row, the pairs there are: a list through `found`, of pair and the number of the next, from 1.
        let mut first = vec![0u32; slots.rows.rows()];
        let mut found: Vec<(Pair, u32)> = Vec::new();
        let mut plain = false;
        let mut of_slot = vec![[UNTOUCHED; 4]; slots.touched.len()];
        for (i, &sample) in slots.touched.iter().enumerate() {
            let (rows, weights) = (slots.indices[sample as usize], slots.weights[sample as usize]);
            plain |= weights != slots.factors[i];
            for j in 0..4 {
                let (row, scale) = (rows[j], slots.slots[i][j]);
                if scale == UNTOUCHED || (weights[j] == 0.0 && slots.factors[i][j] == 0.0) {
                    plain |= weights[j] != 0.0;
                    continue;
                }
                let mut number = first[row as usize];
                while number != 0 && found[number as usize - 1].0[1] != scale {
                    number = found[number as usize - 1].1;
                }
                if number == 0 {
                    found.push(([row, scale], first[row as usize]));
                    number = found.len() as u32;
                    first[row as usize] = number;
                }
                of_slot[i][j] = number - 1;
            }
        }
        // Runs of one scale row, each in the order of the rows.
        let mut order: Vec<u32> = (0..found.len() as u32).collect();
        order.par_sort_unstable_by_key(|&number| {
            let [row, scale] = found[number as usize].0;
            u64::from(scale) << 32 | u64::from(row)
        });
        let mut place = vec![0; found.len()];
        order.iter().enumerate().for_each(|(at, &number)| place[number as usize] = at as u32);
        let move_slot = |slot: &mut u32| {
            if *slot != UNTOUCHED {
                *slot = place[*slot as usize];
            }
        };
        of_slot.par_iter_mut().for_each(|slots| slots.iter_mut().for_each(move_slot));
        let pairs = order.iter().map(|&number| found[number as usize].0).collect();
        Ok(Self { pairs, of_slot, plain })
    }

    /// How many distinct pairs there are.
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }

    pub fn bytes(&self) -> u64 {
        8 * self.pairs.len() as u64 + 16 * self.of_slot.len() as u64
    }
}

/// Irradiance at the view samples, E, from the exitance of gather samples after the edits there, B', for `count` vectors
/// of light at once. Samples that are not touched get the bits of `Transfer::apply`.
///
/// # Errors
/// The light was made for another number of gather samples; the device failed.
pub fn irradiance(
    device: &Device,
    transfer: &Transfer,
    sampled: &Sampled,
    plan: &Plan,
    exitance: &[[f32; 4]],
    count: usize,
) -> Result<Vec<[f32; 4]>> {
    let added = match &sampled.offsets {
        Some(offsets) => offset_product(device, offsets, exitance, count)?,
        None => Vec::new(),
    };
    let whole = transfer.apply(device, exitance, count)?;
    through(device, transfer, &Slots::diffuse(sampled, transfer), sampled, plan, exitance, whole, &added)
}

/// The same for any rows. `whole`: light at the samples that are not touched, one or more vectors; `added`: `P . B'` of each
/// offset row, as many vectors, or empty for none.
#[allow(clippy::too_many_arguments, reason = "each is one operand of the formula of the module")]
pub fn through(
    device: &Device,
    transfer: &Transfer,
    slots: &Slots,
    sampled: &Sampled,
    plan: &Plan,
    exitance: &[[f32; 4]],
    whole: Vec<[f32; 4]>,
    added: &[[f32; 4]],
) -> Result<Vec<[f32; 4]>> {
    let count = exitance.len() / transfer.gather.count().max(1);
    let pyramids = transfer.encode(device, exitance, count)?;
    let samples = slots.indices.len();
    let rows = match plan.plain {
        true => sparse_product(device, slots.rows, &pyramids, count)?,
        false => vec![[0.0; 4]; count * slots.rows.rows()],
    };
    let scaled = scaled_product(device, slots.rows, &sampled.scales, &plan.pairs, &pyramids, count)?;
    let mut arriving = whole;
    for (k, arriving) in arriving.chunks_exact_mut(samples.max(1)).enumerate() {
        let rows = &rows[k * slots.rows.rows()..];
        let scaled = &scaled[k * plan.pairs.len()..];
        let added = if added.is_empty() { added } else { &added[k * sampled.rows()..] };
        let edited = |i: usize| {
            let sample = slots.touched[i] as usize;
            let (indices, weights) = (slots.indices[sample], slots.weights[sample]);
            let mut sum = Vec4::ZERO;
            for j in 0..4 {
                let (pair, scale) = (plan.of_slot[i][j], slots.slots[i][j]);
                let weight = if pair == UNTOUCHED { 0.0 } else { slots.factors[i][j] };
                if weights[j] != weight {
                    sum += Vec4::from_array(rows[indices[j] as usize]) * (weights[j] - weight);
                }
                if weight != 0.0 {
                    sum += Vec4::from_array(scaled[pair as usize]) * weight;
                    sum += added.get(scale as usize).map_or(Vec4::ZERO, |added| Vec4::from_array(*added) * weight);
                }
            }
            sum.to_array()
        };
        let values: Vec<[f32; 4]> = (0..slots.touched.len()).into_par_iter().with_min_len(TILE).map(edited).collect();
        slots.touched.iter().zip(values).for_each(|(&sample, value)| arriving[sample as usize] = value);
    }
    Ok(arriving)
}

/// `P . B'` of each offset row, for `count` vectors of exitance: `count` vectors of as many elements as there are rows of
/// three channels. In an orthonormal basis the product is that of the coefficients.
pub fn offset_product(
    device: &Device,
    offsets: &SparseRows,
    exitance: &[[f32; 4]],
    count: usize,
) -> Result<Vec<[f32; 4]>> {
    let products = sparse_product(device, offsets, &haar_encode(device, exitance, count)?, count)?;
    // Row 3 r + c is for channel c alone.
    Ok(products.as_chunks::<3>().0.iter().map(|[red, green, blue]| [red[0], green[1], blue[2], 0.0]).collect())
}
