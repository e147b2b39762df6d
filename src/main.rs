//! Policy only: parse, call, print the error once, exit code.

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    match chiaro::cli::Cli::parse().run() {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            chiaro::cli::print_error(&error);
            ExitCode::from(error.exit_code())
        }
    }
}
