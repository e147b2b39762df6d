//! Light that leaves the gather samples: direct light, source brushes, bounces.

use super::Stage;
use super::brushes::{Touched, digest, source_change};
use super::positions::TILE;
use super::shares::Shares;
use crate::Result;
use crate::memo::Key;
use crate::transport::Edits;
use crate::transport::edits::{SourceBrush, SourceChange};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::sync::Arc;

/// Radiant exitance of the gather samples towards receivers, W/m².
pub struct Leaving {
    /// M elements.
    pub exitance: Vec<[f32; 4]>,
    /// Names them.
    pub key: Key,
    /// Parts that add up to it.
    pub(super) parts: Vec<Part>,
}

/// Light that leaves some of the gather samples. Light is a sum: what no brush touches is named without the brushes'
/// numbers, so that all that is made of it outlasts the slider of a brush.
pub(super) struct Part {
    /// 1 for the samples that it is the light of, 0 for all others; `None`: of all.
    pub shares: Option<Arc<Shares>>,
    /// So few that it pays to take their entries out of rows.
    pub is_narrow: bool,
    pub key: Key,
}

impl Leaving {
    /// Light in one part; `key` names it.
    pub fn whole(exitance: Vec<[f32; 4]>, key: Key) -> Self {
        Self { exitance, key, parts: vec![Part { shares: None, is_narrow: false, key }] }
    }
}

/// `irradiance`: makes direct light at the gather samples; `reflectance`: theirs; both M elements, named by `key`.
///
/// Sampled edits act on the sum of all bounces. With brushes `B -> s B + o` (thesis Algorithm 5), reflectance `r` and bounces `T` (thesis 3.1.1):
/// `B' = B_0 + B_1 + ...`, `B_0 = s r E + o`, `B_n = s r T B_(n-1)`. As many bounces as the transfer has beyond its last.
pub fn leaving(
    stage: &Stage,
    irradiance: impl FnOnce() -> Result<Vec<[f32; 4]>>,
    reflectance: &[[f32; 4]],
    edits: &Edits,
    plain: Key,
) -> Result<Arc<Leaving>> {
    let brushes: Vec<&SourceBrush> = edits.source().collect();
    let sampled =
        edits.sampled().next().filter(|sampled| sampled.source.scale.is_some() || sampled.source.offset.is_some());
    let key = brushes.iter().fold(plain, |key, brush| Key::of(&[&key.0, &digest(brush)]));
    let key = sampled.map_or(key, |sampled| Key::of(&[b"sampled", &key.0, &sampled.digest()]));
    let bytes = |leaving: &Leaving| super::VEC4 * leaving.exitance.len() as u64;
    stage.memo.remember(key, bytes, || {
        let all = source_change(stage, &brushes)?;
        let mut exitance = exitance(stage, &irradiance()?, reflectance, &all)?;
        if let Some(sampled) = sampled {
            sampled.source.apply(&mut exitance, 1);
        }
        let mut leaving = Leaving::whole(exitance, key);
        // Bounces bring brushed light everywhere, and sampled edits have no touched samples.
        if stage.transfer.settings.bounces == 1
            && edits.sampled().next().is_none()
            && let Some(touched) = Touched::new(stage, &brushes)?
        {
            let part = |shares: &Arc<Shares>, is_narrow, key| Part { shares: Some(shares.clone()), is_narrow, key };
            leaving.parts = vec![part(&touched.rest, false, plain), part(&touched.samples, true, key)];
        }
        Ok(leaving)
    })
}

fn exitance(
    stage: &Stage,
    irradiance: &[[f32; 4]],
    reflectance: &[[f32; 4]],
    brush: &SourceChange,
) -> Result<Vec<[f32; 4]>> {
    let reflect = |irradiance: &[[f32; 4]]| -> Vec<[f32; 4]> {
        let light = irradiance.par_iter().zip(reflectance).with_min_len(TILE).enumerate();
        light.map(|(g, (e, r))| (Vec4::from_array(*e) * Vec4::from_array(*r) * brush.scale(g)).to_array()).collect()
    };
    let mut last = reflect(irradiance);
    last.iter_mut().enumerate().for_each(|(g, light)| *light = add(*light, brush.offset(g).extend(0.0)));
    if stage.transfer.settings.bounces == 1 {
        return Ok(last);
    }
    let mut all = last.clone();
    for _ in 1..stage.transfer.settings.bounces {
        last = reflect(&stage.transfer.bounce(stage.device, &last)?);
        all.iter_mut().zip(&last).for_each(|(sum, more)| *sum = add(*sum, Vec4::from_array(*more)));
    }
    Ok(all)
}

fn add(a: [f32; 4], b: Vec4) -> [f32; 4] {
    (Vec4::from_array(a) + b).to_array()
}

/// All source brushes of a list as one scale and offset of each gather sample; for one bounce, `B' = scale B + offset`.
pub fn source_vectors(stage: &Stage, edits: &Edits) -> Result<(Vec<f32>, Vec<Vec3>)> {
    let brushes: Vec<&SourceBrush> = edits.source().collect();
    let SourceChange { scale, offset } = source_change(stage, &brushes)?;
    Ok((scale, offset))
}
