//! Sparse rows times a vector of light, each entry changed by the way that it takes:
//! `out[row] = scale[row] * sum_e weight_e * distance[way_e >> 16] * direction[way_e & 0xffff] * vector[index_e]`.
//!
//! The tables hold any change of light by distance and direction (thesis 5.4.2), so that a slider of such an edit costs
//! a new table and one pass over the entries of its block. Order of the sum as in `sparse_product`.

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
        is_signed: u32,
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
    let fits = ways.len() == rows.entries().len()
        && vector.len() == rows.columns()
        && [&factors.distance, &factors.direction].iter().all(|table| table.len() == CODES);
    if !fits {
        let message = format!(
            "path_product: {} ways for {} entries, a vector of {} elements for {} columns",
            ways.len(),
            rows.entries().len(),
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
    let tables = Tables {
        distance: factors.distance.as_slice().try_into().expect("length was checked"),
        direction: factors.direction.as_slice().try_into().expect("length was checked"),
    };
    let mut products = vec![[0.0; 4]; rows.rows()];
    products.par_chunks_mut(BLOCK).enumerate().for_each(|(block, products)| {
        for (row, product) in (block * BLOCK..).zip(products) {
            let range = rows.offsets()[row] as usize..rows.offsets()[row + 1] as usize;
            let sum = row_sum(rows, &rows.entries()[range.clone()], &ways[range], &tables, vector);
            *product = sum.map(|sum| sum * rows.scale()[row]);
        }
    });
    products
}

struct Tables<'a> {
    distance: &'a [f32; CODES],
    direction: &'a [f32; CODES],
}

#[inline(always)]
fn row_sum(rows: &SparseRows, entries: &[u32], ways: &[u32], tables: &Tables, vector: &[[f32; 4]]) -> [f32; 4] {
    let format = rows.format();
    let mut sums = [[0.0f32; 4]; 4];
    for (entries, ways) in entries.chunks(4).zip(ways.chunks(4)) {
        for (sum, (&entry, &way)) in sums.iter_mut().zip(entries.iter().zip(ways)) {
            let (index, weight) = format.unpack(entry);
            let factor = tables.distance[(way >> 16) as usize] * tables.direction[(way & 0xffff) as usize];
            let weight = weight as f32 * factor;
            let light = &vector[index];
            for c in 0..4 {
                sum[c] += light[c] * weight;
            }
        }
    }
    let [s0, s1, s2, s3] = sums;
    std::array::from_fn(|c| (s0[c] + s1[c]) + (s2[c] + s3[c]))
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
            is_signed: rows.format().signed.into(),
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
