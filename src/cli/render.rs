//! `chiaro render`: a recipe over its frames.

use super::frames::{chunk, format_frames, parse_frames, parse_part};
use super::progress::{self, Style};
use super::{print, print_error};
use crate::device::{Choice, Device};
use crate::eval::report::{FailedFrame, Report, peak_memory};
use crate::eval::{Context, Disk, Evaluator, Options, outputs};
use crate::graph::{self, Plan};
use crate::params::NodeType;
use crate::progress::Progress;
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Render a recipe over its frames
#[derive(clap::Args)]
pub struct Args {
    /// The recipe (.json)
    graph: PathBuf,
    /// Frames, as in 1-24x2,30; those of the recipe otherwise
    #[arg(long, allow_hyphen_values = true, value_name = "LIST")]
    frames: Option<String>,
    /// Evaluate this node instead of all that write files
    #[arg(long = "node", value_name = "NAME")]
    nodes: Vec<String>,
    /// Set a parameter, as in bleed.brightness=2.5
    #[arg(long = "set", value_name = "NODE.PARAM=JSON")]
    sets: Vec<String>,
    /// Folder for output files [default: that of the recipe]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[arg(long, value_enum, default_value_t = Choice::Auto)]
    device: Choice,
    /// Threads to compute with [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    #[command(flatten)]
    cache: CacheArgs,
    /// Render the I-th of N parts of the frames
    #[arg(long, value_name = "I/N")]
    chunk: Option<String>,
    /// Do the I-th of N parts of what is precomputed, leave it in the cache, and write no files
    #[arg(long, value_name = "I/N", conflicts_with = "no_cache")]
    shard: Option<String>,
    /// Leave out what has its files already
    #[arg(long)]
    skip_existing: bool,
    /// Go on with the next frame when one fails; exit code 5
    #[arg(long)]
    keep_going: bool,
    #[arg(long, value_enum, default_value_t = Style::Auto)]
    progress: Style,
    /// Write what was computed, from where and how long it took
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
    /// Print what would be done, and do nothing
    #[arg(long)]
    dry_run: bool,
}

/// Where precomputed values are kept across runs.
#[derive(clap::Args)]
pub struct CacheArgs {
    /// Folder of the disk cache [default: chiaro in the system's cache folder]
    #[arg(long, env = "CHIARO_CACHE", value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Keep nothing on disk
    #[arg(long, conflicts_with_all = ["cache_size"])]
    no_cache: bool,
    /// Bound of the disk cache, as in 500M or 8G
    #[arg(long, value_name = "SIZE", default_value = "8G", value_parser = parse_size)]
    cache_size: u64,
    /// Compute in spite of the cache, and fail when the result differs
    #[arg(long, env = "CHIARO_VERIFY_CACHE", value_parser = clap::builder::FalseyValueParser::new())]
    pub verify_cache: bool,
}

