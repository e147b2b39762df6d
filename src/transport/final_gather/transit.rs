//! Edits of light on its way from what rays meet to a place (thesis 4.3, 5.4), ray by ray: the same list as the preview's
//! (`lighting::transit`), in its order, with no gather samples in between.
//!
//! A receiver's weight is not baked into what is gathered: what an edit does is kept beside the light, as the derivative
//! by each receiver's weight, so that a cache of few records shows edges as sharp as the selection's (see `cache`). That
//! is exact where one receiver changes at a time.

use crate::image::colour;
use crate::kernels::colour_edits::evaluate;
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::edits::{Change, Transit};
use crate::transport::{Edits, Selection};
use glam::{Vec3, Vec4};
use std::sync::Arc;

/// Gather samples that the preview has unless told otherwise: falloff counts light from nearer than their distance as from
/// there.
const PREVIEW_SAMPLES: f32 = 65536.0;

/// A list of edits between casters and receivers, made ready.
pub struct Transits<'a> {
    edits: Vec<&'a Transit>,
    /// Into `casters` and `receivers`; `None` is the whole scene.
    caster: Vec<Option<usize>>,
    receiver: Vec<Option<usize>>,
    casters: Vec<Arc<Selection>>,
    receivers: Vec<Arc<Selection>>,
    /// Falloff takes nothing for nearer, m.
    nearest: f32,
}

/// Light that arrives at a place, ray by ray.
#[derive(Clone, Default)]
pub struct Arrivals {
    /// What each adds to irradiance, W/m².
    pub light: Vec<Vec4>,
    /// From the place, unit; and how far, m.
    pub direction: Vec<Vec3>,
    pub distance: Vec<f32>,
    /// How much of it gets through what lies in between.
    pub seen: Vec<f32>,
    /// Weight of each caster, one after another.
    pub casters: Vec<f32>,
}

impl Arrivals {
    pub fn clear(&mut self) {
        let Self { light, direction, distance, seen, casters } = self;
        light.clear();
        direction.clear();
        distance.clear();
        seen.clear();
        casters.clear();
    }
}

