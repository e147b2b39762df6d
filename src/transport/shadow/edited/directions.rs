//! Light of edited samples, direction by direction: any edit, and as dear as its lamp is large.

use super::amounts::colour;
use super::chain::Chain;
use super::read::{hidden, shadows};
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

/// Samples that are worked on together.
const TILE: usize = 64;
#[cfg(feature = "gpu")]
const GPU_TILE: usize = 1024;

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
        let tinted = self.visibility.edits.iter().any(|edit| colour(edit) != Vec3::ONE);
        let lanes = if tinted { 3 } else { 1 };
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

/// Shadows of the samples of a tile: each has a value a slot, and a 0 behind them. All other slots are 0.
struct Field {
    /// Places in the list that a chain starts from, or ends with; ascending.
    slots: Vec<u32>,
    values: Vec<f32>,
}

impl Field {
    fn stride(&self) -> usize {
        self.slots.len() + 1
    }

    /// The same with more slots.
    fn spread(&self, slots: &[u32]) -> Vec<f32> {
        let places: Vec<usize> =
            self.slots.iter().map(|slot| slots.binary_search(slot).expect("the slots are among these")).collect();
        let mut all = vec![0.0; self.values.len() / self.stride() * (slots.len() + 1)];
        for (all, values) in all.chunks_exact_mut(slots.len() + 1).zip(self.values.chunks_exact(self.stride())) {
            places.iter().zip(values).for_each(|(&place, &value)| all[place] = value);
        }
        all
    }
}

/// Samples that are worked on together: near each other, so that much the same directions are hidden from them.
struct Tile<'a> {
    all: &'a Directions<'a>,
    device: &'a Device,
    samples: &'a [u32],
    amounts: &'a [Arc<Vec<f32>>],
}

