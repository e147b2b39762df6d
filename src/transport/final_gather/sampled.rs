//! Sampled edits at any place, whatever view and resolution they were sampled for (thesis 5.5.3, Algorithm 12, figure 5.4):
//! a place takes its rows from the three nearest view samples, a ray its scale from the nearest gather sample.

use super::edited_view::EditedView;
use super::incident::{Incident, Leaving};
use super::pieces::Pieces;
use crate::Result;
use crate::memo::{Key, Memo};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::sample_cells::NearestSample;
use crate::transport::sampled::apply::offset_product;
use crate::transport::sampled::{NOWHERE, Sampled, UNTOUCHED, Vectors};
use crate::transport::sides::live_sides;
use bytemuck::cast_slice;
use glam::Vec4;
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

pub struct SampledEdits<'a> {
    geometry: &'a Geometry,
    sampled: &'a Sampled,
    nearest: Arc<NearestSample>,
    view: EditedView<'a>,
    /// Rows as they are asked for.
    pieces: Vec<OnceLock<Pieces>>,
    /// Of each offset row, irradiance that it adds, W/m²; empty for none.
    added: Vec<Vec4>,
}

/// The rows of a place, and how much each counts.
#[derive(Clone, Debug, Default)]
pub struct Mix {
    rows: Vec<(u32, f32)>,
}

impl Mix {
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

impl<'a> SampledEdits<'a> {
    /// # Errors
    /// The edits were sampled for another scene.
    pub fn new(geometry: &'a Geometry, sampled: &'a Sampled, memo: &dyn Memo) -> Result<Self> {
        sampled.check_scene(geometry)?;
        // Other edits of the same samples share them.
        let (gather, view) = (&sampled.gather, &sampled.view);
        let addresses: [&[u8]; 3] =
            [cast_slice(&gather.side), cast_slice(&gather.barycentrics), cast_slice(&view.side)];
        let key = Key::of(&[b"nearest samples", &geometry.fingerprint, addresses[0], addresses[1], addresses[2]]);
        let nearest = memo.remember(key, NearestSample::bytes, || {
            let mut sides: Vec<u32> = view.side.iter().copied().filter(|side| *side != NOWHERE).collect();
            sides.par_sort_unstable();
            sides.dedup();
            let middle = |side: &u32| geometry.surface_point((side / 2) as usize, 0.33, 0.33, side.is_multiple_of(2));
            let seen: Vec<SurfacePoint> = sides.iter().map(middle).collect();
            let live = live_sides(geometry, &seen, memo)?;
            Ok(NearestSample::new(geometry, &live, &gather.side, &gather.barycentrics))
        })?;
        let view = EditedView::new(geometry, sampled);
        let pieces = (0..sampled.rows()).map(|_| OnceLock::new()).collect();
        Ok(Self { geometry, sampled, nearest, view, pieces, added: Vec::new() })
    }

    pub fn changes_source(&self) -> bool {
        self.sampled.source.scale.is_some() || self.sampled.source.offset.is_some()
    }

    /// Changes light where it leaves a surface, by the gather sample nearest to there.
    pub fn at_source(&self, samples: &[Option<u32>], leaving: &mut Leaving) {
        if !self.changes_source() {
            return;
        }
        let source = &self.sampled.source;
        let light = leaving.from_lamps.par_iter_mut().zip(&mut leaving.from_others).zip(samples).with_min_len(4096);
        light.for_each(|((lamps, others), sample)| {
            let (scale, offset) = at(source, *sample);
            *lamps = (*lamps * scale).with_w(lamps.w);
            *others = *others * scale + offset;
        });
    }

    /// The gather samples nearest to N places, those that are `asked` for.
    pub fn samples(
        &self,
        points: &[SurfacePoint],
        barycentrics: &[[f32; 2]],
        asked: impl Fn(usize) -> bool + Sync,
    ) -> Vec<Option<u32>> {
        let each = points.par_iter().zip(barycentrics).enumerate().with_min_len(1024);
        each.map(|(i, (point, at))| if asked(i) { self.nearest.at(self.geometry, point, *at) } else { None }).collect()
    }

