//! What one place found, and what it comes to: irradiance and its gradients, with edits on the way.

use super::crossing::Scratch;
use super::gatherer::Gatherer;
use super::hemisphere::Hemisphere;
use super::transit::Arrivals;
use crate::kernels::trace_rays::RayRecord;
use crate::scene::SurfacePoint;
use crate::transport::light_cache::Gradients;
use glam::{Vec3, Vec4};
use std::f32::consts::{FRAC_1_PI, PI};
use std::ops::Range;

/// What the rays of a batch met.
pub struct Layer {
    pub distances: Vec<f32>,
    /// Radiant exitance towards the place, by the share of the hemisphere's rays in finding it, W/m².
    pub exitance: Vec<Vec4>,
    pub casters: Vec<f32>,
    pub samples: Vec<Option<u32>>,
}

/// What one place of a batch found.
pub struct Place<'a> {
    pub hemisphere: &'a Hemisphere,
    /// Its rays in `cast` and in layers.
    pub fan: Range<usize>,
    pub cast: &'a [RayRecord],
    pub layers: &'a [Layer],
    /// Of each photon: where it stands in `ways` and `blocked`, and in the list of all.
    pub photons: &'a [(usize, usize)],
    pub ways: &'a [RayRecord],
    pub blocked: &'a [u32],
    /// Photons to rays.
    pub ratio: f32,
}

impl Gatherer<'_> {
    pub(super) fn unedited(&self, place: &Place) -> Gradients {
        let layer = &place.layers[0];
        let mut light =
            place.hemisphere.gradients(&layer.exitance[place.fan.clone()], &layer.distances[place.fan.clone()]);
        for &(at, photon) in place.photons.iter().filter(|(at, _)| place.blocked[*at] == 0) {
            let (way, normal) =
                (place.ways[at].direction.into(), self.photons.list[photon].point.geometric_normal.into());
            place.hemisphere.add_place(&mut light, self.by_photon(place, at, photon), way, normal);
        }
        light
    }

    /// All that arrives at a place, rays first; the gather sample nearest to where each comes from, where sampled edits ask
    /// for it; and of the photons of the place, those among them.
    fn arriving(&self, place: &Place, arrivals: &mut Arrivals) -> (Vec<Option<u32>>, Vec<(usize, usize)>) {
        arrivals.clear();
        let (rays, casters) = (place.fan.len(), self.crossing.transits.casters().len());
        let mut samples: Vec<Option<u32>> = Vec::new();
        for (depth, layer) in place.layers.iter().enumerate() {
            for ray in place.fan.clone() {
                arrivals.light.push(layer.exitance[ray] / rays as f32);
                arrivals.direction.push(place.cast[ray].direction.into());
                arrivals.distance.push(layer.distances[ray]);
                arrivals.seen.push(if depth == 0 { 1.0 } else { 0.0 });
            }
            arrivals.casters.extend_from_slice(&layer.casters[place.fan.start * casters..place.fan.end * casters]);
            samples.extend(layer.samples.get(place.fan.clone()).into_iter().flatten());
        }
        // A photon behind something counts only where an edit sees through that.
        let counts = |at: usize| place.ways[at].t_max > 0.0 && (place.blocked[at] == 0 || place.layers.len() > 1);
        let photons: Vec<(usize, usize)> = place.photons.iter().copied().filter(|(at, _)| counts(*at)).collect();
        for &(at, photon) in &photons {
            let way = Vec3::from(place.ways[at].direction);
            arrivals.light.push(self.by_photon(place, at, photon));
            arrivals.direction.push(way.normalize_or_zero());
            arrivals.distance.push(way.length());
            arrivals.seen.push(if place.blocked[at] == 0 { 1.0 } else { 0.0 });
            arrivals.casters.extend_from_slice(&self.photon_casters[photon * casters..][..casters]);
            samples.extend(self.photon_samples.get(photon));
        }
        (samples, photons)
    }

    /// Gains of curves by what arrives at a place, one an edit in transit.
    pub(super) fn gains_at(
        &self,
        place: &Place,
        point: &SurfacePoint,
        receivers: &[f32],
        (arrivals, scratch): &mut (Arrivals, Scratch),
    ) -> Vec<f32> {
        let (samples, _) = self.arriving(place, arrivals);
        self.crossing.gains(arrivals, &samples, receivers, self.crossing.rows(point).as_ref(), scratch)
    }

    pub(super) fn edited(
        &self,
        place: &Place,
        point: &SurfacePoint,
        receivers: &[f32],
        (arrivals, scratch): &mut (Arrivals, Scratch),
    ) -> (Gradients, Vec<Vec4>) {
        let (samples, photons) = self.arriving(place, arrivals);
        let (rays, rows) = (place.fan.len(), self.crossing.rows(point));
        let (added, changes) = self.crossing.edit(arrivals, &samples, receivers, rows.as_ref(), None, scratch);
        let (by_rays, by_photons) = scratch.light.split_at(scratch.light.len() - photons.len());
        let mut sum = Gradients { value: added, ..Gradients::default() };
        for (layer, light) in place.layers.iter().zip(by_rays.chunks_exact(rays)) {
            let more = place.hemisphere.gradients(light, &layer.distances[place.fan.clone()]);
            sum = sum.plus(&more.times(rays as f32));
        }
        for (&(at, photon), light) in photons.iter().zip(by_photons) {
            let normal = self.photons.list[photon].point.geometric_normal.into();
            place.hemisphere.add_place(&mut sum, *light, place.ways[at].direction.into(), normal);
        }
        (sum, changes)
    }

    /// The irradiance that a photon gives by itself, W/m².
    fn by_photon(&self, place: &Place, at: usize, photon: usize) -> Vec4 {
        let photon = &self.photons.list[photon];
        let way = Vec3::from(place.ways[at].direction);
        let squared = way.length_squared();
        let there = -way.dot(photon.point.geometric_normal.into());
        let shape = way.dot(place.hemisphere.normal()) * there / (squared * squared);
        let (by_rays, by_photons) = (shape * FRAC_1_PI, photon.density * place.ratio);
        photon.power * (shape * by_photons / ((by_rays + by_photons) * PI * place.photons.len() as f32))
    }
}
