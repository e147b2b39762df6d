//! Paint that follows what it was painted on.

use super::*;
use chiaro::scene::{Geometry, SurfacePoint};
use chiaro::transport::Selection;
use glam::{Quat, Vec3};
use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

const WALL: usize = 1;

/// The wall slides to the side and turns to lie high over the floor.
fn moving() -> Glb {
    let turned = Quat::from_rotation_x(FRAC_PI_2);
    let times = [0.0, 1.0];
    Glb::room().animate("slide", WALL, "translation", 3, &times, &[0.0, 2.0, -2.0, 1.0, 6.0, 0.0]).animate(
        "turn",
        WALL,
        "rotation",
        4,
        &times,
        &[turned.to_array(), Quat::IDENTITY.to_array()].concat(),
    )
}

fn selection(stage: &Stage, strokes: Json, frame: i64) -> (Arc<Selection>, Arc<Geometry>, NodeReport) {
    let plan = stage.plan(json!({
        "room": { "type": "scene", "params": { "file": "room.glb" } },
        "paint": { "type": "paint", "params": { "strokes": strokes }, "inputs": { "scene": "room" } },
    }));
    let Value::Scene(scene) = stage.value(&plan, "room", frame) else { panic!("a scene") };
    let (value, mut report) = stage.run(&plan, "paint", frame).unwrap_or_else(|error| panic!("frame {frame}: {error}"));
    let Value::Selection(selection) = value else { panic!("a selection") };
    (selection, scene.geometry.clone(), report.pop().unwrap())
}

/// The same places of all surfaces, whatever becomes of them.
fn places(geometry: &Geometry) -> Vec<SurfacePoint> {
    let grid = |i: usize| (0.05 + 0.09 * (i % 10) as f32, 0.05 + 0.09 * (i / 10) as f32);
    let inside = (0..100).map(grid).filter(|(u, v)| u + v < 1.0).collect::<Vec<_>>();
    let triangles = 0..geometry.corners.len();
    triangles.flat_map(|t| inside.iter().map(move |(u, v)| geometry.surface_point(t, *u, *v, true))).collect()
}

fn stroke(attached: Option<i64>) -> Json {
    let mut stroke = json!({
        "points": [[-1.0, 1.0, -2.0], [0.5, 2.5, -2.0], [1.2, 0.8, -2.0]], "normals": [[0, 0, 1], [0, 0, 1], [0, 0, 1]],
        "radius": 0.6,
    });
    if let Some(frame) = attached {
        stroke["attached"] = json!({ "object": "wall", "frame": frame });
    }
    json!([stroke])
}

#[test]
fn attached_strokes_go_with_their_object() {
    let stage = Stage::new(&moving());
    let weights = |frame: i64, attached: Option<i64>| {
        let (selection, geometry, _) = selection(&stage, stroke(attached), frame);
        selection.weights(&places(&geometry))
    };
    let then = weights(0, Some(0));
    assert!(then.iter().filter(|weight| **weight > 0.5).count() > 30);
    assert_eq!(then, weights(0, None), "at the frame that it was painted at it is what any stroke is");
    for frame in [5, 12, 24, 60] {
        let now = weights(frame, Some(0));
        let apart = then.iter().zip(&now).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(apart < 2e-3, "frame {frame}: {apart}");
    }
    // Painted later, it goes back, too.
    let lying = json!([{ "points": [[1.0, 6.0, 0.5]], "normals": [[0, 1, 0]], "radius": 0.5, "attached": { "object": "wall", "frame": 24 } }]);
    let (early, geometry, _) = selection(&stage, lying.clone(), 0);
    let on_wall = SurfacePoint { position: [0.0, 1.5, -2.0], ..geometry.surface_point(2, 0.3, 0.3, true) };
    assert_eq!(on_wall.geometric_normal.map(f32::round), [0.0, 0.0, 1.0]);
    assert_eq!(early.weight(&on_wall), 1.0);
    let beside = SurfacePoint { position: [1.0, 1.5, -2.0], ..on_wall };
    assert_eq!(early.weight(&beside), 0.0);
}

#[test]
fn strokes_that_follow_nothing_stay_in_the_world() {
    let stage = Stage::new(&moving());
    let (_, _, report) = selection(&stage, stroke(Some(0)), 24);
    assert!(report.notes.get("warnings").is_none(), "{:?}", report.notes);
    // The wall has gone from under this one.
    let plan = stage.plan(json!({
        "room": { "type": "scene", "params": { "file": "room.glb" } },
        "paint": { "type": "paint", "params": { "strokes": stroke(None) }, "inputs": { "scene": "room" } },
    }));
    let error = stage.run(&plan, "paint", 24).unwrap_err();
    assert!(error.to_string().contains("touches no surface"), "{error}");
}

#[test]
fn what_stands_still_keeps_its_paint_bit_by_bit() {
    let stage = Stage::new(&moving());
    let dab = |frame: i64| json!([{ "points": [[0.2, 0.0, 1.1]], "radius": 0.4, "adaptive": true, "attached": { "object": "floor", "frame": frame } }]);
    let weights = |frame: i64, painted: i64| {
        let (selection, geometry, _) = selection(&stage, dab(painted), frame);
        let floor: Vec<SurfacePoint> = places(&geometry).into_iter().filter(|point| point.object == 0).collect();
        selection.weights(&floor)
    };
    let then = weights(0, 0);
    assert!(then.iter().any(|weight| *weight > 0.9));
    assert_eq!(weights(1, 0), then);
    // The size of an adaptive brush is that of the frame that it was painted at, when the wall was far.
    assert_eq!(weights(24, 0), then);
    assert_ne!(weights(24, 24), then);
}

#[test]
fn what_cannot_be_followed_is_said() {
    let stage = Stage::new(&moving());
    let refused = |attached: Json| {
        let mut strokes = stroke(None);
        strokes[0]["attached"] = attached;
        let plan = stage.plan(json!({
            "room": { "type": "scene", "params": { "file": "room.glb" } },
            "paint": { "type": "paint", "params": { "strokes": strokes }, "inputs": { "scene": "room" } },
        }));
        stage.run(&plan, "paint", 3).unwrap_err()
    };
    let error = refused(json!({ "object": "wal", "frame": 0 }));
    assert!(error.to_string().contains("strokes[0] follows \"wal\", which is not in the scene"), "{error}");
    assert!(error.help().contains("did you mean \"wall\""), "{}", error.help());
    let error = refused(json!({ "object": "wall", "frame": 24 }));
    assert!(error.to_string().contains("touches no surface"), "{error}");
    let moved = Vec3::from(places(&selection(&stage, stroke(Some(0)), 24).1).last().unwrap().position);
    assert!(moved.y > 0.9, "the wall has moved: {moved}");
}
