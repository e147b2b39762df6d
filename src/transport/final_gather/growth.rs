//! How the cache grows: records where there are none, more rays where noise is seen, finer interpolation.

use super::cache::{Cache, Fresh, Record};
use super::gatherer::{Gathered, Gathers, Places};
use super::placement::{Placement, View};
use crate::Result;
use crate::progress::Stage;
use crate::scene::{Camera, SurfacePoint};
use crate::transport::light_cache::{Found, Gradients};
use crate::transport::sampling;
use glam::Vec3;
use rayon::prelude::*;

/// Rays of one set at least: fewer say little of gradients.
pub const FEWEST: u32 = 32;

/// How far the sharpness of light lets a record count: so that its first derivative, followed as far as R, would not more
/// than double its light (Křivánek et al. 2006).
fn limit(light: &Gradients) -> f32 {
    let steepest = light.moved.iter().map(|by| by.truncate().length_squared()).sum::<f32>().sqrt();
    light.value.truncate().length() / steepest.max(1e-20)
}

/// Records overlap by this: a pixel is covered from a part of their reach.
pub const OVERLAP: f32 = 0.75;

/// What records that were added meant for those that were there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Told {
    pub added: usize,
    /// Squared difference between what the cache said of new places and what was gathered there, without what noise
    /// explains: a sum, in squares of irradiance, all channels together; and of how many places.
    pub off: f64,
    pub tested: usize,
}

impl Told {
    /// `found`: what the cache said of a place; `light`: what was gathered there.
    fn hear(&mut self, found: &Found, light: &Gradients, record: &Record) {
        if found.weight > 0.0 {
            let off = (found.light - light.value).truncate().length_squared();
            self.off += f64::from(off - found.variance - record.variance);
            self.tested += 1;
        }
    }
}

/// What is to be covered, and how.
pub struct Asked<'a> {
    pub view: View<'a>,
    /// The cache as it was when it covered such a picture: it says how many rays a place needs, and is held against what is
    /// found there.
    pub before: Option<&'a Cache>,
    /// Of a place, where nothing is known.
    pub rays: u32,
    /// See `Placement`.
    pub share: f32,
    /// The only pixels that are not covered, where all that is in the cache stays as it is.
    pub gaps: Option<Vec<usize>>,
}

/// Who gathers, and for which picture.
pub struct Growth<'a> {
    pub gatherer: &'a dyn Gathers,
    pub camera: &'a Camera,
    /// Pixels of the picture, downwards.
    pub height: usize,
}

