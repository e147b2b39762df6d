//! The renderer from end to end: a coarse picture first, then refined until its error is as small as asked, then smooth at
//! edges.

use super::cache::Cache;
use super::crossing::Crossing;
use super::estimate::{Demand, Estimate};
use super::film::Film;
use super::gatherer::Gatherer;
use super::growth::{FEWEST, Growth, OVERLAP};
use super::incident::Incident;
use super::placement::View;
use super::view::{Pass, Seen};
use crate::image::Layer;
use crate::progress::Progress;
use crate::{Result, memory};
use glam::Vec4;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::time::Instant;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    pub samples_per_pixel: u32,
    /// Relative error of indirect light that is asked for.
    pub tolerance: f32,
    /// Most rays of a place.
    pub rays: u32,
    /// `a` of the cache when it starts.
    pub cache_error: f32,
}

/// Photons that are drawn from lamps: places choose runs of them.
const PHOTONS: usize = 1 << 16;
/// How much the cache's error is lowered at once.
const FINER: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// Of the squared error that new records found, what the picture had on average: they lie where it was largest.
const TYPICAL: f64 = 0.15;
/// What is left of it in the finer cache: interpolation errs with the square of the cache's error.
const LEFT: f64 = 0.25;

/// Noise of a record, over that of the picture, from which on eyes see it.
const LOCAL: f64 = 3.0;
/// Times that it is looked for in the end.
const EVENED: usize = 3;

/// Where the work stands.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Start,
    Refine,
    Smooth,
    Done,
}

pub struct Renderer<'a> {
    seen: Seen<'a>,
    growth: Growth<'a>,
    settings: Settings,
    cache: Cache<'a>,
    /// One sample of each pixel, until its light is as good as asked.
    first: Option<Pass>,
    film: Film,
    phase: Phase,
    /// Of the cache as it is.
    demand: Option<Demand>,
    /// Times that noise was evened out.
    evened: usize,
    /// More rays were asked for, and no place may have more.
    is_spent: bool,
    /// The object that most of the picture shows.
    shown: Option<u32>,
    start: Instant,
    /// Seconds that it took to see one sample of each pixel.
    first_pass: f64,
    pub estimate: Estimate,
}

impl<'a> Renderer<'a> {
    /// # Errors
    /// Too little memory.
    pub fn new(
        incident: &'a Incident<'a>,
        crossing: &'a Crossing<'a>,
        seen: Seen<'a>,
        settings: Settings,
    ) -> Result<Self> {
        let (width, height) = seen.size;
        let pixels = u64::from(width) * u64::from(height);
        memory::require(Film::BYTES * pixels, &format!("{width} x {height} pixels"), "lower width or height")?;
        let gatherer = Gatherer::new(incident, crossing, PHOTONS)?;
        Ok(Self {
            growth: Growth { gatherer, camera: seen.camera, height: height as usize },
            cache: Cache::new(settings.cache_error, 1.0, crossing),
            first: None,
            film: Film::new(seen.camera, pixels as usize),
            phase: Phase::Start,
            demand: None,
            evened: 0,
            is_spent: false,
            shown: None,
            start: Instant::now(),
            first_pass: 0.0,
            estimate: Estimate::default(),
            seen,
            settings,
        })
    }

    /// Does a part of the work; false when there is none left.
    ///
    /// # Errors
    /// `Cancelled`: `layers` still gives what there is.
    pub fn step(&mut self, progress: &Progress) -> Result<bool> {
        progress.check()?;
        match self.phase {
            Phase::Start => self.start(progress)?,
            Phase::Refine => self.refine(progress)?,
            Phase::Smooth => self.smooth(progress)?,
            Phase::Done => {}
        }
        Ok(self.phase != Phase::Done)
    }

    /// The picture as it is now; `None` before the first.
    pub fn layers(&self) -> Option<Vec<Layer>> {
        match &self.first {
            Some(first) => {
                let mut film = Film::new(self.seen.camera, first.samples.points.len());
                self.expose(&mut film, first);
                Some(film.layers())
            }
            None => (self.film.passes() > 0).then(|| self.film.layers()),
        }
    }

