//! Computes what is asked for of a plan, and nothing else.
//!
//! ```text
//! let document = graph::load(path)?;
//! let plan = Plan::new(&document, nodes::ALL)?;
//! let evaluator = Evaluator::new(Options { disk: Some(Disk::open(folder, bound)?), ..Options::new(device) });
//! let context = Context { cancel: &flag, ..Context::SILENT };
//! let values = evaluator.evaluate(&plan, &plan.targets(&[])?, frame, &context, &mut report)?;
//! ```
//!
//! Pull: keys first (`keys`), then backwards from the targets to see what the caches lack, then forwards through what
//! must run. The inputs of a value that is found are never looked at. Nodes that only write files always run.

pub mod disk;
pub mod files;
mod kept;
pub mod keys;
pub mod memory;
pub mod outputs;
pub mod report;

pub use disk::Disk;
pub use memory::Memory;
pub use report::{CacheUse, NodeReport, Report};

use crate::device::Device;
use crate::graph::{Plan, Step};
use crate::node::{Given, Inputs, Job, Key, Part};
use crate::progress::{Progress, Silent, Sink};
use crate::stored::SectionWriter;
use crate::value::Value;
use crate::{Error, Result};
use disk::Found;
use files::FileHashes;
use kept::Kept;
use keys::{Source, Task, Tasks};
use serde_json::{Map, Value as Json};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;

pub struct Options {
    pub device: Device,
    /// Bytes that the memory cache may hold.
    pub memory: u64,
    pub disk: Option<Disk>,
    /// Compute in spite of a hit, and fail when the result differs.
    pub verify: bool,
}

impl Options {
    /// 1 GiB of memory cache, no disk cache.
    pub fn new(device: Device) -> Self {
        Self { device, memory: 1 << 30, disk: None, verify: false }
    }
}

pub struct Evaluator {
    device: Device,
    memory: Memory,
    disk: Option<Disk>,
    verify: bool,
    files: FileHashes,
}

/// What an evaluation runs with.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Folder for output files, instead of the recipe's.
    pub out: Option<&'a Path>,
    pub sink: &'a dyn Sink,
    pub cancel: &'a AtomicBool,
    /// A node that is stopped may give the best that it has: what takes from it still runs, nothing of that is kept, and
    /// the evaluation ends as `Cancelled`.
    pub keeps_best: bool,
    /// Is shown the targets' values before they are as good as asked, as they get better.
    pub show: Option<&'a Show<'a>>,
}

/// Takes the values of each target.
pub type Show<'a> = dyn Fn(Vec<Vec<Value>>) + Sync + 'a;

static NEVER: AtomicBool = AtomicBool::new(false);

impl Context<'static> {
    /// Shows nothing, and goes on to the end.
    pub const SILENT: Self = Self { out: None, sink: &Silent, cancel: &NEVER, keeps_best: false, show: None };
}

/// What the memory cache holds of a node.
pub struct Remembered {
    pub key: Key,
    pub values: Vec<Value>,
}

/// What a run of a node gave.
struct Outputs {
    values: Vec<Value>,
    notes: Map<String, Json>,
    /// They, or what they were made of, are the best that a node had when it was stopped.
    unfinished: bool,
}

impl Outputs {
    fn bytes(&self) -> u64 {
        self.values.iter().map(Value::bytes).sum()
    }

    /// `None` when a value of a kind that is not storable is among them.
    fn sections(&self) -> Option<SectionWriter<'_>> {
        let mut sections = SectionWriter::default();
        for value in &self.values {
            if !value.kind().is_storable() {
                return None;
            }
            value.write(&mut sections);
        }
        Some(sections)
    }
}

/// What is to be done for a step.
enum Need {
    Nothing,
    Found(Arc<Outputs>),
    Pass(usize),
    /// With what the cache holds, when that is to be verified.
    Run(Option<Arc<Outputs>>),
}

impl Evaluator {
    pub fn new(options: Options) -> Self {
        let Options { device, memory, disk, verify } = options;
        Self { device, memory: Memory::new(memory), disk, verify, files: FileHashes::default() }
    }

