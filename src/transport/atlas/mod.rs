//! Surfaces laid out flat: one square picture of texels for a whole scene (thesis 6.4, per-texel sampling).
//!
//! ```text
//! unwrap   texture coordinates that overlap nowhere: the file's own, or new ones
//! fill     texels -> points on surfaces
//! look_up  values at texels -> values at the points that a camera sees
//! ```

mod fill;
mod look_up;
mod unwrap;

pub use fill::texel_samples;
pub use look_up::{LookedUp, look_up};

use crate::device::Array;

#[derive(Clone, Debug)]
pub struct Atlas {
    /// Texels along a side.
    pub size: usize,
    /// Per triangle: where its corners lie, in [0, 1]², v downwards.
    pub uvs: Array<[[f32; 2]; 3]>,
    /// The coordinates are the file's own.
    pub from_file: bool,
}

impl Atlas {
    pub fn bytes(&self) -> u64 {
        24 * self.uvs.len() as u64
    }

    /// A place on a triangle, in texels.
    fn place(&self, triangle: usize, [u, v]: [f32; 2]) -> [f32; 2] {
        let [a, b, c] = self.uvs[triangle];
        let w = 1.0 - u - v;
        [0, 1].map(|i| (a[i] * w + b[i] * u + c[i] * v) * self.size as f32)
    }
}
