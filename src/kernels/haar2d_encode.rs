//! Orthonormal 2D Haar encoding of square pictures by non-standard decomposition (thesis 6.5, Algorithms 15 and 16).
//!
//! One level takes squares of four: `a b` above `c d` gives the average `(a + b + c + d) / 2` and the details
//! `(a - b + c - d) / 2`, `(a + b - c - d) / 2`, `(a - b - c + d) / 2`; the next level encodes the averages. Place of the
//! results: the h x h averages of a level fill the corner at (0, 0) of the square of side 2 h that they come from; the
//! details lie right of, below and across from them. Sums are `(a + b) + (c + d)` and alike, halved last: the algorithm's
//! pass over rows and pass over columns at once, without their square roots.

use super::{power_of_two, vector_length};
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::{Error, Result};
use glam::Vec4;
use rayon::prelude::*;

uniform! {
    struct Params {
        half: u32,
        side: u32,
        count: u32,
        pad0: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "haar2d_encode",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/haar2d_encode.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<[f32; 4]>("fine"),
        Binding::write::<[f32; 4]>("averages"),
        Binding::write::<[f32; 4]>("coefficients"),
    ],
};

/// Encodes `count` pictures of `side` x `side` elements, `side` a power of two; the result has the same shape.
pub fn haar2d_encode(device: &Device, values: &[[f32; 4]], side: usize, count: usize) -> Result<Vec<[f32; 4]>> {
    let length = vector_length(KERNEL.name, values.len(), count)?;
    power_of_two(KERNEL.name, side)?;
    if length != side * side {
        let message = format!("haar2d_encode: pictures of {length} elements, not {side} x {side}");
        return Err(Error::compute(message, "this is a fault of the node that called the kernel; please report it"));
    }
    match device {
        Device::Cpu => Ok(cpu(values, side)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, values, side),
    }
}

fn cpu(values: &[[f32; 4]], side: usize) -> Vec<[f32; 4]> {
    let mut coefficients = vec![[0.0; 4]; values.len()];
    let pictures = values.par_chunks_exact(side * side).zip(coefficients.par_chunks_exact_mut(side * side));
    pictures.for_each(|(picture, coefficients)| {
        let mut fine: Vec<Vec4> = picture.iter().map(|value| Vec4::from_array(*value)).collect();
        let mut half = side / 2;
        while half > 0 {
            for y in 0..half {
                for x in 0..half {
                    let at = 4 * y * half + 2 * x;
                    let (a, b, c, d) = (fine[at], fine[at + 1], fine[at + 2 * half], fine[at + 2 * half + 1]);
                    // Behind the squares that are still to be read.
                    fine[y * half + x] = ((a + b) + (c + d)) * 0.5;
                    coefficients[y * side + x + half] = (((a - b) + (c - d)) * 0.5).to_array();
                    coefficients[(y + half) * side + x] = (((a + b) - (c + d)) * 0.5).to_array();
                    coefficients[(y + half) * side + x + half] = (((a - b) - (c - d)) * 0.5).to_array();
                }
            }
            half /= 2;
        }
        coefficients[0] = fine[0].to_array();
    });
    coefficients
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, values: &[[f32; 4]], side: usize) -> Result<Vec<[f32; 4]>> {
    let length = side * side;
    let mut result = Vec::with_capacity(values.len());
    for values in values.chunks(length * gpu.page(16 * length)) {
        if side == 1 {
            result.extend_from_slice(values);
            continue;
        }
        let count = values.len() / length;
        let coefficients = gpu.storage::<[f32; 4]>(values.len());
        let mut batch = gpu.batch();
        let (mut fine, mut half) = (gpu.upload(values), side / 2);
        while half > 0 {
            let averages = gpu.storage::<[f32; 4]>(half * half * count);
            let params = Params { half: half as u32, side: side as u32, count: count as u32, pad0: 0 };
            let squares = half * half * count;
            batch.dispatch(&KERNEL, &params, &[&fine, &averages, &coefficients], squares.div_ceil(64))?;
            (fine, half) = (averages, half / 2);
        }
        let [page] = batch.read([&coefficients])?;
        result.extend_from_slice(page.get());
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Algorithm 15 as it is written: passes over rows, then over columns, of the averages so far.
    fn algorithm_15(values: &mut [f64], side: usize) {
        let mut n = side;
        let pass = |values: &mut [f64], at: &dyn Fn(usize) -> usize, n: usize| {
            let line: Vec<f64> = (0..n).map(|i| values[at(i)]).collect();
            for i in 0..n / 2 {
                values[at(i)] = (line[2 * i] + line[2 * i + 1]) / 2f64.sqrt();
                values[at(i + n / 2)] = (line[2 * i] - line[2 * i + 1]) / 2f64.sqrt();
            }
        };
        while n > 1 {
            (0..n).for_each(|y| pass(values, &|i| y * side + i, n));
            (0..n).for_each(|x| pass(values, &|i| i * side + x, n));
            n /= 2;
        }
    }

    #[test]
    fn equals_the_passes_over_rows_and_columns() {
        for side in [1usize, 2, 8, 64] {
            let values: Vec<[f32; 4]> = (0..2 * side * side)
                .map(|i| [(i * i % 97) as f32, -1.0, (i % 7) as f32, 0.25 * (i % 3) as f32])
                .collect();
            let encoded = haar2d_encode(&Device::Cpu, &values, side, 2).unwrap();
            for (values, encoded) in values.chunks(side * side).zip(encoded.chunks(side * side)) {
                for c in 0..4 {
                    let mut expected: Vec<f64> = values.iter().map(|value| f64::from(value[c])).collect();
                    algorithm_15(&mut expected, side);
                    for (found, expected) in encoded.iter().zip(expected) {
                        assert!((f64::from(found[c]) - expected).abs() < 1e-3, "{side}: {} {expected}", found[c]);
                    }
                }
            }
        }
    }

    #[test]
    fn other_shapes_are_refused() {
        assert!(haar2d_encode(&Device::Cpu, &[[0.0; 4]; 36], 6, 1).is_err());
        assert!(haar2d_encode(&Device::Cpu, &[[0.0; 4]; 32], 4, 1).is_err());
        assert!(haar2d_encode(&Device::Cpu, &[[0.0; 4]; 32], 4, 2).is_ok());
    }
}
