//! Which precomputations several chunks of a batch share, found from keys, without computing any.

use crate::Result;
use crate::device::Device;
use crate::eval::{Evaluator, Options};
use crate::graph::Plan;
use crate::node::Key;
use std::collections::BTreeMap;

/// Frames that need all that is shared: of each shared value the first frame that asks for it.
///
/// # Errors
/// As `Evaluator::tasks`.
pub fn frames(plan: &Plan, targets: &[usize], chunks: &[&[i64]]) -> Result<Vec<i64>> {
    let evaluator = Evaluator::new(Options::new(Device::Cpu));
    // Chunks that ask for a value, and the first frame that does.
    let mut asked: BTreeMap<Key, (Vec<usize>, i64)> = BTreeMap::new();
    for (number, chunk) in chunks.iter().enumerate() {
        for &frame in *chunk {
            for task in evaluator.tasks(plan, targets, frame)?.list {
                if plan.steps[task.step].node_type.info.in_parts {
                    let (chunks, _) = asked.entry(task.key).or_insert((Vec::new(), frame));
                    if chunks.last() != Some(&number) {
                        chunks.push(number);
                    }
                }
            }
        }
    }
    let mut frames: Vec<i64> =
        asked.into_values().filter(|(chunks, _)| chunks.len() > 1).map(|(_, frame)| frame).collect();
    frames.sort_unstable();
    frames.dedup();
    Ok(frames)
}
