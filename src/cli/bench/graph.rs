//! Times a recipe: whole runs of the program, cold and warm, and one relight node by hand with a light on the move.

use super::{Part, final_pictures, frames, head, integrate, measure, print, sliders, visibility};
use crate::device::{Choice, Device};
use crate::eval::{Context, Evaluator, Memory, Options};
use crate::graph::{self, Document, Plan};
use crate::node::{Facet, Inputs, Job, Key};
use crate::params::NodeType;
use crate::scene::{Light, LightKind, Scene};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::Vec3;
use serde_json::Value as Json;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Instant;

pub fn run(
    path: &Path,
    device: Device,
    choice: Choice,
    runs: u32,
    registry: &'static [NodeType],
    asked: &dyn Fn(Part) -> bool,
) -> Result<()> {
    let mut document = graph::load(path)?;
    let plan = Plan::new(&document, registry)?;
    let of_type = |name: &str| plan.steps.iter().any(|step| step.node_type.info.name == name);
    let relit = of_type("relight");
    let shadowed = of_type("view_samples") && (of_type("environment") || of_type("visibility"));
    if !relit && !shadowed && !of_type("final_gather") {
        return Err(Error::usage(
            "the recipe has no relight or final_gather node, nor view_samples with an environment or visibility node",
            "name a recipe that lights something",
        ));
    }
    if asked(Part::Process) {
        whole_runs(path, &document, choice)?;
    }
    if asked(Part::Frames) {
        frames::run(&plan, Device::open(choice)?)?;
    }
    if of_type("final_gather") && asked(Part::Final) {
        final_pictures::run(&plan, Device::open(choice)?, runs)?;
    }
    if shadowed && asked(Part::Masks) {
        masks(&plan, &document, Device::open(choice)?)?;
    }
    match relit {
        _ if !asked(Part::Light) => {}
        true => moved_light(&plan, device, runs)?,
        false if !shadowed => {}
        false => integrate::run(&plan, device, runs)?,
    }
    if asked(Part::Sliders) {
        sliders::run(&mut document, Device::open(choice)?, runs, registry)?;
    }
    #[cfg(feature = "editor")]
    if asked(Part::Editor) {
        super::editor::run(path, &document, Device::open(choice)?, registry)?;
    }
    Ok(())
}

/// Draws the masks of visibility of the first view_samples node.
fn masks(plan: &Plan, document: &Document, device: Device) -> Result<()> {
    let Some(view) = plan.steps.iter().position(|step| step.node_type.info.name == "view_samples") else {
        return Ok(());
    };
    let scene = plan.steps[view].inputs.iter().flatten().map(|wire| wire.step);
    let targets: Vec<usize> = std::iter::once(view).chain(scene).collect();
    let evaluator = Evaluator::new(Options::new(device));
    let never = AtomicBool::new(false);
    let context = Context { cancel: &never, ..Context::SILENT };
    let values = evaluator.evaluate(plan, &targets, plan.frames[0], &context, &mut Vec::new())?;
    let size = document.nodes.values().find_map(|node| node.params.get("face_size").and_then(Json::as_u64));
    let (mut samples, mut scene) = (None, None);
    for value in values.into_iter().flatten() {
        match value {
            Value::Samples(found) => samples = Some(found),
            Value::Scene(found) => scene = Some(found),
            _ => {}
        }
    }
    match (samples, scene) {
        (Some(samples), Some(scene)) => visibility::run(
            evaluator.device(),
            &scene.geometry,
            &samples.points,
            size.map_or(128, |size| size as usize),
            &std::array::from_fn::<usize, 6, _>(|face| face),
        ),
        _ => Ok(()),
    }
}

/// What one run of the program said in its report.
struct Told {
    /// Of the process, from outside.
    seconds: f64,
    report: Json,
}

