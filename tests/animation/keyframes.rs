//! Edits sampled at keyframes: exact at their keys, blended between them, carried by surfaces, honest about what was hidden.

use super::*;
use std::sync::Arc;

const WALL: usize = 1;

/// The room with a third, moving thing: an upright panel of 1 x 1 m over the floor.
fn with_panel() -> Glb {
    let mut glb = Glb::room();
    let nodes = glb.json["nodes"].as_array_mut().unwrap();
    nodes.push(json!({ "name": "panel", "mesh": 0, "scale": [0.25, 1, 0.25], "translation": [-1.0, 1.0, 0.5],
                       "rotation": [std::f32::consts::FRAC_1_SQRT_2, 0, 0, std::f32::consts::FRAC_1_SQRT_2] }));
    glb.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    glb
}

const PANEL: usize = 4;

/// Nodes up to `a`, the edits that were sampled at the frame: more light from the floor to `to`.
fn nodes(to: &str, brightness: Json) -> Json {
    json!({
        "room": { "type": "scene", "params": { "file": "room.glb" } },
        "view": { "type": "view_samples", "params": { "width": 48, "height": 36 }, "inputs": { "scene": "room" } },
        "xfer": { "type": "transfer", "params": { "gather_samples": 256, "tolerance": 0.1 },
                  "inputs": { "scene": "room", "samples": "view" } },
        "floor": { "type": "pick", "params": { "objects": ["floor"] }, "inputs": { "scene": "room" } },
        "to": { "type": "pick", "params": { "objects": [to] }, "inputs": { "scene": "room" } },
        "bleed": { "type": "caster_receiver", "params": { "brightness": brightness },
                   "inputs": { "caster": "floor", "receiver": "to" } },
        "a": { "type": "scale_offset", "inputs": { "scene": "room", "transfer": "xfer", "edits": "bleed" } },
        "keyed": { "type": "keyframe_edits", "params": { "frames": [1, 21] },
                   "inputs": { "scene": "room", "transfer": "xfer", "a": "a", "b": "a" } },
        "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer", "edits": "keyed" } },
        "sampled": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer", "edits": "a" } },
        "direct": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer", "edits": "bleed" } },
        "plain": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer" } },
    })
}

fn picture(stage: &Stage, plan: &Plan, node: &str, frame: i64) -> Arc<Image> {
    match stage.value(plan, node, frame) {
        Value::Image(image) => image,
        other => panic!("{:?}", other.kind()),
    }
}

fn indirect(stage: &Stage, plan: &Plan, node: &str, frame: i64) -> Vec<f32> {
    picture(stage, plan, node, frame).layer("indirect").unwrap().data.to_vec()
}

/// Root of the mean squared difference over the mean of the second.
fn off(a: &[f32], b: &[f32]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    let mean = b.iter().map(|b| f64::from(*b)).sum::<f64>() / b.len() as f64;
    (squares / b.len() as f64).sqrt() / mean
}

fn note(stage: &Stage, plan: &Plan, frame: i64, name: &str) -> f64 {
    let (_, report) = stage.run(plan, "keyed", frame).unwrap();
    let keyed = report.iter().find(|node| node.node == "keyed").unwrap();
    keyed.notes[name].as_f64().unwrap_or_else(|| panic!("{name}: {:?}", keyed.notes))
}

fn slide(node: usize, from: [f32; 3], to: [f32; 3]) -> Glb {
    with_panel().animate("slide", node, "translation", 3, &[1.0 / 24.0, 21.0 / 24.0], &[from, to].concat())
}

#[test]
fn at_its_key_an_edit_is_what_was_sampled_there() {
    let stage = Stage::new(&slide(PANEL, [-1.0, 1.0, 0.5], [1.0, 1.5, 0.5]));
    let plan = stage.plan(nodes("panel", json!({ "keys": [[1, 1.5], [21, 4.0]] })));
    for frame in [1, 21] {
        assert_eq!(indirect(&stage, &plan, "lit", frame), indirect(&stage, &plan, "sampled", frame), "frame {frame}");
        assert_eq!(note(&stage, &plan, frame, "disoccluded"), 0.0);
    }
    assert!(off(&indirect(&stage, &plan, "lit", 1), &indirect(&stage, &plan, "plain", 1)) > 0.01, "it does something");
}

