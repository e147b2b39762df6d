//! A change seen in a preview, applied to a renderer's plate (thesis 6.7.4, eq. 6.2, made whole where light is scarce).
//!
//! With the plate's light p, the preview's before and after b and a, channel by channel:
//!
//! ```text
//! p' = p + g (a - b),   g = (p b + e^2) / (b^2 + e^2),   0 <= g <= limit
//! e^2 = (dark mean(b))^2 + (lift max(a - b, 0))^2
//! ```
//! Where the preview has light (b >> e) this is the ratio `p a / b`; where it is dark the difference `p + a - b`; in
//! between it goes smoothly from one to the other. Dark is what is dark in the preview (`dark`), and what is dark beside
//! what is added (`lift`): where a deep shadow is lifted, a ratio multiplies whatever plate and preview disagree on, and
//! shadow edges that they draw half a pixel apart flare up. `limit` bounds what is left of that.

use crate::image::components::{Component, colour_at};
use crate::image::{Image, Layer, colour};
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Pixels that one task works on; sums run over whole blocks in order.
const BLOCK: usize = 4096;
/// Pixels that the gain is measured at, at most.
const MEASURED: usize = 1 << 16;

#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Light below this share of the preview's mean is dark.
    pub dark: f32,
    /// Light below this share of what the change adds is dark, too.
    pub lift: f32,
    /// How many times a difference may grow.
    pub limit: f32,
    /// Factor that brings the preview to the plate's exposure; measured when absent.
    pub gain: Option<f32>,
}

/// What was met on the way. Pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Met {
    /// Preview times this has the plate's exposure.
    pub gain: f32,
    pub changed: usize,
    /// Changed, and so dark in the preview that the difference decides.
    pub by_difference: usize,
    /// Changed, and kept from changing more.
    pub limited: usize,
    /// NaN or infinity in the plate or in the preview: left as they are.
    pub not_finite: usize,
}

/// One light of a picture as radiance.
pub struct Radiance<'a> {
    layer: &'a Layer,
    rgb: [usize; 3],
    colour: Option<(&'a Layer, [usize; 3])>,
}

impl<'a> Radiance<'a> {
    /// # Errors
    /// `Compute` for layers without red, green and blue.
    pub fn of(image: &'a Image, component: Component) -> Result<Self> {
        let layer = &image.layers[component.layer];
        let colour =
            component.colour.map(|at| &image.layers[at]).map(|layer| Ok::<_, Error>((layer, layer.need_rgb()?)));
        Ok(Self { layer, rgb: layer.need_rgb()?, colour: colour.transpose()? })
    }

    /// The beauty, or any layer that is radiance itself.
    ///
    /// # Errors
    /// As `of`.
    pub fn whole(layer: &'a Layer) -> Result<Self> {
        Ok(Self { layer, rgb: layer.need_rgb()?, colour: None })
    }

    fn colour(&self, pixel: usize) -> Vec3 {
        self.colour.map_or(Vec3::ONE, |(layer, rgb)| colour_at(layer, rgb, pixel))
    }

    fn at(&self, pixel: usize) -> Vec3 {
        colour_at(self.layer, self.rgb, pixel) * self.colour(pixel)
    }

    fn pixels(&self) -> usize {
        self.layer.data.len() / self.layer.channels.len()
    }
}

