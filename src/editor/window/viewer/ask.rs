//! What is asked of the worker: again whenever the recipe, the frame or the look has changed.

use super::{Camera, Viewer};
use crate::editor::look::{Look, Output};
use crate::editor::window::state::{State, Tool};
use crate::editor::worker::Request;
use crate::value::Kind;

/// What was asked of the worker last.
#[derive(PartialEq)]
pub struct Asked {
    content: u64,
    frame: i64,
    look: Look,
}

impl Viewer {
    pub(super) fn has_asked(&self, state: &State) -> bool {
        match (self.look(state), &self.asked) {
            (Some(look), Some(asked)) => {
                asked.look == look && (asked.content, asked.frame) == (state.session.content(), state.frame)
            }
            (None, _) => true,
            (Some(_), None) => false,
        }
    }

    pub(super) fn at(&self, state: &State) -> Option<Output> {
        let held = self.held.clone().filter(|(node, _)| state.document().nodes.contains_key(node));
        match self.camera {
            Camera::Environment => held.or_else(|| {
                let is_map = |name: &&String| {
                    let outputs = state.outputs(name);
                    state.document().nodes[*name].kind == "environment_image"
                        || outputs.first().is_some_and(|port| port.kind == Some(Kind::Environment))
                };
                state.document().nodes.keys().rev().find(is_map).map(|name| (name.clone(), 0))
            }),
            _ => held.or_else(|| state.viewed.clone()),
        }
    }

    pub(super) fn look(&self, state: &State) -> Option<Look> {
        let at = self.at(state)?;
        let mut look = Look { other: self.other.clone(), ..Look::new(&at.0, at.1) };
        look.other = look.other.filter(|(node, _)| state.document().nodes.contains_key(node));
        match &self.camera {
            Camera::Recipe => look.mask = mask(state),
            Camera::Free(free) => {
                look.eye = Some(free.orbit.as_ref()?.eye(free.size));
                look.clay = !free.lit;
                look.mask = mask(state);
            }
            Camera::Environment => {}
        }
        if self.camera != Camera::Environment {
            let is_dragged = |name: &&str| {
                let entry = state.entry(name);
                entry.is_some_and(|entry| ["translate_shadow", "rotate_shadow"].contains(&entry.kind.as_str()))
            };
            look.shadow = state.chosen().filter(is_dragged).map(str::to_owned);
        }
        Some(look)
    }

    pub(super) fn ask(&mut self, state: &mut State) {
        let Some(look) = self.look(state) else { return };
        let asked = Asked { content: state.session.content(), frame: state.frame, look };
        if self.asked.as_ref() == Some(&asked) {
            return;
        }
        let request = Request {
            document: state.session.document().clone(),
            look: asked.look.clone(),
            frame: asked.frame,
            settings: self.settings.clone(),
        };
        if self.is_main() {
            state.known.values_mut().for_each(|known| known.error = None);
        }
        self.request = self.worker.request(request);
        self.asked = Some(asked);
    }
}

/// The selection that is chosen, or is being painted.
fn mask(state: &State) -> Option<Output> {
    let chosen = state.chosen()?;
    let gives = |node: &str| state.info(node).and_then(|info| info.outputs.first()).map(|port| port.kind);
    if gives(chosen) == Some(Kind::Selection) {
        return Some((chosen.to_owned(), 0));
    }
    if state.tool != Tool::Brush {
        return None;
    }
    let inputs = &state.entry(chosen)?.inputs;
    let painted = |from: &&String| {
        let node = crate::graph::split(from).0;
        state.entry(node).is_some_and(|entry| ["paint", "select"].contains(&entry.kind.as_str()))
    };
    inputs.values().find(painted).and_then(|from| state.output_number(from))
}
