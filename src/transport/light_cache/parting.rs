//! How places of a cache are told apart: by the weights of the edits' receivers there, and by material.

use crate::scene::SurfacePoint;

/// A place that is asked about.
#[derive(Clone, Copy)]
pub struct Spot<'a> {
    pub point: &'a SurfacePoint,
    /// Weight of each receiver there.
    pub receivers: &'a [f32],
}

/// What tells places apart.
#[derive(Clone, Copy, Debug)]
pub struct Parting {
    /// Weights a place.
    pub count: usize,
    /// Another material has another lobe.
    pub by_material: bool,
}

impl Parting {
    /// Places of one kind do not part ways: a hash of the weights, and of the material (FNV-1a, words for bytes).
    pub fn kind(&self, material: u32, receivers: &[f32]) -> u32 {
        let mix = |hash: u32, word: u32| (hash ^ word).wrapping_mul(0x0100_0193);
        let of_material = if self.by_material { mix(0x811c_9dc5, material) } else { 0x811c_9dc5 };
        receivers.iter().fold(of_material, |hash, weight| mix(hash, weight.to_bits()))
    }

    /// A record `here` says nothing of a place `there`, of each of which material and weights are given: something acts on
    /// the second alone, whose part the first does not have; or too much is different at once.
    pub fn part_ways(&self, here: (u32, &[f32]), there: (u32, &[f32])) -> bool {
        if self.by_material && here.0 != there.0 {
            return true;
        }
        let (here, there) = (here.1, there.1);
        let untouched = here.iter().zip(there).any(|(here, there)| *here == 0.0 && *there != 0.0);
        let (mut sum, mut squares) = (0.0, 0.0);
        here.iter().zip(there).for_each(|(here, there)| {
            let apart = (here - there).abs();
            (sum, squares) = (sum + apart, squares + apart * apart);
        });
        // Derivatives by two receivers at once are not kept.
        untouched || sum * sum - squares > 0.1
    }
}
