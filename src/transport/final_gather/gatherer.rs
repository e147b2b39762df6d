//! Gathers light at places: rays over their hemispheres, light at what these meet, and photons that they can see.

use super::crossing::{Crossing, Scratch};
use super::hemisphere::{Hemisphere, Strata};
use super::incident::{Incident, Leaving};
use super::photons::Photons;
use super::place::{Layer, Place};
use super::transit::{Arrivals, weights};
use crate::Result;
use crate::kernels::blocked_rays;
use crate::kernels::trace_rays::{RayRecord, Traced, trace_rays};
use crate::progress::Stage;
use crate::scene::SurfacePoint;
use crate::transport::light_cache::Gradients;
use crate::transport::sampling;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// Rays that are followed together: bounds the memory between the steps.
const BATCH: usize = 1 << 17;
/// About how many photons are drawn from lamps: places choose runs of them.
const PHOTONS: usize = 1 << 16;
/// Surfaces behind each other that one ray looks through.
const LAYERS: usize = 5;

/// What was gathered at a place.
#[derive(Clone, Debug, Default)]
pub struct Gathered {
    pub light: Gradients,
    /// The derivative by the weight of each receiver, W/m².
    pub changes: Vec<Vec4>,
    /// Harmonic mean and least of the distances to what is seen, m.
    pub reach: [f32; 2],
    /// How much faster than diffuse light this changes with the normal, at least 1.
    pub bend: f32,
}

/// Finds light at places.
pub trait Gathers: Sync {
    /// By `rays` rays each; `stage` counts rays.
    ///
    /// # Errors
    /// `Cancelled`; the device failed.
    fn gather(&self, places: &Places, rays: u32, stage: &Stage) -> Result<Vec<Gathered>>;
}

/// Places to gather at.
pub struct Places<'a> {
    pub points: &'a [SurfacePoint],
    /// `Crossing::weights` there.
    pub receivers: &'a [f32],
    /// One each.
    pub seeds: &'a [u32],
}

impl<'a> Places<'a> {
    /// As many at a time as have their rays followed together.
    pub fn batches(&self, rays: u32) -> impl Iterator<Item = Places<'a>> {
        let (all, batch) = (self.points.len(), (BATCH / rays as usize).max(1));
        let Self { points, receivers, seeds } = *self;
        let count = receivers.len() / all.max(1);
        (0..all).step_by(batch).map(move |first| {
            let range = first..(first + batch).min(all);
            let receivers = &receivers[range.start * count..range.end * count];
            Places { points: &points[range.clone()], receivers, seeds: &seeds[range] }
        })
    }
}

/// Where light comes from, how it is looked for, and what changes it.
pub struct Gatherer<'a> {
    pub(super) incident: &'a Incident<'a>,
    pub(super) crossing: &'a Crossing<'a>,
    pub(super) photons: Photons,
    /// Of each photon: caster weights, and the nearest gather sample of sampled edits.
    pub(super) photon_casters: Vec<f32>,
    pub(super) photon_samples: Vec<Option<u32>>,
}

impl<'a> Gatherer<'a> {
    /// # Errors
    /// The device failed.
    pub fn new(incident: &'a Incident<'a>, crossing: &'a Crossing<'a>) -> Result<Self> {
        let mut photons = Photons::new(incident, PHOTONS)?;
        let points: Vec<SurfacePoint> = photons.list.iter().map(|photon| photon.point).collect();
        let barycentrics: Vec<[f32; 2]> = photons.list.iter().map(|photon| photon.barycentrics).collect();
        let photon_casters = weights(crossing.transits.casters(), &points);
        let mut photon_samples = Vec::new();
        if let Some(sampled) = &crossing.sampled {
            photon_samples = sampled.samples(&points, &barycentrics, |_| true);
            let from_lamps = photons.list.iter().map(|photon| photon.power).collect();
            let mut leaving = Leaving { from_lamps, from_others: vec![Vec4::ZERO; points.len()] };
            sampled.at_source(&photon_samples, &mut leaving);
            photons.list.iter_mut().zip(leaving.from_lamps).for_each(|(photon, power)| photon.power = power);
        }
        Ok(Self { incident, crossing, photons, photon_casters, photon_samples })
    }

