//! `chiaro schema`: the JSON schema of recipes, for editors and other programs.

use super::print;
use crate::Result;
use crate::graph::schema::recipe_schema;
use crate::params::NodeType;

/// Print the JSON schema of recipes
#[derive(clap::Args)]
pub struct Args {}

impl Args {
    pub fn run(self, registry: &'static [NodeType]) -> Result<u8> {
        let text = serde_json::to_string_pretty(&recipe_schema(registry)).expect("plain data");
        print(&format!("{text}\n"));
        Ok(0)
    }
}
