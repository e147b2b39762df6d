//! The chosen node, made from its own description: parameters with units, ranges, words, reset and keys; what its inputs
//! take from; what is wrong, and what to do about it.

mod curve;
mod field;
mod inputs;
mod recipe;
mod tools;

use super::commands::Command;
use super::help::Help;
use super::look::{self, named};
use super::state::State;
use crate::editor::keys;
use crate::fields::{Field, fields};
use crate::params::NodeType;
use egui::{RichText, Ui, WidgetType};
use serde_json::Value as Json;
use std::borrow::Cow;
use std::collections::HashMap;

#[derive(Default)]
pub struct Inspector {
    /// Of each type, read once.
    fields: HashMap<&'static str, Vec<Field>>,
    /// Texts that are being typed, by what they belong to.
    drafts: field::Drafts,
}

impl Inspector {
    pub fn ui(&mut self, state: &mut State, help: &mut Help, ui: &mut Ui) {
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.set_width(ui.available_width());
            match (state.chosen().map(str::to_owned), state.comment) {
                (Some(node), _) => self.node(state, help, &node, ui),
                (None, Some(number)) => recipe::comment(state, number, ui),
                (None, None) => recipe::ui(state, ui),
            }
        });
    }

    fn node(&mut self, state: &mut State, help: &mut Help, node: &str, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let label = ui.label("Name").id;
            let typed = self.drafts.line(ui, &format!("name of {node}"), node, 140.0);
            if let Some(name) = typed.done
                && state.change("rename", None, |document| document.rename(node, &name)).is_some()
            {
                renamed(state, node, &name);
            }
            typed.response.labelled_by(label);
        });
        let Some(entry) = state.document().nodes.get(node).cloned() else { return };
        ui.horizontal(|ui| {
            ui.label(RichText::new(&entry.kind).strong());
            let mut muted = entry.muted;
            if ui.checkbox(&mut muted, "Muted").changed() {
                state.ask(Command::Mute);
            }
            if ui.button("View").clicked() {
                state.ask(Command::View);
            }
            if let Some(node_type) = state.node_type(node)
                && ui.small_button("?").on_hover_text("what this node does").clicked()
            {
                help.explain(node_type.info);
            }
        });
        troubles(state, node, ui);
        let Some(node_type) = state.node_type(node) else {
            ui.label("This version does not know this type of node. It is kept as it is, and saved back unharmed.");
            let text = serde_json::to_string_pretty(&entry.to_json()).unwrap_or_default();
            ui.label(RichText::new(text).monospace().size(11.0));
            return;
        };
        ui.label(RichText::new(node_type.info.summary).weak());
        ui.separator();
        self.params(state, node, node_type, ui);
        tools::ui(state, node, &entry.kind, ui);
        ui.separator();
        inputs::ui(state, node, ui);
        known(state, node, ui);
    }

    fn params(&mut self, state: &mut State, node: &str, node_type: &'static NodeType, ui: &mut Ui) {
        let all = self.fields.entry(node_type.info.name).or_insert_with(|| fields(node_type)).clone();
        for field in &all {
            ui.push_id(&field.name, |ui| self.param(state, node, field, ui));
        }
    }

    fn param(&mut self, state: &mut State, node: &str, field: &Field, ui: &mut Ui) {
        let Some(entry) = state.document().nodes.get(node).cloned() else { return };
        let given = entry.params.get(&field.name);
        let frame = state.frame;
        let keyed = keys::keys(state.document(), node, &field.name);
        let value = given.map_or(Cow::Borrowed(&field.default), |given| keys::value_at(given, frame as f64));
        let mut asked = None;
        ui.horizontal(|ui| {
            let at_key = keyed.as_ref().is_some_and(|keys| keys.iter().any(|(key, _)| *key == frame as f64));
            let words = if at_key { "takes the key at this frame out" } else { "sets a key at this frame" };
            let diamond = look::diamond(ui, at_key, keyed.is_some(), &format!("key of {}", field.name));
            if diamond.on_hover_text(words).clicked() {
                asked = Some(if at_key { Asked::RemoveKey } else { Asked::Key });
            }
            let title = RichText::new(&field.name);
            let title = if given.is_some() { title.strong() } else { title.weak() };
            ui.label(title).on_hover_text(words_of(field));
            if given.is_some() {
                let reset = ui.add(egui::Button::new("⟲").frame(false));
                let reset = named(reset, WidgetType::Button, format!("reset {}", field.name));
                if reset.on_hover_text(format!("back to {}", field.default)).clicked() {
                    asked = Some(Asked::Reset);
                }
            }
        });
        let changed = field::ui(&mut self.drafts, node, field, &value, ui);
        if let Some(changed) = changed.value {
            let mark = format!("{node}.{}", field.name);
            state.change(&format!("{node}.{}", field.name), Some(&mark), |document| {
                keys::set(document, node, &field.name, changed, frame);
                Ok(())
            });
        }
        if changed.pick_file {
            state.pick_file = Some((node.to_owned(), field.name.clone()));
        }
        if changed.is_over {
            state.session.end_drag();
        }
        let Some(asked) = asked else { return };
        state.change(&format!("{node}.{}", field.name), None, |document| {
            match asked {
                Asked::Key => keys::set_key(document, node, &field.name, value.into_owned(), frame as f64),
                Asked::RemoveKey => keys::remove_key(document, node, &field.name, frame as f64),
                Asked::Reset => document.set_param(node, &field.name, None),
            }
            Ok(())
        });
    }
}

enum Asked {
    Key,
    RemoveKey,
    Reset,
}

/// Unit, range and words of a parameter.
fn words_of(field: &Field) -> String {
    let mut text = field.doc.clone();
    if !field.unit.is_empty() {
        text += &format!("\nUnit: {}", field.unit);
    }
    if let crate::fields::Shape::Number(range) = &field.shape {
        let end = |end: Option<f64>| end.map_or("…".to_owned(), |end| end.to_string());
        if range.least.is_some() || range.most.is_some() {
            text += &format!("\nFrom {} to {}", end(range.least), end(range.most));
        }
    }
    if field.default != Json::Null {
        text += &format!("\nDefault: {}", field.default);
    }
    text
}

/// What is chosen and viewed goes by the new name.
fn renamed(state: &mut State, old: &str, new: &str) {
    for name in &mut state.selected {
        if name == old {
            new.clone_into(name);
        }
    }
    if let Some((node, _)) = &mut state.viewed
        && node == old
    {
        new.clone_into(node);
    }
    if let Some(known) = state.known.remove(old) {
        state.known.insert(new.to_owned(), known);
    }
}

fn known(state: &State, node: &str, ui: &mut Ui) {
    let Some(known) = state.known.get(node) else { return };
    let Some(seconds) = known.seconds else { return };
    let size = known.bytes as f64 / f64::from(1 << 20);
    ui.separator();
    ui.weak(format!("computed in {}, {size:.1} MiB", look::seconds(seconds)));
}

fn troubles(state: &State, node: &str, ui: &mut Ui) {
    for problem in state.session.problems_of(node) {
        trouble(&problem.message, &problem.help, ui);
    }
    let Some(known) = state.known.get(node) else { return };
    if let Some((message, help)) = &known.error {
        trouble(message, help, ui);
    }
    for warning in &known.warnings {
        ui.colored_label(ui.visuals().warn_fg_color, format!("⚠ {warning}"));
    }
}

fn trouble(message: &str, help: &str, ui: &mut Ui) {
    ui.colored_label(ui.visuals().error_fg_color, format!("⚠ {message}"));
    if !help.is_empty() {
        ui.label(help);
    }
}
