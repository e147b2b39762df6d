//! Help: shortcuts, what a node says of itself, and the tour of the first start.

use super::commands::{self, Menu};
use super::state::State;
use crate::node::{Info, Port};
use egui::{Context, RichText};

#[derive(Default)]
pub struct Help {
    shortcuts: bool,
    node: Option<&'static Info>,
    step: Option<usize>,
}

/// Three steps, each done in the example that is open.
const TOUR: [(&str, &str); 3] = [
    (
        "Look",
        "This is a finished recipe. The picture is that of the node with an eye on its name. Double click another node in \
         the graph to see that instead, and come back. The wheel zooms, a drag pans.",
    ),
    (
        "Change the light",
        "Select the node \"bleed\": it changes the light that the red wall sends to the block. Drag its brightness in the \
         inspector and watch the block. Ctrl+Z takes it back.",
    ),
    (
        "Paint",
        "Keep \"bleed\" selected, choose Brush above the picture, and paint on the floor: paint goes to the input that is \
         named beside the brush. A paint node has appeared in the graph, like any other. Ctrl+S saves the recipe, and \
         `chiaro render` makes the same picture from it.",
    ),
];

impl Help {
    pub fn new(is_first_start: bool) -> Self {
        Self { step: is_first_start.then_some(0), ..Self::default() }
    }

    pub fn tour(&mut self) {
        self.step = Some(0);
    }

    pub fn shortcuts(&mut self) {
        self.shortcuts = !self.shortcuts;
    }

    pub fn explain(&mut self, info: &'static Info) {
        self.node = Some(info);
    }

    pub fn ui(&mut self, state: &mut State, ctx: &Context) {
        self.tour_ui(state, ctx);
        self.shortcuts_ui(ctx);
        self.node_ui(ctx);
    }

    fn tour_ui(&mut self, state: &mut State, ctx: &Context) {
        let Some(step) = self.step else { return };
        let (title, text) = TOUR[step];
        let window = egui::Window::new(format!("Tour, {} of {}: {title}", step + 1, TOUR.len()));
        let window = window.collapsible(false).resizable(false).default_width(360.0);
        window.anchor(egui::Align2::LEFT_TOP, [24.0, 90.0]).show(ctx, |ui| {
            ui.label(text);
            ui.horizontal(|ui| {
                if step > 0 && ui.button("Back").clicked() {
                    self.step = Some(step - 1);
                }
                let last = step + 1 == TOUR.len();
                if ui.button(if last { "Done" } else { "Next" }).clicked() {
                    self.step = (!last).then_some(step + 1);
                    if step == 0 && state.document().nodes.contains_key("bleed") {
                        state.choose("bleed");
                    }
                }
                if !last && ui.button("Skip").clicked() {
                    self.step = None;
                }
            });
        });
    }

    fn shortcuts_ui(&mut self, ctx: &Context) {
        let mut open = self.shortcuts;
        egui::Window::new("Shortcuts").open(&mut open).vscroll(true).default_width(420.0).show(ctx, |ui| {
            for menu in Menu::ALL {
                let entries: Vec<_> =
                    commands::ALL.iter().filter(|entry| entry.menu == menu && entry.key.is_some()).collect();
                if entries.is_empty() {
                    continue;
                }
                ui.strong(menu.name());
                egui::Grid::new(menu.name()).num_columns(2).min_col_width(120.0).show(ui, |ui| {
                    for entry in entries {
                        let keys = entry.key.map(|key| ctx.format_shortcut(&key)).unwrap_or_default();
                        ui.monospace(keys);
                        ui.label(entry.label);
                        ui.end_row();
                    }
                });
            }
            ui.strong("Mouse");
            egui::Grid::new("mouse").num_columns(2).min_col_width(120.0).show(ui, |ui| {
                for (what, does) in MOUSE {
                    ui.monospace(*what);
                    ui.label(*does);
                    ui.end_row();
                }
            });
        });
        self.shortcuts = open;
    }

    fn node_ui(&mut self, ctx: &Context) {
        let Some(info) = self.node else { return };
        let mut open = true;
        egui::Window::new(info.name).open(&mut open).vscroll(true).default_width(420.0).show(ctx, |ui| {
            ui.label(info.summary);
            let ports = |ui: &mut egui::Ui, title: &str, ports: &[Port]| {
                if ports.is_empty() {
                    return;
                }
                ui.strong(title);
                for port in ports {
                    let optional = if port.optional { ", optional" } else { "" };
                    ui.label(RichText::new(format!("{} ({}{optional})", port.name, port.kind.name())).monospace());
                    ui.indent(port.name, |ui| ui.label(port.doc));
                }
            };
            ports(ui, "Inputs", info.inputs);
            ports(ui, "Outputs", info.outputs);
            ui.strong("Parameters");
            let node_type = crate::nodes::find(info.name);
            for field in node_type.map(crate::fields::fields).unwrap_or_default() {
                let unit = if field.unit.is_empty() { String::new() } else { format!(", {}", field.unit) };
                ui.label(RichText::new(format!("{}{unit} = {}", field.name, field.default)).monospace());
                ui.indent(&field.name, |ui| ui.label(&field.doc));
            }
        });
        if !open {
            self.node = None;
        }
    }
}

const MOUSE: &[(&str, &str)] = &[
    ("drag a port", "connects; let go beside all nodes for what fits"),
    ("right click a wire", "disconnects"),
    ("Shift+drag", "selects nodes in a rectangle"),
    ("double click a node", "views it"),
    ("right click", "menus of nodes and pictures; adds a node beside them"),
    ("wheel, drag", "zooms and pans graphs and pictures"),
    ("double click a picture", "fits it, or shows pixels as they are"),
    ("drag a free viewer", "turns; with Shift or the middle button it slides"),
    ("Shift+drag a light", "through the air instead of along surfaces"),
];
