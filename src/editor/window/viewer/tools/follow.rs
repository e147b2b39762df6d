//! A drag goes on.

use super::hand::{Hand, chosen};
use super::{Drag, Swing};
use crate::editor::hands::handles::{self, Place};
use crate::editor::hands::{light, shadow, stroke};
use crate::editor::keys;
use crate::editor::window::state::State;
use egui::Pos2;
use glam::Vec3;
use serde_json::json;

/// `offset`: of lights from their surface, metres; `is_free`: through the air.
pub fn follow(drag: &Drag, offset: f32, state: &mut State, hand: &Hand, at: Pos2, is_free: bool) {
    match drag {
        Drag::Stroke { paint, radius } => {
            let Some(point) = hand.surface(at) else { return };
            let attached = hand.attached(&point, state.frame);
            state.change("paint", Some("paint"), |document| {
                let (place, normal) = (point.position.into(), point.normal.into());
                stroke::extend(document, paint, (place, normal), *radius, attached.as_ref())
            });
        }
        Drag::Light { node } => {
            let Some(point) = hand.surface(at) else { return };
            let position = light::position(point.position.into(), point.normal.into(), offset);
            state.change("place a light", Some("light"), |document| {
                light::place_at(document, node, position);
                Ok(())
            });
        }
        Drag::Handle { node, number } => drag_handle(node, *number, offset, state, hand, at, is_free),
        Drag::Shadow(swing) => drag_shadow(swing, state, hand, at),
        Drag::Wipe => {}
    }
}

fn drag_handle(node: &str, number: usize, offset: f32, state: &mut State, hand: &Hand, at: Pos2, is_free: bool) {
    let Some((kind, params)) = chosen(state) else { return };
    let all = handles::handles(&kind, &params, hand.aspect());
    let Some(handle) = all.get(number) else { return };
    let to = match handle.at {
        Place::Picture(_) => Some(Place::Picture(hand.mapping.to_picture(at) / hand.mapping.size.y)),
        // Along surfaces; with Shift through the air, as far off as it is.
        Place::World(point) if is_free => hand.beside(point, at).map(Place::World),
        Place::World(_) => hand.surface(at).map(|surface| {
            let off = if kind == "light" { offset } else { 0.0 };
            Place::World(light::position(surface.position.into(), surface.normal.into(), off))
        }),
    };
    let Some(to) = to else { return };
    let changes = handles::dragged(&kind, &params, hand.aspect(), number, handle.at, to);
    let frame = state.frame;
    let mark = format!("handle {node} {number}");
    state.change(&format!("move {}", handle.name), Some(&mark), |document| {
        for (param, value) in changes {
            keys::set(document, node, param, value, frame);
        }
        Ok(())
    });
}

fn drag_shadow(swing: &Swing, state: &mut State, hand: &Hand, at: Pos2) {
    let (Some(to), Some(scene)) = (hand.surface(at), hand.shown.scene.as_ref()) else { return };
    let geometry = &scene.geometry;
    let (from, normal) = (Vec3::from(swing.from.position), Vec3::from(swing.from.geometric_normal));
    let to = Vec3::from(to.position);
    let change = if swing.turns {
        let turned = shadow::angle(geometry, swing.light, swing.axis, from, normal, to);
        turned.map(|turned| {
            let angle = (swing.angle + turned + 180.0).rem_euclid(360.0) - 180.0;
            ("angle", json!((f64::from(angle) * 10.0).round() / 10.0))
        })
    } else {
        let moved = shadow::offset(geometry, swing.light, from, normal, to);
        moved.map(|moved| ("offset", json!((swing.offset + moved).to_array().map(light::rounded))))
    };
    let Some((param, value)) = change else {
        return state.tell("nothing casts a shadow there: take it where it is dark");
    };
    let frame = state.frame;
    state.change("drag the shadow", Some("shadow"), |document| {
        keys::set(document, &swing.node, param, value, frame);
        Ok(())
    });
}
