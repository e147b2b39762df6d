//! Rows of binary pictures by runs: where a picture, read line by line, changes from 0 to 1 and back.
//!
//! A row is the sorted list of positions (`y side + x`) at which its bits toggle, starting from 0; a row that ends at 1
//! has an odd number of them, so an empty picture costs nothing and a full one a single toggle at 0. Two bytes a toggle
//! up to 256 x 256 texels, four above. Not for: sums over runs (see `kernels::run_light`).

use crate::device::Array;
use crate::{Error, Result};
use rayon::prelude::*;
use std::ops::Range;

/// The largest side whose positions fit in 16 bits.
const NARROW: usize = 256;

/// N pictures of `side` x `side` bits.
#[derive(Clone, Debug)]
pub struct Runs {
    side: usize,
    offsets: Array<u32>,
    words: Array<u32>,
}

/// The toggles of some rows, as wide as they are stored.
#[derive(Clone, Copy, Debug)]
pub enum Toggles<'a> {
    Narrow(&'a [u16]),
    Wide(&'a [u32]),
}

impl Runs {
    /// Takes apart what `offsets` and `words` gave. `offsets` has one element more than there are rows and counts
    /// toggles; a word holds two narrow toggles or a wide one. `Error::Compute` for anything that is not so.
    pub fn new(side: usize, offsets: impl Into<Array<u32>>, words: impl Into<Array<u32>>) -> Result<Self> {
        let runs = Self { side, offsets: offsets.into(), words: words.into() };
        let wrong = |what: String| Err(Error::compute(format!("rows of runs are damaged: {what}"), "clear the cache"));
        if !(2..=32_768).contains(&side) || runs.offsets.is_empty() || runs.offsets[0] != 0 {
            return wrong(format!("a side of {side}, {} offsets", runs.offsets.len()));
        }
        if let Some(row) = runs.offsets.windows(2).position(|pair| pair[0] > pair[1]) {
            return wrong(format!("row {row} ends before it starts"));
        }
        let count = runs.count();
        if runs.words.len() != if runs.is_narrow() { count.div_ceil(2) } else { count } {
            return wrong(format!("{} words for {count} toggles", runs.words.len()));
        }
        let sound = |row: &usize| {
            let ends = runs.row_toggles(*row);
            ends.clone().zip(ends.skip(1)).all(|(a, b)| a < b)
                && runs.row_toggles(*row).last().is_none_or(|last| last < side * side)
        };
        match (0..runs.rows()).into_par_iter().find_first(|row| !sound(row)) {
            Some(row) => wrong(format!("row {row} does not rise, or leaves {side} x {side}")),
            None => Ok(runs),
        }
    }

    pub fn side(&self) -> usize {
        self.side
    }

    pub fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Toggles of all rows.
    pub fn count(&self) -> usize {
        self.offsets[self.rows()] as usize
    }

    /// Two toggles a word.
    pub fn is_narrow(&self) -> bool {
        self.side <= NARROW
    }

    /// `rows() + 1` counts of toggles.
    pub fn offsets(&self) -> &Array<u32> {
        &self.offsets
    }

    /// The toggles as they are stored.
    pub fn words(&self) -> &Array<u32> {
        &self.words
    }

    pub fn toggles(&self) -> Toggles<'_> {
        match self.is_narrow() {
            true => Toggles::Narrow(&bytemuck::cast_slice(&self.words)[..self.count()]),
            false => Toggles::Wide(&self.words),
        }
    }

    fn row_toggles(&self, row: usize) -> impl ExactSizeIterator<Item = usize> + Clone + '_ {
        let toggles = self.toggles();
        (self.offsets[row] as usize..self.offsets[row + 1] as usize).map(move |i| match toggles {
            Toggles::Narrow(list) => list[i] as usize,
            Toggles::Wide(list) => list[i] as usize,
        })
    }

    pub fn is_empty(&self, row: usize) -> bool {
        self.offsets[row] == self.offsets[row + 1]
    }

    /// The runs of ones of a row, in order.
    pub fn spans(&self, row: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut ends = self.row_toggles(row);
        let last = self.side * self.side;
        std::iter::from_fn(move || Some(ends.next()?..ends.next().unwrap_or(last)))
    }

    /// Sets the bits of a row's ones (bit `i % 32` of word `i / 32`), and leaves all others as they are.
    pub fn fill(&self, row: usize, mask: &mut [u32]) {
        self.spans(row).for_each(|span| fill(mask, span));
    }

    pub fn bytes(&self) -> u64 {
        4 * (self.offsets.len() + self.words.len()) as u64
    }

    /// Ones where any of several has ones (their union), row by row; all of the same shape.
    ///
    /// # Errors
    /// `Compute` when there are none, they differ in shape, or the union has too many toggles.
    pub fn union(all: &[&Runs]) -> Result<Self> {
        let first = match all {
            [first, rest @ ..] if rest.iter().all(|r| (r.side, r.rows()) == (first.side, first.rows())) => *first,
            _ => return Err(Error::compute("rows of runs of different shapes", "bake them from the same samples")),
        };
        let mut builder = RunsBuilder::new(first.side);
        let block = 4096;
        for start in (0..first.rows()).step_by(block) {
            let rows = start..first.rows().min(start + block);
            let list: Vec<Vec<u32>> = rows.into_par_iter().map(|row| union_of_row(all, row)).collect();
            list.iter().try_for_each(|row| builder.push(row))?;
        }
        builder.finish()
    }
}

