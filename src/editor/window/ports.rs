//! Ports as they are drawn; of a node of an unknown type as far as the recipe tells.

use super::state::State;
use crate::editor::look::Output;
use crate::value::Kind;

#[derive(Clone, Debug, PartialEq)]
pub struct PortView {
    pub name: String,
    pub kind: Option<Kind>,
    pub optional: bool,
    pub doc: &'static str,
}

impl PortView {
    fn of(port: &crate::node::Port) -> Self {
        Self { name: port.name.to_owned(), kind: Some(port.kind), optional: port.optional, doc: port.doc }
    }

    fn unknown(name: &str) -> Self {
        Self { name: name.to_owned(), kind: None, optional: true, doc: "" }
    }
}

impl State {
    pub fn inputs(&self, node: &str) -> Vec<PortView> {
        match self.session.info(node) {
            Some(info) => info.inputs.iter().map(PortView::of).collect(),
            None => {
                let named = self.entry(node).into_iter().flat_map(|entry| entry.inputs.keys());
                named.map(|name| PortView::unknown(name)).collect()
            }
        }
    }

    pub fn outputs(&self, node: &str) -> Vec<PortView> {
        match self.session.info(node) {
            Some(info) => info.outputs.iter().map(PortView::of).collect(),
            None => {
                let wires = self.document().nodes.values().flat_map(|entry| entry.inputs.values());
                let mut ports: Vec<&str> = wires
                    .map(|from| crate::graph::split(from))
                    .filter(|(from, _)| *from == node)
                    .map(|(_, port)| port.unwrap_or(""))
                    .collect();
                ports.sort_unstable();
                ports.dedup();
                ports.into_iter().map(PortView::unknown).collect()
            }
        }
    }

    /// The number of the output that `"node"` or `"node.port"` names.
    pub fn output_number(&self, from: &str) -> Option<Output> {
        let (node, port) = crate::graph::split(from);
        let outputs = self.outputs(node);
        let number = match port {
            Some(port) => outputs.iter().position(|output| output.name == port)?,
            None => 0,
        };
        (number < outputs.len()).then(|| (node.to_owned(), number))
    }

    /// As it is written in a recipe: without the port where it is the first.
    pub fn output_text(&self, (node, number): &Output) -> String {
        match self.outputs(node).get(*number) {
            Some(port) if *number > 0 => format!("{node}.{}", port.name),
            _ => node.clone(),
        }
    }
}
