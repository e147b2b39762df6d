//! Evaluates off the window's thread. The newest request wins: one that is running is cancelled, one that waits is
//! forgotten. What takes long comes coarse first, then in full.

mod bars;
mod run;

use super::develop::{Developed, Settings};
use super::look::Look;
use super::shown::Shown;
use super::thumb::Thumb;
use crate::Result;
use crate::eval::{Evaluator, NodeReport};
use crate::graph::Document;
use crate::params::NodeType;
use run::Run;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;

/// What is to be seen.
#[derive(Clone)]
pub struct Request {
    pub document: Arc<Document>,
    pub look: Look,
    pub frame: i64,
    /// How it is to be shown.
    pub settings: Settings,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    Coarse,
    Full,
}

/// What the window is told. `id` is that of the request.
pub enum Event {
    Progress {
        id: u64,
        node: String,
        stage: String,
        done: u64,
        total: u64,
    },
    Finished {
        id: u64,
        level: Level,
        result: Result<Picture>,
        reports: Vec<NodeReport>,
        seconds: f64,
    },
    /// After a full picture: nodes whose values have become others, with a small picture where they have one.
    Thumbs {
        thumbs: Vec<(String, Option<Thumb>)>,
    },
}

/// What was computed, and how it looks.
pub struct Picture {
    pub shown: Shown,
    pub developed: Developed,
}

pub struct Worker {
    shared: Arc<Shared>,
    events: Receiver<Event>,
    thread: Option<JoinHandle<()>>,
    next: u64,
}

struct Shared {
    waiting: Mutex<Waiting>,
    changed: Condvar,
    /// Stops the evaluation that is running.
    cancel: AtomicBool,
}

#[derive(Default)]
struct Waiting {
    request: Option<(u64, Request)>,
    over: bool,
}

impl Worker {
    /// `wake` is called on the worker's thread when there is something to be told.
    pub fn new(
        evaluator: Arc<Evaluator>,
        registry: &'static [NodeType],
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Self {
        let waiting = Mutex::new(Waiting::default());
        let shared = Arc::new(Shared { waiting, changed: Condvar::new(), cancel: AtomicBool::new(false) });
        let (sender, events) = channel();
        let told = Told { sender, wake: Arc::new(wake) };
        let run = Run::new(evaluator, registry, shared.clone(), told);
        let thread = std::thread::Builder::new().name("evaluation".to_owned()).spawn(move || run.serve());
        Self { shared, events, thread: thread.ok(), next: 1 }
    }

    /// Asks for a picture in place of all that was asked for before; returns the number of the request.
    pub fn request(&mut self, request: Request) -> u64 {
        let id = self.next;
        self.next += 1;
        self.shared.interrupt(|waiting| waiting.request = Some((id, request)));
        id
    }

    /// Stops what is running, and forgets what waits.
    pub fn cancel(&self) {
        self.shared.interrupt(|waiting| waiting.request = None);
    }

    /// What has happened since it was last asked.
    pub fn events(&self) -> impl Iterator<Item = Event> + '_ {
        self.events.try_iter()
    }

