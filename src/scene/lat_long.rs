//! Environment maps as they come: latitude-longitude pictures, and how they become cubes without losing light.
//!
//! The centre of the picture faces +X, columns run towards +Z, the top row is +Y. How they are laid on a cube:
//! `lat_long_cube`.

use super::cube;
use super::{Environment, lat_long_cube};
use crate::{Error, Result};
use std::f64::consts::{PI, TAU};

/// Radiance over all directions, W / (sr m²), row-major, first row at the top.
#[derive(Clone, Debug)]
pub struct LatLong {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) radiance: Vec<[f32; 3]>,
}

impl LatLong {
    /// # Errors
    /// `Compute` for a picture that is not twice as wide as high, and for values that are negative or not finite.
    pub fn new(width: usize, height: usize, radiance: Vec<[f32; 3]>) -> Result<Self> {
        if height == 0 || width != 2 * height || radiance.len() != width * height {
            let message = format!("{width} x {height} pixels; a latitude-longitude map is twice as wide as high");
            return Err(Error::compute(message, "give the whole sphere, both poles included"));
        }
        let mut faults = Vec::new();
        type Is = fn(f32) -> bool;
        let negative: Is = |x| x < 0.0 && x.is_finite();
        let kinds: [(&str, Is); 3] = [("NaN", f32::is_nan), ("infinite", f32::is_infinite), ("negative", negative)];
        for (name, is) in kinds {
            let bad = |pixel: &[f32; 3]| pixel.iter().any(|x| is(*x));
            if let Some(first) = radiance.iter().position(bad) {
                let count = radiance.iter().filter(|pixel| bad(pixel)).count();
                faults.push(format!("{count} {name} (first: column {}, row {})", first % width, first / width));
            }
        }
        match faults.is_empty() {
            true => Ok(Self { width, height, radiance }),
            false => {
                let message = format!("of {} pixels, {}", radiance.len(), faults.join(", "));
                Err(Error::compute(message, "clamp the map to finite values from 0"))
            }
        }
    }

    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Sine of the elevation at the upper edge of a row.
    pub(super) fn edge(&self, row: usize) -> f64 {
        match row {
            0 => 1.0,
            row if row == self.height => -1.0,
            row => (PI * row as f64 / self.height as f64).cos(),
        }
    }

    /// Radiance times solid angle of all pixels; RGB, W/m².
    pub fn energy(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (row, pixels) in self.radiance.chunks(self.width).enumerate() {
            let solid_angle = (self.edge(row) - self.edge(row + 1)) * TAU / self.width as f64;
            for pixel in pixels {
                (0..3).for_each(|c| sum[c] += f64::from(pixel[c]) * solid_angle);
            }
        }
        sum
    }

    /// The map on a cube, turned right-handed about +Y by `rotation` (radians: a quarter takes what was at +Z to +X),
    /// its radiance multiplied by `gain`. Energy is that of the map for any size and rotation, to 1e-7.
    ///
    /// # Errors
    /// `Compute` for a size that cubes do not have, and when the gain makes radiance larger than f32 holds.
    pub fn cube(&self, size: usize, rotation: f64, gain: f64) -> Result<Environment> {
        cube::check_size(size)?;
        let face = size * size;
        let solid_angles: Vec<f64> = (0..face).map(|i| cube::solid_angle(i % size, i / size, size)).collect();
        let texels = lat_long_cube::energies(self, size, rotation).into_iter().enumerate().map(|(texel, energy)| {
            let scale = gain / solid_angles[texel % face];
            let [r, g, b] = energy.map(|energy| (energy * scale) as f32);
            [r, g, b, 0.0]
        });
        let texels: Vec<[f32; 4]> = texels.collect();
        if !texels.iter().flatten().all(|x| x.is_finite()) {
            let message = format!("radiance multiplied by {gain:.3e} is more than numbers hold (3.4e38)");
            return Err(Error::compute(message, "lower the exposure"));
        }
        Environment::new(size, texels)
    }
}
