//! Edits of every kind in the built-in room: where they act, what they do by hand, and that they stack.

use crate::room::{OBJECTS, bits, close, evaluate, evaluator, image, layer, pick, recipe, relative_rms, relight};
use chiaro::device::{Choice, Device};
use chiaro::eval::{CacheUse, Evaluator, Options};
use chiaro::graph::Plan;
use chiaro::image::Image;
use chiaro::image::colour;
use chiaro::value::Value;
use glam::Vec3;
use serde_json::{Value as Json, json};
use std::sync::Arc;

/// A node type, its parameters and its selections.
pub type Step = (&'static str, Json, Json);

/// The room relit by a list of edits, each on what the one before it left, with selections by name; `more` nodes.
pub fn listed(steps: &[Step], more: Json) -> Plan {
    let brush = |points: Json, radius: f32| {
        json!({
            "type": "paint", "inputs": { "scene": "room" },
            "params": { "strokes": [{ "points": points, "radius": radius, "hardness": 0.0 }] },
        })
    };
    let mut nodes = json!({
        "red": pick(&["left_wall"]), "teal": pick(&["right_wall"]), "block": pick(&["block"]),
        "floor": pick(&["floor"]), "ball": pick(&["ball"]), "walls": pick(&["*_wall"]),
        "soft": brush(json!([[-0.4, 0.0, 0.9], [0.5, 0.0, 1.0]]), 1.3),
        "softer": brush(json!([[0.4, 0.0, 1.2]]), 1.6),
        "soft_red": brush(json!([[-2.0, 1.0, 0.3]]), 1.2),
        "nothing": { "type": "paint", "inputs": { "scene": "room" } },
    });
    let mut last = None;
    for (number, (kind, params, inputs)) in steps.iter().enumerate() {
        let (name, mut inputs) = (format!("edit_{number}"), inputs.clone());
        if let Some(last) = last {
            inputs["edits"] = Json::String(last);
        }
        nodes[&name] = json!({ "type": kind, "params": params, "inputs": inputs });
        last = Some(name);
    }
    nodes["lit"] = relight(last.as_deref());
    for (name, node) in more.as_object().unwrap() {
        nodes[name] = node.clone();
    }
    recipe(nodes)
}

fn lit(evaluator: &Evaluator, steps: &[Step]) -> Arc<Image> {
    image(evaluator, &listed(steps, json!({})), "lit")
}

/// The indirect light.
fn after(evaluator: &Evaluator, steps: &[Step]) -> Vec<f32> {
    layer(&lit(evaluator, steps), "indirect")
}

/// Object of each pixel.
fn objects(evaluator: &Evaluator) -> Vec<&'static str> {
    let (Value::Samples(samples), _) = evaluate(evaluator, &listed(&[], json!({})), "view", 1) else { panic!() };
    samples.points.iter().map(|point| OBJECTS.get(point.object as usize).copied().unwrap_or("nothing")).collect()
}

/// Weight of a selection at each pixel.
fn weights(evaluator: &Evaluator, name: &str) -> Vec<f32> {
    let plan = listed(&[], json!({}));
    let (Value::Samples(samples), _) = evaluate(evaluator, &plan, "view", 1) else { panic!() };
    let (Value::Selection(selection), _) = evaluate(evaluator, &plan, name, 1) else { panic!() };
    selection.weights(&samples.points)
}

/// Those that have casters and receivers, or a receiver alone.
fn kinds() -> Vec<(&'static str, Json)> {
    vec![
        ("caster_receiver", json!({ "brightness": 4.0, "hue": 30.0 })),
        ("caster_receiver", json!({ "curve": { "gamma": { "gamma": 2.0, "pivot": 0.3 } } })),
        ("falloff", json!({ "exponent": 0.5, "distance": 1.5 })),
        ("indirect_shadow", json!({ "amount": 0.9 })),
        ("directionality", json!({ "amount": 0.8, "axis": [-1.0, 0.5, 0.0] })),
        ("illumination_brush", json!({ "scale": 2.0, "hue": 40.0 })),
    ]
}