/// The toggles of the union of one row of several, of the same shape.
pub fn union_of_row(all: &[&Runs], row: usize) -> Vec<u32> {
    let last = all[0].side * all[0].side;
    let mut spans: Vec<Range<usize>> = all.iter().flat_map(|runs| runs.spans(row)).collect();
    spans.sort_unstable_by_key(|span| span.start);
    let mut toggles: Vec<u32> = Vec::with_capacity(2 * spans.len());
    let mut end: Option<usize> = None;
    for span in spans {
        match end {
            Some(before) if span.start <= before => end = Some(before.max(span.end)),
            _ => {
                toggles.extend(end.map(|before| before as u32));
                toggles.push(span.start as u32);
                end = Some(span.end);
            }
        }
    }
    toggles.extend(end.filter(|&end| end < last).map(|end| end as u32));
    toggles
}

/// Sets a range of bits.
pub fn fill(mask: &mut [u32], span: Range<usize>) {
    if span.is_empty() {
        return;
    }
    let (first, last) = (span.start / 32, (span.end - 1) / 32);
    let (low, high) = (!0 << (span.start % 32), !0 >> (31 - (span.end - 1) % 32));
    if first == last {
        mask[first] |= low & high;
    } else {
        mask[first] |= low;
        mask[first + 1..last].fill(!0);
        mask[last] |= high;
    }
}

/// Appends the toggles of a mask (bit `i % 32` of word `i / 32`).
pub fn toggles(mask: &[u32], out: &mut Vec<u32>) {
    let mut before = 0;
    for (i, &word) in mask.iter().enumerate() {
        // Where a bit differs from the one before it.
        let mut changes = word ^ (word << 1 | before);
        before = word >> 31;
        while changes != 0 {
            out.push(32 * i as u32 + changes.trailing_zeros());
            changes &= changes - 1;
        }
    }
}

/// Collects rows one after another.
pub struct RunsBuilder {
    side: usize,
    offsets: Vec<u32>,
    words: Vec<u32>,
}

impl RunsBuilder {
    pub fn new(side: usize) -> Self {
        Self { side, offsets: vec![0], words: Vec::new() }
    }

    /// So far.
    pub fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// So far.
    pub fn bytes(&self) -> u64 {
        4 * (self.offsets.len() + self.words.len()) as u64
    }

