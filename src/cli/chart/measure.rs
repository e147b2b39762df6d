//! Runs every combination of a chart, and holds its picture against the reference.

use super::Caches;
use super::settings::{DEVICE, Settings};
use super::spec::{Reference, Spec};
use crate::cli::side::{Side, WHOLE};
use crate::device::{Choice, Device};
use crate::eval::{Context, Disk, Evaluator, NodeReport, Options};
use crate::graph::{self, Document, Plan};
use crate::image::cryptomatte::Cryptomatte;
use crate::image::{Image, Layer, compare};
use crate::params::NodeType;
use crate::progress::{Progress, Sink};
use crate::value::Value;
use crate::{Error, Result};
use serde_json::Value as Json;
use std::time::Instant;

/// All points of a chart, in the order of `Spec::combinations`.
pub struct Found {
    pub points: Vec<Point>,
    /// What ran them, each named once.
    pub devices: Vec<String>,
    /// What they are held against, in words.
    pub reference: String,
}

/// One combination.
pub struct Point {
    pub settings: Settings,
    /// Of the whole evaluation, by `Caches`; the median of the runs.
    pub seconds: [f64; 2],
    /// Nodes in the order in which they ran.
    pub stages: Vec<Stage>,
    pub errors: Errors,
    /// Largest relative error that a node of the recipe states for itself.
    pub stated: Option<f64>,
}

/// One node of the recipe.
pub struct Stage {
    pub node: String,
    /// By `Caches`; 0 where it did not run.
    pub seconds: [f64; 2],
    /// Size of its outputs in memory.
    pub bytes: u64,
}

/// How far a picture is from the reference. All but `ssim` are relative: over the mean of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    pub rmse: f64,
    /// The 99th percentile of absolute differences.
    pub p99: f64,
    pub bias: f64,
    /// Of pixels, also where the others are of blocks; `None` for layers that have no colour.
    pub ssim: Option<f64>,
}

impl Point {
    pub fn bytes(&self) -> u64 {
        self.stages.iter().map(|stage| stage.bytes).sum()
    }

    /// Seconds and the relative RMSE.
    pub fn place(&self, caches: Caches) -> [f64; 2] {
        [self.seconds[caches as usize], self.errors.rmse]
    }
}

/// Runs what the chart asks for.
///
/// # Errors
/// A bad recipe or setting; what stopped a combination; pictures that cannot be compared.
pub fn all(spec: &Spec, choice: Choice, registry: &'static [NodeType], sink: &dyn Sink) -> Result<Found> {
    let document = graph::load(&spec.graph)?;
    let combinations = spec.combinations();
    // All are checked before the first one runs.
    for settings in &combinations {
        Target::new(spec, &document, settings, choice, registry)?;
    }
    let progress = Progress { node: &spec.name, sink, ..Progress::silent() };
    let stage = progress.stage("combinations", combinations.len() as u64 + 1);
    let (layer, width) = reference_layer(spec, &document, choice, registry)?;
    let judge = Judge::new(spec, layer, width)?;
    stage.advance(1)?;
    let (mut points, mut devices) = (Vec::new(), Vec::new());
    for settings in combinations {
        let target = Target::new(spec, &document, &settings, choice, registry)?;
        let (point, device) = target.measured(spec, settings, &judge)?;
        points.push(point);
        if !devices.contains(&device) {
            devices.push(device);
        }
        stage.advance(1)?;
    }
    Ok(Found { points, devices, reference: spec.reference.to_string() })
}

/// What one combination evaluates.
struct Target {
    plan: Plan,
    step: usize,
    device: Choice,
}

impl Target {
    fn new(
        spec: &Spec,
        document: &Document,
        settings: &Settings,
        choice: Choice,
        registry: &'static [NodeType],
    ) -> Result<Self> {
        let (mut document, mut device) = (document.clone(), choice);
        for (name, value) in spec.set.iter().chain(settings) {
            match name.as_str() {
                DEVICE => device = device_of(value)?,
                _ => document.set(&format!("{name}={value}"))?,
            }
        }
        let plan = Plan::new(&document, registry)?;
        let step = match &spec.node {
            Some(name) => plan.targets(std::slice::from_ref(name))?[0],
            None => written(&plan)?,
        };
        Ok(Self { plan, step, device })
    }

    fn evaluate(&self, evaluator: &Evaluator, reports: &mut Vec<NodeReport>) -> Result<(f64, std::sync::Arc<Image>)> {
        let start = Instant::now();
        let frame = self.plan.frames[0];
        let values = evaluator.evaluate(&self.plan, &[self.step], frame, &Context::SILENT, reports)?;
        let seconds = start.elapsed().as_secs_f64();
        let image = values.into_iter().flatten().find_map(|value| match value {
            Value::Image(image) => Some(image),
            _ => None,
        });
        let name = &self.plan.steps[self.step].name;
        let fault = || Error::usage(format!("node \"{name}\" gives no image"), "name a node that does with --node");
        Ok((seconds, image.ok_or_else(fault)?))
    }

