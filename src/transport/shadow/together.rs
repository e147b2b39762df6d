//! Groups as one, and samples as one: rows of what all groups hide, and the mean shadow of a selection.

use super::haar::{self, Encoder, HaarBasis};
use super::visibility::{Data, Rows, Scratch, Visibility};
use crate::scene::cube::FACES;
use crate::transport::runs::{self, Runs};
use crate::transport::sparse::{SparseRows, SparseRowsBuilder};
use crate::{Error, Result};
use rayon::prelude::*;
use std::sync::Arc;

/// Samples that one task adds up.
const BLOCK: usize = 2048;
/// Fixed-point weights: sums of 2^31 samples stay exact, in any order.
const UNIT: f64 = (1u64 << 30) as f64;

impl Visibility {
    /// What all groups hide of a face, before edits; `None` for a face that was not asked for. Runs of several groups are
    /// united, exactly; of rows in a Haar basis the product is made texel by texel and encoded again.
    ///
    /// # Errors
    /// `Compute` when groups hold rows of different shapes.
    pub fn together(&self, face: usize) -> Result<Option<Arc<Rows>>> {
        let groups = self.face(face);
        let (first, rest) = match groups.as_slice() {
            [] => return Ok(None),
            [only] => return Ok(Some((*only).clone())),
            [first, rest @ ..] => (first, rest),
        };
        let alike = |rows: &&Arc<Rows>| rows.size == first.size && rows.rows() == first.rows();
        if !rest.iter().all(alike) {
            return Err(Error::compute("visibility groups of different shapes", "bake them from the same samples"));
        }
        let data = match &first.data {
            Data::Runs(_) => Data::Runs(Runs::union(&runs_of(&groups))?),
            Data::Haar(basis, _) => Data::Haar(*basis, self.encode(face, *basis, first.rows())?),
        };
        Ok(Some(Arc::new(Rows { size: self.size, data })))
    }

    fn encode(&self, face: usize, basis: HaarBasis, rows: usize) -> Result<SparseRows> {
        let format = haar::format(self.size);
        let mut builder = SparseRowsBuilder::new(format)?;
        let scratch = || {
            let encoder = Encoder::new(self.size, basis, self.truncation);
            (encoder, Scratch::default(), vec![0.0; self.size * self.size])
        };
        for start in (0..rows).step_by(BLOCK) {
            let block: Vec<(Vec<u32>, f32)> = (start..rows.min(start + BLOCK))
                .into_par_iter()
                .map_init(scratch, |(encoder, scratch, values), sample| {
                    let mut entries = Vec::new();
                    if self.face(face).iter().all(|rows| rows.count(sample) == 0) {
                        return Ok((entries, 0.0));
                    }
                    self.shadow(sample, face, scratch, values);
                    let scale = format.pack_row(encoder.values(values), &mut entries)?;
                    Ok((entries, scale))
                })
                .collect::<Result<_>>()?;
            block.iter().try_for_each(|(entries, scale)| builder.push_packed(entries, *scale))?;
        }
        builder.finish()
    }

    /// How much of each direction samples have hidden, on average: the mean of `S = H - V` with the weights of a
    /// selection at the samples, for all 6 n n texels. Groups count together, edits do not; faces that were not asked for
    /// count as 0. What `1 - V` of thesis 6.7.2 is, less the directions below the samples' horizons.
    ///
    /// # Errors
    /// `Compute` for another number of weights, weights out of [0, 1], or a selection of none of the samples.
    pub fn blocked(&self, weights: &[f32]) -> Result<Vec<f32>> {
        let count = self.samples.points.len();
        if weights.len() != count {
            let message = format!("{} weights for {count} samples", weights.len());
            return Err(Error::compute(message, "hold the selection against the samples of the visibility"));
        }
        if !weights.iter().all(|weight| (0.0..=1.0).contains(weight)) {
            return Err(Error::compute("a selection has weights out of [0, 1]", "look for NaN in what it is made of"));
        }
        let chosen = |sample: &usize| weights[*sample] > 0.0 && self.samples.points[*sample].exists();
        let samples: Vec<(usize, i64)> =
            (0..count).filter(chosen).map(|i| (i, (f64::from(weights[i]) * UNIT).round() as i64)).collect();
        let total: i64 = samples.iter().map(|(_, weight)| weight).sum();
        if total == 0 {
            return Err(Error::compute(
                "the selection holds none of the view's surfaces",
                "paint or pick what is seen",
            ));
        }
        let texels = self.size * self.size;
        let mut mean = vec![0.0; FACES * texels];
        for (face, mean) in mean.chunks_exact_mut(texels).enumerate() {
            let groups = self.face(face);
            let sums = match groups.first().map(|rows| &rows.data) {
                None => continue,
                Some(Data::Runs(_)) => blocked_runs(&runs_of(&groups), &samples, texels),
                Some(Data::Haar(..)) => self.blocked_values(face, &samples),
            };
            mean.iter_mut().zip(sums).for_each(|(mean, sum)| *mean = (sum / total as f64).clamp(0.0, 1.0) as f32);
        }
        Ok(mean)
    }

    fn blocked_values(&self, face: usize, samples: &[(usize, i64)]) -> Vec<f64> {
        let texels = self.size * self.size;
        let add = |samples: &[(usize, i64)]| {
            let (mut scratch, mut values) = (Scratch::default(), vec![0.0; texels]);
            let mut sums = vec![0.0; texels];
            for (sample, weight) in samples {
                if self.face(face).iter().any(|rows| rows.count(*sample) > 0) {
                    self.shadow(*sample, face, &mut scratch, &mut values);
                    sums.iter_mut().zip(&values).for_each(|(sum, value)| *sum += *weight as f64 * f64::from(*value));
                }
            }
            sums
        };
        // Parts of fixed size, added in order: the same bits for any number of threads.
        let parts: Vec<Vec<f64>> = samples.par_chunks(BLOCK).map(add).collect();
        let mut total = vec![0.0; texels];
        parts.iter().for_each(|part| total.iter_mut().zip(part).for_each(|(total, part)| *total += part));
        total
    }
}

fn runs_of<'a>(groups: &[&'a Arc<Rows>]) -> Vec<&'a Runs> {
    let runs = |rows: &&'a Arc<Rows>| match &rows.data {
        Data::Runs(runs) => Some(runs),
        Data::Haar(..) => None,
    };
    groups.iter().filter_map(runs).collect()
}

/// Marks where the runs of all samples start and end, and sums the marks up once.
fn blocked_runs(groups: &[&Runs], samples: &[(usize, i64)], texels: usize) -> Vec<f64> {
    let mark = |mut marks: Vec<i64>, (sample, weight): &(usize, i64)| {
        let sign = |i: usize| if i.is_multiple_of(2) { *weight } else { -*weight };
        match groups {
            [runs] => runs.spans(*sample).for_each(|span| {
                marks[span.start] += weight;
                marks[span.end] -= weight;
            }),
            _ => runs::union_of_row(groups, *sample)
                .iter()
                .enumerate()
                .for_each(|(i, &toggle)| marks[toggle as usize] += sign(i)),
        }
        marks
    };
    let zero = || vec![0i64; texels + 1];
    let marks = samples.par_iter().with_min_len(BLOCK).fold(zero, mark).reduce(zero, |mut a, b| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        a
    });
    let mut sum = 0;
    let mut running = |mark: &i64| {
        sum += mark;
        sum as f64
    };
    marks[..texels].iter().map(&mut running).collect()
}
