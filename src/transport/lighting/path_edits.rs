//! What edits of single paths ask for, whatever their casters and receivers: names, factors, and how much of what is
//! hidden they let through.

use super::Stage;
use crate::Result;
use crate::memo::Key;
use crate::transport::edits::{Change, Transit};
use crate::transport::ways::{CODES, Factors};
use std::sync::Arc;

/// Names a path edit, its receiver included; whose light it acts on is for the caller to say.
fn edit_key(edit: &Transit) -> Key {
    let receiver = edit.block.receiver.as_ref().map_or([0; 16], |receiver| receiver.digest());
    Key::of(&[bytemuck::cast_slice(&numbers(&edit.change)), &receiver])
}

/// Names a list of path edits.
pub fn list_key(edits: &[&Transit]) -> Key {
    let keys: Vec<[u8; 16]> = edits.iter().map(|edit| edit_key(edit).0).collect();
    Key::of(&[b"path edits", keys.as_flattened()])
}

fn numbers(change: &Change) -> Vec<f32> {
    match change {
        Change::Falloff { exponent, distance } => vec![0.0, *exponent, *distance],
        Change::Shadow { amount } => vec![1.0, *amount],
        Change::Directionality { axis, amount, focus } => vec![2.0, axis.x, axis.y, axis.z, *amount, *focus],
        Change::Colour(_) => unreachable!("colours do not change paths"),
    }
}

/// Share of what is hidden that a list lets through: each edit a share of what those before it left.
pub fn unhidden(edits: &[&Transit]) -> f32 {
    let kept = edits.iter().map(|edit| match edit.change {
        Change::Shadow { amount } => 1.0 - amount,
        _ => 1.0,
    });
    1.0 - kept.product::<f32>()
}

/// All factors of a list; `None` when nothing in it multiplies. Light from nearer than a gather sample's spacing counts
/// as from there: gather samples say no more, and steep falloffs would have no bound.
pub fn factors(stage: &Stage, edits: &[&Transit]) -> Result<Option<Arc<Factors>>> {
    let nearest = stage.transfer.gather.spacing();
    let multiplies = |edit: &&&Transit| matches!(edit.change, Change::Falloff { .. } | Change::Directionality { .. });
    let edits: Vec<&Transit> = edits.iter().filter(multiplies).copied().collect();
    if edits.is_empty() {
        return Ok(None);
    }
    let changes: Vec<Key> = edits.iter().map(|edit| Key::of(&[bytemuck::cast_slice(&numbers(&edit.change))])).collect();
    let changes: Vec<[u8; 16]> = changes.iter().map(|key| key.0).collect();
    let key = Key::of(&[b"factors", &nearest.to_le_bytes(), changes.as_flattened()]);
    let make = || {
        let mut factors = Factors::default();
        for edit in edits {
            match edit.change {
                Change::Falloff { exponent, distance } => {
                    factors.by_distance(|d| (d.max(nearest) / distance).powf(2.0 - exponent).min(f32::MAX));
                }
                Change::Directionality { axis, amount, focus } => factors.by_direction(|v| {
                    let half = 0.5 + 0.5 * v.dot(axis);
                    1.0 + amount * ((focus + 1.0) * half.max(0.0).powf(focus) - 1.0)
                }),
                Change::Shadow { .. } | Change::Colour(_) => {}
            }
        }
        Ok(factors)
    };
    stage.memo.remember(key, |_| 8 * CODES as u64, make).map(Some)
}
