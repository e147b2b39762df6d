//! Averages over a complete binary tree whose leaves are M values in order, M a power of two: `p_i = (p_2i + p_2i+1) / 2`.
//!
//! The result is a heap of 2M elements: root (the mean of all) at 1, children of i at 2i and 2i + 1, leaves at M..2M;
//! element 0 is zero, so that a row of the basis `cut` may point at it for no light. Rows of (tree node, weight) pairs
//! multiply this vector (`sparse_product`).

use super::{power_of_two, vector_length};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use glam::Vec4;
use rayon::prelude::*;

/// Nodes that one task averages.
const BLOCK: usize = 4096;

uniform! {
    struct Params {
        level: u32,
        width: u32,
        leaves: u32,
        count: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "average_pyramid",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/average_pyramid.wgsl"),
    workgroup: [128, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[Binding::write::<[f32; 4]>("pyramid")],
};

/// The pyramids of `count` vectors of M leaves each: `count` heaps of 2M elements.
pub fn average_pyramid(device: &Device, leaves: &[[f32; 4]], count: usize) -> Result<Vec<[f32; 4]>> {
    let length = vector_length(KERNEL.name, leaves.len(), count)?;
    power_of_two(KERNEL.name, length)?;
    match device {
        Device::Cpu => Ok(cpu(leaves, length)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, leaves, length),
    }
}

fn cpu(leaves: &[[f32; 4]], length: usize) -> Vec<[f32; 4]> {
    let mut pyramids = vec![[0.0; 4]; 2 * leaves.len()];
    for (leaves, pyramid) in leaves.chunks_exact(length).zip(pyramids.chunks_exact_mut(2 * length)) {
        pyramid[length..].copy_from_slice(leaves);
        let mut level = length;
        while level > 1 {
            let (coarse, fine) = pyramid[level / 2..2 * level].split_at_mut(level / 2);
            coarse.par_chunks_mut(BLOCK).zip(fine.par_chunks(2 * BLOCK)).for_each(|(coarse, fine)| {
                for (node, pair) in coarse.iter_mut().zip(fine.as_chunks::<2>().0) {
                    *node = ((Vec4::from_array(pair[0]) + Vec4::from_array(pair[1])) * 0.5).to_array();
                }
            });
            level /= 2;
        }
    }
    pyramids
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, leaves: &[[f32; 4]], length: usize) -> Result<Vec<[f32; 4]>> {
    const WIDTH: usize = 256;
    let mut result = Vec::with_capacity(2 * leaves.len());
    for leaves in leaves.chunks(length * gpu.page(32 * length)) {
        let count = leaves.len() / length;
        let pyramid = gpu.storage::<[f32; 4]>(2 * leaves.len());
        for (tree, leaves) in leaves.chunks_exact(length).enumerate() {
            gpu.write(&pyramid, (2 * tree + 1) * length, leaves);
        }
        let mut batch = gpu.batch();
        let mut level = length;
        loop {
            let width = level.min(WIDTH);
            let ancestors = level / width;
            let params =
                Params { level: level as u32, width: width as u32, leaves: length as u32, count: count as u32 };
            batch.dispatch(&KERNEL, &params, &[&pyramid], ancestors * count)?;
            if ancestors == 1 {
                break;
            }
            level = ancestors;
        }
        let [page] = batch.read([&pyramid])?;
        result.extend_from_slice(page.get());
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_leaves_by_hand() {
        let leaves = [[1.0, 0.0, 8.0, -1.0], [3.0, 0.0, 0.0, -3.0], [5.0, 2.0, 0.0, 1.0], [7.0, 4.0, 0.0, 3.0]];
        let pyramid = average_pyramid(&Device::Cpu, &leaves, 1).unwrap();
        assert_eq!(pyramid[0], [0.0; 4]);
        assert_eq!(pyramid[1], [4.0, 1.5, 2.0, 0.0]);
        assert_eq!(pyramid[2..4], [[2.0, 0.0, 4.0, -2.0], [6.0, 3.0, 0.0, 2.0]]);
        assert_eq!(pyramid[4..], leaves);
        let single = average_pyramid(&Device::Cpu, &leaves, 4).unwrap();
        assert_eq!(single[2..4], [[0.0; 4], leaves[1]], "a tree of one leaf is zero and the leaf");
    }

    #[test]
    fn bad_lengths_are_refused() {
        assert!(average_pyramid(&Device::Cpu, &[[0.0; 4]; 3], 1).is_err());
        assert!(average_pyramid(&Device::Cpu, &[], 1).is_err());
    }
}
