//! The renderer from end to end: a coarse picture first, then refined until its error is as small as asked, then smooth at
//! edges.

use super::cache::Cache;
use super::crossing::Crossing;
use super::estimate::Estimate;
use super::film::Film;
use super::gatherer::Gatherer;
use super::incident::Incident;
use super::maps::Maps;
use super::reflections::Reflections;
use super::view::{Pass, Seen};
use crate::image::Layer;
use crate::progress::Progress;
use crate::{Result, memory};
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

/// Where light is gathered from, of one scene and one list of edits.
pub struct Light<'a> {
    pub incident: &'a Incident<'a>,
    pub crossing: &'a Crossing<'a>,
    pub irradiance: &'a Gatherer<'a>,
    /// `None` where nothing shines.
    pub reflections: Option<Reflections<'a>>,
}

impl<'a> Light<'a> {
    /// `gloss`: `Material::gloss` of each.
    pub fn new(irradiance: &'a Gatherer<'a>, seen: &Seen, gloss: &'a [[f32; 4]]) -> Self {
        let Gatherer { incident, crossing, .. } = *irradiance;
        let reflections = Reflections { incident, irradiance, crossing, eye: seen.camera.position, gloss };
        Self { incident, crossing, irradiance, reflections: seen.shines().then_some(reflections) }
    }
}

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
    light: &'a Light<'a>,
    settings: Settings,
    maps: Maps<'a>,
    /// One sample of each pixel, until its light is as good as asked.
    first: Option<Pass>,
    film: Film,
    phase: Phase,
    /// The object that most of the picture shows.
    shown: Option<u32>,
    start: Instant,
    /// Seconds that it took to see one sample of each pixel.
    first_pass: f64,
}

impl<'a> Renderer<'a> {
    /// # Errors
    /// Too little memory.
    pub fn new(light: &'a Light<'a>, seen: Seen<'a>, settings: Settings) -> Result<Self> {
        let (width, height) = seen.size;
        let pixels = u64::from(width) * u64::from(height);
        memory::require(Film::BYTES * pixels, &format!("{width} x {height} pixels"), "lower width or height")?;
        let film = Film::new(seen.camera, pixels as usize);
        Ok(Self {
            maps: Maps::new(light, seen.camera, height as usize, settings),
            first: None,
            film,
            phase: Phase::Start,
            shown: None,
            start: Instant::now(),
            first_pass: 0.0,
            light,
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
            Phase::Start => self.begin(progress)?,
            Phase::Refine => self.refine(progress)?,
            Phase::Smooth => self.smooth(progress)?,
            Phase::Done => {}
        }
        Ok(self.phase != Phase::Done)
    }

    /// The picture as it is now; `None` before the first.
    ///
    /// # Errors
    /// The device failed.
    pub fn layers(&self) -> Result<Option<Vec<Layer>>> {
        let Some(first) = &self.first else { return Ok((self.film.passes() > 0).then(|| self.film.layers())) };
        let mut film = Film::new(self.seen.camera, first.samples.points.len());
        self.seen.expose(&mut film, first, self.light.crossing, self.maps.radiance(first)?);
        Ok(Some(film.layers()))
    }

    /// The object that most of the picture shows, when the picture shows some and no light at all.
    pub fn is_dark(&self) -> Result<Option<u32>> {
        let layers = self.layers()?.unwrap_or_default();
        let Some(beauty) = layers.first() else { return Ok(None) };
        let is_lit = beauty.data.chunks_exact(4).any(|pixel| pixel[..3].iter().any(|x| *x != 0.0));
        Ok(self.shown.filter(|_| !is_lit))
    }

    /// Of what the picture shows, relative to its mean indirect radiance.
    pub fn estimate(&self) -> Estimate {
        self.maps.estimate
    }

    /// Of irradiance.
    pub fn cache(&self) -> &Cache {
        &self.maps.diffuse.cache
    }

    /// Of what shining surfaces reflect.
    pub fn glossy_cache(&self) -> Option<&Cache> {
        self.maps.glossy.as_ref().map(|glossy| &glossy.cache)
    }

    /// About how much of the work is done, in [0, 1], by the time that it took: refining takes time by the power 3/2 of
    /// the error's fall, each sample of a pixel what the first one took.
    pub fn done(&self) -> f64 {
        let spent = self.start.elapsed().as_secs_f64();
        let passes = f64::from(self.settings.samples_per_pixel) - self.passes() as f64;
        let fall = (self.maps.estimate.error().min(1.0) / f64::from(self.settings.tolerance)).max(1.0);
        let left = self.first_pass * passes + if self.first.is_some() { spent * (fall.powf(1.5) - 1.0) } else { 0.0 };
        spent / (spent + left).max(f64::MIN_POSITIVE)
    }

    /// Samples of a pixel so far.
    pub fn passes(&self) -> usize {
        self.film.passes().max(usize::from(self.first.is_some()))
    }

    fn begin(&mut self, progress: &Progress) -> Result<()> {
        let first = self.pass(0)?;
        self.shown = most_seen(&first);
        self.first_pass = self.start.elapsed().as_secs_f64();
        self.maps.start(&first, progress)?;
        self.first = Some(first);
        self.phase = Phase::Refine;
        Ok(())
    }

    /// Makes light better until it is as good as asked, or as can be.
    fn refine(&mut self, progress: &Progress) -> Result<()> {
        let Some(first) = &self.first else { return Ok(()) };
        if self.maps.improve(first, self.settings.tolerance.into(), progress)? {
            return Ok(());
        }
        let radiance = self.maps.radiance(first)?;
        self.seen.expose(&mut self.film, first, self.light.crossing, radiance);
        self.first = None;
        self.phase = if self.settings.samples_per_pixel > 1 { Phase::Smooth } else { Phase::Done };
        Ok(())
    }

    /// One more sample of each pixel.
    fn smooth(&mut self, progress: &Progress) -> Result<()> {
        let pass = self.pass(self.film.passes())?;
        let radiance = self.maps.fill(&pass, progress)?;
        self.seen.expose(&mut self.film, &pass, self.light.crossing, radiance);
        if self.film.passes() >= self.settings.samples_per_pixel as usize {
            self.phase = Phase::Done;
        }
        Ok(())
    }

    fn pass(&self, number: usize) -> Result<Pass> {
        self.seen.pass(self.light.incident, self.light.crossing, number)
    }
}

fn most_seen(pass: &Pass) -> Option<u32> {
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    pass.samples.points.iter().filter(|point| point.exists()).for_each(|p| *counts.entry(p.object).or_default() += 1);
    counts.into_iter().max_by_key(|(_, count)| *count).map(|(object, _)| object)
}