    /// The object that most of the picture shows, when the picture shows some and no light at all.
    pub fn is_dark(&self) -> Option<u32> {
        let layers = self.layers()?;
        let beauty = &layers.first()?.data;
        let is_lit = beauty.chunks_exact(4).any(|pixel| pixel[..3].iter().any(|x| *x != 0.0));
        self.shown.filter(|_| !is_lit)
    }

    pub fn cache(&self) -> &Cache<'a> {
        &self.cache
    }

    /// About how much of the work is done, in [0, 1], by the time that it took: refining takes time by the square of the
    /// error's fall, each sample of a pixel what the first one took.
    pub fn done(&self) -> f64 {
        let spent = self.start.elapsed().as_secs_f64();
        let passes = f64::from(self.settings.samples_per_pixel) - self.passes() as f64;
        let fall = (self.estimate.error().min(1.0) / f64::from(self.settings.tolerance)).max(1.0);
        let left = self.first_pass * passes + if self.first.is_some() { spent * (fall.powf(1.5) - 1.0) } else { 0.0 };
        spent / (spent + left).max(f64::MIN_POSITIVE)
    }

    /// Samples of a pixel so far.
    pub fn passes(&self) -> usize {
        self.film.passes().max(usize::from(self.first.is_some()))
    }

    fn start(&mut self, progress: &Progress) -> Result<()> {
        let first = self.pass(0)?;
        self.shown = most_seen(&first);
        self.first_pass = self.start.elapsed().as_secs_f64();
        let stage = progress.stage("a first picture", first.samples.points.len() as u64);
        self.growth.cover(&mut self.cache, None, view(&first), (2 * FEWEST, 1.0), &stage)?;
        // The first estimate of interpolation comes with the first finer cache.
        self.estimate.interpolation = f64::INFINITY;
        self.assess(&first);
        self.first = Some(first);
        self.phase = Phase::Refine;
        Ok(())
    }

    fn refine(&mut self, progress: &Progress) -> Result<()> {
        let Some(first) = self.first.take() else { return Ok(()) };
        // Where all places have their most rays, there is no more to be had.
        let is_spent = self.is_spent && self.estimate.noise >= self.estimate.interpolation;
        let is_good = is_spent || self.estimate.error() <= f64::from(self.settings.tolerance);
        if is_good && (self.evened >= EVENED || !self.even_out(&first, progress)?) {
            let mut film = std::mem::replace(&mut self.film, Film::new(self.seen.camera, 0));
            self.expose(&mut film, &first);
            self.film = film;
            self.phase = if self.settings.samples_per_pixel > 1 { Phase::Smooth } else { Phase::Done };
            return Ok(());
        }
        if is_good {
            self.assess(&first);
            self.first = Some(first);
            return Ok(());
        }
        let improved = match self.estimate.noise >= self.estimate.interpolation {
            true => self.more_rays(&first, progress),
            false => self.finer(&first, progress),
        };
        if improved.is_ok() {
            self.assess(&first);
        }
        self.first = Some(first);
        improved
    }

    /// Halves the noise, or makes it as small as it need be.
    fn more_rays(&mut self, first: &Pass, progress: &Progress) -> Result<()> {
        let demand = self.demand(first);
        let enough = (0.6 * f64::from(self.settings.tolerance) * demand.mean).powi(2);
        let local = LOCAL * f64::from(self.settings.tolerance).max(self.estimate.noise / 2.0);
        let wanted = demand.rays(&self.cache, (0.25 * demand.noise2).max(enough), local, self.settings.rays);
        self.is_spent = wanted.is_empty();
        self.add_rays(&wanted, progress)
    }

    /// More rays for records whose noise is seen, small as their part in the picture is; false when there are none.
    fn even_out(&mut self, first: &Pass, progress: &Progress) -> Result<bool> {
        self.evened += 1;
        let local = LOCAL * f64::from(self.settings.tolerance);
        let wanted = self.demand(first).rays(&self.cache, f64::INFINITY, local, self.settings.rays);
        self.add_rays(&wanted, progress)?;
        Ok(!wanted.is_empty())
    }

    fn demand(&mut self, first: &Pass) -> Demand {
        self.demand.take().unwrap_or_else(|| Demand::new(&self.cache, &view(first), &first.reflectance))
    }

    fn add_rays(&mut self, wanted: &[(usize, u32)], progress: &Progress) -> Result<()> {
        let stage = progress.stage("more rays", wanted.iter().map(|(_, rays)| u64::from(*rays)).sum());
        let done = self.growth.add_rays(&mut self.cache, wanted, &stage);
        self.cache.refresh();
        done
    }

    fn finer(&mut self, first: &Pass, progress: &Progress) -> Result<()> {
        let before = self.cache.clone();
        self.cache.tighten(before.error() * FINER, 1.0);
        self.cache.refresh();
        let rays: u64 = before.records.iter().map(|record| u64::from(record.rays)).sum();
        let stage = progress.stage("finer interpolation", rays);
        match self.growth.cover(&mut self.cache, Some(&before), view(first), (2 * FEWEST, OVERLAP), &stage) {
            Ok(told) => {
                self.is_spent &= told.added == 0;
                let off = (told.off / 3.0 / told.tested.max(1) as f64).max(0.0);
                let reflectance = mean_square(&first.reflectance);
                self.estimate.interpolation =
                    (off * reflectance * TYPICAL * LEFT).sqrt() / self.estimate.mean.max(f64::MIN_POSITIVE);
                Ok(())
            }
            Err(error) => {
                // With gaps it would be worth less than what was there.
                self.cache = before;
                Err(error)
            }
        }
    }

    /// One more sample of each pixel.
    fn smooth(&mut self, progress: &Progress) -> Result<()> {
        let pass = self.pass(self.film.passes())?;
        let stage = progress.stage("antialiasing", pass.samples.points.len() as u64);
        let before = self.cache.clone();
        let all: u64 = before.records.iter().map(|record| u64::from(record.rays)).sum();
        let rays = (all / before.records.len().max(1) as u64) as u32;
        self.growth.cover(&mut self.cache, Some(&before), view(&pass), (rays.max(2 * FEWEST), 1.0), &stage)?;
        let mut film = std::mem::replace(&mut self.film, Film::new(self.seen.camera, 0));
        self.expose(&mut film, &pass);
        self.film = film;
        if self.film.passes() >= self.settings.samples_per_pixel as usize {
            self.phase = Phase::Done;
        }
        Ok(())
    }

    fn assess(&mut self, first: &Pass) {
        let demand = Demand::new(&self.cache, &view(first), &first.reflectance);
        self.estimate.mean = demand.mean;
        self.estimate.noise = demand.noise2.sqrt() / demand.mean.max(f64::MIN_POSITIVE);
        self.demand = Some(demand);
    }

    /// Adds a pass to a film, in the light of the cache.
    fn expose(&self, film: &mut Film, pass: &Pass) {
        let view = view(pass);
        let light = |pixel| self.cache.look_up(&view.spot(pixel)).light.with_w(0.0).to_array();
        let pixels = (0..view.points.len()).into_par_iter().with_min_len(256);
        let irradiance: Vec<[f32; 4]> = pixels.map(light).collect();
        self.seen.expose(film, pass, self.growth.gatherer.crossing, &irradiance);
    }

    fn pass(&self, number: usize) -> Result<Pass> {
        self.seen.pass(self.growth.gatherer.incident, self.growth.gatherer.crossing, number)
    }
}

fn view(pass: &Pass) -> View<'_> {
    View {
        points: &pass.samples.points,
        receivers: &pass.receivers,
        width: pass.samples.width,
        height: pass.samples.height,
    }
}

/// Of diffuse reflection, radiance over irradiance, all channels.
fn mean_square(reflectance: &[[f32; 4]]) -> f64 {
    let squares = reflectance.iter().map(|r| f64::from(Vec4::from_array(*r).truncate().length_squared()));
    let all: f64 = squares.sum();
    all / 3.0 / reflectance.len().max(1) as f64 / std::f64::consts::PI.powi(2)
}

fn most_seen(pass: &Pass) -> Option<u32> {
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    pass.samples.points.iter().filter(|point| point.exists()).for_each(|p| *counts.entry(p.object).or_default() += 1);
    counts.into_iter().max_by_key(|(_, count)| *count).map(|(object, _)| object)
}