    pub fn device(&self) -> &Device {
        &self.device
    }

    /// The targets and all that they could need, with their keys, without computing anything.
    ///
    /// # Errors
    /// As `keys::tasks`.
    pub fn tasks(&self, plan: &Plan, targets: &[usize], frame: i64) -> Result<Tasks> {
        keys::tasks(plan, targets, frame, &self.files, &self.memory)
    }

    pub fn has_disk(&self) -> bool {
        self.disk.is_some()
    }

    pub fn is_on_disk(&self, key: Key) -> bool {
        self.disk.as_ref().is_some_and(|disk| disk.contains(key))
    }

    /// What the memory cache holds of the targets and of what they take from, without computing
    /// anything; by step.
    ///
    /// # Errors
    /// As `keys::tasks`.
    pub fn remembered(&self, plan: &Plan, targets: &[usize], frame: i64) -> Result<Vec<Option<Remembered>>> {
        let tasks = self.tasks(plan, targets, frame)?;
        let held = |step: usize| {
            let key = tasks.at(step, frame)?.key;
            let values = self.memory.outputs::<Outputs>(key)?.values.clone();
            Some(Remembered { key, values })
        };
        Ok((0..plan.steps.len()).map(held).collect())
    }

    /// The outputs of each target at a frame. What happened to each node is added to `report`, also on failure.
    ///
    /// # Errors
    /// That of the first node that fails, with its name; `Cancelled`.
    pub fn evaluate(
        &self,
        plan: &Plan,
        targets: &[usize],
        frame: i64,
        context: &Context,
        report: &mut Vec<NodeReport>,
    ) -> Result<Vec<Vec<Value>>> {
        let tasks = self.tasks(plan, targets, frame)?;
        let numbers: Vec<usize> =
            targets.iter().map(|step| tasks.find(*step, frame).expect("it is asked for")).collect();
        let mut evaluation = Evaluation { evaluator: self, plan, tasks: &tasks, context, report, targets: &numbers };
        let results = evaluation.results(&numbers)?;
        if numbers.iter().any(|number| results[*number].as_ref().is_some_and(|outputs| outputs.unfinished)) {
            return Err(Error::Cancelled);
        }
        let values = |number: &usize| results[*number].as_ref().map_or_else(Vec::new, |outputs| outputs.values.clone());
        Ok(numbers.iter().map(values).collect())
    }

    /// A part of all precomputations that the targets need at a frame and that are not on disk yet: it is left there for
    /// whoever asks for the whole. Nothing else is computed but what these take from, and no file is written.
    ///
    /// # Errors
    /// As `evaluate`.
    pub fn precompute(
        &self,
        plan: &Plan,
        targets: &[usize],
        frame: i64,
        part: Part,
        context: &Context,
        report: &mut Vec<NodeReport>,
    ) -> Result<()> {
        let tasks = self.tasks(plan, targets, frame)?;
        let mut evaluation = Evaluation { evaluator: self, plan, tasks: &tasks, context, report, targets: &[] };
        for (number, task) in tasks.list.iter().enumerate() {
            if !plan.steps[task.step].node_type.info.in_parts || self.is_on_disk(task.key) {
                continue;
            }
            let sources: BTreeSet<usize> = task.inputs.iter().flatten().map(|source| source.task).collect();
            let results = evaluation.results(&sources.into_iter().collect::<Vec<_>>())?;
            evaluation.compute(number, Some(part), &results)?;
        }
        Ok(())
    }
}

/// One frame of one plan.
struct Evaluation<'a> {
    evaluator: &'a Evaluator,
    plan: &'a Plan,
    tasks: &'a Tasks,
    context: &'a Context<'a>,
    report: &'a mut Vec<NodeReport>,
    /// Tasks that were asked for.
    targets: &'a [usize],
}

impl<'a> Evaluation<'a> {
    fn task(&self, index: usize) -> (&'a Step, &'a Task) {
        let task = &self.tasks.list[index];
        (&self.plan.steps[task.step], task)
    }

