//! The graph pane: nodes, wires, comments, and the palette that adds more.

mod arrange;
mod canvas;
mod comments;
mod draw;
mod node;
mod palette;

pub use arrange::{arrange, free_place, places};
pub use comments::around;

use super::state::State;
use canvas::{Canvas, Happened};
use palette::{Palette, Wanted};

#[derive(Default)]
pub struct GraphPane {
    canvas: Canvas,
    palette: Palette,
}

impl GraphPane {
    pub fn ui(&mut self, state: &mut State, ui: &mut egui::Ui) {
        let happened = self.canvas.ui(state, ui);
        for event in happened {
            self.react(event, state);
        }
        if self.palette.tab_opens(&self.canvas, ui) {
            let at = self.canvas.pointer(ui);
            self.palette.open(at, self.canvas.to_graph(at), None);
        }
    }

    pub fn palette(&mut self, state: &mut State, ui: &mut egui::Ui) {
        if let Some(wanted) = self.palette.ui(state, ui.ctx()) {
            add(wanted, state);
        }
    }

    pub fn open_palette(&mut self, ui_centre: egui::Pos2) {
        let at = if self.canvas.rect().contains(ui_centre) { ui_centre } else { self.canvas.rect().center() };
        self.palette.open(at, self.canvas.to_graph(at), None);
    }

    pub fn zoom_to_fit(&mut self) {
        self.canvas.fit();
    }

    fn react(&mut self, event: Happened, state: &mut State) {
        match event {
            Happened::Connect { from, node, port } => {
                state.change("connect", None, |document| document.connect(&from, &node, &port));
            }
            Happened::Disconnect { node, port } => {
                state.change("disconnect", None, |document| {
                    document.disconnect(&node, &port);
                    Ok(())
                });
            }
            Happened::Moved { nodes, by } => {
                state.change("move", Some("move"), |document| {
                    let places = places(document);
                    for node in &nodes {
                        let at = places.get(node).copied().unwrap_or_default();
                        document.layout.insert(node.clone(), [at[0] + by[0], at[1] + by[1]]);
                    }
                    Ok(())
                });
            }
            Happened::CommentMoved { number, nodes, by } => {
                state.change("move", Some("move"), |document| {
                    let places = places(document);
                    if let Some(comment) = document.comments.get_mut(number) {
                        comment.at = [comment.at[0] + by[0], comment.at[1] + by[1]];
                    }
                    for node in &nodes {
                        let at = places.get(node).copied().unwrap_or_default();
                        document.layout.insert(node.clone(), [at[0] + by[0], at[1] + by[1]]);
                    }
                    Ok(())
                });
            }
            Happened::Dropped => state.session.end_drag(),
            Happened::Palette { at, place, port } => self.palette.open(at, place, port),
            Happened::Mismatch { from, to } => {
                let message = format!("a {from} cannot go into a {to}");
                let help = "ports of the same colour fit together";
                state.complain(&crate::Error::usage(message, help));
            }
        }
    }
}

/// Adds what was chosen in the palette, connected to the port that it was dragged from.
fn add(wanted: Wanted, state: &mut State) {
    let Wanted { kind, at, port } = wanted;
    let Some(info) = state.session.node_type(kind).map(|node_type| node_type.info) else { return };
    let added = state.change(&format!("add {kind}"), None, |document| {
        let name = document.add_node(kind, at);
        match &port {
            Some(palette::Port { name: text, kind, is_output: true, .. }) => {
                if let Some(input) = info.inputs.iter().find(|input| Some(input.kind) == *kind) {
                    document.connect(text, &name, input.name)?;
                }
            }
            Some(palette::Port { node, name: port, kind, is_output: false }) => {
                if let Some(number) = info.outputs.iter().position(|output| Some(output.kind) == *kind) {
                    let from = if number == 0 { name.clone() } else { format!("{name}.{}", info.outputs[number].name) };
                    document.connect(&from, node, port)?;
                }
            }
            None => {}
        }
        Ok(name)
    });
    if let Some(name) = added {
        state.choose(&name);
    }
}
