//! How far the picture may be from the truth, and where more rays would help most.

use super::cache::Cache;
use super::light_map::Seeing;
use glam::Vec4;
use rayon::prelude::*;

/// Errors of indirect radiance over a picture, relative to its mean; all channels together, root of the mean square.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Mean indirect radiance, W/(sr m²).
    pub mean: f64,
    /// Of the rays.
    pub noise: f64,
    /// Of interpolation between records.
    pub interpolation: f64,
}

impl Estimate {
    pub fn error(&self) -> f64 {
        self.noise.hypot(self.interpolation)
    }
}

/// What a picture asks of the records of a cache.
pub struct Demand {
    /// Of each record: how much the variance of its irradiance adds to the mean squared error of the picture's radiance.
    pub weights: Vec<f64>,
    /// Mean indirect radiance, and its mean squared error by noise.
    pub mean: f64,
    pub noise2: f64,
}

/// Parts that a picture is summed up in, whatever the number of threads.
const PARTS: usize = 16;
/// Pixels that are looked at, about.
const PIXELS: usize = 80_000;

struct Part {
    weights: Vec<f64>,
    sum: f64,
    pixels: usize,
}

impl Demand {
    /// Of a large picture, every so many pixels tell enough.
    pub fn new(cache: &Cache, seeing: &Seeing) -> Self {
        let view = &seeing.view;
        let step = (view.points.len() as f64 / PIXELS as f64).sqrt().ceil().max(1.0) as usize;
        let rows: Vec<usize> = (step / 2..view.height).step_by(step).collect();
        let part = rows.len().div_ceil(PARTS).max(1);
        let look = |rows: &[usize]| {
            let mut part = Part { weights: vec![0.0; cache.records.len()], sum: 0.0, pixels: 0 };
            let mut counted = Vec::new();
            for pixel in rows.iter().flat_map(|y| (step / 2..view.width).step_by(step).map(move |x| y * view.width + x))
            {
                part.pixels += 1;
                let spot = view.spot(pixel);
                if !spot.point.exists() {
                    continue;
                }
                let factor = Vec4::from_array(seeing.factor[pixel]).truncate();
                counted.clear();
                let found = cache.columns.look_up_with(&spot, |record, weight| counted.push((record, weight)));
                part.sum += f64::from((found.light.truncate() * factor).element_sum());
                // The variance is of all channels together, so the factor is of their mean.
                let share = f64::from(factor.length_squared()) / 3.0;
                counted.iter().for_each(|(record, weight)| {
                    part.weights[*record] += share * f64::from(weight / found.weight).powi(2);
                });
            }
            part
        };
        let parts: Vec<Part> = rows.par_chunks(part).map(look).collect();
        let pixels: usize = parts.iter().map(|part| part.pixels).sum();
        // Means over all channels.
        let channels = 3.0 * pixels.max(1) as f64;
        let mut weights = vec![0.0; cache.records.len()];
        for part in &parts {
            weights.iter_mut().zip(&part.weights).for_each(|(sum, part)| *sum += part / channels);
        }
        let mean = parts.iter().map(|part| part.sum).sum::<f64>() / channels;
        let noise2 =
            weights.iter().zip(&cache.records).map(|(weight, record)| weight * f64::from(record.variance)).sum();
        Self { weights, mean, noise2 }
    }

    /// Rays to add, by record, so that the noise falls to `noise2` with as few as can be; none has more than `most` in all.
    /// More rays go where variance is large and much of the picture looks (Neyman 1934); and so many everywhere that no
    /// record errs by more than `local` of its own light, which eyes see where it is dark.
    pub fn rays(&self, cache: &Cache, noise2: f64, local: f64, most: u32) -> Vec<(usize, u32)> {
        let variance = smooth_variance(cache);
        let rays: Vec<f64> = cache.records.iter().map(|record| f64::from(record.rays)).collect();
        let pull: Vec<f64> = (0..rays.len()).map(|i| (self.weights[i] * variance[i] * rays[i]).sqrt()).collect();
        let light = |i: usize| f64::from(cache.columns.light[i].value.truncate().length());
        let usual = DARK * (0..rays.len()).map(light).sum::<f64>() / rays.len().max(1) as f64;
        let least: Vec<f64> = (0..rays.len())
            .map(|i| {
                let allowed = (local * (light(i) + usual)).powi(2).max(f64::MIN_POSITIVE);
                rays[i] * (variance[i] / allowed).clamp(1.0, AT_ONCE)
            })
            .collect();
        let wanted =
            |scale: f64, i: usize| (scale * pull[i]).max(least[i]).clamp(rays[i], f64::from(most).max(rays[i]));
        let reached = |scale: f64| -> f64 {
            (0..rays.len()).map(|i| self.weights[i] * variance[i] * rays[i] / wanted(scale, i)).sum()
        };
        // Rising scales lower the noise until all records have their most.
        let (mut low, mut high) = (0.0f64, 1.0f64);
        while reached(high) > noise2 && (0..rays.len()).any(|i| wanted(high, i) < f64::from(most)) && high < 1e30 {
            (low, high) = (high, 4.0 * high);
        }
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if reached(middle) > noise2 { low = middle } else { high = middle }
        }
        let more = |i: usize| {
            let more = wanted(high, i) - rays[i];
            (more >= 0.25 * rays[i]).then_some((i, more as u32))
        };
        (0..rays.len()).filter_map(more).collect()
    }
}

/// Light up to this times the mean of all records is not told apart from none.
const DARK: f64 = 0.05;
/// Times as many rays as a record has that it may get at once for its own sake: its variance is a guess.
const AT_ONCE: f64 = 4.0;

/// The variances of records, each with its neighbours': one alone is a guess.
fn smooth_variance(cache: &Cache) -> Vec<f64> {
    let one = |record: usize| {
        let (mut total, mut sum) = (0.0, 0.0);
        let here = &cache.records[record];
        cache.columns.visit(&cache.spot(record), |other, weight, _| {
            // Itself it counts by far the most for.
            let weight = f64::from(weight.min(10.0 / cache.error()));
            total += weight;
            sum += weight * f64::from(cache.records[other].variance) * f64::from(cache.records[other].rays);
            true
        });
        if total > 0.0 { sum / total / f64::from(here.rays) } else { f64::from(here.variance) }
    };
    (0..cache.records.len()).into_par_iter().with_min_len(64).map(one).collect()
}
