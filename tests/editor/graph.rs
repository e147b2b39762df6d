//! Nodes and wires.

use super::desk::{Desk, aside};
use egui::{Event, Key, Modifiers, PointerButton};

#[test]
fn tab_opens_the_palette_and_enter_adds_what_was_searched_for() {
    let mut desk = Desk::room();
    let empty = desk.within("node edit", -0.8, 0.5);
    desk.hover(empty);
    desk.key(Modifiers::NONE, Key::Tab);
    desk.text("illum");
    desk.key(Modifiers::NONE, Key::Enter);
    assert_eq!(desk.node("illumination_brush").kind, "illumination_brush");
    assert_eq!(desk.state().selected, ["illumination_brush"]);
    let at = desk.document().layout["illumination_brush"];
    assert!(at[0] < 420.0 && at[1] > 150.0, "it lies where the pointer was: {at:?}");
    desk.undo();
    assert!(!desk.document().nodes.contains_key("illumination_brush"));
    desk.redo();
    assert!(desk.document().nodes.contains_key("illumination_brush"));
}

#[test]
fn a_right_click_beside_all_nodes_opens_the_palette_and_a_click_adds() {
    let mut desk = Desk::room();
    let empty = desk.within("node edit", -0.8, 0.5);
    desk.right_click_at(empty);
    desk.text("falloff");
    desk.click("falloff");
    assert_eq!(desk.node("falloff").kind, "falloff");
    desk.right_click_at(empty);
    desk.key(Modifiers::NONE, Key::Escape);
    assert!(!desk.sees("Add a node") || desk.document().nodes.len() == 6, "escape closes it");
}

#[test]
fn a_wire_let_go_offers_what_fits_and_connects_it() {
    let mut desk = Desk::room();
    let (from, to) = (desk.at("output edits of edit"), desk.within("node edit", -0.8, 0.5));
    desk.drag(from, to);
    assert!(desk.sees("Nodes that fit edits"));
    assert!(!desk.sees("ratio_blur"));
    desk.text("falloff");
    desk.key(Modifiers::NONE, Key::Enter);
    assert_eq!(desk.node("falloff").inputs["edits"], "edit");
}

#[test]
fn ports_of_a_kind_are_connected_by_a_drag_and_others_are_not() {
    let mut desk = Desk::room();
    desk.hover(desk.within("node edit", -0.8, 0.5));
    desk.key(Modifiers::NONE, Key::Tab);
    desk.text("pick");
    desk.key(Modifiers::NONE, Key::Enter);
    desk.frames(3);
    desk.drag(desk.at("output scene of room"), desk.at("input scene of pick"));
    assert_eq!(desk.node("pick").inputs["scene"], "room");
    desk.drag(desk.at("output selection of pick"), desk.at("input caster of edit"));
    assert_eq!(desk.node("edit").inputs["caster"], "pick");
    // From the input's end, too.
    desk.drag(desk.at("input receiver of edit"), desk.at("output selection of pick"));
    assert_eq!(desk.node("edit").inputs["receiver"], "pick");
    let before = desk.document().to_text();
    desk.drag(desk.at("output scene of room"), desk.at("input edits of edit"));
    assert_eq!(desk.document().to_text(), before, "a scene is no edit");
    // A right click on a port takes its wires out.
    desk.right_click_at(desk.at("input receiver of edit"));
    assert!(!desk.node("edit").inputs.contains_key("receiver"));
    desk.undo();
    assert_eq!(desk.node("edit").inputs["receiver"], "pick");
    // On an output, where wires begin, one after the other.
    desk.right_click_at(desk.at("output selection of pick"));
    desk.right_click_at(desk.at("output selection of pick"));
    assert!(desk.node("edit").inputs.is_empty());
}

