//! Where things are at a frame, by hand.

use super::*;
use chiaro::scene::{LightKind, Scene};
use glam::{Quat, Vec3};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
use std::sync::Arc;

const FLOOR: usize = 0;
const WALL: usize = 1;
const EYE: usize = 2;
const LAMP: usize = 3;

fn scene(glb: &Glb, params: Json, frame: i64) -> chiaro::Result<(Arc<Scene>, NodeReport)> {
    let stage = Stage::new(glb);
    let mut all = json!({ "file": "room.glb" });
    all.as_object_mut().unwrap().extend(params.as_object().unwrap().clone());
    let plan = stage.plan(json!({ "room": { "type": "scene", "params": all } }));
    let (value, mut report) = stage.run(&plan, "room", frame)?;
    let Value::Scene(scene) = value else { panic!("a scene") };
    Ok((scene, report.swap_remove(0)))
}

/// Lowest and highest corner of an object.
fn bounds(scene: &Scene, name: &str) -> [Vec3; 2] {
    let number = scene.geometry.objects.iter().position(|object| object == name).unwrap() as u32;
    let of_object =
        scene.geometry.corners.iter().zip(&scene.geometry.object[..]).filter(|(_, object)| **object == number);
    let corners = of_object.flat_map(|(corners, _)| corners.map(Vec3::from));
    corners.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
}

fn near(a: Vec3, b: [f32; 3]) {
    assert!(a.distance(b.into()) < 1e-5, "{a} instead of {b:?}");
}

#[test]
fn nodes_lights_and_cameras_move_with_the_frame() {
    let turn = Quat::from_rotation_y(FRAC_PI_2).to_array();
    let glb = Glb::room()
        .animate("slide", WALL, "translation", 3, &[0.5, 1.0], &[0.0, 2.0, -2.0, 1.0, 2.0, -2.0])
        .animate("grow", FLOOR, "scale", 3, &[0.0, 1.0], &[1.0, 1.0, 1.0, 3.0, 1.0, 1.0])
        .animate("lamp", LAMP, "translation", 3, &[0.0, 1.0], &[0.0, 3.0, 0.0, 0.0, 1.0, 0.0])
        .animate("look", EYE, "rotation", 4, &[0.0, 1.0], &[[0.0, 0.0, 0.0, 1.0], turn].concat());
    for (frame, slid, grown, down, turned) in [
        (-3, 0.0, 1.0, 3.0, 0.0),
        (0, 0.0, 1.0, 3.0, 0.0),
        (12, 0.0, 2.0, 2.0, FRAC_PI_4),
        (18, 0.5, 2.5, 1.5, 0.75 * FRAC_PI_2),
        (24, 1.0, 3.0, 1.0, FRAC_PI_2),
        (99, 1.0, 3.0, 1.0, FRAC_PI_2),
    ] {
        let (scene, report) = scene(&glb, json!({}), frame).unwrap();
        let [low, high] = bounds(&scene, "wall");
        near(low, [slid - 2.0, 0.0, -2.0]);
        near(high, [slid + 2.0, 4.0, -2.0]);
        near(bounds(&scene, "floor")[1], [2.0 * grown, 0.0, 2.0]);
        let LightKind::Spot { position, direction, .. } = scene.lights[0].kind else { panic!("a spot") };
        near(position, [0.0, down, 0.0]);
        near(direction, [0.0, -1.0, 0.0]);
        let forward = -scene.cameras[0].world_from_camera.z_axis;
        near(forward, [-turned.sin(), 0.0, -turned.cos()]);
        assert_eq!(report.notes["animations"], json!(["slide", "grow", "lamp", "look"]));
        let time = (frame as f64 / 24.0).clamp(0.0, 1.0);
        assert!((report.notes["time"].as_f64().unwrap() - time).abs() < 1e-6);
    }
}

#[test]
fn time_is_the_recipes_to_bend() {
    let glb = Glb::room().animate("slide", WALL, "translation", 3, &[0.0, 1.0], &[0.0, 2.0, -2.0, 1.0, 2.0, -2.0]);
    let place = |params: Json, frame: i64| bounds(&scene(&glb, params, frame).unwrap().0, "wall")[0].x + 2.0;
    let close = |found: f32, expected: f32| assert!((found - expected).abs() < 1e-5, "{found} instead of {expected}");
    close(place(json!({}), 6), 0.25);
    close(place(json!({ "fps": 12 }), 6), 0.5);
    close(place(json!({ "offset": 6.0 }), 6), 0.5);
    close(place(json!({ "offset": 36.0, "repeat": true }), 6), 0.75);
    close(place(json!({ "offset": 36.0 }), 6), 1.0);
    // Backwards: the curve goes down twice as fast as frames go up.
    close(place(json!({ "offset": { "keys": [[0, 24], [24, -24]] } }), 6), 0.75);
    close(place(json!({ "scale": 2.0 }), 12), 2.0 * -1.5 + 2.0);
}

