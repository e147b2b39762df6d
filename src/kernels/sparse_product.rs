//! Sparse rows times vectors of light: `out[k][row] = scale[row] * sum_e weight_e * vector[k][index_e]`.
//!
//! This is what relighting does (thesis eq. 5.1), and it is bound by memory: every entry is read once from the rows, for
//! up to four vectors at a time, so the tenth edit of a graph costs less than the first. Vectors have `1 << index_bits`
//! elements; the product of `count` of them with N rows is `count` vectors of N.
//!
//! Order of the sum, in both bodies: four running sums over the entries l, l + 4, l + 8, ... (l = 0..4), added as
//! `(s0 + s1) + (s2 + s3)`, times the row's scale.

#[cfg(feature = "gpu")]
use super::put_columns;
use super::{split_columns, vector_length};
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::transport::sparse::SparseRows;
use crate::{Error, Result};
use rayon::prelude::*;
#[cfg(feature = "gpu")]
use std::ops::Range;

/// Vectors that one pass over the entries multiplies.
const VECTORS: usize = 4;
/// Rows that one task multiplies.
const BLOCK: usize = 256;

uniform! {
    struct Params {
        rows: u32,
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
    name: "sparse_product",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/sparse_product.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<u32>("offsets"),
        Binding::read::<u32>("entries"),
        Binding::read::<f32>("scale"),
        Binding::read::<[f32; 4]>("vectors"),
        Binding::write::<[f32; 4]>("products"),
    ],
};

/// Multiplies the rows with `count` vectors of `rows.columns()` elements; the result is `count` vectors of
/// `rows.rows()` elements.
pub fn sparse_product(device: &Device, rows: &SparseRows, vectors: &[[f32; 4]], count: usize) -> Result<Vec<[f32; 4]>> {
    let length = vector_length(KERNEL.name, vectors.len(), count)?;
    if length != rows.columns() {
        return Err(Error::compute(
            format!("sparse_product: vectors of {length} elements; the rows have {} columns", rows.columns()),
            "the light and the transfer were made for different gather samples",
        ));
    }
    let mut products = vec![[0.0; 4]; count * rows.rows()];
    if rows.rows() == 0 {
        return Ok(products);
    }
    let passes = products.chunks_mut(VECTORS * rows.rows()).zip(vectors.chunks(VECTORS * length));
    for (products, vectors) in passes {
        match device {
            Device::Cpu => cpu(rows, vectors, products),
            #[cfg(feature = "gpu")]
            Device::Gpu(gpu) => self::gpu(gpu, rows, vectors, products)?,
        }
    }
    Ok(products)
}

fn cpu(rows: &SparseRows, vectors: &[[f32; 4]], products: &mut [[f32; 4]]) {
    match (products.len() / rows.rows(), rows.format().signed) {
        (1, true) => multiply::<1, true>(rows, vectors, products),
        (1, false) => multiply::<1, false>(rows, vectors, products),
        (2, true) => multiply::<2, true>(rows, vectors, products),
        (2, false) => multiply::<2, false>(rows, vectors, products),
        (3, true) => multiply::<3, true>(rows, vectors, products),
        (3, false) => multiply::<3, false>(rows, vectors, products),
        (_, true) => multiply::<4, true>(rows, vectors, products),
        (_, false) => multiply::<4, false>(rows, vectors, products),
    }
}

/// What an entry needs of K vectors, side by side.
type Cell<const K: usize> = [[f32; 4]; K];

/// The memory of the table, aligned so that no cell of 4 vectors straddles two cache lines.
#[repr(C, align(64))]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Line(Cell<4>);

fn multiply<const K: usize, const SIGNED: bool>(rows: &SparseRows, vectors: &[[f32; 4]], products: &mut [[f32; 4]]) {
    let columns = rows.columns();
    let mut lines = vec![Line([[0.0; 4]; 4]); (K * columns).div_ceil(4)];
    let values: &mut [[f32; 4]] = bytemuck::cast_slice_mut(&mut lines);
    let (cells, _) = values[..K * columns].as_chunks_mut::<K>();
    cells.par_chunks_mut(BLOCK).enumerate().for_each(|(block, cells)| {
        for (i, cell) in cells.iter_mut().enumerate() {
            *cell = std::array::from_fn(|k| vectors[k * columns + block * BLOCK + i]);
        }
    });
    let table: &[Cell<K>] = cells;
    assert_eq!(table.len(), 1 << rows.format().index_bits, "a column has index_bits bits");
    split_columns::<K, _>(products, BLOCK).into_par_iter().enumerate().for_each(|(block, products)| {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi2") {
            // SAFETY: the processor has what the function is compiled for.
            return unsafe { multiply_rows_avx2::<K, SIGNED>(rows, table, block * BLOCK, products) };
        }
        multiply_rows::<K, SIGNED>(rows, table, block * BLOCK, products);
    });
}

