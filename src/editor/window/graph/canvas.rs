//! Nodes and wires on the screen. egui-snarl stays in here and in `draw`: its structure is made anew from the recipe whenever
//! that changes, and what is done to it comes out as `Happened`.

use super::arrange::places;
use super::comments;
use super::draw::{Draw, style};
use super::palette::Port;
use crate::editor::window::state::State;
use egui::emath::TSTransform;
use egui::{Id, Pos2, Rect, Ui, Vec2, pos2};
use egui_snarl::ui::SnarlWidget;
use egui_snarl::{InPinId, NodeId, OutPinId, Snarl};
use std::collections::HashMap;

/// What a person did.
#[derive(Debug, PartialEq)]
pub enum Happened {
    /// `from` as recipes write it.
    Connect {
        from: String,
        node: String,
        port: String,
    },
    Disconnect {
        node: String,
        port: String,
    },
    Moved {
        nodes: Vec<String>,
        by: [f64; 2],
    },
    CommentMoved {
        number: usize,
        nodes: Vec<String>,
        by: [f64; 2],
    },
    /// A drag has ended.
    Dropped,
    /// `at` on the screen, `place` in the graph.
    Palette {
        at: Pos2,
        place: [f64; 2],
        port: Option<Port>,
    },
    /// Two ports that do not fit.
    Mismatch {
        from: &'static str,
        to: &'static str,
    },
}

pub const GRAPH: &str = "graph";

pub struct Canvas {
    snarl: Snarl<String>,
    ids: HashMap<String, NodeId>,
    /// Of the session, when `snarl` was made from it.
    version: Option<u64>,
    /// On the screen.
    rect: Rect,
    to_global: TSTransform,
    fit: bool,
    /// The pane that all was fitted into, and how; until the graph is moved.
    fitted: Option<(Rect, TSTransform)>,
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
            fitted: None,
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
        // A pane that changes its size, as all do when a window opens, keeps in sight what it had.
        self.fitted = self.fitted.filter(|(_, fitted)| *fitted == self.to_global);
        self.fit |= self.fitted.is_some_and(|(pane, _)| pane != self.rect);
        let fits = self.fit && self.rects.len() == state.document().nodes.len();
        if fits {
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
        if fits {
            self.fitted = Some((self.rect, self.to_global));
        }
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
                let output = state
                    .output_number(from)
                    .and_then(|(node, output)| Some(OutPinId { node: *self.ids.get(&node)?, output }));
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
