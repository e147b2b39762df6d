//! How far nodes have come, for the window.

use super::{Event, Told};
use crate::progress::Sink;
use std::collections::HashMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Passes progress on, a few times a second for each stage.
pub struct Bars {
    id: u64,
    told: Told,
    bars: Mutex<HashMap<u64, Bar>>,
    next: AtomicU64,
}

struct Bar {
    node: String,
    stage: String,
    done: u64,
    total: u64,
    last: Instant,
}

impl Bars {
    /// For the request of that number.
    pub fn new(id: u64, told: Told) -> Self {
        Self { id, told, bars: Mutex::default(), next: AtomicU64::new(1) }
    }

    fn tell(&self, bar: &Bar) {
        let (node, stage) = (bar.node.clone(), bar.stage.clone());
        self.told.tell(Event::Progress { id: self.id, node, stage, done: bar.done, total: bar.total });
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<u64, Bar>> {
        self.bars.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Sink for Bars {
    fn begin(&self, node: &str, stage: &str, total: u64) -> u64 {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        let (node, stage) = (node.to_owned(), stage.to_owned());
        let bar = Bar { node, stage, done: 0, total, last: Instant::now() };
        self.lock().insert(number, bar);
        number
    }

    fn advance(&self, stage: u64, steps: u64) {
        let mut bars = self.lock();
        let Some(bar) = bars.get_mut(&stage) else { return };
        bar.done += steps;
        if bar.last.elapsed().as_millis() >= 100 {
            bar.last = Instant::now();
            self.tell(bar);
        }
    }

    fn end(&self, stage: u64) {
        self.lock().remove(&stage);
    }
}