/// The same code with twice as wide registers, without fused operations: the same bits. Measured on a machine with
/// AVX-512: 1.1 times as fast with one vector, 3 times with four; wider registers yet were slower.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi2")]
fn multiply_rows_avx2<const K: usize, const SIGNED: bool>(
    rows: &SparseRows,
    table: &[Cell<K>],
    first: usize,
    products: [&mut [[f32; 4]]; K],
) {
    multiply_rows::<K, SIGNED>(rows, table, first, products);
}

#[inline(always)]
fn multiply_rows<const K: usize, const SIGNED: bool>(
    rows: &SparseRows,
    table: &[Cell<K>],
    first: usize,
    products: [&mut [[f32; 4]]; K],
) {
    let index_bits = rows.format().index_bits;
    for i in 0..products[0].len() {
        let (start, end) = (rows.offsets()[first + i], rows.offsets()[first + i + 1]);
        let sums = row_sums::<K, SIGNED>(&rows.entries()[start as usize..end as usize], index_bits, table);
        for k in 0..K {
            products[k][i] = sums[k].map(|sum| sum * rows.scale()[first + i]);
        }
    }
}

/// Plain arrays rather than a vector type: the compiler then uses the widest registers that it may.
#[inline(always)]
fn row_sums<const K: usize, const SIGNED: bool>(entries: &[u32], index_bits: u32, table: &[Cell<K>]) -> Cell<K> {
    let mut sums = [[[0.0; 4]; K]; 4];
    let (fours, rest) = entries.as_chunks::<4>();
    for four in fours {
        let weights = four.map(|entry| weight::<SIGNED>(entry, index_bits));
        for lane in 0..4 {
            add(&mut sums[lane], cell(table, four[lane], index_bits), weights[lane]);
        }
    }
    for (sums, &entry) in sums.iter_mut().zip(rest) {
        add(sums, cell(table, entry, index_bits), weight::<SIGNED>(entry, index_bits));
    }
    let [s0, s1, s2, s3] = sums;
    std::array::from_fn(|k| std::array::from_fn(|c| (s0[k][c] + s1[k][c]) + (s2[k][c] + s3[k][c])))
}

#[inline(always)]
fn cell<const K: usize>(table: &[Cell<K>], entry: u32, index_bits: u32) -> &Cell<K> {
    // SAFETY: what is left of an entry has index_bits bits, and `multiply` holds the table to be that long.
    unsafe { table.get_unchecked((entry >> (32 - index_bits)) as usize) }
}

#[inline(always)]
fn add<const K: usize>(sums: &mut Cell<K>, cell: &Cell<K>, weight: f32) {
    for k in 0..K {
        for c in 0..4 {
            sums[k][c] += cell[k][c] * weight;
        }
    }
}

#[inline(always)]
fn weight<const SIGNED: bool>(entry: u32, index_bits: u32) -> f32 {
    let high = entry << index_bits;
    // An unsigned weight fits in 31 bits too, and from i32 the conversion is a single instruction.
    (if SIGNED { high as i32 >> index_bits } else { (high >> index_bits) as i32 }) as f32
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, rows: &SparseRows, vectors: &[[f32; 4]], products: &mut [[f32; 4]]) -> Result<()> {
    let count = products.len() / rows.rows();
    let light = gpu.upload(vectors);
    for range in row_pages(gpu, rows, count) {
        let entries = rows.offsets()[range.start] as usize..rows.offsets()[range.end] as usize;
        let params = Params {
            rows: range.len() as u32,
            first_entry: entries.start as u32,
            columns: rows.columns() as u32,
            count: count as u32,
            index_bits: rows.format().index_bits,
            is_signed: rows.format().signed.into(),
            pad0: 0,
            pad1: 0,
        };
        let part = gpu.storage::<[f32; 4]>(count * range.len());
        let buffers = [
            &gpu.array(rows.offsets(), range.start..range.end + 1),
            &gpu.array(rows.entries(), entries),
            &gpu.array(rows.scale(), range.clone()),
            &light,
            &part,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(16))?;
        let [page] = batch.read([&part])?;
        put_columns(products, rows.rows(), range, page.get());
    }
    Ok(())
}

