//! Times an animation frame by frame, and what the evaluator itself costs.

use super::{measure, print};
use crate::device::Device;
use crate::eval::{Context, Evaluator, Options};
use crate::graph::{Document, Plan};
use crate::params::NodeType;
use crate::progress::Silent;
use crate::{Error, Result};
use serde_json::{Value as Json, json};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

static NEVER: AtomicBool = AtomicBool::new(false);

/// All frames of a recipe in one process without a disk cache, files and all: the first, and those after it.
pub fn run(plan: &Plan, device: Device) -> Result<()> {
    let [first, last] = plan.frames;
    if first == last {
        return Ok(());
    }
    let evaluator = Evaluator::new(Options::new(device));
    let folder = tempfile::tempdir().map_err(|error| Error::compute(error.to_string(), "make room for pictures"))?;
    let context = Context { out: Some(folder.path()), sink: &Silent, cancel: &NEVER, ..Context::SILENT };
    let targets = plan.targets(&[])?;
    let mut times = Vec::new();
    for frame in first..=last {
        let start = Instant::now();
        evaluator.evaluate(plan, &targets, frame, &context, &mut Vec::new())?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    let first = times.remove(0);
    times.sort_by(f64::total_cmp);
    let median = times[times.len() / 2];
    print(&format!("{:<60} {first:>8.1}\n", "the first frame"));
    print(&format!("{:<60} {median:>8.1} {:>8.1}\n", format!("{} frames after it", times.len()), times[0]));
    print(&format!("{:<60} {:>8.1}\n", "times faster", first / median));
    Ok(())
}

/// Lights in the chain that is measured.
const LIGHTS: usize = 200;

/// A chain of light nodes: what a node costs beyond its work, when all are new and when none is.
pub fn overhead(device: Device, registry: &'static [NodeType]) -> Result<()> {
    let mut nodes = json!({ "n0": { "type": "scene", "params": { "file": "builtin:room" } } });
    for number in 1..=LIGHTS {
        let moving = json!({ "keys": [[0, [0, 1, 0]], [1_000_000, [1, 1, 0]]] });
        nodes[format!("n{number}")] = json!({
            "type": "light", "params": { "name": format!("lamp{number}"), "kind": "point", "position": moving },
            "inputs": { "scene": format!("n{}", number - 1) },
        });
    }
    let recipe: Json = json!({ "chiaro": 1, "nodes": nodes });
    let document = Document::parse(Path::new("lights.json"), &recipe.to_string())?;
    let plan = Plan::new(&document, registry)?;
    let target = plan.find(&format!("n{LIGHTS}")).expect("it is there");
    let evaluator = Evaluator::new(Options::new(device));
    let context = Context { cancel: &NEVER, ..Context::SILENT };
    let mut failure = Ok(());
    let mut evaluate = |frame: i64| {
        if let Err(error) = evaluator.evaluate(&plan, &[target], frame, &context, &mut Vec::new()) {
            failure = Err(error);
        }
    };
    let mut frame = 0;
    let computed = measure(25, || {
        frame += 1;
        evaluate(frame);
    });
    let found = measure(25, || evaluate(1));
    failure?;
    print(&format!(
        "\n{:<52} {:>10} {:>10}\n",
        format!("a chain of {LIGHTS} light nodes, each"),
        "median us",
        "best us"
    ));
    for (name, (median, best)) in [("computed, all parameters new", computed), ("looked up", found)] {
        let each = 1e3 / LIGHTS as f64;
        print(&format!("{name:<52} {:>10.1} {:>10.1}\n", median * each, best * each));
    }
    Ok(())
}
