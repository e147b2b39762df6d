//! Buttons that bring handles into the picture, or lead on from what was found.

use crate::editor::hands::find::{SHADOW_EDITS, edit_shadow};
use crate::editor::hands::handles::begun;
use crate::editor::window::commands::Command;
use crate::editor::window::state::State;
use egui::Ui;
use serde_json::Value as Json;

pub fn ui(state: &mut State, node: &str, kind: &str, ui: &mut Ui) {
    let aspect =
        state.last.as_ref().map_or(4.0 / 3.0, |shown| shown.picture.width as f32 / shown.picture.height.max(1) as f32);
    if let Some((param, value)) = begun(kind, aspect)
        && state.entry(node).is_some_and(|entry| entry.params.get(param).is_none_or(Json::is_null))
    {
        let label = if param == "corners" { "Pull by the corners" } else { "Draw a gradient" };
        if ui.button(label).clicked() {
            state.change(label, None, |document| {
                document.set_param(node, param, Some(value));
                Ok(())
            });
        }
    }
    if kind == "localize_light" {
        ui.separator();
        ui.label("Its shadow:");
        ui.horizontal_wrapped(|ui| {
            for (kind, label) in SHADOW_EDITS {
                if ui.button(label).clicked()
                    && let Some(edit) = state.change(label, None, |document| edit_shadow(document, node, kind))
                {
                    state.choose(&edit);
                }
            }
        });
    }
    if kind == "paint" && ui.button("Find light").on_hover_text("the light of the shadow that is painted").clicked() {
        state.ask(Command::FindLight);
    }
}
