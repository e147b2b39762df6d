//! Gather samples stay where they are on surfaces, whatever becomes of the surfaces.

use super::*;
use chiaro::transport::Transfer;
use std::sync::Arc;

const WALL: usize = 1;

fn transfers(glb: &Glb, frames: &[i64]) -> Vec<Arc<Transfer>> {
    let stage = Stage::new(glb);
    let plan = stage.plan(json!({
        "room": { "type": "scene", "params": { "file": "room.glb" } },
        "view": { "type": "view_samples", "params": { "width": 16, "height": 12 }, "inputs": { "scene": "room" } },
        "xfer": { "type": "transfer", "params": { "gather_samples": 256, "tolerance": 0.3 },
                  "inputs": { "scene": "room", "samples": "view" } },
    }));
    let transfer = |frame: &i64| match stage.value(&plan, "xfer", *frame) {
        Value::Transfer(transfer) => transfer,
        other => panic!("{:?}", other.kind()),
    };
    frames.iter().map(transfer).collect()
}

#[test]
fn gather_samples_keep_their_addresses_and_move_with_their_surfaces() {
    let moves = [0.0, 2.0, -2.0, 3.0, 2.0, -3.0];
    let glb = Glb::room().animate("slide", WALL, "translation", 3, &[0.0, 1.0], &moves);
    let all = transfers(&glb, &[0, 7, 24]);
    let first = &all[0].gather;
    let mut moved = 0;
    for (transfer, way) in all.iter().zip([0.0, 7.0 / 24.0, 1.0]) {
        let gather = &transfer.gather;
        assert_eq!(gather.barycentrics[..], first.barycentrics[..]);
        for (now, then) in gather.points.iter().zip(&first.points[..]) {
            assert_eq!((now.triangle, now.object), (then.triangle, then.object));
            let is_wall = now.object == 1;
            moved += usize::from(is_wall && way > 0.0);
            let expected = if is_wall { [3.0 * way, 0.0, -way] } else { [0.0; 3] };
            let apart = glam::Vec3::from(now.position) - glam::Vec3::from(then.position);
            assert!(apart.distance(expected.into()) < 1e-5);
        }
    }
    assert!(moved > 100, "{moved}");
}

/// What is folded up at one time must be there at another, with the same numbers.
#[test]
fn what_has_no_area_at_a_time_is_not_forgotten() {
    let grow = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
    let glb = Glb::room().animate("grow", WALL, "scale", 3, &[0.0, 1.0], &grow);
    let all = transfers(&glb, &[0, 12, 24]);
    let on_wall = |transfer: &Transfer| transfer.gather.points.iter().filter(|point| point.object == 1).count();
    assert_eq!(all.iter().map(|transfer| on_wall(transfer)).collect::<Vec<_>>(), [on_wall(&all[2]); 3]);
    assert!(on_wall(&all[2]) > 40);
    // Nothing is credited to a wall that is not there, and much to one that is.
    let credited = |transfer: &Transfer| {
        let is_wall = |node: usize| {
            let count = transfer.gather.count();
            let level = node.ilog2();
            let first = (node - (1 << level)) * (count >> level);
            transfer.gather.points[first].object == 1
        };
        (0..transfer.rows.rows()).flat_map(|row| transfer.rows.row(row)).filter(|(node, _)| is_wall(*node)).count()
    };
    assert_eq!(credited(&all[0]), 0);
    assert!(credited(&all[2]) > 50, "{}", credited(&all[2]));
}

/// Connecting points weighs samples by the area that they have now, as rays do that meet it or not.
#[test]
fn what_shrinks_sends_less() {
    let sizes = [[1.0, 1.0, 1.0], [0.5, 0.5, 0.5]].concat();
    let stage = Stage::new(&Glb::room().animate("shrink", WALL, "scale", 3, &[0.0, 1.0], &sizes));
    let recipe = |estimator: &str| {
        stage.plan(json!({
            "room": { "type": "scene", "params": { "file": "room.glb" } },
            "view": { "type": "view_samples", "params": { "width": 16, "height": 12 }, "inputs": { "scene": "room" } },
            "xfer": { "type": "transfer", "params": { "gather_samples": 4096, "tolerance": 0.02, "estimator": estimator },
                      "inputs": { "scene": "room", "samples": "view" } },
            "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer" } },
        }))
    };
    let mean = |estimator: &str, frame: i64| {
        let Value::Image(image) = stage.value(&recipe(estimator), "lit", frame) else { panic!("a picture") };
        // The lowest rows: floor, which has its light from the wall alone.
        let indirect = &image.layer("indirect").unwrap().data;
        let indirect = &indirect[indirect.len() * 3 / 4..];
        indirect.iter().map(|x| f64::from(*x)).sum::<f64>() / indirect.len() as f64
    };
    let left = |estimator: &str| mean(estimator, 24) / mean(estimator, 0);
    let (rays, points) = (left("rays"), left("points"));
    println!("of the light on the floor {rays:.4} is left by rays, {points:.4} by points");
    assert!(rays < 0.5 && (points / rays - 1.0).abs() < 0.2, "{points} for {rays}");
}

/// A file that does not move gives what it always gave: its samples are placed on itself.
#[test]
fn only_surfaces_that_move_are_looked_at_in_many_poses() {
    let still = Glb::room();
    let lamp = Glb::room().animate("lamp", 3, "translation", 3, &[0.0, 1.0], &[0.0, 3.0, 0.0, 0.0, 1.0, 0.0]);
    let held = Glb::room().animate("slide", WALL, "translation", 3, &[1.0], &[0.0, 2.0, -2.0]);
    let slide = Glb::room().animate("slide", WALL, "translation", 3, &[0.0, 1.0], &[0.0, 2.0, -2.0, 1.0, 2.0, -2.0]);
    for (glb, poses) in [(still, 0), (lamp, 0), (held, 0), (slide, 8)] {
        let stage = Stage::new(&glb);
        let plan = stage.plan(json!({ "room": { "type": "scene", "params": { "file": "room.glb" } } }));
        let Value::Scene(scene) = stage.value(&plan, "room", 3) else { panic!("a scene") };
        assert_eq!(scene.geometry.poses.len(), poses);
    }
}
