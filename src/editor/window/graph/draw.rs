//! One frame of the widget: what each node, port and wire looks like, and what was done to it. Beside `canvas` the only file
//! that names egui-snarl.

use super::canvas::{GRAPH, Happened};
use super::palette::Port;
use super::{comments, node};
use crate::editor::window::look::colour;
use crate::editor::window::ports::PortView;
use crate::editor::window::state::State;
use crate::value::Kind;
use egui::emath::TSTransform;
use egui::{Color32, Id, Pos2, Rect, Stroke, Ui, Vec2};
use egui_snarl::ui::{AnyPins, PinInfo, PinPlacement, PinWireInfo, SelectionStyle, SnarlPin, SnarlStyle, SnarlViewer};
use egui_snarl::{InPin, InPinId, NodeId, OutPin, OutPinId, Snarl};
use std::collections::HashMap;

pub fn style(ui: &Ui) -> SnarlStyle {
    let nothing = SelectionStyle {
        margin: egui::Margin::ZERO,
        rounding: egui::CornerRadius::ZERO,
        fill: Color32::TRANSPARENT,
        stroke: Stroke::NONE,
    };
    SnarlStyle {
        collapsible: Some(false),
        pin_placement: Some(PinPlacement::Edge),
        pin_size: Some(11.0),
        wire_width: Some(2.5),
        centering: Some(false),
        min_scale: Some(0.15),
        max_scale: Some(2.0),
        // What is selected is the window's own to know.
        select_style: Some(nothing),
        bg_frame: Some(egui::Frame::NONE.fill(ui.visuals().extreme_bg_color)),
        ..SnarlStyle::new()
    }
}

/// One frame of the widget.
pub struct Draw<'a> {
    pub state: &'a mut State,
    pub happened: Vec<Happened>,
    pub to_global: TSTransform,
    /// Where the graph is to be seen from, whatever the widget thinks.
    pub forced: Option<TSTransform>,
    pub rects: HashMap<String, Rect>,
    pub screen: Rect,
}

impl Draw<'_> {
    fn input(&self, pin: InPinId, snarl: &Snarl<String>) -> Option<(String, PortView)> {
        let name = snarl.get_node(pin.node)?;
        Some((name.clone(), self.state.inputs(name).get(pin.input)?.clone()))
    }

    fn output(&self, pin: OutPinId, snarl: &Snarl<String>) -> Option<(String, PortView)> {
        let name = snarl.get_node(pin.node)?;
        Some((name.clone(), self.state.outputs(name).get(pin.output)?.clone()))
    }

    fn pin(&self, ui: &Ui, label: String, port: Option<&PortView>, is_connected: bool) -> Pin {
        let colour = colour(port.and_then(|port| port.kind));
        // What must be connected and is not, stands out.
        let is_missing = port.is_some_and(|port| !port.optional) && !is_connected;
        let stroke = if is_missing { Stroke::new(2.0, ui.visuals().error_fg_color) } else { Stroke::new(1.0, colour) };
        let fill = if is_connected { colour } else { ui.visuals().extreme_bg_color };
        Pin {
            id: ui.next_auto_id(),
            label,
            info: PinInfo::circle().with_fill(fill).with_stroke(stroke).with_wire_color(colour),
            to_global: self.to_global,
        }
    }
}

