//! All that can be asked for by menu or key: one table, from which menus, keys and the list of shortcuts are made.

use egui::{Key, KeyboardShortcut, Modifiers};
use std::path::PathBuf;

#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    New,
    Open,
    OpenFile(PathBuf),
    Save,
    SaveAs,
    Quit,
    Undo,
    Redo,
    Cut,
    Copy,
    Paste(Option<String>),
    Duplicate,
    Delete,
    SelectAll,
    Mute,
    Comment,
    AlignLeft,
    AlignTop,
    Arrange,
    ZoomToFit,
    AddNode,
    View,
    Compare,
    Cancel,
    NewViewer,
    EnvironmentViewer,
    PlayPause,
    NextFrame,
    PreviousFrame,
    NextKey,
    PreviousKey,
    Point,
    Brush,
    Light,
    FindLight,
    BrushSmaller,
    BrushLarger,
    Theme,
    Tour,
    Example,
    Shortcuts,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Menu {
    File,
    Edit,
    Graph,
    View,
    Picture,
    Time,
    Help,
}

impl Menu {
    pub const ALL: [Menu; 7] = [Menu::File, Menu::Edit, Menu::Graph, Menu::View, Menu::Picture, Menu::Time, Menu::Help];

    pub fn name(self) -> &'static str {
        match self {
            Self::File => "File",
            Self::Edit => "Edit",
            Self::Graph => "Graph",
            Self::View => "View",
            Self::Picture => "Picture",
            Self::Time => "Time",
            Self::Help => "Help",
        }
    }
}

pub struct Entry {
    pub command: Command,
    pub menu: Menu,
    pub label: &'static str,
    pub key: Option<KeyboardShortcut>,
}

const fn entry(command: Command, menu: Menu, label: &'static str, key: Option<KeyboardShortcut>) -> Entry {
    Entry { command, menu, label, key }
}

const fn plain(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::NONE, key))
}

const fn with(modifiers: Modifiers, key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(modifiers, key))
}

const CTRL: Modifiers = Modifiers::COMMAND;
const CTRL_SHIFT: Modifiers = Modifiers::COMMAND.plus(Modifiers::SHIFT);