/// Of many keyframes only those before and after are sampled.
#[test]
fn keyframes_far_away_are_not_asked_for() {
    let stage = Stage::new(&slide(PANEL, [-1.0, 1.0, 0.5], [1.0, 1.5, 0.5]));
    let mut recipe = nodes("panel", json!(2.0));
    recipe["keyed"]["params"]["frames"] = json!([1, 9, 17, 21]);
    for port in ["b", "c", "d"] {
        recipe["keyed"]["inputs"][port] = json!("a");
    }
    let plan = stage.plan(recipe.clone());
    for (frame, sampled) in [(11, vec![9, 17]), (21, vec![21]), (30, vec![21]), (-3, vec![1])] {
        let fresh = Stage::new(&slide(PANEL, [-1.0, 1.0, 0.5], [1.0, 1.5, 0.5]));
        let (_, report) = fresh.run(&fresh.plan(recipe.clone()), "keyed", frame).unwrap();
        let mut frames: Vec<i64> = report.iter().filter(|node| node.node == "a").map(|node| node.frame).collect();
        frames.sort_unstable();
        assert_eq!(frames, sampled, "frame {frame}");
    }
    // One that is not connected is missed at all frames, also where it is not asked for.
    recipe["keyed"]["inputs"].as_object_mut().unwrap().remove("d");
    let error = stage.run(&stage.plan(recipe), "keyed", 2).unwrap_err();
    assert!(error.to_string().contains("frames names 4 keyframes, connected are: a, b, c"), "{error}");
    assert_eq!(note(&stage, &plan, 21, "disoccluded"), 0.0);
}

/// A held frame is the same whether it is computed alone or after its key: both have one key in the cache.
#[test]
fn held_frames_do_not_depend_on_what_was_computed_before() {
    let glb = with_panel();
    let mut all = nodes("wall", json!({ "keys": [[1, 1.5], [21, 4.0]] }));
    all["keyed"]["params"]["coefficients"] = json!(4);
    let (alone, after) = (Stage::new(&glb), Stage::new(&glb));
    let plan = after.plan(all.clone());
    indirect(&after, &plan, "lit", 21);
    let (first, second) = (indirect(&alone, &alone.plan(all), "lit", 24), indirect(&after, &plan, "lit", 24));
    assert_eq!(first, second);
}

/// Where all stands still, an edit that is linear in its parameter is the procedural edit at each frame.
#[test]
fn between_keys_edits_are_blended_by_time() {
    let stage = Stage::new(&with_panel());
    let keys = json!({ "keys": [[1, 1.0], [21, 5.0]] });
    for (pace, interpolation) in [("linear", "linear"), ("smooth", "smooth"), ("hold", "hold")] {
        let mut all = nodes("wall", keys.clone());
        all["bleed"]["params"]["brightness"]["interpolation"] = interpolation.into();
        all["keyed"]["params"]["interpolation"] = pace.into();
        let plan = stage.plan(all);
        for frame in [-4, 1, 6, 11, 20, 21, 50] {
            let (keyed, direct) = (indirect(&stage, &plan, "lit", frame), indirect(&stage, &plan, "direct", frame));
            let error = off(&keyed, &direct);
            assert!(error < 2e-3, "{pace}, frame {frame}: {error}");
        }
        let middle = off(&indirect(&stage, &plan, "lit", 11), &indirect(&stage, &plan, "plain", 11));
        assert_eq!(middle > 0.05, pace != "hold", "{pace}: {middle}");
    }
}

