//! Computes what is asked for of a plan, and nothing else.
//!
//! ```text
//! let document = graph::load(path)?;
//! let plan = Plan::new(&document, nodes::ALL)?;
//! let evaluator = Evaluator::new(Options { disk: Some(Disk::open(folder, bound)?), ..Options::new(device) });
//! let context = Context { out: None, sink: &Silent, cancel: &flag };
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
use crate::graph::{Plan, Wire};
use crate::node::{Inputs, Job, Key};
use crate::progress::{Progress, Sink};
use crate::stored::SectionWriter;
use crate::value::Value;
use crate::{Error, Result};
use disk::Found;
use files::FileHashes;
use kept::Kept;
use keys::Keyed;
use serde_json::{Map, Value as Json};
use std::path::Path;
use std::sync::atomic::AtomicBool;
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

    /// Keys of the targets and of all that they could need, without computing anything; and whether the disk holds it.
    ///
    /// # Errors
    /// As `keys::keys`.
    pub fn keys(&self, plan: &Plan, targets: &[usize], frame: i64) -> Result<Vec<Option<(Keyed, bool)>>> {
        let keyed = keys::keys(plan, targets, frame as f64, &self.files)?;
        let on_disk = |key: Key| self.disk.as_ref().is_some_and(|disk| disk.contains(key));
        let look = |keyed: Keyed| {
            let found = on_disk(keyed.key);
            (keyed, found)
        };
        Ok(keyed.into_iter().map(|keyed| keyed.map(look)).collect())
    }

    /// What the memory cache holds of the targets and of what they take from, without computing
    /// anything; by step.
    ///
    /// # Errors
    /// As `keys::keys`.
    pub fn remembered(&self, plan: &Plan, targets: &[usize], frame: i64) -> Result<Vec<Option<Remembered>>> {
        let keyed = keys::keys(plan, targets, frame as f64, &self.files)?;
        let held = |key: Key| {
            let values = self.memory.outputs::<Outputs>(key)?.values.clone();
            Some(Remembered { key, values })
        };
        Ok(keyed.into_iter().map(|keyed| keyed.and_then(|keyed| held(keyed.key))).collect())
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
        let keyed = keys::keys(plan, targets, frame as f64, &self.files)?;
        let mut evaluation = Evaluation { evaluator: self, plan, keyed, context, frame, report };
        let (needs, mut takers) = evaluation.needs(targets);
        let mut results: Vec<Option<Arc<Outputs>>> = plan.steps.iter().map(|_| None).collect();
        for (index, (need, wires)) in needs.into_iter().enumerate() {
            let outputs = match need {
                Need::Nothing => continue,
                Need::Found(outputs) => outputs,
                Need::Pass(port) => evaluation.pass(index, port, &results),
                Need::Run(cached) => evaluation.run(index, cached, &results)?,
            };
            results[index] = Some(outputs);
            // Values that nobody will ask for any more leave to the memory cache's judgement.
            for wire in wires {
                takers[wire.step] -= 1;
                if takers[wire.step] == 0 {
                    results[wire.step] = None;
                }
            }
        }
        let values = |target: &usize| results[*target].as_ref().map_or_else(Vec::new, |outputs| outputs.values.clone());
        Ok(targets.iter().map(values).collect())
    }
}

/// One frame of one plan.
struct Evaluation<'a> {
    evaluator: &'a Evaluator,
    plan: &'a Plan,
    keyed: Vec<Option<Keyed>>,
    context: &'a Context<'a>,
    frame: i64,
    report: &'a mut Vec<NodeReport>,
}