/// Ranges of rows whose entries and products each fit in a page; a longer row is a page of its own.
#[cfg(feature = "gpu")]
pub(super) fn row_pages(gpu: &Gpu, rows: &SparseRows, count: usize) -> Vec<Range<usize>> {
    let (most_entries, most_rows) = (gpu.page(4), gpu.page(16 * count));
    let offsets = rows.offsets();
    let mut pages = Vec::new();
    let mut start = 0;
    while start < rows.rows() {
        let last = offsets[start] as usize + most_entries;
        let fitting = offsets[start + 1..].partition_point(|&end| end as usize <= last);
        let end = start + fitting.clamp(1, most_rows).min(rows.rows() - start);
        pages.push(start..end);
        start = end;
    }
    pages
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sparse::EntryFormat;

    #[test]
    fn equals_the_sum_over_the_unpacked_pairs() {
        for (index_bits, signed) in [(3, true), (3, false), (10, true)] {
            let format = EntryFormat::new(index_bits, signed).unwrap();
            let columns = format.columns();
            let pairs: Vec<Vec<(u32, f32)>> = (0..600usize)
                .map(|row| {
                    let sign = |j: usize| if signed && j.is_multiple_of(3) { -1.0 } else { 1.0 };
                    (0..row % 23).map(|j| (((row * 7 + j * 5) % columns) as u32, sign(j) * (j + 1) as f32)).collect()
                })
                .collect();
            let rows = SparseRows::from_rows(format, pairs.iter().map(Vec::as_slice)).unwrap();
            for count in 1..=6 {
                let vectors: Vec<[f32; 4]> =
                    (0..count * columns).map(|i| [i as f32, (i % 13) as f32, 1.0, -0.5]).collect();
                let products = sparse_product(&Device::Cpu, &rows, &vectors, count).unwrap();
                for (k, row) in (0..count).flat_map(|k| (0..rows.rows()).map(move |row| (k, row))) {
                    // The sum, and the sum of magnitudes, which rounding errors are relative to.
                    let mut expected = [(0.0f64, 0.0f64); 4];
                    for (index, weight) in rows.row(row) {
                        for (c, (sum, magnitude)) in expected.iter_mut().enumerate() {
                            let term = weight as f64 * vectors[k * columns + index][c] as f64;
                            (*sum, *magnitude) = (*sum + term, *magnitude + term.abs());
                        }
                    }
                    for (found, (sum, magnitude)) in products[k * rows.rows() + row].iter().zip(expected) {
                        let error = (*found as f64 - sum).abs();
                        assert!(error <= 1e-6 * magnitude, "{format:?} vector {k} row {row}: {found} {sum}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_vector_gives_the_same_bits_alone_and_among_others() {
        let format = EntryFormat::new(6, true).unwrap();
        let pairs: Vec<Vec<(u32, f32)>> =
            (0..300).map(|row| (0..row % 64).map(|j| (j, 1.0 / (j + row + 1) as f32 - 0.01)).collect()).collect();
        let rows = SparseRows::from_rows(format, pairs.iter().map(Vec::as_slice)).unwrap();
        let vectors: Vec<[f32; 4]> = (0..5 * 64).map(|i| [(i as f32).sin(), 0.1 * i as f32, 1e-3, 7.7]).collect();
        let together = sparse_product(&Device::Cpu, &rows, &vectors, 5).unwrap();
        for (vector, together) in vectors.chunks(64).zip(together.chunks(300)) {
            assert_eq!(sparse_product(&Device::Cpu, &rows, vector, 1).unwrap(), together);
        }
    }

    #[test]
    fn vectors_of_another_length_are_refused() {
        let rows = SparseRows::from_rows(EntryFormat::new(2, true).unwrap(), [&[(1, 1.0)][..]]).unwrap();
        assert!(sparse_product(&Device::Cpu, &rows, &[[1.0; 4]; 8], 1).is_err());
        assert!(sparse_product(&Device::Cpu, &rows, &[[1.0; 4]; 4], 1).is_ok());
    }
}
