//! Offset rows of weakened shadows: paths that the transfer lacks, so no scale of it can make them (thesis Algorithm 10).

use super::field::PathField;
use crate::Result;
use crate::memo::Key;
use crate::transport::edits::{Change, Transit};
use crate::transport::hidden::{Hidden, hidden_rows};
use crate::transport::lighting::Stage;
use crate::transport::sampled::fit::fit_towards;
use crate::transport::sampled::row::Row;
use glam::Vec3;
use std::collections::HashMap;
use std::sync::Arc;

/// Edits of shadows that share a caster, and what they uncover.
pub struct Uncovered {
    /// Numbers of the edits among the steps, and their amounts.
    edits: Vec<(usize, f32)>,
    hidden: Arc<Hidden>,
}

impl Uncovered {
    /// Of all shadow edits of the middle; `wanted`: the transfer's rows that they can reach.
    pub fn all(stage: &Stage, middle: &[(usize, &Transit)], wanted: &[bool]) -> Result<Vec<Self>> {
        let mut casters: Vec<([u8; 16], Self)> = Vec::new();
        for (step, (_, edit)) in middle.iter().enumerate() {
            let Change::Shadow { amount } = edit.change else { continue };
            let caster = edit.block.caster.as_ref();
            let digest = caster.map_or([0; 16], |caster| caster.digest());
            if let Some((_, known)) = casters.iter_mut().find(|(known, _)| *known == digest) {
                known.edits.push((step, amount));
                continue;
            }
            let senders = match caster {
                Some(caster) => stage.at_gather(caster)?.to_vec(),
                None => vec![1.0; stage.transfer.gather.count()],
            };
            let rows: Vec<u8> = wanted.iter().map(|wanted| u8::from(*wanted)).collect();
            let key = Key::of(&[b"uncovered", &stage.place.0, &digest, &rows]);
            let hidden = stage.memo.keep(key, Hidden::bytes, || {
                hidden_rows(stage.device, stage.geometry, stage.transfer, &senders, wanted, stage.progress)
            })?;
            casters.push((digest, Self { edits: vec![(step, amount)], hidden }));
        }
        Ok(casters.into_iter().map(|(_, uncovered)| uncovered).collect())
    }

    /// Adds to `row` the paths that these edits add at a row of the transfer, as the other edits of its field change them.
    pub fn add(&self, field: &PathField, transfer_row: usize, row: &mut Row) {
        let senders = field.senders;
        let kept: f32 = self.edits.iter().map(|(step, amount)| 1.0 - amount * field.weights[*step]).product();
        let amount = 1.0 - kept;
        if amount == 0.0 {
            return;
        }
        let first = self.edits[0].0;
        let paths = self.hidden.rows.row(transfer_row).map(|(node, weight)| {
            let caster = senders.caster[first].as_ref().map_or(1.0, |caster| caster[node]);
            let (original, edited, grey) = field.edited(node);
            let scale = fit_towards(original, edited, grey).0;
            (node, scale * (weight * amount * caster))
        });
        spread(senders.patches.count(), paths, row);
    }
}

/// The Haar coefficients of weights that are spread evenly over the leaves of nodes: each reaches the wavelets of its
/// node's ancestors, `+-w / sqrt(leaves of the ancestor)`, and the mean, `w / sqrt(M)`.
fn spread(count: usize, nodes: impl Iterator<Item = (usize, Vec3)>, row: &mut Row) {
    let mut sums: HashMap<u32, Vec3> = row.coefficients.drain(..).collect();
    for (mut node, weight) in nodes {
        *sums.entry(0).or_default() += weight / (count as f32).sqrt();
        while node > 1 {
            let parent = node / 2;
            let leaves = count >> parent.ilog2();
            let sign = if node % 2 == 0 { 1.0 } else { -1.0 };
            *sums.entry(parent as u32).or_default() += weight * (sign / (leaves as f32).sqrt());
            node = parent;
        }
    }
    row.coefficients.extend(sums);
    row.coefficients.sort_unstable_by_key(|coefficient| coefficient.0);
}
