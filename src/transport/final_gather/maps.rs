//! Both kinds of light over a picture, refined together: what surfaces scatter, and what they reflect to the eye.

use super::estimate::Estimate;
use super::growth::Growth;
use super::light_map::{LightMap, Seeing};
use super::placement::View;
use super::render::{Light, Settings};
use super::view::Pass;
use crate::Result;
use crate::progress::Progress;
use crate::scene::{Camera, SurfacePoint};
use crate::transport::light_cache::Parting;
use glam::Vec4;
use rayon::prelude::*;

pub struct Maps<'a> {
    pub diffuse: LightMap<'a>,
    /// `None` where nothing shines.
    pub glossy: Option<LightMap<'a>>,
    /// Of both together.
    pub estimate: Estimate,
}

impl<'a> Maps<'a> {
    /// `height`: pixels of the picture, downwards.
    pub fn new(light: &'a Light<'a>, camera: &'a Camera, height: usize, settings: Settings) -> Self {
        let map = |growth, by_material| {
            let parting = Parting { count: light.crossing.receivers(), by_material };
            LightMap::new(light.incident.device, growth, parting, settings.cache_error, settings.rays)
        };
        let reflections = light.reflections.as_ref();
        Self {
            diffuse: map(Growth { gatherer: light.irradiance, camera, height }, false),
            // Another material has another lobe.
            glossy: reflections.map(|reflections| map(Growth { gatherer: reflections, camera, height }, true)),
            estimate: Estimate::default(),
        }
    }

    /// Something of the light for all of a picture.
    ///
    /// # Errors
    /// `Cancelled`; the device failed.
    pub fn start(&mut self, pass: &Pass, progress: &Progress) -> Result<()> {
        self.diffuse.start(&diffuse(pass), progress)?;
        if let Some(glossy) = &mut self.glossy {
            glossy.start(&shining(pass, &ones(pass)), progress)?;
        }
        self.assess();
        Ok(())
    }

    /// Improves the map that errs more; false when all is as good as asked, or as can be.
    ///
    /// # Errors
    /// As `start`; the maps are whole.
    pub fn improve(&mut self, pass: &Pass, tolerance: f64, progress: &Progress) -> Result<bool> {
        let went_on = self.refine(pass, tolerance, progress)?;
        self.assess();
        Ok(went_on)
    }

    fn refine(&mut self, pass: &Pass, tolerance: f64, progress: &Progress) -> Result<bool> {
        let ones = ones(pass);
        // Errors of both maps against the light of both.
        let all = self.estimate.mean.max(f64::MIN_POSITIVE);
        let of = |map: &LightMap| if map.is_spent() { 0.0 } else { map.estimate.error() * map.estimate.mean / all };
        let errors = [of(&self.diffuse), self.glossy.as_ref().map_or(0.0, of)];
        let enough = |map: &LightMap| tolerance * all / map.estimate.mean.max(1e-6 * all);
        if errors[0].hypot(errors[1]) > tolerance {
            match &mut self.glossy {
                Some(glossy) if errors[1] > errors[0] => {
                    let enough = enough(glossy);
                    glossy.refine(&shining(pass, &ones), enough, progress)?;
                }
                _ => {
                    let enough = enough(&self.diffuse);
                    self.diffuse.refine(&diffuse(pass), enough, progress)?;
                }
            }
            return Ok(true);
        }
        let mut went_on = self.diffuse.even_out(&diffuse(pass), tolerance, progress)?;
        if let Some(glossy) = &mut self.glossy {
            let enough = enough(glossy);
            went_on |= glossy.even_out(&shining(pass, &ones), enough, progress)?;
        }
        Ok(went_on)
    }

    /// Indirect radiance of each pixel, W/(sr m²).
    pub fn radiance(&self, pass: &Pass) -> Result<Vec<[f32; 4]>> {
        let light = self.diffuse.light(&diffuse(pass).view)?;
        let reflected = match &self.glossy {
            Some(glossy) => glossy.light(&shining(pass, &[]).view)?,
            None => Vec::new(),
        };
        Ok(radiance(pass, &light, &reflected))
    }

    /// As `radiance`, of another pass over the picture, whose gaps get records.
    ///
    /// # Errors
    /// As `start`.
    pub fn fill(&mut self, pass: &Pass, progress: &Progress) -> Result<Vec<[f32; 4]>> {
        let light = self.diffuse.fill(diffuse(pass).view, progress)?;
        let reflected = match &mut self.glossy {
            Some(glossy) => glossy.fill(shining(pass, &[]).view, progress)?,
            None => Vec::new(),
        };
        Ok(radiance(pass, &light, &reflected))
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
}

/// `light`: of each pixel, as the maps have it; `reflected`: empty where nothing shines.
fn radiance(pass: &Pass, light: &[[f32; 4]], reflected: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let one = |pixel: usize| {
        let mut all = Vec4::from_array(light[pixel]) * Vec4::from_array(pass.diffuse[pixel]);
        if let Some(reflected) = reflected.get(pixel)
            && pass.shining[pixel].exists()
        {
            all += Vec4::from_array(*reflected);
        }
        all.with_w(0.0).to_array()
    };
    (0..light.len()).into_par_iter().with_min_len(256).map(one).collect()
}

fn view<'a>(points: &'a [SurfacePoint], pass: &'a Pass) -> View<'a> {
    View { points, receivers: &pass.receivers, width: pass.samples.width, height: pass.samples.height }
}

fn diffuse(pass: &Pass) -> Seeing<'_> {
    Seeing { view: view(&pass.samples.points, pass), factor: &pass.diffuse }
}

fn shining<'a>(pass: &'a Pass, factor: &'a [[f32; 4]]) -> Seeing<'a> {
    Seeing { view: view(&pass.shining, pass), factor }
}

/// Reflected light goes to the camera as it is.
fn ones(pass: &Pass) -> Vec<[f32; 4]> {
    pass.shining.iter().map(|point| [if point.exists() { 1.0 } else { 0.0 }; 4]).collect()
}
