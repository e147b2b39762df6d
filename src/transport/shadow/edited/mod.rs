//! Light of edited visibility (thesis 6.6, 6.7.3). Rows stay as they were baked; edits act when light is asked for.
//!
//! ```text
//! amounts     how much each edit does at each sample
//! sums        edits that only weaken shadows: a few sums over whole rows
//! chain, taps edits that look elsewhere, compiled to filters over directions
//! read        baked shadows at some directions
//! directions  any edit, direction by direction, at the samples and directions where it acts
//! tile, field the same for a few samples, which share what is hidden from any of them
//! ```

pub mod amounts;
pub mod chain;
pub mod directions;
mod field;
mod read;
mod sums;
mod taps;
mod tile;

use super::integrate::Stage;
use super::{Visibility, horizon};
use crate::Result;
use crate::device::Device;
use crate::memo::Key;
use crate::progress::Progress;
use crate::scene::Environment;
use crate::scene::cube::FACES;
use directions::Directions;
use rayon::prelude::*;
use std::sync::Arc;
use sums::Sums;

/// Irradiance at each sample with all edits of the visibility; W/m², RGB. Samples where no edit does anything keep every
/// bit.
///
/// # Errors
/// As `Stage::irradiance`; `Cancelled`.
pub fn irradiance(stage: &Stage, progress: Progress) -> Result<Vec<[f32; 4]>> {
    let visibility = stage.visibility;
    let mut light = unedited(stage)?.to_vec();
    let amounts: Vec<Arc<Vec<f32>>> = (0..visibility.edits.len()).map(|e| amount(stage, e)).collect::<Result<_>>()?;
    let wide: Vec<usize> =
        (0..visibility.edits.len()).filter(|&e| !visibility.edits[e].change.is_pointwise()).collect();
    let environment = &stage.transport.environment;
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
    outputs.retain(|texel| environment.is_lit(*texel as usize));
    let samples: Vec<u32> = (0..light.len() as u32).filter(|&sample| aside[sample as usize]).collect();
    if !samples.is_empty() && !outputs.is_empty() {
        let directions = Directions::new(visibility, environment, outputs);
        let added = directions.added(stage.device, progress, &samples, &amounts)?;
        for (sample, added) in samples.into_iter().zip(added) {
            let light = &mut light[sample as usize];
            (0..3).for_each(|c| light[c] = (light[c] + added[c]).max(0.0));
        }
    }
    Ok(light)
}

/// What samples see of each direction with all edits, RGB in [0, 1]: means with the weights of a selection at the samples,
/// 6 n n texels; `environment` has as many. Directions below a sample's horizon count as hidden.
///
/// # Errors
/// As `Visibility::blocked`; what the device meets; `Cancelled`.
pub fn seen(
    device: &Device,
    progress: Progress,
    visibility: &Visibility,
    environment: &Environment,
    weights: &[f32],
) -> Result<Vec<[f32; 3]>> {
    let (size, points) = (visibility.size, &visibility.samples.points);
    let blocked = visibility.blocked(weights)?;
    let chosen = (0..points.len()).filter(|&i| weights[i] > 0.0 && points[i].exists());
    let total: f64 = chosen.clone().map(|i| f64::from(weights[i])).sum();
    let samples: Vec<(u32, f32)> = chosen.map(|i| (i as u32, (f64::from(weights[i]) / total) as f32)).collect();
    let mut seen: Vec<[f32; 3]> = blocked.iter().map(|blocked| [-blocked; 3]).collect();
    for &(sample, weight) in &samples {
        for face in 0..FACES {
            let first = face * size * size;
            horizon::spans(points[sample as usize].normal.into(), face, size, |span| {
                seen[first + span.start..first + span.end].iter_mut().flatten().for_each(|seen| *seen += weight);
            });
        }
    }
    if !visibility.edits.is_empty() {
        let all = (0..seen.len() as u32).collect();
        let amounts = visibility.edits.iter().map(|edit| {
            let selected = amounts::selected(edit, points);
            Arc::new(amounts::amounts(edit, points, &selected))
        });
        let amounts: Vec<Arc<Vec<f32>>> = amounts.collect();
        let opened = Directions::new(visibility, environment, all).opened(device, progress, &samples, &amounts)?;
        seen.iter_mut().flatten().zip(opened.iter().flatten()).for_each(|(seen, opened)| *seen += opened);
    }
    seen.iter_mut().flatten().for_each(|seen| *seen = seen.clamp(0.0, 1.0));
    Ok(seen)
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
