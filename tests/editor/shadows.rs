//! Shadows, by hand: found, dragged, turned, bent, faded.

use super::desk::{Desk, aside};
use chiaro::device::Device;
use chiaro::editor::hands::shadow;
use chiaro::eval::{Context, Evaluator, Options};
use chiaro::graph::Plan;
use chiaro::nodes;
use chiaro::progress::Silent;
use chiaro::scene::bvh::Ray;
use chiaro::scene::{Geometry, SurfacePoint};
use chiaro::value::Value;
use egui::Modifiers;
use glam::{Vec2, Vec3};
use serde_json::json;
use std::sync::atomic::AtomicBool;

/// A yard at night: a lamp is found by a shadow on the ground.
fn yard(edit: serde_json::Value) -> Desk {
    let recipe = json!({ "chiaro": 1, "nodes": {
        "yard": { "type": "scene", "params": { "file": "builtin:yard" } },
        "camera": { "type": "camera", "params": { "name": "main" }, "inputs": { "scene": "yard" } },
        "view": {
            "type": "view_samples", "params": { "width": 160, "height": 120 },
            "inputs": { "scene": "yard", "camera": "camera" }
        },
        "night": { "type": "environment", "params": { "file": "builtin:lamps", "face_size": 64, "rotation": 180.0 } },
        "seen": {
            "type": "visibility", "params": { "face_size": 64 },
            "inputs": { "scene": "yard", "samples": "view", "environment": "night" }
        },
        "shine": { "type": "transport", "inputs": { "scene": "yard", "samples": "view", "environment": "night" } },
        "dark": {
            "type": "paint", "params": { "strokes": [{ "points": [[0.1, 0.0, 1.55]], "radius": 0.12 }] },
            "inputs": { "scene": "yard" }
        },
        "lamp": {
            "type": "localize_light", "params": { "which": 1 },
            "inputs": { "visibility": "seen", "environment": "night", "selection": "dark" }
        },
        "edit": edit,
        "lit": { "type": "integrate", "inputs": { "visibility": "edit", "transport": "shine", "samples": "view" } }
    } });
    let mut desk = Desk::with(&recipe.to_string());
    desk.click("Skip");
    desk.settle();
    desk
}

/// Where the found lamp's light comes from.
fn light(desk: &Desk) -> Vec3 {
    let plan = Plan::new(&desk.document().upstream(&["lamp"]).refreshed().unwrap(), nodes::ALL).unwrap();
    let targets = plan.targets(&["night".to_owned(), "lamp".to_owned()]).unwrap();
    let (sink, cancel) = (Silent, AtomicBool::new(false));
    let context = Context { out: None, sink: &sink, cancel: &cancel, ..Context::SILENT };
    let evaluator = Evaluator::new(Options::new(Device::Cpu));
    let values = evaluator.evaluate(&plan, &targets, 1, &context, &mut Vec::new()).unwrap();
    let (mut night, mut lamp) = (None, None);
    for value in values.into_iter().flatten() {
        match value {
            Value::Environment(environment) => night = Some(environment),
            Value::Light(light) => lamp = Some(light),
            _ => {}
        }
    }
    shadow::direction(&night.unwrap(), Some(&lamp.unwrap())).unwrap()
}

fn is_shadowed(geometry: &Geometry, point: Vec3, light: Vec3) -> bool {
    geometry.bvh.any(&Ray { origin: point + Vec3::Y * 1e-3, direction: light, t_max: f32::INFINITY })
}

/// Two places of the ground that are seen, at least so many pixels apart, the second where `by` takes the first: one in the lamp's shadow, one in its light, each with its
/// surroundings.
fn dark_and_lit(desk: &Desk, light: Vec3, apart: f32, by: impl Fn(Vec3) -> Vec3) -> (Vec3, Vec3) {
    let shown = desk.state().last.clone().unwrap();
    let geometry = &shown.scene.as_ref().unwrap().geometry;
    let around = [Vec3::ZERO, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z].map(|way| way * 0.06);
    let all = |at: Vec3, shadowed: bool| around.iter().all(|way| is_shadowed(geometry, at + *way, light) == shadowed);
    let is_seen = |at: Vec3| {
        let pixel = project(desk, at);
        let point = shown.point(pixel.x as usize, pixel.y as usize);
        point.is_some_and(|point| Vec3::from(point.position).distance(at) < 0.08)
    };
    let pixels = (0..120).flat_map(|y| (0..160).map(move |x| (x, y)));
    let ground =
        pixels.filter_map(|(x, y)| shown.point(x, y)).filter(|point: &&SurfacePoint| point.position[1].abs() < 1e-3);
    ground
        .map(|point| (Vec3::from(point.position), by(point.position.into())))
        .filter(|(from, to)| project(desk, *from).distance(project(desk, *to)) > apart)
        .find(|(from, to)| all(*from, true) && all(*to, false) && is_seen(*from) && is_seen(*to))
        .expect("a shadow on the ground")
}

