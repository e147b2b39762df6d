//! What edits make of light between one row and each node of the gather tree, as a field that `Row` can be made of.

use super::importance::Importance;
use crate::Result;
use crate::kernels::average_pyramid;
use crate::memo::Key;
use crate::transport::edits::{Change, Transit};
use crate::transport::lighting::Stage;
use crate::transport::sampled::fit::fit_towards;
use crate::transport::sampled::patches::Patches;
use crate::transport::sampled::row::Field;
use glam::{Mat3, Vec3, Vec4};
use std::sync::Arc;

/// What fields of all rows share: light and casters by tree node.
pub struct Senders {
    pub patches: Arc<Patches>,
    /// Mean exitance of each of the 2M nodes, edits of columns included.
    pub light: Vec<Vec3>,
    /// Per edit of the middle: mean weight of its caster at each node; `None` is 1.
    pub caster: Vec<Option<Vec<f32>>>,
    /// Per node: all casters have one weight in it.
    pub is_pure: Vec<bool>,
    /// Nearest distance that falloff knows, metres.
    pub nearest: f32,
}

impl Senders {
    /// `sent`: exitance of the gather samples, edits of columns included.
    pub fn new(stage: &Stage, middle: &[&Transit], sent: &[[f32; 4]]) -> Result<Self> {
        let gather = &stage.transfer.gather;
        let key = Key::of(&[b"patches", &stage.place.0]);
        let patches = stage.memo.remember(key, Patches::bytes, || Ok(Patches::new(&gather.points)))?;
        let mut is_pure = vec![true; 2 * gather.count()];
        let mut caster = Vec::new();
        for edit in middle {
            caster.push(match &edit.block.caster {
                Some(selection) => Some(means(&stage.at_gather(selection)?, &mut is_pure)),
                None => None,
            });
        }
        let light = average_pyramid(stage.device, sent, 1)?;
        let light = light.into_iter().map(|light| Vec4::from_array(light).truncate()).collect();
        Ok(Self { patches, light, caster, is_pure, nearest: gather.spacing() })
    }
}

/// Means of weights over every node; nodes where they differ are pure no more.
fn means(weights: &[f32], is_pure: &mut [bool]) -> Vec<f32> {
    let count = weights.len();
    let mut nodes = vec![0.0; count];
    nodes.extend_from_slice(weights);
    let mut ranges: Vec<[f32; 2]> = nodes.iter().map(|&weight| [weight; 2]).collect();
    for node in (1..count).rev() {
        nodes[node] = 0.5 * (nodes[2 * node] + nodes[2 * node + 1]);
        let ([a, b], [c, d]) = (ranges[2 * node], ranges[2 * node + 1]);
        ranges[node] = [a.min(c), b.max(d)];
        is_pure[node] &= ranges[node][1] - ranges[node][0] <= PURE;
    }
    nodes
}

/// Difference of weights that a node may have and still count as one.
const PURE: f32 = 1.0 / 256.0;

/// One edit of the middle.
pub enum Step {
    Colour(Mat3),
    Falloff {
        exponent: f32,
        distance: f32,
    },
    Directionality {
        axis: Vec3,
        amount: f32,
        focus: f32,
    },
    /// Adds paths; see `shadows`.
    Shadow,
}

impl Step {
    pub fn of(edit: &Transit) -> Self {
        match edit.change {
            Change::Colour(ref colour) => Self::Colour(colour.matrix()),
            Change::Falloff { exponent, distance } => Self::Falloff { exponent, distance },
            Change::Directionality { axis, amount, focus } => Self::Directionality { axis, amount, focus },
            Change::Shadow { .. } => Self::Shadow,
        }
    }
}

/// `S - 1` of one row.
pub struct PathField<'a> {
    pub senders: &'a Senders,
    pub steps: &'a [Step],
    /// Of each step, at the row: weight of its receiver, and gain of its curve.
    pub weights: &'a [f32],
    pub gains: Vec<f32>,
    /// Where the row is.
    pub point: Vec3,
    /// Relative change of the field that a piece may have, when all of the row's light comes from it; with the square
    /// root of its share less.
    pub slack: f32,
    /// What the row receives from each node; `None` for a row of many places.
    pub importance: Option<&'a mut Importance>,
    /// Per node: how much the colour part of the class varies in it.
    pub variation: &'a [f32],
}

