//! The command line: one file per subcommand. Messages and progress go to stderr; stdout carries what was asked for.

mod check;
mod devices;
mod frames;
mod messages;
mod nodes;
mod progress;
mod render;
mod schema;

pub use messages::print_error;

use crate::Result;
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
    Render(render::Args),
    Check(check::Args),
    Nodes(nodes::Args),
    Schema(schema::Args),
    Devices(devices::Args),
}

impl Cli {
    /// Does what was asked for and returns the exit code.
    ///
    /// # Errors
    /// What stopped it; see `Error::exit_code`.
    pub fn run(self) -> Result<u8> {
        match self.command {
            Command::Render(args) => args.run(),
            Command::Check(args) => args.run(),
            Command::Nodes(args) => args.run(),
            Command::Schema(args) => args.run(),
            Command::Devices(args) => args.run(),
        }
    }
}

/// Prints to stdout; a reader that has gone away (`| head`) is no error.
fn print(text: &str) {
    use std::io::Write;
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}
