//! The line of frames: scrubbing, and keys that are moved along it.

use super::{Timeline, chosen, frames};
use crate::editor::keys;
use crate::editor::window::look::named;
use crate::editor::window::state::State;
use egui::{Align2, Color32, FontId, Pos2, Rect, Sense, Stroke, Ui, WidgetType, pos2, vec2};

impl Timeline {
    pub(super) fn ruler(&mut self, state: &mut State, ui: &mut Ui) {
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
}
