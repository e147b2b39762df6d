//! Indirect light of a view with a list of edits, from end to end of its path.

use super::idle::idle;
use super::{Between, Gains, GlossyLanes, Lane, Leaving, Light, SceneLight, indirect_radiance, leaving};
use crate::memo::Key;
use crate::transport::Edits;
use crate::transport::glossy::{GlossyTransfer, gloss_key, glossy_transfer};
use crate::{Error, Result};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::sync::Arc;

pub struct Indirect {
    /// Light that leaves the gather samples.
    pub leaving: Arc<Leaving>,
    /// Irradiance at view samples.
    pub irradiance: Light,
    /// Of the curves of transit edits.
    pub gains: Gains,
    /// Radiance that glossy surfaces reflect, at view samples; empty when there are none.
    pub reflection: Vec<[f32; 4]>,
    /// Radiance from view samples to the camera.
    pub radiance: Vec<[f32; 4]>,
    pub told: Told,
}

/// What the report says of it.
#[derive(Clone, Debug, Default)]
pub struct Told {
    /// Parts that the light was split into.
    pub parts: usize,
    /// Edits that change nothing in this view, and why.
    pub idle: Vec<String>,
    /// Places of glossy rows, and their rays and entries.
    pub glossy: Option<[u64; 3]>,
}

impl Indirect {
    /// # Errors
    /// No light at all, or more than numbers hold; selections of another geometry; too little memory; `Cancelled`.
    pub fn new(light: &SceneLight, edits: &Edits) -> Result<Self> {
        let stage = light.stage;
        edits.check(&stage.geometry.fingerprint)?;
        for sampled in edits.sampled() {
            let origin = serde_json::to_vec(&sampled.origin).expect("plain data");
            let key = Key::of(&[b"checked", &stage.place.0, &origin]);
            stage.memo.remember(key, |()| 1, || sampled.check(stage.geometry, stage.transfer))?;
        }
        let glows = edits.source().any(|brush| brush.offset != Vec3::ZERO) || edits.sampled().next().is_some();
        if light.sources() == 0 && !glows {
            let help = "add a light node and connect it to the scene, or give a material emission";
            return Err(Error::compute("the scene has no light: no lamp, and no surface that emits", help));
        }
        let between = Between::new(stage, edits)?;
        let reflectance = light.gather_reflectance()?;
        let leaving = leaving(stage, || light.at_gather(), &reflectance, edits, light.key())?;
        let diffuse = between.arriving(&Lane::diffuse(stage), &leaving, None)?;
        let (reflection, glossy) = reflection(light, &between, &leaving, &diffuse.gains)?;
        let radiance = indirect_radiance(stage, &light.view_reflectance()?, &diffuse.light, &reflection, edits)?;
        bounded(&radiance, edits)?;
        let told = Told { parts: between.parts(), idle: idle(stage, edits)?, glossy };
        Ok(Self { leaving, irradiance: diffuse.light, gains: diffuse.gains, reflection, radiance, told })
    }
}

/// Leaves room to add direct light and the samples of a pixel up.
const LARGEST: f32 = 1e36;

fn bounded(radiance: &[[f32; 4]], edits: &Edits) -> Result<()> {
    // Written so that NaN is out of bounds, too.
    let is_beyond = |light: &&[f32; 4]| !light[..3].iter().all(|x| x.abs() <= LARGEST);
    let beyond = radiance.par_iter().with_min_len(4096).filter(is_beyond).count();
    if beyond == 0 {
        return Ok(());
    }
    let help = match edits.0.is_empty() {
        true => "lower the intensity of lights and the emission of materials",
        false => "lower the factors of the edits (brightness, scale, falloff far from its distance) or the lights",
    };
    let message = format!("indirect light is too large for numbers at {beyond} of {} view samples", radiance.len());
    Err(Error::compute(message, help))
}

/// Radiance, and places, rays and entries of its rows.
type Reflection = (Vec<[f32; 4]>, Option<[u64; 3]>);

/// Radiance that glossy surfaces reflect, at all view samples, and what it took; empty when there are none.
fn reflection(light: &SceneLight, between: &Between, leaving: &Leaving, gains: &Gains) -> Result<Reflection> {
    let (stage, gloss) = (light.stage, &light.gloss);
    let (transfer, model) = (stage.transfer, stage.transfer.settings.glossy);
    let key = Key::of(&[b"glossy", &stage.place.0, &gloss_key(gloss, model)]);
    let bytes = |glossy: &Option<GlossyTransfer>| glossy.as_ref().map_or(1, GlossyTransfer::bytes);
    let glossy = stage
        .memo
        .keep(key, bytes, || glossy_transfer(stage.device, stage.geometry, transfer, gloss, model, stage.progress))?;
    let Some(glossy) = glossy.as_ref() else { return Ok((Vec::new(), None)) };
    let lanes = GlossyLanes::new(glossy, key);
    let [facing, grazing] = lanes.lanes().map(|lane| between.arriving(&lane, leaving, Some(gains)));
    let (facing, grazing) = (facing?.light, grazing?.light);
    let samples = &transfer.samples.points;
    let mut reflection = vec![[0.0; 4]; samples.len()];
    for ((&sample, facing), grazing) in glossy.samples.iter().zip(facing.iter()).zip(grazing.iter()) {
        let [r, g, b, _] = gloss[samples[sample as usize].material as usize];
        let light = Vec4::new(r, g, b, 0.0) * Vec4::from_array(*facing) + Vec4::from_array(*grazing);
        reflection[sample as usize] = light.to_array();
    }
    Ok((reflection, Some([glossy.places() as u64, glossy.rays, glossy.rows.entries().len() as u64])))
}
