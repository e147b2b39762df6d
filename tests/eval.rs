//! What is computed, what is found, and what everything is called: on nodes whose results can be checked by hand.

mod trial_nodes;

use chiaro::device::Device;
use chiaro::eval::files::FileHashes;
use chiaro::eval::keys::{Task, tasks};
use chiaro::eval::{CacheUse, Context, Disk, Evaluator, NodeReport, Options};
use chiaro::graph::{Document, Plan};
use chiaro::node::{Key, NoMemo};
use chiaro::value::Value;
use serde_json::{Value as Json, json};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use trial_nodes::{NODES, values};

fn plan_in(folder: &Path, nodes: Json) -> Plan {
    let text = json!({ "chiaro": 1, "nodes": nodes }).to_string();
    Plan::new(&Document::parse(&folder.join("test.json"), &text).unwrap(), NODES).unwrap_or_else(|e| panic!("{e}"))
}

fn plan(nodes: Json) -> Plan {
    plan_in(Path::new("."), nodes)
}

fn evaluator() -> Evaluator {
    Evaluator::new(Options::new(Device::Cpu))
}

fn on_disk(folder: &Path) -> Evaluator {
    let disk = Some(Disk::open(folder, 1 << 20).unwrap());
    Evaluator::new(Options { disk, ..Options::new(Device::Cpu) })
}

static NEVER: AtomicBool = AtomicBool::new(false);
const CONTEXT: Context = Context { cancel: &NEVER, ..Context::SILENT };

/// Evaluates one node and says what happened to each: `name use`, sorted.
fn evaluate(evaluator: &Evaluator, plan: &Plan, node: &str, frame: i64) -> (Vec<Value>, Vec<String>) {
    let mut report: Vec<NodeReport> = Vec::new();
    let target = plan.find(node).unwrap();
    let values = evaluator.evaluate(plan, &[target], frame, &CONTEXT, &mut report).unwrap_or_else(|e| panic!("{e}"));
    let told = |node: &NodeReport| {
        let word = match node.cache {
            CacheUse::Memory => "memory",
            CacheUse::Disk => "disk",
            CacheUse::Computed => "computed",
            CacheUse::Pass => "pass",
        };
        format!("{} {word}", node.node)
    };
    let mut happened: Vec<String> = report.iter().map(told).collect();
    happened.sort();
    (values.into_iter().next().unwrap(), happened)
}

fn keyed(plan: &Plan, node: &str, frame: i64) -> Task {
    let target = plan.find(node).unwrap();
    tasks(plan, &[target], frame, &FileHashes::default(), &NoMemo).unwrap().list.pop().unwrap()
}

fn key(plan: &Plan, node: &str, frame: i64) -> Key {
    keyed(plan, node, frame).key
}

#[test]
fn values_flow_along_wires() {
    let plan = plan(json!({
        "sum": { "type": "add", "inputs": { "a": "parts.high", "b": "parts" } },
        "parts": { "type": "split", "params": { "at": 2.0 }, "inputs": { "image": "more" } },
        "more": { "type": "gain", "params": { "amount": 3.0 }, "inputs": { "image": "base" } },
        "base": { "type": "flat", "params": { "width": 2, "value": 1.5, "mode": "striped" } },
    }));
    // 1.5 0 -> 4.5 0 -> low 2 0, high 2.5 0 -> high + low of the first pixel.
    assert_eq!(values(&evaluate(&evaluator(), &plan, "sum", 1).0[0]), [4.5, 2.0]);
}

#[test]
fn only_what_is_asked_for_is_computed_and_only_once() {
    let plan = plan(json!({
        "base": { "type": "flat" },
        "left": { "type": "gain", "params": { "amount": 2 }, "inputs": { "image": "base" } },
        "right": { "type": "gain", "params": { "amount": 3 }, "inputs": { "image": "base" } },
        "sum": { "type": "add", "inputs": { "a": "left", "b": "right" } },
    }));
    let evaluator = evaluator();
    assert_eq!(evaluate(&evaluator, &plan, "left", 1).1, ["base computed", "left computed"]);
    assert_eq!(
        evaluate(&evaluator, &plan, "sum", 1).1,
        ["base memory", "left memory", "right computed", "sum computed"]
    );
    assert_eq!(
        evaluate(&evaluator, &plan, "sum", 2).1,
        ["sum memory"],
        "the inputs of what is found are not looked at"
    );
}

