//! Frames: scrubbing, keys that are set and moved, their curves, and playback.

mod curves;
mod ruler;

use super::look::named;
use super::state::State;
use crate::editor::keys;
use egui::{Context, Ui, WidgetType};
use std::time::Instant;

#[derive(Default)]
pub struct Timeline {
    /// When the frame that is shown began to be.
    since: Option<Instant>,
    curves: bool,
    turned: bool,
    /// A key that is dragged: where it is now.
    held: Option<f64>,
    /// A point of a curve that is dragged: parameter, component, frame.
    point: Option<(String, usize, f64)>,
}

impl Timeline {
    /// Playback: the next frame when it is time, and the one before it is there. In a loop.
    pub fn tick(&mut self, state: &mut State, ctx: &Context) {
        if !state.playing {
            self.since = None;
            return;
        }
        let long = 1.0 / state.document().fps.max(0.1);
        let since = *self.since.get_or_insert_with(Instant::now);
        let left = long - since.elapsed().as_secs_f64();
        if left <= 0.0 && state.progress.is_none() && state.is_shown {
            self.step(state, 1);
            self.since = Some(Instant::now());
        }
        ctx.request_repaint_after_secs(left.max(0.001) as f32);
    }

    /// Whether curves are shown, when that has just changed: they need room.
    pub fn turned(&mut self) -> Option<bool> {
        std::mem::take(&mut self.turned).then_some(self.curves)
    }

    /// To the next frame or the one before, round at the ends.
    pub fn step(&mut self, state: &mut State, by: i64) {
        let [first, last] = state.document().frames;
        let count = last - first + 1;
        state.frame = first + (state.frame - first + by).rem_euclid(count);
    }

    /// To the next key of what is chosen, or of any node.
    pub fn step_key(&mut self, state: &mut State, forward: bool) {
        let now = state.frame as f64;
        let frames = frames(state);
        let found = match forward {
            true => frames.iter().find(|frame| **frame > now),
            false => frames.iter().rev().find(|frame| **frame < now),
        };
        if let Some(frame) = found {
            state.frame = frame.round() as i64;
        }
    }

    pub fn ui(&mut self, state: &mut State, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let label = if state.playing { "⏸" } else { "▶" };
            let play = ui.button(label);
            if named(play, WidgetType::Button, if state.playing { "pause" } else { "play" }).clicked() {
                state.playing = !state.playing;
            }
            let [first, last] = state.document().frames;
            let frame = egui::DragValue::new(&mut state.frame).range(first..=last).prefix("frame ");
            named(ui.add(frame), WidgetType::DragValue, "frame");
            let curves = ui.toggle_value(&mut self.curves, "Curves").on_hover_text("values of the chosen node's keys");
            self.turned |= curves.changed();
        });
        self.ruler(state, ui);
        if self.curves {
            self.plot(state, ui);
        }
    }
}

fn chosen(state: &State) -> Vec<String> {
    match state.selected.is_empty() {
        true => state.document().nodes.keys().cloned().collect(),
        false => state.selected.clone(),
    }
}

fn frames(state: &State) -> Vec<f64> {
    keys::frames(state.document(), chosen(state).iter().map(String::as_str))
}
