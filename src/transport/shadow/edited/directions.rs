//! Light of edited samples, direction by direction: any edit, and as dear as its lamp is large.

use super::amounts::colour;
use super::chain::Chain;
use super::tile::Tile;
use crate::Result;
use crate::device::{Array, Device};
use crate::kernels::shadow_light::Beam;
use crate::progress::Progress;
use crate::scene::{Environment, cube};
use crate::transport::shadow::{ShadowEdit, Visibility};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

/// Samples that are worked on together.
const TILE: usize = 64;
#[cfg(feature = "gpu")]
const GPU_TILE: usize = 1024;

/// One group's part of the edits.
pub struct Part {
    pub group: usize,
    pub chain: Chain,
}

/// All edits of a visibility, compiled.
pub struct Directions<'a> {
    pub visibility: &'a Visibility,
    /// Numbers of the edits of all groups together, in the visibility's list.
    pub together: Vec<usize>,
    pub whole: Chain,
    /// Per group, and the numbers of its edits.
    pub parts: Vec<(Part, Vec<usize>)>,
    pub outputs: Vec<u32>,
    pub beams: Array<Beam>,
}

impl<'a> Directions<'a> {
    /// `outputs`: texels whose light is asked for, ascending.
    pub fn new(visibility: &'a Visibility, environment: &Environment, outputs: Vec<u32>) -> Self {
        let (size, edits) = (visibility.size, &visibility.edits);
        let numbers = |group: Option<&str>| -> Vec<usize> {
            (0..edits.len()).filter(|&e| edits[e].group.as_deref() == group).collect()
        };
        let list = |numbers: &[usize]| -> Vec<&ShadowEdit> { numbers.iter().map(|&e| &edits[e]).collect() };
        let together = numbers(None);
        let whole = Chain::new(&list(&together), size, outputs.clone());
        let parts = visibility
            .groups
            .iter()
            .enumerate()
            .map(|(group, named)| {
                let own = numbers(Some(&named.name));
                (Part { group, chain: Chain::new(&list(&own), size, whole.inputs.clone()) }, own)
            })
            .collect();
        let beam = |&texel: &u32| {
            let [r, g, b, angle] = environment.radiance[texel as usize];
            Beam {
                direction: cube::texel_point(texel as usize, size).normalize().extend(0.0).to_array(),
                energy: [r * angle, g * angle, b * angle, 0.0],
            }
        };
        let beams = outputs.iter().map(beam).collect::<Vec<_>>().into();
        Self { visibility, together, whole, parts, outputs, beams }
    }

    /// Three where an edit makes colours differ.
    fn lanes(&self) -> usize {
        let tinted = self.visibility.edits.iter().any(|edit| colour(edit) != Vec3::ONE);
        if tinted { 3 } else { 1 }
    }

    /// What the edits add to what `samples` see of each output, RGB; mean with their weights, which sum to 1.
    ///
    /// # Errors
    /// As `added`.
    pub fn opened(
        &self,
        device: &Device,
        progress: Progress,
        samples: &[(u32, f32)],
        amounts: &[Arc<Vec<f32>>],
    ) -> Result<Vec<[f32; 3]>> {
        let (lanes, size) = (self.lanes(), self.visibility.size);
        let stage = progress.stage("edits of shadows", samples.len() as u64);
        let mut opened = vec![[0.0; 3]; self.outputs.len()];
        for tile in samples.chunks(TILE) {
            let (numbers, weights): (Vec<u32>, Vec<f32>) = tile.iter().copied().unzip();
            let change = Tile { all: self, device, samples: &numbers, amounts }.change(lanes)?;
            let plane = numbers.len() * change.slots.len();
            for (s, weight) in weights.iter().enumerate() {
                let normal = Vec3::from(self.visibility.samples.points[numbers[s] as usize].normal);
                for (k, &slot) in change.slots.iter().enumerate() {
                    // What moved below the horizon is seen no more and no less there.
                    if normal.dot(cube::texel_point(self.outputs[slot as usize] as usize, size)) <= 0.0 {
                        continue;
                    }
                    let value = |lane: usize| change.values[lane.min(lanes - 1) * plane + s * change.slots.len() + k];
                    (0..3).for_each(|lane| opened[slot as usize][lane] += weight * value(lane));
                }
            }
            stage.advance(tile.len() as u64)?;
        }
        Ok(opened)
    }

    /// What the edits add to the irradiance of `samples` (numbers of view samples), RGB; `amounts`: per edit of the
    /// visibility, one a view sample.
    ///
    /// # Errors
    /// What the device meets; `Cancelled`.
    pub fn added(
        &self,
        device: &Device,
        progress: Progress,
        samples: &[u32],
        amounts: &[Arc<Vec<f32>>],
    ) -> Result<Vec<[f32; 4]>> {
        let lanes = self.lanes();
        let stage = progress.stage("edits of shadows", samples.len() as u64);
        let work = |samples: &[u32]| -> Result<Vec<[f32; 4]>> {
            let light = Tile { all: self, device, samples, amounts }.light(lanes)?;
            stage.advance(samples.len() as u64)?;
            Ok(light)
        };
        let tiles: Vec<Vec<[f32; 4]>> = match device {
            Device::Cpu => samples.par_chunks(TILE).map(work).collect::<Result<_>>()?,
            #[cfg(feature = "gpu")]
            Device::Gpu(_) => samples.chunks(GPU_TILE).map(work).collect::<Result<_>>()?,
        };
        Ok(tiles.concat())
    }
}
