//! Softens a shadow: a Gaussian blur of its ratios, on the screen or along the surfaces that it lies on.
//!
//! Passes of five taps whose distances double, along rows and columns by turns (à trous): 20 taps for each doubling of
//! the radius instead of hundreds. The kernel of a pass is that of the B-spline; the last one is narrowed so that the
//! variances add up to that of the Gaussian.

use super::Ratio;
use crate::device::{Array, Device};
use crate::kernels::ratio_blur::{Pass, ratio_blur};
use crate::transport::Samples;
use crate::transport::shadow::kinship::Kin;
use crate::{Error, Result};
use rayon::prelude::*;

/// How far each pixel lies on one surface with those 1, 2, 4, ... to its right and below: what a blur may not cross.
pub struct Links {
    pub width: usize,
    pub height: usize,
    /// Along rows, along columns; by power of two of the distance; a byte a pixel, 255 for one surface.
    axes: [Vec<Array<u32>>; 2],
}

impl Links {
    pub fn new(samples: &Samples) -> Self {
        let (width, height) = (samples.width, samples.height);
        let kin = Kin::of_pixels(samples);
        let axis = |length: usize, stride: usize, place: fn(usize, usize) -> usize| {
            let levels = (0..usize::BITS).map(|level| 1 << level).take_while(|distance| *distance < length);
            let level = |distance: usize| {
                let mut bytes = vec![0u8; (width * height).next_multiple_of(4)];
                bytes.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
                    for (x, byte) in row.iter_mut().enumerate() {
                        let i = y * width + x;
                        if i < width * height && place(x, y) + distance < length {
                            *byte = (255.0 * kin(i).with(&kin(i + distance * stride))).round() as u8;
                        }
                    }
                });
                Array::from(bytemuck::pod_collect_to_vec::<u8, u32>(&bytes))
            };
            levels.map(level).collect::<Vec<_>>()
        };
        let axes = [axis(width, 1, |x, _| x), axis(height, width, |_, y| y)];
        Self { width, height, axes }
    }

    pub fn bytes(&self) -> u64 {
        self.axes.iter().flatten().map(|level| 4 * level.len() as u64).sum()
    }
}

/// `deviation`: standard deviation in pixels, 0 or more. Edges of the picture extend; with links, a blur ends at the
/// edges of surfaces and of the picture. Linear in the ratio; constants stay to the bit; pixels without a ratio give
/// nothing to their neighbours.
///
/// # Errors
/// `Compute` for a radius that is negative or not finite, and for links of another size.
pub fn blur(device: &Device, ratio: &Ratio, deviation: f64, links: Option<&Links>) -> Result<Ratio> {
    if !(0.0..1e6).contains(&deviation) {
        return Err(Error::compute(format!("a radius of {deviation} pixels"), "give a radius of 0 or more"));
    }
    if let Some(links) = links {
        ratio.check("samples have", links.width, links.height)?;
    }
    let passes = passes(deviation, links);
    Ok(ratio.with(ratio_blur(device, &ratio.values, ratio.width, &passes)?))
}

