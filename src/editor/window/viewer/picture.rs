//! Where pixels lie on the screen: zoom, pan, wipe and split; and what is drawn over them.

use super::{Camera, Compare, Viewer, probe, tools};
use crate::editor::window::look::named;
use crate::editor::window::state::State;
use egui::{Align2, Color32, FontId, PointerButton, Pos2, Rect, Sense, Stroke, Ui, WidgetType, pos2, vec2};
use glam::Vec2;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View {
    /// Points of the screen to a pixel of the picture; none: as large as there is room.
    pub zoom: Option<f32>,
    /// What lies in the middle of the pane, in pixels from that of the picture.
    pub centre: Vec2,
}

/// From pixels of the picture to points of the screen.
#[derive(Clone, Copy, Debug)]
pub struct Mapping {
    pub pane: Rect,
    /// Pixels.
    pub size: Vec2,
    pub zoom: f32,
    /// On the screen: between its pixels, so that pixels of a picture at its own size are pixels of the screen.
    corner: Pos2,
}

impl Mapping {
    pub fn new(view: &View, pane: Rect, size: Vec2, pixels_per_point: f32) -> Self {
        let fit = (pane.width() / size.x).min(pane.height() / size.y).max(1e-4);
        let (zoom, centre) = match view.zoom {
            Some(zoom) => (zoom, view.centre),
            None => (fit, Vec2::ZERO),
        };
        let off = (0.5 * size + centre) * zoom;
        let corner = (pane.center() - vec2(off.x, off.y)).to_vec2() * pixels_per_point;
        Self { pane, size, zoom, corner: (corner.round() / pixels_per_point).to_pos2() }
    }

    pub fn to_screen(self, at: Vec2) -> Pos2 {
        self.corner + vec2(at.x, at.y) * self.zoom
    }

    pub fn to_picture(self, at: Pos2) -> Vec2 {
        let off = at - self.corner;
        Vec2::new(off.x, off.y) / self.zoom
    }

    /// What lies in the middle of the pane, in pixels from that of the picture.
    fn centre(self) -> Vec2 {
        self.to_picture(self.pane.center()) - 0.5 * self.size
    }

    pub fn rect(self) -> Rect {
        Rect::from_min_max(self.to_screen(Vec2::ZERO), self.to_screen(self.size))
    }
}

/// Nearest and farthest zoom.
const ZOOM: [f32; 2] = [0.02, 64.0];

pub fn ui(viewer: &mut Viewer, state: &mut State, ui: &mut Ui) {
    let foot = 20.0;
    let available = ui.available_rect_before_wrap();
    let pane = available.with_max_y(available.max.y - foot);
    viewer.pane = pane;
    let response = ui.allocate_rect(pane, Sense::click_and_drag());
    let label = if viewer.is_main() { "picture".to_owned() } else { format!("picture {}", viewer.number) };
    let response = named(response, WidgetType::Image, label);
    let painter = ui.painter_at(pane);
    // The same grey in light and dark: colours are judged beside it.
    painter.rect_filled(pane, 0.0, Color32::from_gray(40));
    let size = viewer.shown.as_ref().map(|shown| {
        let (width, height) = (shown.picture.width, shown.picture.height);
        Vec2::new(width as f32, height as f32)
    });
    if let (Some(size), Some(_)) = (size, &viewer.textures[0]) {
        let [a, b] = panes(viewer, pane).map(|pane| Mapping::new(&viewer.view, pane, size, ui.pixels_per_point()));
        draw(viewer, [&a, &b], &painter);
        let mapping = if is_at(&b, &a, ui) { b } else { a };
        // A hand that works on the picture does not move it.
        if !tools::ui(viewer, state, &mapping, &response, ui) {
            navigate(viewer, &mapping, &response, ui);
        }
    }
    message(viewer, state, &painter, pane);
    let foot = available.with_min_y(pane.max.y);
    let at = response.hover_pos();
    let text = match (at, size) {
        (Some(at), Some(size)) => {
            let [a, b] = panes(viewer, pane).map(|pane| Mapping::new(&viewer.view, pane, size, ui.pixels_per_point()));
            let mapping = if b.pane.contains(at) { b } else { a };
            probe::text(viewer, mapping.to_picture(at))
        }
        _ => None,
    };
    let text = text.unwrap_or_else(|| size.map_or(String::new(), |size| format!("{} x {}", size.x, size.y)));
    ui.put(
        foot,
        egui::Label::new(egui::RichText::new(text).monospace().size(11.0)).truncate().halign(egui::Align::Min),
    );
}

/// What A and B are drawn in: side by side when split, with the same zoom, and the same in their middles.
fn panes(viewer: &Viewer, pane: Rect) -> [Rect; 2] {
    match viewer.compare {
        Compare::Split if viewer.textures[1].is_some() => {
            let (left, right) = pane.split_left_right_at_fraction(0.5);
            [left, right]
        }
        _ => [pane; 2],
    }
}

/// Whether the hand is at work in one of two panes; a drag stays where it began.
fn is_at(one: &Mapping, other: &Mapping, ui: &Ui) -> bool {
    let at = ui.input(|input| input.pointer.press_origin().or(input.pointer.hover_pos()));
    one.pane != other.pane && at.is_some_and(|at| one.pane.contains(at))
}

