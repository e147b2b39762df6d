//! `chiaro schema`: the JSON schema of recipes, for editors and other programs.

use super::print;
use crate::graph::schema::recipe_schema;
use crate::{Result, nodes};

/// Print the JSON schema of recipes
#[derive(clap::Args)]
pub struct Args {}

impl Args {
    pub fn run(self) -> Result<u8> {
        let text = serde_json::to_string_pretty(&recipe_schema(nodes::ALL)).expect("plain data");
        print(&format!("{text}\n"));
        Ok(0)
    }
}