impl SnarlViewer<String> for Draw<'_> {
    fn title(&mut self, node: &String) -> String {
        node.clone()
    }

    fn current_transform(&mut self, to_global: &mut TSTransform, _: &mut Snarl<String>) {
        *to_global = self.forced.unwrap_or(*to_global);
        self.to_global = *to_global;
    }

    fn draw_background(
        &mut self,
        background: Option<&egui_snarl::ui::BackgroundPattern>,
        viewport: &Rect,
        snarl_style: &SnarlStyle,
        style: &egui::Style,
        painter: &egui::Painter,
        _: &Snarl<String>,
    ) {
        if let Some(background) = background {
            background.draw(viewport, snarl_style, style, painter);
        }
        comments::draw(self.state.document(), self.state.comment, style, painter);
    }

    fn node_frame(
        &mut self,
        default: egui::Frame,
        node: NodeId,
        _: &[InPin],
        _: &[OutPin],
        snarl: &Snarl<String>,
    ) -> egui::Frame {
        let name = &snarl[node];
        let is_muted = self.state.entry(name).is_some_and(|entry| entry.muted);
        let frame = default.inner_margin(6.0).corner_radius(5.0);
        let frame = if is_muted { frame.fill(frame.fill.gamma_multiply(0.5)) } else { frame };
        match () {
            () if self.state.selected.contains(name) => frame.stroke(Stroke::new(2.0, Color32::from_rgb(255, 160, 40))),
            () if node::complaint(self.state, name).is_some() => {
                frame.stroke(Stroke::new(2.0, Color32::from_rgb(225, 60, 50)))
            }
            () => frame,
        }
    }

    fn show_header(&mut self, node: NodeId, _: &[InPin], _: &[OutPin], ui: &mut Ui, snarl: &mut Snarl<String>) {
        node::header(self.state, &snarl[node], ui);
    }

    fn inputs(&mut self, node: &String) -> usize {
        self.state.inputs(node).len()
    }

    fn show_input(&mut self, pin: &InPin, ui: &mut Ui, snarl: &mut Snarl<String>) -> impl SnarlPin + 'static {
        ui.style_mut().interaction.selectable_labels = false;
        let found = self.input(pin.id, snarl);
        let (name, port) = found.as_ref().map_or(("", None), |(name, port)| (name, Some(port)));
        if let Some(port) = port {
            let text = if port.optional { egui::RichText::new(&port.name).weak() } else { port.name.as_str().into() };
            let kind = port.kind.map_or("", Kind::name);
            ui.label(text.size(11.0)).on_hover_text(format!("{kind}\n{}", port.doc));
        }
        let label = format!("input {} of {name}", port.map_or("", |port| &port.name));
        self.pin(ui, label, port, !pin.remotes.is_empty())
    }

    fn outputs(&mut self, node: &String) -> usize {
        self.state.outputs(node).len()
    }

    fn show_output(&mut self, pin: &OutPin, ui: &mut Ui, snarl: &mut Snarl<String>) -> impl SnarlPin + 'static {
        ui.style_mut().interaction.selectable_labels = false;
        let found = self.output(pin.id, snarl);
        let (name, port) = found.as_ref().map_or(("", None), |(name, port)| (name, Some(port)));
        if let Some(port) = port {
            let kind = port.kind.map_or("", Kind::name);
            ui.label(egui::RichText::new(&port.name).size(11.0)).on_hover_text(format!("{kind}\n{}", port.doc));
        }
        let label = format!("output {} of {name}", port.map_or("", |port| &port.name));
        // An output that nothing takes from lacks nothing.
        let port = port.map(|port| PortView { optional: true, ..port.clone() });
        self.pin(ui, label, port.as_ref(), !pin.remotes.is_empty())
    }

    fn has_footer(&mut self, _: &String) -> bool {
        true
    }

    fn show_footer(&mut self, node: NodeId, _: &[InPin], _: &[OutPin], ui: &mut Ui, snarl: &mut Snarl<String>) {
        node::footer(self.state, &snarl[node], ui);
    }

    fn final_node_rect(&mut self, node: NodeId, rect: Rect, ui: &mut Ui, snarl: &mut Snarl<String>) {
        let name = snarl[node].clone();
        self.rects.insert(name.clone(), rect);
        let frame = Id::new(GRAPH).with(("snarl-node", node)).with("frame");
        let Some(response) = ui.ctx().read_response(frame) else { return };
        // The part that is seen; all of it where none is.
        let whole = self.to_global * rect;
        let seen = if whole.intersects(self.screen) { whole.intersect(self.screen) } else { whole };
        describe(ui.ctx(), frame, &node::spoken(self.state, &name), seen);
        let adds = ui.input(|input| input.modifiers.shift || input.modifiers.command);
        let is_chosen = self.state.selected.contains(&name);
        if response.clicked() || (response.drag_started() && !is_chosen) || response.secondary_clicked() {
            match (adds, is_chosen) {
                (true, true) if response.clicked() => self.state.selected.retain(|other| *other != name),
                (true, _) => self.state.selected.push(name.clone()),
                (false, true) if response.secondary_clicked() => {}
                (false, _) => self.state.choose(&name),
            }
        }
        if response.double_clicked() {
            self.state.viewed = Some((name, 0));
        }
        let by = response.drag_delta();
        if response.dragged_by(egui::PointerButton::Primary) && !adds && by != Vec2::ZERO {
            self.happened.push(Happened::Moved { nodes: self.state.selected.clone(), by: [by.x.into(), by.y.into()] });
        }
        if response.drag_stopped() {
            self.happened.push(Happened::Dropped);
        }
    }

    fn has_node_menu(&mut self, _: &String) -> bool {
        true
    }

    fn show_node_menu(&mut self, node: NodeId, _: &[InPin], _: &[OutPin], ui: &mut Ui, snarl: &mut Snarl<String>) {
        node::menu(self.state, &snarl[node], ui);
    }

    fn has_dropped_wire_menu(&mut self, pins: AnyPins, snarl: &mut Snarl<String>) -> bool {
        let port = match pins {
            AnyPins::Out(pins) => pins.first().and_then(|pin| {
                let (node, port) = self.output(*pin, snarl)?;
                let name = self.state.output_text(&(node.clone(), pin.output));
                Some(Port { node, name, kind: port.kind, is_output: true })
            }),
            AnyPins::In(pins) => pins.first().and_then(|pin| {
                let (node, port) = self.input(*pin, snarl)?;
                Some(Port { node, name: port.name, kind: port.kind, is_output: false })
            }),
        };
        self.happened.push(Happened::Palette { at: Pos2::ZERO, place: [0.0; 2], port });
        false
    }

    fn connect(&mut self, from: &OutPin, to: &InPin, snarl: &mut Snarl<String>) {
        let (Some((source, output)), Some((node, input))) = (self.output(from.id, snarl), self.input(to.id, snarl))
        else {
            return;
        };
        if let (Some(a), Some(b)) = (output.kind, input.kind)
            && a != b
        {
            self.happened.push(Happened::Mismatch { from: a.name(), to: b.name() });
            return;
        }
        let from = self.state.output_text(&(source, from.id.output));
        self.happened.push(Happened::Connect { from, node, port: input.name });
    }

    fn disconnect(&mut self, _: &OutPin, to: &InPin, snarl: &mut Snarl<String>) {
        if let Some((node, port)) = self.input(to.id, snarl) {
            self.happened.push(Happened::Disconnect { node, port: port.name });
        }
    }

    fn drop_inputs(&mut self, pin: &InPin, snarl: &mut Snarl<String>) {
        if let Some((node, port)) = self.input(pin.id, snarl) {
            self.happened.push(Happened::Disconnect { node, port: port.name });
        }
    }

    fn drop_outputs(&mut self, pin: &OutPin, snarl: &mut Snarl<String>) {
        for remote in &pin.remotes {
            if let Some((node, port)) = self.input(*remote, snarl) {
                self.happened.push(Happened::Disconnect { node, port: port.name });
            }
        }
    }
}

/// A port, with a name that is heard.
struct Pin {
    id: Id,
    label: String,
    info: PinInfo,
    to_global: TSTransform,
}

impl SnarlPin for Pin {
    fn draw(self, snarl_style: &SnarlStyle, style: &egui::Style, rect: Rect, painter: &egui::Painter) -> PinWireInfo {
        describe(painter.ctx(), self.id, &self.label, self.to_global * rect);
        self.info.draw(snarl_style, style, rect, painter)
    }
}

/// Tells assistive technology what lies where on the screen: the graph has a scale of its own.
fn describe(ctx: &egui::Context, id: Id, name: &str, rect: Rect) {
    ctx.accesskit_node_builder(id, |node| {
        node.set_role(egui::accesskit::Role::Button);
        node.set_label(name);
        let (min, max) = (rect.min, rect.max);
        let bounds = egui::accesskit::Rect { x0: min.x.into(), y0: min.y.into(), x1: max.x.into(), y1: max.y.into() };
        node.set_bounds(bounds);
    });
}