impl Tile<'_> {
    fn light(&self, lanes: usize) -> Result<Vec<[f32; 4]>> {
        let all = self.all;
        // Where only groups are edited, the others matter where those change, and as factors.
        let (edited, others): (Vec<&(Part, Vec<usize>)>, Vec<_>) =
            all.parts.iter().partition(|(part, _)| !all.whole.steps.is_empty() || !part.chain.steps.is_empty());
        let raw: Vec<Field> = edited.iter().map(|(part, _)| self.baked(part)).collect();
        // Of these groups together before any edit, where edits are seen.
        let before =
            together(edited.iter().zip(&raw).map(|((part, _), raw)| seen(raw, &part.chain.inputs, &all.outputs)));
        let after: Vec<Field> = (0..lanes).map(|lane| self.edited(&edited, &raw, lane)).collect::<Result<_>>()?;
        let slots = union(after.iter().chain([&before]).map(|field| &field.slots[..]));
        if slots.is_empty() {
            return Ok(vec![[0.0; 4]; self.samples.len()]);
        }
        let texels: Vec<u32> = slots.iter().map(|&slot| all.outputs[slot as usize]).collect();
        let mut seen_past = vec![1.0; self.samples.len() * slots.len()];
        for (part, _) in others {
            let group = &all.visibility.groups[part.group];
            let hidden = shadows(all.visibility, group, self.samples, &texels);
            seen_past.iter_mut().zip(hidden).for_each(|(seen, hidden)| *seen *= 1.0 - hidden);
        }
        let before = before.spread(&slots);
        let mut change = Vec::with_capacity(lanes * seen_past.len());
        for after in &after {
            let after = after.spread(&slots);
            // Without the zeros behind the slots.
            let rows = before.chunks_exact(slots.len() + 1).zip(after.chunks_exact(slots.len() + 1));
            for ((before, after), seen) in rows.zip(seen_past.chunks_exact(slots.len())) {
                change
                    .extend(before.iter().zip(after).zip(seen).map(|((before, after), seen)| seen * (before - after)));
            }
        }
        let beams: Array<Beam> = slots.iter().map(|&slot| all.beams[slot as usize]).collect::<Vec<_>>().into();
        let points = &all.visibility.samples.points;
        let normal = |&sample: &u32| Vec3::from(points[sample as usize].normal).extend(0.0).to_array();
        let normals: Vec<[f32; 4]> = self.samples.iter().map(normal).collect();
        shadow_light(self.device, &beams, &normals, &change, lanes)
    }

    /// What a group hides where its chain looks.
    fn baked(&self, part: &Part) -> Field {
        let visibility = self.all.visibility;
        let (group, texels) = (&visibility.groups[part.group], &part.chain.inputs);
        let slots = hidden(visibility, group, self.samples, texels);
        let chosen: Vec<u32> = slots.iter().map(|&slot| texels[slot as usize]).collect();
        let values = shadows(visibility, group, self.samples, &chosen);
        let mut padded = Vec::with_capacity(values.len() + self.samples.len());
        for sample in 0..self.samples.len() {
            padded.extend_from_slice(&values[sample * chosen.len()..(sample + 1) * chosen.len()]);
            padded.push(0.0);
        }
        Field { slots, values: padded }
    }

    /// What these groups hide after all edits, in one colour, at the outputs.
    fn edited(&self, parts: &[&(Part, Vec<usize>)], raw: &[Field], lane: usize) -> Result<Field> {
        let groups: Vec<Field> = parts
            .iter()
            .zip(raw)
            .map(|((part, numbers), raw)| self.through(&part.chain, numbers, raw, lane))
            .collect::<Result<_>>()?;
        self.through(&self.all.whole, &self.all.together, &together(groups.into_iter()), lane)
    }

    fn through(&self, chain: &Chain, numbers: &[usize], field: &Field, lane: usize) -> Result<Field> {
        let mut field = Field { slots: field.slots.clone(), values: field.values.clone() };
        for step in &chain.steps {
            let edit = numbers[step.edit];
            let factor = colour(&self.all.visibility.edits[edit])[lane];
            let amounts: Vec<f32> =
                self.samples.iter().map(|&sample| factor * self.amounts[edit][sample as usize]).collect();
            let (filter, slots) = step.filter.narrowed(&field.slots);
            let values = shadow_filter(self.device, &filter, &amounts, &field.values)?;
            field = Field { slots, values };
        }
        Ok(field)
    }
}

/// What any of the groups blocks: `1 - (1 - S_1) (1 - S_2) ...`; one group's as it is, bit by bit.
fn together(groups: impl Iterator<Item = Field>) -> Field {
    let mut groups: Vec<Field> = groups.collect();
    if groups.len() == 1 {
        return groups.remove(0);
    }
    let slots = union(groups.iter().map(|group| &group.slots[..]));
    let mut values: Vec<f32> = Vec::new();
    for group in groups {
        let more = group.spread(&slots);
        match values.is_empty() {
            true => values = more,
            false => values.iter_mut().zip(more).for_each(|(all, other)| *all += other * (1.0 - *all)),
        }
    }
    Field { slots, values }
}

/// Slots of any of the lists, ascending.
fn union<'a>(lists: impl Iterator<Item = &'a [u32]>) -> Vec<u32> {
    let mut all: Vec<u32> = lists.flatten().copied().collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// The part of a field over `inputs` that lies on `outputs`, which are among these; both ascending texels.
fn seen(field: &Field, inputs: &[u32], outputs: &[u32]) -> Field {
    let both: Vec<(usize, u32)> = field
        .slots
        .iter()
        .enumerate()
        .filter_map(|(place, &slot)| {
            outputs.binary_search(&inputs[slot as usize]).ok().map(|output| (place, output as u32))
        })
        .collect();
    let rows = field.values.chunks_exact(field.stride());
    let values = rows.flat_map(|row| both.iter().map(|(place, _)| row[*place]).chain([0.0])).collect();
    Field { slots: both.into_iter().map(|(_, output)| output).collect(), values }
}
