//! `chiaro chart`: what settings of a recipe cost, and how far they are from a reference.
//!
//! ```text
//! spec     what is swept, of which recipe, against what: the command line, or a file; settings: values of parameters
//! measure  every combination, cold and warm
//! pareto   which of them no other beats; series: which of them a line joins; beside: what others measured
//! picture  what of it is shown; draw: SVG and PNG; tables: CSV and Markdown
//! ```

mod beside;
mod draw;
mod measure;
mod pareto;
mod picture;
mod series;
mod settings;
mod spec;
mod tables;

use super::progress::{self, Style};
use crate::device::Choice;
use crate::params::NodeType;
use crate::progress::Sink;
use crate::{Error, Result};
use spec::Spec;
use std::path::{Path, PathBuf};

/// Chart the time that settings take against the error that they leave
///
/// Renders every combination of the swept values twice: cold, with nothing in any cache, and warm, with what is
/// precomputed on disk. Writes NAME.svg, NAME.png, NAME.csv and NAME.md, where NAME is that of the recipe or chart.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// Recipes (.json), or charts: files that hold what the options say
    #[arg(required = true, value_name = "GRAPH")]
    graphs: Vec<PathBuf>,
    /// Values of a parameter, as in transport.tolerance=0.08,0.04 or device=cpu,gpu; a JSON list where values have
    /// commas. Every combination is run; points that differ in the last sweep alone are joined
    #[arg(long = "sweep", value_name = "NODE.PARAM=V,V")]
    sweeps: Vec<String>,
    /// Set a parameter of all, as in bleed.brightness=2.5
    #[arg(long = "set", value_name = "NODE.PARAM=JSON")]
    sets: Vec<String>,
    /// What the reference has in place of swept values
    #[arg(long, value_name = "NODE.PARAM=JSON")]
    reference: Vec<String>,
    /// The reference is a layer of a picture instead
    #[arg(long, value_name = "FILE.exr[:LAYER]", conflicts_with = "reference")]
    against: Option<String>,
    /// Multiply it by another layer of its file, for plates that keep light without surface colour
    #[arg(long, value_name = "LAYER", requires = "against")]
    times: Vec<String>,
    /// Errors are of averages over blocks of N x N pixels that show one object [default: 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    blocks: Option<u16>,
    /// The picture whose Cryptomatte says which object a pixel shows; without it, errors are of pixels
    #[arg(long, value_name = "PLATE.exr")]
    objects: Option<PathBuf>,
    /// Draw what another program took, a table of `seconds,error` a line
    #[arg(long, value_name = "NAME=FILE.csv")]
    beside: Vec<String>,
    /// Node whose picture is compared [default: the one that the recipe writes]
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// Its layer [default: the beauty]
    #[arg(long, value_name = "LAYER")]
    layer: Option<String>,
    /// Times are the median of so many runs
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    runs: Option<u16>,
    /// Folder for the charts
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    #[arg(long, value_enum, default_value_t = Choice::Cpu)]
    device: Choice,
    #[arg(long, value_enum, default_value_t = Style::Auto)]
    progress: Style,
}

impl Args {
    /// # Errors
    /// Bad usage or a bad recipe; what stopped a combination; `Output` when a chart cannot be written.
    pub fn run(&self, registry: &'static [NodeType]) -> Result<u8> {
        let sink = progress::start(self.progress);
        // All are read before the first one runs.
        let specs: Vec<Spec> = self.graphs.iter().map(|path| Spec::new(path, self)).collect::<Result<_>>()?;
        std::fs::create_dir_all(&self.out)
            .map_err(|error| Error::output(&self.out, error.to_string(), "name a folder that can be made"))?;
        specs.iter().try_for_each(|spec| chart(spec, &self.out, self.device, registry, &*sink))?;
        Ok(0)
    }
}

fn chart(spec: &Spec, out: &Path, device: Choice, registry: &'static [NodeType], sink: &dyn Sink) -> Result<()> {
    let others = spec.beside.iter().map(|(name, path)| beside::read(name, path)).collect::<Result<Vec<_>>>()?;
    let found = measure::all(spec, device, registry, sink)?;
    let fronts = pareto::fronts(&found.points);
    let table = tables::markdown(spec, &found, &fronts);
    let figure = picture::figure(spec, &found, &fronts, &others);
    let path = |extension: &str| out.join(format!("{}.{extension}", spec.name));
    crate::atomic::write(&path("csv"), tables::csv(spec, &found, &fronts).as_bytes())?;
    crate::atomic::write(&path("md"), table.as_bytes())?;
    crate::atomic::write(&path("svg"), draw::svg(&figure)?.as_bytes())?;
    crate::atomic::write(&path("png"), &draw::png(&figure)?)?;
    super::print(&table);
    Ok(())
}

/// How times were taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Caches {
    /// Nothing is in any cache.
    Cold,
    /// What is precomputed is on disk.
    Warm,
}

impl Caches {
    const BOTH: [Self; 2] = [Self::Cold, Self::Warm];

    fn title(self) -> &'static str {
        match self {
            Self::Cold => "cold: nothing is cached",
            Self::Warm => "warm: what is precomputed is on disk",
        }
    }
}
