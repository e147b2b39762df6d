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