    /// Gains of curves by the irradiance at each place, one an edit in transit; nothing where no curve reaches.
    ///
    /// # Errors
    /// The device failed.
    pub fn gains(&self, places: &Places, rays: u32) -> Result<Vec<Vec<f32>>> {
        let count = self.crossing.receivers();
        let receivers = |place: usize| &places.receivers[place * count..][..count];
        let has_curve = |place: &usize| self.crossing.transits.curve_at(receivers(*place));
        let asked: Vec<usize> = (0..places.points.len()).filter(has_curve).collect();
        let points: Vec<SurfacePoint> = asked.iter().map(|place| places.points[*place]).collect();
        let weights: Vec<f32> = asked.iter().flat_map(|place| receivers(*place)).copied().collect();
        let seeds: Vec<u32> = asked.iter().map(|place| places.seeds[*place]).collect();
        let asked_places = Places { points: &points, receivers: &weights, seeds: &seeds };
        let mut all = vec![Vec::new(); places.points.len()];
        let mut numbers = asked.iter();
        for batch in asked_places.batches(rays) {
            let gains = self.batch(&batch, rays, |place, point, receivers, scratch| {
                self.gains_at(place, point, receivers, scratch)
            })?;
            gains.into_iter().zip(numbers.by_ref()).for_each(|(gains, place)| all[*place] = gains);
        }
        Ok(all)
    }

    /// What is told of each place, by its point, its receivers, and all that its rays and photons found; about half of the
    /// rays go to photons.
    fn batch<T: Send>(
        &self,
        places: &Places,
        rays: u32,
        tell: impl Fn(&Place, &SurfacePoint, &[f32], &mut (Arrivals, Scratch)) -> T + Sync,
    ) -> Result<Vec<T>> {
        let photons = if self.photons.is_empty() { 0 } else { rays as usize / 2 };
        let strata = Strata::of(rays - photons as u32);
        let geometry = self.incident.geometry;
        let rays = strata.rays();
        let hemisphere = |place| Hemisphere::new(place, strata, geometry.lift());
        let hemispheres: Vec<Hemisphere> = places.points.par_iter().map(hemisphere).collect();
        let mut cast = vec![RayRecord::NONE; hemispheres.len() * rays];
        let fans = cast.par_chunks_mut(rays).zip(&hemispheres).zip(places.seeds);
        fans.for_each(|((cast, hemisphere), seed)| hemisphere.rays(*seed, cast));
        let ratio = photons as f32 / rays as f32;
        let mut layers: Vec<Layer> = Vec::new();
        let mut next = None;
        while layers.len() < LAYERS {
            let cast = next.as_ref().unwrap_or(&cast);
            let traced = trace_rays(self.incident.device, geometry, cast)?;
            let beyond = self.beyond(places, cast, &traced, rays);
            layers.push(self.layer(places, &hemispheres, cast, traced, ratio)?);
            if beyond.is_none() {
                break;
            }
            next = beyond;
        }
        // Photons that a place is held against: a run of the sequence that starts anywhere.
        let of = |seed: u32| (0..photons).map(move |i| (sampling::hash(!seed) as usize + i) % self.photons.list.len());
        let mut ways = vec![RayRecord::NONE; hemispheres.len() * photons];
        if photons > 0 {
            ways.par_chunks_mut(photons).zip(&hemispheres).zip(places.seeds).for_each(|((ways, hemisphere), seed)| {
                ways.iter_mut().zip(of(*seed)).for_each(|(way, i)| *way = self.way(hemisphere, i));
            });
        }
        let blocked = blocked_rays(self.incident.device, geometry, &ways)?;
        let count = self.crossing.receivers();
        let one = |scratch: &mut (Arrivals, Scratch), i: usize| {
            let met: Vec<(usize, usize)> =
                of(places.seeds[i]).enumerate().map(|(j, photon)| (i * photons + j, photon)).collect();
            let place = Place {
                hemisphere: &hemispheres[i],
                fan: i * rays..(i + 1) * rays,
                cast: &cast,
                layers: &layers,
                photons: &met,
                ways: &ways,
                blocked: &blocked,
                ratio,
            };
            tell(&place, &places.points[i], &places.receivers[i * count..][..count], scratch)
        };
        let all = (0..hemispheres.len()).into_par_iter();
        Ok(all.map_init(<(Arrivals, Scratch)>::default, one).collect())
    }

