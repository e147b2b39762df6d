//! A shadow as a picture of factors (thesis 6.7.1): light with the shadow over light without it, eq. 6.1.
//!
//! ```text
//! quotient   eq. 6.1: two pictures -> ratio; eq. 6.2: picture x ratio -> picture
//! frame      points of the picture, in heights; how pixels of one picture look into another
//! transform  translate, rotate, scale, four corners
//! lattice    control points, mean-value coordinates
//! blur       Gaussian, on the screen or along surfaces
//! grade      darkness, hue, saturation, brightness, tint, gradient
//! pattern    stripes, checks, dots and pictures cut out of a shadow
//! ```
//! All of them work on the shadow `1 - v`, so that where there is none, there is none afterwards, to the bit.

pub mod blur;
pub mod frame;
pub mod grade;
pub mod lattice;
pub mod pattern;
pub mod quotient;
pub mod transform;

use crate::device::Array;
use crate::image::ColourSpace;
use crate::{Error, Result};

#[derive(Clone, Debug, Default)]
pub struct Ratio {
    pub width: usize,
    pub height: usize,
    /// Row-major, RGB; the fourth element is 1 where the ratio is defined, 0 where there was no light to compare.
    pub values: Array<[f32; 4]>,
    /// Of the pictures that it was made of: factors of red are factors of that red.
    pub colour_space: ColourSpace,
}

impl Ratio {
    pub fn bytes(&self) -> u64 {
        16 * self.values.len() as u64
    }

    /// The same picture with other factors.
    pub fn with(&self, values: Vec<[f32; 4]>) -> Self {
        Self { values: values.into(), ..*self }
    }

    /// What to say where a picture of another colour space is multiplied by this.
    pub fn foreign(&self, picture: ColourSpace) -> Option<String> {
        let (own, other) = (self.colour_space.id(), picture.id());
        let message =
            format!("the ratio was made of pictures in {own}, this one is in {other}: a coloured shadow shifts");
        (own != other).then_some(message)
    }

    /// # Errors
    /// `Compute` with both sizes where `what` has another size than this ratio.
    pub fn check(&self, what: &str, width: usize, height: usize) -> Result<()> {
        if (self.width, self.height) == (width, height) {
            return Ok(());
        }
        let message =
            format!("sizes differ: the ratio has {} x {}, {what} {width} x {height} pixels", self.width, self.height);
        Err(Error::compute(message, "give both the same width and height"))
    }
}