/// In the order of the menus. Cut, copy and paste come from the system as events of their own; their keys stand here to be
/// read.
pub const ALL: &[Entry] = &[
    entry(Command::New, Menu::File, "New", with(CTRL, Key::N)),
    entry(Command::Open, Menu::File, "Open…", with(CTRL, Key::O)),
    entry(Command::Save, Menu::File, "Save", with(CTRL, Key::S)),
    entry(Command::SaveAs, Menu::File, "Save as…", with(CTRL_SHIFT, Key::S)),
    entry(Command::Quit, Menu::File, "Quit", with(CTRL, Key::Q)),
    entry(Command::Undo, Menu::Edit, "Undo", with(CTRL, Key::Z)),
    entry(Command::Redo, Menu::Edit, "Redo", with(CTRL_SHIFT, Key::Z)),
    entry(Command::Cut, Menu::Edit, "Cut", with(CTRL, Key::X)),
    entry(Command::Copy, Menu::Edit, "Copy", with(CTRL, Key::C)),
    entry(Command::Paste(None), Menu::Edit, "Paste", with(CTRL, Key::V)),
    entry(Command::Duplicate, Menu::Edit, "Duplicate", with(CTRL, Key::D)),
    entry(Command::Delete, Menu::Edit, "Delete", plain(Key::Delete)),
    entry(Command::SelectAll, Menu::Edit, "Select all", with(CTRL, Key::A)),
    entry(Command::AddNode, Menu::Graph, "Add a node…", plain(Key::Tab)),
    entry(Command::Mute, Menu::Graph, "Mute or unmute", plain(Key::M)),
    entry(Command::Comment, Menu::Graph, "Comment around the selection", with(CTRL, Key::G)),
    entry(Command::AlignLeft, Menu::Graph, "Align left", with(CTRL_SHIFT, Key::L)),
    entry(Command::AlignTop, Menu::Graph, "Align top", with(CTRL_SHIFT, Key::T)),
    entry(Command::Arrange, Menu::Graph, "Arrange by order", with(CTRL_SHIFT, Key::A)),
    entry(Command::ZoomToFit, Menu::Graph, "Zoom to fit", plain(Key::F)),
    entry(Command::View, Menu::View, "View the selected node", plain(Key::Num1)),
    entry(Command::Compare, Menu::View, "Compare with the selected node", plain(Key::Num2)),
    entry(Command::NewViewer, Menu::View, "New free viewer", with(CTRL, Key::E)),
    entry(Command::EnvironmentViewer, Menu::View, "Environment panel", with(CTRL_SHIFT, Key::E)),
    entry(Command::Cancel, Menu::View, "Cancel the evaluation", plain(Key::Escape)),
    entry(Command::Theme, Menu::View, "Dark or light", with(CTRL_SHIFT, Key::D)),
    entry(Command::Point, Menu::Picture, "Point: probe and handles", plain(Key::V)),
    entry(Command::Brush, Menu::Picture, "Brush: paint a selection", plain(Key::B)),
    entry(Command::Light, Menu::Picture, "Light: place a light", plain(Key::L)),
    entry(Command::BrushSmaller, Menu::Picture, "Smaller brush", plain(Key::OpenBracket)),
    entry(Command::BrushLarger, Menu::Picture, "Larger brush", plain(Key::CloseBracket)),
    entry(Command::FindLight, Menu::Picture, "Find the light of the painted shadow", with(CTRL, Key::F)),
    entry(Command::PlayPause, Menu::Time, "Play or pause", plain(Key::Space)),
    entry(Command::NextFrame, Menu::Time, "Next frame", plain(Key::ArrowRight)),
    entry(Command::PreviousFrame, Menu::Time, "Previous frame", plain(Key::ArrowLeft)),
    entry(Command::NextKey, Menu::Time, "Next key", plain(Key::ArrowUp)),
    entry(Command::PreviousKey, Menu::Time, "Previous key", plain(Key::ArrowDown)),
    entry(Command::Example, Menu::Help, "Open the example", None),
    entry(Command::Tour, Menu::Help, "Tour", None),
    entry(Command::Shortcuts, Menu::Help, "Shortcuts", plain(Key::F1)),
];

/// What keys and the clipboard ask for, unless somebody is typing.
pub fn pressed(ctx: &egui::Context) -> Vec<Command> {
    let typing = ctx.egui_wants_keyboard_input();
    let mut asked = Vec::new();
    ctx.input_mut(|input| {
        // Longer combinations first, so that Ctrl+Shift+Z is not taken for Ctrl+Z.
        for shift in [true, false] {
            for entry in ALL {
                let Some(key) = entry.key.filter(|key| key.modifiers.shift == shift) else { continue };
                let is_safe =
                    key.modifiers.command && !matches!(key.logical_key, Key::A | Key::Z | Key::X | Key::C | Key::V);
                if (!typing || is_safe) && input.consume_shortcut(&key) {
                    asked.push(entry.command.clone());
                }
            }
        }
        if !typing {
            if input.consume_key(Modifiers::COMMAND, Key::Y) {
                asked.push(Command::Redo);
            }
            if input.consume_key(Modifiers::NONE, Key::Backspace) {
                asked.push(Command::Delete);
            }
            for event in &input.events {
                match event {
                    egui::Event::Copy => asked.push(Command::Copy),
                    egui::Event::Cut => asked.push(Command::Cut),
                    egui::Event::Paste(text) => asked.push(Command::Paste(Some(text.clone()))),
                    _ => {}
                }
            }
        }
    });
    asked
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_means_two_things() {
        for (i, entry) in ALL.iter().enumerate() {
            let same = |other: &&Entry| other.key.is_some() && other.key == entry.key;
            assert!(!ALL[..i].iter().any(|other| same(&other)), "{} has a key that is taken", entry.label);
            assert!(!ALL[..i].iter().any(|other| other.label == entry.label));
        }
    }
}
