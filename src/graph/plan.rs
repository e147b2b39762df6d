//! A checked graph in the order in which it can be computed.

use super::check::Checker;
use super::curve::Complaint;
use super::document::{Document, NodeEntry};
use super::params::{Checks, Params, Ready, read_param};
use super::problem::{Problem, summary};
use super::source::{Part, Source, child};
use crate::names::suggest;
use crate::params::NodeType;
use crate::{Error, Result};
use indexmap::IndexMap;
use std::cell::OnceCell;
use std::path::PathBuf;
use std::sync::Arc;

/// Every step comes after the steps that it takes values from.
pub struct Plan {
    pub steps: Vec<Step>,
    /// First and last.
    pub frames: [i64; 2],
    pub fps: f64,
    /// Folder that relative paths start from.
    pub base: PathBuf,
    document: Document,
}

pub struct Step {
    pub name: String,
    pub node_type: &'static NodeType,
    pub params: Arc<Params>,
    /// Per port of the node type; past what is muted.
    pub inputs: Vec<Option<Wire>>,
    /// Nothing takes from it, and it writes no files.
    pub muted: bool,
}

/// Where an input's value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wire {
    pub step: usize,
    pub output: usize,
}

impl Step {
    /// The node with its parameters at a frame.
    ///
    /// # Errors
    /// `Compute` when a curve passes through values that the parameters do not take together.
    pub fn node(&self, frame: f64) -> Result<Ready> {
        self.params.node(self.node_type, frame).map_err(|message| {
            Error::compute(format!("at frame {frame}: {message}"), "change the keys of the parameter's curve")
                .at_node(&self.name, self.node_type.info.name)
        })
    }

    /// It only writes files.
    pub fn is_sink(&self) -> bool {
        self.node_type.info.outputs.is_empty()
    }
}

impl Plan {
    /// Checks a recipe against the node types.
    ///
    /// # Errors
    /// `Graph` with all problems, or `Usage` when only overrides of the command line are wrong.
    pub fn new(document: &Document, registry: &'static [NodeType]) -> Result<Self> {
        Self::again(document, registry, &mut Checks::default())
    }

    /// `new`, for a recipe that changes: parameters of nodes that have not are not checked again. `checks` are of plans
    /// with the same `registry`.
    ///
    /// # Errors
    /// As `new`.
    pub fn again(document: &Document, registry: &'static [NodeType], checks: &mut Checks) -> Result<Self> {
        let (problems, overrides) = (document.problems.clone(), Vec::new());
        let mut planner = Planner { document, source: OnceCell::new(), registry, checks, problems, overrides };
        let (mut steps, mut complete) = (Vec::new(), true);
        for (name, entry) in &document.nodes {
            match planner.step(name, entry) {
                Some(step) => steps.push(step),
                None => complete = false,
            }
        }
        planner.checks.keep(|node| document.nodes.contains_key(node));
        let order = planner.order();
        if !planner.problems.is_empty() {
            let mut problems = planner.problems;
            problems.extend(planner.overrides);
            problems.sort_by_key(|problem| problem.place.as_ref().map_or(usize::MAX, |place| place.range.start));
            return Err(complaint(document, problems));
        }
        if !planner.overrides.is_empty() {
            return Err(Error::usage(summary(&planner.overrides), ""));
        }
        assert!(complete, "a node that cannot be planned has a problem");
        let mut problems = mute(document, &mut steps);
        problems.extend(absent(document, &steps));
        if !problems.is_empty() {
            return Err(complaint(document, problems));
        }
        let mut place = vec![0; steps.len()];
        order.iter().enumerate().for_each(|(to, from)| place[*from] = to);
        let mut sorted: Vec<(usize, Step)> = place.iter().copied().zip(steps).collect();
        sorted.sort_by_key(|(to, _)| *to);
        let mut steps: Vec<Step> = sorted.into_iter().map(|(_, step)| step).collect();
        for wire in steps.iter_mut().flat_map(|step| step.inputs.iter_mut().flatten()) {
            wire.step = place[wire.step];
        }
        let (frames, fps, base) = (document.frames, document.fps, document.base.clone());
        Ok(Self { steps, frames, fps, base, document: document.clone() })
    }

    /// The recipe with the overrides of the command line applied, as text.
    pub fn recipe(&self) -> String {
        self.document.to_text()
    }

    pub fn find(&self, name: &str) -> Option<usize> {
        self.steps.iter().position(|step| step.name == name)
    }

