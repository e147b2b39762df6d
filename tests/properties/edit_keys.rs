//! What edits are named by: each parameter changes its own key and those after it; whatever a relit picture keeps from
//! one list to the next, it is the picture that is computed afresh. And odd views.

use crate::edits::{Step, listed, stack};
use crate::room::{bits, evaluate, evaluator, image, keyed, recipe, relight};
use chiaro::device::Device;
use chiaro::eval::{Evaluator, Options};
use chiaro::graph::Plan;
use chiaro::nodes;
use serde_json::{Map, Value as Json, json};

/// Other values of each parameter of the nodes that edit.
fn variations() -> Vec<(&'static str, Json)> {
    vec![
        (
            "caster_receiver",
            json!({ "brightness": 2.0, "saturation": 0.5, "hue": 10.0, "curve": { "gamma": { "gamma": 2.0 } } }),
        ),
        ("source_brush", json!({ "scale": 2.0, "offset": [0.0, 0.1, 0.0] })),
        ("illumination_brush", json!({ "scale": 2.0, "hue": 20.0, "saturation": 0.5 })),
        ("falloff", json!({ "exponent": 1.5, "distance": 2.0 })),
        ("indirect_shadow", json!({ "amount": 0.25 })),
        ("directionality", json!({ "axis": [0.0, 0.0, 1.0], "amount": 0.75, "focus": 3.0 })),
        (
            "material",
            json!({ "materials": ["teal"], "base_colour": [0.5, 0.5, 0.5], "roughness": 0.4, "metallic": 0.5, "specular": 0.3, "emission": [1, 1, 1] }),
        ),
    ]
}

#[test]
fn each_parameter_changes_its_own_key_and_those_after_it_alone() {
    for (kind, changes) in variations() {
        // Where it does something already, so that it does not pass.
        let active = match kind {
            "caster_receiver" => json!({ "brightness": 3.0 }),
            "falloff" => json!({ "exponent": 1.0 }),
            "directionality" => json!({ "amount": 0.5 }),
            "material" => json!({ "materials": ["red"], "roughness": 0.9 }),
            "indirect_shadow" => json!({}),
            _ => json!({ "scale": 3.0 }),
        };
        let node_type = nodes::ALL.iter().find(|node| node.info.name == kind).unwrap();
        let whole = (node_type.parse)(Map::new()).unwrap();
        assert!(whole.pass_through().is_some() || kind == "indirect_shadow");
        let schema = serde_json::to_value((node_type.schema)()).unwrap();
        let known: Vec<&String> = schema["properties"].as_object().unwrap().keys().collect();
        assert!(known.iter().all(|name| changes.get(name).is_some()), "{kind}: add {known:?} to this test");
        let plan = |params: Json| {
            let scene = if kind == "material" { "mid" } else { "room" };
            let inputs = if kind == "material" { json!({ "scene": "room" }) } else { json!({ "edits": "first" }) };
            let mut lit = relight((kind != "material").then_some("last"));
            lit["inputs"]["scene"] = scene.into();
            recipe(json!({
                "first": { "type": "caster_receiver", "params": { "brightness": 1.1 } },
                "mid": { "type": kind, "params": params, "inputs": inputs },
                "last": { "type": "caster_receiver", "params": { "brightness": 1.2 }, "inputs": { "edits": if kind == "material" { "first" } else { "mid" } } },
                "lit": lit,
            }))
        };
        let keys = |plan: &Plan| {
            ["room", "view", "transport", "first", "mid", "last", "lit"].map(|node| keyed(plan, node, 1).key)
        };
        let before = keys(&plan(active.clone()));
        for (name, value) in changes.as_object().unwrap() {
            let mut params = active.clone();
            params[name] = value.clone();
            let after = keys(&plan(params));
            let changed: Vec<bool> = before.iter().zip(&after).map(|(a, b)| a != b).collect();
            let last = kind != "material";
            assert_eq!(changed, [false, false, false, false, true, last, true], "{kind}.{name}");
        }
    }
}

