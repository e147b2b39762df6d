//! Light at some samples of a lane from some of the light, by way of edits that change paths one by one: falloff,
//! direction, and what lies in between.
//!
//! Such edits multiply (`Factors`) or add paths (hidden ones), so those of one list commute, and with colour edits that
//! are linear, too. Where an edit's receiver is soft, light splits: `1 - a` goes without the edit and `a` with it, which
//! is the expansion of the product over edits; hard receivers leave one branch at each sample.

use super::lane::{CutOut, Lane, Positions};
use super::{Leaving, Stage, VEC4};
use crate::device::Array;
use crate::kernels::{path_product, sparse_product};
use crate::memo::Key;
use crate::transport::edits::{Change, Transit};
use crate::transport::hidden::{Hidden, LAYERS, hidden_rows};
use crate::transport::sampled::apply::{self, Plan, Slots};
use crate::transport::transfer::Basis;
use crate::transport::ways::Factors;
use crate::transport::{Sampled, Selection, SparseRows};
use crate::{Error, Result};
use glam::Vec4;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Different receivers of path edits that may act on one part of the light.
const MOST: usize = 128;
/// Soft ones of these that may meet at one sample: each doubles the work there.
const MOST_SOFT: usize = 8;

/// Share of each gather sample's light, and what names it; `None` is all of the light.
pub type Shares<'a> = Option<(&'a [f32], Key)>;

/// Some light, on its way to some samples.
pub struct Paths<'a> {
    pub stage: &'a Stage<'a>,
    pub lane: &'a Lane<'a>,
    pub leaving: &'a Leaving,
    pub shares: Shares<'a>,
    /// Edits of the matrix that come before all others.
    pub sampled: Option<&'a Sampled>,
}

