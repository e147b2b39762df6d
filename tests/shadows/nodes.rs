//! The nodes `visibility`, `transport` and `integrate` in a graph.

use chiaro::device::Device;
use chiaro::eval::{Context, Evaluator, NodeReport, Options};
use chiaro::graph::{Document, Plan};
use chiaro::nodes;
use chiaro::progress::Sink;
use chiaro::value::Value;
use serde_json::{Value as Json, json};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

/// Which shadows were drawn.
#[derive(Default)]
struct Drawn(Mutex<Vec<String>>);

impl Sink for Drawn {
    fn begin(&self, _: &str, stage: &str, _: u64) -> u64 {
        self.0.lock().unwrap().extend(stage.strip_prefix("shadows of ").map(str::to_owned));
        0
    }
    fn advance(&self, _: u64, _: u64) {}
    fn end(&self, _: u64) {}
}

fn evaluate(evaluator: &Evaluator, visibility: Json, sky: Json) -> (Vec<String>, Vec<f32>, Vec<NodeReport>) {
    run(evaluator, visibility, sky).unwrap_or_else(|error| panic!("{error}"))
}

fn run(evaluator: &Evaluator, visibility: Json, sky: Json) -> chiaro::Result<(Vec<String>, Vec<f32>, Vec<NodeReport>)> {
    let text = json!({ "chiaro": 1, "nodes": {
        "hall": { "type": "scene", "params": { "file": "builtin:hall" } },
        "view": { "type": "view_samples", "params": { "width": 24, "height": 18 }, "inputs": { "scene": "hall" } },
        "sky": { "type": "environment", "params": sky },
        "seen": { "type": "visibility", "params": visibility,
            "inputs": { "scene": "hall", "samples": "view", "environment": "sky" } },
        "light": { "type": "transport", "inputs": { "scene": "hall", "samples": "view", "environment": "sky" } },
        "lit": { "type": "integrate", "inputs": { "visibility": "seen", "transport": "light", "samples": "view" } },
    } });
    let document = Document::parse(Path::new("test.json"), &text.to_string()).unwrap();
    let plan = Plan::new(&document, nodes::ALL).unwrap();
    let (never, drawn) = (AtomicBool::new(false), Drawn::default());
    let context = Context { out: None, sink: &drawn, cancel: &never, ..Context::SILENT };
    let mut report = Vec::new();
    let mut values = evaluator.evaluate(&plan, &[plan.find("lit").unwrap()], 1, &context, &mut report)?;
    let Value::Image(image) = values.remove(0).remove(0) else { panic!("no image") };
    Ok((drawn.0.into_inner().unwrap(), image.find("direct").unwrap().data.to_vec(), report))
}

fn sky() -> Json {
    json!({ "file": "builtin:lamps", "face_size": 32 })
}

#[test]
fn a_changed_group_draws_only_what_is_new() {
    let evaluator = Evaluator::new(Options::new(Device::Cpu));
    let groups = |groups: Json| json!({ "face_size": 32, "groups": groups });
    let (first, light, report) = evaluate(&evaluator, groups(json!({ "urn": ["urn"] })), sky());
    assert_eq!(first.len(), 12, "{first:?}");
    assert!(first[..6].iter().all(|name| name.starts_with("urn, ")) && first[6] == "rest, right", "{first:?}");
    let seen = &report.iter().find(|node| node.node == "seen").unwrap().notes;
    assert_eq!((&seen["groups"], seen["faces"].as_array().unwrap().len()), (&json!(2), 6), "{seen:?}");
    assert!(seen["toggles_per_row"].as_f64().unwrap() > 1.0 && seen["texels_with_energy"] == 6 * 1024, "{seen:?}");
    // Another name for the same objects is nothing new; another group changes the rest.
    let (second, again, _) = evaluate(&evaluator, groups(json!({ "vase": ["ur*"], "ball": ["ball"] })), sky());
    assert!(second.len() == 12 && second[0] == "ball, right" && second[6] == "rest, right", "{second:?}");
    assert_eq!(light, again, "groups together are all objects");
    // A brighter sky leaves visibility as it is.
    let brighter = json!({ "file": "builtin:lamps", "face_size": 32, "exposure": 1.0 });
    let (third, double, _) = evaluate(&evaluator, groups(json!({ "urn": ["urn"] })), brighter);
    assert!(third.is_empty(), "{third:?}");
    assert!(light.iter().zip(&double).all(|(a, b)| (2.0 * a - b).abs() <= 1e-6 * (1.0 + b)));
    // From a face that was not asked for, light comes without shadows.
    let params = json!({ "face_size": 32, "faces": ["front", "top"], "groups": { "urn": ["urn"] } });
    let (fourth, some, report) = evaluate(&evaluator, params, sky());
    assert!(fourth.is_empty(), "{fourth:?}");
    assert!(light.iter().zip(&some).all(|(all, some)| some >= all) && some != light);
    let lit = &report.iter().find(|node| node.node == "lit").unwrap().notes;
    assert_eq!(lit["faces_without_shadows"], json!(["right", "left", "bottom", "back"]));
}

#[test]
fn parameters_that_do_not_fit_are_explained() {
    let evaluator = Evaluator::new(Options::new(Device::Cpu));
    for (params, message, help) in [
        (json!({ "face_size": 64 }), "face_size is 64, the environment's faces have 32 x 32", "same number"),
        (json!({ "face_size": 32, "faces": ["tpo"] }), "no cube face \"tpo\"", "\"top\""),
        (json!({ "face_size": 32, "groups": { "a": ["ball_"] } }), "\"ball_\"", "\"ball\""),
        (json!({ "face_size": 32, "groups": { "a": ["ball"], "b": ["b*"] } }), "\"a\" and \"b\"", "one group"),
    ] {
        let error = run(&evaluator, params, sky()).err().unwrap();
        assert!(error.to_string().contains(message) && error.help().contains(help), "{error}: {}", error.help());
    }
}
