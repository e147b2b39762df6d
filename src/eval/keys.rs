//! Keys: what each value of a plan is called at a frame, found without computing any of them.
//!
//! A node's own part is its type and version, the sources that the program was built from, its parameters at the
//! frame, the content of its files, and what changes in these with the frame if anything does (`Node::moments`). To that
//! come the keys of its inputs, of each only the facets that the port reads. Device and number of threads do not enter.
//!
//! Mostly all of a plan is asked for at one frame; a node may ask for inputs at others (`Node::frames`). Where a step has
//! equal keys at two frames, both are one task.

use super::files::FileHashes;
use crate::Result;
use crate::graph::{Plan, Ready, Step};
use crate::node::{Facet, FacetRule, Key, Memo, Port, When};
use crate::params::AnyNode;
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

/// A hash of all code that results depend on (see build.rs).
pub(super) const SOURCES: &str = env!("CHIARO_SOURCES");

/// One node at one frame, ready to run.
pub struct Task {
    /// Of the plan.
    pub step: usize,
    /// The lowest of the frames that it stands for.
    pub frame: i64,
    pub node: Arc<dyn AnyNode>,
    /// Names what a run of the node computes.
    pub key: Key,
    /// Of the node's files.
    pub content: Key,
    /// The input (index of its port) whose value is this node's, unchanged.
    pub passes: Option<usize>,
    /// Per output the key of each facet.
    pub outputs: Vec<[Key; 4]>,
    /// What the node is told of the frame: 0 unless it depends on it.
    pub told: f64,
    /// Per port where its values come from, one for each frame that it is asked for at: the first is the port's value.
    pub inputs: Vec<Vec<Source>>,
}

/// Where an input's value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Source {
    pub frame: i64,
    /// Number of the task.
    pub task: usize,
    pub output: usize,
}

/// What is asked of a plan: every task comes after those that it takes from.
pub struct Tasks {
    pub list: Vec<Task>,
    /// By step and frame.
    numbers: HashMap<(usize, i64), usize>,
}

impl Tasks {
    /// `None` when nothing that was asked for needs that step.
    pub fn find(&self, step: usize, frame: i64) -> Option<usize> {
        self.numbers.get(&(step, frame)).copied()
    }

    pub fn at(&self, step: usize, frame: i64) -> Option<&Task> {
        self.find(step, frame).map(|number| &self.list[number])
    }
}

/// The targets at a frame, and all that they could need. `memo`: for what nodes read of files to tell frames apart.
///
/// # Errors
/// `File` when an input file cannot be read, `Compute` when parameters do not go together at this frame.
pub fn tasks(plan: &Plan, targets: &[usize], frame: i64, files: &FileHashes, memo: &dyn Memo) -> Result<Tasks> {
    let wanted = wanted(plan, targets, frame)?;
    let mut tasks = Tasks { list: Vec::new(), numbers: HashMap::new() };
    for (index, wanted) in wanted.into_iter().enumerate() {
        let step = &plan.steps[index];
        let first = tasks.list.len();
        for (frame, ready, frames) in wanted {
            let source = |port: usize, frame: i64| {
                let wire = step.inputs[port]?;
                let task = tasks.find(wire.step, frame).expect("sources come first");
                Some(Source { frame, task, output: wire.output })
            };
            let inputs =
                frames.iter().enumerate().map(|(port, at)| at.iter().filter_map(|f| source(port, *f)).collect());
            let inputs: Vec<Vec<Source>> = inputs.collect();
            let task = Asked { plan, index, frame, ready, inputs }.task(&tasks, files, memo);
            let task = task.map_err(|error| error.at_node(&step.name, step.node_type.info.name))?;
            let known = tasks.list[first..].iter().position(|known| known.key == task.key);
            let number = first + known.unwrap_or(tasks.list.len() - first);
            tasks.numbers.insert((index, frame), number);
            if known.is_none() {
                tasks.list.push(task);
            }
        }
    }
    Ok(tasks)
}

/// A frame, the node at that frame, and per port the frames that it asks for.
type Wanted = (i64, Ready, Vec<Vec<i64>>);

/// At which frames each step is needed, in their order.
fn wanted(plan: &Plan, targets: &[usize], frame: i64) -> Result<Vec<Vec<Wanted>>> {
    let mut frames = vec![BTreeSet::new(); plan.steps.len()];
    for target in targets {
        frames[*target].insert(frame);
    }
    let mut wanted = Vec::new();
    for (index, step) in plan.steps.iter().enumerate().rev() {
        let mut here = Vec::new();
        for frame in std::mem::take(&mut frames[index]) {
            let ready = step.node(frame as f64)?;
            let asked = step.inputs.iter().zip(step.node_type.info.inputs).map(|(wire, port)| {
                let Some(wire) = wire else { return Vec::new() };
                let asked = ready.node.frames(port.name, frame);
                frames[wire.step].extend(&asked);
                asked
            });
            let asked = asked.collect();
            here.push((frame, ready, asked));
        }
        wanted.push(here);
    }
    wanted.reverse();
    Ok(wanted)
}

