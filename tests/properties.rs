//! What must hold for any picture: of edits, of lights, of keys and caches (here), of transfers (`properties/transfer`)
//! and of small functions on any input (`properties/numbers`).

#[path = "properties/edit_keys.rs"]
mod edit_keys;
#[path = "properties/edits.rs"]
mod edits;
#[path = "properties/glossy.rs"]
mod glossy;
#[path = "properties/hidden.rs"]
mod hidden;
#[path = "properties/lights.rs"]
mod lights;
#[path = "properties/materials.rs"]
mod materials;
#[path = "properties/numbers.rs"]
mod numbers;
#[path = "properties/path_edits.rs"]
mod path_edits;
#[path = "support/room.rs"]
mod room;
#[path = "properties/source_brushes.rs"]
mod source_brushes;
#[path = "properties/transfer.rs"]
mod transfer;

use chiaro::device::Device;
use chiaro::eval::{CacheUse, Disk, Evaluator, Options};
use chiaro::graph::Plan;
use chiaro::nodes;
use chiaro::value::{Kind, Value};
use room::{OBJECTS, bits, close, edit, evaluate, evaluator, image, keyed, layer, pick, recipe, relative_rms, relight};
use serde_json::{Map, Value as Json, json};
use std::collections::BTreeMap;

/// Which node of `everything` gives a value of a kind.
fn source(kind: Kind) -> &'static str {
    match kind {
        Kind::Scene => "room",
        Kind::Camera => "eye",
        Kind::Samples => "view",
        Kind::Transfer => "transport",
        Kind::Selection => "block",
        Kind::Edits => "change",
        Kind::Image => "lit",
        Kind::Ratio => "shade",
        Kind::Environment => "sky",
        Kind::Visibility => "seen",
        Kind::Transport => "shine",
        Kind::Light => panic!("no node gives {kind:?} here"),
    }
}

#[test]
fn a_node_that_changes_nothing_is_its_input() {
    // Parameters with which node types pass an input through; those that do by default must be here.
    let passing: BTreeMap<&str, Json> = BTreeMap::from([
        ("blur_shadow", json!({})),
        ("caster_receiver", json!({})),
        ("directionality", json!({})),
        ("falloff", json!({})),
        ("grade", json!({})),
        ("illumination_brush", json!({})),
        ("indirect_shadow", json!({ "amount": 0.0 })),
        ("material", json!({ "materials": ["red"] })),
        ("merge", json!({ "amount": 0.0 })),
        ("ratio_blur", json!({})),
        ("ratio_grade", json!({})),
        ("ratio_lattice", json!({})),
        ("ratio_pattern", json!({ "strength": 0.0 })),
        ("ratio_transform", json!({})),
        ("remove_shadow", json!({ "amount": 0.0 })),
        ("rotate_shadow", json!({})),
        ("shadow_gradient", json!({ "amount": 0.0 })),
        ("source_brush", json!({})),
        ("tint_shadow", json!({})),
        ("translate_shadow", json!({})),
        ("tone_map", json!({ "operator": "none" })),
    ]);
    for node_type in nodes::ALL {
        let name = node_type.info.name;
        let by_default = (node_type.parse)(Map::new()).unwrap().pass_through().is_some();
        assert!(!by_default || passing.contains_key(name), "{name} passes by default: add it to this test");
    }
    let evaluator = evaluator();
    for (name, params) in passing {
        let node_type = nodes::ALL.iter().find(|node| node.info.name == name).unwrap();
        let port = (node_type.parse)(params.as_object().unwrap().clone()).unwrap().pass_through().expect(name);
        let mut inputs = Map::new();
        for input in node_type.info.inputs.iter().filter(|input| !input.optional || input.name == port) {
            inputs.insert(input.name.into(), source(input.kind).into());
        }
        let from = inputs[port].as_str().unwrap().to_owned();
        let plan = recipe(json!({
            "eye": { "type": "camera", "inputs": { "scene": "room" } },
            "block": pick(&["block"]),
            "change": edit(json!({ "brightness": 2.0 }), json!({ "caster": "block" })),
            "lit": relight(None),
            "sky": { "type": "environment", "params": { "face_size": 32 } },
            "seen": {
                "type": "visibility", "params": { "face_size": 32 },
                "inputs": { "scene": "room", "samples": "view", "environment": "sky" },
            },
            "shine": { "type": "transport", "inputs": { "scene": "room", "samples": "view", "environment": "sky" } },
            "shade": { "type": "visibility_ratio", "inputs": { "original": "lit", "removed": "lit" } },
            "same": { "type": name, "params": params, "inputs": inputs },
        }));
        assert_eq!(keyed(&plan, "same", 1).outputs, keyed(&plan, &from, 1).outputs, "{name}");
        let (value, report) = evaluate(&evaluator, &plan, "same", 1);
        assert!(report.iter().any(|node| node.node == "same" && node.cache == CacheUse::Pass), "{name} was computed");
        let (before, _) = evaluate(&evaluator, &plan, &from, 1);
        let same = match (&value, &before) {
            (Value::Image(a), Value::Image(b)) => std::sync::Arc::ptr_eq(a, b),
            (Value::Edits(a), Value::Edits(b)) => std::sync::Arc::ptr_eq(a, b),
            (Value::Scene(a), Value::Scene(b)) => std::sync::Arc::ptr_eq(a, b),
            (Value::Visibility(a), Value::Visibility(b)) => std::sync::Arc::ptr_eq(a, b),
            (Value::Ratio(a), Value::Ratio(b)) => std::sync::Arc::ptr_eq(a, b),
            _ => panic!("{name} passes what this test does not compare"),
        };
        assert!(same, "{name} gives another value");
    }
}

