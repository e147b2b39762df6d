//! When no node is chosen: a comment, or the recipe itself.

use super::trouble;
use crate::editor::window::commands::Command;
use crate::editor::window::look::named;
use crate::editor::window::state::State;
use egui::{Ui, WidgetType};

/// The recipe itself.
pub fn ui(state: &mut State, ui: &mut Ui) {
    ui.heading("Recipe");
    let document = state.document();
    ui.label(format!("{} nodes", document.nodes.len()));
    let (mut frames, mut fps) = (document.frames, document.fps);
    ui.horizontal(|ui| {
        ui.label("Frames");
        named(ui.add(egui::DragValue::new(&mut frames[0])), WidgetType::DragValue, "first frame");
        ui.label("to");
        named(ui.add(egui::DragValue::new(&mut frames[1])), WidgetType::DragValue, "last frame");
    });
    ui.horizontal(|ui| {
        ui.label("Frames per second");
        let speed = egui::DragValue::new(&mut fps).range(0.1..=1000.0).speed(0.1);
        named(ui.add(speed), WidgetType::DragValue, "frames per second");
    });
    frames[1] = frames[1].max(frames[0]);
    if (frames, fps) != (document.frames, document.fps) {
        state.change("frames", Some("frames"), |document| {
            (document.frames, document.fps) = (frames, fps);
            Ok(())
        });
    }
    let problems: Vec<(String, String)> = state
        .session
        .problems_of_whole()
        .iter()
        .map(|problem| (problem.message.clone(), problem.help.clone()))
        .collect();
    problems.iter().for_each(|(message, help)| trouble(message, help, ui));
    ui.separator();
    ui.weak("Choose a node to see its parameters. Tab over the graph adds one.");
}

pub fn comment(state: &mut State, number: usize, ui: &mut Ui) {
    let Some(comment) = state.document().comments.get(number) else { return };
    ui.heading("Comment");
    let mut text = comment.text.clone();
    let mut size = comment.size;
    let label = ui.label("Text").id;
    ui.text_edit_multiline(&mut text).labelled_by(label);
    ui.horizontal(|ui| {
        ui.label("Size");
        named(ui.add(egui::DragValue::new(&mut size[0]).range(60.0..=1e5)), WidgetType::DragValue, "comment width");
        named(ui.add(egui::DragValue::new(&mut size[1]).range(40.0..=1e5)), WidgetType::DragValue, "comment height");
    });
    if (&text, size) != (&comment.text, comment.size) {
        state.change("comment", Some("comment"), |document| {
            (document.comments[number].text, document.comments[number].size) = (text, size);
            Ok(())
        });
    }
    if ui.button("Delete comment").clicked() {
        state.ask(Command::Delete);
    }
}
