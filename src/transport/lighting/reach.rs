//! Where a list of edits reaches in a lane.

use super::lane::Lane;
use super::positions::{Positions, TILE, at_positions, gathered};
use super::sums::{At, Given};
use super::{Stage, VEC4};
use crate::Result;
use crate::device::Array;
use crate::memo::Key;
use crate::transport::edits::Transit;
use rayon::prelude::*;
use std::sync::Arc;

/// Depends on selections alone, so it is kept while numbers of edits change.
pub struct Reach {
    /// `None`: everywhere.
    pub positions: Option<Positions>,
    pub count: usize,
    /// Per edit: weights of its receiver there; `None` is 1.
    pub receivers: Vec<Option<Array<f32>>>,
    /// Per edit: names its receiver.
    names: Vec<[u8; 16]>,
    key: Key,
}

/// Where some edits of a list act.
pub struct Where {
    /// Places in the reach; `None`: all.
    pub places: Option<Vec<u32>>,
    /// What they are in the lane; `None`: everywhere.
    pub positions: Option<Positions>,
}

impl Reach {
    pub fn new(stage: &Stage, edits: &[&Transit], lane: &Lane) -> Result<Arc<Self>> {
        let name = |edit: &&Transit| edit.block.receiver.as_ref().map_or([0; 16], |receiver| receiver.digest());
        let names: Vec<[u8; 16]> = edits.iter().map(name).collect();
        let key = Key::of(&[b"reach", &lane.key.0, names.as_flattened()]);
        stage.memo.remember(key, Self::bytes, || {
            let at_all = |edit: &&Transit| match &edit.block.receiver {
                Some(receiver) => at_positions(stage, lane, receiver, None).map(Some),
                None => Ok(None),
            };
            let all: Vec<Option<Array<f32>>> = edits.iter().map(at_all).collect::<Result<_>>()?;
            if all.iter().any(Option::is_none) {
                return Ok(Self { positions: None, count: lane.count(), receivers: all, names, key });
            }
            let weights: Vec<&Array<f32>> = all.iter().flatten().collect();
            let positions = Positions::new(anywhere(lane.count(), &weights));
            let at = |weights: &Array<f32>| gathered(&positions, |i| weights[i as usize]).into();
            let receivers = all.iter().map(|weights| weights.as_ref().map(at)).collect();
            Ok(Self { count: positions.len(), positions: Some(positions), receivers, names, key })
        })
    }

    fn bytes(&self) -> u64 {
        let receivers = self.receivers.iter().flatten().map(|weights| 4 * weights.len() as u64);
        receivers.sum::<u64>() + self.positions.as_ref().map_or(0, Positions::bytes)
    }

    /// Where any of these edits acts; nothing when they act nowhere.
    pub fn where_any(&self, stage: &Stage, edits: &[usize]) -> Result<Arc<Option<Where>>> {
        let mut names: Vec<[u8; 16]> = edits.iter().map(|&edit| self.names[edit]).collect();
        names.sort();
        names.dedup();
        let key = Key::of(&[b"where", &self.key.0, names.as_flattened()]);
        let bytes = |found: &Option<Where>| found.as_ref().map_or(1, Where::bytes);
        stage.memo.remember(key, bytes, || {
            let everywhere = Where { places: None, positions: self.positions.clone() };
            let weights: Option<Vec<_>> = edits.iter().map(|&edit| self.receivers[edit].as_ref()).collect();
            let Some(weights) = weights else { return Ok(Some(everywhere)) };
            let places = anywhere(self.count, &weights);
            if places.len() == self.count {
                return Ok(Some(everywhere));
            }
            let positions = Positions::new(gathered(&places, |place| self.position(place as usize)));
            Ok((!places.is_empty()).then_some(Where { places: Some(places), positions: Some(positions) }))
        })
    }

    fn position(&self, place: usize) -> u32 {
        self.positions.as_ref().map_or(place as u32, |positions| positions[place])
    }

    /// From all view samples to here.
    pub fn of_view(&self, lane: &Lane, values: &Array<f32>) -> Array<f32> {
        let value = |place: usize| values[lane.view_sample(self.position(place) as usize)];
        (0..self.count).into_par_iter().with_min_len(TILE).map(value).collect::<Vec<_>>().into()
    }

    /// From here to all view samples; 1 elsewhere.
    pub fn to_view(&self, lane: &Lane, values: Vec<f32>, count: usize) -> Array<f32> {
        if self.positions.is_none() && lane.samples.is_none() {
            return values.into();
        }
        let mut all = vec![1.0; count];
        for (place, value) in values.into_iter().enumerate() {
            all[lane.view_sample(self.position(place) as usize)] = value;
        }
        all.into()
    }

    /// Of light at all places.
    pub fn light_bytes(&self) -> u64 {
        VEC4 * self.count as u64
    }
}

impl Where {
    /// Light, one element a place.
    pub fn light<'a>(&'a self, light: &'a [[f32; 4]]) -> At<'a> {
        At { places: self.places.as_deref(), weights: None, light: Given::Each(light) }
    }

    fn bytes(&self) -> u64 {
        let places = self.places.as_ref().map_or(0, Vec::len) as u64;
        4 * places + self.positions.as_ref().map_or(0, Positions::bytes)
    }
}

/// Of `count` places, those where any of the weights is above 0.
fn anywhere(count: usize, weights: &[&Array<f32>]) -> Vec<u32> {
    let reached = |&i: &u32| weights.iter().any(|weights| weights[i as usize] > 0.0);
    (0..count as u32).into_par_iter().with_min_len(TILE).filter(reached).collect()
}
