//! Times `integrate` by itself: the picture of a recipe's first integrate node, without edits of shadows.

use super::{head, measure, print};
use crate::device::Device;
use crate::eval::{Context, Evaluator, Memory, Options};
use crate::graph::Plan;
use crate::progress::{Progress, Silent};
use crate::transport::shadow::integrate::Stage;
use crate::value::Value;
use crate::{Error, Result};
use std::sync::atomic::AtomicBool;

/// With nothing remembered, then with what the node remembers of the same light.
pub fn run(plan: &Plan, device: Device, runs: u32) -> Result<()> {
    let Some(step) = plan.steps.iter().find(|step| step.node_type.info.name == "integrate") else { return Ok(()) };
    let evaluator = Evaluator::new(Options::new(device));
    let never = AtomicBool::new(false);
    let context = Context { cancel: &never, ..Context::SILENT };
    let targets: Vec<usize> = step.inputs.iter().flatten().map(|wire| wire.step).collect();
    let (mut visibility, mut transport) = (None, None);
    for value in evaluator.evaluate(plan, &targets, plan.frames[0], &context, &mut Vec::new())?.into_iter().flatten() {
        match value {
            Value::Visibility(found) => visibility = Some((*found).clone()),
            Value::Transport(found) => transport = Some(found),
            _ => {}
        }
    }
    let (Some(mut visibility), Some(transport)) = (visibility, transport) else {
        return Err(Error::usage("the integrate node has no visibility or transport", "connect both"));
    };
    visibility.edits.clear();
    head("in process");
    let mut failure = Ok(());
    let kept = Memory::new(1 << 30);
    for (name, fresh) in [(", light new", true), (", light kept", false)] {
        let (median, best) = measure(runs, || {
            let new = Memory::new(1 << 30);
            let memo = if fresh { &new } else { &kept };
            let stage = Stage { device: evaluator.device(), memo, visibility: &visibility, transport: &transport };
            if let Err(error) = stage.layers(Progress { node: &step.name, sink: &Silent, cancel: &never }) {
                failure = Err(error);
            }
        });
        print(&format!("{:<60} {median:>8.1} {best:>8.1}\n", format!("{}: integrate, no edits{name}", step.name)));
    }
    failure
}
