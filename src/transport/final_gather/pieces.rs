//! A row of an edit as a renderer looks it up: piecewise constant along the ordered gather samples (thesis Algorithm 12,
//! with the row decoded into as many pieces as it has, not into as many numbers as there are samples).

use crate::transport::SparseRows;
use glam::Vec3;

/// Linear RGB over gather samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pieces {
    /// First gather sample of each piece; the first is 0.
    starts: Vec<u32>,
    values: Vec<Vec3>,
}

impl Pieces {
    /// Row `row` (of three channels) of a matrix of Haar coefficients; see `sampled::file` for their order.
    pub fn of(rows: &SparseRows, row: usize) -> Self {
        let count = rows.columns() as u32;
        let channel = |channel: usize| {
            let axis = Vec3::AXES[channel];
            rows.row(3 * row + channel).map(move |(index, value)| (index as u32, axis * value))
        };
        // Channels mostly have coefficients in the same places: three runs, each in order.
        let mut coefficients: Vec<(u32, Vec3)> = (0..3).flat_map(channel).collect();
        coefficients.sort_by_key(|coefficient| coefficient.0);
        // What changes at a gather sample.
        let mut steps: Vec<(u32, Vec3)> = Vec::with_capacity(1 + 3 * coefficients.len());
        steps.push((0, Vec3::ZERO));
        for same in coefficients.chunk_by(|a, b| a.0 == b.0) {
            let (index, value) = (same[0].0, same.iter().map(|coefficient| coefficient.1).sum::<Vec3>());
            match index {
                0 => steps.push((0, value / (count as f32).sqrt())),
                _ => {
                    let span = count >> index.ilog2();
                    let first = (index - (1 << index.ilog2())) * span;
                    let height = value / (span as f32).sqrt();
                    steps.extend([(first, height), (first + span / 2, -2.0 * height), (first + span, height)]);
                }
            }
        }
        Self::from_steps(steps, count)
    }

    /// The sum of pieces, each times a weight.
    pub fn sum(parts: &[(&Pieces, f32)]) -> Self {
        match parts {
            [] => Self::default(),
            [part] => Self::of_two(*part, (part.0, 0.0)),
            [a, b] => Self::of_two(*a, *b),
            _ => {
                let (a, b) = parts.split_at(parts.len() / 2);
                Self::of_two((&Self::sum(a), 1.0), (&Self::sum(b), 1.0))
            }
        }
    }

    /// Both begin at 0.
    fn of_two((a, weight_a): (&Pieces, f32), (b, weight_b): (&Pieces, f32)) -> Self {
        let most = a.starts.len() + b.starts.len();
        let mut sum = Self { starts: Vec::with_capacity(most), values: Vec::with_capacity(most) };
        // Of each: the pieces that have begun.
        let (mut i, mut j) = (0, 0);
        let next = |starts: &[u32], begun: usize| starts.get(begun).copied().unwrap_or(u32::MAX);
        loop {
            let (from_a, from_b) = (next(&a.starts, i), next(&b.starts, j));
            let start = from_a.min(from_b);
            if start == u32::MAX {
                return sum;
            }
            i += usize::from(from_a == start);
            j += usize::from(from_b == start);
            sum.starts.push(start);
            sum.values.push(a.values[i - 1] * weight_a + b.values[j - 1] * weight_b);
        }
    }

    fn from_steps(mut steps: Vec<(u32, Vec3)>, count: u32) -> Self {
        steps.sort_unstable_by_key(|step| step.0);
        let mut pieces = Self::default();
        let mut height = Vec3::ZERO;
        for run in steps.chunk_by(|a, b| a.0 == b.0).take_while(|run| run[0].0 < count) {
            height += run.iter().map(|step| step.1).sum::<Vec3>();
            pieces.starts.push(run[0].0);
            pieces.values.push(height);
        }
        pieces
    }

    pub fn at(&self, sample: u32) -> Vec3 {
        let after = self.starts.partition_point(|start| *start <= sample);
        after.checked_sub(1).map_or(Vec3::ZERO, |piece| self.values[piece])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::haar_decode;
    use crate::transport::sampled::row;
    use crate::transport::sampling::{hash, unit};

    /// What the row's own transform gives, at every sample.
    #[test]
    fn pieces_are_the_decoded_row() {
        let random = |i: u32| 2.0 * unit(hash(i)) - 1.0;
        for (count, coefficients) in [(2usize, 2u32), (64, 5), (1024, 40), (1 << 14, 100)] {
            let make = |number: usize, _: &mut (), row: &mut row::Row| {
                let seed = number as u32 * 77_777;
                let mut indices: Vec<u32> =
                    (0..coefficients).map(|i| (count as f32 * 0.5 * (1.0 + random(seed + i))) as u32).collect();
                indices.sort_unstable();
                indices.dedup();
                let value = |i: u32| {
                    Vec3::new(random(seed ^ i), random(seed + !i), if i.is_multiple_of(3) { 0.0 } else { 2.0 })
                };
                row.coefficients = indices.into_iter().map(|i| (i, value(i))).collect();
                Ok(())
            };
            let rows = row::rows(count, 2, || (), make).unwrap();
            let all: Vec<Vec<[f32; 4]>> = (0..2)
                .map(|number| {
                    let mut dense = vec![[0.0; 4]; count];
                    (0..3).for_each(|channel| {
                        rows.row(3 * number + channel).for_each(|(i, value)| dense[i][channel] = value);
                    });
                    haar_decode(&dense).unwrap()
                })
                .collect();
            let pieces: Vec<Pieces> = (0..2).map(|number| Pieces::of(&rows, number)).collect();
            let both = Pieces::sum(&[(&pieces[0], 0.25), (&pieces[1], -2.0)]);
            for (sample, (a, b)) in all[0].iter().zip(&all[1]).enumerate() {
                let [a, b] = [a, b].map(|value| Vec3::from_slice(&value[..3]));
                assert!((pieces[0].at(sample as u32) - a).length() < 1e-4, "{count}, {sample}");
                assert!((both.at(sample as u32) - (a * 0.25 - b * 2.0)).length() < 1e-3, "{count}, {sample}");
            }
        }
    }
}
