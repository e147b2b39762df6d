//! Source brushes at the gather samples: what they do together, and to which samples.

use super::Stage;
use super::shares::Shares;
use crate::Result;
use crate::device::Array;
use crate::memo::Key;
use crate::transport::Selection;
use crate::transport::edits::{SourceBrush, SourceChange};
use std::sync::Arc;

/// Names a brush.
pub fn digest(brush: &SourceBrush) -> [u8; 16] {
    let selection = brush.selection.as_ref().map_or([0; 16], |selection| selection.digest());
    let numbers = [brush.scale, brush.offset.x, brush.offset.y, brush.offset.z];
    Key::of(&[b"source", &selection, bytemuck::cast_slice(&numbers)]).0
}

/// All brushes at the gather samples.
pub fn source_change(stage: &Stage, brushes: &[&SourceBrush]) -> Result<SourceChange> {
    let mut all = SourceChange::default();
    for brush in brushes {
        let weights = brush.selection.as_ref().map(|selection| stage.at_gather(selection)).transpose()?;
        all.add(brush, weights.as_ref().map(|weights| &weights[..]), stage.transfer.gather.count());
    }
    Ok(all)
}

/// Gather samples that some brush touches, and all others: 1 each.
pub struct Touched {
    pub samples: Arc<Shares>,
    pub rest: Arc<Shares>,
}

impl Touched {
    /// `None` when all samples are alike: without brushes, or with one that has no selection.
    pub fn new(stage: &Stage, brushes: &[&SourceBrush]) -> Result<Option<Arc<Self>>> {
        let Some(selections) = brushes.iter().map(|brush| brush.selection.as_ref()).collect::<Option<Vec<_>>>() else {
            return Ok(None);
        };
        let digests: Vec<[u8; 16]> = selections.iter().map(|selection| selection.digest()).collect();
        let name = |what: &[u8]| Key::of(&[what, &stage.place.0, digests.as_flattened()]);
        let bytes = |touched: &Self| touched.samples.bytes() + touched.rest.bytes();
        let touched = stage.memo.remember(name(b"brushed"), bytes, || {
            let at = |selection: &&Arc<Selection>| stage.at_gather(selection);
            let weights: Vec<Arc<Array<f32>>> = selections.iter().map(at).collect::<Result<_>>()?;
            let is_touched = |g: usize| weights.iter().any(|weights| weights[g] != 0.0);
            let shares = |which: bool, what: &[u8]| {
                let weights = (0..stage.transfer.gather.count()).map(|g| f32::from(is_touched(g) == which)).collect();
                Arc::new(Shares::new(weights, name(what)))
            };
            Ok(Self { samples: shares(true, b"touched"), rest: shares(false, b"untouched") })
        })?;
        Ok(Some(touched).filter(|touched| !touched.samples.are_none && !touched.rest.are_none))
    }
}
