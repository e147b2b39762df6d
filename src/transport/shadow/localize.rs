//! Which part of an environment a shadow belongs to (thesis 6.7.2):
//! `M_f = threshold(E_f / |P| sum over P of (1 - V_f))`.
//!
//! What the painted samples P miss is *blocked radiance* `B(w) = luminance(E(w)) mean of S(x, w)`, with `S` shadows above
//! the horizon only (`edits`). A threshold t keeps the brightest texels of B that together hold 1 - t of the blocked
//! energy (B times solid angle), so it means the same for any exposure, face size and peak. Texels of the level at which
//! that share is reached are kept in part: the lamp shrinks without jumps as t grows.
//!
//! Without a threshold, one is found: the level that parts the energy best into bright and dim (Otsu 1979, on the
//! logarithm of B). The lamp then is what is connected to texels above the level through texels that are blocked
//! anywhere and as bright, so that one that is partly seen is found whole; and its blurred rim.

use super::Lamp;
use super::regions::{regions, rings};
use crate::image::colour::luminance;
use crate::scene::Environment;
use crate::scene::cube::{self, FACES};
use crate::{Error, Result};
use glam::Vec3;

/// A lamp may lose this share of its excess over what is around it.
const LOST: f64 = 0.01;
/// Radians that the rim of a lamp is looked for in.
const RIM: f32 = 0.05;
/// Lamps that are named in a report, at most.
const NAMED: usize = 8;
/// Share of the energy that painted samples miss, below which a connected part of it is no lamp.
const LEAST: f64 = 0.01;
/// Share of the environment's light, below which what samples miss is hardly a shadow.
const FAINT: f64 = 0.001;
/// A texel that holds more than this share of a light is too large for it.
pub const COARSE: f64 = 0.2;

#[derive(Clone, Copy, Debug, Default)]
pub struct Settings<'a> {
    /// [0, 1]: share of the blocked energy that is left out, dimmest first. `None`: found by itself.
    pub threshold: Option<f32>,
    /// 0: all that is above the threshold; 1: its connected part that blocks most, 2: the next, ... Where the threshold
    /// is found, it is found anew for each lamp, in what those before it left: a dim lamp stands out only then.
    pub which: u32,
    /// All else instead.
    pub residual: bool,
    /// Light that was found before and is not looked for again.
    pub except: Option<&'a Lamp>,
    /// How many were painted; for messages.
    pub samples: usize,
}

/// A connected part of the blocked light.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Its middle, weighted by blocked energy.
    pub direction: Vec3,
    pub steradians: f64,
    /// Of the blocked energy.
    pub share: f64,
}

#[derive(Clone, Debug)]
pub struct Found {
    pub lamp: Lamp,
    /// Given, or that which would leave out as much as the level that was found.
    pub threshold: f32,
    /// Share of the environment's energy that the painted samples miss on average, of a sphere around them.
    pub missed: f64,
    /// Of what was found (before `residual`).
    pub texels: usize,
    pub steradians: f64,
    /// Of the environment's energy.
    pub share: f64,
    /// What is found with no threshold and `which` of 1, 2, ...
    pub lamps: Vec<Spot>,
    /// The texel of `lamp` that holds most of its energy, and the share; `None` when it has none.
    pub brightest: Option<(usize, f64)>,
    pub warnings: Vec<String>,
}