/// Object that each pixel of `view` sees.
fn objects(evaluator: &Evaluator, plan: &Plan) -> Vec<u32> {
    let (Value::Samples(samples), _) = evaluate(evaluator, plan, "view", 1) else { panic!("samples") };
    samples.points.iter().map(|point| point.object).collect()
}

fn number(object: &str) -> u32 {
    OBJECTS.iter().position(|name| *name == object).unwrap() as u32
}

const CHANGES: [&str; 3] = [
    r#"{ "brightness": 4.0 }"#,
    r#"{ "saturation": 0.2, "hue": 70.0 }"#,
    r#"{ "curve": { "gamma": { "gamma": 2.0, "pivot": 0.3 } } }"#,
];

/// Also with a caster, where the light is kept in parts whose sum would round anew.
#[test]
fn an_edit_changes_nothing_outside_its_receiver() {
    let evaluator = evaluator();
    for change in CHANGES {
        let change: Json = serde_json::from_str(change).unwrap();
        let plan = recipe(json!({
            "red": pick(&["left_wall"]),
            "block": pick(&["block"]),
            "slight": edit(json!({ "brightness": 1.001 }), json!({ "caster": "red", "receiver": "block" })),
            "from_red": edit(change.clone(), json!({ "caster": "red", "receiver": "block" })),
            "from_all": edit(change, json!({ "receiver": "block" })),
            "plain": relight(None), "a": relight(Some("slight")), "b": relight(Some("from_red")),
            "c": relight(Some("from_all")),
        }));
        let objects = objects(&evaluator, &plan);
        let [plain, slight, red, all] = ["plain", "a", "b", "c"].map(|node| image(&evaluator, &plan, node));
        let mut inside = 0;
        for (pixel, object) in objects.iter().enumerate() {
            let at = |image: &chiaro::image::Image| layer(image, "indirect")[3 * pixel..][..3].to_vec();
            if *object == number("block") {
                inside += usize::from(at(&red) != at(&plain) && at(&all) != at(&plain));
            } else {
                assert_eq!(at(&red), at(&plain), "pixel {pixel} of object {object}");
                assert_eq!(at(&slight), at(&plain), "pixel {pixel} of object {object}");
                assert_eq!(at(&all), at(&plain), "pixel {pixel} of object {object}");
            }
        }
        assert!(inside > 20, "the edit changed {inside} pixels of its receiver");
        for name in ["direct", "albedo", "P", "N", "Z"] {
            assert_eq!(layer(&red, name), layer(&plain, name), "edits act on indirect light alone");
        }
    }
}