/// The plate's layer with the change from `before` to `after`. All have as many pixels.
pub fn apply(plate: &Radiance, before: &Radiance, after: &Radiance, settings: Settings) -> (Layer, Met) {
    let gain = settings.gain.unwrap_or_else(|| measure(plate, before));
    let dark = f64::from(settings.dark) * f64::from(gain) * mean(before);
    let epsilon = (dark * dark).max(f64::from(f32::MIN_POSITIVE));
    let stride = plate.layer.channels.len();
    let mut data = plate.layer.data.to_vec();
    let tasks = data.par_chunks_mut(stride * BLOCK).enumerate().map(|(block, pixels)| {
        let mut met = Met::default();
        for (i, pixel) in pixels.chunks_exact_mut(stride).enumerate() {
            let at = block * BLOCK + i;
            let (p, b, a) = (plate.at(at), before.at(at), after.at(at));
            let surface = plate.colour(at);
            if !(p.is_finite() && b.is_finite() && a.is_finite() && surface.is_finite()) {
                met.not_finite += 1;
                continue;
            }
            let (mut changed, mut by_difference, mut limited) = (false, false, false);
            for (c, &channel) in plate.rgb.iter().enumerate() {
                if a[c] == b[c] || surface[c] <= 0.0 {
                    continue;
                }
                let [p, b, a] = [f64::from(p[c]), f64::from(b[c] * gain), f64::from(a[c] * gain)];
                let added = (a - b).max(0.0) * f64::from(settings.lift);
                let epsilon = epsilon + added * added;
                let growth = (p * b + epsilon) / (b * b + epsilon);
                let new = p + (a - b) * growth.clamp(0.0, settings.limit.into());
                // Light does not fall below none; what was below it before stays.
                pixel[channel] = (new.max(p.min(0.0)) / f64::from(surface[c])).min(f32::MAX.into()) as f32;
                changed = true;
                by_difference |= b * b < epsilon;
                limited |= growth > f64::from(settings.limit);
            }
            met.changed += usize::from(changed);
            met.by_difference += usize::from(by_difference);
            met.limited += usize::from(limited);
        }
        met
    });
    let met = tasks.reduce(Met::default, |x, y| Met {
        gain,
        changed: x.changed + y.changed,
        by_difference: x.by_difference + y.by_difference,
        limited: x.limited + y.limited,
        not_finite: x.not_finite + y.not_finite,
    });
    (plate.layer.with_data(data), Met { gain, ..met })
}

/// Mean of all channels of all pixels, without what is not finite.
fn mean(light: &Radiance) -> f64 {
    let blocks: Vec<(DVec3, usize)> = (0..light.pixels().div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let pixels = block * BLOCK..light.pixels().min((block + 1) * BLOCK);
            let finite = pixels.map(|pixel| light.at(pixel)).filter(|colour| colour.is_finite());
            finite.fold((DVec3::ZERO, 0), |(sum, n), colour| (sum + colour.abs().as_dvec3(), n + 1))
        })
        .collect();
    let (sum, count) = blocks.iter().fold((DVec3::ZERO, 0), |(sum, n), block| (sum + block.0, n + block.1));
    sum.element_sum() / (3 * count.max(1)) as f64
}

/// How many times as bright as the preview the plate is: the median over pixels that are lit in both; 1 without any.
fn measure(plate: &Radiance, before: &Radiance) -> f32 {
    let least = 0.1 * mean(before) as f32;
    let step = plate.pixels().div_ceil(MEASURED).max(1);
    let quotients = (0..plate.pixels()).into_par_iter().step_by(step).filter_map(|pixel| {
        let [p, b] = [plate, before].map(|light| colour::luminance(light.at(pixel)));
        (b > least && p > 0.0 && p.is_finite() && b.is_finite()).then(|| p / b)
    });
    let mut quotients: Vec<f32> = quotients.collect();
    if quotients.is_empty() {
        return 1.0;
    }
    let middle = quotients.len() / 2;
    *quotients.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// The beauty with what a light of it changed by: `beauty + (after - before) colour`. Where the light did not change, no
/// bit of it does.
///
/// # Errors
/// `Compute` for layers without red, green and blue.
pub fn carry(beauty: &Layer, before: &Layer, after: &Layer, colour: Option<&Layer>) -> Result<Layer> {
    let (own, other) = (beauty.need_rgb()?, before.need_rgb()?);
    let colour = colour.map(|layer| Ok::<_, Error>((layer, layer.need_rgb()?))).transpose()?;
    let (stride, step) = (beauty.channels.len(), before.channels.len());
    let mut data = beauty.data.to_vec();
    data.par_chunks_mut(stride * BLOCK).enumerate().for_each(|(block, pixels)| {
        for (i, pixel) in pixels.chunks_exact_mut(stride).enumerate() {
            let at = block * BLOCK + i;
            let surface = colour.map_or(Vec3::ONE, |(layer, rgb)| colour_at(layer, rgb, at));
            for (c, (own, other)) in own.iter().zip(other).enumerate() {
                let (old, new) = (before.data[at * step + other], after.data[at * step + other]);
                if old != new && old.is_finite() && pixel[*own].is_finite() {
                    let sum = pixel[*own] - old * surface[c] + new * surface[c];
                    pixel[*own] = sum.clamp(-f32::MAX, f32::MAX);
                }
            }
        }
    });
    Ok(beauty.with_data(data))
}

#[cfg(test)]
mod tests;
