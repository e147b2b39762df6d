//! Keys: what each value of a plan is called at a frame, found without computing any of them.
//!
//! A node's own part is its type and version, the sources that the program was built from, its parameters at the
//! frame, the content of its files, and the frame if it depends on it. To that come the keys of its inputs, of each
//! only the facets that the port reads. Device and number of threads do not enter.

use super::files::FileHashes;
use crate::Result;
use crate::graph::{Plan, Ready, Step};
use crate::node::{Facet, FacetRule, Key, Port};
use crate::params::AnyNode;
use std::sync::Arc;

/// A hash of all code that results depend on (see build.rs).
pub(super) const SOURCES: &str = env!("CHIARO_SOURCES");

/// One node at one frame, ready to run.
pub struct Keyed {
    pub node: Arc<dyn AnyNode>,
    /// Names what a run of the node computes.
    pub key: Key,
    /// The input (index of its port) whose value is this node's, unchanged.
    pub passes: Option<usize>,
    /// Per output the key of each facet.
    pub outputs: Vec<[Key; 4]>,
    /// What the node is told of the frame: 0 unless it depends on it.
    pub frame: f64,
}

/// Keys of the targets and of all that they could need; `None` for other steps.
///
/// # Errors
/// `File` when an input file cannot be read, `Compute` when parameters do not go together at this frame.
pub fn keys(plan: &Plan, targets: &[usize], frame: f64, files: &FileHashes) -> Result<Vec<Option<Keyed>>> {
    let mut reached = vec![false; plan.steps.len()];
    targets.iter().for_each(|target| reached[*target] = true);
    for (index, step) in plan.steps.iter().enumerate().rev() {
        if reached[index] {
            step.inputs.iter().flatten().for_each(|wire| reached[wire.step] = true);
        }
    }
    let mut keyed: Vec<Option<Keyed>> = Vec::new();
    for (step, reached) in plan.steps.iter().zip(reached) {
        let inputs: Vec<Option<[Key; 4]>> = step
            .inputs
            .iter()
            .map(|wire| {
                let wire = wire.filter(|_| reached)?;
                Some(keyed[wire.step].as_ref().expect("sources come first").outputs[wire.output])
            })
            .collect();
        let next = reached.then(|| key_step(plan, step, &inputs, frame, files)).transpose();
        keyed.push(next.map_err(|error| error.at_node(&step.name, step.node_type.info.name))?);
    }
    Ok(keyed)
}

fn key_step(plan: &Plan, step: &Step, inputs: &[Option<[Key; 4]>], frame: f64, files: &FileHashes) -> Result<Keyed> {
    let Ready { node, digest } = step.node(frame)?;
    let info = step.node_type.info;
    let port = |name: &str| {
        info.inputs
            .iter()
            .position(|port| port.name == name)
            .unwrap_or_else(|| panic!("node type {} declares no input {name}", info.name))
    };
    let content = files.of_node(&*node, &plan.base, frame)?;
    let frame = if node.uses_frame(&plan.base) { frame } else { 0.0 };
    let own = Key::of(&[
        info.name.as_bytes(),
        &info.version.to_le_bytes(),
        SOURCES.as_bytes(),
        &digest.0,
        &content.0,
        &frame.to_le_bytes(),
    ]);
    let input = |index: usize, facets: &[Facet]| match &inputs[index] {
        None => Key::of(&[b"not connected"]),
        Some(keys) => {
            let parts: Vec<&[u8]> = facets.iter().map(|facet| &keys[*facet as usize].0[..]).collect();
            Key::of(&parts)
        }
    };
    // What is handed through untouched is part of the value, even if the node never looks at it.
    let kept = |port: &Port, facet: &Facet| {
        info.facets
            .iter()
            .any(|rule| matches!(rule, FacetRule::Keeps(kept, from) if kept == facet && *from == port.name))
    };
    let read: Vec<Key> = info
        .inputs
        .iter()
        .enumerate()
        .map(|(index, port)| {
            let reads = |facet: &Facet| port.reads.contains(facet) || kept(port, facet);
            input(index, &Facet::ALL.into_iter().filter(reads).collect::<Vec<_>>())
        })
        .collect();
    let key = join(b"run", own, &read);
    let passes = node.pass_through().map(port).filter(|index| inputs[*index].is_some());
    let outputs = match passes.and_then(|index| inputs[index]) {
        Some(keys) => vec![keys; info.outputs.len()],
        None => (0..info.outputs.len())
            .map(|output| {
                let whole = join(&[b'o', output as u8], key, &[]);
                Facet::ALL.map(|facet| {
                    let rule = info.facets.iter().find(|rule| match rule {
                        FacetRule::Keeps(ruled, _) | FacetRule::From(ruled, _) => *ruled == facet,
                    });
                    match rule {
                        Some(FacetRule::Keeps(_, from)) => {
                            inputs[port(from)].map_or(whole, |keys| keys[facet as usize])
                        }
                        Some(FacetRule::From(_, from)) => {
                            let parts: Vec<Key> = from.iter().map(|(name, facets)| input(port(name), facets)).collect();
                            join(&[b'f', output as u8, facet as u8], own, &parts)
                        }
                        None => whole,
                    }
                })
            })
            .collect(),
    };
    Ok(Keyed { node, key, passes, outputs, frame })
}

fn join(label: &[u8], own: Key, others: &[Key]) -> Key {
    let mut parts: Vec<&[u8]> = vec![label, &own.0];
    parts.extend(others.iter().map(|key| &key.0[..]));
    Key::of(&parts)
}
