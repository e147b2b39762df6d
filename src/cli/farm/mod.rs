//! `chiaro farm`: a batch as text for engines that there are. First the parts of what all frames share (`render --shard`,
//! which meet in the cache), then the frames, chunk by chunk. It starts nothing and watches nothing.

mod openjd;
mod shared;
mod slurm;

use super::frames::{format_frames, parse_frames};
use super::print;
use crate::graph::{self, Plan};
use crate::params::NodeType;
use crate::{Error, Result, atomic};
use std::path::{Path, PathBuf};

/// Write a batch as a job for a render farm
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    engine: Engine,
}

#[derive(clap::Subcommand)]
enum Engine {
    /// A template of Open Job Description (2023-09 with TASK_CHUNKING), for Deadline Cloud or `openjd run`
    Openjd(Batch),
    /// A shell script that submits job arrays with sbatch
    Slurm(Batch),
}

#[derive(clap::Args)]
struct Batch {
    /// The recipe (.json)
    graph: PathBuf,
    /// Frames, as in 1-24x2,30; those of the recipe otherwise
    #[arg(long, allow_hyphen_values = true, value_name = "LIST")]
    frames: Option<String>,
    /// Frames of a task
    #[arg(long, value_name = "N", default_value = "4", value_parser = clap::value_parser!(u32).range(1..))]
    chunk_size: u32,
    /// Tasks that share the work of what is precomputed for several chunks
    #[arg(long, value_name = "N", default_value = "8", value_parser = clap::value_parser!(u32).range(1..))]
    shards: u32,
    /// Render this node instead of all that write files
    #[arg(long = "node", value_name = "NAME")]
    nodes: Vec<String>,
    /// Set a parameter, as in bleed.brightness=2.5
    #[arg(long = "set", value_name = "NODE.PARAM=JSON")]
    sets: Vec<String>,
    /// Leave frames out whose files are there when their task starts
    #[arg(long)]
    skip_existing: bool,
    /// Where to write the job [default: stdout]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// What an engine is told.
struct Job {
    name: String,
    recipe: PathBuf,
    frames: Vec<i64>,
    chunk_size: u32,
    shards: u32,
    /// Frames whose precomputations cover all that several chunks share; none: there is nothing to share.
    precompute: Vec<i64>,
    /// `--node` and `--set`, as they were given.
    more: Vec<String>,
    skip_existing: bool,
}

impl Args {
    pub fn run(self, registry: &'static [NodeType]) -> Result<u8> {
        let (write, batch): (fn(&Job) -> String, Batch) = match self.engine {
            Engine::Openjd(batch) => (openjd::template, batch),
            Engine::Slurm(batch) => (slurm::script, batch),
        };
        let text = write(&batch.job(registry)?);
        match &batch.output {
            Some(path) => atomic::write(path, text.as_bytes())?,
            None => print(&text),
        }
        Ok(0)
    }
}

impl Batch {
    fn job(&self, registry: &'static [NodeType]) -> Result<Job> {
        let mut document = graph::load(&self.graph)?;
        self.sets.iter().try_for_each(|argument| document.set(argument))?;
        let plan = Plan::new(&document, registry)?;
        let targets = plan.targets(&self.nodes)?;
        let mut frames = match &self.frames {
            Some(list) => parse_frames(list)?,
            None => parse_frames(&format!("{}..{}", plan.frames[0], plan.frames[1]))?,
        };
        if frames.is_empty() {
            return Err(Error::usage("there is no frame to render", "name some with --frames"));
        }
        // Their order is the engine's affair; a rising list is short.
        frames.sort_unstable();
        let chunks: Vec<&[i64]> = frames.chunks(self.chunk_size as usize).collect();
        let precompute = shared::frames(&plan, &targets, &chunks)?;
        let named = |option: &str, values: &[String]| {
            values.iter().flat_map(|value| [option.to_owned(), value.clone()]).collect::<Vec<_>>()
        };
        let name = self.graph.file_stem().map_or_else(|| "chiaro".into(), |name| name.to_string_lossy());
        Ok(Job {
            name: name.into_owned(),
            recipe: self.recipe()?,
            chunk_size: self.chunk_size,
            shards: self.shards,
            precompute,
            skip_existing: self.skip_existing,
            more: [named("--node", &self.nodes), named("--set", &self.sets)].concat(),
            frames,
        })
    }

    /// As a job beside it names it; absolute when they do not lie together.
    fn recipe(&self) -> Result<PathBuf> {
        let whole = |path: &Path| {
            std::path::absolute(path).map_err(|error| Error::file(path, error.to_string(), "name it by another path"))
        };
        let recipe = whole(&self.graph)?;
        let folder = match &self.output {
            Some(output) => whole(output)?.parent().map(Path::to_owned),
            None => None,
        };
        Ok(match folder {
            Some(folder) if recipe.parent() == Some(&folder) => recipe.file_name().expect("a file").into(),
            _ => recipe,
        })
    }
}

impl Job {
    fn frame_list(&self) -> String {
        format_frames(&self.frames)
    }

    fn precompute_list(&self) -> String {
        format_frames(&self.precompute)
    }
}
