//! Time: what moves in files, what stays the same from frame to frame, and edits that are keyed.

#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/glb.rs"]
mod glb;
#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/node.rs"]
mod node;
mod support;

#[path = "animation/keyframes.rs"]
mod keyframes;
#[path = "animation/reuse.rs"]
mod reuse;
#[path = "animation/scenes.rs"]
mod scenes;
#[path = "animation/stability.rs"]
mod stability;
#[path = "animation/strokes.rs"]
mod strokes;
#[path = "animation/surfaces.rs"]
mod surfaces;

use chiaro::device::Device;
use chiaro::eval::{Context, Evaluator, NodeReport, Options};
use chiaro::graph::{Document, Plan};
use chiaro::image::Image;
use chiaro::nodes;
use chiaro::value::Value;
use glb::Glb;
use serde_json::{Value as Json, json};
use std::sync::atomic::AtomicBool;

/// A folder with one file, and recipes over it.
pub struct Stage {
    folder: tempfile::TempDir,
    pub evaluator: Evaluator,
}

impl Stage {
    pub fn new(glb: &Glb) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("room.glb"), glb.bytes()).unwrap();
        Self { folder, evaluator: Evaluator::new(Options::new(Device::Cpu)) }
    }

    pub fn plan(&self, nodes: Json) -> Plan {
        let text = json!({ "chiaro": 1, "frames": [1, 24], "nodes": nodes }).to_string();
        let document = Document::parse(&self.folder.path().join("test.json"), &text).unwrap_or_else(|e| panic!("{e}"));
        Plan::new(&document, nodes::ALL).unwrap_or_else(|error| panic!("{error}"))
    }

    pub fn run(&self, plan: &Plan, node: &str, frame: i64) -> chiaro::Result<(Value, Vec<NodeReport>)> {
        let (never, mut report) = (AtomicBool::new(false), Vec::new());
        let context = Context { cancel: &never, ..Context::SILENT };
        let target = plan.find(node).unwrap_or_else(|| panic!("no node {node}"));
        let mut values = self.evaluator.evaluate(plan, &[target], frame, &context, &mut report)?;
        Ok((values.swap_remove(0).swap_remove(0), report))
    }

    pub fn value(&self, plan: &Plan, node: &str, frame: i64) -> Value {
        self.run(plan, node, frame).unwrap_or_else(|error| panic!("{node}, frame {frame}: {error}")).0
    }
}