fn on(kind: &str, caster: Option<&str>, receiver: Option<&str>) -> Json {
    let mut inputs = json!({});
    if let Some(receiver) = receiver {
        inputs[if kind == "illumination_brush" { "selection" } else { "receiver" }] = receiver.into();
    }
    if let Some(caster) = caster.filter(|_| !matches!(kind, "illumination_brush" | "directionality")) {
        inputs["caster"] = caster.into();
    }
    inputs
}

#[test]
fn no_kind_of_edit_changes_a_bit_outside_its_receiver() {
    let evaluator = evaluator();
    let objects = objects(&evaluator);
    let plain = lit(&evaluator, &[]);
    let count = kinds().len();
    for (number, (kind, params)) in kinds().into_iter().enumerate() {
        for caster in [None, Some("red")] {
            let step = (kind, params.clone(), on(kind, caster, Some("block")));
            let alone = lit(&evaluator, std::slice::from_ref(&step));
            // Stacked with another kind, which has a caster and a receiver of its own.
            let (other, changes) = kinds().swap_remove((number + 1) % count);
            let second = (other, changes, on(other, Some("teal"), Some("floor")));
            let second_alone = lit(&evaluator, std::slice::from_ref(&second));
            let both = lit(&evaluator, &[step, second]);
            let mut changed = [0, 0];
            for name in ["", "direct", "indirect"] {
                let channels = if name.is_empty() { 4 } else { 3 };
                let [plain, alone, second, both] =
                    [&plain, &alone, &second_alone, &both].map(|image| layer(image, name));
                for (pixel, object) in objects.iter().enumerate() {
                    let at = |layer: &[f32]| layer[channels * pixel..][..channels].to_vec();
                    let what = format!("{kind} and {other}, caster {caster:?}: {name}, pixel {pixel} of {object}");
                    match *object {
                        "block" => {
                            changed[0] += usize::from(at(&alone) != at(&plain));
                            assert_eq!(at(&both), at(&alone), "{what}");
                        }
                        "floor" => {
                            changed[1] += usize::from(at(&second) != at(&plain));
                            assert_eq!(at(&both), at(&second), "{what}");
                        }
                        _ => assert_eq!(at(&both), at(&plain), "{what}"),
                    }
                    assert!(*object == "block" || at(&alone) == at(&plain), "{what}");
                }
            }
            assert!(changed[0] > 10 && changed[1] > 20, "{kind} and {other} changed {changed:?}");
        }
    }
}

#[test]
fn brightness_zero_is_darkness_and_reflections_go_with_it() {
    let evaluator = evaluator();
    let plain = after(&evaluator, &[]);
    let dark = |selections: Json| after(&evaluator, &[("caster_receiver", json!({ "brightness": 0.0 }), selections)]);
    assert!(dark(json!({})).iter().all(|light| *light == 0.0));
    let brightest = plain.iter().copied().fold(0.0, f32::max);
    let steps: Vec<Step> = [json!({ "caster": "red" }), json!({ "caster": "rest" })]
        .map(|inputs| ("caster_receiver", json!({ "brightness": 0.0 }), inputs))
        .into();
    let rest = json!({ "rest": { "type": "select", "params": { "mode": "invert" }, "inputs": { "a": "red" } } });
    let parted = layer(&image(&evaluator, &listed(&steps, rest), "lit"), "indirect");
    assert!(parted.iter().all(|light| light.abs() <= 1e-6 * brightest));
    // A ball that is all reflection shows a caster as bright as it is made.
    let metal = |steps: &[Step]| {
        let shiny = json!({ "materials": ["lacquer"], "metallic": 1.0, "base_colour": [0.9, 0.9, 0.9] });
        let mut lit = relight((!steps.is_empty()).then_some("edit_0"));
        lit["inputs"]["scene"] = "metal".into();
        let more =
            json!({ "metal": { "type": "material", "params": shiny, "inputs": { "scene": "room" } }, "lit": lit });
        layer(&image(&evaluator, &listed(steps, more), "lit"), "indirect")
    };
    let objects = objects(&evaluator);
    let red = |params: Json| metal(&[("caster_receiver", params, json!({ "caster": "red" }))]);
    let (plain, none, thrice) = (metal(&[]), red(json!({ "brightness": 0.0 })), red(json!({ "brightness": 3.0 })));
    // A curve that is a straight line is a brightness; reflections take its gain.
    let line = red(json!({ "curve": { "points": [[0.0, 0.0], [1.0, 3.0]] } }));
    let mut shown = 0;
    for (pixel, _) in objects.iter().enumerate().filter(|(_, object)| **object == "ball") {
        for c in 3 * pixel..3 * pixel + 3 {
            let expected = plain[c] + 2.0 * (plain[c] - none[c]);
            assert!((thrice[c] - expected).abs() <= 1e-4 * brightest, "{} {expected}", thrice[c]);
            assert!((line[c] - expected).abs() <= 1e-4 * brightest, "{} {expected}", line[c]);
            shown += usize::from(thrice[c] > 1.2 * plain[c]);
        }
    }
    assert!(shown > 10, "{shown}");
}

