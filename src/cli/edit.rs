//! `chiaro edit`: the window.

use super::render::CacheArgs;
use crate::device::{Choice, Device};
use crate::editor::window::{self, Engine, Places};
use crate::eval::{Evaluator, Options};
use crate::params::NodeType;
use crate::{Error, Result};
use std::path::PathBuf;
use std::sync::Arc;

/// Open the editor
#[derive(clap::Args)]
pub struct Args {
    /// The recipe (.json); one that does not exist yet is begun
    graph: Option<PathBuf>,
    #[arg(long, value_enum, default_value_t = Choice::Auto)]
    device: Choice,
    /// Memory for computed values, in MiB
    #[arg(long, value_name = "MIB", default_value_t = 2048)]
    memory: u64,
    /// Folder for what the editor keeps: autosaves, recent files [default: chiaro in the system's data folder]
    #[arg(long, env = "CHIARO_EDITOR", value_name = "DIR")]
    folder: Option<PathBuf>,
    #[command(flatten)]
    cache: CacheArgs,
}

impl Args {
    pub fn run(self, registry: &'static [NodeType]) -> Result<u8> {
        let folder = match self.folder {
            Some(folder) => folder,
            None => {
                use etcetera::BaseStrategy;
                let places = etcetera::choose_base_strategy().map_err(|error| {
                    Error::usage(format!("no folder for autosaves: {error}"), "name one with --folder")
                })?;
                places.data_dir().join("chiaro")
            }
        };
        let memory = self.memory.saturating_mul(1 << 20);
        let options = Options {
            memory,
            disk: self.cache.open()?,
            verify: self.cache.verify_cache,
            ..Options::new(Device::open(self.device)?)
        };
        let engine = Engine { evaluator: Arc::new(Evaluator::new(options)), registry };
        window::run(engine, Places { folder }, self.graph)?;
        Ok(0)
    }
}