/// In pixels of the picture.
fn project(desk: &Desk, at: Vec3) -> Vec2 {
    let shown = desk.state().last.as_ref().unwrap();
    let camera = &shown.samples.as_ref().unwrap().camera;
    camera.project(at, Vec2::new(160.0, 120.0)).map_or(Vec2::splat(-1.0), |(pixel, _)| pixel)
}

fn on_screen(desk: &Desk, pixel: Vec2) -> egui::Pos2 {
    let pane = desk.rect("picture");
    let zoom = (pane.width() / 160.0).min(pane.height() / 120.0);
    pane.center() + egui::vec2(pixel.x - 80.0, pixel.y - 60.0) * zoom
}

fn brightness(desk: &Desk, at: Vec3) -> f32 {
    let (picture, pixel) = (desk.picture(), project(desk, at));
    let layer = picture.layer("").unwrap();
    let index = (pixel.y as usize * picture.width + pixel.x as usize) * layer.channels.len();
    layer.data[index..index + 3].iter().sum()
}

#[test]
fn a_shadow_goes_where_it_is_dragged() {
    let mut desk = yard(json!({ "type": "translate_shadow", "inputs": { "visibility": "seen", "light": "lamp" } }));
    let light = light(&desk);
    let (from, to) = dark_and_lit(&desk, light, 3.0, |at| at + Vec3::new(0.3, 0.0, 0.0));
    let before = (brightness(&desk, from), brightness(&desk, to));
    assert!(before.0 < 0.7 * before.1, "{before:?}");
    desk.click("node edit");
    desk.settle();
    desk.drag(on_screen(&desk, project(&desk, from)), on_screen(&desk, project(&desk, to)));
    desk.settle();
    let after = (brightness(&desk, from), brightness(&desk, to));
    assert!(after.1 < 0.5 * (before.0 + before.1), "the shadow is there now: {before:?} {after:?}");
    assert!(desk.node("edit").params["offset"][0].as_f64().unwrap().abs() > 0.01);
    desk.undo();
    assert!(desk.node("edit").params.is_empty(), "one drag, one undo");
}

#[test]
fn a_shadow_swings_where_it_is_dragged() {
    let mut desk = yard(json!({ "type": "rotate_shadow", "inputs": { "visibility": "seen", "light": "lamp" } }));
    let light = light(&desk);
    let geometry = desk.state().last.as_ref().unwrap().scene.as_ref().unwrap().geometry.clone();
    // By twenty degrees about what casts it.
    let swung = move |at: Vec3| {
        let origin = at + Vec3::Y * 1e-3;
        let hit = geometry.bvh.closest(&Ray { origin, direction: light, t_max: f32::INFINITY });
        let caster = if hit.t.is_finite() { origin + light * hit.t } else { at };
        let arm = at - Vec3::new(caster.x, 0.0, caster.z);
        Vec3::new(caster.x, 0.0, caster.z) + glam::Quat::from_rotation_y(20f32.to_radians()) * arm
    };
    let (from, to) = dark_and_lit(&desk, light, 8.0, swung);
    let before = (brightness(&desk, from), brightness(&desk, to));
    desk.click("node edit");
    desk.settle();
    desk.drag(on_screen(&desk, project(&desk, from)), on_screen(&desk, project(&desk, to)));
    desk.settle();
    let after = (brightness(&desk, from), brightness(&desk, to));
    assert!(after.1 < 0.5 * (before.0 + before.1), "the shadow is there now: {before:?} {after:?}");
    let angle = desk.node("edit").params["angle"].as_f64().unwrap();
    assert!((angle.abs() - 20.0).abs() < 4.0, "{angle}");
}

#[test]
fn paint_on_a_shadow_finds_its_light_and_edits_follow() {
    let mut desk =
        yard(json!({ "type": "remove_shadow", "params": { "amount": 0.0 }, "inputs": { "visibility": "seen" } }));
    let light = light(&desk);
    let (dark, _) = dark_and_lit(&desk, light, 3.0, |at| at + Vec3::new(0.3, 0.0, 0.0));
    desk.click_at(desk.within("node night", -0.6, 0.5), Modifiers::NONE);
    desk.click("Brush");
    desk.fill("brush radius", "0.1");
    let at = on_screen(&desk, project(&desk, dark));
    desk.click_at(at, Modifiers::NONE);
    desk.settle();
    assert_eq!(desk.node(&desk.state().selected[0]).kind, "paint");
    let paint = desk.state().selected[0].clone();
    desk.click("Find light");
    desk.settle();
    let found = desk.state().selected[0].clone();
    assert_eq!(desk.node(&found).kind, "localize_light");
    assert_eq!(desk.node(&found).inputs["selection"], paint);
    assert!(desk.sees("Environment: environment_image"), "the light is shown on the environment");
    let before = brightness(&desk, dark);
    desk.click("Remove");
    desk.settle();
    assert_eq!(desk.node("lit").inputs["visibility"], "remove_shadow");
    assert!(brightness(&desk, dark) > 1.3 * before, "{before} {}", brightness(&desk, dark));
    assert_eq!(desk.state().session.problem_count(), 0);
}

