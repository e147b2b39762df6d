//! Sparse matrix rows in four bytes an entry: the shape in which transfer is stored and multiplied.
//!
//! An entry is `index << (32 - index_bits) | weight`: a column in the high `index_bits` bits, a fixed-point weight in
//! the others, two's complement when `signed`. The real weight is `weight * scale[row]`, so each row uses the whole
//! range of its integers. At 16 index bits and signed weights the rounding error of an entry is at most 1/65,534 of the
//! row's largest weight. Not for: the product itself (see `kernels::sparse_product`).

use crate::device::Array;
use crate::{Error, Result};

/// The weight bits that f32 holds exactly; wider fields are left unused at the top.
const EXACT_BITS: u32 = 24;

/// How an entry is split into column and weight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EntryFormat {
    /// Bits of the column, [1, 24]; the multiplied vector has `1 << index_bits` elements.
    pub index_bits: u32,
    /// Weights are two's complement; otherwise they are not negative.
    pub signed: bool,
}

impl EntryFormat {
    /// `Error::Compute` for no or more than 24 bits: the weight keeps at least 7 and a sign.
    pub fn new(index_bits: u32, signed: bool) -> Result<Self> {
        if !(1..=24).contains(&index_bits) {
            return Err(Error::compute(
                format!("sparse rows address 2 to 16,777,216 columns (1 to 24 index bits), not {index_bits} bits"),
                "use fewer gather samples",
            ));
        }
        Ok(Self { index_bits, signed })
    }

    /// Elements of the multiplied vector.
    pub fn columns(self) -> usize {
        1 << self.index_bits
    }

    /// The largest integer weight.
    pub fn max_weight(self) -> i32 {
        let bits = (32 - self.index_bits - u32::from(self.signed)).min(EXACT_BITS);
        (1 << bits) - 1
    }

    /// The column and the integer weight of an entry.
    #[inline(always)]
    pub fn unpack(self, entry: u32) -> (usize, i32) {
        let index = (entry >> (32 - self.index_bits)) as usize;
        let high = entry << self.index_bits;
        let weight = if self.signed { high as i32 >> self.index_bits } else { (high >> self.index_bits) as i32 };
        (index, weight)
    }

    fn pack(self, index: u32, weight: i32) -> u32 {
        index << (32 - self.index_bits) | (weight as u32) << self.index_bits >> self.index_bits
    }

    /// Rounds a row of (column, weight) pairs to fixed point, appends its entries, and returns the row's scale. Pairs
    /// whose weight rounds to zero are left out. Sort by column for speed; the order is kept.
    ///
    /// `Error::Compute` for a column out of range, a weight that is not finite, or a negative weight in an unsigned row.
    pub fn pack_row(self, row: &[(u32, f32)], entries: &mut Vec<u32>) -> Result<f32> {
        let mut largest = 0.0f32;
        for &(index, weight) in row {
            if index as usize >= self.columns() || !weight.is_finite() || (weight < 0.0 && !self.signed) {
                let kind = if self.signed { "a finite" } else { "a finite, non-negative" };
                return Err(Error::compute(
                    format!(
                        "a sparse row holds weight {weight} at column {index}; expected {kind} weight below column {}",
                        self.columns()
                    ),
                    "look for NaN or infinity in the scene's geometry and materials",
                ));
            }
            largest = largest.max(weight.abs());
        }
        // In f64: the quotient and the scale of denormal rows would lose their bits in f32.
        let scale = (largest as f64 / self.max_weight() as f64) as f32;
        if scale == 0.0 {
            return Ok(0.0);
        }
        let limit = self.max_weight() as f64;
        // Positive rows hand what rounding takes on to the next entry: their sum, the light of an even room, stays.
        let mut carried = 0.0;
        for &(index, weight) in row {
            let exact = weight as f64 / scale as f64 + carried;
            let rounded = exact.round().clamp(if self.signed { -limit } else { 0.0 }, limit) as i32;
            if !self.signed {
                carried = exact - rounded as f64;
            }
            if rounded != 0 {
                entries.push(self.pack(index, rounded));
            }
        }
        Ok(scale)
    }
}

/// A sparse matrix by rows: `rows() x columns()`.
#[derive(Clone, Debug)]
pub struct SparseRows {
    offsets: Array<u32>,
    entries: Array<u32>,
    scale: Array<f32>,
    format: EntryFormat,
}

impl SparseRows {
    /// Takes rows apart already packed. `offsets` has one element more than there are rows, starts at 0, never falls,
    /// and ends at the number of entries; `scale` has one finite element a row. `Error::Compute` otherwise: such rows
    /// came from a damaged file or a faulty node.
    pub fn new(
        offsets: impl Into<Array<u32>>,
        entries: impl Into<Array<u32>>,
        scale: impl Into<Array<f32>>,
        format: EntryFormat,
    ) -> Result<Self> {
        let (offsets, entries, scale) = (offsets.into(), entries.into(), scale.into());
        let format = EntryFormat::new(format.index_bits, format.signed)?;
        let wrong = |what: String| Err(Error::compute(format!("sparse rows are damaged: {what}"), "clear the cache"));
        if offsets.len() != scale.len() + 1 {
            return wrong(format!("{} offsets for {} rows", offsets.len(), scale.len()));
        }
        if offsets[0] != 0 || offsets[scale.len()] as usize != entries.len() {
            return wrong(format!(
                "offsets run from {} to {}, not from 0 to {}",
                offsets[0],
                offsets[scale.len()],
                entries.len()
            ));
        }
        if let Some(row) = offsets.windows(2).position(|pair| pair[0] > pair[1]) {
            return wrong(format!("row {row} ends before it starts"));
        }
        if let Some(row) = scale.iter().position(|scale| !scale.is_finite()) {
            return wrong(format!("the scale of row {row} is {}", scale[row]));
        }
        Ok(Self { offsets, entries, scale, format })
    }

