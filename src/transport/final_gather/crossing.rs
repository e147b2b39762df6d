//! All that changes light between surfaces and places: the edits of a list in transit, procedural and sampled.

use super::incident::Incident;
use super::pieces::Pieces;
use super::sampled::SampledEdits;
use super::transit::{Arrivals, Gains, Transits, weights};
use crate::kernels::trace_rays::Traced;
use crate::memo::Memo;
use crate::scene::SurfacePoint;
use crate::transport::Edits;
use crate::{Error, Result};
use glam::Vec4;
use rayon::prelude::*;

pub struct Crossing<'a> {
    pub transits: Transits<'a>,
    pub sampled: Option<SampledEdits<'a>>,
}

/// What sampled edits say of a place.
pub struct Rows {
    /// `S - 1` over gather samples.
    pub scales: Pieces,
    /// Irradiance that comes from nowhere in particular, W/m².
    pub added: Vec4,
}

impl Rows {
    /// Scales light that comes from these gather samples.
    fn scale(&self, light: &mut [Vec4], samples: &[Option<u32>]) {
        for (light, sample) in light.iter_mut().zip(samples) {
            if let Some(sample) = sample {
                *light += *light * self.scales.at(*sample).extend(0.0);
            }
        }
    }
}

/// Vectors that are used again for every place.
#[derive(Default)]
pub struct Scratch {
    /// What the edits make of each arrival, W/m².
    pub light: Vec<Vec4>,
    other: Vec<Vec4>,
    seen: Vec<f32>,
}

impl<'a> Crossing<'a> {
    /// # Errors
    /// Edits of another scene, or several sampled ones in one list; edits of paths with sampled ones.
    pub fn new(incident: &Incident<'a>, edits: &'a Edits, memo: &dyn Memo) -> Result<Self> {
        edits.check(&incident.geometry.fingerprint)?;
        let mut sampled = None;
        if let Some(found) = edits.sampled().next() {
            if edits.transit().any(|edit| !edit.is_colour()) {
                return Err(Error::compute(
                    "falloff, indirect_shadow and directionality do not act on sampled edits",
                    "put them before scale_offset, so that they are sampled with the others",
                ));
            }
            let mut rows = SampledEdits::new(incident.geometry, found, memo)?;
            rows.add_offsets(incident)?;
            sampled = Some(rows);
        }
        Ok(Self { transits: Transits::new(incident.geometry, edits), sampled })
    }

    fn by_rows(&self) -> Option<&SampledEdits<'a>> {
        self.sampled.as_ref().filter(|sampled| sampled.changes_transit())
    }

    /// Weights that tell places apart: of each receiver, and of sampled edits.
    pub fn receivers(&self) -> usize {
        self.transits.receivers().len() + usize::from(self.by_rows().is_some())
    }

    /// The receivers' weights at N places, those of a place one after another.
    pub fn weights(&self, points: &[SurfacePoint]) -> Vec<f32> {
        let procedural = weights(self.transits.receivers(), points);
        let Some(sampled) = self.by_rows() else { return procedural };
        let amounts: Vec<f32> = points.par_iter().with_min_len(256).map(|point| sampled.amount(point)).collect();
        let count = self.transits.receivers().len();
        if count == 0 {
            return amounts;
        }
        let mut all = Vec::with_capacity(points.len() * (count + 1));
        for (i, amount) in amounts.into_iter().enumerate() {
            all.extend_from_slice(&procedural[i * count..][..count]);
            all.push(amount);
        }
        all
    }

    pub fn rows(&self, place: &SurfacePoint) -> Option<Rows> {
        let sampled = self.by_rows()?;
        let mix = sampled.mix(place);
        if mix.is_empty() {
            return None;
        }
        let (scales, added) = (sampled.scales(&mix), sampled.added(&mix));
        Some(Rows { scales, added })
    }

    /// Light at a place arrives there as it is.
    pub fn spares(&self, receivers: &[f32]) -> bool {
        receivers.iter().all(|weight| *weight == 0.0) && !self.transits.reaches(receivers)
    }

    /// The gather samples nearest to what the rays of places met, `rays` a place, where sampled edits ask for them;
    /// `receivers`: of all places.
    pub fn samples(&self, receivers: &[f32], traced: &Traced, rays: usize) -> Vec<Option<u32>> {
        let Some(sampled) = &self.sampled else { return Vec::new() };
        let (everywhere, count) = (sampled.changes_source(), self.receivers());
        let asks = |place: usize| everywhere || self.by_rows().is_some() && receivers[(place + 1) * count - 1] != 0.0;
        let asks: Vec<bool> = (0..traced.points.len() / rays).map(asks).collect();
        if !asks.contains(&true) {
            return Vec::new();
        }
        sampled.samples(&traced.points, &traced.barycentrics, |ray| asks[ray / rays])
    }

    /// Edits what arrives at a place, into `scratch.light`; gives what is added from nowhere in particular, W/m², and the
    /// derivative of all by the weight of each receiver that it is in. `samples`: the gather sample nearest to where each
    /// arrival comes from, where sampled edits ask for it; `gains`: of the curves, where other light says them.
    pub fn edit(
        &self,
        arrivals: &Arrivals,
        samples: &[Option<u32>],
        receivers: &[f32],
        rows: Option<&Rows>,
        gains: Option<&[f32]>,
        scratch: &mut Scratch,
    ) -> (Vec4, Vec<Vec4>) {
        let Scratch { light, other, seen } = scratch;
        let count = self.transits.receivers().len();
        let (procedural, amount) = (&receivers[..count], receivers.get(count).copied().unwrap_or(0.0));
        let gains = || gains.map_or(Gains::Own, Gains::Given);
        let set_out = |light: &mut Vec<Vec4>| {
            light.clone_from(&arrivals.light);
            if let Some(rows) = rows {
                rows.scale(light, samples);
            }
        };
        set_out(light);
        self.transits.apply(arrivals, procedural, light, seen, gains());
        let (sum, added) = (light.iter().sum::<Vec4>(), rows.map_or(Vec4::ZERO, |rows| rows.added));
        let mut changes = vec![Vec4::ZERO; receivers.len()];
        for e in (0..count).filter(|e| procedural[*e] != 0.0) {
            let mut moved = procedural.to_vec();
            moved[e] = if procedural[e] < 0.5 { 1.0 } else { 0.0 };
            set_out(other);
            self.transits.apply(arrivals, &moved, other, seen, gains());
            changes[e] = (other.iter().sum::<Vec4>() - sum) / (moved[e] - procedural[e]);
        }
        if amount != 0.0 {
            other.clone_from(&arrivals.light);
            self.transits.apply(arrivals, procedural, other, seen, gains());
            changes[count] = (sum + added - other.iter().sum::<Vec4>()) / amount;
        }
        (added, changes)
    }

    /// Gains of the curves by what arrives at a place, one an edit in transit; else as `edit`.
    pub fn gains(
        &self,
        arrivals: &Arrivals,
        samples: &[Option<u32>],
        receivers: &[f32],
        rows: Option<&Rows>,
        scratch: &mut Scratch,
    ) -> Vec<f32> {
        let (mut gains, Scratch { light, seen, .. }) = (Vec::new(), scratch);
        light.clone_from(&arrivals.light);
        if let Some(rows) = rows {
            rows.scale(light, samples);
        }
        let procedural = &receivers[..self.transits.receivers().len()];
        self.transits.apply(arrivals, procedural, light, seen, Gains::Told(&mut gains));
        gains
    }
}