#[test]
fn nodes_are_chosen_one_or_many_moved_and_let_go() {
    let mut desk = Desk::room();
    desk.click("node room");
    assert_eq!(desk.state().selected, ["room"]);
    desk.click_with("node view", Modifiers::SHIFT);
    assert_eq!(desk.state().selected, ["room", "view"]);
    desk.click_with("node room", Modifiers::SHIFT);
    assert_eq!(desk.state().selected, ["view"]);
    desk.click_with("node room", Modifiers::SHIFT);
    let (before, content) = (desk.document().layout.clone(), desk.state().session.content());
    let from = aside(desk.rect("node view").left_top(), 12.0, 8.0);
    desk.drag(from, aside(from, 40.0, 30.0));
    let moved = |name: &str| {
        let (a, b) = (before[name], desk.document().layout[name]);
        [b[0] - a[0], b[1] - a[1]]
    };
    assert!(moved("view")[0] > 20.0 && moved("view")[1] > 15.0, "{:?}", moved("view"));
    assert_eq!(moved("view"), moved("room"), "both go");
    assert_eq!(moved("way"), [0.0, 0.0]);
    assert_eq!(desk.state().session.content(), content, "nothing is computed for it");
    desk.undo();
    assert_eq!(desk.document().layout, before, "the drag is undone as one");
    // A rectangle.
    let (low, high) = (desk.rect("node edit"), desk.rect("node lit"));
    let from = egui::pos2(low.left() - 8.0, low.bottom() + 10.0);
    desk.drag_with(from, egui::pos2(high.right() + 6.0, high.top() - 6.0), Modifiers::SHIFT, PointerButton::Primary);
    let mut chosen = desk.state().selected.clone();
    chosen.sort();
    assert!(chosen.contains(&"edit".to_owned()) && chosen.contains(&"lit".to_owned()), "{chosen:?}");
    desk.click_at(desk.within("node edit", -0.8, 0.5), Modifiers::NONE);
    assert!(desk.state().selected.is_empty());
    desk.key(Modifiers::COMMAND, Key::A);
    assert_eq!(desk.state().selected.len(), 5);
}

#[test]
fn nodes_are_copied_pasted_duplicated_muted_and_deleted() {
    let mut desk = Desk::room();
    desk.click("node edit");
    desk.harness.event(Event::Copy);
    desk.frames(2);
    let copied = desk.harness.output().platform_output.commands.iter().find_map(|command| match command {
        egui::OutputCommand::CopyText(text) => Some(text.clone()),
        _ => None,
    });
    let text = copied.unwrap_or_else(|| desk.document().copy(&["edit".to_owned()]));
    desk.harness.event(Event::Paste(text));
    desk.frames(3);
    assert_eq!(desk.node("edit2").params["brightness"], 2.0);
    assert_eq!(desk.state().selected, ["edit2"]);
    desk.key(Modifiers::COMMAND, Key::D);
    assert!(desk.document().nodes.contains_key("edit3"));
    desk.key(Modifiers::NONE, Key::Delete);
    assert!(!desk.document().nodes.contains_key("edit3"));
    desk.harness.event(Event::Paste("no nodes at all".to_owned()));
    desk.frames(3);
    assert_eq!(desk.document().nodes.len(), 6, "what is no recipe is not pasted");
    // Muting changes the picture.
    desk.settle();
    let before = desk.picture();
    desk.click_at(aside(desk.rect("node edit").left_top(), 12.0, 8.0), Modifiers::NONE);
    desk.key(Modifiers::NONE, Key::M);
    desk.settle();
    assert!(desk.node("edit").muted);
    assert_ne!(before.layers[0].data[..], desk.picture().layers[0].data[..]);
    desk.undo();
    desk.settle();
    assert_eq!(before.layers[0].data[..], desk.picture().layers[0].data[..]);
}

