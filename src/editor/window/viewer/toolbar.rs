//! The bar above a picture.

use super::{Camera, Compare, Viewer};
use crate::editor::display::{Channel, Display, Transform, views};
use crate::editor::window::look::named;
use crate::editor::window::state::{State, Tool};
use crate::image::view_transform::Wish;
use crate::value::Kind;
use egui::{ComboBox, DragValue, Ui, WidgetType};

pub fn ui(viewer: &mut Viewer, state: &mut State, ui: &mut Ui) {
    let before = viewer.settings.clone();
    // Two rows, whatever the tool: the picture is not to jump when another is taken.
    ui.spacing_mut().item_spacing.x = 6.0;
    if viewer.camera != Camera::Environment {
        ui.horizontal_wrapped(|ui| tools(viewer, state, ui));
    }
    ui.horizontal_wrapped(|ui| {
        layers(viewer, ui);
        display(viewer, ui);
        compare(viewer, state, ui);
        if let Camera::Free(free) = &mut viewer.camera {
            ui.toggle_value(&mut free.lit, "Lit").on_hover_text("computes the light as seen from here, too");
        }
    });
    if viewer.settings != before {
        viewer.develop();
    }
}

fn tools(viewer: &mut Viewer, state: &mut State, ui: &mut Ui) {
    for tool in Tool::ALL {
        if ui.selectable_label(state.tool == tool, tool.name()).clicked() {
            state.tool = tool;
        }
    }
    match state.tool {
        Tool::Point => {
            ui.weak("hover to probe, drag handles, right click to pick");
        }
        Tool::Light => {
            let offset = DragValue::new(&mut viewer.offset).speed(0.01).range(0.0..=1e6).suffix(" m");
            named(ui.add(offset), WidgetType::DragValue, "light offset").on_hover_text("how far off the surface");
        }
        Tool::Brush => brush(viewer, state, ui),
    }
}

fn brush(viewer: &mut Viewer, state: &mut State, ui: &mut Ui) {
    let ports: Vec<&str> = match state.chosen().and_then(|name| state.info(name)) {
        Some(info) => {
            let selections = info.inputs.iter().filter(|port| port.kind == Kind::Selection && info.name != "select");
            selections.map(|port| port.name).collect()
        }
        None => Vec::new(),
    };
    if ports.len() > 1 {
        let current = viewer.port.clone().filter(|port| ports.contains(&port.as_str()));
        let mut current = current.unwrap_or_else(|| ports[0].to_owned());
        let list = ComboBox::from_id_salt("paint port").selected_text(&current).show_ui(ui, |ui| {
            for port in &ports {
                ui.selectable_value(&mut current, (*port).to_owned(), *port);
            }
        });
        named(list.response, WidgetType::ComboBox, "paint what").on_hover_text("which input of the chosen node");
        viewer.port = Some(current);
    } else {
        viewer.port = ports.first().map(|port| (*port).to_owned());
    }
    let brush = &mut state.brush;
    let unit = if brush.adaptive { " x" } else { " m" };
    let radius = DragValue::new(&mut brush.radius).speed(0.01).range(1e-4..=1e4).suffix(unit);
    named(ui.add(radius), WidgetType::DragValue, "brush radius").on_hover_text("radius; [ and ] change it");
    let hardness = DragValue::new(&mut brush.hardness).speed(0.01).range(0.0..=1.0).prefix("hard ");
    named(ui.add(hardness), WidgetType::DragValue, "brush hardness").on_hover_text("the part of the radius in full");
    let value = DragValue::new(&mut brush.value).speed(0.01).range(0.0..=1.0).prefix("opacity ");
    named(ui.add(value), WidgetType::DragValue, "brush opacity");
    ui.toggle_value(&mut brush.erase, "Erase");
    let adaptive = ui.toggle_value(&mut brush.adaptive, "Adaptive");
    adaptive.on_hover_text("large in open space, small in corners");
}