    /// Packs rows of (column, weight) pairs; see `EntryFormat::pack_row` for the rounding and the errors.
    pub fn from_rows<'a>(format: EntryFormat, rows: impl IntoIterator<Item = &'a [(u32, f32)]>) -> Result<Self> {
        let mut builder = SparseRowsBuilder::new(format)?;
        for row in rows {
            builder.push(row)?;
        }
        builder.finish()
    }

    pub fn rows(&self) -> usize {
        self.scale.len()
    }

    /// A power of two.
    pub fn columns(&self) -> usize {
        self.format.columns()
    }

    pub fn format(&self) -> EntryFormat {
        self.format
    }

    /// `rows() + 1` positions in `entries()`.
    pub fn offsets(&self) -> &Array<u32> {
        &self.offsets
    }

    pub fn entries(&self) -> &Array<u32> {
        &self.entries
    }

    /// What an integer weight of 1 stands for, by row.
    pub fn scale(&self) -> &Array<f32> {
        &self.scale
    }

    /// The (column, weight) pairs of a row.
    pub fn row(&self, row: usize) -> impl ExactSizeIterator<Item = (usize, f32)> + '_ {
        let (format, scale) = (self.format, self.scale[row]);
        self.entries[self.offsets[row] as usize..self.offsets[row + 1] as usize].iter().map(move |&entry| {
            let (index, weight) = format.unpack(entry);
            (index, weight as f32 * scale)
        })
    }

    pub fn bytes(&self) -> u64 {
        4 * (self.offsets.len() + self.entries.len() + self.scale.len()) as u64
    }
}

/// Collects rows one after another. Rows made in parallel are packed with `EntryFormat::pack_row` and put together with
/// `push_packed`.
pub struct SparseRowsBuilder {
    offsets: Vec<u32>,
    entries: Vec<u32>,
    scale: Vec<f32>,
    format: EntryFormat,
}

impl SparseRowsBuilder {
    pub fn new(format: EntryFormat) -> Result<Self> {
        let format = EntryFormat::new(format.index_bits, format.signed)?;
        Ok(Self { offsets: vec![0], entries: Vec::new(), scale: Vec::new(), format })
    }

    /// So far.
    pub fn rows(&self) -> usize {
        self.scale.len()
    }

    /// So far.
    pub fn entries(&self) -> usize {
        self.entries.len()
    }

    pub fn push(&mut self, row: &[(u32, f32)]) -> Result<()> {
        let scale = self.format.pack_row(row, &mut self.entries)?;
        self.close(scale)
    }

    /// Appends a row that `EntryFormat::pack_row` made.
    pub fn push_packed(&mut self, entries: &[u32], scale: f32) -> Result<()> {
        self.entries.extend_from_slice(entries);
        self.close(scale)
    }

    /// Appends all rows of others of the same format.
    ///
    /// # Errors
    /// As `push`.
    pub fn append(&mut self, rows: &SparseRows) -> Result<()> {
        (0..rows.rows()).try_for_each(|row| {
            let range = rows.offsets[row] as usize..rows.offsets[row + 1] as usize;
            self.push_packed(&rows.entries[range], rows.scale[row])
        })
    }

    fn close(&mut self, scale: f32) -> Result<()> {
        let end = u32::try_from(self.entries.len()).map_err(|_| {
            Error::compute(
                format!("the transfer has more than {} entries, the most that can be addressed", u32::MAX),
                "raise the tolerance, or render fewer samples at once",
            )
        })?;
        self.offsets.push(end);
        self.scale.push(scale);
        Ok(())
    }

    pub fn finish(self) -> Result<SparseRows> {
        SparseRows::new(self.offsets, self.entries, self.scale, self.format)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_survives_packing() {
        for (index_bits, signed) in [(16, true), (17, false), (1, true), (24, false), (24, true)] {
            let format = EntryFormat::new(index_bits, signed).unwrap();
            let last = format.columns() as u32 - 1;
            let low = if signed { -1.0 } else { 0.25 };
            let rows = SparseRows::from_rows(format, [&[(0, low), (last, 0.5)][..], &[], &[(last, 65504.0)]]).unwrap();
            let step = 1.0 / format.max_weight() as f32;
            let first: Vec<_> = rows.row(0).collect();
            assert_eq!([first[0].0, first[1].0], [0, last as usize]);
            assert!((first[0].1 - low).abs() <= step && (first[1].1 - 0.5).abs() <= step, "{format:?} {first:?}");
            assert_eq!(rows.row(1).len(), 0);
            let large = rows.row(2).next().unwrap();
            assert!((large.1 / 65504.0 - 1.0).abs() < 1e-6, "{format:?} {large:?}");
        }
    }

    #[test]
    fn bad_rows_are_refused() {
        let unsigned = EntryFormat::new(4, false).unwrap();
        for row in [[(16, 1.0)], [(0, -1.0)], [(0, f32::NAN)], [(0, f32::INFINITY)]] {
            assert!(SparseRows::from_rows(unsigned, [&row[..]]).is_err(), "{row:?}");
        }
        assert!(EntryFormat::new(25, true).is_err() && EntryFormat::new(0, true).is_err());
        assert!(SparseRows::new(vec![0, 2], vec![0], vec![1.0], unsigned).is_err());
        assert!(SparseRows::new(vec![0, 2, 1], vec![0], vec![1.0, 1.0], unsigned).is_err());
        assert!(SparseRows::new(vec![0], vec![], vec![1.0], unsigned).is_err());
    }
}
