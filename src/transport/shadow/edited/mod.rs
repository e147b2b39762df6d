//! Light of edited visibility (thesis 6.6, 6.7.3). Rows stay as they were baked; edits act when light is asked for.
//!
//! ```text
//! amounts     how much each edit does at each sample
//! sums        edits that only weaken shadows: a few sums over whole rows
//! chain, taps edits that look elsewhere, compiled to filters over directions
//! read        baked shadows at some directions
//! directions  any edit, direction by direction, at the samples and directions where it acts
//! ```

pub mod amounts;
pub mod chain;
pub mod directions;
mod read;
mod sums;
mod taps;

use super::integrate::Stage;
use crate::Result;
use crate::memo::Key;
use crate::progress::Progress;
use directions::Directions;
use rayon::prelude::*;
use std::sync::Arc;
use sums::{Sums, is_pointwise};

/// Irradiance at each sample with all edits of the visibility; W/m², RGB. Samples where no edit does anything keep every
/// bit.
///
/// # Errors
/// As `Stage::irradiance`; `Cancelled`.
pub fn irradiance(stage: &Stage, progress: Progress) -> Result<Vec<[f32; 4]>> {
    let visibility = stage.visibility;
    let mut light = unedited(stage)?.to_vec();
    let amounts: Vec<Arc<Vec<f32>>> = (0..visibility.edits.len()).map(|e| amount(stage, e)).collect::<Result<_>>()?;
    let wide: Vec<usize> = (0..visibility.edits.len()).filter(|&e| !is_pointwise(&visibility.edits[e])).collect();
    let energy = |texel: &u32| stage.transport.environment.radiance[*texel as usize][..3].iter().any(|x| *x > 0.0);
    let mut outputs = chain::reach(wide.iter().map(|&e| &visibility.edits[e]), visibility.size);
    let acts = |edits: &[usize], sample: usize| edits.iter().any(|&e| amounts[e][sample] != 0.0);
    let mut aside: Vec<bool> = (0..light.len()).into_par_iter().map(|sample| acts(&wide, sample)).collect();
    match Sums::new(stage, &outputs)? {
        Some(sums) => sums.add(&amounts, &aside, &mut light),
        None => {
            let all: Vec<usize> = (0..visibility.edits.len()).collect();
            outputs = chain::reach(visibility.edits.iter(), visibility.size);
            aside = (0..light.len()).into_par_iter().map(|sample| acts(&all, sample)).collect();
        }
    }
    outputs.retain(energy);
    let samples: Vec<u32> = (0..light.len() as u32).filter(|&sample| aside[sample as usize]).collect();
    if !samples.is_empty() && !outputs.is_empty() {
        let directions = Directions::new(visibility, &stage.transport.environment, outputs);
        let added = directions.added(stage.device, progress, &samples, &amounts)?;
        for (sample, added) in samples.into_iter().zip(added) {
            let light = &mut light[sample as usize];
            (0..3).for_each(|c| light[c] = (light[c] + added[c]).max(0.0));
        }
    }
    Ok(light)
}

/// Kept: sliders of edits do not change it.
fn unedited(stage: &Stage) -> Result<Arc<Vec<[f32; 4]>>> {
    let rows = stage.visibility.groups.iter().flat_map(|group| group.faces.iter().flatten());
    let ids: Vec<u64> = rows.map(|rows| rows.id()).chain([stage.transport.environment.radiance.id()]).collect();
    let key = Key::of(&[b"unedited", bytemuck::cast_slice(&ids), &stage.visibility.samples.points.id().to_le_bytes()]);
    stage.memo.remember(
        key,
        |light: &Vec<[f32; 4]>| 16 * light.len() as u64,
        || stage.irradiance(&stage.shadows()?, None),
    )
}

fn amount(stage: &Stage, edit: usize) -> Result<Arc<Vec<f32>>> {
    let edit = &stage.visibility.edits[edit];
    let points = &stage.visibility.samples.points;
    let numbers = format!("{:?}", edit.change);
    let selection = edit.selection.as_ref().map_or([0; 16], |selection| selection.digest());
    let key = Key::of(&[b"shadow amounts", numbers.as_bytes(), &selection, &points.id().to_le_bytes()]);
    let weights = |weights: &Vec<f32>| 4 * weights.len() as u64;
    stage.memo.remember(key, weights, || {
        let key = Key::of(&[b"shadow selection", &selection, &points.id().to_le_bytes()]);
        let selected = stage.memo.remember(key, weights, || Ok(amounts::selected(edit, points)))?;
        Ok(amounts::amounts(edit, points, &selected))
    })
}