#[test]
fn a_pass_through_is_its_input_and_has_its_key() {
    let plan = plan(json!({
        "base": { "type": "flat" },
        "same": { "type": "gain", "params": { "amount": 1 }, "inputs": { "image": "base" } },
        "twice": { "type": "gain", "params": { "amount": 2 }, "inputs": { "image": "same" } },
        "direct": { "type": "gain", "params": { "amount": 2 }, "inputs": { "image": "base" } },
    }));
    let evaluator = evaluator();
    let (same, happened) = evaluate(&evaluator, &plan, "same", 1);
    assert_eq!(happened, ["base computed", "same pass"]);
    let (base, _) = evaluate(&evaluator, &plan, "base", 1);
    let (Value::Image(same), Value::Image(base)) = (&same[0], &base[0]) else { panic!("pictures") };
    assert!(std::sync::Arc::ptr_eq(same, base));
    assert_eq!(keyed(&plan, "same", 1).outputs, keyed(&plan, "base", 1).outputs);
    assert_eq!(key(&plan, "twice", 1), key(&plan, "direct", 1));
    evaluate(&evaluator, &plan, "twice", 1);
    assert_eq!(evaluate(&evaluator, &plan, "direct", 1).1, ["direct memory"]);
}

#[test]
fn each_parameter_changes_exactly_its_own_key() {
    let nodes = |flat: Json| {
        plan(json!({
            "other": { "type": "flat" },
            "base": { "type": "flat", "params": flat },
            "more": { "type": "gain", "params": { "amount": 2 }, "inputs": { "image": "base" } },
        }))
    };
    let all = |plan: &Plan| ["other", "base", "more"].map(|node| key(plan, node, 1));
    let [other, base, more] = all(&nodes(json!({})));
    let defaults = json!({ "width": 4, "value": 1.0, "mode": "plain", "label": "" });
    assert_eq!(all(&nodes(defaults)), [other, base, more], "a default that is written out is the default");
    let mut seen = vec![base];
    for change in [
        json!({ "width": 5 }),
        json!({ "value": 2 }),
        json!({ "scale": 2 }),
        json!({ "tint": [1, 1, 2] }),
        json!({ "mode": "striped" }),
        json!({ "label": "1" }),
        json!({ "dots": [{ "radius": 1 }] }),
        json!({ "limit": 0 }),
        json!({ "groups": { "a": [] } }),
    ] {
        let [other_now, base_now, more_now] = all(&nodes(change.clone()));
        assert_eq!(other_now, other, "{change}");
        assert!(!seen.contains(&base_now) && more_now != more, "{change}");
        seen.push(base_now);
    }
}

#[test]
fn a_node_may_ask_for_other_frames_and_each_is_computed_once() {
    let plan = plan(json!({
        "time": { "type": "clock" },
        "held": { "type": "flat", "params": { "value": { "keys": [[2, 0.5], [4, 0.75]], "interpolation": "hold" } } },
        "sum": { "type": "add", "inputs": { "a": "time", "b": "held" } },
        "echo": { "type": "echo", "params": { "frames": [3, -2, 4] }, "inputs": { "image": "sum" } },
        "twice": { "type": "echo", "params": { "frames": [2] }, "inputs": { "image": "echo" } },
    }));
    let sums = |frames: &[i64]| frames.iter().map(|&f| f as f32 + if f < 4 { 0.5 } else { 0.75 }).collect::<Vec<_>>();
    let evaluator = evaluator();
    let (found, happened) = evaluate(&evaluator, &plan, "echo", 7);
    assert_eq!(values(&found[0]), sums(&[7, 3, -2, 4]));
    let count = |name: &str| happened.iter().filter(|line| line.starts_with(name)).count();
    assert_eq!(["time", "held", "sum", "echo"].map(count), [4, 2, 4, 1], "{happened:?}");
    // One of the frames is that of the picture: a port named twice.
    let (found, happened) = evaluate(&evaluator, &plan, "echo", 3);
    assert_eq!(values(&found[0]), sums(&[3, 3, -2, 4]));
    assert_eq!(happened, ["echo computed", "sum memory", "sum memory", "sum memory"]);
    // Frames of frames.
    let (found, _) = evaluate(&evaluator, &plan, "twice", 7);
    assert_eq!(values(&found[0]), sums(&[7, 3, -2, 4, 2, 3, -2, 4]));
    assert_ne!(key(&plan, "echo", 3), key(&plan, "echo", 5));
    assert_ne!(key(&plan, "echo", 3), key(&plan, "sum", 3));
}