impl Told {
    fn nodes(&self) -> impl Iterator<Item = (&str, &str, f64)> {
        let list = self.report["nodes"].as_array().into_iter().flatten();
        list.filter_map(|n| Some((n["node"].as_str()?, n["cache"].as_str()?, n["seconds"].as_f64()?)))
    }

    fn megabytes(&self) -> f64 {
        self.report["peak_memory_bytes"].as_f64().unwrap_or(f64::NAN) / (1 << 20) as f64
    }
}

fn whole_runs(path: &Path, document: &Document, choice: Choice) -> Result<()> {
    let folder = tempfile::tempdir().map_err(|e| Error::compute(format!("no temporary folder: {e}"), "set TMPDIR"))?;
    let render = |set: Option<String>| render(path, folder.path(), choice, set);
    let cold = render(None)?;
    print(&format!("{:<52} {:>10}\n", "whole process, to the written files", "seconds"));
    print(&format!("{:<52} {:>10.2}   peak {:.0} MiB\n", "cold", cold.seconds, cold.megabytes()));
    for (node, _, seconds) in cold.nodes().filter(|(_, cache, seconds)| *cache == "computed" && *seconds >= 0.01) {
        print(&format!("  {node:<50} {seconds:>10.2}\n"));
    }
    let mut warm: Vec<Told> = (0..5).map(|_| render(None)).collect::<Result<_>>()?;
    warm.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    let middle = &warm[warm.len() / 2];
    print(&format!(
        "{:<52} {:>10.2}   peak {:.0} MiB\n",
        "warm disk cache, median of 5",
        middle.seconds,
        middle.megabytes()
    ));
    if let Some((name, entry)) = document.nodes.iter().find(|(_, entry)| entry.kind == "caster_receiver") {
        let brightness = entry.params.get("brightness").and_then(Json::as_f64).unwrap_or(1.0);
        let slid = render(Some(format!("{name}.brightness={}", brightness * 1.1)))?;
        let of = |kind: &str| {
            slid.nodes().filter(|(_, cache, _)| *cache == kind).map(|(node, ..)| node).collect::<Vec<_>>().join(", ")
        };
        print(&format!(
            "{:<52} {:>10.2}   from disk: {}; computed: {}\n",
            format!("after {name}.brightness has changed"),
            slid.seconds,
            of("disk"),
            of("computed")
        ));
    }
    Ok(())
}

/// One run of this program with a cache and an output folder of its own.
fn render(path: &Path, folder: &Path, choice: Choice, set: Option<String>) -> Result<Told> {
    let failed = |what: String| {
        Error::compute(format!("the measured run failed: {what}"), "render the recipe by hand to see why")
    };
    let program = std::env::current_exe().map_err(|e| failed(e.to_string()))?;
    let report = folder.join("report.json");
    let device = match choice {
        Choice::Auto => "auto",
        Choice::Cpu => "cpu",
        Choice::Gpu => "gpu",
    };
    let mut command = Command::new(program);
    command.arg("render").arg(path).args(["--progress", "none", "--device", device]);
    command.arg("--cache").arg(folder.join("cache")).arg("--out").arg(folder.join("out")).arg("--report").arg(&report);
    command.args(set.iter().flat_map(|set| ["--set", set]));
    let start = Instant::now();
    let output = command.output().map_err(|e| failed(e.to_string()))?;
    let seconds = start.elapsed().as_secs_f64();
    if !output.status.success() {
        return Err(failed(String::from_utf8_lossy(&output.stderr).into_owned()));
    }
    let text = std::fs::read_to_string(&report).map_err(|e| failed(e.to_string()))?;
    let report = serde_json::from_str(&text).map_err(|e| failed(e.to_string()))?;
    Ok(Told { seconds, report })
}

