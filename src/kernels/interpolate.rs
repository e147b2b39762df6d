//! Light at many samples from a few computed rows: `out[k][n] = sum_{j<4} weights[n][j] * rows[k][indices[n][j]]`.
//!
//! Rows vary slowly over surfaces, so they are computed where the picture needs them and interpolated to every sample.
//! An unused slot has weight 0 and its row is not looked at, so it may hold any index below the number of rows. Sums
//! run over j = 0..4 in order.

use super::vector_length;
#[cfg(feature = "gpu")]
use super::{pages, put_columns};
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::{Error, Result};
use glam::Vec4;
use rayon::prelude::*;

/// Samples that one task interpolates.
const BLOCK: usize = 2048;

uniform! {
    struct Params {
        samples: u32,
        rows: u32,
        count: u32,
        pad0: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "interpolate",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/interpolate.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<[u32; 4]>("indices"),
        Binding::read::<[f32; 4]>("weights"),
        Binding::read::<[f32; 4]>("rows"),
        Binding::write::<[f32; 4]>("samples"),
    ],
};

/// Interpolates `count` vectors of equal length to N samples: `indices` and `weights` have N elements, the result is
/// `count` vectors of N. `Error::Compute` when an index is not below the length of the vectors.
pub fn interpolate(
    device: &Device,
    indices: &Array<[u32; 4]>,
    weights: &Array<[f32; 4]>,
    rows: &[[f32; 4]],
    count: usize,
) -> Result<Vec<[f32; 4]>> {
    let length = vector_length(KERNEL.name, rows.len(), count)?;
    if indices.len() != weights.len() {
        return Err(Error::compute(
            format!("interpolate: {} index rows but {} weight rows", indices.len(), weights.len()),
            "the transfer is damaged: clear the cache",
        ));
    }
    let largest = indices.par_iter().map(|four| four[0].max(four[1]).max(four[2]).max(four[3])).max();
    if let Some(index) = largest.filter(|&index| index as usize >= length) {
        return Err(Error::compute(
            format!("interpolate: index {index}, but there are {length} rows"),
            "the transfer is damaged: clear the cache",
        ));
    }
    match device {
        Device::Cpu => Ok(cpu(indices, weights, rows, length)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, indices, weights, rows, count),
    }
}

fn cpu(indices: &[[u32; 4]], weights: &[[f32; 4]], rows: &[[f32; 4]], length: usize) -> Vec<[f32; 4]> {
    let samples = indices.len();
    let mut out = vec![[0.0; 4]; rows.len() / length.max(1) * samples];
    for (rows, out) in rows.chunks_exact(length.max(1)).zip(out.chunks_exact_mut(samples.max(1))) {
        let tasks = out.par_chunks_mut(BLOCK).zip(indices.par_chunks(BLOCK)).zip(weights.par_chunks(BLOCK));
        tasks.for_each(|((out, indices), weights)| {
            for ((out, indices), weights) in out.iter_mut().zip(indices).zip(weights) {
                let mut sum = Vec4::ZERO;
                for j in 0..4 {
                    if weights[j] != 0.0 {
                        sum += Vec4::from_array(rows[indices[j] as usize]) * weights[j];
                    }
                }
                *out = sum.to_array();
            }
        });
    }
    out
}

#[cfg(feature = "gpu")]
fn gpu(
    gpu: &Gpu,
    indices: &Array<[u32; 4]>,
    weights: &Array<[f32; 4]>,
    rows: &[[f32; 4]],
    count: usize,
) -> Result<Vec<[f32; 4]>> {
    let samples = indices.len();
    let mut out = vec![[0.0; 4]; count * samples];
    let light = gpu.upload(rows);
    for range in pages(samples, gpu.page(16 * count)) {
        let part = gpu.storage::<[f32; 4]>(count * range.len());
        let params =
            Params { samples: range.len() as u32, rows: (rows.len() / count) as u32, count: count as u32, pad0: 0 };
        let mut batch = gpu.batch();
        let buffers = [&gpu.array(indices, range.clone()), &gpu.array(weights, range.clone()), &light, &part];
        batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(64))?;
        let [page] = batch.read([&part])?;
        put_columns(&mut out, samples, range, page.get());
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_vectors_by_hand() {
        let indices = Array::from(vec![[0, 1, 2, 0], [2, 0, 0, 0]]);
        let weights = Array::from(vec![[0.5, 0.25, 0.25, 0.0], [1.0, 0.0, 0.0, 0.0]]);
        let rows = [
            [4.0, 0.0, 1.0, 0.0],
            [8.0, 1.0, 1.0, 0.0],
            [0.0, 3.0, 1.0, 1.0],
            [1.0, 1.0, 1.0, 1.0],
            [f32::NAN, 0.0, 0.0, 0.0],
            [2.0, 2.0, 2.0, 2.0],
        ];
        let out = interpolate(&Device::Cpu, &indices, &weights, &rows, 2).unwrap();
        assert_eq!(out[..2], [[4.0, 1.0, 1.0, 0.25], [0.0, 3.0, 1.0, 1.0]]);
        assert!(out[2][0].is_nan(), "a weighted NaN shows");
        assert_eq!(out[3], [2.0; 4], "a NaN of weight 0 does not");
    }

    #[test]
    fn bad_indices_are_refused() {
        let weights = Array::from(vec![[1.0, 0.0, 0.0, 0.0]]);
        let run = |index: u32, weights: &Array<[f32; 4]>| {
            interpolate(&Device::Cpu, &Array::from(vec![[0, 0, index, 0]]), weights, &[[0.0; 4]; 4], 2)
        };
        assert!(run(1, &weights).is_ok());
        assert!(run(2, &weights).is_err());
        assert!(run(0, &Array::default()).is_err());
    }
}
