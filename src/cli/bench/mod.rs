//! `chiaro bench`: the figures of the README, on this machine.

#[cfg(feature = "editor")]
mod editor;
mod final_pictures;
mod frames;
mod graph;
mod integrate;
mod kernels;
mod sliders;
mod visibility;

use super::print;
use crate::Result;
use crate::device::{Choice, Device};
use crate::params::NodeType;
use std::path::PathBuf;
use std::time::Instant;

/// Measure speed and memory on this machine
///
/// Without a graph: the kernels on made-up data, beside the machine's own streaming rate, and what a node costs beyond
/// its work. With one: a cold and a warm
/// run of the whole program, frames, sliders, relighting after a light has moved, masks of visibility, and integrating them.
#[derive(clap::Args)]
pub struct Args {
    /// Recipe to measure; it needs a relight node, or view_samples beside an environment or visibility node
    graph: Option<PathBuf>,
    #[arg(long, value_enum, default_value_t)]
    device: Choice,
    /// Runs of each measurement; the median is printed
    #[arg(long, default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// Of a recipe, measure only this; may be given several times
    #[arg(long, value_enum)]
    part: Vec<Part>,
}

/// What is measured of a recipe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// Runs of the whole program
    Process,
    /// Masks of visibility, beside rays
    Masks,
    /// Pictures of final quality, with edits and without them by turns
    Final,
    /// Frames of an animation, one after another
    Frames,
    /// One lighting node by itself
    Light,
    /// From a slider to the picture
    Sliders,
    /// From the hand to the editor's window: sliders, a brush, and the longest that the window did not answer
    #[cfg(feature = "editor")]
    Editor,
}

impl Args {
    pub fn run(self, registry: &'static [NodeType]) -> Result<u8> {
        let device = Device::open(self.device)?;
        print(&format!("{}; {}\n", processor(), device.name()));
        match &self.graph {
            Some(path) => {
                let asked = |part| self.part.is_empty() || self.part.contains(&part);
                graph::run(path, device, self.device, self.runs, registry, &asked)?
            }
            None => {
                kernels::run(&device);
                frames::overhead(device, registry)?;
            }
        }
        Ok(0)
    }
}

fn processor() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    model.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}

fn head(title: &str) {
    print(&format!("{title:<52} {:>10} {:>10} {:>8}\n", "median ms", "best ms", "GB/s"));
}

/// Prints median and best milliseconds of `run` over 15 runs, after one that does not count. `bytes`: what must be read.
fn time(name: &str, bytes: usize, run: impl FnMut()) {
    let (median, best) = measure(15, run);
    print(&format!("{name:<52} {median:>10.2} {best:>10.2} {:>8.1}\n", bytes as f64 / median * 1e-6));
}

/// Median and best milliseconds, after one run that does not count.
fn measure(runs: u32, mut run: impl FnMut()) -> (f64, f64) {
    run();
    let mut times: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], times[0])
}
