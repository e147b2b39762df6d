//! Orthonormal 1D Haar encoding of vectors whose length N is a power of two (thesis 2.6.2, and 4.6 on the GPU).
//!
//! One level takes pairs: `s_i = (a_2i + a_2i+1) / sqrt 2`, `d_i = (a_2i - a_2i+1) / sqrt 2`; the next level encodes
//! the `s`. Order of the result (figure 4.5): the mean times sqrt N, then the details from coarse to fine; the details
//! of a level with n pairs lie at n..2n.
//!
//! The GPU body is Algorithm 7: the vector as a matrix, every level of every row at once, then the first column. It
//! writes each detail where figure 4.6 maps it: row r of R keeps the n details of a level at `R n + r n`. The matrix is
//! 256 wide (a row fits in workgroup memory) or N, so it need not be square; a column longer than 256 is encoded in the
//! same way once more. The CPU body goes level by level over the whole vector; every coefficient comes from the same
//! operations in the same order in both.

use super::{power_of_two, vector_length};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use glam::Vec4;
use rayon::prelude::*;

/// Pairs that one task encodes.
const BLOCK: usize = 4096;

const INV_SQRT_2: f32 = std::f32::consts::FRAC_1_SQRT_2;

uniform! {
    struct Params {
        rows: u32,
        width: u32,
        length: u32,
        count: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "haar_encode",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/haar_encode.wgsl"),
    workgroup: [128, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<[f32; 4]>("values"),
        Binding::write::<[f32; 4]>("averages"),
        Binding::write::<[f32; 4]>("coefficients"),
    ],
};

/// Encodes `count` vectors of N elements each, N a power of two; the result has the same shape.
pub fn haar_encode(device: &Device, values: &[[f32; 4]], count: usize) -> Result<Vec<[f32; 4]>> {
    let length = vector_length(KERNEL.name, values.len(), count)?;
    power_of_two(KERNEL.name, length)?;
    match device {
        Device::Cpu => Ok(cpu(values, length)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, values, length),
    }
}

fn cpu(values: &[[f32; 4]], length: usize) -> Vec<[f32; 4]> {
    let mut coefficients = vec![[0.0; 4]; values.len()];
    let mut averages = vec![[0.0; 4]; length];
    for (vector, coefficients) in values.chunks_exact(length).zip(coefficients.chunks_exact_mut(length)) {
        // The averages of all levels together are shorter than the vector: each level takes its part of the scratch.
        let (mut fine, mut scratch) = (vector, averages.as_mut_slice());
        while fine.len() > 1 {
            let half = fine.len() / 2;
            let (coarse, rest) = scratch.split_at_mut(half);
            encode_level(fine, coarse, &mut coefficients[half..2 * half]);
            (fine, scratch) = (coarse, rest);
        }
        coefficients[0] = fine[0];
    }
    coefficients
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, values: &[[f32; 4]], length: usize) -> Result<Vec<[f32; 4]>> {
    const WIDTH: usize = 256;
    let mut result = Vec::with_capacity(values.len());
    for values in values.chunks(length * gpu.page(16 * length)) {
        let count = values.len() / length;
        let coefficients = gpu.storage::<[f32; 4]>(values.len());
        let mut batch = gpu.batch();
        let (mut fine, mut left) = (gpu.upload(values), length);
        loop {
            let width = left.min(WIDTH);
            let rows = left / width;
            let averages = gpu.storage::<[f32; 4]>(rows * count);
            let params = Params { rows: rows as u32, width: width as u32, length: length as u32, count: count as u32 };
            batch.dispatch(&KERNEL, &params, &[&fine, &averages, &coefficients], rows * count)?;
            if rows == 1 {
                break;
            }
            // The first column: the averages of the rows.
            (fine, left) = (averages, rows);
        }
        let [page] = batch.read([&coefficients])?;
        result.extend_from_slice(page.get());
    }
    Ok(result)
}

fn encode_level(fine: &[[f32; 4]], averages: &mut [[f32; 4]], details: &mut [[f32; 4]]) {
    let tasks = fine.par_chunks(2 * BLOCK).zip(averages.par_chunks_mut(BLOCK)).zip(details.par_chunks_mut(BLOCK));
    tasks.for_each(|((fine, averages), details)| {
        for ((pair, average), detail) in fine.as_chunks::<2>().0.iter().zip(averages).zip(details) {
            let (a, b) = (Vec4::from_array(pair[0]), Vec4::from_array(pair[1]));
            *average = ((a + b) * INV_SQRT_2).to_array();
            *detail = ((a - b) * INV_SQRT_2).to_array();
        }
    });
}

/// The inverse of `haar_encode` for one vector, on the CPU: for tests, and for edits sampled in the wavelet basis.
pub fn haar_decode(coefficients: &[[f32; 4]]) -> Result<Vec<[f32; 4]>> {
    power_of_two("haar_decode", coefficients.len())?;
    let mut values = coefficients.to_vec();
    let mut coarse = values.clone();
    let mut half = 1;
    while half < values.len() {
        coarse[..half].copy_from_slice(&values[..half]);
        for (i, (average, detail)) in coarse[..half].iter().zip(&coefficients[half..2 * half]).enumerate() {
            let (average, detail) = (Vec4::from_array(*average), Vec4::from_array(*detail));
            values[2 * i] = ((average + detail) * INV_SQRT_2).to_array();
            values[2 * i + 1] = ((average - detail) * INV_SQRT_2).to_array();
        }
        half *= 2;
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Figure 4.5, symbolically: each coefficient is a vector of the signs of a_1..a_16, unnormalised; the sixteen
    /// symbols are pushed through the encoder four at a time, as the lanes of a value.
    #[test]
    fn sixteen_elements_as_in_figure_4_5() {
        // (first, middle, end): a_first..middle - a_middle..end, and the number of levels that it went through.
        let expected: [(usize, usize, usize, i32); 16] = [
            (0, 16, 16, 4), // a_1..16
            (0, 8, 16, 4),  // a_1..8 - a_9..16
            (0, 4, 8, 3),
            (8, 12, 16, 3),
            (0, 2, 4, 2), // a_1..2 - a_3..4
            (4, 6, 8, 2),
            (8, 10, 12, 2),
            (12, 14, 16, 2),
            (0, 1, 2, 1), // a_1 - a_2
            (2, 3, 4, 1),
            (4, 5, 6, 1),
            (6, 7, 8, 1),
            (8, 9, 10, 1),
            (10, 11, 12, 1),
            (12, 13, 14, 1),
            (14, 15, 16, 1),
        ];
        for four in 0..4 {
            let mut symbols = [[0.0; 4]; 16];
            (0..4).for_each(|lane| symbols[4 * four + lane][lane] = 1.0);
            let encoded = haar_encode(&Device::Cpu, &symbols, 1).unwrap();
            for (coefficient, &(first, middle, end, levels)) in encoded.iter().zip(&expected) {
                for (lane, found) in coefficient.iter().enumerate() {
                    let symbol = 4 * four + lane;
                    let sign = match symbol {
                        s if (first..middle).contains(&s) => 1.0,
                        s if (middle..end).contains(&s) => -1.0,
                        _ => 0.0,
                    };
                    let found = found * 2.0f32.sqrt().powi(levels);
                    assert!((found - sign).abs() < 1e-6, "a_{} in {first}..{middle}..{end}: {found}", symbol + 1);
                }
            }
        }
    }

    #[test]
    fn decoding_gives_the_vector_back_and_energy_is_kept() {
        for length in [1usize, 2, 8, 512, 16_384] {
            let values: Vec<[f32; 4]> = (0..length).map(|i| [i as f32, (i * i % 97) as f32, -1.0, 0.5]).collect();
            let encoded = haar_encode(&Device::Cpu, &values, 1).unwrap();
            let energy = |v: &[[f32; 4]]| v.iter().flatten().map(|x| (*x as f64).powi(2)).sum::<f64>();
            assert!((energy(&encoded) / energy(&values) - 1.0).abs() < 1e-5, "{length}");
            for (a, b) in haar_decode(&encoded).unwrap().iter().flatten().zip(values.iter().flatten()) {
                assert!((a - b).abs() <= 1e-5 * length as f32, "{length}: {a} {b}");
            }
        }
    }

    #[test]
    fn lengths_that_are_no_power_of_two_are_refused() {
        assert!(haar_encode(&Device::Cpu, &[[0.0; 4]; 6], 2).is_err());
        assert!(haar_encode(&Device::Cpu, &[[0.0; 4]; 5], 2).is_err());
        assert!(haar_encode(&Device::Cpu, &[], 1).is_err());
        assert!(haar_encode(&Device::Cpu, &[[0.0; 4]; 4], 0).is_err());
    }
}
