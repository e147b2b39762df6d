//! What a node shows of itself: name and type, what it made, how long that took, and what is wrong with it.

use crate::editor::window::commands::Command;
use crate::editor::window::look;
use crate::editor::window::state::State;
use crate::eval::CacheUse;
use egui::{RichText, Ui};

/// What is wrong with a node, and what to do about it.
pub fn complaint(state: &State, name: &str) -> Option<(String, String)> {
    let of_recipe = state.session.problems_of(name).first();
    let of_recipe = of_recipe.map(|problem| (problem.message.clone(), problem.help.clone()));
    of_recipe.or_else(|| state.known.get(name)?.error.clone())
}

pub fn header(state: &State, name: &str, ui: &mut Ui) {
    ui.style_mut().interaction.selectable_labels = false;
    let entry = state.entry(name);
    let is_muted = entry.is_some_and(|entry| entry.muted);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        if state.viewed.as_ref().is_some_and(|(viewed, _)| viewed == name) {
            ui.label("👁").on_hover_text("shown in the viewer");
        }
        let title = RichText::new(name).strong();
        ui.label(if is_muted { title.strikethrough() } else { title });
        let kind = entry.map_or("", |entry| entry.kind.as_str());
        if kind != name {
            ui.label(RichText::new(kind).weak().size(11.0));
        }
        if let Some((message, help)) = complaint(state, name) {
            let sign = RichText::new("⚠").color(ui.visuals().error_fg_color);
            ui.label(sign).on_hover_text(format!("{message}\n{help}"));
        } else if let Some(warning) = state.known.get(name).and_then(|known| known.warnings.first()) {
            ui.label(RichText::new("⚠").color(ui.visuals().warn_fg_color)).on_hover_text(warning);
        }
    });
}

pub fn footer(state: &State, name: &str, ui: &mut Ui) {
    ui.style_mut().interaction.selectable_labels = false;
    ui.spacing_mut().interact_size.y = 0.0;
    if let Some(progress) = state.progress.as_ref().filter(|progress| progress.node == name) {
        let share = progress.done as f32 / progress.total.max(1) as f32;
        let bar = egui::ProgressBar::new(share).desired_width(110.0).desired_height(6.0);
        ui.add(bar).on_hover_text(&progress.stage);
    }
    let Some(known) = state.known.get(name) else { return };
    ui.vertical(|ui| {
        if let Some(thumb) = &known.thumb {
            ui.image(thumb);
        }
        let (share, words) = match known.cache {
            Some(CacheUse::Memory) => (1.0, "held in memory"),
            Some(CacheUse::Disk) => (0.5, "read from the disk cache"),
            Some(CacheUse::Computed) => (0.0, "computed the last time"),
            Some(CacheUse::Pass) => (0.0, "passes its input on"),
            None => return,
        };
        let time = known.seconds.map(look::seconds).unwrap_or_default();
        let size = known.bytes as f64 / f64::from(1 << 20);
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            look::disc(ui, share);
            let text = RichText::new(time).weak().size(10.0);
            ui.label(text).on_hover_text(format!("{words}; {size:.1} MiB"));
        });
    });
}

/// As it is read out.
pub fn spoken(state: &State, name: &str) -> String {
    let entry = state.entry(name);
    let kind = entry.map_or("", |entry| entry.kind.as_str());
    let mut text = format!("node {name}");
    if kind != name {
        text += &format!(", {kind}");
    }
    if entry.is_some_and(|entry| entry.muted) {
        text += ", muted";
    }
    if complaint(state, name).is_some() {
        text += ", has a problem";
    }
    text
}

pub fn menu(state: &mut State, name: &str, ui: &mut Ui) {
    if !state.selected.iter().any(|selected| selected == name) {
        state.choose(name);
    }
    for (label, command) in [
        ("View", Command::View),
        ("Compare with it", Command::Compare),
        ("Mute or unmute", Command::Mute),
        ("Duplicate", Command::Duplicate),
        ("Comment around it", Command::Comment),
        ("Delete", Command::Delete),
    ] {
        if ui.button(label).clicked() {
            state.ask(command);
            ui.close();
        }
    }
}
