//! Light of edits that only weaken shadows, each direction by itself: fades, gradients and tints. Few sums over whole rows
//! serve all samples and all amounts, so that a slider costs no more than a sum over these.
//!
//! Directions fall into regions in which every lamp has one weight. In region r, with `psi` what edits of all groups
//! leave of a shadow and `phi_g` what edits of group g leave of that group's:
//! ```text
//! S' = psi (1 - product over groups (1 - phi_g S_g))
//!    = psi sum over sets K of edited groups: product_(g in K) phi_g product_(g not in K) (1 - phi_g) S_(K and the unedited)
//! ```
//! where `S_K` is what the groups of K hide together.

use super::amounts::colour;
use crate::Result;
use crate::device::Array;
use crate::memo::Key;
use crate::scene::cube::FACES;
use crate::transport::shadow::integrate::Stage;
use crate::transport::shadow::{ShadowEdit, Visibility};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Sums over all rows at most; beyond, direction by direction is cheaper.
const MOST: usize = 64;

/// Directions in which every lamp has one weight.
struct Region {
    /// 1 in it and 0 elsewhere, over all texels.
    mask: Array<f32>,
    /// Of each pointwise edit's lamp.
    lamps: Vec<f32>,
    /// Edits that look elsewhere act here, too.
    also_wide: bool,
}

pub struct Sums<'a> {
    stage: &'a Stage<'a>,
    /// Numbers of the pointwise edits in the visibility's list.
    edits: Vec<usize>,
    /// Numbers of groups that some of them name.
    groups: Vec<usize>,
    regions: Arc<Vec<Region>>,
    /// Irradiance that each region loses to each set of groups: `hidden[region << groups.len() | set]`, where bit i of a
    /// set is `groups[i]`; the unedited groups are in every set.
    hidden: Vec<Arc<Vec<[f32; 4]>>>,
}

impl<'a> Sums<'a> {
    /// `wide`: texels where edits that are not pointwise act. `None` when it would take too many sums.
    pub fn new(stage: &'a Stage<'a>, wide: &[u32]) -> Result<Option<Self>> {
        let visibility = stage.visibility;
        let list = &visibility.edits;
        let edits: Vec<usize> = (0..list.len()).filter(|&e| list[e].change.is_pointwise()).collect();
        let named = |g: &usize| edits.iter().any(|&e| list[e].group.as_deref() == Some(&visibility.groups[*g].name));
        let groups: Vec<usize> = (0..visibility.groups.len()).filter(named).collect();
        let ids: Vec<u64> = edits.iter().map(|&e| list[e].lamp.as_ref().map_or(0, |lamp| lamp.weights.id())).collect();
        let key = Key::of(&[b"regions", bytemuck::cast_slice(&ids), bytemuck::cast_slice(wide)]);
        let bytes = |regions: &Option<Arc<Vec<Region>>>| {
            regions.iter().flat_map(|regions| regions.iter()).map(|region| 4 * region.mask.len() as u64).sum()
        };
        let regions = stage.memo.remember(key, bytes, || {
            let lamps: Vec<&ShadowEdit> = edits.iter().map(|&e| &list[e]).collect();
            Ok(regions(&lamps, wide, visibility.size).map(Arc::new))
        })?;
        let Some(regions) = (*regions).clone().filter(|regions| regions.len() << groups.len() <= MOST) else {
            return Ok(None);
        };
        let mut sums = Self { stage, edits, groups, regions, hidden: Vec::new() };
        for region in sums.regions.iter() {
            for set in 0..1 << sums.groups.len() {
                sums.hidden.push(sums.hidden_by(region, set)?);
            }
        }
        Ok(Some(sums))
    }