#[test]
fn frames_with_equal_values_share_a_key() {
    let plan = plan(json!({
        "moving": { "type": "flat", "params": { "value": { "keys": [[2, 0.5], [4, 1.0], [6, 0.5]] } } },
        "clock": { "type": "clock" },
        "stopped": { "type": "clock", "params": { "stopped": true } },
    }));
    let moving = |frame| key(&plan, "moving", frame);
    assert_eq!([1, 3, 4].map(moving), [7, 5, 4].map(moving));
    assert_ne!(moving(3), moving(4));
    assert_ne!(key(&plan, "clock", 1), key(&plan, "clock", 2));
    assert_eq!(key(&plan, "stopped", 1), key(&plan, "stopped", 2));
    let evaluator = evaluator();
    assert_eq!(values(&evaluate(&evaluator, &plan, "clock", 5).0[0]), [5.0]);
    assert_eq!(
        values(&evaluate(&evaluator, &plan, "stopped", 5).0[0]),
        [0.0],
        "what does not depend on it is not told"
    );
}

#[test]
fn moving_a_lamp_changes_only_what_reads_lights() {
    let nodes = |power: f32, file: &str| {
        plan(json!({
            "stage": { "type": "stage", "params": { "file": file } },
            "lamp": { "type": "lamp", "params": { "power": power }, "inputs": { "scene": "stage" } },
            "fill": { "type": "lamp", "params": { "power": 0.5 }, "inputs": { "scene": "lamp" } },
            "outline": { "type": "outline", "inputs": { "scene": "fill" } },
            "shade": { "type": "shade", "inputs": { "scene": "fill" } },
        }))
    };
    let (before, after) = (nodes(1.0, "a"), nodes(2.0, "a"));
    assert_eq!(key(&before, "outline", 1), key(&after, "outline", 1));
    assert_ne!(key(&before, "shade", 1), key(&after, "shade", 1));
    let moved = nodes(1.0, "b");
    assert_ne!(key(&before, "outline", 1), key(&moved, "outline", 1));
    assert_ne!(key(&before, "lamp", 1), key(&moved, "lamp", 1), "it hands the triangles on, so they are in its value");
    let evaluator = evaluator();
    evaluate(&evaluator, &before, "outline", 1);
    assert_eq!(values(&evaluate(&evaluator, &before, "shade", 1).0[0]), [1.5]);
    assert_eq!(evaluate(&evaluator, &after, "outline", 1).1, ["outline memory"]);
    assert_eq!(values(&evaluate(&evaluator, &after, "shade", 1).0[0]), [2.5]);
}

#[test]
fn files_enter_by_content_and_builtins_are_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let read =
        |file: &str| plan_in(folder.path(), json!({ "a": { "type": "read_number", "params": { "file": file } } }));
    write("number.txt", "1");
    let plan = read("number.txt");
    let evaluator = evaluator();
    assert_eq!(values(&evaluate(&evaluator, &plan, "a", 1).0[0]), [1.0]);
    assert_eq!(evaluate(&evaluator, &plan, "a", 1).1, ["a memory"]);
    write("number.txt", "22");
    assert_eq!(values(&evaluate(&evaluator, &plan, "a", 1).0[0]), [22.0]);
    write("number.txt", "1");
    assert_eq!(evaluate(&evaluator, &plan, "a", 1).1, ["a memory"], "back to content that is known");
    assert_eq!(values(&evaluate(&evaluator, &read("builtin:seven"), "a", 1).0[0]), [7.0]);
    let missing = read("none.txt");
    let error = evaluator.evaluate(&missing, &[0], 1, &CONTEXT, &mut Vec::new()).unwrap_err();
    assert_eq!(error.exit_code(), 3);
    assert!(error.to_string().contains("none.txt") && error.to_string().contains("node \"a\""), "{error}");
}

