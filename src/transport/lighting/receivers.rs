//! The receivers of path edits: where they are soft, light splits into branches, which edits act on or not.

use super::Stage;
use super::lane::Lane;
use super::positions::{Positions, TILE, at_positions, gathered};
use crate::device::Array;
use crate::memo::Key;
use crate::transport::edits::Transit;
use crate::transport::selection::Digest;
use crate::{Error, Result};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Different receivers of path edits that may act on one part of the light.
const MOST: usize = 128;
/// Soft ones of these that may meet at one sample: each doubles the work there.
const MOST_SOFT: usize = 8;

/// The receivers that a list of edits tells apart.
pub struct Receivers {
    digests: Vec<Digest>,
    /// Receiver of each edit; `None` is everywhere.
    of: Vec<Option<usize>>,
}

/// Light that takes one way through a list of edits.
pub struct Branch {
    /// Bit r: the edits of receiver r act.
    acts: u128,
    /// `None`: all positions asked for.
    pub within: Option<Within>,
    /// How much of the light there takes it; `None`: all.
    pub weights: Option<Vec<f32>>,
}

/// Some of the positions asked for.
pub struct Within {
    pub places: Vec<u32>,
    /// What these are in the lane.
    pub positions: Positions,
}

impl Receivers {
    /// # Errors
    /// More different receivers than are told apart.
    pub fn new(edits: &[&Transit]) -> Result<Self> {
        let mut all = Self { digests: Vec::new(), of: Vec::new() };
        for edit in edits {
            all.of.push(edit.block.receiver.as_ref().map(|receiver| {
                let digest = receiver.digest();
                all.digests.iter().position(|known| *known == digest).unwrap_or_else(|| {
                    all.digests.push(digest);
                    all.digests.len() - 1
                })
            }));
        }
        if all.digests.len() > MOST {
            let message =
                format!("path edits with {} different receivers act on one part of the light", all.digests.len());
            return Err(Error::compute(message, format!("use at most {MOST}, or one receiver for several edits")));
        }
        Ok(all)
    }

    /// The edits that act in a branch.
    pub fn edits_of<'e>(&self, edits: &[&'e Transit], branch: &Branch) -> Vec<&'e Transit> {
        let acts = |receiver: &Option<usize>| receiver.is_none_or(|r| branch.acts >> r & 1 == 1);
        edits.iter().zip(&self.of).filter(|(_, receiver)| acts(receiver)).map(|(edit, _)| *edit).collect()
    }

    /// The branches that light takes at some sample, in a fixed order. They depend on selections alone, so they are kept
    /// while numbers of edits change. `edits`: those that this was made for.
    ///
    /// # Errors
    /// Too many soft receivers at one sample.
    pub fn branches(
        &self,
        stage: &Stage,
        lane: &Lane,
        edits: &[&Transit],
        positions: Option<&Positions>,
    ) -> Result<Arc<Vec<Branch>>> {
        if self.digests.is_empty() {
            return Ok(Arc::new(vec![Branch { acts: 0, within: None, weights: None }]));
        }
        let name = Positions::name(positions);
        let key = Key::of(&[b"branches", &lane.key.0, &name, self.digests.as_flattened()]);
        let bytes = |branches: &Vec<Branch>| branches.iter().map(Branch::bytes).sum();
        stage.memo.remember(key, bytes, || {
            let first = |r: usize| self.of.iter().position(|of| *of == Some(r)).expect("an edit named it");
            let receivers =
                (0..self.digests.len()).map(|r| edits[first(r)].block.receiver.as_ref().expect("it has one"));
            let weights: Vec<Array<f32>> =
                receivers.map(|receiver| at_positions(stage, lane, receiver, positions)).collect::<Result<_>>()?;
            let count = positions.map_or(lane.count(), |positions| positions.len());
            let found: Vec<Found> = (0..count.div_ceil(TILE))
                .into_par_iter()
                .map(|tile| find(&weights, tile * TILE..((tile + 1) * TILE).min(count)))
                .collect::<Result<_>>()?;
            let mut all = Found::new();
            for (acts, (places, weights)) in found.into_iter().flatten() {
                let (all_places, all_weights) = all.entry(acts).or_default();
                all_places.extend(places);
                all_weights.extend(weights);
            }
            let within = |places: Vec<u32>| {
                let numbers = match positions {
                    Some(positions) => gathered(&places, |place| positions[place as usize]),
                    None => places.clone(),
                };
                Within { places, positions: Positions::new(numbers) }
            };
            let branch = |(acts, (places, weights)): (u128, (Vec<u32>, Vec<f32>))| Branch {
                acts,
                within: (places.len() < count).then(|| within(places)),
                weights: Some(weights).filter(|weights| weights.iter().any(|&weight| weight != 1.0)),
            };
            Ok(all.into_iter().map(branch).collect())
        })
    }
}

impl Branch {
    fn bytes(&self) -> u64 {
        let weights = self.weights.as_ref().map_or(0, Vec::len) as u64;
        4 * weights + self.within.as_ref().map_or(0, |within| 2 * within.positions.bytes())
    }
}

/// Per set of receivers that act: places, and how much of the light there takes the branch.
type Found = BTreeMap<u128, (Vec<u32>, Vec<f32>)>;

/// `weights`: of each receiver at all places.
fn find(weights: &[Array<f32>], places: std::ops::Range<usize>) -> Result<Found> {
    let mut branches = Found::new();
    let mut soft: Vec<(usize, f32)> = Vec::with_capacity(MOST_SOFT);
    for i in places {
        let mut always = 0u128;
        soft.clear();
        for (r, weight) in weights.iter().map(|weights| weights[i]).enumerate() {
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