    fn hidden_by(&self, region: &Region, set: usize) -> Result<Arc<Vec<[f32; 4]>>> {
        let all = self.stage.visibility;
        let belongs = |g: usize| self.groups.iter().position(|&edited| edited == g).is_none_or(|i| set >> i & 1 == 1);
        let groups = (0..all.groups.len()).filter(|&g| belongs(g)).map(|g| all.groups[g].clone()).collect();
        let some = Visibility { groups, edits: Vec::new(), ..all.clone() };
        let ids: Vec<u64> = (0..FACES).flat_map(|face| some.face(face).into_iter().map(|rows| rows.id())).collect();
        let light = [self.stage.transport.environment.radiance.id(), region.mask.id()];
        let key = Key::of(&[b"hidden light", bytemuck::cast_slice(&ids), bytemuck::cast_slice(&light)]);
        self.stage.memo.remember(
            key,
            |light: &Vec<[f32; 4]>| 16 * light.len() as u64,
            || {
                let stage = Stage { visibility: &some, ..*self.stage };
                stage.hidden(&stage.shadows()?, Some(&region.mask))
            },
        )
    }

    /// Adds what the edits let through to the irradiance of all samples where they do anything; `amounts`: per edit of
    /// the visibility, one a sample. At samples of `aside`, directions where wide edits act are left out.
    pub fn add(&self, amounts: &[Arc<Vec<f32>>], aside: &[bool], light: &mut [[f32; 4]]) {
        let list = &self.stage.visibility.edits;
        let number = |name: &str| self.groups.iter().position(|&g| self.stage.visibility.groups[g].name == name);
        // Of each edit: its number, its group's place in `groups`, its colour.
        let edits: Vec<(usize, Option<usize>, Vec3)> =
            self.edits.iter().map(|&e| (e, list[e].group.as_deref().and_then(number), colour(&list[e]))).collect();
        light.par_iter_mut().enumerate().with_min_len(1024).for_each(|(sample, light)| {
            if edits.iter().all(|(e, ..)| amounts[*e][sample] == 0.0) {
                return;
            }
            let mut added = Vec4::ZERO;
            for (r, region) in self.regions.iter().enumerate().filter(|(_, r)| !(aside[sample] && r.also_wide)) {
                let mut together = Vec3::ONE;
                let mut left = [Vec3::ONE; MOST.ilog2() as usize];
                for ((e, group, colour), lamp) in edits.iter().zip(&region.lamps) {
                    let factor = Vec3::ONE - *colour * (amounts[*e][sample] * lamp);
                    match group {
                        Some(group) => left[*group] *= factor,
                        None => together *= factor,
                    }
                }
                let sets = 1 << self.groups.len();
                let hidden = |set: usize| Vec4::from_array(self.hidden[r * sets + set][sample]).truncate();
                let mut remains = Vec3::ZERO;
                for set in 0..sets {
                    let share = |i: usize| if set >> i & 1 == 1 { left[i] } else { Vec3::ONE - left[i] };
                    remains += hidden(set) * (0..self.groups.len()).map(share).product::<Vec3>();
                }
                added += (hidden(sets - 1) - together * remains).extend(0.0);
            }
            *light = (Vec4::from_array(*light) + added).max(Vec4::ZERO).to_array();
        });
    }
}

/// `None` when there are more than `MOST`.
fn regions(edits: &[&ShadowEdit], wide: &[u32], size: usize) -> Option<Vec<Region>> {
    let texels = FACES * size * size;
    let mut is_wide = vec![false; texels];
    wide.iter().for_each(|&texel| is_wide[texel as usize] = true);
    let mut numbers: BTreeMap<(Vec<u32>, bool), Vec<usize>> = BTreeMap::new();
    for (texel, &also_wide) in is_wide.iter().enumerate() {
        let weight = |edit: &&ShadowEdit| edit.lamp.as_ref().map_or(1.0, |lamp| lamp.weights[texel]);
        let lamps: Vec<f32> = edits.iter().map(weight).collect();
        if lamps.iter().any(|&weight| weight > 0.0) {
            let bits = lamps.iter().map(|weight| weight.to_bits()).collect();
            numbers.entry((bits, also_wide)).or_default().push(texel);
            if numbers.len() > MOST {
                return None;
            }
        }
    }
    let region = |((bits, also_wide), members): ((Vec<u32>, bool), Vec<usize>)| {
        let mut mask = vec![0.0; texels];
        members.into_iter().for_each(|texel| mask[texel] = 1.0);
        Region { mask: mask.into(), lamps: bits.into_iter().map(f32::from_bits).collect(), also_wide }
    };
    Some(numbers.into_iter().map(region).collect())
}
