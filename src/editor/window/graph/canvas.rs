//! Nodes and wires on the screen. The only file that names egui-snarl: its structure is made anew from the recipe whenever
//! that changes, and what is done to it comes out as `Happened`.

use super::arrange::places;
use super::palette::Port;
use super::{comments, node};
use crate::editor::window::look::colour;
use crate::editor::window::state::{PortView, State};
use crate::value::Kind;
use egui::emath::TSTransform;
use egui::{Color32, Id, Pos2, Rect, Stroke, Ui, Vec2, pos2};
use egui_snarl::ui::{
    AnyPins, PinInfo, PinPlacement, PinWireInfo, SelectionStyle, SnarlPin, SnarlStyle, SnarlViewer, SnarlWidget,
};
use egui_snarl::{InPin, InPinId, NodeId, OutPin, OutPinId, Snarl};
use std::collections::HashMap;

/// What a person did.
#[derive(Debug, PartialEq)]
pub enum Happened {
    /// `from` as recipes write it.
    Connect { from: String, node: String, port: String },
    Disconnect { node: String, port: String },
    Moved { nodes: Vec<String>, by: [f64; 2] },
    CommentMoved { number: usize, nodes: Vec<String>, by: [f64; 2] },
    /// A drag has ended.
    Dropped,
    /// `at` on the screen, `place` in the graph.
    Palette { at: Pos2, place: [f64; 2], port: Option<Port> },
    /// Two ports that do not fit.
    Mismatch { from: &'static str, to: &'static str },
}

const GRAPH: &str = "graph";

pub struct Canvas {
    snarl: Snarl<String>,
    ids: HashMap<String, NodeId>,
    /// Of the session, when `snarl` was made from it.
    version: Option<u64>,
    /// On the screen.
    rect: Rect,
    to_global: TSTransform,
    fit: bool,
    /// Of each node, in the graph.
    rects: HashMap<String, Rect>,
    /// Where a rectangle that selects was begun, in the graph.
    band: Option<Pos2>,
    comment: Option<usize>,
}

impl Default for Canvas {
    fn default() -> Self {
        Self {
            snarl: Snarl::new(),
            ids: HashMap::new(),
            version: None,
            rect: Rect::ZERO,
            to_global: TSTransform::IDENTITY,
            fit: true,
            rects: HashMap::new(),
            band: None,
            comment: None,
        }
    }
}

impl Canvas {
    pub fn rect(&self) -> Rect {
        self.rect
    }

    pub fn fit(&mut self) {
        self.fit = true;
    }

    pub fn to_graph(&self, at: Pos2) -> [f64; 2] {
        let at = self.to_global.inverse() * at;
        [f64::from(at.x), f64::from(at.y)]
    }

    /// Where the pointer is, or the middle of the graph.
    pub fn pointer(&self, ui: &Ui) -> Pos2 {
        let at = ui.input(|input| input.pointer.hover_pos());
        at.filter(|at| self.rect.contains(*at)).unwrap_or(self.rect.center())
    }

    pub fn ui(&mut self, state: &mut State, ui: &mut Ui) -> Vec<Happened> {
        self.sync(state);
        self.rect = ui.available_rect_before_wrap();
        // All nodes have been drawn once, so that their sizes are known.
        let mut forced = self.comment.map(|_| self.to_global);
        if self.fit && self.rects.len() == state.document().nodes.len() {
            forced = Some(fitted(self.rects.values().copied(), self.rect));
            self.fit = false;
        } else if self.fit {
            ui.ctx().request_repaint();
        }
        let mut draw = Draw {
            happened: Vec::new(),
            to_global: self.to_global,
            forced,
            rects: std::mem::take(&mut self.rects),
            screen: self.rect,
            state,
        };
        draw.rects.retain(|name, _| self.ids.contains_key(name));
        let response = SnarlWidget::new().id(Id::new(GRAPH)).style(style(ui)).show(&mut self.snarl, &mut draw, ui);
        let Draw { mut happened, to_global, rects, .. } = draw;
        (self.to_global, self.rects) = (to_global, rects);
        let pointer = ui.input(|input| input.pointer.latest_pos()).unwrap_or(self.rect.center());
        for event in &mut happened {
            if let Happened::Palette { at, place, .. } = event {
                (*at, *place) = (pointer, self.to_graph(pointer));
            }
        }
        self.background(state, ui, &response, &mut happened);
        happened
    }