#[test]
fn of_animations_that_move_the_same_the_first_is_played_or_those_that_are_named() {
    let slide = |to: f32| [0.0, 2.0, -2.0, to, 2.0, -2.0];
    let glb = Glb::room()
        .animate("walk", WALL, "translation", 3, &[0.0, 1.0], &slide(1.0))
        .animate("run", WALL, "translation", 3, &[0.0, 1.0], &slide(8.0))
        .animate("lamp", LAMP, "translation", 3, &[0.0, 1.0], &slide(0.5));
    let place = |params: Json| {
        let (scene, report) = scene(&glb, params, 24).unwrap();
        (bounds(&scene, "wall")[0].x + 2.0, report.notes)
    };
    let (x, notes) = place(json!({}));
    assert_eq!(
        (x, &notes["animations"], &notes["animations_left_out"]),
        (1.0, &json!(["walk", "lamp"]), &json!(["run"]))
    );
    let (x, notes) = place(json!({ "animations": ["r*"] }));
    assert_eq!((x, &notes["animations"], notes.get("animations_left_out")), (8.0, &json!(["run"]), None));
    let error = scene(&glb, json!({ "animations": ["runn"] }), 1).unwrap_err();
    assert!(error.to_string().contains("no animation of the scene is called \"runn\""), "{error}");
    let error = scene(&Glb::room(), json!({ "animations": ["walk"] }), 1).unwrap_err();
    assert!(error.to_string().contains("holds no animation"), "{error}");
}

#[test]
fn morph_targets_bend_a_mesh_by_their_weights() {
    let mut glb = Glb::room();
    let up = glb.floats(3, &[[0.0, 1.0, 0.0]; 4].concat());
    let corner = glb.floats(3, &[3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    glb.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": up }, { "POSITION": corner }]);
    glb.json["meshes"][0]["weights"] = json!([0.5, 0.0]);
    let glb = glb.animate("bend", FLOOR, "weights", 2, &[0.0, 1.0], &[0.0, 0.0, 2.0, 1.0]);
    for (frame, height, corner) in [(0, 0.0, -2.0), (12, 1.0, -0.5), (24, 2.0, 1.0)] {
        let (scene, _) = scene(&glb, json!({}), frame).unwrap();
        let [low, high] = bounds(&scene, "floor");
        assert!((low.y - height).abs() < 1e-5 && (high.y - height).abs() < 1e-5, "{low} {high}");
        let first = Vec3::from(scene.geometry.corners[0][0]);
        near(first, [corner, height, 2.0]);
        // The wall has the same mesh: of it the weights stand still, at those of the mesh.
        let [low, high] = bounds(&scene, "wall");
        near(low, [-2.0, 0.0, -1.5]);
        near(high, [2.0, 4.0, -1.5]);
    }
}

#[test]
fn skins_carry_vertices_with_their_joints() {
    let mut glb = Glb::room();
    // The floor's corners 0 and 3 (x = -2) follow one joint, corner 2 the other, corner 1 both.
    let joints = glb.joints(&[[0, 1, 0, 0]; 4]);
    let weights = glb
        .floats(4, &[[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]].concat());
    let mut attributes = glb.json["meshes"][0]["primitives"][0].clone();
    attributes["attributes"]["JOINTS_0"] = joints.into();
    attributes["attributes"]["WEIGHTS_0"] = weights.into();
    glb.json["meshes"].as_array_mut().unwrap().push(json!({ "primitives": [attributes] }));
    // The second joint rests at (2, 0, 0): its matrix goes from the mesh to the joint.
    let mut matrices = [[0.0f32; 16]; 2];
    for (matrix, x) in matrices.iter_mut().zip([0.0, -2.0]) {
        (0..4).for_each(|i| matrix[5 * i] = 1.0);
        matrix[12] = x;
    }
    let inverse = glb.floats(16, &matrices.concat());
    glb.json["skins"] = json!([{ "joints": [4, 5], "inverseBindMatrices": inverse }]);
    let nodes = glb.json["nodes"].as_array_mut().unwrap();
    // What the node of a skinned mesh says of its place is not asked.
    nodes[FLOOR] = json!({ "name": "floor", "mesh": 1, "skin": 0, "translation": [50, 50, 50] });
    nodes.push(json!({ "name": "a" }));
    nodes.push(json!({ "name": "b", "translation": [2, 0, 0] }));
    glb.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4, 5]);
    let turn = Quat::from_rotation_z(FRAC_PI_2).to_array();
    let glb = glb.animate("lift", 5, "rotation", 4, &[0.0, 1.0], &[[0.0, 0.0, 0.0, 1.0], turn].concat()).animate(
        "slide",
        4,
        "translation",
        3,
        &[0.0, 1.0],
        &[0.0, 0.0, 0.0, -4.0, 0.0, 0.0],
    );
    let corners = |frame: i64| {
        let (scene, _) = scene(&glb, json!({}), frame).unwrap();
        let [[a, b, c], [_, _, d]] = [scene.geometry.corners[0], scene.geometry.corners[1]];
        [a, b, c, d].map(Vec3::from)
    };
    let rest = [[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]];
    corners(0).into_iter().zip(rest).for_each(|(found, expected)| near(found, expected));
    let [a, b, c, d] = corners(24);
    near(a, [-6.0, 0.0, 2.0]);
    near(b, [0.0, 0.0, 2.0]);
    near(c, [2.0, 0.0, -2.0]);
    near(d, [-6.0, 0.0, -2.0]);
}

