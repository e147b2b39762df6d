//! Rows of transfer, scaled by rows of edits, times vectors of light: `out[k][p] = scale[t] * sum_e weight_e * S_c(node_e) *
//! vector[k][node_e]` over the entries e of transfer row t, for pairs p = (t, c) of a transfer row and a scale row.
//!
//! This is what sampled edits cost in `relight` (thesis eqs. 5.2 to 5.4): the product of two rows of different bases,
//! which neither of them holds. Transfer rows are of basis `cut`: columns are nodes of the gather tree, vectors are its
//! pyramids of averages (`average_pyramid`). A scale row is three sparse rows, of red, green and blue, that hold the
//! Haar coefficients of `S - 1` along the gather samples; `S_c(node)` is the mean of S over the node's leaves, so the
//! product is exact where S is constant in every node that the transfer row names. The fourth element of light is
//! multiplied by 1.
//!
//! Pairs may come in any order and more than once; runs of one scale row cost its decoding once. Order of the sum, in
//! both bodies: four running sums over the entries l, l + 4, l + 8, ... (l = 0..4), added as `(s0 + s1) + (s2 + s3)`,
//! times the row's scale; a pair without a scale row gets the bits of `sparse_product`.

mod factors;
#[cfg(feature = "gpu")]
mod trees;

#[cfg(feature = "gpu")]
use super::sparse_product::row_pages;
use super::vector_length;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::transport::sparse::SparseRows;
use crate::{Error, Result};
use factors::Factors;
use rayon::prelude::*;

/// Vectors that one pass over the entries multiplies.
const VECTORS: usize = 4;
/// Pairs that one task multiplies.
const BLOCK: usize = 64;

/// A transfer row and a scale row.
pub type Pair = [u32; 2];

/// In the place of a scale row: S = 1.
pub const UNSCALED: u32 = u32::MAX;

uniform! {
    struct Params {
        pairs: u32,
        first_entry: u32,
        columns: u32,
        count: u32,
        index_bits: u32,
        is_signed: u32,
        pad0: u32,
        pad1: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "scaled_product",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/scaled_product.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<u32>("offsets"),
        Binding::read::<u32>("entries"),
        Binding::read::<f32>("scale"),
        Binding::read::<[f32; 4]>("vectors"),
        Binding::read::<Pair>("pairs"),
        Binding::read::<[u32; 4]>("trees"),
        Binding::write::<[f32; 4]>("products"),
    ],
};

/// Multiplies the pairs with `count` vectors of `rows.columns()` elements, pyramids over M leaves each; `scales` has three
/// rows of M columns for each scale row. The result is `count` vectors of `pairs.len()` elements.
///
/// Errors: vectors, rows and scale rows that do not fit each other; a pair that names a row that is not there.
pub fn scaled_product(
    device: &Device,
    rows: &SparseRows,
    scales: &SparseRows,
    pairs: &[Pair],
    vectors: &[[f32; 4]],
    count: usize,
) -> Result<Vec<[f32; 4]>> {
    let length = vector_length(KERNEL.name, vectors.len(), count)?;
    check(rows, scales, pairs, length)?;
    let mut products = vec![[0.0; 4]; count * pairs.len()];
    if pairs.is_empty() {
        return Ok(products);
    }
    let passes = products.chunks_mut(VECTORS * pairs.len()).zip(vectors.chunks(VECTORS * length));
    for (products, vectors) in passes {
        let task = Task { rows, scales, pairs, vectors };
        match device {
            Device::Cpu => task.cpu(products),
            #[cfg(feature = "gpu")]
            Device::Gpu(gpu) => task.gpu(gpu, products)?,
        }
    }
    Ok(products)
}