impl CacheArgs {
    pub fn open(&self) -> Result<Option<Disk>> {
        if self.no_cache {
            return Ok(None);
        }
        let folder = match &self.cache {
            Some(folder) => folder.clone(),
            None => {
                use etcetera::BaseStrategy;
                match etcetera::choose_base_strategy() {
                    Ok(places) => places.cache_dir().join("chiaro"),
                    Err(error) => {
                        tracing::warn!("no disk cache: {error}; name a folder with --cache");
                        return Ok(None);
                    }
                }
            }
        };
        match Disk::open(&folder, self.cache_size) {
            Ok(disk) => Ok(Some(disk)),
            // A folder that was asked for must work; the usual one need not (a farm's home may be read-only).
            Err(error) if self.cache.is_none() => {
                tracing::warn!("no disk cache: {error}");
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }
}

fn parse_size(text: &str) -> std::result::Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let shift = match text[digits.len()..].to_ascii_uppercase().trim_end_matches('B').trim_end_matches('I') {
        "" => 0,
        "K" => 10,
        "M" => 20,
        "G" => 30,
        "T" => 40,
        _ => return Err("write bytes, or a number with K, M, G or T".to_owned()),
    };
    let number: u64 = digits.parse().map_err(|_| "write bytes, or a number with K, M, G or T".to_owned())?;
    number.checked_mul(1 << shift).ok_or_else(|| "too large".to_owned())
}

/// What frames are stages of.
pub const PROGRESS: &str = "render";

static CANCEL: AtomicBool = AtomicBool::new(false);

/// The first Ctrl-C (or SIGTERM) asks nodes to stop between tiles, and those that can to leave the best that they have; the
/// second ends the process.
fn listen_for_signals() {
    let set = ctrlc::set_handler(|| {
        if CANCEL.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    match set {
        // A second render in the same process.
        Ok(()) | Err(ctrlc::Error::MultipleHandlers) => {}
        Err(error) => tracing::warn!("Ctrl-C ends the program at once: {error}"),
    }
}

impl Args {
    pub fn run(self, registry: &'static [NodeType]) -> Result<u8> {
        let Some(threads) = self.threads else { return self.execute(registry) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build();
        pool.map_err(|error| Error::compute(format!("{threads} threads cannot be started: {error}"), "ask for fewer"))?
            .install(|| self.execute(registry))
    }

    fn execute(&self, registry: &'static [NodeType]) -> Result<u8> {
        let start = Instant::now();
        let sink = progress::start(self.progress);
        let mut document = graph::load(&self.graph)?;
        self.sets.iter().try_for_each(|argument| document.set(argument))?;
        let plan = Plan::new(&document, registry)?;
        let targets = plan.targets(&self.nodes)?;
        let frames = self.frames(&plan)?;
        let device = Device::open(self.device)?;
        let (disk, verify) = (self.cache.open()?, self.cache.verify_cache);
        let evaluator = Evaluator::new(Options { disk, verify, ..Options::new(device) });
        if self.dry_run {
            return self.print_plan(&plan, &targets, &frames, &evaluator);
        }
        listen_for_signals();
        let mut report = Report {
            chiaro: env!("CARGO_PKG_VERSION"),
            recipe: self.graph.display().to_string(),
            device: evaluator.device().name(),
            threads: rayon::current_num_threads(),
            ..Report::default()
        };
        let out = self.out.as_deref();
        let context = Context { out, sink: &*sink, cancel: &CANCEL, keeps_best: true, ..Context::SILENT };
        let result = self.render(&plan, &targets, &frames, &evaluator, &context, &mut report);
        report.seconds = start.elapsed().as_secs_f64();
        report.peak_memory_bytes = peak_memory();
        let written = self.report.as_deref().map_or(Ok(()), |path| report.write(path));
        result.and_then(|code| written.map(|()| code))
    }

    fn frames(&self, plan: &Plan) -> Result<Vec<i64>> {
        let frames = match &self.frames {
            Some(list) => parse_frames(list)?,
            None => parse_frames(&format!("{}..{}", plan.frames[0], plan.frames[1]))?,
        };
        match &self.chunk {
            Some(text) => Ok(chunk(&frames, parse_part("--chunk", text)?)),
            None => Ok(frames),
        }
    }

    fn render(
        &self,
        plan: &Plan,
        targets: &[usize],
        frames: &[i64],
        evaluator: &Evaluator,
        context: &Context,
        report: &mut Report,
    ) -> Result<u8> {
        let progress = Progress { node: PROGRESS, sink: context.sink, cancel: context.cancel };
        let shard = self.shard.as_deref().map(|text| parse_part("--shard", text)).transpose()?;
        if shard.is_some() && !evaluator.has_disk() {
            let message = "parts of a precomputation meet in the disk cache, and there is none";
            return Err(Error::usage(message, "name a folder that all of them share with --cache"));
        }
        let stage = (frames.len() > 1).then(|| progress.stage("frames", frames.len() as u64));
        for &frame in frames {
            let result = self.missing(plan, targets, frame).and_then(|missing| match (missing.is_empty(), shard) {
                (true, _) => Ok(false),
                (false, Some(part)) => {
                    evaluator.precompute(plan, &missing, frame, part, context, &mut report.nodes).map(|()| true)
                }
                (false, None) => outputs::check(plan, &missing, frame, context.out, &self.graph)
                    .and_then(|()| evaluator.evaluate(plan, &missing, frame, context, &mut report.nodes))
                    .map(|_| true),
            });
            match result {
                Ok(true) => report.frames.push(frame),
                Ok(false) => report.skipped.push(frame),
                Err(error) => {
                    report.failed.push(FailedFrame { frame, error: error.to_string() });
                    if !self.keep_going || matches!(error, Error::Cancelled) {
                        return Err(error);
                    }
                    eprintln!("frame {frame}:");
                    print_error(&error);
                }
            }
            if let Some(stage) = &stage {
                // Cancelled while the last frame was being written: it is done, so say so.
                if stage.advance(1).is_err() && Some(&frame) != frames.last() {
                    return Err(Error::Cancelled);
                }
            }
        }
        if report.failed.is_empty() {
            return Ok(0);
        }
        let failed: Vec<i64> = report.failed.iter().map(|failed| failed.frame).collect();
        eprintln!("error: {} of {} frames failed: {}", failed.len(), frames.len(), format_frames(&failed));
        Ok(5)
    }

    /// The targets that have something to do at a frame.
    fn missing(&self, plan: &Plan, targets: &[usize], frame: i64) -> Result<Vec<usize>> {
        if !self.skip_existing {
            return Ok(targets.to_vec());
        }
        let folder: &Path = self.out.as_deref().unwrap_or(&plan.base);
        let mut missing = Vec::new();
        for &target in targets {
            let files = plan.steps[target].node(frame as f64)?.node.output_files(frame as f64);
            if files.is_empty() || !files.iter().all(|file| folder.join(file).is_file()) {
                missing.push(target);
            }
        }
        Ok(missing)
    }

    fn print_plan(&self, plan: &Plan, targets: &[usize], frames: &[i64], evaluator: &Evaluator) -> Result<u8> {
        print(&format!("device {}, {} frames: {}\n", evaluator.device().name(), frames.len(), format_frames(frames)));
        let Some(first) = frames.first() else { return Ok(0) };
        for task in evaluator.tasks(plan, targets, *first)?.list {
            let step = &plan.steps[task.step];
            let wires = step.inputs.iter().zip(step.node_type.info.inputs).filter_map(|(wire, port)| {
                let from = &plan.steps[(*wire)?.step];
                let output = from.node_type.info.outputs[(*wire)?.output].name;
                let output = if (*wire)?.output == 0 { String::new() } else { format!(".{output}") };
                Some(format!("{} = {}{output}", port.name, from.name))
            });
            let state = match task.passes {
                Some(port) => format!("passes {} through", step.node_type.info.inputs[port].name),
                None if step.is_sink() => {
                    format!("writes {}", task.node.output_files(*first as f64).join(", "))
                }
                None if evaluator.is_on_disk(task.key) => format!("{}, on disk", task.key),
                None => task.key.to_string(),
            };
            let state = if task.frame == *first { state } else { format!("{state}, of frame {}", task.frame) };
            let (name, kind) = (&step.name, step.node_type.info.name);
            print(&format!("{name:12} {kind:16} {state}\n"));
            wires.for_each(|wire| print(&format!("{:29} {wire}\n", "")));
        }
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(
            ["17", "2K", "500M", "8GiB", "1tb"].map(|text| parse_size(text).unwrap()),
            [17, 2 << 10, 500 << 20, 8 << 30, 1 << 40]
        );
        assert!(["", "G", "1X", "-1", "99999999999T"].iter().all(|text| parse_size(text).is_err()));
    }
}