    /// Clicks and drags beside all nodes.
    fn background(&mut self, state: &mut State, ui: &Ui, response: &egui::Response, happened: &mut Vec<Happened>) {
        let pointer = ui.input(|input| input.pointer.latest_pos()).map(|at| self.to_global.inverse() * at);
        let pressed = ui.input(|input| input.pointer.press_origin()).map(|at| self.to_global.inverse() * at);
        if response.drag_started_by(egui::PointerButton::Primary)
            && let Some(at) = pressed
        {
            self.comment = comments::title_at(state.document(), at);
            state.comment = self.comment.or(state.comment);
        }
        if let Some(number) = self.comment {
            let by = ui.input(|input| input.pointer.delta()) / self.to_global.scaling;
            if by != Vec2::ZERO {
                let nodes = comments::held(state.document(), number, &self.rects);
                happened.push(Happened::CommentMoved { number, nodes, by: [by.x.into(), by.y.into()] });
            }
            if response.drag_stopped() || !ui.input(|input| input.pointer.any_down()) {
                self.comment = None;
                happened.push(Happened::Dropped);
            }
        }
        if response.clicked()
            && let Some(at) = pointer
        {
            state.selected.clear();
            state.comment = comments::title_at(state.document(), at);
        }
        if response.secondary_clicked()
            && let Some(at) = ui.input(|input| input.pointer.interact_pos())
        {
            happened.push(Happened::Palette { at, place: self.to_graph(at), port: None });
        }
        let band = ui.ctx().read_response(Id::new(GRAPH).with("select"));
        if let Some(band) = band {
            if band.drag_started() {
                self.band = pressed;
            }
            if band.drag_stopped()
                && let (Some(from), Some(to)) = (self.band.take(), pointer)
            {
                let area = Rect::from_two_pos(from, to);
                for name in state.document().nodes.keys().cloned().collect::<Vec<_>>() {
                    let is_in = self.rects.get(&name).is_some_and(|rect| rect.intersects(area));
                    if is_in && !state.selected.contains(&name) {
                        state.selected.push(name);
                    }
                }
            }
        }
    }

    /// Makes the widget's nodes and wires those of the recipe.
    fn sync(&mut self, state: &State) {
        if self.version == Some(state.session.version()) {
            return;
        }
        self.version = Some(state.session.version());
        let document = state.document();
        let snarl = &mut self.snarl;
        self.ids.retain(|name, id| {
            let stays = document.nodes.contains_key(name);
            if !stays {
                snarl.remove_node(*id);
            }
            stays
        });
        let places = places(document);
        for name in document.nodes.keys() {
            let at = places.get(name).copied().unwrap_or_default().map(|x| x as f32);
            let at = pos2(at[0], at[1]);
            let id = *self.ids.entry(name.clone()).or_insert_with(|| snarl.insert_node(at, name.clone()));
            if let Some(node) = snarl.get_node_info_mut(id) {
                node.pos = at;
            }
        }
        let wires: Vec<(OutPinId, InPinId)> = snarl.wires().collect();
        for (from, to) in wires {
            snarl.disconnect(from, to);
        }
        for (name, entry) in &document.nodes {
            let inputs = state.inputs(name);
            for (port, from) in &entry.inputs {
                let input = inputs.iter().position(|input| input.name == *port);
                let output = state.output_number(from).and_then(|(node, output)| {
                    Some(OutPinId { node: *self.ids.get(&node)?, output })
                });
                if let (Some(input), Some(output)) = (input, output) {
                    snarl.connect(output, InPinId { node: self.ids[name], input });
                }
            }
        }
    }
}

/// Where all is seen, no larger than life.
fn fitted(rects: impl Iterator<Item = Rect>, screen: Rect) -> TSTransform {
    let all = rects.fold(Rect::NOTHING, Rect::union).expand(24.0);
    if !all.is_finite() || all.width() <= 0.0 {
        return TSTransform::from_translation(screen.center().to_vec2());
    }
    let scaling = (screen.size() / all.size()).min_elem().clamp(0.2, 1.0);
    TSTransform::new(screen.center().to_vec2() - all.center().to_vec2() * scaling, scaling)
}

fn style(ui: &Ui) -> SnarlStyle {
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
struct Draw<'a> {
    state: &'a mut State,
    happened: Vec<Happened>,
    to_global: TSTransform,
    /// Where the graph is to be seen from, whatever the widget thinks.
    forced: Option<TSTransform>,
    rects: HashMap<String, Rect>,
    screen: Rect,
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
        Pin { id: ui.next_auto_id(), label, info: PinInfo::circle().with_fill(fill).with_stroke(stroke).with_wire_color(colour), to_global: self.to_global }
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
        let seen = (self.to_global * rect).intersect(self.screen);
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
            self.happened.push(Happened::Moved {
                nodes: self.state.selected.clone(),
                by: [by.x.into(), by.y.into()],
            });
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
        let bounds =
            egui::accesskit::Rect { x0: min.x.into(), y0: min.y.into(), x1: max.x.into(), y1: max.y.into() };
        node.set_bounds(bounds);
    });
}