fn check(rows: &SparseRows, scales: &SparseRows, pairs: &[Pair], length: usize) -> Result<()> {
    let wrong = |what: String| {
        Err(Error::compute(format!("scaled_product: {what}"), "sample the edits anew for this transfer, of basis cut"))
    };
    if length != rows.columns() {
        return wrong(format!("vectors of {length} elements; the rows have {} columns", rows.columns()));
    }
    if 2 * scales.columns() != rows.columns() {
        return wrong(format!("{} columns of scale rows, {} of transfer rows", scales.columns(), rows.columns()));
    }
    let (transfer_rows, scale_rows) = (rows.rows(), scales.rows() / 3);
    let there =
        |[row, scale]: &Pair| (*row as usize) < transfer_rows && (*scale == UNSCALED || (*scale as usize) < scale_rows);
    if let Some(at) = pairs.par_iter().position_first(|pair| !there(pair)) {
        let [row, scale] = pairs[at];
        return wrong(format!(
            "pair {at} is of transfer row {row} and scale row {scale}; there are {transfer_rows} and {scale_rows}"
        ));
    }
    Ok(())
}

/// One pass: up to four vectors.
struct Task<'a> {
    rows: &'a SparseRows,
    scales: &'a SparseRows,
    pairs: &'a [Pair],
    vectors: &'a [[f32; 4]],
}

/// What an entry needs of K vectors, side by side.
type Cell<const K: usize> = [[f32; 4]; K];

/// The memory of the table, aligned so that no cell of 4 vectors straddles two cache lines.
#[repr(C, align(64))]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Line(Cell<4>);

impl Task<'_> {
    fn cpu(&self, products: &mut [[f32; 4]]) {
        match (products.len() / self.pairs.len(), self.rows.format().signed) {
            (1, true) => self.multiply::<1, true>(products),
            (1, false) => self.multiply::<1, false>(products),
            (2, true) => self.multiply::<2, true>(products),
            (2, false) => self.multiply::<2, false>(products),
            (3, true) => self.multiply::<3, true>(products),
            (3, false) => self.multiply::<3, false>(products),
            (_, true) => self.multiply::<4, true>(products),
            (_, false) => self.multiply::<4, false>(products),
        }
    }

    fn multiply<const K: usize, const SIGNED: bool>(&self, products: &mut [[f32; 4]]) {
        const CELLS: usize = 256;
        let columns = self.rows.columns();
        let mut lines = vec![Line([[0.0; 4]; 4]); (K * columns).div_ceil(4)];
        let values: &mut [[f32; 4]] = bytemuck::cast_slice_mut(&mut lines);
        let (cells, _) = values[..K * columns].as_chunks_mut::<K>();
        cells.par_chunks_mut(CELLS).enumerate().for_each(|(block, cells)| {
            for (i, cell) in cells.iter_mut().enumerate() {
                *cell = std::array::from_fn(|k| self.vectors[k * columns + block * CELLS + i]);
            }
        });
        let table: &[Cell<K>] = cells;
        assert_eq!(table.len(), 1 << self.rows.format().index_bits, "a column has index_bits bits");
        let levels = self.scales.columns().ilog2();
        let mut left: Vec<&mut [[f32; 4]]> = products.chunks_exact_mut(self.pairs.len()).collect();
        for part in parts(self.pairs) {
            let products: [&mut [[f32; 4]]; K] = std::array::from_fn(|k| {
                let (now, later) = std::mem::take(&mut left[k]).split_at_mut(part.len());
                left[k] = later;
                now
            });
            let shared = self.shared_factors(part, levels);
            let blocks = split_blocks(products, BLOCK).into_par_iter().zip(part.par_chunks(BLOCK));
            blocks.for_each_init(
                || shared.is_none().then(|| Factors::new(levels, factors::TOP)),
                |own, (mut products, pairs)| {
                    let mut done = 0;
                    for run in pairs.chunk_by(|a, b| a[1] == b[1]) {
                        let factors = match (&shared, &mut *own) {
                            (Some(shared), _) => shared,
                            (None, Some(own)) => {
                                own.fill(self.scales, scale_row(run));
                                own
                            }
                            (None, None) => unreachable!("made where none is shared"),
                        };
                        let products = products.each_mut().map(|products| &mut products[done..done + run.len()]);
                        multiply_run::<K, SIGNED>(self.rows, table, factors, run, products);
                        done += run.len();
                    }
                },
            );
        }
    }

    /// A table of all nodes for a part that is one long run of a row of many fine wavelets.
    fn shared_factors(&self, part: &[Pair], levels: u32) -> Option<Factors> {
        if !is_long(part) {
            return None;
        }
        let mut factors = Factors::new(levels, factors::TOP);
        factors.fill(self.scales, scale_row(part));
        if factors.deeper() > FINE {
            factors = Factors::new(levels, levels);
            factors.fill(self.scales, scale_row(part));
        }
        Some(factors)
    }
}