#[test]
fn brushes_do_what_a_hand_computes() {
    let evaluator = evaluator();
    let objects = objects(&evaluator);
    let plain = after(&evaluator, &[]);
    let source = |scale: f32, selection: &str| {
        after(&evaluator, &[("source_brush", json!({ "scale": scale }), json!({ "selection": selection }))])
    };
    // In one bounce, what a surface sends is what it casts.
    for scale in [0.0, 0.5, 3.0] {
        let cast = ("caster_receiver", json!({ "brightness": scale }), json!({ "caster": "red" }));
        close(&source(scale, "red"), &after(&evaluator, &[cast]), 1e-6, 1e-4);
    }
    let soft = ("caster_receiver", json!({ "brightness": 3.0 }), json!({ "caster": "soft_red" }));
    close(&source(3.0, "soft_red"), &after(&evaluator, &[soft]), 1e-6, 1e-4);
    // Soft selections are linear in what they change.
    let (none, thrice) = (source(0.0, "soft_red"), source(3.0, "soft_red"));
    let linear: Vec<f32> = plain.iter().zip(&none).map(|(p, n)| p + 2.0 * (p - n)).collect();
    assert!(relative_rms(&thrice, &plain) > 0.01);
    close(&thrice, &linear, 1e-6, 1e-4);
    // After reflectance: the red wall itself turns.
    let turned = after(&evaluator, &[("illumination_brush", json!({ "hue": 120.0 }), json!({ "selection": "red" }))]);
    let matrix = colour::hue(120.0);
    for pixel in 0..objects.len() {
        let at = |layer: &[f32]| Vec3::from_slice(&layer[3 * pixel..]);
        let expected = if objects[pixel] == "left_wall" { matrix * at(&plain) } else { at(&plain) };
        assert!((at(&turned) - expected).abs().max_element() <= 1e-6, "pixel {pixel}");
    }
    let arriving = after(&evaluator, &[("caster_receiver", json!({ "hue": 120.0 }), json!({ "receiver": "red" }))]);
    assert!(relative_rms(&arriving, &turned) > 0.01, "before reflectance is not after it");
    let brush = |scale: f32| ("illumination_brush", json!({ "scale": scale }), json!({ "selection": "floor" }));
    assert!(relative_rms(&after(&evaluator, &[brush(4.0)]), &plain) > 0.05);
    close(&after(&evaluator, &[brush(4.0), brush(0.25)]), &plain, 0.0, 1e-6);
}