fn draw(viewer: &Viewer, [left, right]: [&Mapping; 2], painter: &egui::Painter) {
    let [Some(a), b] = &viewer.textures else { return };
    let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    let rect = left.rect();
    let within = |clip: Rect| painter.with_clip_rect(painter.clip_rect().intersect(clip));
    let Some(b) = b else {
        painter.image(a.id(), rect, uv, Color32::WHITE);
        return;
    };
    match viewer.compare {
        Compare::Other => painter.image(b.id(), rect, uv, Color32::WHITE),
        Compare::Split => {
            within(left.pane).image(a.id(), rect, uv, Color32::WHITE);
            within(right.pane).image(b.id(), right.rect(), uv, Color32::WHITE);
            painter.vline(right.pane.left(), right.pane.y_range(), Stroke::new(1.0, Color32::from_gray(90)))
        }
        Compare::Wipe(at) => {
            let x = rect.left() + at * rect.width();
            painter.image(b.id(), rect, uv, Color32::WHITE);
            within(rect.with_max_x(x)).image(a.id(), rect, uv, Color32::WHITE);
            painter.vline(x, rect.y_range(), Stroke::new(2.0, Color32::from_white_alpha(200)))
        }
    };
}

/// Whether a place is on the line between A and B.
pub fn is_on_line(viewer: &Viewer, mapping: &Mapping, at: Pos2) -> bool {
    let Compare::Wipe(share) = viewer.compare else { return false };
    let line = mapping.rect().left() + share * mapping.rect().width();
    viewer.textures[1].is_some() && (at.x - line).abs() < 10.0
}

/// Draws the line between A and B to a place.
pub fn wipe(viewer: &mut Viewer, mapping: &Mapping, to: Pos2) {
    let rect = mapping.rect();
    viewer.compare = Compare::Wipe(((to.x - rect.left()) / rect.width()).clamp(0.0, 1.0));
}

/// Pan, zoom, and turning free cameras.
fn navigate(viewer: &mut Viewer, mapping: &Mapping, response: &egui::Response, ui: &Ui) {
    let rect = mapping.rect();
    let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
    let factor = if response.hovered() { (scroll * 0.004).exp() * pinch } else { 1.0 };
    let by = response.drag_delta();
    let by = Vec2::new(by.x, by.y);
    if let Camera::Free(free) = &mut viewer.camera
        && let Some(orbit) = &mut free.orbit
    {
        let by = by / rect.height().max(1.0);
        let is_middle = response.dragged_by(PointerButton::Middle);
        let slides = is_middle || ui.input(|input| input.modifiers.shift);
        match slides {
            _ if by == Vec2::ZERO => {}
            true => orbit.slide(by),
            false => orbit.turn(by),
        }
        orbit.approach(factor);
        return;
    }
    if by != Vec2::ZERO {
        viewer.view = View { zoom: Some(mapping.zoom), centre: mapping.centre() - by / mapping.zoom };
    }
    if factor != 1.0
        && let Some(at) = response.hover_pos()
    {
        let zoom = (mapping.zoom * factor).clamp(ZOOM[0], ZOOM[1]);
        // What is under the pointer stays there.
        let pixel = mapping.to_picture(at);
        let off = at - mapping.pane.center();
        let centre = pixel - 0.5 * mapping.size - Vec2::new(off.x, off.y) / zoom;
        viewer.view = View { zoom: Some(zoom), centre };
    }
    if response.double_clicked() {
        let is_fit = viewer.view.zoom.is_none();
        viewer.view = View { zoom: is_fit.then(|| 1.0 / ui.pixels_per_point()), centre: Vec2::ZERO };
    }
}

/// What there is to be said in place of a picture, or over it.
fn message(viewer: &Viewer, state: &State, painter: &egui::Painter, pane: Rect) {
    let (text, colour) = match &viewer.error {
        Some((message, help)) => (format!("{message}\n{help}"), Color32::from_rgb(255, 120, 100)),
        None if viewer.shown.is_some() => return,
        None if viewer.look(state).is_some() => ("computing…".to_owned(), Color32::GRAY),
        None => ("nothing to be shown: add a node, or press 1 on one".to_owned(), Color32::GRAY),
    };
    let text = painter.layout(text, FontId::proportional(14.0), colour, pane.width() - 60.0);
    let rect = Align2::CENTER_CENTER.anchor_size(pane.center(), text.size());
    painter.rect_filled(rect.expand(10.0), 6.0, Color32::from_black_alpha(190));
    painter.galley(rect.min, text, colour);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_and_points_go_to_and_fro() {
        let pane = Rect::from_min_size(pos2(10.0, 20.0), vec2(400.0, 300.0));
        let size = Vec2::new(640.0, 480.0);
        for view in [View::default(), View { zoom: Some(3.0), centre: Vec2::new(20.0, -7.0) }] {
            let mapping = Mapping::new(&view, pane, size, 1.0);
            for at in [Vec2::ZERO, Vec2::new(100.5, 3.25), size] {
                assert!(mapping.to_picture(mapping.to_screen(at)).distance(at) < 1e-2);
            }
        }
        assert_eq!(Mapping::new(&View::default(), pane, size, 1.0).rect(), pane, "all of it, no larger than the pane");
    }
}