/// Of the curves of a list at a place, one gain an edit; 1 where an edit has none, or does not reach the place.
pub enum Gains<'a> {
    /// Each curve asks the light that it acts on.
    Own,
    /// As `Own`, and they are told.
    Told(&'a mut Vec<f32>),
    /// By light other than that which is edited.
    Given(&'a [f32]),
}

fn numbered(list: &mut Vec<Arc<Selection>>, selection: &Option<Arc<Selection>>) -> Option<usize> {
    let selection = selection.as_ref()?;
    let known = list.iter().position(|known| known.digest() == selection.digest());
    Some(known.unwrap_or_else(|| {
        list.push(selection.clone());
        list.len() - 1
    }))
}

impl<'a> Transits<'a> {
    pub fn new(geometry: &Geometry, edits: &'a Edits) -> Self {
        let edits: Vec<&Transit> = edits.transit().collect();
        let (mut casters, mut receivers) = (Vec::new(), Vec::new());
        let caster = edits.iter().map(|edit| numbered(&mut casters, &edit.block.caster)).collect();
        let receiver = edits.iter().map(|edit| numbered(&mut receivers, &edit.block.receiver)).collect();
        let area: f32 = (0..geometry.corners.len()).map(|triangle| geometry.area(triangle)).sum();
        Self { edits, caster, receiver, casters, receivers, nearest: (area / PREVIEW_SAMPLES).sqrt() }
    }

    pub fn casters(&self) -> &[Arc<Selection>] {
        &self.casters
    }

    pub fn receivers(&self) -> &[Arc<Selection>] {
        &self.receivers
    }

    /// Light from behind what is seen may get through to a place.
    pub fn sees_through(&self, receivers: &[f32]) -> bool {
        let acts = |e: usize| self.receiver[e].is_none_or(|receiver| receivers[receiver] > 0.0);
        (0..self.edits.len()).any(|e| matches!(self.edits[e].change, Change::Shadow { .. }) && acts(e))
    }

    /// Some edit has a receiver that this one is.
    pub fn reaches(&self, receivers: &[f32]) -> bool {
        (0..self.edits.len()).any(|e| self.receiver[e].is_none_or(|receiver| receivers[receiver] > 0.0))
    }

    /// Some edit with a curve has a receiver that this one is.
    pub fn curve_at(&self, receivers: &[f32]) -> bool {
        let reaches = |e: usize| self.receiver[e].is_none_or(|receiver| receivers[receiver] > 0.0);
        (0..self.edits.len()).any(|e| self.edits[e].has_curve() && reaches(e))
    }

    /// Edits light that arrives, one each of `arrivals`, whose own may be another; `seen` is used again for every place.
    /// `receivers`: weight of each receiver at the place.
    pub fn apply(
        &self,
        arrivals: &Arrivals,
        receivers: &[f32],
        light: &mut [Vec4],
        seen: &mut Vec<f32>,
        mut gains: Gains,
    ) {
        seen.clone_from(&arrivals.seen);
        if let Gains::Told(gains) = &mut gains {
            gains.clear();
            gains.resize(self.edits.len(), 1.0);
        }
        let count = self.casters.len();
        for (e, edit) in self.edits.iter().enumerate() {
            let receiver = self.receiver[e].map_or(1.0, |receiver| receivers[receiver]);
            if receiver == 0.0 {
                continue;
            }
            let weight =
                |i: usize| receiver * self.caster[e].map_or(1.0, |caster| arrivals.casters[i * count + caster]);
            match &edit.change {
                Change::Falloff { exponent, distance } => {
                    for (i, light) in light.iter_mut().enumerate() {
                        let far = arrivals.distance[i].max(self.nearest) / distance;
                        *light *= 1.0 + weight(i) * (far.powf(2.0 - exponent).min(f32::MAX) - 1.0);
                    }
                }
                Change::Directionality { axis, amount, focus } => {
                    for (i, light) in light.iter_mut().enumerate() {
                        let half = (0.5 + 0.5 * arrivals.direction[i].dot(*axis)).max(0.0);
                        *light *= 1.0 + weight(i) * amount * ((focus + 1.0) * half.powf(*focus) - 1.0);
                    }
                }
                Change::Shadow { amount } => {
                    seen.iter_mut().enumerate().for_each(|(i, seen)| *seen += amount * weight(i) * (1.0 - *seen));
                }
                Change::Colour(change) => {
                    let (matrix, curve) = (change.matrix(), change.knots());
                    let by_own_light = || {
                        let caster = |i: usize| self.caster[e].map_or(1.0, |c| arrivals.casters[i * count + c]);
                        let all: Vec4 = light.iter().enumerate().map(|(i, light)| *light * (seen[i] * caster(i))).sum();
                        let luminance = colour::luminance(matrix * all.truncate());
                        if luminance > DARK { evaluate(&curve, luminance) / luminance } else { 1.0 }
                    };
                    let gain = match &mut gains {
                        Gains::Given(gains) => gains[e],
                        _ if curve.is_empty() => 1.0,
                        Gains::Own => by_own_light(),
                        Gains::Told(gains) => {
                            gains[e] = by_own_light();
                            gains[e]
                        }
                    };
                    let matrix = matrix * gain;
                    for (i, light) in light.iter_mut().enumerate() {
                        let weight = weight(i);
                        if weight > 0.0 {
                            let old = light.truncate();
                            *light = (old + (matrix * old - old) * weight).extend(0.0);
                        }
                    }
                }
            }
        }
        light.iter_mut().zip(&*seen).for_each(|(light, seen)| *light *= *seen);
    }
}

/// Luminance up to which there is no light to scale.
const DARK: f32 = 1e-20;

/// Weights of selections at points, those of a point one after another.
pub fn weights(selections: &[Arc<Selection>], points: &[SurfacePoint]) -> Vec<f32> {
    let mut all = vec![0.0; selections.len() * points.len()];
    for (number, selection) in selections.iter().enumerate() {
        let weights = selection.weights(points);
        all.iter_mut().skip(number).step_by(selections.len()).zip(weights).for_each(|(to, weight)| *to = weight);
    }
    all
}