#[test]
fn soft_receivers_blend_what_is_edited_and_what_is_not() {
    let evaluator = evaluator();
    let plain = after(&evaluator, &[]);
    let [soft, softer] = ["soft", "softer"].map(|name| weights(&evaluator, name));
    assert!(soft.iter().filter(|w| **w > 0.05 && **w < 0.95).count() > 100);
    let step =
        |(kind, params): (&'static str, Json), receiver: Option<&str>| (kind, params, on(kind, Some("red"), receiver));
    let kinds = kinds();
    for kind in &kinds {
        let full = after(&evaluator, &[step(kind.clone(), None)]);
        let found = after(&evaluator, &[step(kind.clone(), Some("soft"))]);
        let blend: Vec<f32> = (0..plain.len()).map(|c| plain[c] + soft[c / 3] * (full[c] - plain[c])).collect();
        assert!(relative_rms(&found, &plain) > 1e-3, "{kind:?} does nothing");
        close(&found, &blend, 2e-6, 2e-4);
    }
    // Two at once are expanded; of two curves, the second would act on a blend.
    for (a, b) in [(2, 4), (0, 3), (3, 2), (2, 0), (4, 3)] {
        let (a, b) = (&kinds[a], &kinds[b]);
        let with = |first: bool, second: bool| {
            let steps = [(a, first), (b, second)].into_iter().filter(|(_, acts)| *acts);
            after(&evaluator, &steps.map(|(kind, _)| step(kind.clone(), None)).collect::<Vec<_>>())
        };
        let (only_a, only_b, both) = (with(true, false), with(false, true), with(true, true));
        let found = after(&evaluator, &[step(a.clone(), Some("soft")), step(b.clone(), Some("softer"))]);
        let expanded: Vec<f32> = (0..plain.len())
            .map(|c| {
                let (s, t) = (soft[c / 3], softer[c / 3]);
                (1.0 - s) * (1.0 - t) * plain[c]
                    + s * (1.0 - t) * only_a[c]
                    + (1.0 - s) * t * only_b[c]
                    + s * t * both[c]
            })
            .collect();
        close(&found, &expanded, 5e-6, 5e-4);
    }
}

#[test]
fn as_many_receivers_as_there_are_objects() {
    let evaluator = evaluator();
    let objects = objects(&evaluator);
    let picks: Json =
        OBJECTS.iter().map(|name| (format!("on_{name}"), pick(&[name]))).collect::<serde_json::Map<_, _>>().into();
    let step = |(number, name): (usize, &&'static str)| -> Step {
        let exponent = 0.5 + 0.2 * number as f32;
        ("falloff", json!({ "exponent": exponent, "distance": 2.0 }), json!({ "receiver": format!("on_{name}") }))
    };
    let steps: Vec<Step> = OBJECTS.iter().enumerate().map(step).collect();
    let all = layer(&image(&evaluator, &listed(&steps, picks.clone()), "lit"), "indirect");
    for (number, name) in OBJECTS.iter().enumerate() {
        let alone = layer(&image(&evaluator, &listed(&steps[number..=number], picks.clone()), "lit"), "indirect");
        for pixel in (0..objects.len()).filter(|pixel| objects[*pixel] == *name) {
            assert_eq!(all[3 * pixel..][..3], alone[3 * pixel..][..3], "pixel {pixel} of {name}");
        }
    }
}

/// Light of the red wall alone is edited; the scene changes under the edit.
#[test]
fn an_edit_still_means_the_same_when_the_scene_changes() {
    let evaluator = evaluator();
    let changes = [
        json!({ "type": "material", "params": { "materials": ["red"], "base_colour": [0.1, 0.5, 0.3] }, "inputs": { "scene": "room" } }),
        json!({ "type": "light", "params": { "name": "key", "position": [1.0, 2.0, 1.0] }, "inputs": { "scene": "room" } }),
        json!({ "type": "light", "params": { "name": "key", "intensity": 7.0 }, "inputs": { "scene": "room" } }),
    ];
    let before = after(&evaluator, &[]);
    for change in changes {
        let changed = |params: Option<Json>| {
            let steps: Vec<Step> =
                params.into_iter().map(|params| ("caster_receiver", params, json!({ "caster": "red" }))).collect();
            let mut lit = relight((!steps.is_empty()).then_some("edit_0"));
            lit["inputs"]["scene"] = "changed".into();
            let plan = listed(&steps, json!({ "changed": change, "lit": lit }));
            let (value, report) = evaluate(&evaluator, &plan, "lit", 1);
            let transfers: Vec<_> = report.iter().filter(|node| node.node == "transport").collect();
            assert!(transfers.iter().all(|node| node.cache != CacheUse::Computed), "a new transfer: {transfers:?}");
            let Value::Image(image) = value else { panic!("a picture") };
            layer(&image, "indirect")
        };
        let (plain, none) = (changed(None), changed(Some(json!({ "brightness": 0.0 }))));
        assert!(relative_rms(&plain, &before) > 0.1 && relative_rms(&plain, &none) > 0.01);
        let thrice = changed(Some(json!({ "brightness": 3.0 })));
        let expected: Vec<f32> = plain.iter().zip(&none).map(|(p, n)| p + 2.0 * (p - n)).collect();
        close(&thrice, &expected, 2e-6, 1e-4);
        let grey = changed(Some(json!({ "saturation": 0.0 })));
        // Luminance of the light before reflectance stays; compared where reflectance is grey.
        let matte = Vec3::new(0.5, 0.5, 0.48);
        for (pixel, _) in objects(&evaluator).iter().enumerate().filter(|(_, object)| **object == "pedestal") {
            let at = |layer: &[f32]| Vec3::from_slice(&layer[3 * pixel..]) / matte;
            let from_red = colour::saturation(0.0) * (at(&plain) - at(&none));
            assert!((at(&grey) - at(&none) - from_red).abs().max_element() < 1e-5, "pixel {pixel}");
        }
    }
}

/// One of each kind, with soft and hard selections; curves before and after path edits.
pub fn stack() -> Vec<Step> {
    vec![
        ("source_brush", json!({ "scale": 1.5, "offset": [0.0, 0.2, 0.6] }), json!({ "selection": "soft_red" })),
        ("falloff", json!({ "exponent": 1.0, "distance": 1.5 }), json!({ "caster": "soft_red", "receiver": "soft" })),
        (
            "caster_receiver",
            json!({ "curve": { "gamma": { "gamma": 1.6, "pivot": 0.2 } } }),
            json!({ "caster": "walls" }),
        ),
        ("indirect_shadow", json!({ "amount": 0.8 }), json!({ "caster": "red", "receiver": "floor" })),
        (
            "directionality",
            json!({ "amount": 0.5, "axis": [1.0, 1.0, 0.0], "focus": 2.0 }),
            json!({ "receiver": "softer" }),
        ),
        (
            "caster_receiver",
            json!({ "brightness": 1.5, "saturation": 1.4, "hue": 25.0 }),
            json!({ "caster": "red", "receiver": "soft" }),
        ),
        (
            "caster_receiver",
            json!({ "curve": { "points": [[0.0, 0.0], [0.3, 0.5], [1.0, 1.0]] } }),
            json!({ "receiver": "block" }),
        ),
        ("illumination_brush", json!({ "scale": 1.3, "saturation": 0.7 }), json!({ "selection": "softer" })),
    ]
}

#[test]
fn all_edits_stacked_give_the_same_bits_for_any_number_of_threads() {
    let plan = listed(&stack(), json!({}));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bits(&image(&evaluator(), &plan, "lit")))
    };
    let one = with(1);
    assert!([2, 5].into_iter().all(|threads| with(threads) == one));
}