    /// The outputs of these tasks, by number; others are computed on the way and let go.
    fn results(&mut self, numbers: &[usize]) -> Result<Vec<Option<Arc<Outputs>>>> {
        let (needs, mut takers) = self.needs(numbers);
        let mut results: Vec<Option<Arc<Outputs>>> = self.tasks.list.iter().map(|_| None).collect();
        for (index, (need, sources)) in needs.into_iter().enumerate() {
            let outputs = match need {
                Need::Nothing => continue,
                Need::Found(outputs) => outputs,
                Need::Pass(port) => self.pass(index, port, &results),
                Need::Run(cached) => self.run(index, cached, &results)?,
            };
            results[index] = Some(outputs);
            // Values that nobody will ask for any more leave to the memory cache's judgement.
            for source in sources {
                takers[source.task] -= 1;
                if takers[source.task] == 0 {
                    results[source.task] = None;
                }
            }
        }
        Ok(results)
    }

    /// What each task must do and the sources that it takes from for that, and how many take from each task (targets
    /// count as one more).
    fn needs(&mut self, targets: &[usize]) -> (Vec<(Need, Vec<Source>)>, Vec<usize>) {
        let mut takers = vec![0; self.tasks.list.len()];
        targets.iter().for_each(|target| takers[*target] += 1);
        let mut needs = Vec::new();
        for index in (0..self.tasks.list.len()).rev() {
            let (step, task) = self.task(index);
            let need = match () {
                () if takers[index] == 0 => Need::Nothing,
                () if step.is_sink() => Need::Run(None),
                () => match task.passes {
                    Some(port) => Need::Pass(port),
                    None => match self.look_up(index) {
                        Some(found) if !self.evaluator.verify => Need::Found(found),
                        found => Need::Run(found),
                    },
                },
            };
            let sources: Vec<Source> = match &need {
                Need::Nothing | Need::Found(_) => Vec::new(),
                Need::Pass(port) => task.inputs[*port][..1].to_vec(),
                Need::Run(_) => task.inputs.iter().flatten().copied().collect(),
            };
            sources.iter().for_each(|source| takers[source.task] += 1);
            needs.push((need, sources));
        }
        needs.reverse();
        (needs, takers)
    }

    fn look_up(&mut self, index: usize) -> Option<Arc<Outputs>> {
        let start = Instant::now();
        let (step, task) = self.task(index);
        let (info, key) = (step.node_type.info, task.key);
        if let Some(found) = self.evaluator.memory.outputs::<Outputs>(key) {
            self.tell(index, start, CacheUse::Memory, found.bytes(), found.notes.clone());
            return Some(found);
        }
        let disk = self.evaluator.disk.as_ref().filter(|_| info.stored)?;
        let found = disk.get(key, |sections| {
            let notes = sections.value()?;
            let values = info.outputs.iter().map(|port| Value::read(port.kind, sections)).collect::<Option<_>>()?;
            Some(Outputs { values, notes, unfinished: false })
        });
        match found {
            Found::Value(outputs) => {
                let outputs = Arc::new(outputs);
                self.evaluator.memory.put_outputs(key, outputs.clone(), outputs.bytes());
                self.tell(index, start, CacheUse::Disk, outputs.bytes(), outputs.notes.clone());
                Some(outputs)
            }
            Found::Nothing => None,
            Found::Damaged => {
                let path = disk.path(key);
                tracing::warn!("damaged cache entry, computed again: {}", path.display());
                None
            }
        }
    }

    fn given(&self, source: &Source, results: &[Option<Arc<Outputs>>]) -> Given {
        let outputs = results[source.task].as_ref().expect("sources are computed first");
        (outputs.values[source.output].clone(), self.tasks.list[source.task].outputs[source.output])
    }