    /// The steps of the given names, or all that write files when none is given.
    ///
    /// # Errors
    /// `Usage` when there is no node of a name, or nothing that writes files.
    pub fn targets(&self, names: &[String]) -> Result<Vec<usize>> {
        if names.is_empty() {
            let sinks: Vec<usize> =
                (0..self.steps.len()).filter(|step| self.steps[*step].is_sink() && !self.steps[*step].muted).collect();
            if sinks.is_empty() {
                let help = "add a write_image node, or name a node with --node";
                return Err(Error::usage("no node of this recipe writes a file", help));
            }
            return Ok(sinks);
        }
        let find = |name: &String| {
            self.find(name).ok_or_else(|| {
                let help = suggest(name, self.steps.iter().map(|step| step.name.as_str()));
                Error::usage(format!("there is no node \"{name}\" in the recipe"), help)
            })
        };
        let steps: Vec<usize> = names.iter().map(find).collect::<Result<_>>()?;
        match steps.iter().find(|step| self.steps[**step].muted) {
            Some(muted) => {
                let message = format!("node \"{}\" is muted", self.steps[*muted].name);
                Err(Error::usage(message, "unmute it, or name the node in front of it"))
            }
            None => Ok(steps),
        }
    }
}

fn complaint(document: &Document, problems: Vec<Problem>) -> Error {
    Error::Graph { path: document.path.clone(), source_text: document.source().text.clone(), problems }
}

struct Planner<'a> {
    document: &'a Document,
    /// Of the document, once something is wrong with it.
    source: OnceCell<Arc<Source>>,
    registry: &'static [NodeType],
    checks: &'a mut Checks,
    problems: Vec<Problem>,
    /// Problems of parameters that were given on the command line.
    overrides: Vec<Problem>,
}

