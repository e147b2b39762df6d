//! Softens a shadow: a Gaussian blur of its ratios, on the screen or along the surfaces that it lies on.
//!
//! Four sweeps of exponentials along rows and as many along columns (`kernels::ratio_blur`), whose variances add up to
//! that of the Gaussian: as dear for a wide blur as for a narrow one, and without seams where a surface ends.

use super::Ratio;
use crate::device::{Array, Device};
use crate::kernels::ratio_blur::{SWEEPS, ratio_blur};
use crate::transport::Samples;
use crate::transport::shadow::kinship::Kin;
use crate::{Error, Result};
use glam::Vec4;
use rayon::prelude::*;

/// How far each pixel lies on one surface with its neighbours: what a blur may not cross.
pub struct Links {
    pub width: usize,
    pub height: usize,
    /// Of each pixel and the next in its row, row by row; and in its column, column by column. A byte each, 255 for one
    /// surface.
    axes: [Array<u32>; 2],
}

impl Links {
    pub fn new(samples: &Samples) -> Self {
        let (width, height) = (samples.width, samples.height);
        let kin = Kin::of_pixels(samples);
        // `length` pixels a line; pixels and lines are so many pixels apart.
        let axis = |length: usize, stride: usize, line_stride: usize| {
            let mut bytes = vec![0u8; (width * height).next_multiple_of(4)];
            bytes[..width * height].par_chunks_mut(length.max(1)).enumerate().for_each(|(line, bytes)| {
                let pixel = |i: usize| kin(line * line_stride + i * stride);
                let mut before = pixel(0);
                for i in 1..length {
                    let next = pixel(i);
                    bytes[i - 1] = (255.0 * before.with(&next)).round() as u8;
                    before = next;
                }
            });
            Array::from(bytemuck::pod_collect_to_vec::<u8, u32>(&bytes))
        };
        Self { width, height, axes: [axis(width, 1, width), axis(height, width, 1)] }
    }

    pub fn bytes(&self) -> u64 {
        self.axes.iter().map(|links| 4 * links.len() as u64).sum()
    }
}

/// `deviation`: standard deviation in pixels, 0 or more. Edges of the picture extend; with links, those of surfaces do,
/// too. Linear in the ratio; constants stay (to the bit where all pixels have a ratio); pixels without one neither give
/// nor take, and what is next to them is weighted anew.
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
    let links = links.map(|links| links.axes.each_ref());
    // Of the shadow, which fades out to 0, times the weight.
    let shadow = |value: &[f32; 4]| (1.0 - Vec4::from_array(*value)).with_w(1.0);
    let weighted = |value: &[f32; 4]| (shadow(value) * value[3]).to_array();
    let before: Vec<[f32; 4]> = ratio.values.par_iter().with_min_len(4096).map(weighted).collect();
    let mut values = ratio_blur(device, &before, ratio.width, share(deviation), links)?;
    values.par_iter_mut().zip(&ratio.values[..]).with_min_len(4096).for_each(|(soft, value)| {
        let sum = Vec4::from_array(*soft);
        *soft = *value;
        if value[3] > 0.0 && sum.w > 1e-12 {
            // As a change of what was there, so that what does not change stays to the bit.
            let changed = Vec4::from_array(*value) + (shadow(value) - sum / sum.w);
            *soft = changed.with_w(value[3]).to_array();
        }
    });
    Ok(ratio.with(values))
}

/// The exponential whose variance, so many times, is that of the Gaussian: `2 a / (1 - a)^2 = variance`.
fn share(deviation: f64) -> f32 {
    let variance = deviation * deviation / (SWEEPS.len() / 2) as f64;
    if variance < 1e-12 {
        return 0.0;
    }
    ((variance + 1.0 - (2.0 * variance + 1.0).sqrt()) / variance).min(1.0 - 1e-6) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Ratio {
        let values = (0..width * height).map(|i| {
            let v = value(i % width, i / width);
            [v, v, v, 1.0]
        });
        Ratio { width, height, values: values.collect::<Vec<_>>().into(), ..Ratio::default() }
    }

    /// The answer to one dark pixel is a Gaussian, round, of that width, and weighs as much as the pixel.
    #[test]
    fn a_point_becomes_a_gaussian() {
        for deviation in [0.7, 1.0, 2.5, 4.0, 6.0, 9.0] {
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
            // Four exponentials have a sharper peak than a Gaussian, most of all where there are few pixels.
            assert!(worst < if deviation < 2.0 { 0.6 } else { 0.35 }, "{deviation}: off by {worst} of the peak");
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
            let limit = [(1.5, 0.08), (3.0, 0.035)].into_iter().find(|(below, _)| deviation < *below);
            assert!(worst < limit.map_or(0.025, |(_, limit)| limit), "{deviation}: off by {worst}");
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
        let after = blur(&Device::Cpu, &holed, 11.0, None).unwrap();
        assert_eq!(after.values[400], holed.values[400]);
        assert!(after.values.iter().enumerate().all(|(i, v)| i == 400 || (v[0] - 0.3).abs() < 1e-6));
        assert_eq!(blur(&Device::Cpu, &holed, 0.0, None).unwrap().values[..], holed.values[..]);
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(blur(&Device::Cpu, &holed, bad, None).is_err());
        }
        assert!(blur(&Device::Cpu, &flat.with(vec![]), 3.0, None).is_ok());
    }
}