    /// Waits for the next event; `None` when the worker has ended.
    pub fn wait(&self) -> Option<Event> {
        self.events.recv().ok()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.shared.interrupt(|waiting| waiting.over = true);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Shared {
    /// Changes what waits, and stops what is running. In one, so that what waits is not stopped in its place.
    fn interrupt(&self, change: impl FnOnce(&mut Waiting)) {
        let mut waiting = self.lock();
        change(&mut waiting);
        self.cancel.store(true, Ordering::Relaxed);
        self.changed.notify_one();
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

/// To the window.
#[derive(Clone)]
struct Told {
    sender: Sender<Event>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Told {
    fn tell(&self, event: Event) {
        // A window that has closed does not listen any more.
        let _ = self.sender.send(event);
        (self.wake)();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Device;
    use crate::eval::Options;
    use crate::nodes;
    use serde_json::json;
    use std::path::Path;

    fn recipe(width: u32, brightness: f64) -> Arc<Document> {
        let text = json!({ "chiaro": 1, "nodes": {
            "room": { "type": "scene", "params": { "file": "builtin:room" } },
            "view": { "type": "view_samples", "params": { "width": width, "height": 64 }, "inputs": { "scene": "room" } },
            "way": {
                "type": "transfer", "params": { "gather_samples": 2048, "tolerance": 0.1 },
                "inputs": { "scene": "room", "samples": "view" },
            },
            "edit": { "type": "caster_receiver", "params": { "brightness": brightness } },
            "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "way", "edits": "edit" } },
            "broken": { "type": "nonsense" },
        }});
        Arc::new(Document::parse(Path::new("test.json"), &text.to_string()).unwrap())
    }

    fn worker() -> Worker {
        Worker::new(Arc::new(Evaluator::new(Options::new(Device::Cpu))), nodes::ALL, || {})
    }

    fn ask(document: Arc<Document>, node: &str) -> Request {
        Request { document, look: Look::new(node, 0), frame: 1, settings: Settings::default() }
    }

    /// Until the full picture of a request; what comes before it.
    fn finished(worker: &Worker, of: u64) -> (Vec<(u64, Level)>, Result<Picture>) {
        let mut seen = Vec::new();
        loop {
            match worker.wait().expect("it lives") {
                Event::Finished { id, level: Level::Full, result, .. } if id == of => return (seen, result),
                Event::Finished { id, level, .. } => seen.push((id, level)),
                Event::Progress { .. } | Event::Thumbs { .. } => {}
            }
        }
    }

    fn width(picture: &Picture) -> usize {
        assert_eq!(picture.developed.picture.width, picture.shown.picture.width);
        picture.shown.picture.width
    }

    #[test]
    fn a_picture_comes_coarse_then_full_then_at_once() {
        let mut worker = worker();
        let id = worker.request(ask(recipe(96, 2.0), "lit"));
        let Some(Event::Finished { level: Level::Coarse, result, .. }) =
            std::iter::from_fn(|| worker.wait()).find(|event| matches!(event, Event::Finished { .. }))
        else {
            panic!("coarse first");
        };
        assert_eq!(width(&result.unwrap()), 24);
        let (_, full) = finished(&worker, id);
        assert_eq!(width(&full.unwrap()), 96, "and a node that is broken elsewhere is no matter");
        // All that is dear is there now.
        let id = worker.request(ask(recipe(96, 2.5), "lit"));
        finished(&worker, id).1.unwrap();
        let id = worker.request(ask(recipe(96, 3.0), "lit"));
        assert_eq!(finished(&worker, id).0, []);
    }

    #[test]
    fn the_newest_wins() {
        let mut worker = worker();
        let ids: Vec<u64> = (0..20).map(|i| worker.request(ask(recipe(640, 1.0 + f64::from(i)), "lit"))).collect();
        let last = worker.request(ask(recipe(64, 2.0), "lit"));
        let (seen, result) = finished(&worker, last);
        assert_eq!(width(&result.unwrap()), 64);
        let full = seen.iter().filter(|(id, level)| ids.contains(id) && *level == Level::Full).count();
        assert!(full <= 2, "{full} requests that nobody wanted any more were answered");
    }

    #[test]
    fn what_is_wrong_is_told() {
        let mut worker = worker();
        let id = worker.request(ask(recipe(64, 2.0), "broken"));
        assert!(finished(&worker, id).1.is_err());
        let id = worker.request(ask(recipe(64, 2.0), "no_such_node"));
        assert!(finished(&worker, id).1.is_err());
        let id = worker.request(Request { look: Look::new("lit", 7), ..ask(recipe(64, 2.0), "lit") });
        assert!(finished(&worker, id).1.is_err());
        let id = worker.request(ask(recipe(64, 2.0), "edit"));
        let Err(error) = finished(&worker, id).1 else { panic!("edits are no picture") };
        assert!(error.help().contains("relight"), "{}", error.help());
    }
}
