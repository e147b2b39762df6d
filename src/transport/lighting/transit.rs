//! The list of edits between casters and receivers, in order, at the samples of a lane (thesis Algorithm 4, stacked).
//!
//! Light is split by caster (`atoms`). Each atom travels through the path edits of its casters (`paths`), then the
//! colour edits act on the sums that their masks name. A curve acts on the light as all edits before it left it; path
//! edits that come after it in the list act on its result, so its gains are found from a shorter list first.

use super::lane::Lane;
use super::paths::{Light, Paths};
use super::reach::Reach;
use super::shares::Shares;
use super::sums::{At, Given, put_at, sum_at, without};
use super::{Leaving, Stage};
use crate::device::Array;
use crate::kernels::colour_edits::{ColourEdit, Edited, colour_edits};
use crate::memo::Key;
use crate::transport::atoms;
use crate::transport::edits::{Change, Transit};
use crate::transport::{Edits, Sampled, Selection};
use crate::{Result, memory};
use std::sync::Arc;

/// A list of transit edits made ready for one transfer: which casters it tells apart.
pub struct Between<'a> {
    stage: &'a Stage<'a>,
    edits: Vec<&'a Transit>,
    /// Index into `atoms.members` of each edit's caster; `None`: everything.
    caster: Vec<Option<usize>>,
    atoms: Arc<Atoms>,
    sampled: Option<&'a Sampled>,
}

/// The parts that casters split light into: see `atoms::Atoms`.
struct Atoms {
    shares: Vec<Arc<Shares>>,
    members: Vec<Vec<usize>>,
}

/// Per edit of the list, where it has a curve: its gain at each view sample, 1 where the edit does not reach.
pub type Gains = Vec<Option<Array<f32>>>;

/// Light at the samples of a lane.
pub struct Arriving {
    pub light: Light,
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
        Ok(Self { stage, atoms: Atoms::new(stage, &distinct)?, edits, caster, sampled })
    }

    /// Parts that the light is split into.
    pub fn parts(&self) -> usize {
        self.atoms.shares.len()
    }

    /// The edited light at all samples of a lane. Samples that no edit's receiver holds keep every bit of the whole.
    /// `gains`: of the curves, where they were found already, at the diffuse lane.
    pub fn arriving(&self, lane: &Lane, leaving: &Leaving, gains: Option<&Gains>) -> Result<Arriving> {
        let whole = || self.paths(lane, leaving, None)?.light(&[], None);
        let mut gains = gains.cloned().unwrap_or_else(|| vec![None; self.edits.len()]);
        if self.edits.is_empty() {
            return Ok(Arriving { light: whole()?, gains });
        }
        let reach = Reach::new(self.stage, &self.edits, lane)?;
        if reach.count == 0 {
            return Ok(Arriving { light: whole()?, gains });
        }
        let bytes = 2 * self.parts() as u64 * reach.light_bytes();
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
                put_at(&mut light, At { places: Some(positions), weights: None, light: Given::Each(&edited) });
                light
            }
        };
        Ok(Arriving { light: Arc::new(light), gains })
    }

    fn paths<'b>(&'b self, lane: &'b Lane<'b>, leaving: &'b Leaving, atom: Option<usize>) -> Result<Paths<'b>> {
        Paths::new(self.stage, lane, leaving, atom.map(|atom| &self.atoms.shares[atom]), self.sampled)
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
        let everything = self.paths(lane, leaving, None)?.light(&on_all, reach.positions.as_ref())?;
        let mut atoms = vec![everything.clone()];
        // Of each atom, the light to take out of the first.
        let mut taken = Vec::new();
        for atom in 1..self.parts() {
            let tells = (0..prefix).filter(|&e| self.caster[e].is_some() && self.acts_on(e, atom));
            let found = reach.where_any(self.stage, &tells.collect::<Vec<_>>())?;
            let Some(told) = found.as_ref() else {
                atoms.push(Arc::default());
                continue;
            };
            let on_atom = path_edits(Some(atom));
            let paths = self.paths(lane, leaving, Some(atom))?;
            let changed = paths.light(&on_atom, told.positions.as_ref())?;
            let before = match on_atom.len() == on_all.len() {
                true => changed.clone(),
                false => paths.light(&on_all, told.positions.as_ref())?,
            };
            atoms.push(match &told.places {
                None => changed,
                Some(_) => Arc::new(sum_at(reach.count, &[told.light(&changed)])),
            });
            taken.push((found, before));
        }
        if !taken.is_empty() {
            let at = taken.iter().filter_map(|(found, light)| Some(Option::as_ref(found)?.light(light)));
            atoms[0] = Arc::new(without(&everything, &at.collect::<Vec<_>>()));
        }
        Ok(atoms)
    }
}

impl Atoms {
    /// Depends on the casters alone, so it is kept while numbers of edits change.
    fn new(stage: &Stage, casters: &[&Arc<Selection>]) -> Result<Arc<Self>> {
        let digests: Vec<[u8; 16]> = casters.iter().map(|caster| caster.digest()).collect();
        let key = Key::of(&[b"atoms", &stage.place.0, digests.as_flattened()]);
        let bytes = |atoms: &Self| atoms.shares.iter().map(|shares| shares.bytes()).sum();
        stage.memo.remember(key, bytes, || {
            let weights: Vec<Vec<f32>> =
                casters.iter().map(|caster| Ok(stage.at_gather(caster)?.to_vec())).collect::<Result<_>>()?;
            let atoms::Atoms { shares, members } = atoms::split(stage.transfer.gather.count(), &weights)?;
            let named = |weights: Vec<f32>| {
                let key = Key::of(&[b"shares", bytemuck::cast_slice(&weights)]);
                Arc::new(Shares::new(weights, key))
            };
            Ok(Self { shares: shares.into_iter().map(named).collect(), members })
        })
    }
}
