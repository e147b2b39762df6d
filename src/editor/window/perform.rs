//! What commands do.

use super::commands::Command;
use super::state::{State, Tool};
use super::viewer::{Camera, Viewer};
use super::{Pane, Window, graph};
use crate::Error;
use crate::editor::look::Output;

/// Between what is copied and its copy.
const ASIDE: [f64; 2] = [40.0, 40.0];

impl Window {
    pub(super) fn perform(&mut self, command: Command, ctx: &egui::Context) {
        let state = &mut self.state;
        if self.files.perform(&command, state) {
            return;
        }
        match command {
            Command::Undo if !state.session.undo() => state.tell("nothing to undo"),
            Command::Redo if !state.session.redo() => state.tell("nothing to redo"),
            Command::Copy => copy(state, ctx),
            Command::Cut => {
                copy(state, ctx);
                delete(state);
            }
            // A menu cannot read the clipboard; the system sends what it holds.
            Command::Paste(None) => ctx.send_viewport_cmd(egui::ViewportCommand::RequestPaste),
            Command::Paste(Some(text)) => paste(state, &text),
            Command::Duplicate => {
                let text = state.document().copy(&state.selected);
                paste(state, &text);
            }
            Command::Delete => delete(state),
            Command::SelectAll => state.selected = state.document().nodes.keys().cloned().collect(),
            Command::Mute => mute(state),
            Command::Comment => comment(state),
            Command::AlignLeft => align(state, 0),
            Command::AlignTop => align(state, 1),
            Command::Arrange => {
                let places = graph::arrange(state.document());
                state.change("arrange", None, |document| {
                    document.layout = document.nodes.keys().map(|name| (name.clone(), places[name])).collect();
                    Ok(())
                });
                self.graph.zoom_to_fit();
            }
            Command::ZoomToFit => self.graph.zoom_to_fit(),
            Command::AddNode => {
                let at = ctx.input(|input| input.pointer.hover_pos()).unwrap_or_default();
                self.graph.open_palette(at);
            }
            Command::View => match state.chosen().map(str::to_owned) {
                Some(name) => state.viewed = Some((name, 0)),
                None => state.tell("select a node first"),
            },
            Command::Compare => {
                let other: Option<Output> = state.chosen().map(|name| (name.to_owned(), 0));
                if let Some(viewer) = self.viewers_mut().next() {
                    viewer.compare_with(other);
                }
            }
            Command::Cancel => {
                self.state.progress = None;
                self.viewers_mut().for_each(|viewer| viewer.cancel());
            }
            Command::NewViewer => self.add_viewer(ctx, Camera::free()),
            Command::EnvironmentViewer => self.add_viewer(ctx, Camera::Environment),
            Command::PlayPause => state.playing = !state.playing,
            Command::NextFrame => self.timeline.step(state, 1),
            Command::PreviousFrame => self.timeline.step(state, -1),
            Command::NextKey => self.timeline.step_key(state, true),
            Command::PreviousKey => self.timeline.step_key(state, false),
            Command::Point => state.tool = Tool::Point,
            Command::Brush => state.tool = Tool::Brush,
            Command::Light => state.tool = Tool::Light,
            Command::BrushSmaller => state.brush.radius = (state.brush.radius / 1.25).max(1e-4),
            Command::BrushLarger => state.brush.radius = (state.brush.radius * 1.25).min(1e4),
            Command::FindLight => {
                if let Some(found) =
                    state.change("find light", None, crate::editor::hands::find_light_of(&state.selected.clone()))
                {
                    state.choose(&found.edit);
                    self.add_environment(ctx, &found.picture);
                }
            }
            Command::Theme => {
                let dark = ctx.global_style().visuals.dark_mode;
                ctx.set_theme(if dark { egui::Theme::Light } else { egui::Theme::Dark });
            }
            Command::Tour => self.help.tour(),
            Command::Shortcuts => self.help.shortcuts(),
            // Done by `files`, or above.
            _ => {}
        }
    }

