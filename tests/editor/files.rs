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
    // It is among those opened last.
    desk.menu("File", "Recent");
    desk.hover(desk.at("Recent"));
    desk.frames(10);
    let path = desk.file().display().to_string();
    desk.click(&path);
    assert!(desk.document().nodes.contains_key("edit2"));
}

/// Closing asks, and goes back; with nothing to lose it closes.
#[test]
fn a_window_with_changes_does_not_close_unasked() {
    let mut desk = Desk::room();
    let close = |desk: &mut Desk| {
        let viewport = desk.harness.input_mut().viewports.entry(egui::ViewportId::ROOT).or_default();
        viewport.events.push(egui::ViewportEvent::Close);
        desk.frames(1);
        let output = desk.harness.output().viewport_output[&egui::ViewportId::ROOT].commands.clone();
        desk.harness.input_mut().viewports.entry(egui::ViewportId::ROOT).or_default().events.clear();
        desk.frames(2);
        output.contains(&egui::ViewportCommand::CancelClose)
    };
    assert!(!close(&mut desk), "nothing to lose");
    desk.click("node edit");
    desk.key(Modifiers::COMMAND, Key::D);
    assert!(close(&mut desk) && desk.sees("not saved"));
    desk.click("Go back");
    assert!(close(&mut desk));
    desk.click("Discard changes");
    desk.frames(2);
    assert!(!close(&mut desk), "now it may");
}

#[derive(Debug)]
struct Dropped(std::path::PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &std::path::Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

fn drop_file(desk: &mut Desk, path: std::path::PathBuf) {
    desk.harness.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(path)));
    desk.frames(1);
    desk.harness.input_mut().dropped_files.clear();
    desk.frames(2);
}

#[test]
fn dropped_scenes_and_pictures_become_nodes_and_recipes_are_opened() {
    let mut desk = Desk::room();
    for (file, kind) in [("a.glb", "scene"), ("sub/b.exr", "read_image"), ("c.hdr", "environment")] {
        let path = desk.folder.path().join(file);
        drop_file(&mut desk, path);
        let node = desk.node(&desk.state().selected[0]);
        assert_eq!((node.kind.as_str(), node.params["file"].as_str()), (kind, Some(file)));
    }
    let text = desk.folder.path().join("notes.txt");
    drop_file(&mut desk, text);
    assert!(desk.sees("no recipe, scene or picture"));
    desk.key(Modifiers::COMMAND, Key::S);
    let other = desk.folder.path().join("other.json");
    std::fs::write(&other, r#"{ "chiaro": 1, "nodes": {} }"#).unwrap();
    drop_file(&mut desk, other);
    assert!(desk.document().nodes.is_empty());
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
    // It is left once again, by this window.
    let kept = |desk: &Desk| -> Vec<String> {
        let files = std::fs::read_dir(desk.folder.path().join("editor/recovery")).unwrap();
        let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.ends_with(".recovery")).collect()
    };
    let wait_for = |desk: &mut Desk, expected: &[&str]| {
        let start = std::time::Instant::now();
        while kept(desk) != expected {
            assert!(start.elapsed().as_secs() < 20, "{:?} are kept, expected {expected:?}", kept(desk));
            desk.frames(1);
        }
    };
    wait_for(&mut desk, &["2.recovery"]);
    let Desk { harness, folder } = desk;
    drop(harness);
    let mut desk = Desk::open(folder, None);
    desk.click("Recover it");
    assert!(desk.document().nodes.contains_key("edit2"));
    desk.key(Modifiers::COMMAND, Key::S);
    wait_for(&mut desk, &[]);
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

/// A node that a lost GPU fails, and the CPU does not.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Fragile {
    /// Grey.
    value: f32,
}

impl chiaro::node::Node for Fragile {
    const INFO: chiaro::node::Info = chiaro::node::Info {
        name: "fragile",
        category: "trial",
        summary: "Fails where there is a GPU",
        outputs: &[chiaro::node::Port::new("image", chiaro::value::Kind::Image, "Grey")],
        ..chiaro::node::Info::NEW
    };

    fn run(&self, _: &chiaro::node::Inputs, job: &chiaro::node::Job) -> chiaro::Result<Vec<chiaro::value::Value>> {
        use chiaro::image::{Content, Image, Layer};
        if !matches!(job.device, chiaro::device::Device::Cpu) {
            return Err(chiaro::Error::device("the GPU was lost", "use --device cpu"));
        }
        let layers = vec![Layer::new("", &["Y"], Content::Colour, vec![self.value; 4])];
        let image = Image { width: 2, height: 2, layers, ..Image::default() };
        Ok(vec![chiaro::value::Value::Image(std::sync::Arc::new(image))])
    }
}

#[cfg(feature = "gpu")]
#[test]
fn a_lost_gpu_loses_nothing() {
    use chiaro::device::{Choice, Device};
    let Ok(device) = Device::open(Choice::Gpu) else {
        println!("skipped: no GPU, software or not");
        return;
    };
    let registry: &'static [chiaro::params::NodeType] =
        Box::leak(Box::new([chiaro::params::NodeType::of::<Fragile>()]));
    let recipe = r#"{ "chiaro": 1, "nodes": { "grey": { "type": "fragile", "params": { "value": 0.25 } } } }"#;
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("recipe.json"), recipe).unwrap();
    let file = folder.path().join("recipe.json");
    let mut desk = Desk::open_with(folder, Some(file), device, registry);
    desk.settle();
    assert!(desk.sees("The GPU has failed") && desk.sees("CPU,"), "it says so, and goes on");
    assert!(desk.sees("2 x 2"), "the picture is there");
    assert_eq!(desk.node("grey").params["value"], 0.25);
}

/// What runs is told at its node, and can be stopped.
#[test]
fn an_evaluation_is_cancelled() {
    let recipe = ROOM.replace("2048", "262144").replace("0.1", "0.001").replace("96", "1280").replace("72", "960");
    let mut desk = Desk::with(&recipe);
    let start = std::time::Instant::now();
    while !desk.sees("Cancel") {
        assert!(start.elapsed().as_secs() < 60, "something runs");
        std::thread::sleep(Duration::from_millis(5));
        desk.frames(1);
    }
    desk.click("Cancel");
    desk.frames(3);
    assert!(desk.harness.state().is_idle() && desk.state().progress.is_none());
    // Smaller, it is computed.
    desk.click("Skip");
    desk.click("node view");
    desk.fill("width", "64");
    desk.fill("height", "48");
    desk.click("node way");
    desk.fill("gather_samples", "1024");
    desk.fill("tolerance", "0.2");
    desk.settle();
    assert_eq!(desk.picture().width, 64);
}
