//! Which view samples share rows: those that the same edits reach with the same weights.

use super::split::Split;
use crate::Result;
use crate::device::Array;
use crate::memo::Key;
use crate::transport::lighting::Stage;
use crate::transport::{Selection, Transfer};
use std::collections::HashMap;
use std::sync::Arc;

/// Steps of a soft weight where edits of different receivers meet. Alone, a weight counts as it is.
const STEPS: f32 = 64.0;

/// The edits that act on some view samples.
pub struct Class {
    /// Weight of each edit of the middle, in its order; 0 where it does not act.
    pub weights: Vec<f32>,
}

/// View samples that edits of the middle reach.
pub struct Touched {
    pub classes: Vec<Class>,
    /// Number of each in the picture, increasing.
    pub samples: Vec<u32>,
    /// Of each: its class, and what the rows of the class count for it.
    pub class: Vec<u32>,
    pub factor: Vec<f32>,
}

impl Touched {
    pub fn new(stage: &Stage, split: &Split) -> Result<Arc<Self>> {
        let digest = |receiver: &Arc<Selection>| receiver.digest();
        let receivers: Vec<[u8; 16]> =
            split.middle.iter().map(|(_, edit)| edit.block.receiver.as_ref().map_or([0; 16], digest)).collect();
        let key = Key::of(&[b"touched", &stage.place.0, bytemuck::cast_slice(&receivers)]);
        stage.memo.remember(key, |touched: &Self| 12 * touched.samples.len() as u64, || Self::find(stage, split))
    }

    fn find(stage: &Stage, split: &Split) -> Result<Self> {
        let receivers: Vec<Option<Arc<Array<f32>>>> = split
            .middle
            .iter()
            .map(|(_, edit)| edit.block.receiver.as_ref().map(|receiver| stage.at_view(receiver)).transpose())
            .collect::<Result<_>>()?;
        let mut touched = Self { classes: Vec::new(), samples: Vec::new(), class: Vec::new(), factor: Vec::new() };
        let mut known: HashMap<Vec<u8>, u32> = HashMap::new();
        let mut steps = vec![0u8; receivers.len()];
        for (sample, point) in stage.transfer.samples.points.iter().enumerate() {
            let weight = |r: &Option<Arc<Array<f32>>>| r.as_ref().map_or(1.0, |weights| weights[sample]);
            let acting = receivers.iter().filter(|r| weight(r) > 0.0).count();
            if acting == 0 || !point.exists() {
                continue;
            }
            let mut factor = 1.0;
            for (step, receiver) in steps.iter_mut().zip(&receivers) {
                let weight = weight(receiver);
                // An edit that acts alone is linear in its weight.
                *step = match acting {
                    1 if weight > 0.0 => {
                        factor = weight;
                        STEPS as u8
                    }
                    _ => (weight * STEPS).round() as u8,
                };
            }
            let class = match known.get(&steps) {
                Some(class) => *class,
                None => {
                    let weights = steps.iter().map(|&step| f32::from(step) / STEPS).collect();
                    touched.classes.push(Class { weights });
                    known.insert(steps.clone(), touched.classes.len() as u32 - 1);
                    touched.classes.len() as u32 - 1
                }
            };
            touched.samples.push(sample as u32);
            touched.class.push(class);
            touched.factor.push(factor);
        }
        Ok(touched)
    }

    /// Rows of the transfer that touched samples interpolate between.
    pub fn transfer_rows(&self, transfer: &Transfer) -> Vec<bool> {
        let mut is = vec![false; transfer.rows.rows()];
        for &sample in &self.samples {
            let (rows, weights) = (transfer.indices[sample as usize], transfer.weights[sample as usize]);
            (0..4).filter(|&j| weights[j] != 0.0).for_each(|j| is[rows[j] as usize] = true);
        }
        is
    }
}
