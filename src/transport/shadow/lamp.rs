//! The part of an environment that is found responsible for a shadow (thesis 6.7.2), or any other part of it.

use crate::device::Array;
use crate::scene::cube::FACES;
use crate::{Error, Result};

#[derive(Clone, Debug)]
pub struct Lamp {
    /// Texels along a side of each face.
    pub size: usize,
    /// How much of each of the 6 n n texels belongs to it, [0, 1].
    pub weights: Array<f32>,
}

impl Lamp {
    pub fn bytes(&self) -> u64 {
        4 * self.weights.len() as u64
    }

    /// # Errors
    /// `Compute` when the lamp was found in an environment of another size.
    pub fn check(&self, size: usize) -> Result<()> {
        if self.size == size && self.weights.len() == FACES * size * size {
            return Ok(());
        }
        let message = format!("a light of {0} x {0} texels a face, and a visibility of {size} x {size}", self.size);
        Err(Error::compute(message, "give environment and visibility the same face_size"))
    }

    /// All that it is not.
    pub fn complement(&self) -> Self {
        let weights: Vec<f32> = self.weights.iter().map(|weight| 1.0 - weight).collect();
        Self { size: self.size, weights: weights.into() }
    }
}