/// A step at a frame, before its key is known.
struct Asked<'a> {
    plan: &'a Plan,
    index: usize,
    frame: i64,
    ready: Ready,
    inputs: Vec<Vec<Source>>,
}

impl Asked<'_> {
    fn step(&self) -> &Step {
        &self.plan.steps[self.index]
    }

    fn port(&self, name: &str) -> usize {
        let info = self.step().node_type.info;
        let found = info.inputs.iter().position(|port| port.name == name);
        found.unwrap_or_else(|| panic!("node type {} declares no input {name}", info.name))
    }

    fn task(self, tasks: &Tasks, files: &FileHashes, memo: &dyn Memo) -> Result<Task> {
        let Ready { node, digest } = &self.ready;
        let info = self.step().node_type.info;
        let Plan { base, fps, .. } = self.plan;
        let content = files.of_node(&**node, base, self.frame as f64)?;
        let told = if node.uses_frame(base) { self.frame as f64 } else { 0.0 };
        let moments = match node.uses_frame(base) {
            true => node.moments(&When { frame: told, fps: *fps, base, content, memo })?,
            false => [Key::of(&[b"always"]); 4],
        };
        let version = info.version.to_le_bytes();
        let own = Key::of(&[info.name.as_bytes(), &version, SOURCES.as_bytes(), &digest.0, &content.0]);
        let of_source = |source: &Source| tasks.list[source.task].outputs[source.output];
        // What is handed through untouched is part of the value, even if the node never looks at it.
        let kept = |port: &Port, facet: &Facet| {
            let keeps =
                |rule: &FacetRule| matches!(rule, FacetRule::Keeps(kept, from) if kept == facet && *from == port.name);
            info.facets.iter().any(keeps)
        };
        let input = |port: usize, facets: &dyn Fn(&Facet) -> bool| {
            let sources = self.inputs[port].iter().map(of_source);
            let keys: Vec<Key> = sources
                .flat_map(|keys| Facet::ALL.into_iter().filter(facets).map(move |facet| keys[facet as usize]))
                .collect();
            join(if self.step().inputs[port].is_none() { b"not connected" } else { b"connected" }, &keys)
        };
        let read = info.inputs.iter().enumerate().map(|(index, port)| {
            let reads = |facet: &Facet| port.reads.contains(facet) || kept(port, facet);
            input(index, &reads)
        });
        let parts: Vec<Key> = [own].into_iter().chain(moments).chain(read).collect();
        let key = join(b"run", &parts);
        let first = |port: usize| self.inputs[port].first().map(of_source);
        let passes = node.pass_through().map(|name| self.port(name)).filter(|port| !self.inputs[*port].is_empty());
        let facet = |output: usize, facet: Facet| {
            let whole = join(&[b'o', output as u8], &[key]);
            let ruled = |rule: &&FacetRule| match rule {
                FacetRule::Keeps(ruled, _) | FacetRule::From(ruled, _) => *ruled == facet,
            };
            match info.facets.iter().find(ruled) {
                Some(FacetRule::Keeps(_, from)) => first(self.port(from)).map_or(whole, |keys| keys[facet as usize]),
                Some(FacetRule::From(_, from)) => {
                    let inputs =
                        from.iter().map(|(name, facets)| input(self.port(name), &|facet| facets.contains(facet)));
                    let parts: Vec<Key> = [own, moments[facet as usize]].into_iter().chain(inputs).collect();
                    join(&[b'f', output as u8, facet as u8], &parts)
                }
                None => whole,
            }
        };
        let outputs = match passes.and_then(first) {
            Some(keys) => vec![keys; info.outputs.len()],
            None => (0..info.outputs.len()).map(|output| Facet::ALL.map(|of| facet(output, of))).collect(),
        };
        let Self { index: step, frame, ready: Ready { node, .. }, inputs, .. } = self;
        Ok(Task { step, frame, node, key, content, passes, outputs, told, inputs })
    }
}

fn join(label: &[u8], keys: &[Key]) -> Key {
    let mut parts: Vec<&[u8]> = vec![label];
    parts.extend(keys.iter().map(|key| &key.0[..]));
    Key::of(&parts)
}