/// One picture after another from one evaluator: nothing that it kept from the ones before shows.
#[test]
fn what_is_kept_between_lists_never_shows() {
    let with = |change: &dyn Fn(&mut Vec<Step>)| {
        let mut steps = stack();
        change(&mut steps);
        (steps, json!({}))
    };
    let set = |number: usize, name: &'static str, value: Json| {
        with(&move |steps: &mut Vec<Step>| steps[number].1[name] = value.clone())
    };
    let wire = |number: usize, port: &'static str, to: &'static str| {
        with(&move |steps: &mut Vec<Step>| steps[number].2[port] = to.into())
    };
    let scene = |params: Json, kind: &str| {
        let mut lit = relight(Some("edit_7"));
        lit["inputs"]["scene"] = "changed".into();
        (stack(), json!({ "changed": { "type": kind, "params": params, "inputs": { "scene": "room" } }, "lit": lit }))
    };
    let mut fewer = relight(Some("edit_7"));
    fewer["params"] = json!({ "light_samples": 4 });
    let transport = |params: Json| {
        (
            stack(),
            json!({ "transport": { "type": "transfer", "params": params, "inputs": { "scene": "room", "samples": "view" } } }),
        )
    };
    let lists = [
        with(&|_| {}),
        set(0, "scale", json!(2.0)),
        set(0, "offset", json!([0.1, 0.0, 0.0])),
        set(1, "exponent", json!(3.0)),
        set(1, "distance", json!(0.5)),
        set(2, "curve", json!({ "gamma": { "gamma": 1.6, "pivot": 0.4 } })),
        set(3, "amount", json!(0.4)),
        set(4, "axis", json!([0.0, 1.0, 1.0])),
        set(4, "focus", json!(1.0)),
        set(4, "amount", json!(0.6)),
        set(7, "hue", json!(30.0)),
        wire(1, "receiver", "softer"),
        wire(1, "caster", "teal"),
        wire(3, "caster", "teal"),
        wire(3, "receiver", "walls"),
        wire(4, "receiver", "soft"),
        with(&|steps| steps.swap(1, 2)),
        with(&|steps| steps.swap(2, 6)),
        scene(json!({ "name": "key", "position": [0.9, 2.0, 1.0] }), "light"),
        scene(json!({ "materials": ["red"], "base_colour": [0.2, 0.3, 0.6] }), "material"),
        scene(json!({ "materials": ["lacquer"], "roughness": 0.6 }), "material"),
        (stack(), json!({ "lit": fewer })),
        transport(json!({ "gather_samples": 1024, "tolerance": 0.1 })),
        transport(json!({ "gather_samples": 2048, "tolerance": 0.1, "bounces": 2 })),
        transport(json!({ "gather_samples": 2048, "tolerance": 0.1, "glossy": "blinn" })),
        with(&|_| {}),
    ];
    let kept = evaluator();
    let mut pictures = std::collections::BTreeSet::new();
    for (number, (steps, more)) in lists.iter().enumerate() {
        let plan = listed(steps, more.clone());
        let found = bits(&image(&kept, &plan, "lit"));
        assert!(found == bits(&image(&evaluator(), &plan, "lit")), "list {number}");
        assert!(pictures.insert(found) || number + 1 == lists.len(), "list {number} changes nothing");
    }
    let checked = Evaluator::new(Options { verify: true, ..Options::new(Device::Cpu) });
    let plan = listed(&stack(), json!({}));
    let first = bits(&image(&checked, &plan, "lit"));
    assert!(first == bits(&image(&checked, &plan, "lit")));
}

#[test]
fn odd_views_and_scenes_give_finite_pictures() {
    let view = |width: u32, height: u32| json!({ "type": "view_samples", "params": { "width": width, "height": height }, "inputs": { "scene": "room" } });
    let transport = |params: Json| json!({ "type": "transfer", "params": params, "inputs": { "scene": "room", "samples": "view" } });
    let mut black = relight(Some("edit_7"));
    black["inputs"]["scene"] = "black".into();
    let cases = [
        json!({ "view": view(1, 1) }),
        json!({ "view": view(7, 1), "transport": transport(json!({ "gather_samples": 2, "tolerance": 1.0 })) }),
        json!({ "transport": transport(json!({ "gather_samples": 64, "tolerance": 1.0, "bounces": 3 })) }),
        json!({ "black": { "type": "material", "params": { "base_colour": [0, 0, 0], "specular": 0.0 }, "inputs": { "scene": "room" } }, "lit": black }),
    ];
    for case in cases {
        let lit = image(&evaluator(), &listed(&stack(), case.clone()), "lit");
        assert!(lit.layers.iter().flat_map(|layer| layer.data.iter()).all(|x| x.is_finite()), "{case}");
    }
    // Haar rows hold no paths: edits of paths say so, all others are shown.
    let haar = json!({ "transport": transport(json!({ "gather_samples": 1024, "tolerance": 0.2, "basis": "haar" })) });
    for (number, step) in stack().into_iter().enumerate() {
        let plan = listed(std::slice::from_ref(&step), haar.clone());
        let target = plan.find("lit").unwrap();
        if ["falloff", "directionality"].contains(&step.0) {
            let never = std::sync::atomic::AtomicBool::new(false);
            let context = chiaro::eval::Context { cancel: &never, ..chiaro::eval::Context::SILENT };
            let error = evaluator().evaluate(&plan, &[target], 1, &context, &mut Vec::new()).unwrap_err();
            assert!(error.to_string().contains("haar"), "{error}");
        } else {
            let (plain, _) = evaluate(&evaluator(), &listed(&[], haar.clone()), "lit", 1);
            let chiaro::value::Value::Image(plain) = plain else { panic!("a picture") };
            let lit = image(&evaluator(), &plan, "lit");
            assert!(bits(&lit) != bits(&plain), "edit {number} changes nothing");
        }
    }
}