impl Planner<'_> {
    fn complain(&mut self, pointer: &str, part: Part, message: impl Into<String>, help: impl Into<String>) {
        let source = self.source.get_or_init(|| self.document.source());
        self.problems.push(source.problem(pointer, part, message, help));
    }

    fn find_type(&self, name: &str) -> Option<&'static NodeType> {
        self.registry.iter().find(|node_type| node_type.info.name == name)
    }

    fn step(&mut self, name: &str, entry: &Arc<NodeEntry>) -> Option<Step> {
        let pointer = child("/nodes", name);
        let Some(node_type) = self.find_type(&entry.kind) else {
            if !entry.kind.is_empty() {
                let help = suggest(&entry.kind, self.registry.iter().map(|node_type| node_type.info.name));
                let message = format!("there is no node type \"{}\"", entry.kind);
                self.complain(&child(&pointer, "type"), Part::Value, message, help);
            }
            return None;
        };
        let params = self.params(name, entry, node_type);
        let inputs = self.inputs(name, entry, node_type);
        Some(Step { name: name.to_owned(), node_type, params, inputs, muted: entry.muted })
    }

    fn params(&mut self, node: &str, entry: &Arc<NodeEntry>, node_type: &'static NodeType) -> Arc<Params> {
        let first = self.document.frames[0];
        if let Some(known) = self.checks.of(node, entry, first) {
            return known;
        }
        let (params, mut fine) = self.read(node, entry, node_type);
        // Each parameter may be fine, and still not go with the others.
        if fine && let Err(message) = params.node(node_type, first as f64) {
            let pointer = child(&child("/nodes", node), "params");
            self.complain(&pointer, Part::Value, format!("parameters of {}: {message}", node_type.info.name), "");
            fine = false;
        }
        let params = Arc::new(params);
        if fine {
            self.checks.note(node, entry, first, &params);
        }
        params
    }

    /// Each parameter by itself, and whether all are fine.
    fn read(&mut self, node: &str, entry: &NodeEntry, node_type: &'static NodeType) -> (Params, bool) {
        let (mut params, mut fine) = (IndexMap::new(), true);
        if entry.params.is_empty() {
            return (Params::new(params), fine);
        }
        let checker = Checker::of(node_type);
        for (name, value) in &entry.params {
            let Some(param) = checker.param(name) else {
                let message = format!("{} has no parameter \"{name}\"", node_type.info.name);
                let help = suggest(name, checker.names());
                self.complain_of_param(node, name, Part::Key, (String::new(), message, help));
                fine = false;
                continue;
            };
            match read_param(param, value) {
                Ok(read) => drop(params.insert(name.clone(), read)),
                Err(complaints) => {
                    fine = false;
                    for (at, message, help) in complaints {
                        let inside = inside(&at);
                        let message = format!("parameter \"{name}\" of {}{inside}: {message}", node_type.info.name);
                        self.complain_of_param(node, name, Part::Value, (at, message, help));
                    }
                }
            }
        }
        (Params::new(params), fine)
    }

    fn complain_of_param(&mut self, node: &str, name: &str, part: Part, (at, message, help): Complaint) {
        let pointer = format!("{}{at}", child(&child(&child("/nodes", node), "params"), name));
        match self.document.overrides.get(&(node.to_owned(), name.to_owned())) {
            Some(argument) => {
                let message = format!("--set {argument}: {message}");
                self.overrides.push(Problem { message, help, pointer, place: None });
            }
            None => self.complain(&pointer, part, message, help),
        }
    }

    fn inputs(&mut self, name: &str, entry: &NodeEntry, node_type: &NodeType) -> Vec<Option<Wire>> {
        let info = node_type.info;
        let pointer = child("/nodes", name);
        for port in entry.inputs.keys().filter(|port| !info.inputs.iter().any(|known| known.name == port.as_str())) {
            let help = suggest(port, info.inputs.iter().map(|port| port.name));
            let message = format!("{} has no input \"{port}\"", info.name);
            self.complain(&child(&child(&pointer, "inputs"), port), Part::Key, message, help);
        }
        let mut wires = Vec::new();
        for port in info.inputs {
            let wire = entry.inputs.get(port.name).and_then(|from| {
                let pointer = child(&child(&pointer, "inputs"), port.name);
                let (wire, kind) = self.wire(&pointer, from)?;
                if kind == port.kind {
                    return Some(wire);
                }
                let (wanted, given) = (port.kind.name(), kind.name());
                let message = format!(
                    "input \"{}\" of \"{name}\" ({}) takes {wanted}, but \"{from}\" gives {given}",
                    port.name, info.name
                );
                let fitting: Vec<String> = self.givers(port.kind);
                let help = match fitting.is_empty() {
                    true => format!("no node of this recipe gives {wanted}"),
                    false => format!("{wanted} is given by {}", fitting.join(", ")),
                };
                self.complain(&pointer, Part::Value, message, help);
                None
            });
            if !port.optional && !entry.inputs.contains_key(port.name) {
                let message = format!("input \"{}\" of \"{name}\" ({}) is not connected", port.name, info.name);
                let help = format!("connect a node that gives {}: {}", port.kind.name(), port.doc);
                self.complain(&pointer, Part::Key, message, help);
            }
            wires.push(wire);
        }
        wires
    }

    /// The output that `"node"` or `"node.port"` names, by the document's order, and its type.
    fn wire(&mut self, pointer: &str, from: &str) -> Option<(Wire, crate::value::Kind)> {
        let (node, port) = from.split_once('.').map_or((from, None), |(node, port)| (node, Some(port)));
        let document = self.document;
        let Some((step, _, entry)) = document.nodes.get_full(node) else {
            let help = suggest(node, document.nodes.keys().map(String::as_str));
            self.complain(pointer, Part::Value, format!("there is no node \"{node}\""), help);
            return None;
        };
        // A node of an unknown type is a problem of its own.
        let info = self.find_type(&entry.kind)?.info;
        let output = match port {
            None => info.outputs.first().map(|_| 0),
            Some(port) => info.outputs.iter().position(|output| output.name == port),
        };
        let Some(output) = output else {
            let (message, help) = match port {
                Some(port) => (
                    format!("\"{node}\" ({}) has no output \"{port}\"", info.name),
                    suggest(port, info.outputs.iter().map(|output| output.name)),
                ),
                None => (format!("\"{node}\" ({}) has no outputs", info.name), String::new()),
            };
            self.complain(pointer, Part::Value, message, help);
            return None;
        };
        Some((Wire { step, output }, info.outputs[output].kind))
    }

    /// What of this recipe gives values of a type, as inputs name it.
    fn givers(&self, kind: crate::value::Kind) -> Vec<String> {
        let mut found = Vec::new();
        for (name, entry) in &self.document.nodes {
            let outputs = self.find_type(&entry.kind).map_or(&[][..], |node_type| node_type.info.outputs);
            for (index, output) in outputs.iter().enumerate().filter(|(_, output)| output.kind == kind) {
                found.push(if index == 0 { format!("\"{name}\"") } else { format!("\"{name}.{}\"", output.name) });
            }
        }
        found
    }

    /// Indices of the document's nodes, each after its inputs, otherwise as written. Names every loop.
    fn order(&mut self) -> Vec<usize> {
        let nodes = &self.document.nodes;
        let sources: Vec<Vec<usize>> = nodes
            .values()
            .map(|entry| {
                let names = entry.inputs.values().map(|from| from.split('.').next().unwrap_or(from));
                names.filter_map(|name| nodes.get_index_of(name)).collect()
            })
            .collect();
        let mut waiting: Vec<usize> = sources.iter().map(Vec::len).collect();
        let mut takers = vec![Vec::new(); nodes.len()];
        for (taker, sources) in sources.iter().enumerate() {
            sources.iter().for_each(|source| takers[*source].push(taker));
        }
        let mut ready: std::collections::BTreeSet<usize> =
            (0..nodes.len()).filter(|node| waiting[*node] == 0).collect();
        let mut order = Vec::new();
        while let Some(node) = ready.pop_first() {
            order.push(node);
            for taker in &takers[node] {
                waiting[*taker] -= 1;
                if waiting[*taker] == 0 {
                    ready.insert(*taker);
                }
            }
        }
        let mut seen: Vec<bool> = waiting.iter().map(|count| *count == 0).collect();
        while let Some(start) = seen.iter().position(|seen| !seen) {
            // Backwards along wires that never became ready: this must come round, or meet a loop that is known.
            let mut path: Vec<usize> = Vec::new();
            let mut node = start;
            while !seen[node] {
                seen[node] = true;
                path.push(node);
                let stuck = |source: &&usize| waiting[**source] > 0;
                node = *sources[node].iter().find(stuck).expect("a stuck node has a stuck input");
            }
            if let Some(from) = path.iter().position(|member| *member == node) {
                let name = |index: &usize| nodes.get_index(*index).map_or("", |(name, _)| name.as_str());
                let mut names: Vec<&str> = path[from..].iter().rev().map(name).collect();
                names.push(names[0]);
                let message = format!("nodes feed themselves: {}", names.join(" -> "));
                let pointer = child("/nodes", names[0]);
                self.complain(&pointer, Part::Key, message, "take one of these wires out");
            }
        }
        order
    }
}