#[test]
fn comments_frame_nodes_and_carry_them() {
    let mut desk = Desk::room();
    desk.click("node edit");
    desk.key(Modifiers::COMMAND, Key::G);
    assert_eq!(desk.document().comments.len(), 1);
    desk.fill_lines("Text", "the bleed");
    assert_eq!(desk.document().comments[0].text, "the bleed");
    let before = (desk.document().comments[0].at, desk.document().layout["edit"]);
    // By its bar, above the node.
    let node = desk.rect("node edit");
    let bar = egui::pos2(node.center().x, node.top() - 30.0 * node.width() / 150.0);
    desk.drag(bar, aside(bar, 30.0, 0.0));
    let after = (desk.document().comments[0].at, desk.document().layout["edit"]);
    assert!(after.0[0] - before.0[0] > 10.0, "{before:?} {after:?}");
    assert!((after.0[0] - before.0[0] - (after.1[0] - before.1[0])).abs() < 1e-3, "the node goes with it");
    desk.click("Delete comment");
    assert!(desk.document().comments.is_empty());
    desk.undo();
    assert_eq!(desk.document().comments[0].text, "the bleed");
}

#[test]
fn nodes_are_aligned_arranged_and_brought_into_sight() {
    let mut desk = Desk::room();
    desk.click("node way");
    desk.click_with("node edit", Modifiers::SHIFT);
    desk.click_with("node lit", Modifiers::SHIFT);
    desk.menu("Graph", "Align left");
    let left = |desk: &Desk, name: &str| desk.document().layout[name][0];
    assert!(left(&desk, "way") == left(&desk, "lit") && left(&desk, "edit") == left(&desk, "lit"));
    desk.undo();
    desk.menu("Graph", "Align top");
    assert_eq!(desk.document().layout["way"][1], desk.document().layout["lit"][1]);
    desk.menu("Graph", "Arrange by order");
    assert!(left(&desk, "room") < left(&desk, "view") && left(&desk, "view") < left(&desk, "way"));
    // Panned away, and back.
    let empty = aside(desk.rect("node room").left_bottom(), 10.0, 60.0);
    desk.drag(empty, aside(empty, -700.0, 0.0));
    desk.hover(aside(empty, 100.0, 0.0));
    desk.menu("Graph", "Zoom to fit");
    desk.frames(4);
    let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(1440.0, 900.0));
    for name in ["node room", "node lit"] {
        assert!(screen.contains_rect(desk.rect(name)) && desk.rect(name).width() > 20.0, "{name}");
    }
}

#[test]
fn nodes_tell_time_and_show_what_is_wrong_with_them() {
    let mut desk = Desk::room();
    for name in ["room", "view", "way", "lit"] {
        let known = &desk.state().known[name];
        assert!(known.seconds.is_some() && known.cache.is_some(), "{name}");
    }
    assert!(desk.state().known["lit"].thumb.is_some() && desk.state().known["view"].thumb.is_some());
    desk.click("node way");
    desk.right_click_at(desk.at("input samples of way"));
    desk.settle();
    assert!(desk.sees("node way, transfer, has a problem"));
    assert!(desk.sees("must be connected"));
    desk.undo();
    desk.settle();
    assert!(!desk.sees("has a problem"));
}

/// A recipe written by hand says nothing of places: nodes stay where they were shown when one comes to lie beside them.
#[test]
fn a_first_place_does_not_move_the_others() {
    let (recipe, _) = super::desk::ROOM.split_once(", \"layout\"").unwrap();
    let mut desk = Desk::with(&format!("{recipe} }}"));
    desk.settle();
    assert!(desk.document().layout.is_empty());
    let before = ["node room", "node edit", "node lit"].map(|name| desk.rect(name));
    let empty = desk.within("node edit", -0.8, 0.9);
    desk.hover(empty);
    desk.key(Modifiers::NONE, Key::Tab);
    desk.text("illum");
    desk.key(Modifiers::NONE, Key::Enter);
    assert_eq!(desk.document().layout.len(), desk.document().nodes.len());
    assert_eq!(["node room", "node edit", "node lit"].map(|name| desk.rect(name)), before);
    desk.undo();
    assert!(desk.document().layout.is_empty(), "as it was written");
    assert_eq!(["node room", "node edit", "node lit"].map(|name| desk.rect(name)), before);
}