impl PathField<'_> {
    /// Light of the node after all steps, beside as it was, and what becomes of grey light.
    pub fn edited(&self, node: usize) -> (Vec3, Vec3, f32) {
        let original = self.senders.light[node];
        let (mut light, mut grey) = (original, 1.0);
        let to = self.senders.patches.centre[node] - self.point;
        for (s, step) in self.steps.iter().enumerate() {
            let weight = self.weights[s] * self.senders.caster[s].as_ref().map_or(1.0, |caster| caster[node]);
            if weight == 0.0 {
                continue;
            }
            let factor = match step {
                Step::Colour(matrix) => {
                    let changed = *matrix * light * self.gains[s];
                    light += (changed - light) * weight;
                    // Hue and saturation leave grey as it is.
                    grey *= 1.0 + weight * ((*matrix * Vec3::ONE).x * self.gains[s] - 1.0);
                    continue;
                }
                Step::Falloff { exponent, distance } => {
                    (to.length().max(self.senders.nearest) / distance).powf(2.0 - exponent)
                }
                Step::Directionality { axis, amount, focus } => {
                    let half = (0.5 + 0.5 * to.normalize_or_zero().dot(*axis)).max(0.0);
                    1.0 + amount * ((focus + 1.0) * half.powf(*focus) - 1.0)
                }
                Step::Shadow => continue,
            };
            light *= 1.0 + weight * (factor - 1.0);
            grey *= 1.0 + weight * (factor - 1.0);
        }
        (original, light, grey)
    }

    /// How much the field of a row without path edits varies over each node: the range of any channel.
    pub fn variation(&self) -> Vec<f32> {
        let count = self.senders.patches.count();
        let grey =
            |step: &Step| !matches!(step, Step::Colour(matrix) if *matrix != Mat3::from_diagonal(matrix.diagonal()));
        if self.steps.iter().all(grey) {
            // What is left to vary is whether an edit acts, and `Senders::is_pure` knows that.
            return vec![0.0; 2 * count];
        }
        let mut ranges: Vec<[Vec3; 2]> = vec![[Vec3::ZERO; 2]; count];
        ranges.extend((count..2 * count).map(|leaf| [self.value(leaf); 2]));
        for node in (1..count).rev() {
            let ([a, b], [c, d]) = (ranges[2 * node], ranges[2 * node + 1]);
            ranges[node] = [a.min(c), b.max(d)];
        }
        ranges.iter().map(|[low, high]| (*high - *low).max_element()).collect()
    }

    /// How much path edits vary over a node, relative to their value.
    fn bend(&self, node: usize) -> f32 {
        let radius = self.senders.patches.radius[node];
        let distance = (self.senders.patches.centre[node] - self.point).length();
        let wide = radius / (distance - radius).max(self.senders.nearest);
        let each = self.steps.iter().enumerate().map(|(s, step)| {
            let acts = self.weights[s] > 0.0 && self.senders.caster[s].as_ref().is_none_or(|caster| caster[node] > 0.0);
            match step {
                Step::Falloff { exponent, .. } if acts => (2.0 - exponent).abs() * wide,
                Step::Directionality { amount, focus, .. } if acts => amount * focus * wide,
                _ => 0.0,
            }
        });
        each.sum()
    }

    fn value(&self, node: usize) -> Vec3 {
        let (original, edited, grey) = self.edited(node);
        fit_towards(original, edited, grey).0 - Vec3::ONE
    }
}

/// The share of a node where it is not known.
const MIDDLING: f32 = 0.01;
/// A node that sends less than that is one piece whatever is in it.
const UNSEEN: f32 = 1e-6;

impl Field for PathField<'_> {
    fn constant(&mut self, node: usize) -> Option<Vec3> {
        let share = self.importance.as_ref().map_or(MIDDLING, |importance| importance.share(node));
        let limit = self.slack / share.max(1e-6).sqrt();
        let varies = if self.senders.is_pure[node] { self.variation[node] + self.bend(node) } else { f32::INFINITY };
        if varies <= limit || (share < UNSEEN && self.importance.is_some()) {
            return Some(self.value(node));
        }
        if let Some(importance) = &mut self.importance {
            importance.enter(node);
        }
        None
    }

    fn leaf(&mut self, node: usize) -> Vec3 {
        self.value(node)
    }
}