/// `blocked`: mean of S over the painted samples, [0, 1], 6 n n texels.
///
/// # Errors
/// `Compute` when nothing is blocked, the environment is black, there is no lamp of that number, or sizes differ.
pub fn localize(environment: &Environment, blocked: &[f32], settings: &Settings) -> Result<Found> {
    let mut field = Field::new(environment, blocked)?;
    let whole = field.whole();
    let missed = field.energy_of_all();
    if missed <= 0.0 {
        let count = settings.samples;
        let message =
            format!("the {count} painted samples are in no shadow: they miss 0 % of this environment's light");
        return Err(Error::compute(
            message,
            "paint inside of a shadow, and look whether the environment has light there",
        ));
    }
    if let Some(except) = settings.except {
        except.check(environment.size)?;
        field.blocked.iter_mut().zip(&except.weights).for_each(|(b, weight)| *b *= 1.0 - weight);
    }
    if field.energy_of_all() <= 0.0 {
        let message = "the painted samples miss no light beside that of `except`";
        return Err(Error::compute(message, "all lights of this shadow are found"));
    }
    let least = LEAST * missed;
    let lamps = field.lamps(least);
    let (weights, threshold) = match settings.threshold {
        Some(threshold) => (field.above(threshold.clamp(0.0, 1.0), settings.which)?, threshold),
        None => field.found(settings.which, least)?,
    };
    let lamp = Lamp { size: environment.size, weights: weights.into() };
    let mut warnings = Vec::new();
    if missed < FAINT * whole {
        let percent = 100.0 * missed / whole;
        let what = format!("the painted samples miss only {percent:.2} % of the environment's light");
        warnings.push(format!("{what}: paint where the shadow is dark"));
    }
    let texels = lamp.weights.iter().filter(|weight| **weight > 0.0).count();
    if texels == 0 {
        warnings.push(format!("the light is empty: a threshold of {threshold} leaves nothing; lower it"));
    }
    let energy = field.light_of(&lamp);
    let steradians = (0..field.solid.len()).map(|i| f64::from(lamp.weights[i] * field.solid[i])).sum();
    let lamp = if settings.residual { lamp.complement() } else { lamp };
    let brightest = field.brightest(&lamp);
    if let Some((texel, share)) = brightest.filter(|(_, share)| *share > COARSE) {
        warnings.push(coarse(texel, share, environment.size));
    }
    let share = energy / whole;
    Ok(Found { lamp, threshold, missed: missed / whole, texels, steradians, share, lamps, brightest, warnings })
}

/// Where a texel is, for people.
pub fn texel_name(texel: usize, size: usize) -> String {
    let face = cube::FACE_NAMES[texel / (size * size)];
    format!("face {face}, column {}, row {}", texel % size, texel / size % size)
}

fn coarse(texel: usize, share: f64, size: usize) -> String {
    let what = format!("one texel ({}) holds {:.0} % of the light's energy", texel_name(texel, size), 100.0 * share);
    let advice = match size < *cube::SIZES.end() {
        true => "its shadow has steps; raise face_size",
        false => "its shadow has steps, and face_size is at its largest: use a larger or softer lamp",
    };
    format!("{what}: {advice}")
}

/// What is known of each texel.
#[derive(Clone)]
struct Field {
    size: usize,
    luminance: Vec<f32>,
    /// Blocked radiance.
    blocked: Vec<f32>,
    solid: Vec<f32>,
}

impl Field {
    fn new(environment: &Environment, blocked: &[f32]) -> Result<Self> {
        let size = environment.size;
        if blocked.len() != FACES * size * size {
            let side = (blocked.len() as f64 / FACES as f64).sqrt();
            let message =
                format!("an environment of {size} x {size} texels a face, and a visibility of {side} x {side}");
            return Err(Error::compute(message, "give environment and visibility the same face_size"));
        }
        if let Some(texel) = blocked.iter().position(|s| !s.is_finite()) {
            let message = format!("the shadow at {} is {}", texel_name(texel, size), blocked[texel]);
            return Err(Error::compute(message, "this is a fault of the visibility; please report it"));
        }
        let luminance = |texel: &[f32; 4]| luminance(Vec3::new(texel[0], texel[1], texel[2]));
        let luminance: Vec<f32> = environment.radiance.iter().map(luminance).collect();
        if luminance.iter().all(|x| *x <= 0.0) {
            return Err(Error::compute("the environment is black", "give one with light, or raise its exposure"));
        }
        let blocked = blocked.iter().zip(&luminance).map(|(s, light)| s.clamp(0.0, 1.0) * light).collect();
        Ok(Self { size, luminance, blocked, solid: environment.radiance.iter().map(|texel| texel[3]).collect() })
    }

    fn energy(&self, texel: usize) -> f64 {
        f64::from(self.blocked[texel]) * f64::from(self.solid[texel])
    }

    fn light(&self, texel: usize) -> f64 {
        f64::from(self.luminance[texel]) * f64::from(self.solid[texel])
    }

    fn energy_of_all(&self) -> f64 {
        (0..self.blocked.len()).map(|texel| self.energy(texel)).sum()
    }

    fn whole(&self) -> f64 {
        (0..self.blocked.len()).map(|texel| self.light(texel)).sum()
    }

    fn light_of(&self, lamp: &Lamp) -> f64 {
        lamp.weights.iter().enumerate().map(|(texel, weight)| f64::from(*weight) * self.light(texel)).sum()
    }

