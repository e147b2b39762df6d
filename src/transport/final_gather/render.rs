//! The renderer from end to end: a coarse picture first, then refined until its error is as small as asked, then smooth at
//! edges.

use super::cache::Cache;
use super::crossing::Crossing;
use super::estimate::Estimate;
use super::film::Film;
use super::gatherer::Gatherer;
use super::growth::Growth;
use super::incident::Incident;
use super::light_map::{LightMap, Seeing};
use super::placement::View;
use super::reflections::Reflections;
use super::view::{Pass, Seen};
use crate::image::Layer;
use crate::progress::Progress;
use crate::scene::SurfacePoint;
use crate::transport::light_cache::Parting;
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

/// Where light is gathered from, of one scene and one list of edits.
pub struct Light<'a> {
    pub incident: &'a Incident<'a>,
    pub crossing: &'a Crossing<'a>,
    pub irradiance: Gatherer<'a>,
    /// `None` where nothing shines.
    pub reflections: Option<Reflections<'a>>,
}

/// Photons that are drawn from lamps: places choose runs of them.
const PHOTONS: usize = 1 << 16;

impl<'a> Light<'a> {
    /// `gloss`: `Material::gloss` of each.
    pub fn new(
        incident: &'a Incident<'a>,
        crossing: &'a Crossing<'a>,
        seen: &Seen,
        gloss: &'a [[f32; 4]],
    ) -> Result<Self> {
        let eye = seen.camera.position;
        let reflections = Reflections { incident, crossing, eye, gloss };
        Ok(Self {
            incident,
            crossing,
            irradiance: Gatherer::new(incident, crossing, PHOTONS)?,
            reflections: Reflections::are_there(gloss).then_some(reflections),
        })
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

/// A pass, and what of it shines.
struct First {
    pass: Pass,
    shining: Vec<SurfacePoint>,
}

pub struct Renderer<'a> {
    seen: Seen<'a>,
    light: &'a Light<'a>,
    settings: Settings,
    diffuse: LightMap<'a>,
    glossy: Option<LightMap<'a>>,
    /// One sample of each pixel, until its light is as good as asked.
    first: Option<First>,
    film: Film,
    phase: Phase,
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
    pub fn new(light: &'a Light<'a>, seen: Seen<'a>, settings: Settings) -> Result<Self> {
        let (width, height) = seen.size;
        let pixels = u64::from(width) * u64::from(height);
        memory::require(Film::BYTES * pixels, &format!("{width} x {height} pixels"), "lower width or height")?;
        let (camera, height, error) = (seen.camera, height as usize, settings.cache_error);
        let device = light.incident.device;
        let growth = Growth { gatherer: &light.irradiance, camera, height };
        let parting = |by_material| Parting { count: light.crossing.receivers(), by_material };
        let glossy = light.reflections.as_ref().map(|reflections| {
            let growth = Growth { gatherer: reflections, camera, height };
            LightMap::new(device, growth, parting(true), error, settings.rays)
        });
        Ok(Self {
            diffuse: LightMap::new(device, growth, parting(false), error, settings.rays),
            glossy,
            first: None,
            film: Film::new(camera, pixels as usize),
            phase: Phase::Start,
            shown: None,
            start: Instant::now(),
            first_pass: 0.0,
            estimate: Estimate::default(),
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
        let mut film = Film::new(self.seen.camera, first.shining.len());
        self.expose_first(&mut film, first)?;
        Ok(Some(film.layers()))
    }

    /// The object that most of the picture shows, when the picture shows some and no light at all.
    pub fn is_dark(&self) -> Result<Option<u32>> {
        let layers = self.layers()?.unwrap_or_default();
        let Some(beauty) = layers.first() else { return Ok(None) };
        let is_lit = beauty.data.chunks_exact(4).any(|pixel| pixel[..3].iter().any(|x| *x != 0.0));
        Ok(self.shown.filter(|_| !is_lit))
    }

    /// Of irradiance.
    pub fn cache(&self) -> &Cache {
        &self.diffuse.cache
    }

    /// Of what shining surfaces reflect.
    pub fn glossy_cache(&self) -> Option<&Cache> {
        self.glossy.as_ref().map(|glossy| &glossy.cache)
    }

    /// About how much of the work is done, in [0, 1], by the time that it took: refining takes time by the power 3/2 of
    /// the error's fall, each sample of a pixel what the first one took.
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

    fn begin(&mut self, progress: &Progress) -> Result<()> {
        let first = self.pass(0)?;
        self.shown = most_seen(&first.pass);
        self.first_pass = self.start.elapsed().as_secs_f64();
        self.diffuse.start(&diffuse(&first), progress)?;
        if let Some(glossy) = &mut self.glossy {
            glossy.start(&shining(&first, &ones(&first)), progress)?;
        }
        self.first = Some(first);
        self.assess();
        self.phase = Phase::Refine;
        Ok(())
    }

    /// Improves the map that errs more.
    fn refine(&mut self, progress: &Progress) -> Result<()> {
        let Some(first) = self.first.take() else { return Ok(()) };
        let improved = self.improve(&first, progress);
        self.first = Some(first);
        if !improved? {
            let first = self.first.take().expect("just put there");
            let mut film = std::mem::replace(&mut self.film, Film::new(self.seen.camera, 0));
            self.expose_first(&mut film, &first)?;
            self.film = film;
            self.phase = if self.settings.samples_per_pixel > 1 { Phase::Smooth } else { Phase::Done };
        }
        self.assess();
        Ok(())
    }

    /// False when all is as good as asked, or as can be.
    fn improve(&mut self, first: &First, progress: &Progress) -> Result<bool> {
        let tolerance = f64::from(self.settings.tolerance);
        let ones = ones(first);
        // Errors of both maps against the light of both.
        let all = self.estimate.mean.max(f64::MIN_POSITIVE);
        let of = |map: &LightMap| if map.is_spent() { 0.0 } else { map.estimate.error() * map.estimate.mean / all };
        let errors = [of(&self.diffuse), self.glossy.as_ref().map_or(0.0, of)];
        let enough = |map: &LightMap| tolerance * all / map.estimate.mean.max(1e-6 * all);
        if errors[0].hypot(errors[1]) > tolerance {
            match &mut self.glossy {
                Some(glossy) if errors[1] > errors[0] => {
                    let enough = enough(glossy);
                    glossy.refine(&shining(first, &ones), enough, progress)?;
                }
                _ => {
                    let enough = enough(&self.diffuse);
                    self.diffuse.refine(&diffuse(first), enough, progress)?;
                }
            }
            return Ok(true);
        }
        let mut went_on = self.diffuse.even_out(&diffuse(first), tolerance, progress)?;
        if let Some(glossy) = &mut self.glossy {
            let enough = enough(glossy);
            went_on |= glossy.even_out(&shining(first, &ones), enough, progress)?;
        }
        Ok(went_on)
    }

    /// One more sample of each pixel.
    fn smooth(&mut self, progress: &Progress) -> Result<()> {
        let pass = self.pass(self.film.passes())?;
        let light = self.diffuse.fill(diffuse(&pass).view, progress)?;
        let reflected = match &mut self.glossy {
            Some(glossy) => glossy.fill(shining(&pass, &[]).view, progress)?,
            None => Vec::new(),
        };
        let mut film = std::mem::replace(&mut self.film, Film::new(self.seen.camera, 0));
        self.expose(&mut film, &pass, &light, &reflected);
        self.film = film;
        if self.film.passes() >= self.settings.samples_per_pixel as usize {
            self.phase = Phase::Done;
        }
        Ok(())
    }

    /// Errors of both maps together.
    fn assess(&mut self) {
        let maps = [Some(&self.diffuse), self.glossy.as_ref()];
        let mut all = Estimate::default();
        for Estimate { mean, noise, interpolation } in maps.into_iter().flatten().map(|map| map.estimate) {
            all.mean += mean;
            all.noise = all.noise.hypot(noise * mean);
            // Infinite until it is known; of no light, there is no error.
            all.interpolation = all.interpolation.hypot(if mean > 0.0 { interpolation * mean } else { 0.0 });
        }
        let mean = all.mean.max(f64::MIN_POSITIVE);
        self.estimate = Estimate { noise: all.noise / mean, interpolation: all.interpolation / mean, ..all };
    }

    /// Adds the first pass to a film, in the light of both maps.
    fn expose_first(&self, film: &mut Film, first: &First) -> Result<()> {
        let light = self.diffuse.light(&diffuse(first).view)?;
        let reflected = match &self.glossy {
            Some(glossy) => glossy.light(&shining(first, &[]).view)?,
            None => Vec::new(),
        };
        self.expose(film, first, &light, &reflected);
        Ok(())
    }

    /// `light`: of each pixel, as the maps have it; `reflected`: empty where nothing shines.
    fn expose(&self, film: &mut Film, pass: &First, light: &[[f32; 4]], reflected: &[[f32; 4]]) {
        let radiance = |pixel: usize| {
            let mut all = Vec4::from_array(light[pixel]) * Vec4::from_array(pass.pass.diffuse[pixel]);
            if pass.shining[pixel].exists() {
                all += Vec4::from_array(reflected[pixel]);
            }
            all.with_w(0.0).to_array()
        };
        let pixels = (0..light.len()).into_par_iter().with_min_len(256);
        self.seen.expose(film, &pass.pass, self.light.crossing, pixels.map(radiance).collect());
    }

    fn pass(&self, number: usize) -> Result<First> {
        let pass = self.seen.pass(self.light.incident, self.light.crossing, number)?;
        let shining = |point: &SurfacePoint| match &self.light.reflections {
            Some(reflections) => reflections.shining(point),
            None => SurfacePoint::NOWHERE,
        };
        let shining = pass.samples.points.par_iter().with_min_len(4096).map(shining).collect();
        Ok(First { pass, shining })
    }
}

fn view<'a>(points: &'a [SurfacePoint], pass: &'a Pass) -> View<'a> {
    View { points, receivers: &pass.receivers, width: pass.samples.width, height: pass.samples.height }
}

fn diffuse(first: &First) -> Seeing<'_> {
    Seeing { view: view(&first.pass.samples.points, &first.pass), factor: &first.pass.diffuse }
}

fn shining<'a>(first: &'a First, factor: &'a [[f32; 4]]) -> Seeing<'a> {
    Seeing { view: view(&first.shining, &first.pass), factor }
}

/// Reflected light goes to the camera as it is.
fn ones(first: &First) -> Vec<[f32; 4]> {
    first.shining.iter().map(|point| [if point.exists() { 1.0 } else { 0.0 }; 4]).collect()
}

fn most_seen(pass: &Pass) -> Option<u32> {
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    pass.samples.points.iter().filter(|point| point.exists()).for_each(|p| *counts.entry(p.object).or_default() += 1);
    counts.into_iter().max_by_key(|(_, count)| *count).map(|(object, _)| object)
}
