//! The worker's thread: takes the newest request, and answers it.

use super::bars::Bars;
use super::{Event, Level, Picture, Request, Shared, Told};
use crate::editor::develop::develop;
use crate::editor::look::{Staging, is_own};
use crate::editor::shown::{LastMask, Parts, Shown};
use crate::editor::thumb::thumb;
use crate::eval::{Context, Evaluator, NodeReport, Remembered};
use crate::graph::{Checks, Document, Plan};
use crate::node::Key;
use crate::params::NodeType;
use crate::value::Value;
use crate::{Error, Result};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Seconds above which a picture comes coarse first: what a hand still takes for at once.
const LONG: f64 = 0.05;
/// Pixels of a coarse picture along a side, of those of the full one.
const COARSE: u64 = 4;

pub struct Run {
    evaluator: Arc<Evaluator>,
    registry: &'static [NodeType],
    shared: Arc<Shared>,
    told: Told,
    /// How long the last two full pictures of each node took.
    seconds: HashMap<(String, usize), [f64; 2]>,
    /// Of the values that thumbs were made of.
    keys: HashMap<String, Key>,
    mask: LastMask,
    checks: Checks,
}

impl Run {
    pub fn new(evaluator: Arc<Evaluator>, registry: &'static [NodeType], shared: Arc<Shared>, told: Told) -> Self {
        Self {
            evaluator,
            registry,
            shared,
            told,
            seconds: HashMap::new(),
            keys: HashMap::new(),
            mask: LastMask::default(),
            checks: Checks::default(),
        }
    }

    pub fn serve(mut self) {
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
        // One alone may have been held up by something else.
        let is_long = self.seconds.get(place).is_none_or(|last| last.iter().all(|seconds| *seconds > LONG));
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
            let last = self.seconds.entry(place.clone()).or_insert([seconds; 2]);
            *last = [seconds, last[0]];
        }
        let is_shown = result.is_ok();
        self.told.tell(Event::Finished { id, level: Level::Full, result, reports, seconds });
        if is_shown {
            self.thumbs(request, &staging);
        }
    }

    /// What a person can do nothing about is told as such, and ends neither window nor worker.
    fn evaluate(
        &mut self,
        id: u64,
        request: &Request,
        document: &Document,
        staging: &Staging,
    ) -> (Result<Picture>, Vec<NodeReport>, f64) {
        let start = Instant::now();
        let mut reports = Vec::new();
        let computed = || {
            let shown = self.shown(id, request, document, staging, &mut reports)?;
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
        &mut self,
        id: u64,
        request: &Request,
        document: &Document,
        staging: &Staging,
        reports: &mut Vec<NodeReport>,
    ) -> Result<Shown> {
        let plan = Plan::again(document, self.registry, &mut self.checks)?;
        let mut names: Vec<String> = staging.targets().into_iter().map(|(node, _)| node.to_owned()).collect();
        names.sort();
        names.dedup();
        let targets = plan.targets(&names)?;
        let sink = Bars::new(id, self.told.clone());
        // What gets better while it is computed is shown as it does.
        let (told, settings, start) = (self.told.clone(), request.settings.clone(), Instant::now());
        let show = |values: Vec<Vec<Value>>| {
            let parts = parts(staging, &|node, output| taken(&names, &values, node, output));
            if let Ok(shown) = Shown::new(parts, &mut LastMask::default()) {
                let developed = develop(&shown, &settings);
                let (result, seconds) = (Ok(Picture { shown, developed }), start.elapsed().as_secs_f64());
                told.tell(Event::Finished { id, level: Level::Coarse, result, reports: Vec::new(), seconds });
            }
        };
        let context = Context { sink: &sink, cancel: &self.shared.cancel, show: Some(&show), ..Context::SILENT };
        let values = self.evaluator.evaluate(&plan, &targets, request.frame, &context, reports)?;
        Shown::new(parts(staging, &|node, output| taken(&names, &values, node, output)), &mut self.mask)
    }

    fn thumbs(&mut self, request: &Request, staging: &Staging) {
        let mut remembered = || {
            let plan = Plan::again(&staging.document, self.registry, &mut self.checks)?;
            let steps: Vec<usize> = (0..plan.steps.len()).collect();
            let remembered = self.evaluator.remembered(&plan, &steps, request.frame)?;
            Ok::<_, Error>(plan.steps.into_iter().map(|step| step.name).zip(remembered).collect::<Vec<_>>())
        };
        let mut thumbs = Vec::new();
        let remembered = remembered().unwrap_or_default();
        for (node, found) in remembered {
            let Some(Remembered { key, values }) = found.filter(|_| !is_own(&request.document, &node)) else {
                continue;
            };
            if self.keys.insert(node.clone(), key) != Some(key) {
                thumbs.push((node, values.first().and_then(thumb)));
            }
        }
        self.told.tell(Event::Thumbs { thumbs });
    }
}

/// The value of an output of one of the targets, which are called `names`.
fn taken(names: &[String], values: &[Vec<Value>], node: &str, output: usize) -> Option<Value> {
    let target = names.iter().position(|name| name == node)?;
    values[target].get(output).cloned()
}

/// What is to be shown; `of` gives the value of a node's output.
fn parts(staging: &Staging, of: &dyn Fn(&str, usize) -> Option<Value>) -> Parts {
    let given = |place: &Option<(String, usize)>| place.as_ref().and_then(|(node, output)| of(node, *output));
    Parts {
        picture: of(&staging.picture.0, staging.picture.1),
        other: given(&staging.other),
        mask: given(&staging.mask),
        samples: staging.samples.as_ref().and_then(|samples| of(samples, 0)),
        scene: given(&staging.scene),
        lamp: given(&staging.lamp),
        environment: given(&staging.environment),
    }
}

/// The recipe with fewer pixels, where that is to be had.
fn coarse(document: &Document, registry: &[NodeType]) -> Option<Document> {
    let view = registry.iter().find(|node_type| node_type.info.name == "view_samples")?;
    // Pictures from files keep their size, and what is merged with them must have it.
    if document.nodes.values().any(|entry| entry.kind == "read_image") {
        return None;
    }
    let defaults = (view.defaults)();
    let mut document = document.clone();
    let mut changed = false;
    for entry in document.nodes.values_mut().filter(|entry| entry.kind == view.info.name) {
        let entry = Arc::make_mut(entry);
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
