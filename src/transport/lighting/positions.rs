//! Which samples of a lane: lists of numbers that carry a name, so that keys do not hash them again and again.

use super::Stage;
use super::lane::Lane;
use crate::Result;
use crate::device::Array;
use crate::memo::Key;
use crate::transport::Selection;
use rayon::prelude::*;
use std::ops::Deref;
use std::sync::Arc;

/// Samples that one task works on.
pub const TILE: usize = 4096;

/// Numbers of samples, ascending.
#[derive(Clone)]
pub struct Positions {
    numbers: Arc<Vec<u32>>,
    key: Key,
}

impl Positions {
    pub fn new(numbers: Vec<u32>) -> Self {
        let key = Key::of(&[b"positions", bytemuck::cast_slice(&numbers)]);
        Self { numbers: Arc::new(numbers), key }
    }

    /// Names the numbers; `None` is all samples.
    pub fn name(positions: Option<&Self>) -> [u8; 16] {
        positions.map_or([0; 16], |positions| positions.key.0)
    }

    pub fn bytes(&self) -> u64 {
        4 * self.len() as u64
    }
}

impl Deref for Positions {
    type Target = [u32];
    fn deref(&self) -> &[u32] {
        &self.numbers
    }
}

/// Weights of a selection at positions of a lane.
pub fn at_positions(
    stage: &Stage,
    lane: &Lane,
    selection: &Arc<Selection>,
    positions: Option<&Positions>,
) -> Result<Array<f32>> {
    let weights = stage.at_view(selection)?;
    let at = |position: usize| weights[lane.view_sample(position)];
    Ok(match positions {
        Some(positions) => gathered(positions, |position| at(position as usize)).into(),
        None if lane.samples.is_none() => (*weights).clone(),
        None => (0..lane.count()).into_par_iter().with_min_len(TILE).map(at).collect::<Vec<_>>().into(),
    })
}

/// A value of each of some numbers.
pub fn gathered<T: Send>(numbers: &[u32], value: impl Fn(u32) -> T + Sync) -> Vec<T> {
    numbers.par_iter().with_min_len(TILE).map(|&number| value(number)).collect()
}
