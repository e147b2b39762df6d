//! Points of a picture, and how the pixels of one ratio look into another.
//!
//! Points are measured in heights of the picture: (0, 0) is its upper left corner, x goes right to the aspect, y down
//! to 1; pixels are square, so circles stay circles. For pictures of texels, (1, 1) may stand for the lower right
//! corner instead (`Units::uv`): texture coordinates, v down as in glTF.

use super::Ratio;
use crate::Result;
use crate::device::Device;
use crate::kernels::ratio_warp::{Place, ratio_warp};
use glam::{DMat2, DVec2};
use rayon::prelude::*;

/// Pixels a unit, across and down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units(pub DVec2);

impl Units {
    pub fn heights(ratio: &Ratio) -> Self {
        Self(DVec2::splat(ratio.height as f64))
    }

    pub fn uv(ratio: &Ratio) -> Self {
        Self(DVec2::new(ratio.width as f64, ratio.height as f64))
    }

    /// The lower right corner of the picture.
    pub fn size(self, ratio: &Ratio) -> DVec2 {
        DVec2::new(ratio.width as f64, ratio.height as f64) / self.0
    }

    /// The middle of a pixel.
    pub fn of_pixel(self, x: usize, y: usize) -> DVec2 {
        DVec2::new(x as f64 + 0.5, y as f64 + 0.5) / self.0
    }
}

/// Where a pixel looks: a point of the source, and how it moves as the pixel moves (columns: right, down), in units.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    pub at: DVec2,
    pub change: DMat2,
}

/// The finest step between look-ups, in pixels: what rounding moves by less does not move.
const GRID: f64 = 4096.0;
const NO_FRACTION: f64 = 1.5 * (1u64 << 52) as f64;

/// The look-up of one pixel; `None`: there is no shadow there.
pub fn place(units: Units, look: Option<Look>) -> Place {
    let Some(look) = look else { return Place::NOWHERE };
    // Rounded as adding a number does that leaves no room for a fraction: no call of the library.
    let at = (((look.at * units.0 - 0.5) * GRID) + NO_FRACTION - NO_FRACTION) / GRID;
    let furthest = 0.5 * f64::from(Place::FURTHEST);
    if !at.is_finite() || at.abs().max_element() >= furthest {
        return Place::NOWHERE;
    }
    // Units of the source for units of the target are pixels for pixels.
    let columns = [look.change.x_axis * units.0 / units.0.x, look.change.y_axis * units.0 / units.0.y];
    let mut place = Place { at: at.as_vec2().to_array(), counts: [1; 2], sides: [[0.0; 2]; 2] };
    for (k, column) in columns.into_iter().enumerate() {
        // Between pixels the look-up blurs by about a pixel: what that is short of the area, it is spread by. So
        // nothing is blurred that is not made smaller, and nothing jumps where it begins to be.
        let square = column.length_squared();
        if square > 1.01 {
            let spread = (square - 1.01).sqrt().min(furthest);
            let side = column / square.sqrt() * spread;
            if side.is_finite() {
                place.counts[k] = ((spread + 0.5).ceil() as u32).min(Place::MOST);
                place.sides[k] = side.as_vec2().to_array();
            }
        }
    }
    place
}

/// Rows of pixels that one task looks up: what it needs stays in the processor's cache.
const ROWS: usize = 16;

/// The ratio with each pixel looked up elsewhere: `fill` sets the places of the rows from a first one on.
///
/// # Errors
/// What the device meets.
pub fn warp(device: &Device, ratio: &Ratio, fill: impl Fn(usize, &mut [Place]) + Sync) -> Result<Ratio> {
    let (values, width) = (&ratio.values, ratio.width.max(1));
    let mut warped = vec![[0.0; 4]; ratio.width * ratio.height];
    match device {
        Device::Cpu => warped.par_chunks_mut(ROWS * width).enumerate().try_for_each_init(
            || vec![Place::NOWHERE; ROWS * width],
            |places, (block, warped)| {
                let places = &mut places[..warped.len()];
                fill(block * ROWS, places);
                ratio_warp(device, values, ratio.width, places, warped)
            },
        )?,
        #[cfg(feature = "gpu")]
        Device::Gpu(_) => {
            let mut places = vec![Place::NOWHERE; warped.len()];
            let blocks = places.par_chunks_mut(ROWS * width).enumerate();
            blocks.for_each(|(block, places)| fill(block * ROWS, places));
            ratio_warp(device, values, ratio.width, &places, &mut warped)?;
        }
    }
    Ok(ratio.with(warped))
}
