//! Light at some samples of a lane from some of the light, by way of edits that change paths one by one: falloff,
//! direction, and what lies in between.
//!
//! Such edits multiply (`Factors`) or add paths (hidden ones), so those of one list commute, and with colour edits that
//! are linear, too. Where an edit's receiver is soft, light splits: `1 - a` goes without the edit and `a` with it, which
//! is the expansion of the product over edits; hard receivers leave one branch at each sample.

use super::lane::{CutOut, Lane};
use super::path_edits::{factors, list_key, unhidden};
use super::positions::Positions;
use super::receivers::Receivers;
use super::shares::{Beam, Shares};
use super::sums::{At, sum_at};
use super::{Leaving, Stage, VEC4};
use crate::kernels::{path_product, sparse_product};
use crate::memo::Key;
use crate::transport::edits::Transit;
use crate::transport::hidden::{Hidden, LAYERS, hidden_rows};
use crate::transport::sampled::apply::{self, Plan, Slots};
use crate::transport::transfer::Basis;
use crate::transport::ways::Factors;
use crate::transport::{Sampled, SparseRows};
use crate::{Error, Result};
use glam::Vec4;
use std::sync::Arc;

/// One element a place.
pub type Light = Arc<Vec<[f32; 4]>>;

/// Some light, on its way to some samples.
pub struct Paths<'a> {
    stage: &'a Stage<'a>,
    lane: &'a Lane<'a>,
    /// Parts that add up to it.
    beams: Vec<Beam<'a>>,
    /// Edits of the matrix that come before all others.
    sampled: Option<&'a Sampled>,
}

// What the memo keeps is a vector.
#[allow(clippy::ptr_arg)]
fn bytes(light: &Vec<[f32; 4]>) -> u64 {
    VEC4 * light.len() as u64
}

impl<'a> Paths<'a> {
    /// `caster`: share of each gather sample's light, `None` for all.
    pub fn new(
        stage: &'a Stage<'a>,
        lane: &'a Lane<'a>,
        leaving: &'a Leaving,
        caster: Option<&Arc<Shares>>,
        sampled: Option<&'a Sampled>,
    ) -> Result<Self> {
        Ok(Self { stage, lane, beams: Beam::all(stage, leaving, caster)?, sampled })
    }

    /// What arrives at `positions` of the lane (`None`: all of it) through path edits; one element a position.
    pub fn light(&self, edits: &[&Transit], positions: Option<&Positions>) -> Result<Light> {
        let Some(sampled) = self.sampled else { return self.unsampled(edits, positions) };
        let name = [&b"sampled"[..], &sampled.digest()].concat();
        let key = self.key(&name, &self.beams, edits, positions);
        self.stage.memo.remember(key, bytes, || self.through(sampled, edits, positions))
    }

    fn unsampled(&self, edits: &[&Transit], positions: Option<&Positions>) -> Result<Light> {
        let memo = self.stage.memo;
        memo.remember(self.key(b"light", &self.beams, edits, positions), bytes, || {
            let receivers = Receivers::new(edits)?;
            let count = positions.map_or(self.lane.count(), |positions| positions.len());
            let branches = receivers.branches(self.stage, self.lane, edits, positions)?;
            let mut arriving = Vec::new();
            for beam in &self.beams {
                for branch in branches.iter() {
                    let edits = receivers.edits_of(edits, branch);
                    let positions = branch.within.as_ref().map_or(positions, |within| Some(&within.positions));
                    let cut = CutOut::new(self.stage, self.lane, positions, beam.columns.as_deref())?;
                    // Kept by itself: the slider of an edit does not change the branches that go without it.
                    let key = self.key(b"rows", std::slice::from_ref(beam), &edits, positions);
                    let rows = memo.remember(key, bytes, || self.rows(beam, &cut, &edits, positions))?;
                    arriving.push((branch, cut, rows));
                }
            }
            let at = arriving.iter().map(|(branch, cut, rows)| At {
                places: branch.within.as_ref().map(|within| &within.places[..]),
                weights: branch.weights.as_deref(),
                light: cut.between(rows),
            });
            Ok(sum_at(count, &at.collect::<Vec<_>>()))
        })
    }

    fn key(&self, name: &[u8], beams: &[Beam], edits: &[&Transit], positions: Option<&Positions>) -> Key {
        let beams: Vec<[u8; 16]> = beams.iter().map(|beam| beam.key.0).collect();
        Key::of(&[name, &self.lane.key.0, beams.as_flattened(), &list_key(edits).0, &Positions::name(positions)])
    }

    /// What arrives at the rows of a cut-out, which is of these positions and this beam, where every edit of the list
    /// acts in full.
    fn rows(
        &self,
        beam: &Beam,
        cut: &CutOut,
        edits: &[&Transit],
        positions: Option<&Positions>,
    ) -> Result<Vec<[f32; 4]>> {
        let Self { stage, lane, .. } = self;
        let encoded = beam.encoded(stage)?;
        let factors = factors(stage, edits)?;
        let mut rows = self.product(cut, &cut.rows, b"seen", factors.as_ref(), encoded)?;
        let amount = unhidden(edits);
        if amount > 0.0 && lane.sees_through {
            let hidden = cut.hidden(stage, beam.columns.as_deref(), || self.hidden(beam, positions))?;
            let more = self.product(cut, &hidden, b"hidden", factors.as_ref(), encoded)?;
            rows.iter_mut().zip(more).for_each(|(sum, more)| {
                *sum = (Vec4::from_array(*sum) + Vec4::from_array(more) * amount).to_array();
            });
        }
        Ok(rows)
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
        let [beam] = &self.beams[..] else { unreachable!("light that meets sampled edits is in one part") };
        let light = beam.light();
        let whole = self.unsampled(&[], None)?.to_vec();
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

    /// What the view does not see of the caster, at the rows of some positions: the same for all parts of its light.
    fn hidden(&self, beam: &Beam, positions: Option<&Positions>) -> Result<Arc<Hidden>> {
        let stage = self.stage;
        let transfer = stage.transfer;
        let cut = CutOut::new(stage, self.lane, positions, beam.caster.as_deref())?;
        stage.memo.keep(Key::of(&[b"hidden", &cut.key.0]), Hidden::bytes, || {
            let everywhere = vec![1.0; transfer.gather.count()];
            let senders = beam.caster.as_ref().map_or(&everywhere[..], |caster| &caster.weights);
            let wanted = cut.is_of(transfer.rows.rows());
            let hidden = hidden_rows(stage.device, stage.geometry, transfer, senders, &wanted, stage.progress)?;
            if hidden.dropped > 0 {
                tracing::warn!("{} hits behind more than {LAYERS} surfaces of a caster are left out", hidden.dropped);
            }
            Ok(hidden)
        })
    }
}
