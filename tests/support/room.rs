//! Small recipes in the built-in room, evaluated in this process.

use chiaro::device::Device;
use chiaro::eval::keys::{Task, tasks};
use chiaro::eval::{Context, Evaluator, NodeReport, Options, files::FileHashes};
use chiaro::graph::{Document, Plan};
use chiaro::image::Image;
use chiaro::node::NoMemo;
use chiaro::nodes;
use chiaro::value::Value;
use serde_json::{Value as Json, json};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// All objects of the room.
pub const OBJECTS: [&str; 9] =
    ["floor", "ceiling", "back_wall", "left_wall", "right_wall", "block", "pedestal", "ball", "panel"];

/// A recipe of `room`, `view` (48 x 36), `transport` and what is given; nodes of the same name are replaced.
pub fn recipe(nodes: Json) -> Plan {
    let mut all = json!({
        "room": { "type": "scene", "params": { "file": "builtin:room" } },
        "view": { "type": "view_samples", "params": { "width": 48, "height": 36 }, "inputs": { "scene": "room" } },
        "transport": {
            "type": "transfer", "params": { "gather_samples": 2048, "tolerance": 0.1 },
            "inputs": { "scene": "room", "samples": "view" },
        },
    });
    for (name, node) in nodes.as_object().expect("nodes by name") {
        all[name] = node.clone();
    }
    let text = json!({ "chiaro": 1, "nodes": all }).to_string();
    let document = Document::parse(Path::new("test.json"), &text).unwrap_or_else(|error| panic!("{error}"));
    Plan::new(&document, nodes::ALL).unwrap_or_else(|error| panic!("{error}"))
}

/// A `relight` of the room, with edits of that node if any.
pub fn relight(edits: Option<&str>) -> Json {
    let mut node = json!({ "type": "relight", "inputs": { "scene": "room", "transfer": "transport" } });
    if let Some(edits) = edits {
        node["inputs"]["edits"] = edits.into();
    }
    node
}

pub fn pick(objects: &[&str]) -> Json {
    json!({ "type": "pick", "params": { "objects": objects }, "inputs": { "scene": "room" } })
}

/// A `caster_receiver`; `inputs` as in a recipe.
pub fn edit(params: Json, inputs: Json) -> Json {
    json!({ "type": "caster_receiver", "params": params, "inputs": inputs })
}

pub fn evaluator() -> Evaluator {
    Evaluator::new(Options::new(Device::Cpu))
}

pub fn evaluate(evaluator: &Evaluator, plan: &Plan, node: &str, frame: i64) -> (Value, Vec<NodeReport>) {
    let never = AtomicBool::new(false);
    let context = Context { cancel: &never, ..Context::SILENT };
    let (target, mut report) = (plan.find(node).unwrap_or_else(|| panic!("no node {node}")), Vec::new());
    let values = evaluator.evaluate(plan, &[target], frame, &context, &mut report);
    let mut values = values.unwrap_or_else(|error| panic!("{error}")).swap_remove(0);
    (values.swap_remove(0), report)
}

pub fn image(evaluator: &Evaluator, plan: &Plan, node: &str) -> Arc<Image> {
    match evaluate(evaluator, plan, node, 1).0 {
        Value::Image(image) => image,
        other => panic!("{node} gives {:?}", other.kind()),
    }
}

/// The numbers of a layer; `indirect` and the like, the beauty by an empty name.
pub fn layer(image: &Image, name: &str) -> Vec<f32> {
    image.layer(name).unwrap_or_else(|| panic!("no layer {name}")).data.to_vec()
}

pub fn keyed(plan: &Plan, node: &str, frame: i64) -> Task {
    let target = plan.find(node).unwrap_or_else(|| panic!("no node {node}"));
    tasks(plan, &[target], frame, &FileHashes::default(), &NoMemo).unwrap().list.pop().unwrap()
}

/// Every bit of every layer.
pub fn bits(image: &Image) -> Vec<(String, Vec<u32>)> {
    let bits = |data: &[f32]| data.iter().map(|x| x.to_bits()).collect();
    image.layers.iter().map(|layer| (layer.name.clone(), bits(&layer.data))).collect()
}

/// Fails where `|a - b| > absolute + relative |b|`, or either is not finite.
#[track_caller]
pub fn close(a: &[f32], b: &[f32], absolute: f32, relative: f32) {
    assert_eq!(a.len(), b.len());
    let off = |(a, b): (&f32, &f32)| !a.is_finite() || !b.is_finite() || (a - b).abs() > absolute + relative * b.abs();
    if let Some(at) = a.iter().zip(b).position(off) {
        let count = a.iter().zip(b).filter(|pair| off(*pair)).count();
        panic!("{count} of {} values are off; value {at} is {:e}, expected {:e}", a.len(), a[at], b[at]);
    }
}

/// Root mean square of `a - b` over that of `b`.
pub fn relative_rms(a: &[f32], b: &[f32]) -> f64 {
    let squares = |values: &mut dyn Iterator<Item = f32>| values.map(|x| f64::from(x) * f64::from(x)).sum::<f64>();
    (squares(&mut a.iter().zip(b).map(|(a, b)| a - b)) / squares(&mut b.iter().copied())).sqrt()
}
