//! The command line: one file per subcommand. Messages and progress go to stderr; stdout carries what was asked for.

mod bench;
mod chart;
mod check;
mod devices;
pub mod diff;
#[cfg(feature = "editor")]
mod edit;
mod farm;
mod frames;
mod info;
mod messages;
mod node_help;
mod progress;
mod render;
mod schema;
mod side;

pub use messages::print_error;

use crate::params::NodeType;
use crate::{Result, nodes};
use clap::{Parser, Subcommand};

/// A node-graph compositor for light and shadow.
///
/// Exit codes: 0 done; 1 failed, or images differ; 2 bad usage or bad graph; 3 an input file is missing or unreadable;
/// 4 no such device; 5 some frames failed under --keep-going.
#[derive(Parser)]
#[command(name = "chiaro", version, max_term_width = 100)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    #[cfg(feature = "editor")]
    Edit(edit::Args),
    Render(render::Args),
    Check(check::Args),
    Diff(diff::Args),
    Info(info::Args),
    Nodes(node_help::Args),
    Schema(schema::Args),
    Devices(devices::Args),
    Bench(bench::Args),
    Chart(chart::Args),
    Farm(farm::Args),
}

impl Cli {
    /// Does what was asked for and returns the exit code.
    ///
    /// # Errors
    /// What stopped it; see `Error::exit_code`.
    pub fn run(self) -> Result<u8> {
        self.run_with(nodes::ALL)
    }

    /// The same with other node types than those of the program.
    ///
    /// # Errors
    /// As `run`.
    pub fn run_with(self, registry: &'static [NodeType]) -> Result<u8> {
        match self.command {
            #[cfg(feature = "editor")]
            Command::Edit(args) => args.run(registry),
            Command::Render(args) => args.run(registry),
            Command::Check(args) => args.run(registry),
            Command::Diff(args) => diff::run(&args).map(|equal| u8::from(!equal)),
            Command::Info(args) => args.run(),
            Command::Nodes(args) => args.run(registry),
            Command::Schema(args) => args.run(registry),
            Command::Devices(args) => args.run(),
            Command::Bench(args) => args.run(registry),
            Command::Chart(args) => args.run(registry),
            Command::Farm(args) => args.run(registry),
        }
    }
}

/// Prints to stdout; a reader that has gone away (`| head`) is no error.
fn print(text: &str) {
    use std::io::Write;
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}
