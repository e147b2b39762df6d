//! Times the pictures of final_gather nodes: the first one that is shown and the finished one, with edits and without.

use super::print;
use crate::Result;
use crate::device::Device;
use crate::eval::{Context, Evaluator, Options};
use crate::graph::{Plan, Step};
use crate::node::{Facet, Inputs, Job, Key, NoMemo};
use crate::value::{Kind, Value};
use serde_json::Map;
use std::sync::Mutex;
use std::time::Instant;

/// Every final_gather node of a recipe, `runs` times each way by turns, because the machine's speed drifts.
pub fn run(plan: &Plan, device: Device, runs: u32) -> Result<()> {
    let evaluator = Evaluator::new(Options::new(device));
    for step in plan.steps.iter().filter(|step| step.node_type.info.name == "final_gather") {
        measured(plan, step, &evaluator, runs)?;
    }
    Ok(())
}

/// Seconds to the first picture and to the last; the error that the node states, in per cent.
#[derive(Clone, Copy)]
struct Times {
    first: f64,
    last: f64,
    error: f64,
}

fn measured(plan: &Plan, step: &Step, evaluator: &Evaluator, runs: u32) -> Result<()> {
    let targets: Vec<usize> = step.inputs.iter().flatten().map(|wire| wire.step).collect();
    let frame = plan.frames[0];
    let mut found = evaluator.evaluate(plan, &targets, frame, &Context::SILENT, &mut Vec::new())?.into_iter();
    let mut given = |wire: &Option<crate::graph::Wire>| {
        wire.map(|wire| found.next().expect("one for each wire")[wire.output].clone())
    };
    let values: Vec<Option<Value>> = step.inputs.iter().map(&mut given).collect();
    let node = step.node(frame as f64)?.node;
    let render = |edited: bool| -> Result<Times> {
        let port = |(port, value): (usize, &Option<Value>)| {
            let value = value.clone().filter(|value| edited || value.kind() != Kind::Edits)?;
            Some((value, Facet::ALL.map(|facet| Key::of(&[&[port as u8, facet as u8]]))))
        };
        let inputs = Inputs {
            info: step.node_type.info,
            values: values.iter().enumerate().map(port).collect(),
            at_frames: Vec::new(),
            connected: step.inputs.iter().map(Option::is_some).collect(),
        };
        let (start, first, notes) = (Instant::now(), Mutex::new(None), Mutex::new(Map::new()));
        let show = |_: Vec<Value>| {
            first.lock().expect("no panic while timing").get_or_insert_with(|| start.elapsed().as_secs_f64());
        };
        let job = Job { show: Some(&show), ..Job::alone(evaluator.device(), &NoMemo, &notes) };
        node.run(&inputs, &job)?;
        let last = start.elapsed().as_secs_f64();
        let notes = notes.lock().expect("no panic while timing");
        let error = 100.0 * notes.get("error").and_then(serde_json::Value::as_f64).unwrap_or(f64::NAN);
        let first = first.lock().expect("no panic while timing").unwrap_or(last);
        Ok(Times { first, last, error })
    };
    let is_edited = values.iter().flatten().any(|value| value.kind() == Kind::Edits);
    let (mut with, mut without) = (Vec::new(), Vec::new());
    for run in 0..runs {
        // Each comes first by turns.
        for edited in [run % 2 == 1, run % 2 == 0] {
            match edited {
                true if is_edited => with.push(render(true)?),
                true => {}
                false => without.push(render(false)?),
            }
        }
    }
    print(&format!("{:<44} {:>12} {:>12} {:>12}\n", step.name, "first s", "finished s", "error %"));
    let tell = |name: &str, times: &[Times]| {
        let median = |of: fn(&Times) -> f64| quantile(times.iter().map(of).collect(), 0.5);
        let [first, last, error] = [median(|t| t.first), median(|t| t.last), median(|t| t.error)];
        print(&format!("{name:<44} {first:>12.2} {last:>12.2} {error:>12.2}\n"));
    };
    tell("without edits", &without);
    if is_edited {
        tell("with edits", &with);
        let ratios: Vec<f64> = with.iter().zip(&without).map(|(with, without)| with.last / without.last).collect();
        for (name, share) in [("ratio, lower quartile of pairs", 0.25), ("median", 0.5), ("upper quartile", 0.75)] {
            print(&format!("{name:<44} {:>12} {:>12.3}\n", "", quantile(ratios.clone(), share)));
        }
    }
    Ok(())
}

/// The value that a share of all are below.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get((values.len() as f64 * share) as usize).copied().unwrap_or(f64::NAN)
}
