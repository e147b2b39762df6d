//! What glossy surfaces reflect to the eye: rays drawn from their lobes, light at what these meet (thesis 5.3: the last
//! bounce may be glossy).
//!
//! The eye stands still, so reflected radiance is a function of the place alone, and is cached as irradiance is; it changes
//! as fast as the lobe is narrow, until each sample gathers for itself.

use super::crossing::{Crossing, Rows, Scratch};
use super::gatherer::{Gathered, Gatherer, Gathers, Places};
use super::hemisphere::Hemisphere;
use super::incident::Incident;
use super::transit::{Arrivals, weights};
use crate::Result;
use crate::kernels::glossy_rows::View;
use crate::kernels::trace_rays::{RayRecord, trace_rays};
use crate::progress::Stage;
use crate::transport::light_cache::Gradients;
use crate::transport::sampling;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// Rays that say the gains of curves at a place, at least.
const GAIN_RAYS: u32 = 256;
/// How far a record counts, over what it would for diffuse light, of a lobe as wide as 1.
const SPREAD: f32 = 2.5;

pub struct Reflections<'a> {
    pub incident: &'a Incident<'a>,
    /// Of irradiance, which says the gains of curves.
    pub irradiance: &'a Gatherer<'a>,
    pub crossing: &'a Crossing<'a>,
    pub eye: Vec3,
    /// `Material::gloss` of each.
    pub gloss: &'a [[f32; 4]],
}

/// Width of a lobe, as `kernels::direct_light` has it.
fn alpha(gloss: &[f32; 4]) -> f32 {
    (gloss[3] * gloss[3]).max(1e-3)
}

impl Reflections<'_> {
    fn batch(&self, places: &Places, rays: usize) -> Result<Vec<Gathered>> {
        let Incident { device, geometry, .. } = *self.incident;
        let mut cast = vec![RayRecord::NONE; places.points.len() * rays];
        // What light along each ray counts.
        let mut shares = vec![Vec4::ZERO; cast.len()];
        let fans = cast.par_chunks_mut(rays).zip(shares.par_chunks_mut(rays)).zip(places.points).zip(places.seeds);
        fans.for_each(|(((cast, shares), place), seed)| {
            let view = View::new(place, self.eye, geometry.lift());
            let gloss = &self.gloss[place.material as usize];
            let f0 = Vec4::new(gloss[0], gloss[1], gloss[2], 0.0);
            for (i, (cast, share)) in cast.iter_mut().zip(shares).enumerate() {
                let at = sampling::lattice(i as u32, rays as u32, sampling::shift(*seed));
                let Some((ray, [coloured, plain])) = view.reflected(place, alpha(gloss), at) else { continue };
                *cast = RayRecord::new(&ray);
                *share = (f0 * coloured + Vec4::new(plain, plain, plain, 0.0)) * (FRAC_1_PI / rays as f32);
            }
        });
        let traced = trace_rays(device, geometry, &cast)?;
        let samples = self.crossing.samples(places.receivers, &traced, rays);
        let casters = weights(self.crossing.transits.casters(), &traced.points);
        let mut leaving = self.incident.light(traced.points, &traced.barycentrics, places.seeds[0])?;
        if let Some(sampled) = &self.crossing.sampled {
            sampled.at_source(&samples, &mut leaving);
        }
        let count = self.crossing.receivers();
        // A curve says what becomes of light at the place, of which the eye sees a part: as in the preview.
        let gains = self.irradiance.gains(places, GAIN_RAYS.max(rays as u32))?;
        let sum = |(arrivals, scratch): &mut (Arrivals, Scratch), i: usize| {
            let (fan, place) = (i * rays..(i + 1) * rays, &places.points[i]);
            arrivals.clear();
            for ray in fan.clone() {
                let light = leaving.from_lamps[ray].with_w(0.0) + leaving.from_others[ray];
                arrivals.light.push(light * shares[ray]);
                arrivals.direction.push(cast[ray].direction.into());
                arrivals.distance.push(traced.distances[ray]);
                arrivals.seen.push(1.0);
            }
            let each = self.crossing.transits.casters().len();
            arrivals.casters.extend_from_slice(&casters[fan.start * each..fan.end * each]);
            let samples = samples.get(fan.clone()).unwrap_or(&[]);
            let receivers = &places.receivers[i * count..][..count];
            // What is added is diffuse light: it is not reflected, as in the preview.
            let rows = self.crossing.rows(place).map(|rows| Rows { added: Vec4::ZERO, ..rows });
            let gains = Some(&gains[i][..]).filter(|gains| !gains.is_empty());
            let (_, changes) = self.crossing.edit(arrivals, samples, receivers, rows.as_ref(), gains, scratch);
            let light = Gradients { value: scratch.light.iter().sum(), ..Gradients::default() };
            let width = alpha(&self.gloss[place.material as usize]);
            // What is reflected moves with the eye's parallax, too.
            let eye = Vec3::from(place.position).distance(self.eye);
            let reach = Hemisphere::reach(&traced.distances[fan]);
            let reach = reach.map(|reach| (SPREAD * width).min(1.0) / (1.0 / reach + 1.0 / eye));
            Gathered { light, changes, reach, bend: (1.0 / (SPREAD * width)).max(1.0) }
        };
        let all = (0..places.points.len()).into_par_iter();
        Ok(all.map_init(<(Arrivals, Scratch)>::default, sum).collect())
    }
}

impl Gathers for Reflections<'_> {
    fn gather(&self, places: &Places, rays: u32, stage: &Stage) -> Result<Vec<Gathered>> {
        let mut all = Vec::with_capacity(places.points.len());
        for places in places.batches(rays) {
            all.extend(self.batch(&places, rays as usize)?);
            stage.advance(u64::from(rays) * places.points.len() as u64)?;
        }
        Ok(all)
    }
}