/// Pairs of one scale row, one after another, that are worth a table of all nodes.
const LONG: usize = 256;
/// Wavelets below the usual table that make look-ups slow.
const FINE: usize = 64;

fn is_long(part: &[Pair]) -> bool {
    part.len() >= LONG && part[0][1] == part[part.len() - 1][1]
}

/// Long runs, and what lies between them.
fn parts(pairs: &[Pair]) -> Vec<&[Pair]> {
    let (mut parts, mut start, mut end) = (Vec::new(), 0, 0);
    for run in pairs.chunk_by(|a, b| a[1] == b[1]) {
        if is_long(run) {
            parts.extend([&pairs[start..end], run]);
            start = end + run.len();
        }
        end += run.len();
    }
    parts.push(&pairs[start..end]);
    parts.retain(|part| !part.is_empty());
    parts
}

fn scale_row(run: &[Pair]) -> Option<usize> {
    Some(run[0][1]).filter(|scale| *scale != UNSCALED).map(|scale| scale as usize)
}

/// Cuts K vectors of equal length into blocks: each item holds the same range of all K.
fn split_blocks<const K: usize>(products: [&mut [[f32; 4]]; K], block: usize) -> Vec<[&mut [[f32; 4]]; K]> {
    let count = products[0].len().div_ceil(block);
    let mut columns = products.map(|column| column.chunks_mut(block));
    (0..count).map(|_| columns.each_mut().map(|column| column.next().expect("equal lengths"))).collect()
}

fn multiply_run<const K: usize, const SIGNED: bool>(
    rows: &SparseRows,
    table: &[Cell<K>],
    factors: &Factors,
    run: &[Pair],
    products: [&mut [[f32; 4]]; K],
) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi2") && is_x86_feature_detected!("lzcnt") {
        // SAFETY: the processor has what the function is compiled for.
        return unsafe { multiply_rows_avx2::<K, SIGNED>(rows, table, factors, run, products) };
    }
    multiply_rows::<K, SIGNED>(rows, table, factors, run, products);
}

/// The same code with wider registers, without fused operations: the same bits.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi2,lzcnt")]
fn multiply_rows_avx2<const K: usize, const SIGNED: bool>(
    rows: &SparseRows,
    table: &[Cell<K>],
    factors: &Factors,
    run: &[Pair],
    products: [&mut [[f32; 4]]; K],
) {
    multiply_rows::<K, SIGNED>(rows, table, factors, run, products);
}

#[inline(always)]
fn multiply_rows<const K: usize, const SIGNED: bool>(
    rows: &SparseRows,
    table: &[Cell<K>],
    factors: &Factors,
    run: &[Pair],
    products: [&mut [[f32; 4]]; K],
) {
    let index_bits = rows.format().index_bits;
    for (i, [row, _]) in run.iter().enumerate() {
        let row = *row as usize;
        let (start, end) = (rows.offsets()[row] as usize, rows.offsets()[row + 1] as usize);
        let sums = row_sums::<K, SIGNED>(&rows.entries()[start..end], index_bits, table, factors);
        for k in 0..K {
            products[k][i] = sums[k].map(|sum| sum * rows.scale()[row]);
        }
    }
}

