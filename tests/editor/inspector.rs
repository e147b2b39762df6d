//! Parameters, keys and time.

use super::desk::{Desk, aside};
use egui::{Key, Modifiers};
use serde_json::json;

fn chosen(node: &str) -> Desk {
    let mut desk = Desk::room();
    desk.click("Skip");
    desk.click(&format!("node {node}"));
    desk
}

#[test]
fn numbers_are_typed_dragged_and_reset() {
    let mut desk = chosen("edit");
    let before = desk.picture();
    desk.fill("brightness", "6.5");
    assert_eq!(desk.node("edit").params["brightness"], 6.5);
    desk.settle();
    assert_ne!(before.layers[0].data[..], desk.picture().layers[0].data[..]);
    let at = desk.at("brightness");
    desk.drag(at, aside(at, 60.0, 0.0));
    assert!(desk.node("edit").params["brightness"].as_f64().unwrap() > 6.5);
    desk.undo();
    assert_eq!(desk.node("edit").params["brightness"], 6.5, "the drag is undone as one");
    desk.click("reset brightness");
    assert!(desk.node("edit").params.is_empty());
    desk.fill("brightness", "-4");
    assert_eq!(desk.node("edit").params["brightness"], 0.0, "kept in its range");
}

#[test]
fn a_node_is_renamed_and_stays_chosen_and_connected() {
    let mut desk = chosen("edit");
    desk.fill("Name", "bleed");
    assert_eq!(desk.node("lit").inputs["edits"], "bleed");
    assert_eq!(desk.state().selected, ["bleed"]);
    desk.fill("Name", "lit");
    assert!(desk.document().nodes.contains_key("bleed") && desk.sees("another node"));
}

#[test]
fn inputs_are_chosen_from_lists() {
    let mut desk = chosen("lit");
    desk.click("edits takes from");
    desk.click("—");
    assert!(!desk.node("lit").inputs.contains_key("edits"));
    desk.click("edits takes from");
    desk.frames(2);
    desk.click("edit");
    assert_eq!(desk.node("lit").inputs["edits"], "edit");
}

#[test]
fn hues_and_tone_curves_are_edited() {
    let mut desk = chosen("edit");
    desk.fill("hue", "120");
    assert_eq!(desk.node("edit").params["hue"], 120.0);
    desk.click("curve");
    desk.click("points");
    let curve = desk.rect("tone curve");
    let middle = curve.center();
    desk.drag(middle, aside(middle, 0.0, -40.0));
    let points = desk.node("edit").params["curve"]["points"].as_array().unwrap().clone();
    assert_eq!(points.len(), 3);
    assert!(points[1][1].as_f64().unwrap() > 0.6, "{points:?}");
    let at = aside(middle, 0.0, -40.0);
    desk.right_click_at(at);
    assert_eq!(desk.node("edit").params["curve"]["points"].as_array().unwrap().len(), 2);
    desk.settle();
    assert_eq!(desk.state().session.problem_count(), 0);
}

#[test]
fn keys_are_set_moved_and_played() {
    let mut desk = chosen("edit");
    desk.fill("brightness", "1");
    desk.click("key of brightness");
    assert_eq!(desk.node("edit").params["brightness"], json!({ "keys": [[1, 1.0]] }));
    let time = desk.rect("timeline");
    let frame =
        |number: f32| egui::pos2(time.left() + 12.0 + (number - 1.0) / 23.0 * (time.width() - 24.0), time.center().y);
    desk.click_at(frame(13.0), Modifiers::NONE);
    assert_eq!(desk.state().frame, 13);
    desk.fill("brightness", "4");
    assert_eq!(desk.node("edit").params["brightness"], json!({ "keys": [[1, 1.0], [13, 4.0]] }));
    desk.settle();
    let later = desk.picture();
    desk.click_at(frame(7.0), Modifiers::NONE);
    desk.settle();
    assert_ne!(later.layers[0].data[..], desk.picture().layers[0].data[..], "another frame, another picture");
    // The key goes from 13 to 20.
    let key = egui::pos2(frame(13.0).x, time.bottom() - 8.0);
    desk.drag(key, egui::pos2(frame(20.0).x, key.y));
    assert_eq!(desk.node("edit").params["brightness"], json!({ "keys": [[1, 1.0], [20, 4.0]] }));
    desk.key(Modifiers::NONE, Key::ArrowUp);
    assert_eq!(desk.state().frame, 20);
    desk.key(Modifiers::NONE, Key::ArrowRight);
    assert_eq!(desk.state().frame, 21);
    desk.key(Modifiers::NONE, Key::Space);
    assert!(desk.state().playing);
    let start = std::time::Instant::now();
    while desk.state().frame != 3 && start.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(10));
        desk.frames(1);
    }
    desk.key(Modifiers::NONE, Key::Space);
    assert!(!desk.state().playing && desk.state().frame < 20, "round and round");
    // The diamond takes keys out again.
    desk.key(Modifiers::NONE, Key::ArrowDown);
    desk.key(Modifiers::NONE, Key::ArrowDown);
    assert_eq!(desk.state().frame, 1);
    desk.click("key of brightness");
    assert_eq!(desk.node("edit").params["brightness"], json!({ "keys": [[20, 4.0]] }));
}

#[test]
fn curves_are_shown_and_their_points_dragged() {
    let mut desk = chosen("edit");
    desk.click("key of brightness");
    desk.click("Curves");
    desk.frames(4);
    assert!(desk.sees("interpolation of brightness"));
    desk.click("interpolation of brightness");
    desk.click("smooth");
    assert_eq!(desk.node("edit").params["brightness"]["interpolation"], "smooth");
}
