//! Indirect light of a view with a list of edits, from end to end of its path.

use super::{Between, Gains, GlossyLanes, Lane, Leaving, SceneLight, indirect_radiance, leaving};
use crate::Result;
use crate::memo::Key;
use crate::transport::Edits;
use crate::transport::glossy::{GlossyTransfer, gloss_key, glossy_transfer};
use glam::Vec4;
use std::sync::Arc;

pub struct Indirect {
    /// Light that leaves the gather samples.
    pub leaving: Arc<Leaving>,
    /// Irradiance at view samples.
    pub irradiance: Vec<[f32; 4]>,
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
    /// Casters that hold no gather sample.
    pub empty_casters: usize,
    /// Places of glossy rows, and their rays and entries.
    pub glossy: Option<[u64; 3]>,
}

impl Indirect {
    /// # Errors
    /// Selections of another geometry, too little memory, `Cancelled`.
    pub fn new(light: &SceneLight, edits: &Edits) -> Result<Self> {
        let stage = light.stage;
        edits.check(&stage.geometry.fingerprint)?;
        for sampled in edits.sampled() {
            let key = Key::of(&[b"checked", &stage.place.0, &sampled.digest()]);
            stage.memo.remember(key, |()| 1, || sampled.check(stage.geometry, stage.transfer))?;
        }
        let between = Between::new(stage, edits)?;
        let reflectance = light.gather_reflectance()?;
        let received = light.at_gather()?;
        let leaving = leaving(stage, || received, &reflectance, edits, light.key())?;
        let diffuse = between.arriving(&Lane::diffuse(stage), &leaving, None)?;
        let (reflection, glossy) = reflection(light, &between, &leaving, &diffuse.gains)?;
        let radiance = indirect_radiance(stage, &*light.view_reflectance()?, &diffuse.light, &reflection, edits)?;
        let told = Told { parts: between.parts(), empty_casters: between.empty_casters(), glossy };
        Ok(Self { leaving, irradiance: diffuse.light, gains: diffuse.gains, reflection, radiance, told })
    }
}

/// Radiance that glossy surfaces reflect, at all view samples, and what it took; empty when there are none.
fn reflection(
    light: &SceneLight,
    between: &Between,
    leaving: &Leaving,
    gains: &Gains,
) -> Result<(Vec<[f32; 4]>, Option<[u64; 3]>)> {
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
    for ((&sample, facing), grazing) in glossy.samples.iter().zip(facing).zip(grazing) {
        let [r, g, b, _] = gloss[samples[sample as usize].material as usize];
        let light = Vec4::new(r, g, b, 0.0) * Vec4::from_array(facing) + Vec4::from_array(grazing);
        reflection[sample as usize] = light.to_array();
    }
    Ok((reflection, Some([glossy.places() as u64, glossy.rays, glossy.rows.entries().len() as u64])))
}
