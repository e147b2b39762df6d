//! Samples a list of edits as scale and offset of the transfer matrix (thesis 5.3, 5.5.2): what other programs can apply
//! without knowing the edits. See `sampled` for what the result means.
//!
//! ```text
//! split    columns | middle | eye                      constant columns and rows become vectors (eq. 5.5)
//! classes  view samples that the same edits of the middle reach share rows
//! field    scale of the middle between one row and each gather node, from light before and after
//! shadows  offset rows: paths that the transfer lacks
//! ```
//!
//! What a scale cannot give, because a channel has no light to be scaled, goes to the offset at the eye.

mod classes;
mod field;
mod importance;
mod middle;
mod shadows;
mod split;

use crate::device::Array;
use crate::memo::Key;
use crate::transport::lighting::{Indirect, Leaving, SceneLight, leaving, source_vectors};
use crate::transport::sampled::{GatherPlaces, Origin, Parts, Vectors, ViewPlaces, fit};
use crate::transport::{Basis, Edit, Edits, Sampled};
use crate::{Error, Result};
use field::Step;
use glam::{Vec3, Vec4};
use middle::Middle;
use rayon::prelude::*;
use split::Split;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Haar coefficients of a row, at most.
    pub coefficients: usize,
    /// L2 norm of what a row leaves out over that of the row, weighted by what the row receives.
    pub tolerance: f32,
}

/// What the report says of sampled edits.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    pub rows: usize,
    /// Of all rows together.
    pub coefficients: u64,
    /// Rows that `coefficients` cut short of the tolerance.
    pub cut_short: u64,
    /// Root of the mean squared difference to the procedural edits over the mean, of indirect radiance at the view samples
    /// that edits change; 0 when there are none.
    pub error: f64,
    /// View samples that edits change.
    pub changed: usize,
}

/// # Errors
/// A list that holds sampled edits, a transfer of basis `haar`, and whatever lighting fails with.
pub fn sample(light: &SceneLight, edits: &Edits, settings: Settings) -> Result<(Sampled, Cost)> {
    let stage = light.stage;
    if edits.sampled().next().is_some() {
        let help = "connect the edits that they were sampled from";
        return Err(Error::compute("the list holds edits that are sampled already", help));
    }
    if stage.transfer.settings.basis != Basis::Cut {
        let help = "give the transfer the basis \"cut\"";
        return Err(Error::compute("edits are sampled for transfers of basis cut, this one is of basis haar", help));
    }
    let split = Split::new(edits);
    let edited = Indirect::new(light, edits)?;
    let (source, sent) = columns(light, edits, &split, &edited.leaving)?;
    let middle = Middle::new(stage, &split, &sent, &edited)?;
    let (rows, mut cost) = middle.rows(stage, settings)?;
    let residual = middle.residual(stage, edited.leaving.key)?;
    let eye = eye(light, edits, &split, &edited, &residual)?;
    let key = Key::of(&[b"places", &stage.place.0]);
    let places = stage.memo.remember(
        key,
        |_| 72 * stage.transfer.samples.points.len() as u64,
        || {
            let origin = Origin::of(stage.geometry, stage.transfer);
            Ok((
                origin,
                ViewPlaces::of(stage.geometry, &stage.transfer.samples),
                GatherPlaces::of(stage.geometry, stage.transfer),
            ))
        },
    )?;
    let (origin, view, gather) = (*places).clone();
    let sampled = Sampled::new(Parts {
        origin,
        view,
        gather,
        source,
        eye,
        touched: rows.touched.into(),
        slots: rows.slots.into(),
        weights: rows.weights.into(),
        scales: rows.scales,
        offsets: rows.offsets,
    })?;
    let again = Indirect::new(light, &Edits::default().and(Edit::Sampled(Arc::new(sampled.clone()))))?;
    // Without a lamp there is no unedited picture: all of it is the edits'.
    let plain = match light.sources() {
        0 => vec![[0.0; 4]; edited.radiance.len()],
        _ => Indirect::new(light, &Edits::default())?.radiance,
    };
    (cost.error, cost.changed) = difference(&plain, &edited.radiance, &again.radiance);
    Ok((sampled, cost))
}