fn layers(viewer: &mut Viewer, ui: &mut Ui) {
    let Some(shown) = &viewer.shown else { return };
    let display = &mut viewer.settings.display;
    let title = |name: &str| if name.is_empty() { "beauty".to_owned() } else { name.to_owned() };
    let list = ComboBox::from_id_salt("layer").selected_text(title(&display.layer)).show_ui(ui, |ui| {
        for layer in &shown.picture.layers {
            ui.selectable_value(&mut display.layer, layer.name.clone(), title(&layer.name));
        }
    });
    named(list.response, WidgetType::ComboBox, "layer");
    let layer = shown.picture.layer(&display.layer).or(shown.picture.layers.first());
    let channels: Vec<String> = layer.map(|layer| layer.channels.clone()).unwrap_or_default();
    let text = match display.channel {
        Channel::All => "all".to_owned(),
        Channel::Luminance => "luminance".to_owned(),
        Channel::One(number) => channels.get(number).cloned().unwrap_or_default(),
    };
    let list = ComboBox::from_id_salt("channel").width(60.0).selected_text(text).show_ui(ui, |ui| {
        ui.selectable_value(&mut display.channel, Channel::All, "all");
        ui.selectable_value(&mut display.channel, Channel::Luminance, "luminance");
        for (number, channel) in channels.iter().enumerate() {
            ui.selectable_value(&mut display.channel, Channel::One(number), channel);
        }
    });
    named(list.response, WidgetType::ComboBox, "channel");
}

fn display(viewer: &mut Viewer, ui: &mut Ui) {
    let display = &mut viewer.settings.display;
    let exposure = DragValue::new(&mut display.exposure).speed(0.05).range(-20.0..=20.0).suffix(" EV");
    named(ui.add(exposure), WidgetType::DragValue, "exposure").on_hover_text("exposure, in stops");
    let gamma = DragValue::new(&mut display.gamma).speed(0.01).range(0.1..=10.0).prefix("γ ");
    named(ui.add(gamma), WidgetType::DragValue, "gamma").on_hover_text("gamma, on top of the view transform");
    transforms(display, ui);
    ui.toggle_value(&mut display.false_colour, "False colour").on_hover_text("stops over middle grey as colours");
    ui.toggle_value(&mut viewer.settings.show_mask, "Selection").on_hover_text("tints what the chosen node selects");
}

/// The view transform: plain ones, ACES, and all displays and views of `$OCIO`.
fn transforms(display: &mut Display, ui: &mut Ui) {
    let name = |transform: &Transform| match transform {
        Transform::Plain => "sRGB".to_owned(),
        Transform::Reinhard => "Reinhard".to_owned(),
        Transform::View(wish) if *wish == Wish::aces() => "ACES 2.0".to_owned(),
        Transform::View(wish) => format!("{}: {}", wish.display, wish.view),
    };
    let list = ComboBox::from_id_salt("transform").width(80.0).selected_text(name(&display.transform)).truncate();
    let list = list.show_ui(ui, |ui| {
        let known = views().as_deref().unwrap_or(&[]);
        let all = known.iter().cloned().map(Transform::View);
        for transform in [Transform::Plain, Transform::Reinhard].into_iter().chain(all) {
            let text = name(&transform);
            ui.selectable_value(&mut display.transform, transform, text);
        }
        if let Err(problem) = views() {
            ui.weak(format!("$OCIO: {problem}"));
        }
    });
    named(list.response, WidgetType::ComboBox, "view transform");
}

fn compare(viewer: &mut Viewer, state: &State, ui: &mut Ui) {
    let is_frozen = viewer.frozen.is_some();
    let has_other = viewer.other.is_some() || is_frozen;
    let text = match (&viewer.other, is_frozen) {
        (_, true) => "A | frozen".to_owned(),
        (Some((node, _)), _) => format!("A | {node}"),
        (None, false) => "A".to_owned(),
    };
    let list = ComboBox::from_id_salt("compare").width(90.0).selected_text(text).show_ui(ui, |ui| {
        if ui.selectable_label(!has_other, "A alone").clicked() {
            (viewer.other, viewer.frozen) = (None, None);
        }
        if ui.selectable_label(is_frozen, "with A as it is now").clicked() {
            viewer.other = None;
            viewer.frozen = viewer.shown.as_ref().map(|shown| shown.picture.clone());
            if let Some(shown) = viewer.shown.clone() {
                viewer.show(shown);
            }
        }
        for name in state.document().nodes.keys() {
            let is_image = state.outputs(name).first().is_some_and(|port| port.kind == Some(Kind::Image));
            let other = Some((name.clone(), 0));
            if is_image && ui.selectable_label(viewer.other == other, format!("with {name}")).clicked() {
                (viewer.other, viewer.frozen) = (other, None);
            }
        }
    });
    named(list.response, WidgetType::ComboBox, "compare").on_hover_text("A/B");
    if !has_other {
        return;
    }
    for (mode, label) in [(Compare::Wipe(0.5), "Wipe"), (Compare::Split, "Split"), (Compare::Other, "B")] {
        let is_on = std::mem::discriminant(&viewer.compare) == std::mem::discriminant(&mode);
        if ui.selectable_label(is_on, label).clicked() {
            viewer.compare = mode;
        }
    }
}
