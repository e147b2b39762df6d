//! The first start, and what can be looked up.

use super::desk::{Desk, ROOM, can_draw};
use chiaro::device::Device;
use egui::{Key, Modifiers};

#[test]
fn the_first_start_opens_a_finished_example_with_a_tour() {
    let mut desk = Desk::open(tempfile::tempdir().unwrap(), None);
    assert!(desk.sees("Tour, 1 of 3"));
    assert!(desk.document().nodes.contains_key("bleed") && desk.state().session.problem_count() == 0);
    desk.click("Next");
    assert!(desk.sees("Tour, 2 of 3"));
    assert_eq!(desk.state().selected, ["bleed"], "what it speaks of is chosen");
    desk.click("Next");
    desk.click("Done");
    assert!(!desk.sees("Tour,"));
    let Desk { harness, folder } = desk;
    drop(harness);
    let desk = Desk::open(folder, None);
    assert!(!desk.sees("Tour,") && desk.document().nodes.is_empty(), "only once");
}

#[test]
fn every_shortcut_is_listed_and_nodes_explain_themselves() {
    let mut desk = Desk::room();
    desk.click("Skip");
    desk.key(Modifiers::NONE, Key::F1);
    for text in ["Undo", "Mute or unmute", "Zoom to fit", "drag a port"] {
        assert!(desk.sees(text), "{text}");
    }
    desk.key(Modifiers::NONE, Key::F1);
    desk.click("node edit");
    desk.click("?");
    assert!(desk.sees("Factor of the light"));
}

/// Whatever can be pressed or typed into has a name that can be read out.
#[test]
fn all_that_can_be_used_has_a_name() {
    use egui::accesskit::Role;
    use egui_kittest::kittest::{By, NodeT, Queryable};
    let mut desk = Desk::room();
    desk.click("Skip");
    for node in ["edit", "room", "view", "lit"] {
        desk.click(&format!("node {node}"));
        desk.frames(2);
        let used = [Role::Button, Role::CheckBox, Role::TextInput, Role::SpinButton, Role::ComboBox, Role::Slider];
        let is_nameless = |node: &egui_kittest::kittest::AccessKitNode| {
            let name = node.label().filter(|label| !label.trim().is_empty()).or(node.value());
            used.contains(&node.role()) && name.is_none_or(|name| name.trim().is_empty())
        };
        let nameless: Vec<_> = desk
            .harness
            .query_all(By::new().predicate(is_nameless))
            .map(|node| (node.accesskit_node().role(), node.rect()))
            .collect();
        assert!(nameless.is_empty(), "with {node} chosen: {nameless:?}");
    }
}

#[test]
fn the_window_is_light_or_dark_all_over() {
    if !can_draw() {
        return;
    }
    let mut desk = Desk::room();
    desk.click("Skip");
    desk.click("node edit");
    for (is_light, command) in [(false, None), (true, Some("Dark or light")), (false, Some("Dark or light"))] {
        if let Some(command) = command {
            desk.menu("View", command);
            desk.frames(4);
        }
        let image = desk.harness.render().unwrap();
        // Beside the inspector's words, beside the timeline's, and in the bar at the foot.
        for (x, y) in [(1400, 700), (900, 828), (700, 892)] {
            let [r, g, b, _] = image.get_pixel(x, y).0;
            let is_bright = u32::from(r) + u32::from(g) + u32::from(b) > 600;
            assert_eq!(is_bright, is_light, "at {x}, {y}: {r} {g} {b}");
        }
    }
}

/// Two pixels to a point: all lies where it did, and is drawn in more detail.
#[test]
fn dense_screens_are_used_in_full() {
    let at = Desk::room().rect("node edit").center();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("recipe.json");
    std::fs::write(&file, ROOM).unwrap();
    let mut desk = Desk::open_on(2.0, folder, Some(file), Device::Cpu, chiaro::nodes::ALL);
    desk.settle();
    desk.click("Skip");
    let off = desk.rect("node edit").center() - at;
    assert!(off.length() < 2.0, "{off:?}");
    desk.click("node edit");
    desk.fill("brightness", "3");
    assert_eq!(desk.node("edit").params["brightness"], 3.0);
    if can_draw() {
        let image = desk.harness.render().unwrap();
        assert_eq!((image.width(), image.height()), (2880, 1800));
    }
}