/// Leads wires past muted nodes: what took from one takes what goes into its first port of the same kind. `steps` are in
/// the order of the document.
fn mute(document: &Document, steps: &mut [Step]) -> Vec<Problem> {
    let source = |steps: &[Step], mut wire: Wire| -> Option<Wire> {
        while steps[wire.step].muted {
            let info = steps[wire.step].node_type.info;
            let kind = info.outputs[wire.output].kind;
            let port = info.inputs.iter().position(|port| port.kind == kind)?;
            wire = steps[wire.step].inputs[port]?;
        }
        Some(wire)
    };
    let mut problems = Vec::new();
    let led: Vec<Vec<Option<Wire>>> =
        steps.iter().map(|step| step.inputs.iter().map(|wire| source(steps, (*wire)?)).collect()).collect();
    for (step, led) in steps.iter().zip(&led).filter(|(step, _)| !step.muted) {
        let ports = step.node_type.info.inputs.iter().zip(step.inputs.iter().zip(led));
        for (port, (before, _)) in ports.filter(|(port, (wire, led))| !port.optional && wire.is_some() && led.is_none())
        {
            let from = before.map_or("", |wire| &steps[wire.step].name);
            let pointer = child(&child(&child("/nodes", &step.name), "inputs"), port.name);
            let message = format!("input \"{}\" of \"{}\" takes from \"{from}\", which is muted", port.name, step.name);
            let help = format!("\"{from}\" has no {} to pass on; unmute it, or take from another", port.kind.name());
            problems.push(document.source().problem(&pointer, Part::Value, message, help));
        }
    }
    steps.iter_mut().zip(led).for_each(|(step, led)| step.inputs = led);
    problems
}

/// Wires that take from outputs which are not there without another input. `steps` are in the order of the document.
fn absent(document: &Document, steps: &[Step]) -> Vec<Problem> {
    let mut problems = Vec::new();
    for step in steps.iter().filter(|step| !step.muted) {
        let wires = step.node_type.info.inputs.iter().zip(&step.inputs);
        for (port, wire) in wires.filter_map(|(port, wire)| Some((port, (*wire)?))) {
            let from = &steps[wire.step];
            let info = from.node_type.info;
            let output = &info.outputs[wire.output];
            let there = |needed: &str| {
                let at = info.inputs.iter().position(|input| input.name == needed);
                at.is_some_and(|at| from.inputs[at].is_some())
            };
            let Some(needed) = output.needs.filter(|needed| !there(needed)) else { continue };
            let pointer = child(&child(&child("/nodes", &step.name), "inputs"), port.name);
            let (name, kind) = (&from.name, info.name);
            let message = format!("\"{name}\" ({kind}) gives no {} without its input \"{needed}\"", output.name);
            let help = format!("connect {needed} of \"{name}\"");
            problems.push(document.source().problem(&pointer, Part::Value, message, help));
        }
    }
    problems
}

/// `, at [1].radius` for the pointer `/1/radius`; nothing for the whole parameter.
fn inside(pointer: &str) -> String {
    let mut path = String::new();
    for name in pointer.split('/').skip(1) {
        match name.parse::<usize>() {
            Ok(index) => path += &format!("[{index}]"),
            Err(_) if path.is_empty() => path += name,
            Err(_) => path += &format!(".{name}"),
        }
    }
    if path.is_empty() { path } else { format!(", at {path}") }
}