impl Paths<'_> {
    /// What arrives at `positions` of the lane (`None`: all of it) through path edits; one element a position.
    pub fn light(&self, edits: &[&Transit], positions: Option<&Positions>) -> Result<Arc<Vec<[f32; 4]>>> {
        let keys: Vec<[u8; 16]> = edits.iter().map(|edit| edit_key(edit).0).collect();
        let key = self.key(b"light", &[bytemuck::cast_slice(&keys), bytes_of(positions)]);
        let bytes = |light: &Vec<[f32; 4]>| VEC4 * light.len() as u64;
        self.stage.memo.remember(key, bytes, || {
            let count = positions.map_or(self.lane.count(), |positions| positions.len());
            let receivers = Receivers::new(self.stage, self.lane, edits, positions)?;
            if receivers.weights.is_empty() {
                return self.branch(edits, positions);
            }
            let mut total = vec![[0.0; 4]; count];
            for (branch, (places, weights)) in receivers.branches(count)? {
                let chosen: Vec<&Transit> = receivers.edits_of(edits, branch);
                if places.len() == count && weights.iter().all(|&weight| weight == 1.0) {
                    return self.branch(&chosen, positions);
                }
                let lane_places: Vec<u32> =
                    places.iter().map(|&i| positions.map_or(i, |positions| positions[i as usize])).collect();
                let lane_places = Arc::new(lane_places);
                // Kept by itself: the slider of an edit does not change the branches that go without it.
                let keys: Vec<[u8; 16]> = chosen.iter().map(|edit| edit_key(edit).0).collect();
                let key = self.key(b"branch", &[bytemuck::cast_slice(&keys), bytemuck::cast_slice(&lane_places)]);
                let arriving = self.stage.memo.remember(key, bytes, || self.branch(&chosen, Some(&lane_places)))?;
                for ((&i, weight), light) in places.iter().zip(weights).zip(arriving.iter()) {
                    let sum = Vec4::from_array(total[i as usize]) + Vec4::from_array(*light) * weight;
                    total[i as usize] = sum.to_array();
                }
            }
            Ok(total)
        })
    }

    fn key(&self, name: &[u8], parts: &[&[u8]]) -> Key {
        let shares = self.shares.map_or([0; 16], |(_, key)| key.0);
        let sampled = self.sampled.map_or([0; 16], |sampled| sampled.digest());
        let own = [name, &self.lane.key.0, &self.leaving.key.0, &shares, &sampled];
        Key::of(&own.into_iter().chain(parts.iter().copied()).collect::<Vec<_>>())
    }

    /// The same where every edit of the list acts in full.
    fn branch(&self, edits: &[&Transit], positions: Option<&Positions>) -> Result<Vec<[f32; 4]>> {
        let Self { stage, lane, shares, sampled, .. } = self;
        if let Some(sampled) = sampled {
            return self.through(sampled, edits, positions);
        }
        let cut = CutOut::new(stage, lane, positions, *shares)?;
        let encoded = stage.transfer.encode(stage.device, &self.exitance(), 1)?;
        let factors = factors(edits, stage.transfer.gather.spacing());
        let mut rows = self.product(&cut, &cut.rows, b"seen", factors.as_ref(), &encoded)?;
        let amount = unhidden(edits);
        if amount > 0.0 && lane.sees_through {
            let hidden = cut.rows_of(&self.hidden(&cut)?.rows)?;
            let more = self.product(&cut, &hidden, b"hidden", factors.as_ref(), &encoded)?;
            rows.iter_mut().zip(more).for_each(|(sum, more)| {
                *sum = (Vec4::from_array(*sum) + Vec4::from_array(more) * amount).to_array();
            });
        }
        cut.interpolate(stage, &rows)
    }

    /// The light, as it leaves the gather samples.
    fn exitance(&self) -> Cow<'_, [[f32; 4]]> {
        let exitance = &self.leaving.exitance;
        match self.shares {
            None => Cow::Borrowed(exitance),
            Some((shares, _)) => {
                Cow::Owned(exitance.iter().zip(shares).map(|(b, s)| (Vec4::from_array(*b) * *s).to_array()).collect())
            }
        }
    }

    /// By way of sampled edits.
    fn through(&self, sampled: &Sampled, edits: &[&Transit], positions: Option<&Positions>) -> Result<Vec<[f32; 4]>> {
        let Stage { device, transfer, .. } = *self.stage;
        if !edits.is_empty() {
            let message = "falloff, indirect_shadow and directionality do not act on sampled edits";
            return Err(Error::compute(
                message,
                "put them before scale_offset, so that they are sampled with the others",
            ));
        }
        let light = self.exitance();
        let whole = Paths { sampled: None, ..*self }.light(&[], None)?.to_vec();
        let (slots, added) = match self.lane.samples {
            None => (Slots::diffuse(sampled, transfer), sampled.offsets.as_ref()),
            Some(samples) => {
                let Lane { rows, indices, weights, .. } = self.lane;
                (Slots::other(sampled, rows, samples, indices, weights), None)
            }
        };
        let added = added.map(|added| apply::offset_product(device, added, &light, 1)).transpose()?.unwrap_or_default();
        let plan = self.plan(&slots, sampled)?;
        let all = apply::through(device, transfer, &slots, sampled, &plan, &light, whole, &added)?;
        Ok(match positions {
            None => all,
            Some(positions) => positions.iter().map(|&position| all[position as usize]).collect(),
        })
    }

    fn plan(&self, slots: &Slots, sampled: &Sampled) -> Result<Arc<Plan>> {
        let key = Key::of(&[b"pairs", &self.lane.key.0, &sampled.digest()]);
        self.stage.memo.remember(key, Plan::bytes, || Plan::new(slots, self.stage.transfer))
    }

    /// Light at rows that are laid out as those of the cut-out.
    fn product(
        &self,
        cut: &CutOut,
        rows: &SparseRows,
        name: &[u8],
        factors: Option<&Factors>,
        encoded: &[[f32; 4]],
    ) -> Result<Vec<[f32; 4]>> {
        let stage = self.stage;
        match factors {
            None => sparse_product(stage.device, rows, encoded, 1),
            Some(factors) => {
                if stage.transfer.settings.basis != Basis::Cut {
                    return Err(Error::compute(
                        "falloff and directionality change paths, and rows of basis \"haar\" hold no paths",
                        "give the transfer the basis \"cut\"",
                    ));
                }
                let ways = cut.ways(stage, self.lane, rows, name)?;
                path_product(stage.device, rows, &ways, factors, encoded)
            }
        }
    }

    /// What the view does not see of the light's senders, at the cut-out's rows.
    fn hidden(&self, cut: &CutOut) -> Result<Arc<Hidden>> {
        let stage = self.stage;
        let transfer = stage.transfer;
        stage.memo.keep(Key::of(&[b"hidden", &cut.key.0]), Hidden::bytes, || {
            let everywhere = vec![1.0; transfer.gather.count()];
            let senders = self.shares.map_or(&everywhere[..], |(shares, _)| shares);
            let wanted = cut.is_of(transfer.rows.rows());
            let hidden = hidden_rows(stage.device, stage.geometry, transfer, senders, &wanted, stage.progress)?;
            if hidden.dropped > 0 {
                tracing::warn!("{} hits behind more than {LAYERS} surfaces of a caster are left out", hidden.dropped);
            }
            Ok(hidden)
        })
    }
}

fn bytes_of(positions: Option<&Positions>) -> &[u8] {
    positions.map_or(b"all", |positions| bytemuck::cast_slice(positions))
}

/// Names a path edit, its receiver included; whose light it acts on is for the caller to say.
fn edit_key(edit: &Transit) -> Key {
    let numbers: Vec<f32> = match &edit.change {
        Change::Falloff { exponent, distance } => vec![0.0, *exponent, *distance],
        Change::Shadow { amount } => vec![1.0, *amount],
        Change::Directionality { axis, amount, focus } => vec![2.0, axis.x, axis.y, axis.z, *amount, *focus],
        Change::Colour(_) => unreachable!("colours do not change paths"),
    };
    let receiver = edit.block.receiver.as_ref().map_or([0; 16], |receiver| receiver.digest());
    Key::of(&[bytemuck::cast_slice(&numbers), &receiver])
}

