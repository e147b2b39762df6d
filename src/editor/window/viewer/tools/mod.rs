//! Tools: what the hand does on the picture, each ending in ordinary nodes.
//!
//! ```text
//! mod     one frame of the hand; the menu on a right click
//! hand    what lies under the pointer, and where it lies on the screen
//! hover   where the brush will paint, and a light stand
//! begin   a drag begins: stroke, light, handle, shadow
//! follow  ... and goes on
//! ```

mod begin;
mod follow;
mod hand;
mod hover;

use super::picture::{self, Mapping};
use super::{Camera, Viewer};
use crate::editor::look::nearest;
use crate::editor::window::state::{State, Tool};
use crate::scene::SurfacePoint;
use begin::begin;
use egui::{PointerButton, Pos2, Response, Ui};
use follow::follow;
use glam::Vec3;
use hand::Hand;
use hover::hover;
use serde_json::json;

/// What is being dragged.
pub enum Drag {
    Stroke {
        paint: String,
        radius: f32,
    },
    Light {
        node: String,
    },
    Handle {
        node: String,
        number: usize,
    },
    Shadow(Box<Swing>),
    /// The line between A and B.
    Wipe,
}

/// A shadow that is dragged over a surface.
pub struct Swing {
    node: String,
    light: Vec3,
    from: SurfacePoint,
    /// Of the node, when the drag began: its offset, or its axis and angle.
    offset: Vec3,
    axis: Vec3,
    angle: f32,
    turns: bool,
}

/// Whether the hand is at work, so that the picture stays where it is.
pub fn ui(viewer: &mut Viewer, state: &mut State, mapping: &Mapping, response: &Response, ui: &Ui) -> bool {
    if viewer.camera == Camera::Environment {
        return false;
    }
    let Some(shown) = viewer.shown.clone() else { return false };
    let hand = Hand { shown: &shown, mapping };
    let pointer = response.hover_pos().or(ui.input(|input| input.pointer.interact_pos()));
    let handles = hand.handles(state);
    hand.draw_handles(&handles, ui);
    if let Some(at) = pointer.filter(|_| response.hovered()) {
        hover(viewer, state, &hand, at, ui);
    }
    if response.secondary_clicked() {
        viewer.menu_at = pointer;
    }
    let menu_at = viewer.menu_at;
    response.context_menu(|ui| menu(state, &hand, menu_at, ui));
    let is_primary = response.drag_started_by(PointerButton::Primary)
        || (response.clicked_by(PointerButton::Primary) && state.tool != Tool::Point);
    if is_primary {
        let at = ui.input(|input| input.pointer.press_origin()).or(pointer);
        let is_wipe = at.is_some_and(|at| picture::is_on_line(viewer, mapping, at));
        viewer.drag = match is_wipe {
            true => Some(Drag::Wipe),
            false => at.and_then(|at| begin(viewer, state, &hand, &handles, at)),
        };
    }
    let is_busy = viewer.drag.is_some();
    if let (Some(Drag::Wipe), Some(at)) = (&viewer.drag, pointer) {
        picture::wipe(viewer, mapping, at);
    } else if let (Some(drag), Some(at)) = (&viewer.drag, pointer) {
        let is_free = ui.input(|input| input.modifiers.shift);
        follow(drag, viewer.offset, state, &hand, at, is_free);
    }
    if response.drag_stopped() || (is_busy && !ui.input(|input| input.pointer.any_down())) {
        viewer.drag = None;
        state.session.end_drag();
    }
    is_busy
}

/// On a right click: what is under the pointer, as a selection.
fn menu(state: &mut State, hand: &Hand, at: Option<Pos2>, ui: &mut Ui) {
    let Some(point) = at.and_then(|at| hand.surface(at)) else {
        ui.weak("no surface here");
        return;
    };
    let shown = hand.shown;
    for (param, name) in
        [("objects", shown.object(&point).to_owned()), ("materials", shown.material(&point).to_owned())]
    {
        let what = if param == "objects" { "object" } else { "material" };
        if !name.is_empty() && ui.button(format!("Pick {what} {name}")).clicked() {
            let place = crate::editor::window::graph::free_place(state);
            let scene = state.viewed.clone().and_then(|(node, _)| nearest(state.document(), &node, "scene"));
            let added = state.change("pick", None, |document| {
                let node = document.add_node("pick", place);
                document.set_param(&node, param, Some(json!([name])));
                if let Some(scene) = scene {
                    document.connect(&scene, &node, "scene")?;
                }
                Ok(node)
            });
            if let Some(node) = added {
                state.choose(&node);
            }
            ui.close();
        }
    }
}
