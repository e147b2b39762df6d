//! One row of an edit, as a function over the gather samples: made in pieces from the tree's root down, kept as the
//! largest of its Haar coefficients (thesis eq. 5.4).
//!
//! Edits are smooth where transfer is not, so a row is constant over most of the tree's nodes: it is described by few
//! pieces, and only the wavelets of the pieces' ancestors are not zero. Making a row costs what its pieces cost; no
//! vector over all gather samples is ever written.

use crate::Result;
use crate::transport::sparse::{EntryFormat, SparseRows, SparseRowsBuilder};
use glam::Vec3;
use rayon::prelude::*;

/// What a row is to hold, linear RGB: `S - 1` for scales, `O` for offsets.
pub trait Field {
    /// The value all over a node (that is no leaf) when it hardly varies in it; `None` to be asked about its children.
    fn constant(&mut self, node: usize) -> Option<Vec3>;
    /// The value at a leaf: node M + i for gather sample i.
    fn leaf(&mut self, node: usize) -> Vec3;
}

/// Orthonormal Haar coefficients along the ordered gather samples; coefficient `i` belongs to tree node `i`, 0 is the
/// mean times sqrt M (the order of `kernels::haar_encode`). What is not listed is 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// In the order of their numbers, each once.
    pub coefficients: Vec<(u32, Vec3)>,
}

/// What `Row::truncate` left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Kept {
    pub coefficients: usize,
    /// L2 norm of what was dropped over that of the whole row.
    pub error: f32,
}

impl Row {
    /// Replaces the row by a field over M = `count` gather samples, exactly as its pieces say.
    pub fn fill(&mut self, count: usize, field: &mut impl Field) {
        self.coefficients.clear();
        let mean = self.descend(1, count, count, field);
        self.put(0, mean * (count as f32).sqrt());
        self.coefficients.sort_unstable_by_key(|coefficient| coefficient.0);
    }

    /// Notes the wavelets at and below a node of `span` leaves; gives the mean over it.
    fn descend(&mut self, node: usize, span: usize, count: usize, field: &mut impl Field) -> Vec3 {
        if node >= count {
            return field.leaf(node);
        }
        if let Some(value) = field.constant(node) {
            return value;
        }
        let left = self.descend(2 * node, span / 2, count, field);
        let right = self.descend(2 * node + 1, span / 2, count, field);
        self.put(node as u32, (left - right) * (0.5 * (span as f32).sqrt()));
        (left + right) * 0.5
    }

    fn put(&mut self, index: u32, coefficient: Vec3) {
        if coefficient != Vec3::ZERO {
            self.coefficients.push((index, coefficient));
        }
    }

    /// Drops the smallest coefficients, counted over all three channels so that grey edits stay grey, as long as what
    /// is dropped stays below `tolerance` of the row in L2 norm; and those beyond the `most` largest in any case. The
    /// basis is orthonormal along samples of equal area, so the error is weighted by area.
    pub fn truncate(&mut self, tolerance: f32, most: usize) -> Kept {
        self.truncate_by(tolerance, most, |_| 1.0)
    }

    /// The same with the error weighted anew: `weight` is the mean weight of a sample below a tree node (1: the root, also
    /// asked for coefficient 0).
    pub fn truncate_by(&mut self, tolerance: f32, most: usize, weight: impl Fn(usize) -> f32) -> Kept {
        let energy = |(i, c): &(u32, Vec3)| c.as_dvec3().length_squared() * f64::from(weight((*i).max(1) as usize));
        let larger = |a: &(u32, Vec3), b: &(u32, Vec3)| energy(b).total_cmp(&energy(a)).then(a.0.cmp(&b.0));
        let list = &mut self.coefficients;
        let total: f64 = list.iter().map(energy).sum();
        let mut dropped = 0.0;
        if list.len() > most {
            list.select_nth_unstable_by(most, larger);
            dropped = list[most..].iter().map(energy).sum();
            list.truncate(most);
        }
        let allowed = f64::from(tolerance).powi(2) * total;
        list.sort_unstable_by(larger);
        while let Some(last) = list.last().map(energy).filter(|last| dropped + last <= allowed) {
            dropped += last;
            list.pop();
        }
        list.sort_unstable_by_key(|coefficient| coefficient.0);
        let error = if total > 0.0 { (dropped / total).sqrt() as f32 } else { 0.0 };
        Kept { coefficients: list.len(), error }
    }

