//! The list of edits between casters and receivers, in order, at the samples of a lane (thesis Algorithm 4, stacked).
//!
//! Light is split by caster (`atoms`). Each atom travels through the path edits of its casters (`paths`), then the
//! colour edits act on the sums that their masks name. A curve acts on the light as all edits before it left it; path
//! edits that come after it in the list act on its result, so its gains are found from a shorter list first.

use super::lane::{Lane, Positions};
use super::paths::{Paths, Shares, at_positions};
use super::{Leaving, Stage};
use crate::device::Array;
use crate::kernels::colour_edits::{ColourEdit, Edited, colour_edits};
use crate::memo::Key;
use crate::transport::atoms::{self, Atoms};
use crate::transport::edits::{Change, Transit};
use crate::transport::{Edits, Sampled, Selection};
use crate::{Result, memory};
use glam::Vec4;
use rayon::prelude::*;
use std::sync::Arc;

/// A list of transit edits made ready for one transfer: which casters it tells apart.
pub struct Between<'a> {
    stage: &'a Stage<'a>,
    edits: Vec<&'a Transit>,
    /// Index into `atoms.members` of each edit's caster; `None`: everything.
    caster: Vec<Option<usize>>,
    atoms: Atoms,
    /// Names the shares of each atom.
    keys: Vec<Key>,
    sampled: Option<&'a Sampled>,
}

/// Per edit of the list, where it has a curve: its gain at each view sample, 1 where the edit does not reach.
pub type Gains = Vec<Option<Array<f32>>>;

/// Light at the samples of a lane.
pub struct Arriving {
    pub light: Vec<[f32; 4]>,
    pub gains: Gains,
}

impl<'a> Between<'a> {
    pub fn new(stage: &'a Stage<'a>, edits: &'a Edits) -> Result<Self> {
        let sampled = edits.sampled().next().map(|sampled| &**sampled);
        let edits: Vec<&Transit> = edits.transit().collect();
        let mut distinct: Vec<&Arc<Selection>> = Vec::new();
        let mut caster: Vec<Option<usize>> = Vec::new();
        for edit in &edits {
            caster.push(edit.block.caster.as_ref().map(|caster| {
                distinct.iter().position(|known| known.digest() == caster.digest()).unwrap_or_else(|| {
                    distinct.push(caster);
                    distinct.len() - 1
                })
            }));
        }
        let weights: Vec<Vec<f32>> =
            distinct.iter().map(|caster| Ok(stage.at_gather(caster)?.to_vec())).collect::<Result<_>>()?;
        let atoms = atoms::split(stage.transfer.gather.count(), &weights)?;
        let keys = atoms.shares.iter().map(|shares| Key::of(&[b"shares", bytemuck::cast_slice(shares)])).collect();
        Ok(Self { stage, edits, caster, atoms, keys, sampled })
    }

    /// Parts that the light is split into.
    pub fn parts(&self) -> usize {
        self.atoms.shares.len()
    }

    /// How many casters no gather sample lies in.
    pub fn empty_casters(&self) -> usize {
        self.atoms.members.iter().filter(|members| members.is_empty()).count()
    }

    /// The edited light at all samples of a lane. Samples that no edit's receiver holds keep every bit of the whole.
    /// `gains`: of the curves, where they were found already, at the diffuse lane.
    pub fn arriving(&self, lane: &Lane, leaving: &Leaving, gains: Option<&Gains>) -> Result<Arriving> {
        let whole = || self.paths(lane, leaving, None).light(&[], None);
        let reach = Reach::new(self, lane)?;
        let mut gains = gains.cloned().unwrap_or_else(|| vec![None; self.edits.len()]);
        if self.edits.is_empty() || reach.count == 0 {
            return Ok(Arriving { light: whole()?.to_vec(), gains });
        }
        let bytes = super::VEC4 * (2 * self.parts() * reach.count) as u64;
        let what = format!("{} parts of the light", self.parts());
        memory::require(bytes, &what, "use fewer different casters, or fewer pixels")?;
        let last_path = self.edits.iter().rposition(|edit| !edit.is_colour()).unwrap_or(0);
        for early in 0..last_path {
            if self.edits[early].has_curve() && gains[early].is_none() {
                self.edited(lane, leaving, &reach, early + 1, &mut gains)?;
            }
        }
        let edited = self.edited(lane, leaving, &reach, self.edits.len(), &mut gains)?;
        let light = match &reach.positions {
            None => edited,
            Some(positions) => {
                let mut light = whole()?.to_vec();
                positions.iter().zip(edited).for_each(|(&position, edited)| light[position as usize] = edited);
                light
            }
        };
        Ok(Arriving { light, gains })
    }