    /// Appends a row by its toggles.
    ///
    /// # Errors
    /// `Compute` when all rows together have more toggles than can be counted.
    pub fn push(&mut self, toggles: &[u32]) -> Result<()> {
        let before = self.offsets[self.rows()];
        let after = u32::try_from(toggles.len()).ok().and_then(|more| before.checked_add(more)).ok_or_else(|| {
            let message = format!("visibility has more than {} toggles, the most that can be addressed", u32::MAX);
            Error::compute(message, "render fewer samples at once, or lower face_size")
        })?;
        if self.side <= NARROW {
            self.words.resize((after as usize).div_ceil(2), 0);
            let halves: &mut [u16] = bytemuck::cast_slice_mut(&mut self.words);
            for (half, &toggle) in halves[before as usize..].iter_mut().zip(toggles) {
                *half = toggle as u16;
            }
        } else {
            self.words.extend_from_slice(toggles);
        }
        self.offsets.push(after);
        Ok(())
    }

    /// Appends all rows of others of the same side.
    ///
    /// # Errors
    /// As `push`.
    pub fn append(&mut self, runs: &Runs) -> Result<()> {
        let mut list = Vec::new();
        for row in 0..runs.rows() {
            list.clear();
            list.extend(runs.row_toggles(row).map(|toggle| toggle as u32));
            self.push(&list)?;
        }
        Ok(())
    }

    pub fn finish(mut self) -> Result<Runs> {
        self.words.shrink_to_fit();
        Runs::new(self.side, self.offsets, self.words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random_mask(side: usize, seed: usize) -> Vec<u32> {
        let word = |i: usize| {
            let x = ((seed * 977 + i) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23);
            match x % 5 {
                0 => 0,
                1 => !0,
                _ => (x.wrapping_mul(0xbf58_476d_1ce4_e5b9) & x >> 7) as u32,
            }
        };
        (0..side * side / 32).map(word).collect()
    }

    #[test]
    fn masks_come_back_and_unions_are_ors() {
        for side in [32, 128, 256, 512] {
            let masks: Vec<Vec<u32>> = (0..7)
                .map(|seed| match seed {
                    0 => vec![0; side * side / 32],
                    1 => vec![!0; side * side / 32],
                    seed => random_mask(side, seed),
                })
                .collect();
            let rows = |order: &[usize]| {
                let mut builder = RunsBuilder::new(side);
                for &mask in order {
                    let mut list = Vec::new();
                    toggles(&masks[mask], &mut list);
                    builder.push(&list).unwrap();
                }
                builder.finish().unwrap()
            };
            let (a, b) = (rows(&[0, 1, 2, 3, 4, 5, 6]), rows(&[1, 0, 3, 0, 5, 6, 2]));
            let both = Runs::union(&[&a, &b]).unwrap();
            for (row, other) in [1, 0, 3, 0, 5, 6, 2].into_iter().enumerate() {
                let decoded = |runs: &Runs| {
                    let mut mask = vec![0; side * side / 32];
                    runs.fill(row, &mut mask);
                    mask
                };
                assert_eq!(decoded(&a), masks[row], "{side} {row}");
                let or: Vec<u32> = masks[row].iter().zip(&masks[other]).map(|(a, b)| a | b).collect();
                assert_eq!(decoded(&both), or, "{side} {row}");
            }
            assert!(a.is_empty(0) && a.spans(1).eq(std::iter::once(0..side * side)));
            assert_eq!(a.offsets()[2], 1, "a full row costs one toggle");
        }
    }

    #[test]
    fn damaged_rows_are_refused() {
        let pack = |a: u32, b: u32| a | b << 16;
        assert!(Runs::new(32, vec![0, 2], vec![pack(3, 7)]).is_ok());
        assert!(Runs::new(32, vec![0, 2], vec![pack(7, 3)]).is_err());
        assert!(Runs::new(32, vec![0, 2], vec![pack(3, 1024)]).is_err());
        assert!(Runs::new(32, vec![0, 3], vec![pack(3, 7)]).is_err());
        assert!(Runs::new(32, vec![0, 2, 1], vec![pack(3, 7)]).is_err());
        assert!(Runs::new(32, vec![], vec![]).is_err());
        let (small, other) = (Runs::new(32, vec![0, 0], vec![]).unwrap(), Runs::new(64, vec![0, 0], vec![]).unwrap());
        assert!(Runs::union(&[&small, &other]).is_err() && Runs::union(&[]).is_err());
    }
}