/// Share of what is hidden that a list lets through: each edit a share of what those before it left.
fn unhidden(edits: &[&Transit]) -> f32 {
    let kept = edits.iter().map(|edit| match edit.change {
        Change::Shadow { amount } => 1.0 - amount,
        _ => 1.0,
    });
    1.0 - kept.product::<f32>()
}

/// All factors of a list; `None` when nothing in it multiplies. Light from nearer than `nearest` metres counts as from
/// there: gather samples say no more, and steep falloffs would have no bound.
fn factors(edits: &[&Transit], nearest: f32) -> Option<Factors> {
    let mut factors = None;
    for edit in edits {
        match edit.change {
            Change::Falloff { exponent, distance } => {
                let all: &mut Factors = factors.get_or_insert_default();
                all.by_distance(|d| (d.max(nearest) / distance).powf(2.0 - exponent).min(f32::MAX));
            }
            Change::Directionality { axis, amount, focus } => {
                let all: &mut Factors = factors.get_or_insert_default();
                all.by_direction(|v| {
                    let half = 0.5 + 0.5 * v.dot(axis);
                    1.0 + amount * ((focus + 1.0) * half.max(0.0).powf(focus) - 1.0)
                });
            }
            Change::Shadow { .. } | Change::Colour(_) => {}
        }
    }
    factors
}

/// Per set of receivers that act (bit r for receiver r): places, and how much of the light there takes the branch.
type Branches = BTreeMap<u128, (Vec<u32>, Vec<f32>)>;

/// The receivers that a list of edits tells apart.
struct Receivers {
    /// Per receiver, weights at the positions.
    weights: Vec<Array<f32>>,
    /// Receiver of each edit; `None` is everywhere.
    of: Vec<Option<usize>>,
}

impl Receivers {
    fn new(stage: &Stage, lane: &Lane, edits: &[&Transit], positions: Option<&Positions>) -> Result<Self> {
        let mut digests = Vec::new();
        let mut all = Self { weights: Vec::new(), of: Vec::new() };
        for edit in edits {
            let Some(receiver) = &edit.block.receiver else {
                all.of.push(None);
                continue;
            };
            let digest = receiver.digest();
            let known = digests.iter().position(|known| *known == digest);
            all.of.push(Some(known.unwrap_or(digests.len())));
            if known.is_none() {
                digests.push(digest);
                all.weights.push(at_positions(stage, lane, receiver, positions)?);
            }
        }
        if all.weights.len() > MOST {
            let message =
                format!("path edits with {} different receivers act on one part of the light", all.weights.len());
            return Err(Error::compute(message, format!("use at most {MOST}, or one receiver for several edits")));
        }
        Ok(all)
    }

    /// The edits that act in a branch: bit r says whether those of receiver r do.
    fn edits_of<'e>(&self, edits: &[&'e Transit], branch: u128) -> Vec<&'e Transit> {
        let acts = |receiver: &Option<usize>| receiver.is_none_or(|r| branch >> r & 1 == 1);
        edits.iter().zip(&self.of).filter(|(_, receiver)| acts(receiver)).map(|(edit, _)| *edit).collect()
    }

    /// The branches that light takes at some sample: where, and how much of it.
    fn branches(&self, count: usize) -> Result<Branches> {
        let mut branches = Branches::new();
        let mut soft: Vec<(usize, f32)> = Vec::with_capacity(MOST_SOFT);
        for i in 0..count {
            let mut always = 0u128;
            soft.clear();
            for (r, weight) in self.weights.iter().map(|weights| weights[i]).enumerate() {
                match weight {
                    1.0.. => always |= 1 << r,
                    weight if weight > 0.0 => soft.push((r, weight)),
                    _ => {}
                }
            }
            if soft.len() > MOST_SOFT {
                let message = format!("soft receivers of {} path edits meet at one point", soft.len());
                return Err(Error::compute(message, format!("let at most {MOST_SOFT} overlap, or harden their edges")));
            }
            for choice in 0..1u32 << soft.len() {
                let takes = |j: usize| choice >> j & 1 == 1;
                let branch =
                    soft.iter().enumerate().filter(|(j, _)| takes(*j)).fold(always, |all, (_, (r, _))| all | 1 << r);
                let share = soft.iter().enumerate().map(|(j, (_, w))| if takes(j) { *w } else { 1.0 - w }).product();
                let (places, weights) = branches.entry(branch).or_default();
                places.push(i as u32);
                weights.push(share);
            }
        }
        Ok(branches)
    }
}

/// Weights of a selection at positions of a lane.
pub fn at_positions(
    stage: &Stage,
    lane: &Lane,
    selection: &Selection,
    positions: Option<&Positions>,
) -> Result<Array<f32>> {
    let weights = stage.at_view(selection)?;
    let at = |position: usize| weights[lane.view_sample(position)];
    Ok(match positions {
        Some(positions) => positions.iter().map(|&position| at(position as usize)).collect::<Vec<_>>().into(),
        None if lane.samples.is_none() => (*weights).clone(),
        None => (0..lane.count()).map(at).collect::<Vec<_>>().into(),
    })
}
