//! A window without a screen, and a hand.

use chiaro::device::Device;
use chiaro::editor::window::{Engine, Places, State, Window};
use chiaro::eval::{Evaluator, Options};
use chiaro::graph::Document;
use chiaro::nodes;
use chiaro::params::NodeType;
use egui::{Event, Key, Modifiers, PointerButton, Pos2, Vec2, pos2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

pub struct Desk {
    pub harness: Harness<'static, Window>,
    pub folder: tempfile::TempDir,
}

/// The room, small enough to be computed at once.
pub const ROOM: &str = r#"{ "chiaro": 1, "frames": [1, 24], "nodes": {
    "room": { "type": "scene", "params": { "file": "builtin:room" } },
    "view": { "type": "view_samples", "params": { "width": 96, "height": 72 }, "inputs": { "scene": "room" } },
    "way": {
        "type": "transfer", "params": { "gather_samples": 2048, "tolerance": 0.1 },
        "inputs": { "scene": "room", "samples": "view" }
    },
    "edit": { "type": "caster_receiver", "params": { "brightness": 2.0 } },
    "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "way", "edits": "edit" } }
}, "layout": { "room": [0, 0], "view": [200, 0], "way": [420, 0], "edit": [420, 180], "lit": [640, 60] } }"#;

impl Desk {
    /// With a recipe in a file of its own.
    pub fn with(recipe: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("recipe.json");
        std::fs::write(&file, recipe).unwrap();
        Self::open(folder, Some(file))
    }

    pub fn room() -> Self {
        let mut desk = Self::with(ROOM);
        desk.settle();
        desk
    }

    pub fn open(folder: tempfile::TempDir, file: Option<PathBuf>) -> Self {
        Self::open_with(folder, file, Device::Cpu, nodes::ALL)
    }

    pub fn open_with(
        folder: tempfile::TempDir,
        file: Option<PathBuf>,
        device: Device,
        registry: &'static [NodeType],
    ) -> Self {
        Self::open_on(1.0, folder, file, device, registry)
    }

    /// On a screen of so many pixels to a point.
    pub fn open_on(
        pixels_per_point: f32,
        folder: tempfile::TempDir,
        file: Option<PathBuf>,
        device: Device,
        registry: &'static [NodeType],
    ) -> Self {
        let places = Places { folder: folder.path().join("editor") };
        let engine = Engine { evaluator: Arc::new(Evaluator::new(Options::new(device))), registry };
        let harness = Harness::builder()
            .with_size(vec2(1440.0, 900.0))
            .with_step_dt(1.0 / 60.0)
            .with_pixels_per_point(pixels_per_point)
            .build_eframe(move |cc| Window::new(&cc.egui_ctx, engine, places, file).unwrap());
        let mut desk = Self { harness, folder };
        desk.frames(4);
        desk
    }

    pub fn state(&self) -> &State {
        self.harness.state().state()
    }

    pub fn document(&self) -> &Document {
        self.state().session.document()
    }

    pub fn file(&self) -> PathBuf {
        self.folder.path().join("recipe.json")
    }

    pub fn saved(&self) -> Document {
        chiaro::graph::load(&self.file()).unwrap()
    }

    pub fn frames(&mut self, count: usize) {
        self.harness.run_steps(count);
    }

    /// Until all that was asked for is computed and shown.
    pub fn settle(&mut self) {
        let start = Instant::now();
        self.frames(4);
        while !self.harness.state().is_at_rest() {
            assert!(start.elapsed() < Duration::from_secs(120), "the editor does not come to rest");
            std::thread::sleep(Duration::from_millis(4));
            self.frames(1);
        }
        self.frames(4);
    }

    /// Where something lies whose name is this, with or without more words behind a comma.
    pub fn at(&self, name: &str) -> Pos2 {
        self.rect(name).center()
    }

    pub fn rect(&self, name: &str) -> egui::Rect {
        use egui::accesskit::Role;
        let is_text = |node: &egui_kittest::Node| node.accesskit_node().role() == Role::TextRun;
        let exact: Vec<_> = self.harness.query_all_by_label(name).filter(|node| !is_text(node)).collect();
        // What can be pressed comes before words.
        let is_word = |node: &&egui_kittest::Node| node.accesskit_node().role() == Role::Label;
        if let Some(node) = exact.iter().rev().find(|node| !is_word(node)).or(exact.last()) {
            return node.rect();
        }
        let begins = |node: &egui_kittest::kittest::AccessKitNode| {
            node.label().is_some_and(|label| label.strip_prefix(name).is_some_and(|rest| rest.starts_with(',')))
        };
        let found: Vec<_> = self.harness.query_all(egui_kittest::kittest::By::new().predicate(begins)).collect();
        if let Some(node) = found.last() {
            return node.rect();
        }
        // Entries of menus end in their keys.
        let before_keys = format!("{name} ");
        let entries = self.harness.query_all_by_label_contains(&before_keys);
        let entry = entries.min_by_key(|node| node.accesskit_node().label().map_or(0, |label| label.len()));
        entry.unwrap_or_else(|| panic!("there is no \"{name}\" on the screen")).rect()
    }

    pub fn sees(&self, text: &str) -> bool {
        let says = |node: &egui_kittest::kittest::AccessKitNode| {
            let (label, value) = (node.label().unwrap_or_default(), node.value().unwrap_or_default());
            label.contains(text) || value.contains(text)
        };
        self.harness.query_all(egui_kittest::kittest::By::new().predicate(says)).next().is_some()
    }

    /// The line that tells what is under the pointer.
    pub fn probe(&self) -> String {
        let is_probe = |node: &egui_kittest::kittest::AccessKitNode| {
            [node.label(), node.value()].into_iter().flatten().any(|text| text.contains("   P "))
        };
        let found = self.harness.query_all(egui_kittest::kittest::By::new().predicate(is_probe)).next();
        found.and_then(|node| node.accesskit_node().label().or(node.value())).unwrap_or_default()
    }

