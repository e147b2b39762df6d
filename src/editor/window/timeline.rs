//! Frames: scrubbing, keys that are set and moved, their curves, and playback.

use super::look::named;
use super::state::State;
use crate::editor::keys;
use egui::{Align2, Color32, Context, FontId, Pos2, Rect, Sense, Stroke, Ui, WidgetType, pos2, vec2};
use egui_plot::{Line, Plot, PlotPoints, Points};
use serde_json::{Value as Json, json};
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

    fn ruler(&mut self, state: &mut State, ui: &mut Ui) {
        let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), 30.0), Sense::click_and_drag());
        let response = named(response, WidgetType::Slider, "timeline");
        let [first, last] = state.document().frames;
        let span = Span { first, last, rect: rect.shrink2(vec2(12.0, 0.0)) };
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
        let step = span.step();
        let mut frame = (first + step - 1).div_euclid(step) * step;
        while frame <= last {
            let x = span.x(frame as f64);
            painter.vline(x, rect.top()..=rect.top() + 5.0, Stroke::new(1.0, ui.visuals().weak_text_color()));
            let (at, font) = (pos2(x, rect.top() + 6.0), FontId::proportional(10.0));
            painter.text(at, Align2::CENTER_TOP, frame.to_string(), font, ui.visuals().weak_text_color());
            frame += step;
        }
        let keyed = frames(state);
        let middle = rect.bottom() - 8.0;
        for frame in &keyed {
            let at = pos2(span.x(*frame), middle);
            let is_held = self.held == Some(*frame);
            let colour = if is_held { Color32::WHITE } else { Color32::from_rgb(255, 170, 50) };
            let corners = [vec2(0.0, -5.0), vec2(5.0, 0.0), vec2(0.0, 5.0), vec2(-5.0, 0.0)].map(|by| at + by);
            painter.add(egui::Shape::convex_polygon(corners.to_vec(), colour, Stroke::NONE));
        }
        let now = span.x(state.frame as f64);
        painter.vline(now, rect.y_range(), Stroke::new(2.0, Color32::from_rgb(90, 160, 255)));
        let pressed = ui.input(|input| input.pointer.press_origin());
        if response.drag_started()
            && let Some(at) = pressed
        {
            let is_near = |frame: &&f64| (pos2(span.x(**frame), middle) - at).length() < 8.0;
            self.held = keyed.iter().find(is_near).copied();
        }
        if let Some(at) = response.interact_pointer_pos().filter(|_| response.dragged() || response.clicked()) {
            let frame = span.frame(at);
            match self.held {
                Some(held) if held != frame as f64 => {
                    self.move_keys(state, held, frame as f64);
                    self.held = Some(frame as f64);
                }
                Some(_) => {}
                None => state.frame = frame,
            }
        }
        if response.drag_stopped() {
            self.held = None;
            state.session.end_drag();
        }
    }

    /// All keys of what is chosen that lie at a frame.
    fn move_keys(&self, state: &mut State, from: f64, to: f64) {
        let nodes = chosen(state);
        state.change("move keys", Some("keys"), |document| {
            for node in &nodes {
                let params: Vec<String> = document.nodes[node].params.keys().cloned().collect();
                for param in params {
                    keys::move_key(document, node, &param, from, to, None);
                }
            }
            Ok(())
        });
    }

    /// Values over frames; points are dragged.
    fn plot(&mut self, state: &mut State, ui: &mut Ui) {
        let Some(node) = state.chosen().map(str::to_owned) else {
            ui.weak("choose a node with keys");
            return;
        };
        let tracks = tracks(state, &node);
        if tracks.is_empty() {
            ui.weak("no parameter of this node has keys: press a ◇ in the inspector");
            return;
        }
        ui.horizontal(|ui| {
            for param in tracks.iter().map(|track| &track.param).collect::<std::collections::BTreeSet<_>>() {
                let now = keys::interpolation(state.document(), &node, param);
                let mut wanted = now.clone();
                let list = egui::ComboBox::from_id_salt(param).selected_text(format!("{param}: {now}"));
                let list = list.show_ui(ui, |ui| {
                    for name in ["linear", "smooth", "hold"] {
                        ui.selectable_value(&mut wanted, name.to_owned(), name);
                    }
                });
                named(list.response, WidgetType::ComboBox, format!("interpolation of {param}"));
                if wanted != now {
                    state.change("interpolation", None, |document| {
                        keys::set_interpolation(document, &node, param, &wanted);
                        Ok(())
                    });
                }
            }
        });
        let [first, last] = state.document().frames;
        let params = state.entry(&node).map(|entry| entry.params.clone()).unwrap_or_default();
        let plot = Plot::new("curves").allow_drag(self.point.is_none()).show_axes([true, true]);
        let shown = plot.show(ui, |plot| {
            for track in &tracks {
                let value = &params[&track.param];
                let steps = ((last - first) * 4).clamp(1, 2000);
                let line = (0..=steps).filter_map(|i| {
                    let frame = first as f64 + (last - first) as f64 * i as f64 / steps as f64;
                    Some([frame, component(&keys::value_at(value, frame), track.component)?])
                });
                plot.line(Line::new(track.name(), PlotPoints::from_iter(line)));
                let points = Points::new(track.name(), PlotPoints::from(track.points.clone())).radius(5.0);
                plot.points(points);
            }
            plot.vline(egui_plot::VLine::new("now", state.frame as f64));
        });
        let response = named(shown.response, WidgetType::Other, "curves");
        let transform = shown.transform;
        let pressed = ui.input(|input| input.pointer.press_origin());
        if let (Some(at), None, true) = (pressed, &self.point, response.is_pointer_button_down_on()) {
            let is_near = |point: &[f64; 2]| {
                let screen: Pos2 = transform.position_from_point(&egui_plot::PlotPoint::new(point[0], point[1]));
                screen.distance(at) < 8.0
            };
            self.point = tracks.iter().find_map(|track| {
                let point = track.points.iter().find(|point| is_near(point))?;
                Some((track.param.clone(), track.component, point[0]))
            });
        }
        if let (Some((param, part, frame)), Some(at)) =
            (self.point.clone(), ui.input(|input| input.pointer.interact_pos()))
            && ui.input(|input| input.pointer.is_moving())
        {
            let to = transform.value_from_position(at);
            let (goal, height) = (to.x.round().clamp(first as f64, last as f64), (to.y * 1e3).round() / 1e3);
            let old = keys::value_at(&params[&param], frame);
            state.change("move a key", Some("keys"), |document| {
                keys::move_key(document, &node, &param, frame, goal, Some(with_component(old, part, height)));
                Ok(())
            });
            self.point = Some((param, part, goal));
        }
        if !ui.input(|input| input.pointer.any_down()) && self.point.take().is_some() {
            state.session.end_drag();
        }
    }
}