/// What was edited goes with its surface: here a panel that crosses the picture while the camera turns.
#[test]
fn edits_go_where_their_surfaces_go() {
    let glb = slide(PANEL, [-1.0, 1.0, 0.5], [1.0, 1.5, 0.5]).animate(
        "look",
        2,
        "translation",
        3,
        &[1.0 / 24.0, 21.0 / 24.0],
        &[0.0, 1.5, 4.0, 0.4, 1.7, 3.8],
    );
    let stage = Stage::new(&glb);
    let plan = stage.plan(nodes("panel", json!(6.0)));
    for frame in [1, 5, 11, 18, 21, 30] {
        let [keyed, direct, plain] = ["lit", "direct", "plain"].map(|node| indirect(&stage, &plan, node, frame));
        let (error, effect) = (off(&keyed, &direct), off(&plain, &direct));
        println!("frame {frame}: {:.2} % of an effect of {:.1} %", 100.0 * error, 100.0 * effect);
        assert!(effect > 0.03, "frame {frame}: {effect}");
        assert!(error < 0.05 * effect, "frame {frame}: {error} of {effect}");
    }
}

/// The middle of the wall is behind the panel at both keys; at the frame between the panel is gone.
#[test]
fn what_no_key_saw_is_filled_and_counted() {
    let times = [1.0, 11.0, 21.0].map(|frame: f32| frame / 24.0);
    let front = [0.0, 1.5, 2.5];
    let away = [0.0, 30.0, 2.5];
    let glb = with_panel().animate("lift", PANEL, "translation", 3, &times, &[front, away, front].concat());
    let stage = Stage::new(&glb);
    let plan = stage.plan(nodes("wall", json!(4.0)));
    let depth = |frame: i64| picture(&stage, &plan, "plain", frame).layer("Z").unwrap().data.to_vec();
    let (then, now) = (depth(1), depth(11));
    let is_panel = |z: f32| (1.0..2.0).contains(&z);
    let is_there = |z: f32| z > 0.0 && z.is_finite();
    assert!(!now.iter().any(|z| is_panel(*z)));
    let uncovered = then.iter().zip(&now).filter(|(then, now)| is_panel(**then) && is_there(**now)).count() as f64;
    let there = now.iter().filter(|z| is_there(**z)).count() as f64;
    let share = note(&stage, &plan, 11, "disoccluded");
    println!("{:.0} samples are disoccluded, the panel was before {uncovered} of {there}", share * there);
    // All but those at the border, for which the seen neighbours are near enough.
    assert!(share * there <= uncovered && share * there > 0.8 * uncovered);
    // Filled in, not left out: the wall is edited all over.
    let [keyed, direct, plain] = ["lit", "direct", "plain"].map(|node| indirect(&stage, &plan, node, 11));
    let (error, effect) = (off(&keyed, &direct), off(&plain, &direct));
    assert!(error < 0.02 * effect, "{error} of {effect}");
    let never = AtomicBool::new(false);
    let context = Context { cancel: &never, ..Context::SILENT };
    let values =
        stage.evaluator.evaluate(&plan, &[plan.find("keyed").unwrap()], 11, &context, &mut Vec::new()).unwrap();
    let Value::Image(filled) = &values[0][1] else { panic!("a picture") };
    let sum: f32 = filled.layers[0].data.iter().sum::<f32>() / filled.layers[0].data.len() as f32;
    let shown = f64::from(sum) * (48.0 * 36.0) / there;
    assert!((shown / share - 1.0).abs() < 0.02, "the picture shows {shown}, the report says {share}");
}

/// Another size of picture, and keys in any part of it (figure 5.4).
#[test]
fn keys_of_another_resolution_are_carried_too() {
    let stage = Stage::new(&slide(WALL, [0.0, 2.0, -2.0], [0.5, 2.0, -2.0]));
    let mut all = nodes("wall", json!(3.0));
    all["fine"] =
        json!({ "type": "view_samples", "params": { "width": 80, "height": 60 }, "inputs": { "scene": "room" } });
    all["fine_xfer"] = all["xfer"].clone();
    all["fine_xfer"]["inputs"]["samples"] = "fine".into();
    for node in ["keyed", "lit", "direct", "plain"] {
        all[node]["inputs"]["transfer"] = "fine_xfer".into();
    }
    let plan = stage.plan(all);
    for frame in [1, 10, 21] {
        let [keyed, direct, plain] = ["lit", "direct", "plain"].map(|node| indirect(&stage, &plan, node, frame));
        let (error, effect) = (off(&keyed, &direct), off(&plain, &direct));
        assert!(effect > 0.2 && error < 0.05 * effect, "frame {frame}: {error} of {effect}");
    }
}