#[test]
fn all_edits_stacked_are_the_same_on_the_gpu() {
    let Ok(device) = Device::open(Choice::Gpu) else {
        eprintln!("SKIPPED: no GPU adapter: all_edits_stacked_are_the_same_on_the_gpu");
        return;
    };
    let plan = listed(&stack(), json!({}));
    let on_gpu = layer(&image(&Evaluator::new(Options::new(device)), &plan, "lit"), "indirect");
    let evaluator = evaluator();
    let on_cpu = layer(&image(&evaluator, &plan, "lit"), "indirect");
    let difference = relative_rms(&on_gpu, &on_cpu);
    println!("difference {difference:.1e}");
    // Rays that graze an edge fall on the other side of it.
    assert!(difference < 2e-3, "{difference}");
    assert!(relative_rms(&after(&evaluator, &stack()[..7]), &on_cpu) > 0.02, "the measure can fail");
}

/// The room lit by its lamp alone, at a part of its strength.
fn faded(evaluator: &Evaluator, strength: f64, steps: &[Step]) -> Vec<f32> {
    let intensity = 70.0 * strength;
    let mut lit = relight((!steps.is_empty()).then(|| format!("edit_{}", steps.len() - 1)).as_deref());
    lit["inputs"]["scene"] = "faded".into();
    let more = json!({
        "off": { "type": "material", "params": { "materials": ["panel"], "emission": [0, 0, 0] }, "inputs": { "scene": "room" } },
        "faded": { "type": "light", "params": { "name": "key", "intensity": intensity }, "inputs": { "scene": "off" } },
        "lit": lit,
    });
    let light = layer(&image(evaluator, &listed(steps, more), "lit"), "indirect");
    assert!(light.iter().all(|x| x.is_finite()), "not finite at {strength}");
    light
}