    fn add_viewer(&mut self, ctx: &egui::Context, camera: Camera) {
        let viewer = Viewer::new(ctx, &self.engine, self.viewers, camera);
        self.viewers += 1;
        let tile = self.panes.tiles.insert_pane(Pane::Viewer(Box::new(viewer)));
        // Beside the main viewer, so that both are seen.
        let is_main = |tile: &egui_tiles::Tile<Pane>| matches!(tile, egui_tiles::Tile::Pane(Pane::Viewer(viewer)) if viewer.is_main());
        let main = self.panes.tiles.iter().find(|(_, tile)| is_main(tile)).map(|(id, _)| *id);
        let tabs = main.and_then(|main| self.panes.tiles.parent_of(main));
        let above = tabs.and_then(|tabs| self.panes.tiles.parent_of(tabs));
        match (tabs, above) {
            (Some(tabs), Some(above)) => {
                let row = self.panes.tiles.insert_horizontal_tile(vec![tabs, tile]);
                if let Some(egui_tiles::Tile::Container(container)) = self.panes.tiles.get_mut(above) {
                    let _ = container.replace_child(tabs, row);
                }
            }
            _ => drop(self.panes.root.map(|root| self.panes.move_tile_to_container(tile, root, usize::MAX, true))),
        }
    }

    /// A viewer that stays with one node: the located light on its environment.
    fn add_environment(&mut self, ctx: &egui::Context, node: &str) {
        if !self.viewers_mut().any(|viewer| viewer.shows_environment()) {
            self.add_viewer(ctx, Camera::Environment);
        }
        let node = node.to_owned();
        self.viewers_mut()
            .filter(|viewer| viewer.shows_environment())
            .for_each(|viewer| viewer.hold((node.clone(), 0)));
    }
}

fn copy(state: &mut State, ctx: &egui::Context) {
    if state.selected.is_empty() {
        return state.tell("select nodes first");
    }
    ctx.copy_text(state.document().copy(&state.selected));
}

fn paste(state: &mut State, text: &str) {
    let names = state.change("paste", None, |document| {
        document.paste(text, ASIDE).map_err(|_| {
            Error::usage("the clipboard holds no nodes", "copy nodes of a recipe, or its text, and paste again")
        })
    });
    if let Some(names) = names {
        state.selected = names;
    }
}

fn delete(state: &mut State) {
    let (nodes, comment) = (state.selected.clone(), state.comment);
    if nodes.is_empty() && comment.is_none() {
        return;
    }
    state.change("delete", None, |document| {
        document.remove_nodes(&nodes);
        if let Some(number) = comment.filter(|number| *number < document.comments.len()) {
            document.comments.remove(number);
        }
        Ok(())
    });
    (state.selected, state.comment) = (Vec::new(), None);
}

/// All of them, unless all are muted already.
fn mute(state: &mut State) {
    let nodes = state.selected.clone();
    let is_muted = |name: &String| state.entry(name).is_some_and(|entry| entry.muted);
    let muted = !nodes.iter().all(is_muted);
    let label = if muted { "mute" } else { "unmute" };
    state.change(label, None, |document| {
        for name in &nodes {
            if let Some(entry) = document.entry_mut(name) {
                entry.muted = muted;
            }
        }
        Ok(())
    });
}

fn comment(state: &mut State) {
    let places = graph::places(state.document());
    let around: Vec<[f64; 2]> = state.selected.iter().filter_map(|name| places.get(name).copied()).collect();
    let around = if around.is_empty() { vec![graph::free_place(state)] } else { around };
    let number = state.document().comments.len();
    state.change("comment", None, |document| {
        document.comments.push(graph::around(&around));
        Ok(())
    });
    state.selected.clear();
    state.comment = Some(number);
}

/// Along an axis, to the least of them.
fn align(state: &mut State, axis: usize) {
    let places = graph::places(state.document());
    let nodes = state.selected.clone();
    let least = nodes.iter().map(|name| places[name][axis]).fold(f64::INFINITY, f64::min);
    state.change("align", None, |document| {
        for name in &nodes {
            let mut at = places[name];
            at[axis] = least;
            document.layout.insert(name.clone(), at);
        }
        Ok::<_, Error>(())
    });
}
