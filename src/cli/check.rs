//! `chiaro check`: whether recipes are well-formed, without computing anything or looking at the files they name.

use super::{print, print_error};
use crate::Result;
use crate::graph::{self, Plan};
use crate::params::NodeType;
use std::path::PathBuf;

/// Check recipes and report all their problems
#[derive(clap::Args)]
pub struct Args {
    /// Recipes (.json)
    #[arg(required = true, value_name = "GRAPH")]
    graphs: Vec<PathBuf>,
}

impl Args {
    pub fn run(self, registry: &'static [NodeType]) -> Result<u8> {
        let mut code = 0;
        for path in &self.graphs {
            match graph::load(path).and_then(|document| Plan::new(&document, registry)) {
                Ok(plan) => print(&format!("{}: good, {} nodes\n", path.display(), plan.steps.len())),
                Err(error) => {
                    print_error(&error);
                    code = code.max(error.exit_code());
                }
            }
        }
        Ok(code)
    }
}
