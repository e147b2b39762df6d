//! One kind of light over a picture, as a cache that is refined: irradiance, or what glossy surfaces reflect.

use super::cache::Cache;
use super::estimate::{Demand, Estimate};
use super::growth::{Asked, FEWEST, Growth, OVERLAP};
use super::placement::View;
use crate::Result;
use crate::device::Device;
use crate::kernels::cached_light;
use crate::progress::Progress;
use crate::transport::light_cache::Parting;

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
/// Of a pixel, what a record covers at least.
const PIXELS: f32 = 1.0;

/// Pixels of a picture, and what its light counts there.
#[derive(Clone, Copy)]
pub struct Seeing<'a> {
    pub view: View<'a>,
    /// Radiance to the camera over light of the map, one a pixel.
    pub factor: &'a [[f32; 4]],
}

pub struct LightMap<'a> {
    /// Where the light of pixels is looked up.
    device: &'a Device,
    growth: Growth<'a>,
    pub cache: Cache,
    /// Of the cache as it is.
    demand: Option<Demand>,
    /// Relative to the light of this map alone.
    pub estimate: Estimate,
    /// Times that noise was evened out.
    evened: usize,
    /// More rays were asked for, and no place may have more.
    is_spent: bool,
    /// Most rays of a place.
    most: u32,
}

impl<'a> LightMap<'a> {
    /// `error`: `a` of the cache when it starts; `most`: rays of a place.
    pub fn new(device: &'a Device, growth: Growth<'a>, parting: Parting, error: f32, most: u32) -> Self {
        Self {
            device,
            growth,
            cache: Cache::new(error, PIXELS, parting),
            demand: None,
            estimate: Estimate::default(),
            evened: 0,
            is_spent: false,
            most,
        }
    }

    /// Something of the light for all of a picture.
    pub fn start(&mut self, seeing: &Seeing, progress: &Progress) -> Result<()> {
        let stage = progress.stage("a first picture", seeing.view.points.len() as u64);
        let asked = Asked { view: seeing.view, before: None, rays: 2 * FEWEST, share: 1.0, gaps: None };
        self.growth.cover(&mut self.cache, asked, &stage)?;
        // The first estimate of interpolation comes with the first finer cache.
        self.estimate.interpolation = f64::INFINITY;
        self.assess(seeing);
        Ok(())
    }

    /// No better is to be had.
    pub fn is_spent(&self) -> bool {
        self.is_spent && self.estimate.noise >= self.estimate.interpolation
    }

    /// Lowers the larger part of the error, that of noise down to `enough` of this map's light.
    ///
    /// # Errors
    /// `Cancelled`: the map is whole, as it was before or better.
    pub fn refine(&mut self, seeing: &Seeing, enough: f64, progress: &Progress) -> Result<()> {
        match self.estimate.noise >= self.estimate.interpolation {
            true => self.more_rays(seeing, enough, progress)?,
            false => self.finer(seeing, progress)?,
        }
        self.assess(seeing);
        Ok(())
    }

    /// Halves the noise, or makes it as small as it need be.
    fn more_rays(&mut self, seeing: &Seeing, enough: f64, progress: &Progress) -> Result<()> {
        let demand = self.demand(seeing);
        let least = (0.6 * enough * demand.mean).powi(2);
        let local = LOCAL * enough.max(self.estimate.noise / 2.0);
        let wanted = demand.rays(&self.cache, (0.25 * demand.noise2).max(least), local, self.most);
        self.is_spent = wanted.is_empty();
        self.add_rays(&wanted, progress)
    }

    /// More rays for records whose noise is seen, small as their part in the picture is; false when there are none.
    pub fn even_out(&mut self, seeing: &Seeing, enough: f64, progress: &Progress) -> Result<bool> {
        if self.evened >= EVENED {
            return Ok(false);
        }
        self.evened += 1;
        let wanted = self.demand(seeing).rays(&self.cache, f64::INFINITY, LOCAL * enough, self.most);
        self.add_rays(&wanted, progress)?;
        self.assess(seeing);
        Ok(!wanted.is_empty())
    }

    fn demand(&mut self, seeing: &Seeing) -> Demand {
        self.demand.take().unwrap_or_else(|| Demand::new(&self.cache, seeing))
    }

    fn add_rays(&mut self, wanted: &[(usize, u32)], progress: &Progress) -> Result<()> {
        let stage = progress.stage("more rays", wanted.iter().map(|(_, rays)| u64::from(*rays)).sum());
        let done = self.growth.add_rays(&mut self.cache, wanted, &stage);
        self.cache.refresh();
        done
    }

    fn finer(&mut self, seeing: &Seeing, progress: &Progress) -> Result<()> {
        let before = self.cache.clone();
        self.cache.tighten(before.error() * FINER, PIXELS);
        self.cache.refresh();
        let rays: u64 = before.records.iter().map(|record| u64::from(record.rays)).sum();
        let stage = progress.stage("finer interpolation", rays);
        let view = seeing.view;
        let asked = Asked { view, before: Some(&before), rays: 2 * FEWEST, share: OVERLAP, gaps: None };
        match self.growth.cover(&mut self.cache, asked, &stage) {
            Ok(told) => {
                self.is_spent &= told.added == 0;
                let off = (told.off / 3.0 / told.tested.max(1) as f64).max(0.0);
                let error = (off * mean_square(seeing.factor) * TYPICAL * LEFT).sqrt();
                self.estimate.interpolation = error / self.estimate.mean.max(f64::MIN_POSITIVE);
                Ok(())
            }
            Err(error) => {
                // With gaps it would be worth less than what was there.
                self.cache = before;
                Err(error)
            }
        }
    }

    /// The light of each pixel, and in the fourth element how much is known of it.
    pub fn light(&self, view: &View) -> Result<Vec<[f32; 4]>> {
        cached_light(self.device, &self.cache.columns, view.points, view.receivers)
    }

    /// The light of each pixel of another pass over the picture, whose gaps get records.
    pub fn fill(&mut self, view: View, progress: &Progress) -> Result<Vec<[f32; 4]>> {
        let mut light = self.light(&view)?;
        let is_gap = |pixel: &usize| light[*pixel][3] == 0.0 && view.points[*pixel].exists();
        let gaps: Vec<usize> = (0..light.len()).filter(is_gap).collect();
        let all: u64 = self.cache.records.iter().map(|record| u64::from(record.rays)).sum();
        let rays = ((all / self.cache.records.len().max(1) as u64) as u32).max(2 * FEWEST);
        let stage = progress.stage("antialiasing", gaps.len() as u64 * u64::from(rays));
        let asked = Asked { view, before: None, rays, share: 1.0, gaps: Some(gaps.clone()) };
        self.growth.cover(&mut self.cache, asked, &stage)?;
        for pixel in gaps {
            light[pixel] = self.cache.columns.look_up(&view.spot(pixel)).light.to_array();
        }
        Ok(light)
    }

    fn assess(&mut self, seeing: &Seeing) {
        let demand = Demand::new(&self.cache, seeing);
        self.estimate.mean = demand.mean;
        self.estimate.noise = demand.noise2.sqrt() / demand.mean.max(f64::MIN_POSITIVE);
        self.demand = Some(demand);
    }
}

/// All channels together.
fn mean_square(factor: &[[f32; 4]]) -> f64 {
    let squares = factor.iter().flat_map(|factor| &factor[..3]).map(|x| f64::from(x * x));
    squares.sum::<f64>() / 3.0 / factor.len().max(1) as f64
}
