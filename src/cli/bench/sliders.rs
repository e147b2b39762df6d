//! Times sliders of edits: from a changed parameter to the finished picture that shows it, in one process.

use super::{measure, print};
use crate::Result;
use crate::device::Device;
use crate::eval::{Context, Evaluator, Options};
use crate::graph::{Document, Plan};
use crate::params::NodeType;
use serde_json::{Value as Json, json};
use std::sync::atomic::AtomicBool;

/// The parameter of each kind of edit that is slid, and how far a step is.
pub const SLIDERS: &[(&str, &str, f64)] = &[
    ("caster_receiver", "brightness", 0.01),
    ("source_brush", "scale", 0.01),
    ("illumination_brush", "scale", 0.01),
    ("falloff", "exponent", 0.005),
    ("indirect_shadow", "amount", -0.005),
    ("directionality", "amount", 0.005),
];

/// As `SLIDERS`, for shadows under an environment, and for the light itself.
pub const SHADOW_SLIDERS: &[(&str, &str, f64)] = &[
    ("environment", "exposure", 0.01),
    ("remove_shadow", "amount", -0.005),
    ("shadow_gradient", "amount", -0.005),
    ("translate_shadow", "offset", 0.005),
    ("rotate_shadow", "angle", 0.1),
    ("blur_shadow", "angle", 0.05),
    ("tint_shadow", "amount", -0.005),
];

/// As `SLIDERS`, for ratios of shadows: what is waited for is the first picture with a shadow put in.
pub const RATIO_SLIDERS: &[(&str, &str, f64)] = &[
    ("ratio_transform", "rotate", 0.1),
    ("ratio_lattice", "amount", 0.002),
    ("ratio_blur", "radius", 0.0002),
    ("ratio_grade", "strength", 0.002),
    ("ratio_pattern", "angle", 0.1),
];

/// Every node of the recipe that has such a parameter, one after the other.
pub fn run(document: &mut Document, device: Device, runs: u32, registry: &'static [NodeType]) -> Result<()> {
    let evaluator = Evaluator::new(Options::new(device));
    slide(document, &evaluator, runs, registry, "relight", SLIDERS)?;
    slide(document, &evaluator, runs, registry, "synthesize_shadow", RATIO_SLIDERS)?;
    slide(document, &evaluator, runs, registry, "integrate", SHADOW_SLIDERS)
}

/// `kind`: of the node that is waited for, the first of its kind in the recipe.
fn slide(
    document: &mut Document,
    evaluator: &Evaluator,
    runs: u32,
    registry: &'static [NodeType],
    kind: &str,
    sliders: &[(&str, &str, f64)],
) -> Result<()> {
    let plan = Plan::new(document, registry)?;
    let Some(step) = plan.steps.iter().find(|step| step.node_type.info.name == kind) else { return Ok(()) };
    let target = step.name.clone();
    let never = AtomicBool::new(false);
    let context = Context { cancel: &never, ..Context::SILENT };
    let render = |document: &Document| -> Result<()> {
        let plan = Plan::new(document, registry)?;
        let target = plan.find(&target).expect("it was there");
        evaluator.evaluate(&plan, &[target], plan.frames[0], &context, &mut Vec::new()).map(drop)
    };
    let slid: Vec<(String, &str, Json, f64)> = document
        .nodes
        .iter()
        .filter_map(|(name, entry)| {
            let (_, param, step) = sliders.iter().find(|(kind, ..)| *kind == entry.kind)?;
            Some((name.clone(), *param, entry.params.get(*param)?.clone(), *step))
        })
        .collect();
    for (name, param, start, step) in slid {
        let mut turn = 0;
        let mut failure = Ok(());
        let set = |document: &mut Document, value: Json| document.set(&format!("{name}.{param}={value}"));
        let (median, best) = measure(runs, || {
            turn += 1;
            let moved = set(document, stepped(&start, step * f64::from(turn))).and_then(|()| render(document));
            if let Err(error) = moved {
                failure = Err(error);
            }
        });
        failure?;
        set(document, start.clone())?;
        print(&format!("{:<60} {median:>8.1} {best:>8.1}\n", format!("{target}: {name}.{param} slid")));
    }
    Ok(())
}

/// A number that much further; of several, the first.
pub fn stepped(start: &Json, by: f64) -> Json {
    match start {
        Json::Array(all) => {
            let first = all.first().map(|first| stepped(first, by));
            first.into_iter().chain(all.iter().skip(1).cloned()).collect()
        }
        number => json!(number.as_f64().unwrap_or_default() + by),
    }
}
