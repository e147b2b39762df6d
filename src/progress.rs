//! Progress and cancellation, as a long computation sees them. The command line decides how it is shown.

use crate::{Error, Result};
use std::sync::atomic::{AtomicBool, Ordering};

/// Where progress goes. `begin` opens a stage of `total` steps; `advance` and `end` refer to the stage by its number.
pub trait Sink: Send + Sync {
    fn begin(&self, node: &str, stage: &str, total: u64) -> u64;
    fn advance(&self, stage: u64, steps: u64);
    fn end(&self, stage: u64);
}

/// A sink that shows nothing.
pub struct Silent;

impl Sink for Silent {
    fn begin(&self, _: &str, _: &str, _: u64) -> u64 {
        0
    }
    fn advance(&self, _: u64, _: u64) {}
    fn end(&self, _: u64) {}
}

/// What a node is handed: its name, the sink, and the flag that asks it to stop.
#[derive(Clone, Copy)]
pub struct Progress<'a> {
    pub node: &'a str,
    pub sink: &'a dyn Sink,
    pub cancel: &'a AtomicBool,
}

static NEVER: AtomicBool = AtomicBool::new(false);

impl Progress<'static> {
    /// For tests and library calls that need neither progress nor cancellation.
    pub const fn silent() -> Self {
        Self { node: "", sink: &Silent, cancel: &NEVER }
    }
}

impl<'a> Progress<'a> {
    pub fn stage(&self, name: &str, total: u64) -> Stage<'a> {
        Stage { id: self.sink.begin(self.node, name, total), progress: *self }
    }

    /// `Err(Cancelled)` once somebody has asked to stop; call it between tiles.
    pub fn check(&self) -> Result<()> {
        if self.cancel.load(Ordering::Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
    }
}

/// One bar. Ends when dropped.
pub struct Stage<'a> {
    id: u64,
    progress: Progress<'a>,
}

impl Stage<'_> {
    /// Counts finished steps and says whether to go on.
    pub fn advance(&self, steps: u64) -> Result<()> {
        self.progress.sink.advance(self.id, steps);
        self.progress.check()
    }
}

impl Drop for Stage<'_> {
    fn drop(&mut self) {
        self.progress.sink.end(self.id);
    }
}
