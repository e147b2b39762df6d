//! Light from far away, by direction: radiance on the texels of a cube.

use crate::device::Array;
use crate::scene::cube::{self, FACES};
use crate::{Error, Result};

#[derive(Clone, Debug)]
pub struct Environment {
    /// Texels along a side of each face.
    pub size: usize,
    /// 6 n n texels in the order of `cube`: radiance in W / (sr m²), and the texel's solid angle in sr.
    pub radiance: Array<[f32; 4]>,
}

impl Environment {
    /// `radiance`: RGB of 6 n n texels; the fourth element is filled in.
    ///
    /// # Errors
    /// `Compute` for a wrong size or count, and for radiance that is negative or not finite.
    pub fn new(size: usize, mut radiance: Vec<[f32; 4]>) -> Result<Self> {
        cube::check_size(size)?;
        let texels = FACES * size * size;
        if radiance.len() != texels {
            let message = format!("an environment of {} texels; expected 6 x {size} x {size}", radiance.len());
            return Err(Error::compute(message, "this is a fault of the node that made it; please report it"));
        }
        let bad = radiance.iter().filter(|texel| !texel[..3].iter().all(|x| *x >= 0.0 && x.is_finite())).count();
        if bad > 0 {
            let message = format!("radiance of {bad} of {texels} texels is negative or no number");
            return Err(Error::compute(message, "repair the environment map: clamp it to finite values from 0"));
        }
        let angles = cube::solid_angles(size);
        radiance.iter_mut().zip(angles.iter().cycle()).for_each(|(texel, angle)| texel[3] = *angle);
        Ok(Self { size, radiance: radiance.into() })
    }

    pub fn bytes(&self) -> u64 {
        16 * self.radiance.len() as u64
    }

    /// Radiance times solid angle, summed over a range of texels; RGB, W/m².
    pub fn energy(&self, texels: std::ops::Range<usize>) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for texel in &self.radiance[texels] {
            (0..3).for_each(|c| sum[c] += f64::from(texel[c]) * f64::from(texel[3]));
        }
        sum
    }

    /// Whether any light comes from a texel.
    pub fn is_lit(&self, texel: usize) -> bool {
        self.radiance[texel][..3].iter().any(|radiance| *radiance > 0.0)
    }

    /// Which faces carry any light.
    pub fn lit_faces(&self) -> [bool; FACES] {
        let face = self.size * self.size;
        std::array::from_fn(|f| self.energy(f * face..(f + 1) * face).iter().any(|energy| *energy > 0.0))
    }
}