/// A number that changes over time: a parameter, or a component of one.
struct Track {
    param: String,
    component: usize,
    is_part: bool,
    points: Vec<[f64; 2]>,
}

impl Track {
    fn name(&self) -> String {
        if self.is_part { format!("{}[{}]", self.param, self.component) } else { self.param.clone() }
    }
}

fn tracks(state: &State, node: &str) -> Vec<Track> {
    let Some(entry) = state.entry(node) else { return Vec::new() };
    let mut tracks = Vec::new();
    for param in entry.params.keys() {
        let Some(keys) = keys::keys(state.document(), node, param) else { continue };
        let parts = keys.first().and_then(|(_, value)| value.as_array()).map(Vec::len);
        for part in 0..parts.unwrap_or(1) {
            let point = |(frame, value): &(f64, Json)| Some([*frame, component(value, part)?]);
            let points: Vec<[f64; 2]> = keys.iter().filter_map(point).collect();
            if !points.is_empty() {
                tracks.push(Track { param: param.clone(), component: part, is_part: parts.is_some(), points });
            }
        }
    }
    tracks
}

fn component(value: &Json, part: usize) -> Option<f64> {
    value.get(part).unwrap_or(value).as_f64()
}

fn with_component(mut value: Json, part: usize, number: f64) -> Json {
    match value.get_mut(part) {
        Some(place) => {
            *place = json!(number);
            value
        }
        None => json!(number),
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

/// Frames along a line.
struct Span {
    first: i64,
    last: i64,
    rect: Rect,
}

impl Span {
    fn x(&self, frame: f64) -> f32 {
        let share = (frame - self.first as f64) / ((self.last - self.first) as f64).max(1.0);
        self.rect.left() + share as f32 * self.rect.width()
    }

    fn frame(&self, at: Pos2) -> i64 {
        let share = f64::from((at.x - self.rect.left()) / self.rect.width().max(1.0)).clamp(0.0, 1.0);
        self.first + (share * (self.last - self.first) as f64).round() as i64
    }

    /// Between frames that are numbered.
    fn step(&self) -> i64 {
        let most = f64::from(self.rect.width() / 46.0).max(1.0);
        let wanted = (self.last - self.first) as f64 / most;
        [1, 2, 5, 10, 20, 50, 100, 200, 500].into_iter().find(|step| *step as f64 >= wanted).unwrap_or(1000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_lie_along_the_line() {
        let span = Span { first: 1, last: 25, rect: Rect::from_min_size(pos2(10.0, 0.0), vec2(480.0, 30.0)) };
        for frame in 1..=25 {
            assert_eq!(span.frame(pos2(span.x(frame as f64), 3.0)), frame);
        }
        assert_eq!((span.frame(pos2(-100.0, 0.0)), span.frame(pos2(9999.0, 0.0)), span.step()), (1, 25, 5));
        let single = Span { first: 1, last: 1, ..span };
        assert_eq!(single.frame(pos2(200.0, 0.0)), 1);
    }

    #[test]
    fn components_come_and_go() {
        assert_eq!(with_component(json!([1, 2, 3]), 1, 5.0), json!([1, 5.0, 3]));
        assert_eq!(with_component(json!(2), 0, 5.0), json!(5.0));
        assert_eq!(component(&json!([1, 2]), 1), Some(2.0));
    }
}