    /// Adds `factor` times another row: rows of an edit that differ only by a factor are made once. (Where each view
    /// sample has one such row, the factor may as well stand in its slot: see `Sampled::weights`.)
    pub fn add_scaled(&mut self, factor: Vec3, other: &Row) {
        let mut mine = std::mem::take(&mut self.coefficients).into_iter().peekable();
        let mut others = other.coefficients.iter().peekable();
        self.coefficients.reserve(mine.len() + others.len());
        while let Some(index) = [mine.peek().map(|c| c.0), others.peek().map(|c| c.0)].into_iter().flatten().min() {
            let old = mine.next_if(|c| c.0 == index).map_or(Vec3::ZERO, |c| c.1);
            let more = others.next_if(|c| c.0 == index).map_or(Vec3::ZERO, |c| c.1);
            self.put(index, old + factor * more);
        }
    }
}

/// Rows made in parallel, by number, each with what `scratch` made for its thread, and packed: three sparse rows (red, green, blue) of M columns for each.
///
/// # Errors
/// That of `make`; a coefficient that is not finite.
pub fn rows<S>(
    columns: usize,
    count: usize,
    scratch: impl Fn() -> S + Sync + Send,
    make: impl Fn(usize, &mut S, &mut Row) -> Result<()> + Sync,
) -> Result<SparseRows> {
    let format = EntryFormat::new(columns.ilog2(), true)?;
    type Packed = [(Vec<u32>, f32); 3];
    let packed: Vec<Packed> = (0..count)
        .into_par_iter()
        .map_init(
            || (scratch(), Row::default(), Vec::new()),
            |(scratch, row, channel), number| {
                row.coefficients.clear();
                make(number, scratch, row)?;
                let mut packed = Packed::default();
                for (c, (entries, scale)) in packed.iter_mut().enumerate() {
                    channel.clear();
                    channel.extend(row.coefficients.iter().map(|(index, value)| (*index, value[c])));
                    *scale = format.pack_row(channel, entries)?;
                }
                Ok(packed)
            },
        )
        .collect::<Result<_>>()?;
    let mut builder = SparseRowsBuilder::new(format)?;
    for (entries, scale) in packed.iter().flatten() {
        builder.push_packed(entries, *scale)?;
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Device;
    use crate::kernels::{haar_decode, haar_encode};
    use crate::transport::sampling::{hash, unit};

    fn random(seed: u32) -> f32 {
        unit(hash(seed))
    }

    /// A piece ends where a throw of the dice, fixed for the node, says so.
    struct Pieces {
        seed: u32,
        depth: u32,
        asked: usize,
    }

    impl Pieces {
        fn value(&self, node: usize) -> Vec3 {
            Vec3::from_array([0, 1, 2].map(|c| 4.0 * random(self.seed ^ (node as u32 * 3 + c)) - 2.0))
        }
    }

    impl Field for Pieces {
        fn constant(&mut self, node: usize) -> Option<Vec3> {
            self.asked += 1;
            let ends = node.ilog2() >= self.depth || random(self.seed.wrapping_add(node as u32 * 7)) < 0.2;
            ends.then(|| self.value(node))
        }

        fn leaf(&mut self, node: usize) -> Vec3 {
            self.asked += 1;
            self.value(node)
        }
    }

    fn dense(count: usize, field: &mut impl Field) -> Vec<[f32; 4]> {
        fn fill(node: usize, values: &mut [[f32; 4]], count: usize, field: &mut impl Field) {
            let value = if node >= count { Some(field.leaf(node)) } else { field.constant(node) };
            if let Some(value) = value {
                return values.fill(value.extend(0.0).to_array());
            }
            let (left, right) = values.split_at_mut(values.len() / 2);
            fill(2 * node, left, count, field);
            fill(2 * node + 1, right, count, field);
        }
        let mut values = vec![[0.0; 4]; count];
        fill(1, &mut values, count, field);
        values
    }

    fn spread(row: &Row, count: usize) -> Vec<[f32; 4]> {
        let mut coefficients = vec![[0.0; 4]; count];
        row.coefficients.iter().for_each(|(i, c)| coefficients[*i as usize] = c.extend(0.0).to_array());
        coefficients
    }

    #[test]
    fn rows_are_the_transform_of_their_pieces() {
        for count in [1usize, 2, 4, 64, 1024, 1 << 14] {
            for seed in 0..20 {
                let mut field = Pieces { seed: hash(seed), depth: seed % 13, asked: 0 };
                let values = dense(count, &mut field);
                let pieces = std::mem::take(&mut field.asked);
                let mut row = Row::default();
                row.fill(count, &mut field);
                assert_eq!(field.asked, pieces, "each node is asked once");
                assert!(row.coefficients.is_sorted_by(|a, b| a.0 < b.0));
                let expected = haar_encode(&Device::Cpu, &values, 1).unwrap();
                for (i, (a, b)) in spread(&row, count).iter().zip(&expected).enumerate() {
                    for c in 0..3 {
                        let off = (a[c] - b[c]).abs();
                        assert!(off <= 1e-4 * (count as f32).sqrt().max(1.0), "{count}, seed {seed}, {i}: {a:?} {b:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn what_truncation_drops_is_what_it_says_and_no_more_than_allowed() {
        let count = 1 << 10;
        for seed in 0..40u32 {
            let mut field = Pieces { seed: hash(seed), depth: 9, asked: 0 };
            let values = dense(count, &mut field);
            let mut whole = Row::default();
            whole.fill(count, &mut field);
            for (tolerance, most) in
                [(0.0, usize::MAX), (0.01, usize::MAX), (0.3, usize::MAX), (0.0, 5), (0.01, 20), (2.0, 9)]
            {
                let mut row = whole.clone();
                let kept = row.truncate(tolerance, most);
                assert!(kept.coefficients == row.coefficients.len() && kept.coefficients <= most);
                let decoded = haar_decode(&spread(&row, count)).unwrap();
                let squares = |pair: &mut dyn Iterator<Item = f32>| pair.map(|x| f64::from(x).powi(2)).sum::<f64>();
                let off = squares(&mut decoded.iter().flatten().zip(values.iter().flatten()).map(|(a, b)| a - b));
                let error = (off / squares(&mut values.iter().flatten().copied())).sqrt();
                assert!((error - f64::from(kept.error)).abs() < 1e-4, "{error} {kept:?}");
                let full = row.coefficients.len() == most.min(whole.coefficients.len());
                assert!(error <= f64::from(tolerance) + 1e-6 || full, "{tolerance} {most}: {kept:?}");
                // One less would not have done.
                if let Some(least) = row.coefficients.iter().map(|c| c.1.length()).min_by(f32::total_cmp) {
                    let total = whole.coefficients.iter().map(|c| c.1.length_squared()).sum::<f32>().sqrt();
                    assert!(kept.error.hypot(least / total) > tolerance, "{tolerance} {most}: {kept:?}");
                }
            }
        }
    }

    #[test]
    fn rows_add_up() {
        let count = 256;
        let [mut a, mut b] = [3, 4].map(|seed| Pieces { seed, depth: 8, asked: 0 });
        let [mut row, mut other] = [Row::default(), Row::default()];
        row.fill(count, &mut a);
        other.fill(count, &mut b);
        let factor = Vec3::new(0.5, -2.0, 0.0);
        let (before, with) = (spread(&row, count), spread(&other, count));
        row.add_scaled(factor, &other);
        assert!(row.coefficients.is_sorted_by(|a, b| a.0 < b.0));
        for (i, sum) in spread(&row, count).iter().enumerate() {
            for c in 0..3 {
                assert_eq!(sum[c], before[i][c] + factor[c] * with[i][c]);
            }
        }
        let mut none = row.clone();
        none.add_scaled(Vec3::NEG_ONE, &row);
        assert_eq!(none, Row::default());
    }

    #[test]
    fn packed_rows_are_the_rows() {
        let make = |number: usize, _: &mut (), row: &mut Row| {
            row.fill(128, &mut Pieces { seed: number as u32, depth: 7, asked: 0 });
            Ok(())
        };
        let packed = rows(128, 50, || (), make).unwrap();
        assert_eq!((packed.rows(), packed.columns()), (150, 128));
        for number in 0..50 {
            let mut row = Row::default();
            make(number, &mut (), &mut row).unwrap();
            for (c, dense) in [0, 1, 2].map(|c| (c, spread(&row, 128))) {
                let largest = dense.iter().map(|x| x[c].abs()).fold(0.0, f32::max);
                let mut found = vec![0.0; 128];
                packed.row(3 * number + c).for_each(|(index, value)| found[index] = value);
                assert!(found.iter().zip(&dense).all(|(a, b)| (a - b[c]).abs() <= 1e-6 * largest));
            }
        }
        assert!(
            rows(
                128,
                1,
                || (),
                |_, (), row| {
                    row.coefficients.push((0, Vec3::NAN));
                    Ok(())
                }
            )
            .is_err()
        );
    }
}
