//! Light of some gather samples: shares of what each sends, with a name, and one such part on its way (`Beam`).

use super::Stage;
use super::leaving::{Leaving, Part};
use super::positions::TILE;
use crate::Result;
use crate::memo::Key;
use glam::Vec4;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

/// Share of each gather sample's light, in [0, 1].
pub struct Shares {
    pub weights: Vec<f32>,
    /// All of them are 0.
    pub are_none: bool,
    /// Names the weights and where the samples are.
    pub key: Key,
}

impl Shares {
    pub fn new(weights: Vec<f32>, key: Key) -> Self {
        let are_none = weights.iter().all(|&weight| weight == 0.0);
        Self { weights, are_none, key }
    }

    pub fn bytes(&self) -> u64 {
        4 * self.weights.len() as u64
    }

    /// Both, one after the other; `None` is all of the light.
    fn and(stage: &Stage, a: Option<&Arc<Self>>, b: Option<&Arc<Self>>) -> Result<Option<Arc<Self>>> {
        let (Some(a), Some(b)) = (a, b) else { return Ok(a.or(b).cloned()) };
        let key = Key::of(&[b"shares of shares", &a.key.0, &b.key.0]);
        let product = || a.weights.iter().zip(&b.weights).map(|(a, b)| a * b).collect();
        stage.memo.remember(key, Self::bytes, || Ok(Self::new(product(), key))).map(Some)
    }
}

/// One part of the light that leaves, of some caster.
pub struct Beam<'a> {
    exitance: &'a [[f32; 4]],
    /// What of it is sent.
    shares: Option<Arc<Shares>>,
    /// What its caster sends, of this part or not.
    pub caster: Option<Arc<Shares>>,
    /// Gather samples that products with it look at: all that send, perhaps more.
    pub columns: Option<Arc<Shares>>,
    /// Names the light.
    pub key: Key,
    encoded: OnceLock<Vec<[f32; 4]>>,
}

impl<'a> Beam<'a> {
    /// The parts of light that `caster` has any of (`None`: all of it): they add up to its share.
    pub fn all(stage: &Stage, leaving: &'a Leaving, caster: Option<&Arc<Shares>>) -> Result<Vec<Self>> {
        let beam = |part: &Part| -> Result<Self> {
            let shares = Shares::and(stage, part.shares.as_ref(), caster)?;
            let name = shares.as_ref().map_or([0; 16], |shares| shares.key.0);
            let columns = if part.is_narrow { shares.clone() } else { caster.cloned() };
            let key = Key::of(&[b"beam", &part.key.0, &name]);
            Ok(Self {
                exitance: &leaving.exitance,
                shares,
                caster: caster.cloned(),
                columns,
                key,
                encoded: OnceLock::new(),
            })
        };
        let beams: Vec<Self> = leaving.parts.iter().map(beam).collect::<Result<_>>()?;
        Ok(beams.into_iter().filter(|beam| beam.shares.as_ref().is_none_or(|shares| !shares.are_none)).collect())
    }

    /// As it leaves the gather samples.
    pub fn light(&self) -> Cow<'a, [[f32; 4]]> {
        match &self.shares {
            None => Cow::Borrowed(self.exitance),
            Some(shares) => {
                let share = |(light, share): (&[f32; 4], &f32)| (Vec4::from_array(*light) * *share).to_array();
                Cow::Owned(self.exitance.par_iter().zip(&shares.weights).with_min_len(TILE).map(share).collect())
            }
        }
    }

    /// In the basis of the transfer's rows.
    pub fn encoded(&self, stage: &Stage) -> Result<&[[f32; 4]]> {
        if let Some(encoded) = self.encoded.get() {
            return Ok(encoded);
        }
        let encoded = stage.transfer.encode(stage.device, &self.light(), 1)?;
        Ok(self.encoded.get_or_init(|| encoded))
    }
}