/// Brushes at the eye and at the source (eq. 5.5) are carried as vectors.
#[test]
fn vectors_are_carried_with_rows() {
    let stage = Stage::new(&slide(PANEL, [-1.0, 1.0, 0.5], [1.0, 1.5, 0.5]));
    let grow = |low: f64, high: f64| json!({ "keys": [[1, low], [21, high]] });
    let mut all = nodes("panel", json!(2.0));
    all["eye"] = json!({ "type": "illumination_brush", "params": { "scale": grow(1.0, 3.0) },
                         "inputs": { "selection": "to", "edits": "bleed" } });
    all["both"] = json!({ "type": "source_brush", "params": { "scale": grow(2.0, 0.5) },
                          "inputs": { "selection": "floor", "edits": "eye" } });
    for node in ["a", "direct"] {
        all[node]["inputs"]["edits"] = "both".into();
    }
    let plan = stage.plan(all);
    for frame in [1, 8, 21] {
        let [keyed, direct, plain] = ["lit", "direct", "plain"].map(|node| indirect(&stage, &plan, node, frame));
        let (error, effect) = (off(&keyed, &direct), off(&plain, &direct));
        println!("frame {frame}: {:.2} % of an effect of {:.1} %", 100.0 * error, 100.0 * effect);
        // The product of two blends is not the blend of the products.
        assert!(effect > 0.2 && error < 0.15 * effect, "frame {frame}: {error} of {effect}");
    }
}

/// Edits that were sampled at more gather samples, or at fewer, are nearly the same.
#[test]
fn other_gather_samples_take_from_the_nearest() {
    let stage = Stage::new(&slide(PANEL, [-1.0, 1.0, 0.5], [1.0, 1.5, 0.5]));
    // From a patch of the floor whose weight falls off.
    let patch = json!({ "type": "paint", "inputs": { "scene": "room" }, "params": {
        "strokes": [{ "points": [[-1.0, 0.0, 0.5], [0.0, 0.0, 0.8]], "radius": 1.2, "hardness": 0.3 }],
    } });
    let nodes = || {
        let mut all = nodes("panel", json!(3.0));
        all["floor"] = patch.clone();
        all
    };
    let plain = stage.plan(nodes());
    let expected = indirect(&stage, &plain, "lit", 11);
    let does = off(&indirect(&stage, &plain, "plain", 11), &expected);
    for count in [128, 256, 1024] {
        let mut all = nodes();
        all["other"] = all["xfer"].clone();
        all["other"]["params"]["gather_samples"] = json!(count);
        all["a"]["inputs"]["transfer"] = json!("other");
        let plan = stage.plan(all);
        let error = off(&indirect(&stage, &plan, "lit", 11), &expected);
        println!("{count} gather samples for 256: off by {error:.4}; the edit itself: {does:.4}");
        assert!(error < 0.05 * does, "{count}: {error} of {does}");
        let (_, report) = stage.run(&plan, "keyed", 11).unwrap();
        let keyed = report.iter().find(|node| node.node == "keyed").unwrap();
        let told = keyed.notes.get("keyframes_of_other_gather_samples");
        assert_eq!(told, (count != 256).then(|| json!([1, 21])).as_ref());
    }
}