fn passes(deviation: f64, links: Option<&Links>) -> Vec<Pass> {
    let mut passes = Vec::new();
    let mut left = deviation * deviation;
    for level in 0..20 {
        let step = 1usize << level;
        let whole = (step * step) as f64;
        let share = (left / whole).min(1.0);
        if share <= 0.0 {
            break;
        }
        left -= share * whole;
        // Two kernels (a, 1 - 2a, a), one after the other; their variances are 2a each, and 1/4 makes the B-spline.
        let a = 0.25 * share;
        let (near, far) = (2.0 * a * (1.0 - 2.0 * a), a * a);
        for (axis, vertical) in [false, true].into_iter().enumerate() {
            let links = match links {
                None => None,
                Some(links) => {
                    let levels = &links.axes[axis];
                    let Some(near) = levels.get(level) else { continue };
                    // Nothing is so far off: no link is looked at.
                    let far = levels.get(level + 1).unwrap_or(near);
                    Some([near.clone(), far.clone()])
                }
            };
            passes.push(Pass { vertical, step, near: near as f32, far: far as f32, links });
        }
    }
    passes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Ratio {
        let values = (0..width * height).map(|i| {
            let v = value(i % width, i / width);
            [v, v, v, 1.0]
        });
        Ratio { width, height, values: values.collect::<Vec<_>>().into() }
    }

    /// The answer to one dark pixel is a Gaussian, round, of that width, and weighs as much as the pixel.
    #[test]
    fn a_point_becomes_a_gaussian() {
        for deviation in [0.7, 1.0, 2.5, 4.0, 6.0, 9.0, 14.0] {
            let n = 128;
            let point = grey(n, n, |x, y| if (x, y) == (64, 64) { 0.0 } else { 1.0 });
            let blurred = blur(&Device::Cpu, &point, deviation, None).unwrap();
            let peak = 1.0 / (2.0 * std::f64::consts::PI * deviation * deviation);
            let (mut sum, mut worst) = (0.0, 0.0f64);
            for (i, value) in blurred.values.iter().enumerate() {
                let found = f64::from(1.0 - value[0]);
                let (x, y) = ((i % n) as f64 - 64.0, (i / n) as f64 - 64.0);
                let exact = peak * (-(x * x + y * y) / (2.0 * deviation * deviation)).exp();
                sum += found;
                worst = worst.max((found - exact).abs() / peak);
            }
            assert!((sum - 1.0).abs() < 2e-3, "{deviation}: {sum}");
            // Between one and two pixels there are too few taps to be round; an edge shows none of it.
            let limit = if deviation < 2.0 { 0.25 } else { 0.12 };
            assert!(worst < limit, "{deviation}: off by {worst} of the peak");
        }
    }

    /// What is seen of a blur: the edge of a shadow, against the integral of the Gaussian.
    #[test]
    fn an_edge_becomes_a_soft_edge() {
        for deviation in [0.7, 1.0, 1.6, 2.5, 4.0, 6.0, 9.0, 14.0, 20.0] {
            let edge = grey(256, 1, |x, _| if x < 128 { 0.0 } else { 1.0 });
            let blurred = blur(&Device::Cpu, &edge, deviation, None).unwrap();
            let mut exact = 0.0;
            let fine = 64;
            let mut worst = 0.0f64;
            // Cumulative sum of the Gaussian, from far left.
            for x in 0..256 * fine {
                let at = (x as f64 + 0.5) / fine as f64 - 128.0;
                exact += (-at * at / (2.0 * deviation * deviation)).exp()
                    / (deviation * (2.0 * std::f64::consts::PI).sqrt() * fine as f64);
                if x % fine == fine / 2 {
                    worst = worst.max((exact - f64::from(blurred.values[x / fine][0])).abs());
                }
            }
            assert!(worst < 0.035, "{deviation}: off by {worst}");
        }
    }

    #[test]
    fn constants_and_the_undefined_stay() {
        let flat = grey(37, 23, |_, _| 0.3);
        let blurred = blur(&Device::Cpu, &flat, 11.0, None).unwrap();
        assert_eq!(blurred.values[..], flat.values[..]);
        let mut values = flat.values.to_vec();
        values[400] = [1.0, 1.0, 1.0, 0.0];
        let holed = flat.with(values);
        assert_eq!(blur(&Device::Cpu, &holed, 11.0, None).unwrap().values[..], holed.values[..]);
        assert_eq!(blur(&Device::Cpu, &holed, 0.0, None).unwrap().values[..], holed.values[..]);
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(blur(&Device::Cpu, &holed, bad, None).is_err());
        }
        assert!(blur(&Device::Cpu, &flat.with(vec![]), 3.0, None).is_ok());
    }
}