/// Plain arrays rather than a vector type: the compiler then uses the widest registers that it may.
#[inline(always)]
fn row_sums<const K: usize, const SIGNED: bool>(
    entries: &[u32],
    index_bits: u32,
    table: &[Cell<K>],
    factors: &Factors,
) -> Cell<K> {
    let mut sums = [[[0.0; 4]; K]; 4];
    let (fours, rest) = entries.as_chunks::<4>();
    for four in fours {
        for lane in 0..4 {
            add::<K, SIGNED>(&mut sums[lane], four[lane], index_bits, table, factors);
        }
    }
    for (sums, &entry) in sums.iter_mut().zip(rest) {
        add::<K, SIGNED>(sums, entry, index_bits, table, factors);
    }
    let [s0, s1, s2, s3] = sums;
    std::array::from_fn(|k| std::array::from_fn(|c| (s0[k][c] + s1[k][c]) + (s2[k][c] + s3[k][c])))
}

#[inline(always)]
fn add<const K: usize, const SIGNED: bool>(
    sums: &mut Cell<K>,
    entry: u32,
    index_bits: u32,
    table: &[Cell<K>],
    factors: &Factors,
) {
    let node = (entry >> (32 - index_bits)) as usize;
    let high = entry << index_bits;
    let weight = (if SIGNED { high as i32 >> index_bits } else { (high >> index_bits) as i32 }) as f32;
    let factor = factors.at(node).map(|factor| factor * weight);
    // SAFETY: what is left of an entry has index_bits bits, and `multiply` holds the table to be that long.
    let cell = unsafe { table.get_unchecked(node) };
    for k in 0..K {
        for c in 0..4 {
            sums[k][c] += cell[k][c] * factor[c];
        }
    }
}

#[cfg(feature = "gpu")]
impl Task<'_> {
    /// Page by page of transfer rows; of a page's pairs, as many at once as their trees and products fit in pages.
    fn gpu(&self, gpu: &Gpu, products: &mut [[f32; 4]]) -> Result<()> {
        let (count, offsets) = (products.len() / self.pairs.len(), self.rows.offsets());
        let light = gpu.upload(self.vectors);
        let mut trees = trees::Trees::new(self.scales.columns().ilog2());
        for range in row_pages(gpu, self.rows, count) {
            let here: Vec<usize> =
                (0..self.pairs.len()).filter(|&p| range.contains(&(self.pairs[p][0] as usize))).collect();
            let mut left = &here[..];
            while !left.is_empty() {
                let (mut records, mut pairs, mut before) = (Vec::new(), Vec::new(), UNSCALED);
                let mut root = UNSCALED;
                for &p in &left[..left.len().min(gpu.page(16 * count))] {
                    let [row, scale] = self.pairs[p];
                    if scale != before {
                        if !pairs.is_empty() && records.len() > gpu.page(16) / 2 {
                            break;
                        }
                        root = if scale == UNSCALED { UNSCALED } else { records.len() as u32 };
                        if scale != UNSCALED {
                            trees.append(self.scales, scale as usize, &mut records);
                        }
                        before = scale;
                    }
                    pairs.push([row - range.start as u32, root]);
                }
                let entries = offsets[range.start] as usize..offsets[range.end] as usize;
                let params = Params {
                    pairs: pairs.len() as u32,
                    first_entry: entries.start as u32,
                    columns: self.rows.columns() as u32,
                    count: count as u32,
                    index_bits: self.rows.format().index_bits,
                    is_signed: self.rows.format().signed.into(),
                    pad0: 0,
                    pad1: 0,
                };
                let part = gpu.storage::<[f32; 4]>(count * pairs.len());
                let buffers = [
                    &gpu.array(offsets, range.start..range.end + 1),
                    &gpu.array(self.rows.entries(), entries),
                    &gpu.array(self.rows.scale(), range.clone()),
                    &light,
                    &gpu.upload(&pairs),
                    &gpu.upload(&records),
                    &part,
                ];
                let mut batch = gpu.batch();
                batch.dispatch(&KERNEL, &params, &buffers, pairs.len().div_ceil(16))?;
                let [page] = batch.read([&part])?;
                let (now, later) = left.split_at(pairs.len());
                for (column, part) in page.get::<[f32; 4]>().chunks_exact(pairs.len()).enumerate() {
                    for (&p, product) in now.iter().zip(part) {
                        products[column * self.pairs.len() + p] = *product;
                    }
                }
                left = later;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
