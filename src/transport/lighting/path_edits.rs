//! What edits of single paths ask for, whatever their casters and receivers: names, factors, and how much of what is
//! hidden they let through.

use super::Stage;
use crate::Result;
use crate::memo::Key;
use crate::transport::edits::{Change, Transit};
use crate::transport::ways::Factors;
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
pub fn factors(stage: &Stage, edits: &[&Transit]) -> Result<Option<Factors>> {
    let nearest = stage.transfer.gather.spacing();
    let is_falloff = |change: &&Change| matches!(change, Change::Falloff { .. });
    let is_side = |change: &&Change| matches!(change, Change::Directionality { .. });
    let (falloffs, sides) = (some(edits, is_falloff), some(edits, is_side));
    if falloffs.is_empty() && sides.is_empty() {
        return Ok(None);
    }
    // Each table is kept by itself: a slider moves one, and the lists of many casters ask for it.
    let distance = table(stage, &falloffs, &nearest.to_le_bytes(), || {
        let mut factors = Factors::default();
        for change in &falloffs {
            let Change::Falloff { exponent, distance } = change else { continue };
            factors.by_distance(|d| (d.max(nearest) / distance).powf(2.0 - exponent).min(f32::MAX));
        }
        factors.distance
    })?;
    let direction = table(stage, &sides, b"", || {
        let mut factors = Factors::default();
        for change in &sides {
            let Change::Directionality { axis, amount, focus } = change else { continue };
            factors.by_direction(|v| {
                let half = 0.5 + 0.5 * v.dot(*axis);
                1.0 + amount * ((focus + 1.0) * half.max(0.0).powf(*focus) - 1.0)
            });
        }
        factors.direction
    })?;
    Ok(Some(Factors { distance: distance.to_vec(), direction: direction.to_vec() }))
}

fn some<'e>(edits: &[&'e Transit], is: impl Fn(&&'e Change) -> bool) -> Vec<&'e Change> {
    edits.iter().map(|edit| &edit.change).filter(is).collect()
}

/// One element a code.
fn table(stage: &Stage, changes: &[&Change], limit: &[u8], make: impl FnOnce() -> Vec<f32>) -> Result<Arc<Vec<f32>>> {
    let numbers: Vec<f32> = changes.iter().flat_map(|change| numbers(change)).collect();
    let key = Key::of(&[b"factors", limit, bytemuck::cast_slice(&numbers)]);
    stage.memo.remember(key, |table: &Vec<f32>| 4 * table.len() as u64, || Ok(make()))
}
