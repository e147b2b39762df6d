//! Sparse rows times a vector of light, each entry changed by the way that it takes:
//! `out[row] = scale[row] * sum_e weight_e * distance[way_e >> 16] * direction[way_e & 0xffff] * vector[index_e]`.
//!
//! The tables hold any change of light by distance and direction (thesis 5.4.2), so that a slider of such an edit costs
//! a new table and one pass over the entries of its block. Order of the sum as in `sparse_product`. Rows of basis `cut`
//! only, whose weights are unsigned.

#[cfg(feature = "gpu")]
use super::sparse_product::row_pages;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::transport::sparse::SparseRows;
use crate::transport::ways::{CODES, Factors};
use crate::{Error, Result};
use rayon::prelude::*;

/// Rows that one task multiplies.
const BLOCK: usize = 64;

uniform! {
    struct Params {
        rows: u32,
        first_entry: u32,
        index_bits: u32,
        pad0: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "path_product",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/path_product.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<u32>("offsets"),
        Binding::read::<u32>("entries"),
        Binding::read::<f32>("scale"),
        Binding::read::<u32>("ways"),
        Binding::read::<f32>("factors"),
        Binding::read::<[f32; 4]>("vector"),
        Binding::write::<[f32; 4]>("products"),
    ],
};

/// `ways`: one an entry; `vector`: `rows.columns()` elements. The result has one element a row.
pub fn path_product(
    device: &Device,
    rows: &SparseRows,
    ways: &Array<u32>,
    factors: &Factors,
    vector: &[[f32; 4]],
) -> Result<Vec<[f32; 4]>> {
    let fits = !rows.format().signed
        && ways.len() == rows.entries().len()
        && vector.len() == rows.columns()
        && [&factors.distance, &factors.direction].iter().all(|table| table.len() == CODES);
    if !fits {
        let message = format!(
            "path_product: {} ways for {} entries of {:?}, a vector of {} elements for {} columns",
            ways.len(),
            rows.entries().len(),
            rows.format(),
            vector.len(),
            rows.columns()
        );
        return Err(Error::compute(message, "this is a fault of the node that called the kernel; please report it"));
    }
    match device {
        Device::Cpu => Ok(cpu(rows, ways, factors, vector)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, rows, ways, factors, vector),
    }
}

fn cpu(rows: &SparseRows, ways: &[u32], factors: &Factors, vector: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let is_one = |table: &[f32]| table.iter().all(|&factor| factor == 1.0);
    // A table of ones is not looked into: times one changes no bit.
    match (is_one(&factors.distance), is_one(&factors.direction)) {
        (false, true) => multiply::<true, false>(rows, ways, factors, vector),
        (true, false) => multiply::<false, true>(rows, ways, factors, vector),
        _ => multiply::<true, true>(rows, ways, factors, vector),
    }
}

struct Tables<'a> {
    distance: &'a [f32; CODES],
    direction: &'a [f32; CODES],
    vector: &'a [[f32; 4]],
    index_bits: u32,
}

fn multiply<const DISTANCE: bool, const DIRECTION: bool>(
    rows: &SparseRows,
    ways: &[u32],
    factors: &Factors,
    vector: &[[f32; 4]],
) -> Vec<[f32; 4]> {
    let index_bits = rows.format().index_bits;
    assert_eq!(vector.len(), 1 << index_bits, "a column has index_bits bits");
    let distance = factors.distance.as_slice().try_into().expect("length was checked");
    let direction = factors.direction.as_slice().try_into().expect("length was checked");
    let tables = Tables { distance, direction, vector, index_bits };
    let mut products = vec![[0.0; 4]; rows.rows()];
    products.par_chunks_mut(BLOCK).enumerate().for_each(|(block, products)| {
        for (row, product) in (block * BLOCK..).zip(products) {
            let range = rows.offsets()[row] as usize..rows.offsets()[row + 1] as usize;
            let sum = row_sum::<DISTANCE, DIRECTION>(&rows.entries()[range.clone()], &ways[range], &tables);
            *product = sum.map(|sum| sum * rows.scale()[row]);
        }
    });
    products
}

#[inline]
fn row_sum<const DISTANCE: bool, const DIRECTION: bool>(entries: &[u32], ways: &[u32], tables: &Tables) -> [f32; 4] {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi2") {
        // SAFETY: the processor has what the function is compiled for.
        return unsafe { row_sum_avx2::<DISTANCE, DIRECTION>(entries, ways, tables) };
    }
    row_sum_plain::<DISTANCE, DIRECTION>(entries, ways, tables)
}

/// The same code for wider registers, without fused operations: the same bits.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi2")]
fn row_sum_avx2<const DISTANCE: bool, const DIRECTION: bool>(
    entries: &[u32],
    ways: &[u32],
    tables: &Tables,
) -> [f32; 4] {
    row_sum_plain::<DISTANCE, DIRECTION>(entries, ways, tables)
}