fn fading() -> Vec<Vec<Step>> {
    let red = json!({ "caster": "red" });
    let curve = |curve: Json, inputs: &Json| -> Vec<Step> {
        vec![("caster_receiver", json!({ "curve": curve }), inputs.clone())]
    };
    vec![
        curve(json!({ "gamma": { "gamma": 2.0, "pivot": 0.3 } }), &json!({})),
        curve(json!({ "gamma": { "gamma": 10.0, "pivot": 0.3 } }), &red),
        curve(json!({ "gamma": { "gamma": 0.3, "pivot": 0.3 } }), &red),
        curve(json!({ "points": [[0.0, 0.2], [1.0, 1.0]] }), &red),
        curve(json!({ "points": [[0.2, 0.9], [1.0, 0.1]] }), &json!({})),
        vec![("caster_receiver", json!({ "saturation": 3.0, "hue": 100.0 }), red.clone())],
        stack().into_iter().skip(1).collect(),
    ]
}

/// However a list lifts the dark, light that goes to nothing takes its picture with it.
#[test]
fn a_light_that_fades_to_nothing_fades_to_nothing() {
    let evaluator = evaluator();
    let largest = |light: &[f32]| light.iter().fold(0.0f32, |a, b| a.max(b.abs()));
    for steps in fading() {
        let sizes: Vec<f32> = (0..14).map(|k| largest(&faded(&evaluator, 10f64.powi(-2 * k), &steps))).collect();
        let what = format!("{steps:?}: {sizes:?}");
        // 1e-26 of a light: below where gains are looked for at all.
        assert!(sizes[0] > 0.01 && sizes[13] <= 1e-12 * sizes[0], "{what}");
        let linear = |pair: &[f32]| pair[1] <= 0.02 * pair[0] || pair[0] < 1e-18;
        assert!(sizes.windows(2).skip(6).all(linear), "in the end linear: {what}");
        assert_eq!(largest(&faded(&evaluator, 0.0, &steps)), 0.0, "{what}");
    }
}

/// Curves that lift black rise steeply by nature; those are above.
#[test]
fn no_pixel_jumps_while_a_light_fades() {
    let evaluator = evaluator();
    let lists = fading();
    for (list, bound) in [(0, 0.01), (2, 0.07), (5, 0.01), (6, 0.12)] {
        let (steps, count) = (&lists[list], 24);
        // Even steps of a square: fine near zero.
        let strength = |i: usize| (i as f64 / count as f64).powi(2);
        let sweep: Vec<Vec<f32>> = (0..=count).map(|i| faded(&evaluator, strength(i), steps)).collect();
        let largest = sweep.iter().flatten().fold(0.0f32, |a, b| a.max(b.abs()));
        let bend = |i: usize, c: usize| (sweep[i - 1][c] - 2.0 * sweep[i][c] + sweep[i + 1][c]).abs();
        let worst = (1..count).flat_map(|i| (0..sweep[0].len()).map(move |c| bend(i, c))).fold(0.0, f32::max);
        println!("{steps:?}: {:.4}", worst / largest);
        assert!(worst <= bound * largest, "{steps:?}: {worst} of {largest}");
    }
}