/// Scale and offset at the source (eq. 5.5), and the light that they leave: brushes and edits of all receivers.
fn columns(light: &SceneLight, edits: &Edits, split: &Split, sent: &Leaving) -> Result<(Vectors, Vec<[f32; 4]>)> {
    let stage = light.stage;
    let mut edited = sent.exitance.clone();
    for edit in &split.columns {
        let Step::Colour(matrix) = Step::of(edit) else { continue };
        let weights = edit.block.caster.as_ref().map(|caster| stage.at_gather(caster)).transpose()?;
        edited.par_iter_mut().enumerate().for_each(|(g, light)| {
            let old = rgb(light);
            let weight = weights.as_ref().map_or(1.0, |weights| weights[g]);
            *light = (old + (matrix * old - old) * weight).extend(light[3]).to_array();
        });
    }
    if edits.source().next().is_none() && split.columns.is_empty() {
        return Ok((Vectors::default(), edited));
    }
    if split.columns.is_empty() && stage.transfer.settings.bounces == 1 {
        // One bounce: brushes are scale and offset themselves, whatever the light.
        let (scale, offset) = source_vectors(stage, edits)?;
        let scale = scale.into_iter().map(|scale| [scale, scale, scale, 1.0]).collect::<Vec<_>>();
        let offset = offset.into_iter().map(|offset| offset.extend(0.0).to_array()).collect::<Vec<_>>();
        return Ok((Vectors { scale: Some(scale.into()), offset: Some(offset.into()) }, edited));
    }
    let reflectance = light.gather_reflectance()?;
    let plain = leaving(stage, || light.at_gather(), &reflectance, &Edits::default(), light.key())?;
    Ok((vectors(&plain.exitance, &edited)?, edited))
}

/// Light that stays bit by bit keeps scale 1 and offset 0.
fn vectors(original: &[[f32; 4]], edited: &[[f32; 4]]) -> Result<Vectors> {
    let mut fit = fit::fit(original, edited)?;
    let pairs = original.par_iter().zip(edited);
    fit.scale.par_iter_mut().zip(&mut fit.offset).zip(pairs).for_each(|((scale, offset), (original, edited))| {
        if original[..3] == edited[..3] {
            (*scale, *offset) = ([1.0; 4], [0.0; 4]);
        }
    });
    Ok(Vectors { scale: Some(fit.scale.into()), offset: Some(fit.offset.into()) })
}

/// Scale and offset at the eye: edits of all casters, brushes, and what the rows could not scale.
fn eye(light: &SceneLight, edits: &Edits, split: &Split, edited: &Indirect, residual: &[[f32; 4]]) -> Result<Vectors> {
    let mut eye = Vectors::default();
    if split.eye > 0 || edits.eye().next().is_some() {
        let middle = Indirect::new(light, &split.without_eye(edits))?;
        eye = vectors(&middle.radiance, &edited.radiance)?;
    }
    if !residual.is_empty() {
        let reflectance = light.view_reflectance()?;
        let radiance = |i: usize| {
            let scale = eye.scale.as_ref().map_or(Vec4::ONE, |scale| Vec4::from_array(scale[i]));
            let offset = eye.offset.as_ref().map_or(Vec4::ZERO, |offset| Vec4::from_array(offset[i]));
            let more = Vec4::from_array(reflectance[i]) * Vec4::from_array(residual[i]) * FRAC_1_PI;
            (offset + scale * more).truncate().extend(0.0).to_array()
        };
        let offset: Vec<[f32; 4]> = (0..residual.len()).into_par_iter().map(radiance).collect();
        eye.offset = Some(Array::from(offset));
    }
    Ok(eye)
}

/// Relative root of the mean squared difference where edits change anything, and at how many samples they do.
fn difference(plain: &[[f32; 4]], edited: &[[f32; 4]], again: &[[f32; 4]]) -> (f64, usize) {
    // In parts of fixed size, so that the sums do not depend on the number of threads.
    type Part<'a> = &'a [[f32; 4]];
    let part = |((plain, edited), again): ((Part, Part), Part)| {
        let (mut squares, mut sum, mut count) = (0.0, 0.0, 0);
        for ((plain, edited), again) in plain.iter().zip(edited).zip(again) {
            if plain[..3] != edited[..3] || again[..3] != edited[..3] {
                squares += f64::from((rgb(again) - rgb(edited)).length_squared());
                sum += f64::from(rgb(edited).element_sum().abs());
                count += 1;
            }
        }
        (squares, sum, count)
    };
    let parts: Vec<(f64, f64, usize)> =
        plain.par_chunks(1 << 14).zip(edited.par_chunks(1 << 14)).zip(again.par_chunks(1 << 14)).map(part).collect();
    let (squares, sum, count) = parts.iter().fold((0.0, 0.0, 0), |(a, b, c), (d, e, f)| (a + d, b + e, c + f));
    let mean = sum / (3 * count.max(1)) as f64;
    let error = (squares / (3 * count.max(1)) as f64).sqrt();
    (if error > 0.0 { error / mean.max(f64::MIN_POSITIVE) } else { 0.0 }, count)
}

fn rgb(light: &[f32; 4]) -> Vec3 {
    Vec4::from_array(*light).truncate()
}