impl Growth<'_> {
    /// Adds records until all points of a picture are covered.
    pub fn cover(&self, cache: &mut Cache, asked: Asked, stage: &Stage) -> Result<Told> {
        let Asked { view, before, rays, share, gaps } = asked;
        let mut placement = match gaps {
            Some(gaps) => Placement::of_gaps(view, gaps),
            None => Placement::new(view, share, before.is_some()),
        };
        let mut told = Told::default();
        loop {
            let next = placement.next(cache);
            if next.is_empty() {
                cache.refresh();
                return Ok(told);
            }
            let mut fresh = Fresh::default();
            let rays: Vec<u32> = next
                .par_iter()
                .map(|pixel| before.and_then(|before| before.rays_near(&view.spot(*pixel))).unwrap_or(rays))
                .collect();
            for class in classes(&rays) {
                let of: Vec<usize> =
                    next.iter().zip(&rays).filter(|(_, rays)| self::class(**rays) == class).map(|(i, _)| *i).collect();
                let points: Vec<SurfacePoint> = of.iter().map(|&pixel| view.points[pixel]).collect();
                let receivers: Vec<f32> = of.iter().flat_map(|&pixel| view.spot(pixel).receivers).copied().collect();
                let seeds: Vec<u32> = points.iter().map(seed).collect();
                let places = |seeds| Places { points: &points, receivers: &receivers, seeds };
                let [a, b] = [set(&seeds, 0), set(&seeds, 1)];
                let a = self.gatherer.gather(&places(&a), class / 2, stage)?;
                let b = self.gatherer.gather(&places(&b), class / 2, stage)?;
                for (i, (a, b)) in a.iter().zip(&b).enumerate() {
                    let light = a.light.mix(&b.light, 0.5);
                    let record = self.record(&points[i], seeds[i], a, b, class);
                    if let Some(before) = before {
                        told.hear(&before.columns.look_up(&view.spot(of[i])), &light, &record);
                    }
                    fresh.records.push(record);
                    fresh.light.push(light);
                    fresh.changes.extend(a.changes.iter().zip(&b.changes).map(|(a, b)| 0.5 * (*a + *b)));
                }
                fresh.receivers.extend(receivers);
            }
            told.added += fresh.records.len();
            cache.extend(fresh, placement.is_settled());
        }
    }

    /// Casts more rays from some records: pairs of record and rays.
    pub fn add_rays(&self, cache: &mut Cache, wanted: &[(usize, u32)], stage: &Stage) -> Result<()> {
        let rays: Vec<u32> = wanted.iter().map(|(_, rays)| *rays).collect();
        for class in classes(&rays) {
            let of: Vec<usize> =
                wanted.iter().filter(|(_, rays)| self::class(*rays) == class).map(|(record, _)| *record).collect();
            let points: Vec<SurfacePoint> = of.iter().map(|&i| cache.records[i].place).collect();
            let receivers: Vec<f32> = of.iter().flat_map(|&i| cache.spot(i).receivers).copied().collect();
            // Sets of a record are told apart by how many rays were there before.
            let seeds: Vec<u32> = of.iter().map(|&i| cache.records[i].seed ^ cache.records[i].rays).collect();
            let places = Places { points: &points, receivers: &receivers, seeds: &set(&seeds, 2) };
            let found = self.gatherer.gather(&places, class, stage)?;
            for (&i, found) in of.iter().zip(found) {
                cache.refine(i, &found.light, &found.changes, class);
            }
        }
        Ok(())
    }

    /// Of two sets of rays.
    fn record(&self, place: &SurfacePoint, seed: u32, a: &Gathered, b: &Gathered, rays: u32) -> Record {
        let mean = 2.0 / (1.0 / a.reach[0] + 1.0 / b.reach[0]);
        Record {
            place: *place,
            seed,
            radius: mean.min(limit(&a.light.mix(&b.light, 0.5))),
            bend: a.bend.max(b.bend),
            footprint: self.footprint(place),
            rays,
            variance: 0.25 * (a.light.value - b.light.value).truncate().length_squared(),
        }
    }

    /// About the width of a pixel on a surface, m.
    fn footprint(&self, place: &SurfacePoint) -> f32 {
        let way = self.camera.position - Vec3::from(place.position);
        let cosine = way.normalize_or_zero().dot(place.normal.into()).abs().max(0.05);
        way.length() * 2.0 * (0.5 * self.camera.fov_y).tan() / self.height as f32 / cosine.sqrt()
    }
}

/// Names the rays of a place, whatever else is gathered.
fn seed(place: &SurfacePoint) -> u32 {
    place.position.iter().fold(place.triangle, |seed, x| sampling::hash(seed ^ x.to_bits()))
}

/// Seeds of another set of rays.
fn set(seeds: &[u32], set: u32) -> Vec<u32> {
    seeds.iter().map(|seed| sampling::hash(seed.wrapping_add(set << 24))).collect()
}

/// Rays are counted in powers of two, so that places share passes.
fn class(rays: u32) -> u32 {
    rays.next_power_of_two().max(2 * FEWEST)
}

fn classes(rays: &[u32]) -> Vec<u32> {
    let mut all: Vec<u32> = rays.iter().map(|rays| class(*rays)).collect();
    all.sort_unstable();
    all.dedup();
    all
}
