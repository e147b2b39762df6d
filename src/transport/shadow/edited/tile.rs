//! A few samples through all edits of a visibility, direction by direction.

use super::amounts::colour;
use super::chain::Chain;
use super::directions::{Directions, Part};
use super::field::{Field, seen, together, union};
use super::read::{hidden, shadows};
use crate::Result;
use crate::device::{Array, Device};
use crate::kernels::shadow_filter::shadow_filter;
use crate::kernels::shadow_light::{Beam, shadow_light};
use glam::Vec3;
use std::sync::Arc;

/// What edits let through more than before, of the samples of a tile.
pub struct Change {
    /// Numbers of outputs where anything changes, ascending.
    pub slots: Vec<u32>,
    /// Per lane, sample and slot: V after less V before.
    pub values: Vec<f32>,
}

/// Samples that are worked on together: near each other, so that much the same directions are hidden from them.
pub struct Tile<'a> {
    pub all: &'a Directions<'a>,
    pub device: &'a Device,
    pub samples: &'a [u32],
    pub amounts: &'a [Arc<Vec<f32>>],
}

impl Tile<'_> {
    /// Irradiance that the edits add.
    ///
    /// # Errors
    /// What the device meets.
    pub fn light(&self, lanes: usize) -> Result<Vec<[f32; 4]>> {
        let change = self.change(lanes)?;
        if change.slots.is_empty() {
            return Ok(vec![[0.0; 4]; self.samples.len()]);
        }
        let beams = change.slots.iter().map(|&slot| self.all.beams[slot as usize]);
        let beams: Array<Beam> = beams.collect::<Vec<_>>().into();
        let points = &self.all.visibility.samples.points;
        let normal = |&sample: &u32| Vec3::from(points[sample as usize].normal).extend(0.0).to_array();
        let normals: Vec<[f32; 4]> = self.samples.iter().map(normal).collect();
        shadow_light(self.device, &beams, &normals, &change.values, lanes)
    }

    /// # Errors
    /// What the device meets.
    pub fn change(&self, lanes: usize) -> Result<Change> {
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
            return Ok(Change { slots, values: Vec::new() });
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
        Ok(Change { slots, values: change })
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