impl Evaluation<'_> {
    fn keyed(&self, step: usize) -> &Keyed {
        self.keyed[step].as_ref().expect("keys reach all that is needed")
    }

    /// What each step must do and the wires that it takes from for that, and how many take from each step (targets
    /// count as one more).
    fn needs(&mut self, targets: &[usize]) -> (Vec<(Need, Vec<Wire>)>, Vec<usize>) {
        let plan = self.plan;
        let mut takers = vec![0; plan.steps.len()];
        targets.iter().for_each(|target| takers[*target] += 1);
        let mut needs = Vec::new();
        for (index, step) in plan.steps.iter().enumerate().rev() {
            let need = match () {
                () if takers[index] == 0 => Need::Nothing,
                () if step.is_sink() => Need::Run(None),
                () => match self.keyed(index).passes {
                    Some(port) => Need::Pass(port),
                    None => match self.look_up(index) {
                        Some(found) if !self.evaluator.verify => Need::Found(found),
                        found => Need::Run(found),
                    },
                },
            };
            let wires: Vec<Wire> = match &need {
                Need::Nothing | Need::Found(_) => Vec::new(),
                Need::Pass(port) => step.inputs[*port].into_iter().collect(),
                Need::Run(_) => step.inputs.iter().copied().flatten().collect(),
            };
            wires.iter().for_each(|wire| takers[wire.step] += 1);
            needs.push((need, wires));
        }
        needs.reverse();
        (needs, takers)
    }

    fn look_up(&mut self, index: usize) -> Option<Arc<Outputs>> {
        let start = Instant::now();
        let (info, key) = (self.plan.steps[index].node_type.info, self.keyed(index).key);
        if let Some(found) = self.evaluator.memory.outputs::<Outputs>(key) {
            self.tell(index, start, CacheUse::Memory, found.bytes(), found.notes.clone());
            return Some(found);
        }
        let disk = self.evaluator.disk.as_ref().filter(|_| info.stored)?;
        let found = disk.get(key, |sections| {
            let notes = sections.value()?;
            let values = info.outputs.iter().map(|port| Value::read(port.kind, sections)).collect::<Option<_>>()?;
            Some(Outputs { values, notes })
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

    fn input(&self, index: usize, port: usize, results: &[Option<Arc<Outputs>>]) -> Option<(Value, [Key; 4])> {
        let wire = self.plan.steps[index].inputs[port]?;
        let outputs = results[wire.step].as_ref().expect("sources are computed first");
        Some((outputs.values[wire.output].clone(), self.keyed(wire.step).outputs[wire.output]))
    }

    fn pass(&mut self, index: usize, port: usize, results: &[Option<Arc<Outputs>>]) -> Arc<Outputs> {
        let (value, _) = self.input(index, port, results).expect("keys pass only what is connected");
        self.tell(index, Instant::now(), CacheUse::Pass, value.bytes(), Map::new());
        Arc::new(Outputs { values: vec![value], notes: Map::new() })
    }

    fn run(
        &mut self,
        index: usize,
        cached: Option<Arc<Outputs>>,
        results: &[Option<Arc<Outputs>>],
    ) -> Result<Arc<Outputs>> {
        let start = Instant::now();
        let step = &self.plan.steps[index];
        let info = step.node_type.info;
        let keyed = self.keyed(index);
        let inputs =
            Inputs { info, values: (0..info.inputs.len()).map(|port| self.input(index, port, results)).collect() };
        let notes = Mutex::new(Map::new());
        let Evaluator { memory, disk, verify, .. } = self.evaluator;
        let memo = Kept { memory, disk: disk.as_ref(), verify: *verify };
        let job = Job {
            device: &self.evaluator.device,
            progress: Progress { node: &step.name, sink: self.context.sink, cancel: self.context.cancel },
            memo: &memo,
            frame: keyed.frame,
            fps: self.plan.fps,
            base: &self.plan.base,
            out: self.context.out,
            recipe: &|| self.plan.recipe(),
            key: keyed.key,
            notes: &notes,
        };
        let values = job
            .progress
            .check()
            .and_then(|()| keyed.node.run(&inputs, &job))
            .map_err(|error| error.at_node(&step.name, info.name))?;
        drop(inputs);
        let given: Vec<_> = values.iter().map(Value::kind).collect();
        let declared: Vec<_> = info.outputs.iter().map(|port| port.kind).collect();
        assert_eq!(given, declared, "{} does not give what it declares", info.name);
        let key = keyed.key;
        let outputs = Arc::new(Outputs { values, notes: notes.into_inner().expect("no panic while noting") });
        if !step.is_sink() {
            match cached {
                Some(cached) => compare(&cached, &outputs).map_err(|error| error.at_node(&step.name, info.name))?,
                None => self.keep(index, key, &outputs),
            }
        }
        self.tell(index, start, CacheUse::Computed, outputs.bytes(), outputs.notes.clone());
        Ok(outputs)
    }

    fn keep(&self, index: usize, key: Key, outputs: &Arc<Outputs>) {
        let info = self.plan.steps[index].node_type.info;
        self.evaluator.memory.put_outputs(key, outputs.clone(), outputs.bytes());
        let Some(disk) = self.evaluator.disk.as_ref().filter(|_| info.stored) else { return };
        let values =
            outputs.sections().unwrap_or_else(|| panic!("{} is stored, but its outputs are not storable", info.name));
        let mut sections = SectionWriter::default();
        sections.value(&outputs.notes);
        sections.sections.extend(values.sections);
        if let Err(error) = disk.put(key, &sections) {
            tracing::warn!("{} is not kept in the disk cache: {error}", self.plan.steps[index].name);
        }
    }

    fn tell(&mut self, index: usize, start: Instant, cache: CacheUse, bytes: u64, notes: Map<String, Json>) {
        let step = &self.plan.steps[index];
        let seconds = start.elapsed().as_secs_f64();
        let (node, kind, key) = (step.name.clone(), step.node_type.info.name, self.keyed(index).key.to_string());
        self.report.push(NodeReport { node, kind, frame: self.frame, key, seconds, cache, bytes, notes });
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