#[test]
fn casters_sum_to_the_whole() {
    let mut nodes = json!({ "plain": relight(None) });
    for object in OBJECTS {
        let others: Vec<&str> = OBJECTS.into_iter().filter(|other| *other != object).collect();
        nodes[format!("{object}_others")] = pick(&others);
        nodes[format!("{object}_alone")] =
            edit(json!({ "brightness": 0.0 }), json!({ "caster": format!("{object}_others") }));
        nodes[format!("by_{object}")] = relight(Some(&format!("{object}_alone")));
    }
    nodes["transport"] = json!({
        "type": "transfer", "params": { "gather_samples": 2048, "tolerance": 0.1, "bounces": 2 },
        "inputs": { "scene": "room", "samples": "view" },
    });
    let (plan, evaluator) = (recipe(nodes), evaluator());
    let whole = layer(&image(&evaluator, &plan, "plain"), "indirect");
    let mut sum = vec![0.0f32; whole.len()];
    for object in OBJECTS {
        let part = layer(&image(&evaluator, &plan, &format!("by_{object}")), "indirect");
        assert!(part.iter().all(|x| *x >= 0.0), "negative light from {object}");
        assert!(part != whole, "all light from {object}");
        sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
    }
    assert!(whole.iter().sum::<f32>() > 1.0, "a dark picture proves nothing");
    close(&sum, &whole, 1e-7, 1e-4);
}

