//! What does not change from frame to frame is not computed again.

use super::*;
use chiaro::eval::CacheUse;
use std::collections::BTreeMap;

fn recipe(stage: &Stage) -> Plan {
    stage.plan(json!({
        "room": { "type": "scene", "params": { "file": "room.glb" } },
        "view": { "type": "view_samples", "params": { "width": 16, "height": 12 }, "inputs": { "scene": "room" } },
        "xfer": { "type": "transfer", "params": { "gather_samples": 64, "tolerance": 0.5 },
                  "inputs": { "scene": "room", "samples": "view" } },
        "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer" } },
    }))
}

/// What each node did at a second frame, after a first; nothing: nobody asked it.
fn second(glb: &Glb, frames: [i64; 2]) -> BTreeMap<String, CacheUse> {
    let stage = Stage::new(glb);
    let plan = recipe(&stage);
    let (_, report) = stage.run(&plan, "lit", frames[0]).unwrap();
    assert!(report.iter().all(|node| node.cache == CacheUse::Computed));
    let (_, report) = stage.run(&plan, "lit", frames[1]).unwrap();
    report.into_iter().map(|node| (node.node, node.cache)).collect()
}

#[test]
fn only_what_a_frame_changes_is_computed() {
    use CacheUse::{Computed, Memory};
    let slide = |node: usize| {
        let from = [[0.0, 0.0, 0.0], [0.0, 2.0, -2.0], [0.0, 1.5, 4.0], [0.0, 3.5, 1.0]][node];
        let to = [from[0] + 0.25, from[1], from[2]];
        Glb::room().animate("slide", node, "translation", 3, &[0.0, 1.0], &[from, to].concat())
    };
    let all = |uses: [Option<CacheUse>; 4]| -> BTreeMap<String, CacheUse> {
        let named = ["room", "view", "xfer", "lit"].into_iter().zip(uses);
        named.filter_map(|(name, what)| Some((name.to_owned(), what?))).collect()
    };
    let (new, old) = (Some(Computed), Some(Memory));
    let (wall, camera, lamp) = (slide(1), slide(2), slide(3));
    assert_eq!(second(&lamp, [1, 2]), all([new, None, old, new]), "a lamp moves");
    assert_eq!(second(&camera, [1, 2]), all([new, new, new, new]), "the camera moves");
    assert_eq!(second(&wall, [1, 2]), all([new, new, new, new]), "an object moves");
    // It is over: the last key holds.
    for glb in [&wall, &camera, &lamp] {
        assert_eq!(second(glb, [24, 30]), all([None, None, None, old]));
    }
    assert_eq!(second(&Glb::room(), [1, 2]), all([None, None, None, old]), "nothing moves");
}

/// A curve may turn time itself: it counts by the moment that it leads to.
#[test]
fn time_that_stands_still_is_no_change() {
    let glb = Glb::room().animate("slide", 1, "translation", 3, &[0.0, 1.0], &[0.0, 2.0, -2.0, 0.25, 2.0, -1.5]);
    let stage = Stage::new(&glb);
    // Frames 1 to 10 all show the file at frame 12, later ones go on.
    let offset = json!({ "keys": [[1, 11], [10, 2]] });
    let plan = stage.plan(json!({
        "room": { "type": "scene", "params": { "file": "room.glb", "offset": offset } },
        "view": { "type": "view_samples", "params": { "width": 16, "height": 12 }, "inputs": { "scene": "room" } },
    }));
    let uses = |frame: i64| {
        let (_, report) = stage.run(&plan, "view", frame).unwrap();
        report.iter().map(|node| node.cache).collect::<Vec<_>>()
    };
    assert_eq!(uses(1), [CacheUse::Computed; 2]);
    for frame in [4, 10] {
        assert_eq!(uses(frame), [CacheUse::Memory], "frame {frame}");
    }
    assert_eq!(uses(11), [CacheUse::Computed; 2]);
}

/// Rays in all, rays kept from the frame before, rows found, and the picture, at a frame.
fn lit(stage: &Stage, plan: &Plan, frame: i64) -> ([u64; 3], Vec<u32>) {
    let (value, report) = stage.run(plan, "lit", frame).unwrap();
    let Value::Image(image) = value else { panic!("a picture") };
    let transfer = report.iter().find(|node| node.node == "xfer").unwrap();
    let note = |name: &str| transfer.notes.get(name).map_or(0, |value| value.as_u64().unwrap());
    (["rays", "rays_kept", "rows_found"].map(note), bits(&image))
}

fn bits(image: &Image) -> Vec<u32> {
    image.layers.iter().flat_map(|layer| layer.data.iter().map(|x| x.to_bits())).collect()
}

