//! Edits of a list that change nothing in a view, because no sample lies where they act.

use super::Stage;
use crate::Result;
use crate::device::Array;
use crate::memo::Key;
use crate::transport::{Edit, Edits, Selection};
use std::sync::Arc;

/// One line an edit, with its place in the list (from 1), its kind and the reason.
pub fn idle(stage: &Stage, edits: &Edits) -> Result<Vec<String>> {
    let nowhere = |what: &[u8], selection: &Selection, weights: &dyn Fn() -> Result<Arc<Array<f32>>>| -> Result<bool> {
        let key = Key::of(&[b"nowhere", what, &stage.place.0, &selection.digest()]);
        Ok(*stage.memo.remember(key, |_| 1, || Ok(weights()?.iter().all(|&weight| weight == 0.0)))?)
    };
    let unsent = |caster: &Arc<Selection>| nowhere(b"gather", caster, &|| stage.at_gather(caster));
    let unseen = |receiver: &Arc<Selection>| nowhere(b"view", receiver, &|| stage.at_view(receiver));
    let mut lines = Vec::new();
    for (number, edit) in edits.0.iter().enumerate() {
        let [sends, receives] = match edit {
            Edit::Source(brush) => [brush.selection.as_ref(), None],
            Edit::Transit(transit) => [transit.block.caster.as_ref(), transit.block.receiver.as_ref()],
            Edit::Eye(brush) => [None, brush.selection.as_ref()],
            Edit::Sampled(_) => [None, None],
        };
        let why = match (sends, receives) {
            (Some(caster), _) if unsent(caster)? => {
                "no gather sample lies in what sends its light: select more, or raise gather_samples"
            }
            (_, Some(receiver)) if unseen(receiver)? => {
                "nothing that it acts on is in view: select more, or turn the camera"
            }
            _ => continue,
        };
        lines.push(format!("edit {} of {} ({}) changes nothing here: {why}", number + 1, edits.0.len(), edit.kind()));
    }
    Ok(lines)
}
