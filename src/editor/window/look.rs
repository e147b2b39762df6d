//! Colours, and small widgets that several panes use.

use crate::value::Kind;
use egui::{Color32, WidgetInfo, WidgetType};

/// Of ports and wires of a kind; bright enough for dark and dark enough for light backgrounds.
pub fn colour(kind: Option<Kind>) -> Color32 {
    let [r, g, b] = match kind {
        None => [128, 128, 128],
        Some(Kind::Scene) => [214, 137, 48],
        Some(Kind::Camera) => [150, 150, 110],
        Some(Kind::Samples) => [64, 160, 170],
        Some(Kind::Transfer) => [130, 110, 210],
        Some(Kind::Selection) => [220, 80, 70],
        Some(Kind::Edits) => [200, 90, 160],
        Some(Kind::Image) => [190, 165, 40],
        Some(Kind::Environment) => [70, 130, 220],
        Some(Kind::Visibility) => [90, 150, 90],
        Some(Kind::Transport) => [50, 140, 110],
        Some(Kind::Light) => [230, 180, 90],
        Some(Kind::Ratio) => [150, 100, 80],
    };
    Color32::from_rgb(r, g, b)
}

/// Both themes, with values that can be told apart and focus that can be seen.
pub fn install(ctx: &egui::Context) {
    ctx.options_mut(|options| options.zoom_with_keyboard = true);
    ctx.all_styles_mut(|style| {
        style.interaction.tooltip_delay = 0.4;
        style.spacing.slider_width = 120.0;
    });
}

/// Gives what was drawn by hand a name that people hear and tests ask for.
pub fn named(response: egui::Response, kind: WidgetType, name: impl Into<String>) -> egui::Response {
    let name = name.into();
    let enabled = response.enabled();
    response.widget_info(|| WidgetInfo::labeled(kind, enabled, &name));
    response
}

/// A small diamond: filled, with a dot, or empty.
pub fn diamond(ui: &mut egui::Ui, filled: bool, dotted: bool, name: &str) -> egui::Response {
    let (rect, response) = ui.allocate_exact_size(egui::Vec2::splat(14.0), egui::Sense::click());
    let colour = match (filled || dotted, response.hovered()) {
        (_, true) => ui.visuals().strong_text_color(),
        (true, _) => Color32::from_rgb(255, 170, 50),
        (false, _) => ui.visuals().weak_text_color(),
    };
    let corners = [(0.0, -5.0), (5.0, 0.0), (0.0, 5.0), (-5.0, 0.0)].map(|(x, y)| rect.center() + egui::vec2(x, y));
    let fill = if filled { colour } else { Color32::TRANSPARENT };
    ui.painter().add(egui::Shape::convex_polygon(corners.to_vec(), fill, egui::Stroke::new(1.2, colour)));
    if dotted && !filled {
        ui.painter().circle_filled(rect.center(), 1.5, colour);
    }
    if response.has_focus() {
        ui.painter().rect_stroke(rect, 2.0, ui.visuals().selection.stroke, egui::StrokeKind::Outside);
    }
    named(response, WidgetType::Button, name)
}

/// A small disc, of which this share is filled from below.
pub fn disc(ui: &mut egui::Ui, share: f32) {
    let (rect, _) = ui.allocate_exact_size(egui::Vec2::splat(8.0), egui::Sense::hover());
    let colour = ui.visuals().weak_text_color();
    let low = rect.with_min_y(rect.bottom() - share * rect.height());
    ui.painter_at(low).circle_filled(rect.center(), 3.5, colour);
    ui.painter().circle_stroke(rect.center(), 3.5, egui::Stroke::new(1.0, colour));
}

/// A time as it is read at a glance.
pub fn seconds(seconds: f64) -> String {
    match seconds {
        s if s < 0.000_95 => format!("{:.0} µs", s * 1e6),
        s if s < 0.0095 => format!("{:.1} ms", s * 1e3),
        s if s < 0.95 => format!("{:.0} ms", s * 1e3),
        s if s < 95.0 => format!("{s:.1} s"),
        s => format!("{:.0} min", s / 60.0),
    }
}