#[test]
fn what_is_stored_is_found_by_another_process() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(json!({
        "base": { "type": "flat", "params": { "value": 0.1 } },
        "more": { "type": "gain", "params": { "amount": 2 }, "inputs": { "image": "base" } },
    }));
    let (first, happened) = evaluate(&on_disk(folder.path()), &plan, "more", 1);
    assert_eq!(happened, ["base computed", "more computed"]);
    let again = on_disk(folder.path());
    let (second, happened) = evaluate(&again, &plan, "more", 1);
    assert_eq!(happened, ["base disk", "more computed"], "gain is not worth storing");
    assert_eq!(values(&first[0]), values(&second[0]));
    let mut report = Vec::new();
    again.evaluate(&plan, &[plan.find("base").unwrap()], 1, &CONTEXT, &mut report).unwrap();
    assert_eq!(Json::from(report[0].notes.clone()), json!({ "pixels": 4 }), "notes are kept with the value");
}

#[test]
fn a_damaged_entry_is_computed_again_and_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(json!({ "base": { "type": "flat", "params": { "width": 1000 } } }));
    let (good, _) = evaluate(&on_disk(folder.path()), &plan, "base", 1);
    let entry = Disk::open(folder.path(), 1 << 20).unwrap().path(key(&plan, "base", 1));
    let mut bytes = std::fs::read(&entry).unwrap();
    for damage in 0..2 {
        match damage {
            0 => bytes[2000] ^= 1,
            _ => bytes.truncate(3000),
        }
        std::fs::write(&entry, &bytes).unwrap();
        let (values_now, happened) = evaluate(&on_disk(folder.path()), &plan, "base", 1);
        assert_eq!(happened, ["base computed"]);
        assert_eq!(values(&values_now[0]), values(&good[0]));
        assert_eq!(evaluate(&on_disk(folder.path()), &plan, "base", 1).1, ["base disk"], "replaced");
    }
}

/// Entries of one key that hold what another node computes: only the checked mode can notice.
#[test]
fn the_checked_mode_notices_a_wrong_entry() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(json!({ "base": { "type": "flat" } }));
    let key = key(&plan, "base", 1);
    evaluate(&on_disk(folder.path()), &plan, "base", 1);
    let checked = || {
        let disk = Some(Disk::open(folder.path(), 1 << 20).unwrap());
        Evaluator::new(Options { disk, verify: true, ..Options::new(Device::Cpu) })
    };
    assert_eq!(evaluate(&checked(), &plan, "base", 1).1, ["base computed", "base disk"]);
    let layer = chiaro::image::Layer {
        name: String::new(),
        channels: vec!["Z".into()],
        content: chiaro::image::Content::Data,
        data: vec![9.0f32; 4].into(),
    };
    let wrong = chiaro::image::Image { width: 4, height: 1, layers: vec![layer], ..Default::default() };
    let wrong = Value::Image(std::sync::Arc::new(wrong));
    let mut sections = chiaro::stored::SectionWriter::default();
    sections.value(&json!({}));
    wrong.write(&mut sections);
    Disk::open(folder.path(), 1 << 20).unwrap().put(key, &sections).unwrap();
    assert_eq!(values(&evaluate(&on_disk(folder.path()), &plan, "base", 1).0[0]), [9.0; 4], "believed otherwise");
    let error = checked().evaluate(&plan, &[0], 1, &CONTEXT, &mut Vec::new()).unwrap_err();
    assert!(error.to_string().contains("not what is computed"), "{error}");
}

/// Whether the one `keeper` of a plan had to compute; and its value.
fn keeper(evaluator: &Evaluator, params: Json) -> (bool, f32) {
    let plan = plan(json!({ "keeper": { "type": "keeper", "params": params } }));
    let mut report: Vec<NodeReport> = Vec::new();
    let found = evaluator.evaluate(&plan, &[0], 1, &CONTEXT, &mut report).unwrap_or_else(|e| panic!("{e}"));
    (report[0].notes.contains_key("computed"), values(&found[0][0])[0])
}

#[test]
fn what_a_node_keeps_outlives_the_evaluator() {
    let folder = tempfile::tempdir().unwrap();
    let (first, named) = (on_disk(folder.path()), |label: &str| json!({ "value": 2, "label": label }));
    assert_eq!(keeper(&first, named("a")), (true, 2.0));
    assert_eq!(keeper(&first, named("b")), (false, 2.0), "from memory");
    assert_eq!(keeper(&on_disk(folder.path()), named("c")), (false, 2.0), "from disk");
    assert_eq!(keeper(&on_disk(folder.path()), json!({ "value": 3 })), (true, 3.0), "another key");
    assert_eq!(keeper(&evaluator(), named("d")), (true, 2.0), "no disk");
}

