//! Evaluates off the window's thread. The newest request wins: one that is running is cancelled, one that waits is
//! forgotten. What takes long comes coarse first, then in full.

use super::develop::{Developed, Settings, develop};
use super::look::{Look, Staging, is_own};
use super::shown::{Parts, Shown};
use super::thumb::{Thumb, thumb};
use crate::eval::{Context, Evaluator, NodeReport, Remembered};
use crate::graph::{Document, Plan};
use crate::node::Key;
use crate::params::NodeType;
use crate::progress::Sink;
use crate::{Error, Result};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::Instant;

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

/// Seconds above which a picture comes coarse first.
const LONG: f64 = 0.1;
/// Pixels of a coarse picture along a side, of those of the full one.
const COARSE: u64 = 4;

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
        let run =
            Run { evaluator, registry, shared: shared.clone(), told, seconds: HashMap::new(), keys: HashMap::new() };
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

/// The worker's thread.
struct Run {
    evaluator: Arc<Evaluator>,
    registry: &'static [NodeType],
    shared: Arc<Shared>,
    told: Told,
    /// How long the last full picture of each node took.
    seconds: HashMap<(String, usize), f64>,
    /// Of the values that thumbs were made of.
    keys: HashMap<String, Key>,
}

impl Run {
    fn serve(mut self) {
        loop {
            let mut waiting = self.shared.lock();
            let (id, request) = loop {
                if waiting.over {
                    return;
                }
                match waiting.request.take() {
                    Some(request) => break request,
                    None => {
                        let woken = self.shared.changed.wait(waiting);
                        waiting = woken.unwrap_or_else(std::sync::PoisonError::into_inner);
                    }
                }
            };
            self.shared.cancel.store(false, Ordering::Relaxed);
            drop(waiting);
            self.answer(id, &request);
        }
    }

    fn answer(&mut self, id: u64, request: &Request) {
        let staging = match Staging::new(&request.document, &request.look, self.registry) {
            Ok(staging) => staging,
            Err(error) => {
                let (level, result) = (Level::Full, Err(error));
                self.told.tell(Event::Finished { id, level, result, reports: Vec::new(), seconds: 0.0 });
                return;
            }
        };
        let place = &request.look.at;
        let is_long = self.seconds.get(place).is_none_or(|seconds| *seconds > LONG);
        if is_long && let Some(document) = coarse(&staging.document, self.registry) {
            match self.evaluate(id, request, &document, &staging) {
                (Err(Error::Cancelled), ..) => return,
                // What is wrong is wrong in full, too, and told then.
                (Err(_), ..) => {}
                (result, reports, seconds) => {
                    self.told.tell(Event::Finished { id, level: Level::Coarse, result, reports, seconds });
                }
            }
        }
        let (result, reports, seconds) = self.evaluate(id, request, &staging.document, &staging);
        if !matches!(result, Err(Error::Cancelled)) {
            self.seconds.insert(place.clone(), seconds);
        }
        let is_shown = result.is_ok();
        self.told.tell(Event::Finished { id, level: Level::Full, result, reports, seconds });
        if is_shown {
            self.thumbs(request, &staging);
        }
    }

    /// What a person can do nothing about is told as such, and ends neither window nor worker.
    fn evaluate(
        &self,
        id: u64,
        request: &Request,
        document: &Document,
        staging: &Staging,
    ) -> (Result<Picture>, Vec<NodeReport>, f64) {
        let start = Instant::now();
        let mut reports = Vec::new();
        let computed = || {
            let shown = self.shown(id, request.frame, document, staging, &mut reports)?;
            let developed = develop(&shown, &request.settings);
            Ok(Picture { shown, developed })
        };
        let result = catch_unwind(AssertUnwindSafe(computed)).unwrap_or_else(|_| {
            let message = format!("\"{}\" could not be computed: a fault of the program", request.look.at.0);
            Err(Error::compute(message, "save the recipe and report it; the recipe itself is not harmed"))
        });
        reports.retain(|report| !is_own(&request.document, &report.node));
        (result, reports, start.elapsed().as_secs_f64())
    }

    fn shown(
        &self,
        id: u64,
        frame: i64,
        document: &Document,
        staging: &Staging,
        reports: &mut Vec<NodeReport>,
    ) -> Result<Shown> {
        let plan = Plan::new(document, self.registry)?;
        let mut names: Vec<String> = staging.targets().into_iter().map(|(node, _)| node.to_owned()).collect();
        names.sort();
        names.dedup();
        let targets = plan.targets(&names)?;
        let sink = Bars { id, told: self.told.clone(), bars: Mutex::default(), next: AtomicU64::new(1) };
        let context = Context { out: None, sink: &sink, cancel: &self.shared.cancel };
        let values = self.evaluator.evaluate(&plan, &targets, frame, &context, reports)?;
        let of = |node: &str, output: usize| {
            let target = targets.iter().position(|target| plan.steps[*target].name == node)?;
            values[target].get(output).cloned()
        };
        let given = |place: &Option<(String, usize)>| place.as_ref().and_then(|(node, output)| of(node, *output));
        Shown::new(Parts {
            picture: of(&staging.picture.0, staging.picture.1),
            other: given(&staging.other),
            mask: given(&staging.mask),
            samples: staging.samples.as_ref().and_then(|samples| of(samples, 0)),
            scene: given(&staging.scene),
            lamp: given(&staging.lamp),
            environment: given(&staging.environment),
        })
    }

    fn thumbs(&mut self, request: &Request, staging: &Staging) {
        let remembered = || {
            let plan = Plan::new(&staging.document, self.registry)?;
            let steps: Vec<usize> = (0..plan.steps.len()).collect();
            let remembered = self.evaluator.remembered(&plan, &steps, request.frame)?;
            Ok::<_, Error>(plan.steps.into_iter().map(|step| step.name).zip(remembered).collect::<Vec<_>>())
        };
        let Ok(remembered) = remembered() else { return };
        let mut thumbs = Vec::new();
        for (node, found) in remembered {
            let Some(Remembered { key, values }) = found.filter(|_| !is_own(&request.document, &node)) else {
                continue;
            };
            if self.keys.insert(node.clone(), key) != Some(key) {
                thumbs.push((node, values.first().and_then(thumb)));
            }
        }
        if !thumbs.is_empty() {
            self.told.tell(Event::Thumbs { thumbs });
        }
    }
}

/// The recipe with fewer pixels, where that is to be had.
fn coarse(document: &Document, registry: &[NodeType]) -> Option<Document> {
    let view = registry.iter().find(|node_type| node_type.info.name == "view_samples")?;
    let defaults = (view.defaults)();
    let mut document = document.clone();
    let mut changed = false;
    for entry in document.nodes.values_mut().filter(|entry| entry.kind == view.info.name) {
        for name in ["width", "height"] {
            let full = entry.params.get(name).unwrap_or(&defaults[name]).as_u64();
            let Some(full) = full.filter(|full| *full >= 16 * COARSE) else { continue };
            entry.params.insert(name.to_owned(), (full / COARSE).into());
            changed = true;
        }
        entry.params.shift_remove("samples_per_pixel");
    }
    changed.then(|| document.refreshed().ok()).flatten()
}

/// Passes progress on, a few times a second for each stage.
struct Bars {
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