/// Colours and lenses may be animated, too: such channels are counted, and all else moves.
#[test]
fn channels_of_other_things_are_left_out() {
    let slide = || Glb::room().animate("a", WALL, "translation", 3, &[0.0, 1.0], &[0.0, 2.0, -1.5, 1.0, 2.0, -1.5]);
    for other in [json!({ "path": "pointer" }), json!({ "path": "colour", "node": 0 }), json!({})] {
        let mut glb = slide();
        let channel = json!({ "sampler": 0, "target": other });
        glb.json["animations"][0]["channels"].as_array_mut().unwrap().insert(0, channel.clone());
        let (found, report) = scene(&glb, json!({}), 24).unwrap();
        assert_eq!(report.notes["animated_otherwise_left_out"], json!(1));
        let [low, _] = bounds(&found, "wall");
        assert!((low.x - -1.0).abs() < 1e-5, "{low}");
        glb.json["animations"][0]["channels"] = json!([channel]);
        let (still, report) = scene(&glb, json!({}), 24).unwrap();
        assert_eq!(report.notes["animated_otherwise_left_out"], json!(1));
        assert!(still.geometry.poses.is_empty());
    }
}

/// A faulty animation is in the way of nobody who does not play it.
#[test]
fn only_what_is_played_must_make_sense() {
    let glb = Glb::room()
        .animate("good", WALL, "translation", 3, &[0.0, 1.0], &[0.0, 2.0, -1.5, 1.0, 2.0, -1.5])
        .animate("bad", FLOOR, "translation", 3, &[1.0, 0.5], &[0.0; 6]);
    let error = scene(&glb, json!({}), 24).unwrap_err();
    assert!(error.to_string().contains("animation \"bad\"") && error.help().contains("`animations`"), "{error}");
    let (found, _) = scene(&glb, json!({ "animations": ["good"] }), 24).unwrap();
    assert!((bounds(&found, "wall")[0].x - -1.0).abs() < 1e-5);
}

/// At some of the times that stand for all of an animation nothing may be there.
#[test]
fn surfaces_may_vanish_for_a_while() {
    let mut glb = Glb::room();
    glb.json["scenes"][0]["nodes"] = json!([WALL, 2, 3]);
    let sizes = [[0.0; 3], [0.0; 3], [1.0; 3]].concat();
    let glb = glb.animate("grow", WALL, "scale", 3, &[0.0, 0.5, 1.0], &sizes);
    let (found, _) = scene(&glb, json!({}), 24).unwrap();
    assert!(!found.geometry.poses.is_empty() && found.geometry.poses.len() < 8);
    let error = scene(&glb, json!({}), 6).unwrap_err();
    assert!(error.to_string().contains("no triangle with an area"), "{error}");
}

#[test]
fn what_makes_no_sense_is_said() {
    let still = |times: &[f32], values: &[f32]| Glb::room().animate("a", WALL, "translation", 3, times, values);
    let fault = |glb: &Glb| {
        let error = scene(glb, json!({}), 1).unwrap_err();
        assert_eq!(error.exit_code(), 3, "{error}");
        error.to_string()
    };
    let zeros = [0.0; 6];
    assert!(
        fault(&still(&[1.0, 0.5], &zeros)).contains("\"wall\" in animation \"a\" has key 1 at 0.5 s, after one at 1 s")
    );
    assert!(fault(&still(&[0.0, 1.0], &zeros[..3])).contains("3 numbers for 2 keys, expected 6"));
    assert!(fault(&still(&[0.0, 1.0], &[f32::NAN; 6])).contains("not finite"));
    assert!(fault(&still(&[0.0, 1.0], &[1e30; 6])).contains("farther out"));
    let wrong = still(&[0.0, 1.0], &zeros).set("/animations/0/channels/0/target/path", "rotation".into());
    assert!(fault(&wrong).contains("wrong type"));
    let target = |pointer: &str, value: Json| {
        fault(&still(&[0.0, 1.0], &zeros).set(&format!("/animations/0/channels/0/target/{pointer}"), value))
    };
    assert!(target("node", json!(99)).contains("animation 0 moves node 99 of 4"));
    let mut flat = Glb::room();
    (flat.json["nodes"][0]["scale"], flat.json["nodes"][1]["scale"]) = (json!([0, 0, 0]), json!([0, 0, 0]));
    assert!(fault(&flat).contains("no triangle with an area"));
}
