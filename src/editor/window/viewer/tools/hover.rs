//! Where the brush will paint, and where a light will stand.

use super::hand::{Hand, radius};
use crate::editor::hands::handles::Place;
use crate::editor::hands::{light, ring};
use crate::editor::window::state::{State, Tool};
use crate::editor::window::viewer::Viewer;
use egui::{Color32, Pos2, Stroke, Ui};

pub fn hover(viewer: &Viewer, state: &State, hand: &Hand, at: Pos2, ui: &Ui) {
    let painter = ui.painter_at(hand.mapping.pane);
    match state.tool {
        Tool::Point => {}
        Tool::Brush => {
            let pixel = hand.mapping.to_picture(at);
            let colour = if state.brush.erase { Color32::from_rgb(120, 200, 255) } else { Color32::WHITE };
            for (share, width) in [(1.0, 1.5), (state.brush.hardness, 0.75)] {
                let Some(radius) = radius(state, hand, at) else { continue };
                let ring = ring::ring(hand.shown, pixel, radius * share);
                let points: Vec<Pos2> = ring.into_iter().map(|at| hand.mapping.to_screen(at)).collect();
                if points.len() > 2 {
                    painter.add(egui::Shape::closed_line(points.clone(), Stroke::new(width + 1.5, Color32::BLACK)));
                    painter.add(egui::Shape::closed_line(points, Stroke::new(width, colour)));
                }
            }
        }
        Tool::Light => {
            let Some(point) = hand.surface(at) else { return };
            let stands = light::position(point.position.into(), point.normal.into(), viewer.offset);
            if let Some(top) = hand.to_screen(Place::World(stands)) {
                painter.line_segment([at, top], Stroke::new(1.5, Color32::YELLOW));
                painter.circle_filled(top, 5.0, Color32::YELLOW);
            }
        }
    }
}
