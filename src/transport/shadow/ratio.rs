//! A shadow as a picture of factors (thesis 6.7.1): light with the shadow over light without it, eq. 6.1.

use crate::device::Array;

#[derive(Clone, Debug)]
pub struct Ratio {
    pub width: usize,
    pub height: usize,
    /// Row-major, RGB; the fourth element is 1 where the ratio is defined, 0 where there was no light to compare.
    pub values: Array<[f32; 4]>,
}

impl Ratio {
    pub fn bytes(&self) -> u64 {
        16 * self.values.len() as u64
    }
}