/// Light that is added where something stood in its way comes from as much area, however many samples stand for it.
#[test]
fn what_is_added_goes_with_the_area_of_samples() {
    let stage = Stage::new(&slide(PANEL, [-1.0, 1.0, 0.5], [1.0, 1.5, 0.5]));
    let nodes = || {
        let mut all = nodes("wall", json!(1.0));
        all["bleed"] = json!({ "type": "indirect_shadow", "params": { "amount": 1.0 },
                               "inputs": { "caster": "floor", "receiver": "to" } });
        all
    };
    let plan = stage.plan(nodes());
    let expected = indirect(&stage, &plan, "lit", 11);
    let does = off(&indirect(&stage, &plan, "plain", 11), &expected);
    assert!(does > 0.005, "{does}");
    for count in [64, 1024] {
        let mut all = nodes();
        all["other"] = all["xfer"].clone();
        all["other"]["params"]["gather_samples"] = json!(count);
        all["a"]["inputs"]["transfer"] = json!("other");
        let error = off(&indirect(&stage, &stage.plan(all), "lit", 11), &expected);
        println!("added light, {count} gather samples for 256: off by {error:.4}; the edit itself: {does:.4}");
        assert!(error < 0.3 * does, "{count}: {error} of {does}");
    }
}

/// A camera that sinks comes to see the underside of the floor: light is gathered from there, too.
#[test]
fn a_camera_may_come_to_see_other_sides() {
    let mut glb = with_panel();
    let cellar = json!({ "name": "cellar", "mesh": 0, "scale": [0.25, 1, 0.25], "translation": [0, -0.4, 0] });
    glb.json["nodes"].as_array_mut().unwrap().push(cellar);
    glb.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4, 5]);
    // Lit on the side of the wall.
    glb.json["nodes"][PANEL]["translation"] = json!([-1.0, 1.0, 1.6]);
    let way = [[0.0, 1.5, 4.0], [0.0, -0.3, 6.0]].concat();
    let stage = Stage::new(&glb.animate("sink", 2, "translation", 3, &[1.0 / 24.0, 21.0 / 24.0], &way));
    let mut all = nodes("wall", json!(3.0));
    all["floor"]["params"]["objects"] = json!(["panel"]);
    all["keyed"]["params"]["frames"] = json!([1]);
    all["keyed"]["inputs"].as_object_mut().unwrap().remove("b");
    let plan = stage.plan(all);
    let (_, report) = stage.run(&plan, "keyed", 21).unwrap();
    let keyed = report.iter().find(|node| node.node == "keyed").unwrap();
    assert_eq!(keyed.notes["keyframes_of_other_gather_samples"], json!([1]), "{:?}", keyed.notes);
    let [carried, direct, plain] = ["lit", "direct", "plain"].map(|node| indirect(&stage, &plan, node, 21));
    let (error, does) = (off(&carried, &direct), off(&plain, &direct));
    assert!(does > 0.01 && error < 0.1 * does, "{error} of {does}");
}

#[test]
fn what_does_not_fit_is_said() {
    let stage = Stage::new(&with_panel());
    let refused = |change: &dyn Fn(&mut Json)| {
        let mut all = nodes("panel", json!(2.0));
        change(&mut all);
        let plan = stage.plan(all);
        let error = stage.run(&plan, "lit", 7).unwrap_err();
        assert_eq!(error.exit_code(), 1, "{error}");
        error.to_string()
    };
    assert!(
        refused(&|all| all["keyed"]["params"]["frames"] = json!([1]))
            .contains("names 1 keyframes, connected are: a, b")
    );
    assert!(refused(&|all| all["keyed"]["params"]["frames"] = json!([5, 5])).contains("keyframe 5 follows 5"));
    assert!(refused(&|all| all["keyed"]["inputs"]["b"] = json!("bleed")).contains("one sampled edit"));
    let scene = |all: &mut Json| {
        all["hall"] = json!({ "type": "scene", "params": { "file": "builtin:room" } });
        all["hall_view"] =
            json!({ "type": "view_samples", "params": { "width": 8, "height": 6 }, "inputs": { "scene": "hall" } });
        all["hall_xfer"] = all["xfer"].clone();
        all["hall_xfer"]["inputs"] = json!({ "scene": "hall", "samples": "hall_view" });
        all["some"] = json!({ "type": "caster_receiver", "params": { "brightness": 2.0 } });
        all["a"]["inputs"] = json!({ "scene": "hall", "transfer": "hall_xfer", "edits": "some" });
    };
    assert!(refused(&scene).contains("another scene"));
}