    /// Cold and warm, as often as the chart says.
    fn measured(&self, spec: &Spec, settings: Settings, judge: &Judge) -> Result<(Point, String)> {
        let (mut runs, mut picture, mut device) = ([Vec::new(), Vec::new()], None, String::new());
        for _ in 0..spec.runs {
            let folder = tempfile::tempdir()
                .map_err(|error| Error::compute(format!("no temporary folder: {error}"), "set TMPDIR"))?;
            for caches in Caches::BOTH {
                let disk = Some(Disk::open(folder.path(), u64::MAX)?);
                let evaluator = Evaluator::new(Options { disk, ..Options::new(Device::open(self.device)?) });
                let mut reports = Vec::new();
                let (seconds, image) = self.evaluate(&evaluator, &mut reports)?;
                runs[caches as usize].push((seconds, reports));
                device = evaluator.device().name();
                picture = Some(image);
            }
        }
        let [cold, warm] = runs.map(median);
        let picture = picture.expect("one run at least");
        let point = Point {
            stages: stages(&cold.1, &warm.1),
            stated: stated(&cold.1),
            seconds: [cold.0, warm.0],
            errors: judge.errors(&picture, &spec.layer)?,
            settings,
        };
        Ok((point, device))
    }
}

/// The image that the recipe writes.
fn written(plan: &Plan) -> Result<usize> {
    let of_type = |step: &&graph::Step| step.node_type.info.name == "write_image" && !step.muted;
    let sinks: Vec<&graph::Step> = plan.steps.iter().filter(of_type).collect();
    match sinks[..] {
        [sink] => Ok(sink.inputs.iter().flatten().next().expect("the plan is checked").step),
        _ => {
            let message = format!("the recipe writes {} images", sinks.len());
            Err(Error::usage(message, "name the node whose picture is compared with --node"))
        }
    }
}

fn device_of(value: &Json) -> Result<Choice> {
    match value.as_str() {
        Some("cpu") => Ok(Choice::Cpu),
        Some("gpu") => Ok(Choice::Gpu),
        _ => Err(Error::usage(format!("device = {value}: there is no such device"), "sweep device=cpu,gpu")),
    }
}

/// The run whose seconds are the median, with what it reported.
fn median(mut runs: Vec<(f64, Vec<NodeReport>)>) -> (f64, Vec<NodeReport>) {
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    runs.swap_remove(runs.len() / 2)
}

fn stages(cold: &[NodeReport], warm: &[NodeReport]) -> Vec<Stage> {
    let of = |report: &NodeReport| {
        let again = warm.iter().find(|other| other.node == report.node);
        let seconds = [report.seconds, again.map_or(0.0, |again| again.seconds)];
        Stage { node: report.node.clone(), seconds, bytes: report.bytes }
    };
    cold.iter().map(of).collect()
}

fn stated(reports: &[NodeReport]) -> Option<f64> {
    reports.iter().filter_map(|report| report.notes.get("error")?.as_f64()).max_by(f64::total_cmp)
}

/// The layer that points are held against, and its width.
fn reference_layer(
    spec: &Spec,
    document: &Document,
    choice: Choice,
    registry: &'static [NodeType],
) -> Result<(Layer, usize)> {
    match &spec.reference {
        Reference::Set(settings) => {
            let target = Target::new(spec, document, settings, choice, registry)?;
            let evaluator = Evaluator::new(Options::new(Device::open(target.device)?));
            let (_, image) = target.evaluate(&evaluator, &mut Vec::new())?;
            Ok((layer_of(&image, &spec.layer)?.clone(), image.width))
        }
        Reference::Plate(plate) => {
            let (layer, image) = Side { path: plate.file.clone(), layer: None }.read(&plate.layer, &plate.times)?;
            Ok((layer, image.width))
        }
    }
}

fn layer_of<'a>(image: &'a Image, layer: &str) -> Result<&'a Layer> {
    image.find(layer).map_err(|missing| Error::usage(missing.message, missing.help))
}

/// What pictures are held against, and how.
struct Judge {
    reference: Layer,
    width: usize,
    /// Side of blocks, and the object of each pixel.
    blocks: Option<(usize, Vec<u32>)>,
}

impl Judge {
    fn new(spec: &Spec, reference: Layer, width: usize) -> Result<Self> {
        let blocks = match &spec.objects {
            Some(path) => {
                let whole = Cryptomatte::read(path, "CryptoObject")?.whole(WHOLE);
                Some((usize::from(spec.blocks), whole))
            }
            None => None,
        };
        Ok(Self { reference, width, blocks })
    }

    fn errors(&self, image: &Image, layer: &str) -> Result<Errors> {
        let layer = layer_of(image, layer)?;
        if image.width != self.width || layer.data.len() / layer.channels.len() != self.pixels() {
            let message = format!(
                "the picture has {} x {} pixels, the reference {} x {}",
                image.width,
                image.height,
                self.width,
                self.pixels() / self.width.max(1)
            );
            return Err(Error::usage(message, "set the resolution of the view to that of the reference"));
        }
        let ssim = compare::ssim(layer, &self.reference, self.width);
        let figures = compare::compare(layer, &self.reference, self.width)?;
        if figures.not_finite_a + figures.not_finite_b > 0 {
            let message = format!("{} values are not finite", figures.not_finite_a + figures.not_finite_b);
            return Err(Error::compute(message, "compare a layer that has light everywhere"));
        }
        let Some((size, objects)) = &self.blocks else {
            let [rmse, p99, bias] = [figures.relative(), figures.relative_p99(), figures.bias()];
            return Ok(Errors { rmse, p99, bias, ssim });
        };
        let all = compare::blocks(layer, &self.reference, self.width, objects, *size)?.swap_remove(0);
        // Of nothing, every error is 0.
        if all.blocks == 0 {
            let message = format!("no block of {size} x {size} pixels shows one object alone");
            return Err(Error::usage(message, "make blocks smaller, or leave --objects out"));
        }
        Ok(Errors { rmse: all.relative_rmse, p99: all.relative_p99, bias: all.bias, ssim })
    }

    fn pixels(&self) -> usize {
        self.reference.data.len() / self.reference.channels.len()
    }
}
