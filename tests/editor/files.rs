//! Opening and saving, and what must not be lost.

use super::desk::{Desk, ROOM};
use egui::{Key, Modifiers};
use std::time::Duration;

#[test]
fn what_is_saved_is_what_is_on_the_screen() {
    let mut desk = Desk::room();
    desk.click("node edit");
    desk.key(Modifiers::COMMAND, Key::D);
    assert!(desk.state().session.is_unsaved());
    desk.key(Modifiers::COMMAND, Key::S);
    assert!(!desk.state().session.is_unsaved());
    assert_eq!(desk.saved().nodes, desk.document().nodes);
}

#[test]
fn unknown_nodes_are_shown_and_saved_back_unharmed() {
    let recipe = ROOM.replacen(
        r#""nodes": {"#,
        r#""nodes": { "odd": { "type": "from_the_future", "params": { "deep": [1, { "a": 2 }] }, "inputs": { "in": "room" },
            "colour": "red" }, "#,
        1,
    );
    let mut desk = Desk::with(&recipe);
    desk.settle();
    assert!(desk.sees("node odd, from_the_future, has a problem"));
    desk.click("node odd");
    assert!(desk.sees("does not know this type"));
    desk.click("node edit");
    desk.key(Modifiers::COMMAND, Key::D);
    desk.key(Modifiers::COMMAND, Key::S);
    let before: serde_json::Value = serde_json::from_str(&recipe).unwrap();
    let after: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(desk.file()).unwrap()).unwrap();
    assert_eq!(before["nodes"]["odd"], after["nodes"]["odd"]);
    assert!(after["nodes"]["edit2"].is_object());
}

#[test]
fn a_new_recipe_asks_before_it_takes_the_place_of_what_is_not_saved() {
    let mut desk = Desk::room();
    desk.click("node edit");
    desk.key(Modifiers::COMMAND, Key::D);
    desk.menu("File", "New");
    assert!(desk.sees("not saved"));
    desk.click("Go back");
    assert!(desk.document().nodes.contains_key("edit2"), "nothing has happened");
    desk.menu("File", "New");
    desk.click("Save");
    assert!(desk.document().nodes.is_empty());
    assert!(desk.saved().nodes.contains_key("edit2"));
    // Discarded.
    desk.menu("File", "Recent");
}

#[test]
fn a_file_that_another_program_changes_is_asked_about() {
    let mut desk = Desk::room();
    std::fs::write(desk.file(), ROOM.replace("2.0", "7.0")).unwrap();
    std::thread::sleep(Duration::from_millis(2100));
    desk.frames(3);
    assert!(desk.sees("Another program has changed"));
    desk.click("Read it again");
    assert_eq!(desk.node("edit").params["brightness"], 7.0);
    std::fs::remove_file(desk.file()).unwrap();
    std::thread::sleep(Duration::from_millis(2100));
    desk.frames(3);
    desk.click("Keep mine");
    assert!(desk.state().session.is_unsaved());
    desk.key(Modifiers::COMMAND, Key::S);
    assert_eq!(desk.saved().nodes["edit"].params["brightness"], 7.0);
}

/// A window that is lost in any way but by closing leaves what was not saved.
#[test]
fn a_lost_window_loses_nothing() {
    let mut desk = Desk::room();
    desk.click("node edit");
    desk.key(Modifiers::COMMAND, Key::D);
    desk.frames(3);
    let Desk { harness, folder } = desk;
    drop(harness);
    let mut desk = Desk::open(folder, None);
    assert!(desk.sees("before"), "it tells what was left");
    desk.click("Recover it");
    assert!(desk.document().nodes.contains_key("edit2") && desk.state().session.is_unsaved());
    assert_eq!(desk.state().session.file(), Some(desk.file().as_path()));
}

#[test]
fn a_full_disk_loses_neither_the_file_nor_the_document() {
    let mut desk = Desk::room();
    desk.click("node edit");
    desk.key(Modifiers::COMMAND, Key::D);
    // No file can be made in a folder that is none.
    let folder = desk.folder.path().join("gone");
    std::fs::create_dir(&folder).unwrap();
    let before = std::fs::read(desk.file()).unwrap();
    std::fs::remove_file(desk.file()).unwrap();
    std::fs::create_dir(desk.file()).unwrap();
    desk.key(Modifiers::COMMAND, Key::S);
    assert!(desk.state().session.is_unsaved() && desk.document().nodes.contains_key("edit2"));
    std::fs::remove_dir(desk.file()).unwrap();
    std::fs::write(desk.file(), before).unwrap();
    desk.key(Modifiers::COMMAND, Key::S);
    assert!(!desk.state().session.is_unsaved());
}
