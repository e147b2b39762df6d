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
    /// Places of one kind do not part ways: a hash of the weights (FNV-1a, words for bytes), and the material.
    pub fn kind(&self, spot: &Spot) -> u64 {
        let mix = |hash: u64, weight: &f32| (hash ^ u64::from(weight.to_bits())).wrapping_mul(0x0100_0000_01b3);
        let material = if self.by_material { spot.point.material } else { 0 };
        (spot.receivers.iter().fold(0xcbf2_9ce4_8422_2325, mix) << 32) ^ u64::from(material)
    }

    /// A record at `here` says nothing of a place `there`: something acts on the second alone, whose part the first does
    /// not have; or too much is different at once.
    pub fn part_ways(&self, here: &Spot, there: &Spot) -> bool {
        if self.by_material && here.point.material != there.point.material {
            return true;
        }
        let (here, there) = (here.receivers, there.receivers);
        if here == there {
            return false;
        }
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
