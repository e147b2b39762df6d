//! Light of edited samples, direction by direction: any edit, and as dear as its lamp is large.

use super::amounts::colour;
use super::chain::Chain;
use super::read::shadows;
use crate::Result;
use crate::device::{Array, Device};
use crate::kernels::shadow_filter::shadow_filter;
use crate::kernels::shadow_light::{Beam, shadow_light};
use crate::progress::Progress;
use crate::scene::{Environment, cube};
use crate::transport::shadow::{ShadowEdit, Visibility};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

/// Bytes of slots that are worked on at once.
const TILE: usize = 64 << 20;

/// One group's part of the edits.
struct Part {
    group: usize,
    chain: Chain,
}

/// All edits of a visibility, compiled.
pub struct Directions<'a> {
    visibility: &'a Visibility,
    /// Numbers of the edits of all groups together, in the visibility's list.
    together: Vec<usize>,
    whole: Chain,
    /// Per group, and the numbers of its edits.
    parts: Vec<(Part, Vec<usize>)>,
    outputs: Vec<u32>,
    beams: Array<Beam>,
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

    /// Slots of a sample at most.
    pub fn slots(&self) -> usize {
        self.parts.iter().map(|(part, _)| part.chain.widest()).fold(self.whole.widest(), usize::max)
    }

    /// What the edits add to the irradiance of `samples` (numbers of view samples), RGB; `amounts`: per edit of the
    /// visibility, one a view sample.
    ///
    /// # Errors
    /// Too little memory; `Cancelled`.
    pub fn added(
        &self,
        device: &Device,
        progress: Progress,
        samples: &[u32],
        amounts: &[Arc<Vec<f32>>],
    ) -> Result<Vec<[f32; 4]>> {
        let tinted = self.visibility.edits.iter().any(|edit| colour(edit) != Vec3::ONE);
        let lanes = if tinted { 3 } else { 1 };
        let tile = (TILE / (4 * self.slots().max(1) * lanes)).clamp(1, 4096);
        let mut light = Vec::with_capacity(samples.len());
        let stage = progress.stage("edits of shadows", samples.len() as u64);
        for samples in samples.chunks(tile) {
            light.extend(self.tile(device, samples, amounts, lanes)?);
            stage.advance(samples.len() as u64)?;
        }
        Ok(light)
    }

    fn tile(&self, device: &Device, samples: &[u32], amounts: &[Arc<Vec<f32>>], lanes: usize) -> Result<Vec<[f32; 4]>> {
        let of_edit = |edit: usize, lane: usize| -> Vec<f32> {
            let factor = colour(&self.visibility.edits[edit])[lane];
            samples.iter().map(|&sample| factor * amounts[edit][sample as usize]).collect()
        };
        let raw: Vec<Vec<f32>> = self
            .parts
            .iter()
            .map(|(part, _)| shadows(self.visibility, &self.visibility.groups[part.group], samples, &part.chain.inputs))
            .collect();
        // Of all groups together before any edit, where edits are seen.
        let before = together(
            self.parts.iter().zip(&raw).map(|((part, _), raw)| picked(raw, &part.chain.inputs, &self.outputs)),
        );
        let mut change = Vec::with_capacity(lanes * before.len());
        for lane in 0..lanes {
            let run = |chain: &Chain, numbers: &[usize], shadows: &[f32]| -> Result<Vec<f32>> {
                let mut slots = shadows.to_vec();
                for step in &chain.steps {
                    slots = shadow_filter(device, &step.filter, &of_edit(numbers[step.edit], lane), &slots)?;
                }
                Ok(slots)
            };
            let groups: Vec<Vec<f32>> = self
                .parts
                .iter()
                .zip(&raw)
                .map(|((part, numbers), raw)| run(&part.chain, numbers, raw))
                .collect::<Result<_>>()?;
            let all = together(groups.into_iter());
            let after = run(&self.whole, &self.together, &all)?;
            change.par_extend(before.par_iter().zip(&after).with_min_len(4096).map(|(before, after)| before - after));
        }
        let points = &self.visibility.samples.points;
        let normals: Vec<[f32; 4]> =
            samples.iter().map(|&sample| Vec3::from(points[sample as usize].normal).extend(0.0).to_array()).collect();
        shadow_light(device, &self.beams, &normals, &change, lanes)
    }
}

/// What any of the groups blocks: `1 - (1 - S_1) (1 - S_2) ...`; one group's as it is, bit by bit.
fn together(mut groups: impl Iterator<Item = Vec<f32>>) -> Vec<f32> {
    let mut all = groups.next().expect("a visibility has groups");
    for group in groups {
        all.par_iter_mut().zip(&group).with_min_len(4096).for_each(|(all, other)| *all += other * (1.0 - *all));
    }
    all
}

/// The slots of some texels, which are among `inputs`; both ascending.
fn picked(slots: &[f32], inputs: &[u32], outputs: &[u32]) -> Vec<f32> {
    if inputs.len() == outputs.len() {
        return slots.to_vec();
    }
    let places: Vec<usize> = outputs.iter().map(|texel| inputs.binary_search(texel).expect("outputs go in")).collect();
    slots.par_chunks_exact(inputs.len()).flat_map_iter(|slots| places.iter().map(|&place| slots[place])).collect()
}
