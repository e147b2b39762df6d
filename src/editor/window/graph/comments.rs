//! Frames with words on them, behind nodes.

use crate::graph::{Comment, Document};
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, StrokeKind, Style, pos2, vec2};
use std::collections::HashMap;

/// Height of the bar that a comment is dragged by.
const TITLE: f32 = 24.0;
/// Between the frame and the nodes that it was made around.
const MARGIN: f32 = 20.0;

pub fn rect(comment: &Comment) -> Rect {
    let [x, y] = comment.at.map(|x| x as f32);
    let [width, height] = comment.size.map(|x| x as f32);
    Rect::from_min_size(pos2(x, y), vec2(width, height))
}

/// The comment whose bar is at a place of the graph.
pub fn title_at(document: &Document, at: Pos2) -> Option<usize> {
    let bar = |comment: &Comment| rect(comment).with_max_y(rect(comment).min.y + TITLE);
    document.comments.iter().rposition(|comment| bar(comment).contains(at))
}

/// The nodes that lie within a comment.
pub fn held(document: &Document, number: usize, rects: &HashMap<String, Rect>) -> Vec<String> {
    let Some(frame) = document.comments.get(number).map(rect) else { return Vec::new() };
    rects.iter().filter(|(_, node)| frame.contains_rect(**node)).map(|(name, _)| name.clone()).collect()
}

/// A comment around nodes, which lie at these places and have about the usual size.
pub fn around(places: &[[f64; 2]]) -> Comment {
    let fold = |i: usize, with: fn(f64, f64) -> f64| places.iter().map(|at| at[i]).reduce(with).unwrap_or(0.0);
    let margin = f64::from(MARGIN);
    let at = [fold(0, f64::min) - margin, fold(1, f64::min) - margin - f64::from(TITLE)];
    let end = [fold(0, f64::max) + 190.0 + margin, fold(1, f64::max) + 160.0 + margin];
    Comment { text: "comment".to_owned(), at, size: [end[0] - at[0], end[1] - at[1]] }
}

pub fn draw(document: &Document, chosen: Option<usize>, style: &Style, painter: &Painter) {
    for (number, comment) in document.comments.iter().enumerate() {
        let frame = rect(comment);
        let tint = if style.visuals.dark_mode { Color32::from_white_alpha(14) } else { Color32::from_black_alpha(14) };
        let stroke = match chosen == Some(number) {
            true => Stroke::new(2.0, Color32::from_rgb(255, 160, 40)),
            false => Stroke::new(1.0, style.visuals.weak_text_color()),
        };
        painter.rect(frame, 6.0, tint, stroke, StrokeKind::Inside);
        painter.rect_filled(frame.with_max_y(frame.min.y + TITLE), 6.0, tint);
        let at = frame.left_top() + vec2(8.0, TITLE / 2.0);
        painter.text(at, Align2::LEFT_CENTER, &comment.text, FontId::proportional(14.0), style.visuals.text_color());
    }
}