#[test]
fn a_shadow_fades_along_a_drawn_arrow() {
    let mut desk = yard(json!({
        "type": "shadow_gradient", "params": { "from": [-0.5, 0.0, -1.0], "to": [0.5, 0.0, -1.0] },
        "inputs": { "visibility": "seen" }
    }));
    desk.click("node edit");
    let end = on_screen(&desk, project(&desk, Vec3::new(0.5, 0.0, -1.0)));
    desk.drag(end, aside(end, 40.0, 20.0));
    let to: Vec<f64> = serde_json::from_value(desk.node("edit").params["to"].clone()).unwrap();
    assert!(to[0] > 0.6 && to[1].abs() < 1e-3, "along the ground: {to:?}");
    assert_eq!(desk.node("edit").params["from"], json!([-0.5, 0.0, -1.0]));
}

/// Ratios: their handles lie in the picture.
fn ratio(kind: &str) -> Desk {
    let recipe = json!({ "chiaro": 1, "nodes": {
        "room": { "type": "scene", "params": { "file": "builtin:room" } },
        "view": { "type": "view_samples", "params": { "width": 96, "height": 72 }, "inputs": { "scene": "room" } },
        "way": {
            "type": "transfer", "params": { "gather_samples": 2048, "tolerance": 0.1 },
            "inputs": { "scene": "room", "samples": "view" }
        },
        "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "way" } },
        "dim": { "type": "grade", "params": { "multiply": [0.5, 0.5, 0.5] }, "inputs": { "image": "lit" } },
        "ratio": { "type": "visibility_ratio", "inputs": { "original": "dim", "removed": "lit" } },
        "edit": { "type": kind, "inputs": { "ratio": "ratio" } },
        "out": { "type": "synthesize_shadow", "inputs": { "image": "lit", "ratio": "edit" } }
    } });
    let mut desk = Desk::with(&recipe.to_string());
    desk.click("Skip");
    desk.settle();
    desk.click("node edit");
    desk.frames(3);
    desk
}

/// Where a place of the picture, in heights, lies on the screen.
fn heights(desk: &Desk, x: f32, y: f32) -> egui::Pos2 {
    let pane = desk.rect("picture");
    let zoom = (pane.width() / 96.0).min(pane.height() / 72.0);
    pane.center() + egui::vec2(x * 72.0 - 48.0, y * 72.0 - 36.0) * zoom
}

#[test]
fn control_points_of_a_lattice_are_pulled() {
    let mut desk = ratio("ratio_lattice");
    // Four columns and three rows: the second point of the second row.
    let point = heights(&desk, (96.0 / 72.0) / 4.0, 1.0 / 3.0);
    desk.drag(point, aside(point, 30.0, 12.0));
    desk.settle();
    let points = desk.node("edit").params["points"].as_array().unwrap().clone();
    assert_eq!(points.len(), 20);
    assert!(points[6][0].as_f64().unwrap() > 0.36, "{points:?}");
    assert_eq!(points[7][0].as_f64().unwrap(), 0.6667, "the others stay");
    assert_eq!(desk.state().session.problem_count(), 0);
}

#[test]
fn a_ratio_is_moved_turned_and_pulled_by_its_corners() {
    let mut desk = ratio("ratio_transform");
    let middle = heights(&desk, 0.5 * 96.0 / 72.0, 0.5);
    desk.drag(middle, aside(middle, 50.0, 0.0));
    let moved = desk.node("edit").params["translate"][0].as_f64().unwrap();
    assert!(moved > 0.05, "{moved}");
    desk.undo();
    desk.click("Pull by the corners");
    let corner = heights(&desk, 0.0, 0.0);
    desk.drag(aside(corner, 1.0, 1.0), aside(corner, 40.0, 30.0));
    desk.settle();
    let corners = desk.node("edit").params["corners"].clone();
    assert!(corners[0][0].as_f64().unwrap() > 0.05 && corners[2] == json!([1.3333, 1.0]), "{corners}");
    assert_eq!(desk.state().session.problem_count(), 0);
}

#[test]
fn a_gradient_is_drawn_over_a_ratio() {
    let mut desk = ratio("ratio_grade");
    desk.click("Draw a gradient");
    let head = heights(&desk, 0.5 * 96.0 / 72.0, 0.75);
    desk.drag(head, aside(head, 40.0, -20.0));
    desk.settle();
    let gradient = &desk.node("edit").params["gradient"];
    assert!(gradient["to"][0].as_f64().unwrap() > 0.7 && gradient["from"][1] == 0.25, "{gradient}");
    assert_eq!(desk.state().session.problem_count(), 0);
}
