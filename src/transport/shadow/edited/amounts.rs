//! How much each edit of a list does at each sample.

use crate::scene::SurfacePoint;
use crate::transport::shadow::{ShadowChange, ShadowEdit};
use glam::Vec3;
use rayon::prelude::*;

/// Weights of an edit's selection at the samples.
pub fn selected(edit: &ShadowEdit, points: &[SurfacePoint]) -> Vec<f32> {
    match &edit.selection {
        Some(selection) => selection.weights(points),
        None => points.iter().map(|point| f32::from(u8::from(point.exists()))).collect(),
    }
}

/// Of one edit: per sample, the share of its shadow that the edit's result replaces, before lamp and colour.
pub fn amounts(edit: &ShadowEdit, points: &[SurfacePoint], selected: &[f32]) -> Vec<f32> {
    let mut amounts = selected.to_vec();
    match edit.change {
        ShadowChange::Fade { amount } | ShadowChange::Tint { amount, .. } => {
            amounts.iter_mut().for_each(|share| *share *= amount);
        }
        ShadowChange::Gradient { amount, from, to } => {
            let along = to - from;
            let scale = 1.0 / along.length_squared();
            amounts.par_iter_mut().zip(points).with_min_len(4096).for_each(|(share, point)| {
                let way = ((Vec3::from(point.position) - from).dot(along) * scale).clamp(0.0, 1.0);
                *share *= amount * way;
            });
        }
        ShadowChange::Move { .. } | ShadowChange::Turn { .. } | ShadowChange::Blur { .. } => {}
    }
    amounts
}

/// What an edit's amount is multiplied with in each colour.
pub fn colour(edit: &ShadowEdit) -> Vec3 {
    match edit.change {
        ShadowChange::Tint { colour, .. } => colour,
        _ => Vec3::ONE,
    }
}