/// Emitting surfaces cannot be switched off: their own picture is in each of the others.
#[test]
fn lights_sum_to_all_lights() {
    let lights = [
        json!({ "name": "key" }),
        json!({ "name": "bulb", "kind": "point", "position": [-1.3, 0.6, 0.6], "colour": [1.0, 0.75, 0.4] }),
        json!({ "name": "sun", "kind": "directional", "direction": [0.4, -0.5, -1.0], "intensity": 3.0 }),
        json!({ "name": "softbox", "kind": "area", "position": [-1.2, 1.4, 2.4], "direction": [0.6, -0.1, -1.0] }),
    ];
    let evaluator = evaluator();
    let with = |on: &dyn Fn(usize) -> bool| {
        let mut nodes = json!({ "lit": relight(None) });
        let mut last = "room".to_owned();
        for (number, light) in lights.iter().enumerate() {
            let (mut params, name) = (light.clone(), format!("light_{number}"));
            params["on"] = on(number).into();
            nodes[&name] = json!({ "type": "light", "params": params, "inputs": { "scene": last } });
            last = name;
        }
        nodes["lit"]["inputs"]["scene"] = last.into();
        nodes["transport"] = json!({
            "type": "transfer", "params": { "gather_samples": 2048, "tolerance": 0.1, "bounces": 2 },
            "inputs": { "scene": "room", "samples": "view" },
        });
        image(&evaluator, &recipe(nodes), "lit")
    };
    let (all, none) = (with(&|_| true), with(&|_| false));
    let each: Vec<_> = (0..lights.len()).map(|number| with(&|other| other == number)).collect();
    for name in ["", "direct", "indirect"] {
        let [all, none] = [&all, &none].map(|image| layer(image, name));
        let mut sum = vec![0.0f32; all.len()];
        for part in &each {
            let part = layer(part, name);
            assert!(part != none, "a light without light");
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
        let expected: Vec<f32> = all.iter().zip(&none).map(|(a, n)| a + (each.len() - 1) as f32 * n).collect();
        close(&sum, &expected, 1e-7, 1e-5);
    }
}

/// The indirect light of the room after a list of edits, each on what the one before it left.
fn after(evaluator: &Evaluator, edits: &[(Json, Json)]) -> Vec<f32> {
    let mut nodes = json!({ "red": pick(&["left_wall"]), "block": pick(&["block"]), "walls": pick(&["*_wall"]) });
    let mut last = None;
    for (number, (params, inputs)) in edits.iter().enumerate() {
        let mut inputs = inputs.clone();
        if let Some(last) = last {
            inputs["edits"] = Json::String(last);
        }
        let name = format!("edit_{number}");
        nodes[&name] = edit(params.clone(), inputs);
        last = Some(name);
    }
    nodes["lit"] = relight(last.as_deref());
    layer(&image(evaluator, &recipe(nodes), "lit"), "indirect")
}

#[test]
fn an_edit_can_be_taken_back() {
    let evaluator = evaluator();
    let plain = after(&evaluator, &[]);
    let red = json!({ "caster": "red" });
    for inputs in [json!({}), red.clone(), json!({ "caster": "walls", "receiver": "block" })] {
        let there = (json!({ "brightness": 3.0 }), inputs.clone());
        assert!(relative_rms(&after(&evaluator, std::slice::from_ref(&there)), &plain) > 0.05);
        let back = (json!({ "brightness": 1.0 / 3.0 }), inputs);
        close(&after(&evaluator, &[there, back]), &plain, 1e-9, 1e-5);
    }
    let turn = (json!({ "hue": 120.0 }), red.clone());
    assert!(relative_rms(&after(&evaluator, std::slice::from_ref(&turn)), &plain) > 0.05);
    // A turned hue may be negative in a channel: errors are of the size of the other channels.
    close(&after(&evaluator, &[turn.clone(), turn.clone(), turn]), &plain, 1e-6, 1e-4);
    for hue in [360.0, -360.0] {
        assert_eq!(after(&evaluator, &[(json!({ "hue": hue }), red.clone())]), plain, "hue {hue}");
    }
}

#[test]
fn order_matters_only_where_it_should() {
    let evaluator = evaluator();
    let red = json!({ "caster": "red" });
    let curve = json!({ "curve": { "gamma": { "gamma": 2.0, "pivot": 0.3 } } });
    let both_ways =
        |a: (Json, Json), b: (Json, Json)| (after(&evaluator, &[a.clone(), b.clone()]), after(&evaluator, &[b, a]));
    let brighter = (json!({ "brightness": 3.0 }), red.clone());
    let (a, b) = both_ways(brighter.clone(), (json!({ "saturation": 0.3, "hue": 50.0 }), json!({ "caster": "walls" })));
    close(&a, &b, 1e-6, 1e-4);
    let (a, b) = both_ways(brighter, (curve.clone(), red.clone()));
    assert!(relative_rms(&a, &b) > 0.01, "a curve acts on what the edits before it left");
    // Receivers that have no point in common.
    let rest: Vec<&str> = OBJECTS.into_iter().filter(|object| *object != "block").collect();
    let mut nodes = json!({ "red": pick(&["left_wall"]), "block": pick(&["block"]), "rest": pick(&rest) });
    for (name, receiver, before) in
        [("a", "block", None), ("ab", "rest", Some("a")), ("b", "rest", None), ("ba", "block", Some("b"))]
    {
        let params = if receiver == "block" { curve.clone() } else { json!({ "brightness": 3.0 }) };
        let mut inputs = json!({ "caster": "red", "receiver": receiver });
        if let Some(before) = before {
            inputs["edits"] = before.into();
        }
        nodes[name] = edit(params, inputs);
        nodes[format!("lit_{name}")] = relight(Some(name));
    }
    let plan = recipe(nodes);
    let [a, ab, ba] = ["lit_a", "lit_ab", "lit_ba"].map(|node| bits(&image(&evaluator, &plan, node)));
    assert!(ab == ba && a != ab);
}

#[test]
fn a_keyframe_is_its_key() {
    let nodes = |brightness: Json| {
        recipe(json!({
            "red": pick(&["left_wall"]),
            "bleed": edit(json!({ "brightness": brightness }), json!({ "caster": "red" })),
            "lit": relight(Some("bleed")),
        }))
    };
    let key = |plan: &Plan, frame: i64| keyed(plan, "lit", frame).key;
    for interpolation in ["linear", "smooth", "hold"] {
        let keys = json!([[2, 0.3], [7, 4.0], [12, 1.0]]);
        let moving = nodes(json!({ "keys": keys, "interpolation": interpolation }));
        for (frame, value) in [(2, 0.3), (7, 4.0), (12, 1.0), (-5, 0.3), (40, 1.0)] {
            assert_eq!(key(&moving, frame), key(&nodes(value.into()), 1), "{interpolation}, frame {frame}");
        }
        let between = key(&moving, 9);
        assert_eq!(between == key(&moving, 7), interpolation == "hold", "{interpolation} between keys");
    }
}

/// Everything that computes: bounces, several samples a pixel, lights of all kinds, edits.
fn everything() -> Plan {
    recipe(json!({
        "view": {
            "type": "view_samples", "params": { "width": 31, "height": 23, "samples_per_pixel": 4 },
            "inputs": { "scene": "room" },
        },
        "lamp": {
            "type": "light", "params": { "kind": "area", "position": [-1.2, 1.4, 2.4], "direction": [0.6, -0.1, -1.0] },
            "inputs": { "scene": "room" },
        },
        "transport": {
            "type": "transfer", "params": { "gather_samples": 2048, "tolerance": 0.1, "bounces": 2 },
            "inputs": { "scene": "room", "samples": "view" },
        },
        "red": pick(&["left_wall"]),
        "bleed": edit(json!({ "brightness": 3.0, "curve": { "gamma": { "gamma": 2.0 } } }), json!({ "caster": "red" })),
        "lit": { "type": "relight", "inputs": { "scene": "lamp", "transfer": "transport", "edits": "bleed" } },
        "picture": { "type": "tone_map", "inputs": { "image": "lit" } },
    }))
}

#[test]
fn every_bit_is_the_same_for_any_number_of_threads() {
    let plan = everything();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bits(&image(&evaluator(), &plan, "picture")))
    };
    let one = with(1);
    assert!([2, 3, 8].into_iter().all(|threads| with(threads) == one));
}

#[test]
fn every_bit_is_the_same_from_any_cache() {
    let (plan, folder) = (everything(), tempfile::tempdir().unwrap());
    let on_disk = || {
        let disk = Some(Disk::open(folder.path(), 1 << 30).unwrap());
        Evaluator::new(Options { disk, ..Options::new(Device::Cpu) })
    };
    let shown = |evaluator: &Evaluator, use_: CacheUse, of: &str| {
        let (value, report) = evaluate(evaluator, &plan, "picture", 1);
        assert!(report.iter().any(|node| node.node == of && node.cache == use_), "{of} is not {use_:?}");
        let Value::Image(image) = value else { panic!("a picture") };
        bits(&image)
    };
    let first = on_disk();
    let cold = shown(&first, CacheUse::Computed, "transport");
    assert!(cold == shown(&first, CacheUse::Memory, "picture"), "from memory");
    assert!(cold == shown(&on_disk(), CacheUse::Disk, "transport"), "from disk");
    let disk = Some(Disk::open(folder.path(), 1 << 30).unwrap());
    let checked = Evaluator::new(Options { disk, verify: true, ..Options::new(Device::Cpu) });
    assert!(cold == shown(&checked, CacheUse::Computed, "transport"), "computed in spite of the cache");
}
