//! Light that leaves the gather samples: direct light, source brushes, bounces.

use super::Stage;
use crate::Result;
use crate::memo::Key;
use crate::transport::Edits;
use crate::transport::edits::SourceBrush;
use glam::{Vec3, Vec4};
use std::sync::Arc;

/// Radiant exitance of the gather samples towards receivers, W/m².
pub struct Leaving {
    /// M elements.
    pub exitance: Vec<[f32; 4]>,
    /// Names them.
    pub key: Key,
}

/// `irradiance`: makes direct light at the gather samples; `reflectance`: theirs; both M elements, named by `key`.
///
/// Sampled edits act on the sum of all bounces. With brushes `B -> s B + o` (thesis Algorithm 5), reflectance `r` and bounces `T` (thesis 3.1.1):
/// `B' = B_0 + B_1 + ...`, `B_0 = s r E + o`, `B_n = s r T B_(n-1)`. As many bounces as the transfer has beyond its last.
pub fn leaving(
    stage: &Stage,
    irradiance: impl FnOnce() -> Vec<[f32; 4]>,
    reflectance: &[[f32; 4]],
    edits: &Edits,
    key: Key,
) -> Result<Arc<Leaving>> {
    let brushes: Vec<&SourceBrush> = edits.source().collect();
    let sampled =
        edits.sampled().next().filter(|sampled| sampled.source.scale.is_some() || sampled.source.offset.is_some());
    let key = brushes.iter().fold(key, |key, brush| Key::of(&[&key.0, &digest(brush)]));
    let key = sampled.map_or(key, |sampled| Key::of(&[b"sampled", &key.0, &sampled.digest()]));
    let bytes = |leaving: &Leaving| super::VEC4 * leaving.exitance.len() as u64;
    stage.memo.remember(key, bytes, || {
        let brushes = Brushes::new(stage, &brushes, reflectance.len())?;
        let mut exitance = exitance(stage, &irradiance(), reflectance, &brushes)?;
        if let Some(sampled) = sampled {
            sampled.source.apply(&mut exitance, 1);
        }
        Ok(Leaving { exitance, key })
    })
}

fn exitance(
    stage: &Stage,
    irradiance: &[[f32; 4]],
    reflectance: &[[f32; 4]],
    brush: &Brushes,
) -> Result<Vec<[f32; 4]>> {
    let reflect = |irradiance: &[[f32; 4]]| -> Vec<[f32; 4]> {
        let light = irradiance.iter().zip(reflectance).enumerate();
        light.map(|(g, (e, r))| (Vec4::from_array(*e) * Vec4::from_array(*r) * brush.scale(g)).to_array()).collect()
    };
    let mut last = reflect(irradiance);
    last.iter_mut().enumerate().for_each(|(g, light)| *light = add(*light, brush.offset(g).extend(0.0)));
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
    let Brushes { scale, offset } = Brushes::new(stage, &brushes, stage.transfer.gather.count())?;
    Ok((scale, offset))
}

fn digest(brush: &SourceBrush) -> [u8; 16] {
    let selection = brush.selection.as_ref().map_or([0; 16], |selection| selection.digest());
    let numbers = [brush.scale, brush.offset.x, brush.offset.y, brush.offset.z];
    Key::of(&[b"source", &selection, bytemuck::cast_slice(&numbers)]).0
}

/// All brushes as one scale and offset of each gather sample; empty for none.
struct Brushes {
    scale: Vec<f32>,
    offset: Vec<Vec3>,
}

impl Brushes {
    fn new(stage: &Stage, brushes: &[&SourceBrush], count: usize) -> Result<Self> {
        let mut all = Self { scale: Vec::new(), offset: Vec::new() };
        for brush in brushes {
            all.scale.resize(count, 1.0);
            all.offset.resize(count, Vec3::ZERO);
            let weights = brush.selection.as_ref().map(|selection| stage.at_gather(selection)).transpose()?;
            for (g, (scale, offset)) in all.scale.iter_mut().zip(&mut all.offset).enumerate() {
                let weight = weights.as_ref().map_or(1.0, |weights| weights[g]);
                let factor = 1.0 + weight * (brush.scale - 1.0);
                *scale *= factor;
                *offset = *offset * factor + brush.offset * weight;
            }
        }
        Ok(all)
    }

    fn scale(&self, g: usize) -> f32 {
        self.scale.get(g).copied().unwrap_or(1.0)
    }

    fn offset(&self, g: usize) -> Vec3 {
        self.offset.get(g).copied().unwrap_or(Vec3::ZERO)
    }
}