/// Most rays meet what they met before; light is that of a fresh start, bit by bit.
#[test]
fn rays_are_cast_anew_only_as_far_as_something_moved() {
    let slide = Glb::room().animate("slide", 1, "translation", 3, &[0.0, 1.0], &[0.0, 2.0, -2.0, 0.25, 2.0, -1.5]);
    let turn = std::f32::consts::FRAC_1_SQRT_2;
    let spin = Glb::room().animate("spin", 1, "rotation", 4, &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, turn, turn]);
    for (name, glb, basis) in [("slides", &slide, "cut"), ("spins", &spin, "cut"), ("slides", &slide, "haar")] {
        let recipe = |stage: &Stage| {
            stage.plan(json!({
                "room": { "type": "scene", "params": { "file": "room.glb" } },
                "view": { "type": "view_samples", "params": { "width": 48, "height": 36 }, "inputs": { "scene": "room" } },
                "xfer": { "type": "transfer",
                          "params": { "gather_samples": 1024, "tolerance": 0.1, "bounces": 2, "basis": basis },
                          "inputs": { "scene": "room", "samples": "view" } },
                "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer" } },
            }))
        };
        let stage = Stage::new(glb);
        let plan = recipe(&stage);
        let ([_, kept, _], first) = lit(&stage, &plan, 3);
        assert_eq!(kept, 0, "there was nothing before");
        for frame in [4, 20, 8] {
            let ([rays, kept, _], picture) = lit(&stage, &plan, frame);
            println!("the wall {name}, {basis}: {kept} of {rays} rays kept");
            assert!(5 * kept > rays && kept < rays, "{kept} of {rays}");
            assert_ne!(picture, first, "light changes");
            let fresh = Stage::new(glb);
            assert_eq!(lit(&fresh, &recipe(&fresh), frame).1, picture, "bit by bit what a fresh start gives");
        }
    }
}

/// Under a camera that moves, light goes on from surface to surface as it did.
#[test]
fn what_only_the_camera_changes_is_the_view() {
    let glb = Glb::room().animate("dolly", 2, "translation", 3, &[0.0, 1.0], &[0.0, 1.5, 4.0, 0.5, 1.5, 4.0]);
    let recipe = |stage: &Stage| {
        stage.plan(json!({
            "room": { "type": "scene", "params": { "file": "room.glb" } },
            "view": { "type": "view_samples", "params": { "width": 48, "height": 36 }, "inputs": { "scene": "room" } },
            "xfer": { "type": "transfer", "params": { "gather_samples": 1024, "tolerance": 0.1, "bounces": 2 },
                      "inputs": { "scene": "room", "samples": "view" } },
            "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer" } },
        }))
    };
    let stage = Stage::new(&glb);
    let plan = recipe(&stage);
    let ([all, ..], first) = lit(&stage, &plan, 3);
    let ([rays, _, found], picture) = lit(&stage, &plan, 9);
    assert!(rays < all && found == 1024, "{rays} of {all} rays, {found} rows found");
    assert_ne!(picture, first);
    let fresh = Stage::new(&glb);
    assert_eq!(lit(&fresh, &recipe(&fresh), 9).1, picture, "bit by bit what a fresh start gives");
}

/// The scene of a wall behind a floor, and a panel far to the side, which moves.
fn with_panel(moves: bool) -> Glb {
    let mut glb = Glb::room();
    let nodes = glb.json["nodes"].as_array_mut().unwrap();
    nodes.push(json!({ "name": "panel", "mesh": 0, "scale": [0.2, 1, 0.2], "translation": [6.0, 0.5, 0.0],
                       "rotation": [std::f32::consts::FRAC_1_SQRT_2, 0, 0, std::f32::consts::FRAC_1_SQRT_2] }));
    glb.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    let to = if moves { 0.9 } else { 0.5 };
    glb.animate("lift", 4, "translation", 3, &[0.0, 1.0], &[6.0, 0.5, 0.0, 6.0, to, 0.0])
}

/// Tiles found and computed, and the picture, at a frame.
fn shaded(stage: &Stage, plan: &Plan, frame: i64) -> ([u64; 2], Vec<u32>) {
    let (value, report) = stage.run(plan, "lit", frame).unwrap();
    let Value::Image(image) = value else { panic!("a picture") };
    let seen = report.iter().find(|node| node.node == "seen").unwrap();
    let tiles = ["tiles_found", "tiles_computed"].map(|name| seen.notes[name].as_u64().unwrap());
    (tiles, bits(&image))
}

/// A panel to the side moves: only faces that look that way are drawn again, and the picture is that of a fresh start.
#[test]
fn what_an_object_hides_is_drawn_again_only_where_it_is_seen() {
    let recipe = |stage: &Stage, groups: Json| {
        stage.plan(json!({
            "room": { "type": "scene", "params": { "file": "room.glb" } },
            "view": { "type": "view_samples", "params": { "width": 160, "height": 102 }, "inputs": { "scene": "room" } },
            "sky": { "type": "environment", "params": { "file": "builtin:sky", "face_size": 128 } },
            "seen": { "type": "visibility", "params": { "face_size": 128, "groups": groups },
                      "inputs": { "scene": "room", "samples": "view", "environment": "sky" } },
            "light": { "type": "transport", "inputs": { "scene": "room", "samples": "view", "environment": "sky" } },
            "lit": { "type": "integrate", "inputs": { "visibility": "seen", "transport": "light", "samples": "view" } },
        }))
    };
    for groups in [json!({}), json!({ "panel": ["panel"] })] {
        let stage = Stage::new(&with_panel(true));
        let plan = recipe(&stage, groups.clone());
        let ([found, all], first) = shaded(&stage, &plan, 3);
        assert!(found == 0 && all >= 5, "{found} {all}");
        let ([found, drawn], second) = shaded(&stage, &plan, 20);
        println!("groups {groups}: {drawn} of {all} tiles drawn again");
        assert!(found + drawn == all && 0 < drawn && 2 * drawn <= all, "{found} found, {drawn} drawn");
        assert_ne!(first, second, "its shadow moves");
        let fresh = Stage::new(&with_panel(true));
        assert_eq!(shaded(&fresh, &recipe(&fresh, groups), 20).1, second, "bit by bit what a fresh start gives");
    }
}