#[inline(always)]
fn row_sum_plain<const DISTANCE: bool, const DIRECTION: bool>(
    entries: &[u32],
    ways: &[u32],
    tables: &Tables,
) -> [f32; 4] {
    let mut sums = [[0.0f32; 4]; 4];
    let (fours, rest) = entries.as_chunks::<4>();
    let (way_fours, way_rest) = ways.as_chunks::<4>();
    for (entries, ways) in fours.iter().zip(way_fours) {
        for lane in 0..4 {
            add::<DISTANCE, DIRECTION>(&mut sums[lane], entries[lane], ways[lane], tables);
        }
    }
    for (sum, (&entry, &way)) in sums.iter_mut().zip(rest.iter().zip(way_rest)) {
        add::<DISTANCE, DIRECTION>(sum, entry, way, tables);
    }
    let [s0, s1, s2, s3] = sums;
    std::array::from_fn(|c| (s0[c] + s1[c]) + (s2[c] + s3[c]))
}

#[inline(always)]
fn add<const DISTANCE: bool, const DIRECTION: bool>(sum: &mut [f32; 4], entry: u32, way: u32, tables: &Tables) {
    // From i32 the conversion is a single instruction, and a weight fits in 31 bits.
    let mut weight = (entry << tables.index_bits >> tables.index_bits) as i32 as f32;
    let mut factor = 1.0;
    if DISTANCE {
        factor *= tables.distance[(way >> 16) as usize];
    }
    if DIRECTION {
        factor *= tables.direction[(way & 0xffff) as usize];
    }
    weight *= factor;
    // SAFETY: what is left of an entry has index_bits bits, and `multiply` holds the vector to be that long.
    let light = unsafe { tables.vector.get_unchecked((entry >> (32 - tables.index_bits)) as usize) };
    for c in 0..4 {
        sum[c] += light[c] * weight;
    }
}

#[cfg(feature = "gpu")]
fn gpu(
    gpu: &Gpu,
    rows: &SparseRows,
    ways: &Array<u32>,
    factors: &Factors,
    vector: &[[f32; 4]],
) -> Result<Vec<[f32; 4]>> {
    let mut products = Vec::with_capacity(rows.rows());
    let light = gpu.upload(vector);
    let tables = gpu.upload_parts([&factors.distance[..], &factors.direction[..]].into_iter());
    for range in row_pages(gpu, rows, 1) {
        let entries = rows.offsets()[range.start] as usize..rows.offsets()[range.end] as usize;
        let params = Params {
            rows: range.len() as u32,
            first_entry: entries.start as u32,
            index_bits: rows.format().index_bits,
            pad0: 0,
        };
        let part = gpu.storage::<[f32; 4]>(range.len());
        let buffers = [
            &gpu.array(rows.offsets(), range.start..range.end + 1),
            &gpu.array(rows.entries(), entries.clone()),
            &gpu.array(rows.scale(), range.clone()),
            &gpu.array(ways, entries),
            &tables,
            &light,
            &part,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(16))?;
        let [page] = batch.read([&part])?;
        products.extend_from_slice(page.get());
    }
    Ok(products)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::sparse_product;
    use crate::transport::sparse::EntryFormat;
    use crate::transport::ways;
    use glam::Vec3;

    #[test]
    fn factors_of_one_change_no_bit_and_others_scale_entries() {
        let format = EntryFormat::new(3, false).unwrap();
        let lists: Vec<Vec<(u32, f32)>> =
            (0..9).map(|row| (0..row).map(|j| (j % 8, 0.3 + j as f32)).collect()).collect();
        let rows = SparseRows::from_rows(format, lists.iter().map(Vec::as_slice)).unwrap();
        let vector: Vec<[f32; 4]> = (0..8).map(|i| [i as f32, 1.0, 0.1 * i as f32, 0.0]).collect();
        let near = ways::pack(Vec3::X);
        let ways = Array::from(vec![near; rows.entries().len()]);
        let mut factors = Factors::default();
        let run = |factors: &Factors| path_product(&Device::Cpu, &rows, &ways, factors, &vector).unwrap();
        let plain = sparse_product(&Device::Cpu, &rows, &vector, 1).unwrap();
        assert_eq!(run(&factors), plain);
        factors.by_distance(|_| 4.0);
        factors.by_direction(|v| if v.x > 0.9 { 0.5 } else { 100.0 });
        for (found, plain) in run(&factors).iter().zip(&plain) {
            assert_eq!(found.map(|x| 0.5 * x), *plain, "times four, times a half");
        }
        assert!(path_product(&Device::Cpu, &rows, &ways, &factors, &vector[1..]).is_err());
    }
}