    fn inputs(&self, index: usize, results: &[Option<Arc<Outputs>>]) -> Inputs<'a> {
        let (step, task) = self.task(index);
        let values = task.inputs.iter().map(|sources| Some(self.given(sources.first()?, results))).collect();
        // A port that is asked for as it is now needs no second entry.
        let others = task.inputs.iter().enumerate().filter(|(_, sources)| {
            sources.len() > 1 || sources.first().is_some_and(|source| source.frame != task.frame)
        });
        let given = |port: usize, source: &Source| (port, source.frame, self.given(source, results));
        let at_frames =
            others.flat_map(|(port, sources)| sources.iter().map(move |source| given(port, source))).collect();
        let connected = step.inputs.iter().map(Option::is_some).collect();
        Inputs { info: step.node_type.info, values, at_frames, connected }
    }

    fn pass(&mut self, index: usize, port: usize, results: &[Option<Arc<Outputs>>]) -> Arc<Outputs> {
        let (value, _) = self.given(&self.task(index).1.inputs[port][0], results);
        self.tell(index, Instant::now(), CacheUse::Pass, value.bytes(), Map::new());
        let unfinished = results[self.task(index).1.inputs[port][0].task].as_ref().is_some_and(|from| from.unfinished);
        Arc::new(Outputs { values: vec![value], notes: Map::new(), unfinished })
    }

    fn run(
        &mut self,
        index: usize,
        cached: Option<Arc<Outputs>>,
        results: &[Option<Arc<Outputs>>],
    ) -> Result<Arc<Outputs>> {
        let (step, task) = self.task(index);
        let info = step.node_type.info;
        let (outputs, start) = (Arc::new(self.compute(index, None, results)?), Instant::now());
        let given: Vec<_> = outputs.values.iter().map(Value::kind).collect();
        let declared: Vec<_> = info.outputs.iter().map(|port| port.kind).collect();
        assert_eq!(given, declared, "{} does not give what it declares", info.name);
        if !step.is_sink() && !outputs.unfinished {
            match cached {
                Some(cached) => compare(&cached, &outputs).map_err(|error| error.at_node(&step.name, info.name))?,
                None => self.keep(index, task.key, &outputs),
            }
        }
        // Keeping is part of what it takes.
        if let Some(told) = self.report.last_mut() {
            told.seconds += start.elapsed().as_secs_f64();
        }
        Ok(outputs)
    }

    /// Runs a node, and tells the report; with a part, there are no values.
    fn compute(&mut self, index: usize, part: Option<Part>, results: &[Option<Arc<Outputs>>]) -> Result<Outputs> {
        let start = Instant::now();
        let (step, task) = self.task(index);
        let inputs = self.inputs(index, results);
        let notes = Mutex::new(Map::new());
        let from =
            task.inputs.iter().flatten().any(|source| results[source.task].as_ref().is_some_and(|r| r.unfinished));
        let unfinished = AtomicBool::new(from);
        let show = |values: Vec<Value>| self.show(index, values, results);
        let Evaluator { memory, disk, verify, .. } = self.evaluator;
        let memo = Kept { memory, disk: disk.as_ref(), verify: *verify, must_last: part.is_some() };
        let job = Job {
            device: &self.evaluator.device,
            progress: Progress {
                node: &step.name,
                sink: self.context.sink,
                // What is made of the best that there is goes on to its end.
                cancel: if from { &NEVER } else { self.context.cancel },
            },
            memo: &memo,
            frame: task.told,
            fps: self.plan.fps,
            base: &self.plan.base,
            out: self.context.out,
            recipe: &|| self.plan.recipe(),
            key: task.key,
            content: task.content,
            part,
            notes: &notes,
            show: self.context.show.map(|_| &show as &(dyn Fn(Vec<Value>) + Sync)),
            keeps_best: self.context.keeps_best,
            unfinished: &unfinished,
        };
        let values = job
            .progress
            .check()
            .and_then(|()| task.node.run(&inputs, &job))
            .map_err(|error| error.at_node(&step.name, step.node_type.info.name))?;
        drop(inputs);
        let unfinished = unfinished.load(Ordering::Relaxed);
        let outputs = Outputs { values, notes: notes.into_inner().expect("no panic while noting"), unfinished };
        self.tell(index, start, CacheUse::Computed, outputs.bytes(), outputs.notes.clone());
        Ok(outputs)
    }

    /// Hands out what the targets are with these values of a task, which are not yet what they will be. What else they take
    /// is computed as ever; what is made of these values is not kept.
    fn show(&self, index: usize, values: Vec<Value>, results: &[Option<Arc<Outputs>>]) {
        let Some(show) = self.context.show else { return };
        let mut early: Vec<Option<Arc<Outputs>>> = results.to_vec();
        early[index] = Some(Arc::new(Outputs { values, notes: Map::new(), unfinished: true }));
        let context = Context { show: None, ..*self.context };
        let mut evaluation = Evaluation { context: &context, report: &mut Vec::new(), ..*self };
        // What is wrong will be said when it is met in earnest.
        if let Ok(results) = evaluation.early_results(early) {
            let of = |number: &usize| results[*number].as_ref().map_or_else(Vec::new, |outputs| outputs.values.clone());
            show(self.targets.iter().map(of).collect());
        }
    }

    /// The results of the targets, from those that there are.
    fn early_results(&mut self, mut results: Vec<Option<Arc<Outputs>>>) -> Result<Vec<Option<Arc<Outputs>>>> {
        for target in self.targets {
            self.early_result(*target, &mut results)?;
        }
        Ok(results)
    }

    fn early_result(&mut self, index: usize, results: &mut Vec<Option<Arc<Outputs>>>) -> Result<()> {
        let (step, task) = self.task(index);
        if results[index].is_some() || step.is_sink() {
            return Ok(());
        }
        let sources: Vec<Source> = task.inputs.iter().flatten().copied().collect();
        if !self.takes_early(index, results)
            && task.passes.is_none()
            && let Some(found) = self.look_up(index)
        {
            results[index] = Some(found);
            return Ok(());
        }
        for source in &sources {
            self.early_result(source.task, results)?;
        }
        let outputs = match task.passes {
            Some(port) => self.pass(index, port, results),
            None => self.run(index, None, results)?,
        };
        results[index] = Some(outputs);
        Ok(())
    }

    /// Whether a task takes, near or far, from what is unfinished.
    fn takes_early(&self, index: usize, results: &[Option<Arc<Outputs>>]) -> bool {
        match &results[index] {
            Some(outputs) => outputs.unfinished,
            None => self.task(index).1.inputs.iter().flatten().any(|source| self.takes_early(source.task, results)),
        }
    }

    fn keep(&self, index: usize, key: Key, outputs: &Arc<Outputs>) {
        let (step, _) = self.task(index);
        let info = step.node_type.info;
        self.evaluator.memory.put_outputs(key, outputs.clone(), outputs.bytes());
        let Some(disk) = self.evaluator.disk.as_ref().filter(|_| info.stored) else { return };
        let values =
            outputs.sections().unwrap_or_else(|| panic!("{} is stored, but its outputs are not storable", info.name));
        let mut sections = SectionWriter::default();
        sections.value(&outputs.notes);
        sections.sections.extend(values.sections);
        if let Err(error) = disk.put(key, &sections) {
            tracing::warn!("{} is not kept in the disk cache: {error}", step.name);
        }
    }

    fn tell(&mut self, index: usize, start: Instant, cache: CacheUse, bytes: u64, notes: Map<String, Json>) {
        let (step, task) = self.task(index);
        let seconds = start.elapsed().as_secs_f64();
        let (node, kind, key) = (step.name.clone(), step.node_type.info.name, task.key.to_string());
        self.report.push(NodeReport { node, kind, frame: task.frame, key, seconds, cache, bytes, notes });
    }
}

/// Checked mode: a cached value must be what is computed now.
fn compare(cached: &Outputs, computed: &Outputs) -> Result<()> {
    let (Some(a), Some(b)) = (cached.sections(), computed.sections()) else {
        tracing::info!("values of this kind cannot be compared: not verified");
        return Ok(());
    };
    if a.sections == b.sections {
        return Ok(());
    }
    Err(Error::compute(
        "the cached value is not what is computed now",
        "its key misses something that it depends on, or it was computed on another device; clear the cache",
    ))
}