    fn paths<'b>(&'b self, lane: &'b Lane<'b>, leaving: &'b Leaving, atom: Option<usize>) -> Paths<'b> {
        let shares: Shares = atom.map(|atom| (&self.atoms.shares[atom][..], self.keys[atom]));
        Paths { stage: self.stage, lane, leaving, shares, sampled: self.sampled }
    }

    fn acts_on(&self, edit: usize, atom: usize) -> bool {
        self.caster[edit].is_none_or(|caster| self.atoms.members[caster].contains(&atom))
    }

    /// Light where the list reaches, after its first `prefix` edits; adds the gains that their curves ask for.
    fn edited(
        &self,
        lane: &Lane,
        leaving: &Leaving,
        reach: &Reach,
        prefix: usize,
        gains: &mut Gains,
    ) -> Result<Vec<[f32; 4]>> {
        let list = &self.edits[..prefix];
        let atoms = self.separated(lane, leaving, reach, prefix)?;
        let atoms: Vec<&[[f32; 4]]> = atoms.iter().map(|atom| &atom[..]).collect();
        let colours = (0..prefix).filter_map(|e| {
            let Change::Colour(colour) = &list[e].change else { return None };
            let gain = gains[e].as_ref().map(|gain| reach.of_view(lane, gain));
            Some((
                e,
                ColourEdit {
                    atoms: ColourEdit::mask((0..self.parts()).filter(|&atom| self.acts_on(e, atom))),
                    matrix: colour.matrix(),
                    curve: colour.knots(),
                    receiver: reach.receivers[e].clone(),
                    gain,
                },
            ))
        });
        let (numbers, colours): (Vec<usize>, Vec<ColourEdit>) = colours.unzip();
        let Edited { light, gains: told } = colour_edits(self.stage.device, &atoms, reach.count, &colours)?;
        let tell = numbers.into_iter().zip(&colours).filter(|(_, edit)| edit.tells()).map(|(number, _)| number);
        for (number, told) in tell.zip(told) {
            gains[number] = Some(reach.to_view(lane, told, self.stage.transfer.samples.points.len()));
        }
        Ok(light)
    }

    /// The atoms of light where the list reaches: each where an edit tells it apart, dark elsewhere; what is not told
    /// apart stays in the first.
    fn separated(&self, lane: &Lane, leaving: &Leaving, reach: &Reach, prefix: usize) -> Result<Vec<Light>> {
        let path_edits = |atom: Option<usize>| -> Vec<&Transit> {
            let acts = |e: usize| atom.map_or(self.caster[e].is_none(), |atom| self.acts_on(e, atom));
            (0..prefix).filter(|&e| !self.edits[e].is_colour() && acts(e)).map(|e| self.edits[e]).collect()
        };
        let on_all = path_edits(None);
        let everything = self.paths(lane, leaving, None).light(&on_all, reach.positions.as_ref())?;
        let mut atoms = vec![everything.clone()];
        // Of each atom, the light to take out of the first.
        let mut taken: Vec<Light> = Vec::new();
        for atom in 1..self.parts() {
            let tells = (0..prefix).filter(|&e| self.caster[e].is_some() && self.acts_on(e, atom));
            let Some((places, positions)) = reach.where_any(tells) else {
                atoms.push(Arc::default());
                continue;
            };
            let on_atom = path_edits(Some(atom));
            let paths = self.paths(lane, leaving, Some(atom));
            let here = |edits: &[&Transit]| -> Result<Light> {
                let light = paths.light(edits, positions.as_ref())?;
                Ok(places.as_ref().map_or(light.clone(), |places| Arc::new(scatter(&light, places, reach.count))))
            };
            let changed = here(&on_atom)?;
            taken.push(if on_atom.len() == on_all.len() { changed.clone() } else { here(&on_all)? });
            atoms.push(changed);
        }
        if !taken.is_empty() {
            let left = |(i, all): (usize, &[f32; 4])| {
                let left = taken.iter().fold(Vec4::from_array(*all), |left, atom| left - Vec4::from_array(atom[i]));
                left.to_array()
            };
            atoms[0] = Arc::new(everything.par_iter().enumerate().with_min_len(4096).map(left).collect());
        }
        Ok(atoms)
    }
}

