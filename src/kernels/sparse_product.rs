//! Sparse rows times vectors of light: `out[k][row] = scale[row] * sum_e weight_e * vector[k][index_e]`.
//!
//! This is what relighting does (thesis eq. 5.1), and it is bound by memory: every entry is read once from the rows, for
//! up to four vectors at a time, so the tenth edit of a graph costs less than the first. Vectors have `1 << index_bits`
//! elements; the product of `count` of them with N rows is `count` vectors of N.
//!
//! Order of the sum, in both bodies: four running sums over the entries l, l + 4, l + 8, ... (l = 0..4), added as
//! `(s0 + s1) + (s2 + s3)`, times the row's scale.

use super::{split_columns, vector_length};
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::transport::SparseRows;
use crate::{Error, Result};
use glam::Vec4;
use rayon::prelude::*;

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

/// One cache line of the table, so that the table is aligned to one.
#[repr(C, align(64))]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Line([[f32; 4]; 4]);

fn multiply<const K: usize, const SIGNED: bool>(rows: &SparseRows, vectors: &[[f32; 4]], products: &mut [[f32; 4]]) {
    // The vectors interleaved: what an entry needs of all of them lies together.
    let columns = rows.columns();
    let mut lines = vec![Line([[0.0; 4]; 4]); (K * columns).div_ceil(4)];
    let table: &mut [Vec4] = bytemuck::cast_slice_mut(&mut lines);
    table.par_chunks_mut(K * BLOCK).take(columns.div_ceil(BLOCK)).enumerate().for_each(|(block, table)| {
        for (i, cell) in table.chunks_exact_mut(K).enumerate().take(columns - block * BLOCK) {
            (0..K).for_each(|k| cell[k] = Vec4::from_array(vectors[k * columns + block * BLOCK + i]));
        }
    });
    let table = &table[..K * columns];
    let index_bits = rows.format().index_bits;
    split_columns::<K, _>(products, BLOCK).into_par_iter().enumerate().for_each(|(block, mut products)| {
        let first = block * BLOCK;
        for i in 0..products[0].len() {
            let row = first + i;
            let entries = &rows.entries()[rows.offsets()[row] as usize..rows.offsets()[row + 1] as usize];
            let sums = row_sums::<K, SIGNED>(entries, index_bits, table);
            (0..K).for_each(|k| products[k][i] = (sums[k] * rows.scale()[row]).to_array());
        }
    });
}

#[inline(always)]
fn row_sums<const K: usize, const SIGNED: bool>(entries: &[u32], index_bits: u32, table: &[Vec4]) -> [Vec4; K] {
    let mut sums = [[Vec4::ZERO; K]; 4];
    let (fours, rest) = entries.as_chunks::<4>();
    for four in fours {
        let weights = four.map(|entry| weight::<SIGNED>(entry, index_bits));
        for lane in 0..4 {
            let cell = &table[K * (four[lane] >> (32 - index_bits)) as usize..][..K];
            (0..K).for_each(|k| sums[lane][k] += cell[k] * weights[lane]);
        }
    }
    for (lane, &entry) in rest.iter().enumerate() {
        let cell = &table[K * (entry >> (32 - index_bits)) as usize..][..K];
        (0..K).for_each(|k| sums[lane][k] += cell[k] * weight::<SIGNED>(entry, index_bits));
    }
    std::array::from_fn(|k| (sums[0][k] + sums[1][k]) + (sums[2][k] + sums[3][k]))
}

#[inline(always)]
fn weight<const SIGNED: bool>(entry: u32, index_bits: u32) -> f32 {
    let high = entry << index_bits;
    // An unsigned weight fits in 31 bits too, and from i32 the conversion is a single instruction.
    (if SIGNED { high as i32 >> index_bits } else { (high >> index_bits) as i32 }) as f32
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
                    let sign = |j: usize| if signed && j % 3 == 0 { -1.0 } else { 1.0 };
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
    fn vectors_of_another_length_are_refused() {
        let rows = SparseRows::from_rows(EntryFormat::new(2, true).unwrap(), [&[(1, 1.0)][..]]).unwrap();
        assert!(sparse_product(&Device::Cpu, &rows, &[[1.0; 4]; 8], 1).is_err());
        assert!(sparse_product(&Device::Cpu, &rows, &[[1.0; 4]; 4], 1).is_ok());
    }
}