#[test]
fn what_a_node_keeps_is_computed_again_when_it_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    keeper(&on_disk(folder.path()), json!({}));
    let entries: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    let [entry] = &entries[..] else { panic!("{entries:?}") };
    let good = std::fs::read(entry).unwrap();
    let (mut flipped, cut) = (good.clone(), good[..good.len() / 2].to_vec());
    flipped[good.len() - 100] ^= 1;
    for bytes in [flipped, cut] {
        std::fs::write(entry, &bytes).unwrap();
        assert_eq!(keeper(&on_disk(folder.path()), json!({})), (true, 1.0));
        assert!(std::fs::read(entry).unwrap() == good, "replaced");
        assert_eq!(keeper(&on_disk(folder.path()), json!({})), (false, 1.0));
    }
}

#[test]
fn the_checked_mode_compares_what_nodes_keep() {
    let folder = tempfile::tempdir().unwrap();
    keeper(&on_disk(folder.path()), json!({}));
    let checked = || {
        let disk = Some(Disk::open(folder.path(), 1 << 20).unwrap());
        Evaluator::new(Options { disk, verify: true, ..Options::new(Device::Cpu) })
    };
    assert_eq!(keeper(&checked(), json!({})), (true, 1.0));
    let plan = plan(json!({ "keeper": { "type": "keeper", "params": { "forgetful": true } } }));
    let error = checked().evaluate(&plan, &[0], 1, &CONTEXT, &mut Vec::new()).unwrap_err();
    assert!(error.to_string().contains("something else than is computed now"), "{error}");
}

#[test]
fn writers_always_write_and_failures_name_their_node() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan_in(
        folder.path(),
        json!({
            "base": { "type": "flat", "params": { "width": 1 } },
            "risky": { "type": "fail", "params": { "from": 2 }, "inputs": { "image": "base" } },
            "out": { "type": "dump", "inputs": { "image": "risky" } },
        }),
    );
    let evaluator = evaluator();
    let out = folder.path().join("dump.0001.txt");
    for _ in 0..2 {
        evaluate(&evaluator, &plan, "out", 1);
        assert_eq!(std::fs::read_to_string(&out).unwrap(), "[1.0]");
        std::fs::remove_file(&out).unwrap();
    }
    let mut report = Vec::new();
    let targets = plan.targets(&[]).unwrap();
    let error = evaluator.evaluate(&plan, &targets, 2, &CONTEXT, &mut report).unwrap_err();
    assert!(error.to_string().starts_with("node \"risky\" (fail)"), "{error}");
    assert_eq!(error.exit_code(), 1);
    assert_eq!(report.len(), 1, "what was done before is reported: base");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    let elsewhere = tempfile::tempdir().unwrap();
    let context = Context { out: Some(elsewhere.path()), ..CONTEXT };
    evaluator.evaluate(&plan, &targets, 1, &context, &mut report).unwrap();
    assert!(elsewhere.path().join("dump.0001.txt").is_file());
}

#[test]
fn asked_to_stop_it_stops() {
    let plan = plan(json!({ "base": { "type": "flat" } }));
    let cancel = AtomicBool::new(true);
    let context = Context { cancel: &cancel, ..CONTEXT };
    let error = evaluator().evaluate(&plan, &[0], 1, &context, &mut Vec::new()).unwrap_err();
    assert!(matches!(error, chiaro::Error::Cancelled));
}

/// Long chains must not run out of stack.
#[test]
fn chains_may_be_long() {
    let mut nodes = serde_json::Map::new();
    nodes.insert("n0".into(), json!({ "type": "flat", "params": { "width": 1, "value": 0 } }));
    nodes.insert("one".into(), json!({ "type": "flat", "params": { "width": 1 } }));
    for index in 1..=5000 {
        let inputs = json!({ "a": format!("n{}", index - 1), "b": "one" });
        nodes.insert(format!("n{index}"), json!({ "type": "add", "inputs": inputs }));
    }
    let (sum, _) = evaluate(&evaluator(), &plan(nodes.into()), "n5000", 1);
    assert_eq!(values(&sum[0]), [5000.0]);
}
