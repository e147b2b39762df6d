//! What all panes share: the recipe, what is chosen in it, and what is known of its nodes.

use super::commands::Command;
use super::graph::places;
use super::known::{Known, Progress};
use crate::editor::look::Output;
use crate::editor::{Session, shown::Shown};
use crate::graph::{Document, NodeEntry};
use crate::node::Info;
use crate::params::NodeType;
use crate::value::Kind;
use crate::{Error, Result};
use egui_notify::Toasts;
use std::collections::HashMap;
use std::time::Duration;

pub struct State {
    pub session: Session,
    /// Names of nodes, the last chosen at the end: the one that the inspector shows.
    pub selected: Vec<String>,
    /// Number of a comment, chosen in place of nodes.
    pub comment: Option<usize>,
    /// What viewers show that are not held to a node of their own.
    pub viewed: Option<Output>,
    pub frame: i64,
    pub playing: bool,
    pub tool: Tool,
    pub brush: Brush,
    pub known: HashMap<String, Known>,
    /// Of an evaluation that runs.
    pub progress: Option<Progress>,
    pub toasts: Toasts,
    /// The last that was told, and whether it is a complaint; the status bar keeps it for those who read slowly, or hear.
    pub told: Option<(String, bool)>,
    /// Asked for by widgets; done once all panes are drawn.
    pub asked: Vec<Command>,
    /// The surfaces that the main viewer shows last, for tools that need a scene.
    pub last: Option<Shown>,
    /// The main viewer shows the frame in full.
    pub is_shown: bool,
    /// A node's parameter whose file is to be chosen.
    pub pick_file: Option<(String, String)>,
}

/// What a press on the picture does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tool {
    /// Looks at pixels, chooses objects, and moves the handles of the chosen node.
    #[default]
    Point,
    Brush,
    Light,
}

impl Tool {
    pub const ALL: [Tool; 3] = [Tool::Point, Tool::Brush, Tool::Light];

    pub fn name(self) -> &'static str {
        match self {
            Self::Point => "Point",
            Self::Brush => "Brush",
            Self::Light => "Light",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brush {
    /// Metres; with `adaptive` a factor of the distance to what is around.
    pub radius: f32,
    pub hardness: f32,
    pub value: f32,
    pub erase: bool,
    pub adaptive: bool,
}

impl Default for Brush {
    fn default() -> Self {
        Self { radius: 0.25, hardness: 0.5, value: 1.0, erase: false, adaptive: false }
    }
}

impl State {
    pub fn new(session: Session) -> Self {
        let frame = session.document().frames[0];
        let mut state = Self {
            session,
            selected: Vec::new(),
            comment: None,
            viewed: None,
            frame,
            playing: false,
            tool: Tool::Point,
            brush: Brush::default(),
            known: HashMap::new(),
            progress: None,
            toasts: Toasts::default(),
            told: None,
            asked: Vec::new(),
            last: None,
            is_shown: false,
            pick_file: None,
        };
        state.view_something();
        state
    }

    pub fn document(&self) -> &Document {
        self.session.document()
    }

    pub fn entry(&self, node: &str) -> Option<&NodeEntry> {
        self.document().nodes.get(node).map(|entry| &**entry)
    }

    /// The node that the inspector shows and handles belong to.
    pub fn chosen(&self) -> Option<&str> {
        self.selected.last().map(String::as_str)
    }

    pub fn choose(&mut self, node: &str) {
        self.selected = vec![node.to_owned()];
        self.comment = None;
    }

    pub fn ask(&mut self, command: Command) {
        self.asked.push(command);
    }

    /// Changes the recipe and tells what stands against it. Changes in a row with the same `mark` are undone as one.
    pub fn change<T>(
        &mut self,
        label: &str,
        mark: Option<&str>,
        change: impl FnOnce(&mut Document) -> Result<T>,
    ) -> Option<T> {
        match self.session.change(label, mark, |document| in_place(document, change)) {
            Ok(value) => Some(value),
            Err(error) => {
                self.complain(&error);
                None
            }
        }
    }

    pub fn complain(&mut self, error: &Error) {
        let text = match error.help() {
            "" => error.to_string(),
            help => format!("{error}\n{help}"),
        };
        self.told = Some((text.replace('\n', " — "), true));
        // Long enough to be read.
        self.toasts.error(text).duration(Duration::from_secs(12));
    }

    pub fn tell(&mut self, text: impl Into<String>) {
        let text = text.into();
        self.told = Some((text.clone(), false));
        self.toasts.info(text).duration(Duration::from_secs(4));
    }

    /// What is gone is no longer chosen or viewed; called after every change.
    pub fn tidy(&mut self) {
        let document = self.session.document().clone();
        self.selected.retain(|name| document.nodes.contains_key(name));
        self.known.retain(|name, _| document.nodes.contains_key(name));
        self.comment = self.comment.filter(|number| *number < document.comments.len());
        if self.viewed.as_ref().is_none_or(|(node, _)| !document.nodes.contains_key(node)) {
            self.view_something();
        }
    }

    /// The last picture that the recipe makes, if any.
    fn view_something(&mut self) {
        let of_kind = |wanted: &[Kind]| {
            let document = self.session.document();
            let taken = |name: &str| {
                let inputs = document.nodes.values().filter(|entry| entry.kind != "write_image");
                inputs.flat_map(|entry| entry.inputs.values()).any(|from| crate::graph::split(from).0 == name)
            };
            let fits = |name: &&String| {
                let info = self.session.info(name);
                info.and_then(|info| info.outputs.first()).is_some_and(|port| wanted.contains(&port.kind))
            };
            let mut names: Vec<&String> = document.nodes.keys().filter(fits).collect();
            names.sort_by_key(|name| !taken(name));
            names.last().map(|name| ((*name).clone(), 0))
        };
        self.viewed = of_kind(&[Kind::Image]).or_else(|| of_kind(&[Kind::Samples, Kind::Environment, Kind::Scene]));
    }

    pub fn node_type(&self, node: &str) -> Option<&'static NodeType> {
        self.session.node_type(&self.entry(node)?.kind)
    }

    pub fn info(&self, node: &str) -> Option<&'static Info> {
        self.session.info(node)
    }
}

/// Makes a change to a recipe as it is seen: nodes without a place of their own stay where they are shown when others come
/// to lie beside them. A change that moves nothing leaves them without.
fn in_place<T>(document: &mut Document, change: impl FnOnce(&mut Document) -> Result<T>) -> Result<T> {
    let own = document.layout.clone();
    let places = places(document);
    for name in document.nodes.keys() {
        document.layout.entry(name.clone()).or_insert_with(|| places[name]);
    }
    let shown = document.layout.clone();
    let value = change(document)?;
    if document.layout == shown {
        document.layout = own;
    }
    Ok(value)
}