/// One element a place.
type Light = Arc<Vec<[f32; 4]>>;

fn scatter(light: &[[f32; 4]], places: &[u32], count: usize) -> Vec<[f32; 4]> {
    let mut all = vec![[0.0; 4]; count];
    places.iter().zip(light).for_each(|(&place, light)| all[place as usize] = *light);
    all
}

/// Where a list of edits reaches in a lane.
struct Reach {
    /// `None`: everywhere.
    positions: Option<Positions>,
    count: usize,
    /// Per edit: weights of its receiver there; `None` is 1.
    receivers: Vec<Option<Array<f32>>>,
}

impl Reach {
    fn new(between: &Between, lane: &Lane) -> Result<Self> {
        let at_all = |edit: &&Transit| match &edit.block.receiver {
            Some(receiver) => at_positions(between.stage, lane, receiver, None).map(Some),
            None => Ok(None),
        };
        let all: Vec<Option<Array<f32>>> = between.edits.iter().map(at_all).collect::<Result<_>>()?;
        if all.iter().any(Option::is_none) {
            return Ok(Self { positions: None, count: lane.count(), receivers: all });
        }
        let reached = |&i: &u32| all.iter().flatten().any(|weights| weights[i as usize] > 0.0);
        let positions: Vec<u32> = (0..lane.count() as u32).into_par_iter().with_min_len(4096).filter(reached).collect();
        let at = |weights: &Array<f32>| positions.iter().map(|&i| weights[i as usize]).collect::<Vec<f32>>().into();
        let receivers = all.iter().map(|weights| weights.as_ref().map(at)).collect();
        Ok(Self { count: positions.len(), positions: Some(Arc::new(positions)), receivers })
    }

    /// Where any of these edits acts: places in this reach, and positions in the lane; `None` for all. Nothing when they
    /// act nowhere.
    #[allow(clippy::type_complexity)]
    fn where_any(&self, edits: impl Iterator<Item = usize>) -> Option<(Option<Vec<u32>>, Option<Positions>)> {
        let mut weights = Vec::new();
        for edit in edits {
            match &self.receivers[edit] {
                Some(receiver) => weights.push(receiver),
                None => return Some((None, self.positions.clone())),
            }
        }
        let places: Vec<u32> =
            (0..self.count as u32).filter(|&i| weights.iter().any(|weights| weights[i as usize] > 0.0)).collect();
        if places.len() == self.count {
            return Some((None, self.positions.clone()));
        }
        let positions = places.iter().map(|&i| self.position(i as usize)).collect();
        (!places.is_empty()).then(|| (Some(places), Some(Arc::new(positions))))
    }

    fn position(&self, place: usize) -> u32 {
        self.positions.as_ref().map_or(place as u32, |positions| positions[place])
    }

    /// From all view samples to here.
    fn of_view(&self, lane: &Lane, values: &Array<f32>) -> Array<f32> {
        (0..self.count).map(|place| values[lane.view_sample(self.position(place) as usize)]).collect::<Vec<_>>().into()
    }

    /// From here to all view samples; 1 elsewhere.
    fn to_view(&self, lane: &Lane, values: Vec<f32>, count: usize) -> Array<f32> {
        let mut all = vec![1.0; count];
        for (place, value) in values.into_iter().enumerate() {
            all[lane.view_sample(self.position(place) as usize)] = value;
        }
        all.into()
    }
}
