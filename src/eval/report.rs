//! What `--report` holds.

use crate::Result;
use serde::Serialize;
use serde_json::{Map, Value as Json};
use std::path::Path;

/// Where a node's value came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CacheUse {
    Memory,
    Disk,
    Computed,
    /// The node returns an input unchanged.
    Pass,
}

#[derive(Clone, Debug, Serialize)]
pub struct NodeReport {
    pub node: String,
    #[serde(rename = "type")]
    pub kind: &'static str,
    pub frame: i64,
    pub key: String,
    /// Of this node alone, without its inputs.
    pub seconds: f64,
    pub cache: CacheUse,
    /// Size of its outputs in memory.
    pub bytes: u64,
    /// What the node says about itself.
    pub notes: Map<String, Json>,
}

#[derive(Clone, Debug, Serialize)]
pub struct FailedFrame {
    pub frame: i64,
    pub error: String,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    pub chiaro: &'static str,
    pub recipe: String,
    pub device: String,
    pub threads: usize,
    /// Rendered without a failure.
    pub frames: Vec<i64>,
    /// Their files were there already (`--skip-existing`).
    pub skipped: Vec<i64>,
    pub failed: Vec<FailedFrame>,
    pub seconds: f64,
    /// Largest resident size of the process; absent where the system does not say.
    pub peak_memory_bytes: Option<u64>,
    pub nodes: Vec<NodeReport>,
}

impl Report {
    /// # Errors
    /// `Output` when the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self).expect("plain data");
        crate::atomic::write(path, text.as_bytes())
    }
}

/// Linux tells; other systems need a call that is not worth a dependency.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}