    pub fn click(&mut self, name: &str) {
        let at = self.at(name);
        self.click_at(at, Modifiers::NONE);
    }

    pub fn click_with(&mut self, name: &str, modifiers: Modifiers) {
        let at = self.at(name);
        self.click_at(at, modifiers);
    }

    pub fn click_at(&mut self, at: Pos2, modifiers: Modifiers) {
        self.press(at, PointerButton::Primary, modifiers);
    }

    pub fn right_click_at(&mut self, at: Pos2) {
        self.press(at, PointerButton::Secondary, Modifiers::NONE);
    }

    fn press(&mut self, at: Pos2, button: PointerButton, modifiers: Modifiers) {
        self.hover(at);
        for pressed in [true, false] {
            self.harness.event(Event::ModifiersChanged(modifiers));
            self.harness.event(Event::PointerButton { pos: at, button, pressed, modifiers });
            self.frames(1);
        }
        self.harness.event(Event::ModifiersChanged(Modifiers::NONE));
        self.frames(2);
    }

    pub fn hover(&mut self, at: Pos2) {
        self.harness.event(Event::PointerMoved(at));
        self.frames(2);
    }

    pub fn drag(&mut self, from: Pos2, to: Pos2) {
        self.drag_with(from, to, Modifiers::NONE, PointerButton::Primary);
    }

    /// In steps, as a hand moves.
    pub fn drag_with(&mut self, from: Pos2, to: Pos2, modifiers: Modifiers, button: PointerButton) {
        self.hover(from);
        self.harness.event(Event::ModifiersChanged(modifiers));
        self.harness.event(Event::PointerButton { pos: from, button, pressed: true, modifiers });
        self.frames(1);
        const STEPS: usize = 8;
        for step in 1..=STEPS {
            let at = from + (to - from) * (step as f32 / STEPS as f32);
            self.harness.event(Event::ModifiersChanged(modifiers));
            self.harness.event(Event::PointerMoved(at));
            self.frames(1);
        }
        self.frames(1);
        self.harness.event(Event::ModifiersChanged(modifiers));
        self.harness.event(Event::PointerButton { pos: to, button, pressed: false, modifiers });
        self.frames(1);
        self.harness.event(Event::ModifiersChanged(Modifiers::NONE));
        self.frames(2);
    }

    pub fn key(&mut self, modifiers: Modifiers, key: Key) {
        self.harness.key_press_modifiers(modifiers, key);
        self.frames(3);
    }

    pub fn text(&mut self, text: &str) {
        self.harness.event(Event::Text(text.to_owned()));
        self.frames(2);
    }

    /// Puts a number or text into a field.
    pub fn fill(&mut self, name: &str, text: &str) {
        // The number beside a slider, which is at its end.
        let rect = self.rect(name);
        let at = if rect.width() > 140.0 { pos2(rect.right() - 16.0, rect.center().y) } else { rect.center() };
        self.click_at(at, Modifiers::NONE);
        self.key(Modifiers::COMMAND, Key::A);
        self.text(text);
        self.key(Modifiers::NONE, Key::Enter);
    }

    pub fn undo(&mut self) {
        self.key(Modifiers::COMMAND, Key::Z);
    }

    pub fn redo(&mut self) {
        self.key(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    }

    /// Chooses an entry of a menu.
    pub fn menu(&mut self, menu: &str, entry: &str) {
        // The menu's button comes before all else of that name.
        let button = self.harness.query_all_by_label(menu).next().unwrap_or_else(|| panic!("no menu {menu}"));
        let at = button.rect().center();
        self.click_at(at, Modifiers::NONE);
        self.frames(3);
        self.click(entry);
        self.frames(3);
    }

    /// A place within a part of the screen, by shares of its width and height.
    pub fn within(&self, name: &str, x: f32, y: f32) -> Pos2 {
        let rect = self.rect(name);
        pos2(rect.left() + x * rect.width(), rect.top() + y * rect.height())
    }

    pub fn node(&self, name: &str) -> &chiaro::graph::NodeEntry {
        self.document().nodes.get(name).unwrap_or_else(|| panic!("no node {name}"))
    }

    /// The pixels that the viewer shows, once it has come to rest.
    pub fn picture(&self) -> Arc<chiaro::image::Image> {
        assert!(self.harness.state().is_idle(), "what is shown may be coarse: settle first");
        self.state().last.as_ref().expect("something is shown").picture.clone()
    }
}

/// Whether there is a driver to draw with, software or not; says so when there is none.
pub fn can_draw() -> bool {
    static CAN: std::sync::OnceLock<bool> = std::sync::OnceLock::new();
    let can = *CAN.get_or_init(|| {
        let draw = || Harness::builder().with_size(vec2(8.0, 8.0)).build_ui(|_| {}).render().is_ok();
        std::panic::catch_unwind(draw).unwrap_or(false)
    });
    if !can {
        println!("skipped: no driver to draw with");
    }
    can
}

/// Beside a place.
pub fn aside(at: Pos2, x: f32, y: f32) -> Pos2 {
    at + Vec2::new(x, y)
}

impl Desk {
    /// Puts text into a field of several lines, which is left by a click elsewhere.
    pub fn fill_lines(&mut self, name: &str, text: &str) {
        let field = self.harness.query_all_by_label(name).find(|node| node.accesskit_node().is_text_input());
        let at = field.unwrap_or_else(|| panic!("no field {name}")).rect().center();
        self.click_at(at, Modifiers::NONE);
        self.key(Modifiers::COMMAND, Key::A);
        self.text(text);
    }
}