    fn brightest(&self, lamp: &Lamp) -> Option<(usize, f64)> {
        let held = |texel: &usize| f64::from(lamp.weights[*texel]) * self.light(*texel);
        let texel = (0..lamp.weights.len()).max_by(|a, b| held(a).total_cmp(&held(b)).then(b.cmp(a)))?;
        Some((texel, held(&texel) / self.light_of(lamp))).filter(|(_, share)| share.is_finite())
    }

    /// Blocked texels, brightest first.
    fn sorted(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.blocked.len()).filter(|texel| self.blocked[*texel] > 0.0).collect();
        order.sort_unstable_by(|a, b| self.blocked[*b].total_cmp(&self.blocked[*a]).then(a.cmp(b)));
        order
    }

    /// Weights of the texels above a threshold, all or of one region of them.
    fn above(&self, threshold: f32, which: u32) -> Result<Vec<f32>> {
        let order = self.sorted();
        let total: f64 = order.iter().map(|texel| self.energy(*texel)).sum();
        let mut left = (1.0 - f64::from(threshold)) * total;
        let mut weights = vec![0.0; self.blocked.len()];
        for level in order.chunk_by(|a, b| self.blocked[*a] == self.blocked[*b]) {
            let energy: f64 = level.iter().map(|texel| self.energy(*texel)).sum();
            // A part of a texel that rounding alone leaves is none.
            let part = ((left + 1e-9 * total) / energy).min(1.0);
            if left <= 1e-9 * total {
                break;
            }
            level.iter().for_each(|texel| weights[*texel] = part as f32);
            left -= energy;
        }
        if which == 0 {
            return Ok(weights);
        }
        let parts = self.by_energy(regions(&weights.iter().map(|weight| *weight > 0.0).collect::<Vec<_>>(), self.size));
        let count = parts.len();
        let part = parts.into_iter().nth(which as usize - 1).ok_or_else(|| no_lamp(which, count))?;
        let mut one = vec![0.0; weights.len()];
        part.into_iter().for_each(|texel| one[texel] = weights[texel]);
        Ok(one)
    }

    /// Weights, and the threshold that cuts at the same level.
    fn found(&self, which: u32, least: f64) -> Result<(Vec<f32>, f32)> {
        let mut field = self.clone();
        let (mut texels, mut level) = (Vec::new(), 0.0);
        if which == 0 {
            level = self.level();
            texels = self.with_rim(self.bright(level).into_iter().flatten().collect());
        }
        for number in 1..=which {
            (texels, level) = field.take_lamp(least).ok_or_else(|| no_lamp(which, number as usize - 1))?;
        }
        let above = (0..self.blocked.len()).filter(|texel| self.blocked[*texel] >= level);
        let kept: f64 = above.map(|texel| self.energy(texel)).sum();
        let mut weights = vec![0.0; self.blocked.len()];
        texels.into_iter().for_each(|texel| weights[texel] = 1.0);
        Ok((weights, (1.0 - kept / self.energy_of_all()).max(0.0) as f32))
    }

    /// What there is to find, each lamp looked for in what those before it left.
    fn lamps(&self, least: f64) -> Vec<Spot> {
        let mut field = self.clone();
        let lamps = std::iter::from_fn(|| field.take_lamp(least)).take(NAMED);
        let spot = |(lamp, _): (Vec<usize>, f32)| {
            let towards = |texel: usize| cube::texel_point(texel, self.size).normalize() * self.energy(texel) as f32;
            let direction = lamp.iter().map(|texel| towards(*texel)).sum::<Vec3>().normalize_or_zero();
            let steradians = lamp.iter().map(|texel| f64::from(self.solid[*texel])).sum();
            let energy: f64 = lamp.iter().map(|texel| self.energy(*texel)).sum();
            Spot { direction, steradians, share: energy / self.energy_of_all() }
        };
        lamps.map(spot).collect()
    }

    /// Finds the next lamp, with its level, and puts it out. What blocks less than `least` is put out on the way.
    fn take_lamp(&mut self, least: f64) -> Option<(Vec<usize>, f32)> {
        loop {
            let level = self.level();
            let regions = self.by_energy(self.bright(level));
            let strongest = self.with_rim(regions.first()?.clone());
            let counts = strongest.iter().map(|texel| self.energy(*texel)).sum::<f64>() >= least;
            if counts {
                strongest.iter().for_each(|texel| self.blocked[*texel] = 0.0);
                return Some((strongest, level));
            }
            regions.into_iter().flatten().for_each(|texel| self.blocked[texel] = 0.0);
        }
    }

    /// Regions, that which blocks most first.
    fn by_energy(&self, mut regions: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
        let energy = |region: &Vec<usize>| region.iter().map(|texel| self.energy(*texel)).sum::<f64>();
        regions.sort_by(|a, b| energy(b).total_cmp(&energy(a)));
        regions
    }

    /// Regions that are blocked and as bright as a level, and somewhere blocked as much as that.
    fn bright(&self, level: f32) -> Vec<Vec<usize>> {
        let inside: Vec<bool> =
            self.blocked.iter().zip(&self.luminance).map(|(b, light)| *b > 0.0 && *light >= level).collect();
        let mut regions = regions(&inside, self.size);
        regions.retain(|region| region.iter().any(|texel| self.blocked[*texel] >= level));
        regions
    }

    /// The level of blocked radiance with the largest variance between what is above and what is below: of the
    /// logarithm, weighted by energy. 0 where all is one.
    fn level(&self) -> f32 {
        const PER_STOP: f32 = 16.0;
        const BINS: usize = 40 * PER_STOP as usize;
        let peak = self.blocked.iter().copied().fold(0.0, f32::max).log2();
        let bin = |b: f32| (((peak - b.log2()) * PER_STOP) as usize).min(BINS - 1);
        let mut histogram = vec![0.0; BINS];
        for texel in (0..self.blocked.len()).filter(|texel| self.blocked[*texel] > 0.0) {
            histogram[bin(self.blocked[texel])] += self.energy(texel);
        }
        let total: f64 = histogram.iter().sum();
        let moment: f64 = histogram.iter().enumerate().map(|(i, energy)| i as f64 * energy).sum();
        let (mut energy, mut sum, mut best) = (0.0, 0.0, (0.0, None));
        for (i, part) in histogram.iter().enumerate() {
            (energy, sum) = (energy + part, sum + i as f64 * part);
            let rest = total - energy;
            if energy <= 1e-12 * total || rest <= 1e-12 * total {
                continue;
            }
            let variance = energy * rest * ((moment - sum) / rest - sum / energy).powi(2);
            if variance > best.0 * (1.0 + 1e-12) {
                best = (variance, Some(i));
            }
        }
        best.1.map_or(0.0, |i| (peak - (i + 1) as f32 / PER_STOP).exp2())
    }

    /// A lamp with the texels around it that it falls off over, as many rings as hold all but `LOST` of its excess over
    /// what is around it. Never uphill: there another lamp begins.
    fn with_rim(&self, core: Vec<usize>) -> Vec<usize> {
        let reach = ((RIM * self.size as f32 * 0.5).ceil() as usize).max(1);
        let mut outer: Vec<f32> = rings(&core, reach + 1, self.size, |_, _| true)
            .pop()
            .map(|ring| ring.into_iter().map(|texel| self.luminance[texel]).collect())
            .unwrap_or_default();
        outer.sort_unstable_by(f32::total_cmp);
        let around = outer.get(outer.len() / 2).copied().unwrap_or(0.0);
        let falls = |from: usize, to: usize| {
            let light = self.luminance[to];
            self.blocked[to] > 0.0 && light > around && light <= self.luminance[from]
        };
        let rim = rings(&core, reach, self.size, falls);
        let excess = |texels: &[usize]| {
            let over = |texel: &usize| f64::from((self.luminance[*texel] - around).max(0.0) * self.solid[*texel]);
            texels.iter().map(over).sum::<f64>()
        };
        let mut held = excess(&core);
        let all = held + rim.iter().map(|ring| excess(ring)).sum::<f64>();
        let mut lamp = core;
        for ring in rim {
            if held >= (1.0 - LOST) * all {
                break;
            }
            held += excess(&ring);
            lamp.extend(ring);
        }
        lamp
    }
}

fn no_lamp(which: u32, count: usize) -> Error {
    let lamps = if count == 1 { "one light is".to_owned() } else { format!("{count} lights are") };
    Error::compute(format!("there is no light number {which}: {lamps} blocked"), "lower `which`, or the threshold")
}

#[cfg(test)]
mod tests;