/// Runs the first relight node again and again, its first lamp a little further along each time.
fn moved_light(plan: &Plan, device: Device, runs: u32) -> Result<()> {
    let Some(step) = plan.steps.iter().find(|step| step.node_type.info.name == "relight") else {
        return Err(Error::usage("the recipe has no relight node", "name a recipe that lights something"));
    };
    let evaluator = Evaluator::new(Options::new(device));
    let never = AtomicBool::new(false);
    let context = Context { cancel: &never, ..Context::SILENT };
    let targets: Vec<usize> = step.inputs.iter().flatten().map(|wire| wire.step).collect();
    let frame = plan.frames[0];
    let mut found = evaluator.evaluate(plan, &targets, frame, &context, &mut Vec::new())?.into_iter();
    let values: Vec<Option<Value>> = step
        .inputs
        .iter()
        .map(|wire| wire.map(|wire| found.next().expect("one for each wire")[wire.output].clone()))
        .collect();

    let node = step.node(frame as f64)?.node;
    let memory = Memory::new(1 << 30);
    let relight = |lights: Option<Vec<Light>>, turn: u32, edited: bool| -> Result<()> {
        let inputs = Inputs {
            info: step.node_type.info,
            values: values
                .iter()
                .enumerate()
                .map(|(port, value)| {
                    let value = value.clone().filter(|value| edited || value.kind() != Kind::Edits)?;
                    let mut keys = Facet::ALL.map(|facet| Key::of(&[&[port as u8, facet as u8]]));
                    Some((
                        match (&value, &lights) {
                            (Value::Scene(scene), Some(lights)) => {
                                keys[Facet::Lights as usize] = Key::of(&[b"moved", &turn.to_le_bytes()]);
                                Value::Scene(Arc::new(Scene { lights: Arc::new(lights.clone()), ..(**scene).clone() }))
                            }
                            _ => value,
                        },
                        keys,
                    ))
                })
                .collect(),
            at_frames: Vec::new(),
            connected: step.inputs.iter().map(Option::is_some).collect(),
        };
        let notes = Mutex::default();
        let job = Job { key: Key::of(&[&turn.to_le_bytes()]), ..Job::alone(evaluator.device(), &memory, &notes) };
        node.run(&inputs, &job).map(drop)
    };
    let lights = values.iter().flatten().find_map(|value| match value {
        Value::Scene(scene) => Some(scene.lights.to_vec()),
        _ => None,
    });
    let Some(lights) = lights.filter(|lights| !lights.is_empty()) else {
        return Err(Error::usage("the scene has no light to move", "name a recipe with a light"));
    };
    let mut turn = 0;
    let mut failure = Ok(());
    head("in process");
    let mut measured = |name: &str, edited: bool, failure: &mut Result<()>| {
        let (median, best) = measure(runs, || {
            turn += 1;
            let mut moved = lights.clone();
            shift(&mut moved[0].kind, Vec3::new(0.004, 0.002, -0.003) * turn as f32);
            if let Err(error) = relight(Some(moved), turn, edited) {
                *failure = Err(error);
            }
        });
        let name = format!("{}: relight after \"{}\" has moved{name}", step.name, lights[0].name);
        print(&format!("{name:<60} {median:>8.1} {best:>8.1}\n"));
        median
    };
    let edits = values.iter().flatten().find_map(|value| match value {
        Value::Edits(edits) => Some(edits.0.len()),
        _ => None,
    });
    // With and without edits by turns, because the machine's speed drifts.
    let with = edits.map(|count| format!(", {count} edits")).unwrap_or_default();
    let first = measured(&with, true, &mut failure);
    if edits.is_some() {
        let without = measured(", no edits", false, &mut failure);
        let again = measured(&with, true, &mut failure);
        print(&format!("{:<60} {:>8.2}\n", "ratio", 0.5 * (first + again) / without));
    }
    failure
}

fn shift(kind: &mut LightKind, by: Vec3) {
    match kind {
        LightKind::Point { position } | LightKind::Spot { position, .. } | LightKind::Area { corner: position, .. } => {
            *position += by
        }
        LightKind::Directional { direction } => *direction = (*direction + by).normalize(),
    }
}
