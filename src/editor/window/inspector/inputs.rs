//! What the inputs of a node take from, chosen from lists: the way without a mouse.

use crate::editor::window::look::named;
use crate::editor::window::state::State;
use egui::{ComboBox, Ui, WidgetType};

pub fn ui(state: &mut State, node: &str, ui: &mut Ui) {
    let ports = state.inputs(node);
    if ports.is_empty() {
        return;
    }
    ui.weak("Inputs");
    for port in ports {
        let now = state.entry(node).and_then(|entry| entry.inputs.get(&port.name)).cloned();
        let mut wanted = now.clone();
        ui.horizontal(|ui| {
            ui.label(&port.name).on_hover_text(port.doc);
            let text = now.as_deref().unwrap_or(if port.optional { "—" } else { "must be connected" });
            let list = ComboBox::from_id_salt(("input", &port.name)).selected_text(text).show_ui(ui, |ui| {
                ui.selectable_value(&mut wanted, None, "—");
                for from in sources(state, node, port.kind) {
                    ui.selectable_value(&mut wanted, Some(from.clone()), from);
                }
            });
            named(list.response, WidgetType::ComboBox, format!("{} takes from", port.name));
        });
        if wanted == now {
            continue;
        }
        let label = if wanted.is_some() { "connect" } else { "disconnect" };
        state.change(label, None, |document| match &wanted {
            Some(from) => document.connect(from, node, &port.name),
            None => {
                document.disconnect(node, &port.name);
                Ok(())
            }
        });
    }
}

/// Outputs of the kind that do not depend on the node, as recipes write them.
fn sources(state: &State, node: &str, kind: Option<crate::value::Kind>) -> Vec<String> {
    let document = state.document();
    let mut found = Vec::new();
    for name in document.nodes.keys().filter(|name| !document.depends(name, node)) {
        for (number, port) in state.outputs(name).iter().enumerate() {
            if port.kind == kind {
                found.push(state.output_text(&(name.clone(), number)));
            }
        }
    }
    found
}