    pub fn changes_transit(&self) -> bool {
        !self.sampled.touched.is_empty()
    }

    /// What offset rows add comes from all surfaces, seen or not: `incident` says how bright they are.
    pub fn add_offsets(&mut self, incident: &Incident) -> Result<()> {
        let Some(offsets) = &self.sampled.offsets else { return Ok(()) };
        let points = self.nearest.points().to_vec();
        let mut leaving = incident.light(points, &self.sampled.gather.barycentrics, 0)?;
        let samples: Vec<Option<u32>> = (0..self.nearest.points().len() as u32).map(Some).collect();
        self.at_source(&samples, &mut leaving);
        let all = leaving.from_lamps.iter().zip(&leaving.from_others);
        let exitance: Vec<[f32; 4]> = all.map(|(a, b)| (a.with_w(0.0) + *b).to_array()).collect();
        let added = offset_product(incident.device, offsets, &exitance, 1)?;
        self.added = added.into_iter().map(Vec4::from_array).collect();
        Ok(())
    }

    /// How much of the edits there is at a place: what `mix` counts together.
    pub fn amount(&self, place: &SurfacePoint) -> f32 {
        self.view.amount(place)
    }

    /// The rows of a place: of its three nearest view samples, each by its barycentric weight.
    pub fn mix(&self, place: &SurfacePoint) -> Mix {
        let mut mix = Mix::default();
        // Rows of a place are those of its own object.
        if !place.exists() || !self.view.touches(place.object) {
            return mix;
        }
        let reach = self.view.reach(place);
        for (sample, share) in reach.samples.into_iter().zip(reach.weights).filter(|(_, share)| *share > 0.0) {
            let Ok(touched) = self.sampled.touched.binary_search(&sample) else { continue };
            for (row, weight) in self.sampled.slots[touched].into_iter().zip(self.sampled.weights[touched]) {
                if row == UNTOUCHED || weight == 0.0 {
                    continue;
                }
                match mix.rows.iter_mut().find(|known| known.0 == row) {
                    Some(known) => known.1 += share * weight,
                    None => mix.rows.push((row, share * weight)),
                }
            }
        }
        mix
    }

    /// `S - 1` of a place over gather samples.
    pub fn scales(&self, mix: &Mix) -> Pieces {
        let pieces =
            |row: u32| self.pieces[row as usize].get_or_init(|| Pieces::of(&self.sampled.scales, row as usize));
        let parts: Vec<(&Pieces, f32)> = mix.rows.iter().map(|(row, weight)| (pieces(*row), *weight)).collect();
        Pieces::sum(&parts)
    }

    /// Irradiance that offset rows add at a place, W/m².
    pub fn added(&self, mix: &Mix) -> Vec4 {
        mix.rows.iter().filter_map(|(row, weight)| Some(*self.added.get(*row as usize)? * *weight)).sum()
    }

    /// Changes radiance from surface points to the camera.
    pub fn at_eye(&self, points: &[SurfacePoint], radiance: &mut [[f32; 4]]) {
        let eye = &self.sampled.eye;
        if eye.scale.is_none() && eye.offset.is_none() {
            return;
        }
        radiance.par_iter_mut().zip(points).with_min_len(1024).for_each(|(light, point)| {
            let reach = self.view.reach(point);
            let (mut scale, mut offset, mut all) = (Vec4::ZERO, Vec4::ZERO, 0.0);
            for (sample, share) in reach.samples.into_iter().zip(reach.weights) {
                let (s, o) = at(eye, Some(sample));
                (scale, offset, all) = (scale + s * share, offset + o * share, all + share);
            }
            if all > 0.0 {
                *light = (Vec4::from_array(*light) * scale + offset).to_array();
            }
        });
    }
}

fn at(vectors: &Vectors, sample: Option<u32>) -> (Vec4, Vec4) {
    let of = |vector: &Option<crate::device::Array<[f32; 4]>>| {
        Some(Vec4::from_array(vector.as_ref()?[sample? as usize]).with_w(0.0))
    };
    (of(&vectors.scale).unwrap_or(Vec4::ONE), of(&vectors.offset).unwrap_or(Vec4::ZERO))
}