    /// Light at what rays met, with edits at the source.
    fn layer(
        &self,
        places: &Places,
        hemispheres: &[Hemisphere],
        cast: &[RayRecord],
        traced: Traced,
        ratio: f32,
    ) -> Result<Layer> {
        let rays = cast.len() / hemispheres.len().max(1);
        let samples = self.crossing.samples(places.receivers, &traced, rays);
        let met = traced.points;
        let mut leaving = self.incident.light(met.clone(), &traced.barycentrics, places.seeds[0])?;
        if let Some(sampled) = &self.crossing.sampled {
            sampled.at_source(&samples, &mut leaving);
        }
        let exitance = |ray: usize| {
            let lamps = leaving.from_lamps[ray];
            let mut light = leaving.from_others[ray];
            if lamps.w > 0.0 {
                let direction = Vec3::from(cast[ray].direction);
                let there = -direction.dot(met[ray].geometric_normal.into());
                let here = direction.dot(hemispheres[ray / rays].normal());
                let by_rays = (here * there).max(0.0) * FRAC_1_PI / traced.distances[ray].powi(2);
                light += lamps * (by_rays / (by_rays + ratio * self.photons.density(lamps.w)));
            }
            light.with_w(0.0)
        };
        let exitance = (0..cast.len()).into_par_iter().with_min_len(1024).map(exitance).collect();
        let casters = weights(self.crossing.transits.casters(), &met);
        Ok(Layer { distances: traced.distances, exitance, casters, samples })
    }

    /// Rays that go on behind what they met, where an edit lets such light through.
    fn beyond(&self, places: &Places, cast: &[RayRecord], traced: &Traced, rays: usize) -> Option<Vec<RayRecord>> {
        let count = self.crossing.receivers();
        let sees_through =
            |place: usize| self.crossing.transits.sees_through(&places.receivers[place * count..][..count]);
        let through: Vec<bool> = (0..places.points.len()).map(sees_through).collect();
        if !through.contains(&true) {
            return None;
        }
        let on = |ray: usize| match traced.points[ray].exists() && through[ray / rays] {
            true => RayRecord { t_min: traced.distances[ray] * 1.000_01, ..cast[ray] },
            false => RayRecord::NONE,
        };
        let beyond: Vec<RayRecord> = (0..cast.len()).map(on).collect();
        beyond.iter().any(|ray| ray.t_max > 0.0).then_some(beyond)
    }

    /// From a place to a photon; none where one is behind the other.
    fn way(&self, hemisphere: &Hemisphere, photon: usize) -> RayRecord {
        let photon = &self.photons.list[photon];
        let normal = Vec3::from(photon.point.geometric_normal);
        let way = Vec3::from(photon.point.position) - hemisphere.origin();
        let is_open = photon.density > 0.0
            && way.dot(hemisphere.normal()) > 0.0
            && way.dot(hemisphere.geometric()) > 0.0
            && way.dot(normal) < 0.0;
        let t_max = if is_open { 0.9999 } else { 0.0 };
        RayRecord { origin: hemisphere.origin().to_array(), t_max, direction: way.to_array(), t_min: 0.0 }
    }
}

impl Gathers for Gatherer<'_> {
    fn gather(&self, places: &Places, rays: u32, stage: &Stage) -> Result<Vec<Gathered>> {
        let mut all = Vec::with_capacity(places.points.len());
        for places in places.batches(rays) {
            all.extend(self.batch(&places, rays, |place, point, receivers, scratch| {
                let reach = Hemisphere::reach(&place.layers[0].distances[place.fan.clone()]);
                let (light, changes) = match self.crossing.spares(receivers) {
                    true => (self.unedited(place), vec![Vec4::ZERO; receivers.len()]),
                    false => self.edited(place, point, receivers, scratch),
                };
                Gathered { light, changes, reach, bend: 1.0 }
            })?);
            stage.advance(u64::from(rays) * places.points.len() as u64)?;
        }
        Ok(all)
    }
}
