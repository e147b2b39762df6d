//! A drag begins.

use super::hand::{Hand, REACH, chosen, radius};
use super::{Drag, Swing};
use crate::editor::hands::handles::Handle;
use crate::editor::hands::{light, stroke};
use crate::editor::look::{VIEWS, nearest, nearest_of};
use crate::editor::window::state::{State, Tool};
use crate::editor::window::viewer::Viewer;
use egui::Pos2;
use glam::Vec3;
use serde_json::Value as Json;

/// What the hand takes at a place of the screen, with the chosen tool.
pub fn begin(viewer: &Viewer, state: &mut State, hand: &Hand, handles: &[Handle], at: Pos2) -> Option<Drag> {
    match state.tool {
        Tool::Point => {
            let is_near = |handle: &Handle| hand.to_screen(handle.at).is_some_and(|place| place.distance(at) < REACH);
            match handles.iter().rposition(is_near) {
                Some(number) => Some(Drag::Handle { node: state.chosen()?.to_owned(), number }),
                None => swing(state, hand, at).map(|swing| Drag::Shadow(Box::new(swing))),
            }
        }
        Tool::Light => {
            let point = hand.surface(at)?;
            let position = light::position(point.position.into(), point.normal.into(), viewer.offset);
            // A light that is chosen is moved; else one is added.
            let chosen = state.chosen().filter(|name| state.entry(name).is_some_and(|entry| entry.kind == "light"));
            let node = match chosen.map(str::to_owned) {
                Some(node) => node,
                None => {
                    let lit = viewer.at(state)?.0;
                    let placed = state
                        .change("place a light", Some("light"), |document| light::place(document, &lit, position))?;
                    state.choose(&placed);
                    placed
                }
            };
            Some(Drag::Light { node })
        }
        Tool::Brush => {
            let point = hand.surface(at)?;
            let scene = scene_of(viewer, state)?;
            let brush = state.brush;
            let mut dab = stroke::dab(
                point.position.into(),
                point.normal.into(),
                brush.radius,
                brush.hardness,
                brush.value,
                brush.erase,
                brush.adaptive,
            );
            dab.attached = hand.attached(&point, state.frame);
            let spacing = radius(state, hand, at).unwrap_or(brush.radius);
            let node = state.chosen().map(str::to_owned);
            let info = node.as_deref().and_then(|node| state.info(node));
            let port = viewer.port.clone();
            let paint = state.change("paint", Some("paint"), |document| {
                let target = node.as_deref().zip(info);
                let paint = stroke::target(document, target, port.as_deref(), &scene)?;
                stroke::begin(document, &paint, &dab)?;
                Ok(paint)
            })?;
            if info.is_none_or(|info| !info.inputs.iter().any(|port| port.kind == crate::value::Kind::Selection)) {
                state.choose(&paint);
            }
            Some(Drag::Stroke { paint, radius: spacing })
        }
    }
}

/// What the shown view looks at, as recipes write it.
fn scene_of(viewer: &Viewer, state: &State) -> Option<String> {
    let (node, _) = viewer.at(state)?;
    let document = state.document();
    let view = nearest_of(document, &node, &VIEWS);
    let of_view = view.and_then(|view| document.nodes[&view].inputs.get("scene").cloned());
    of_view.or_else(|| nearest(document, &node, "scene"))
}

/// A shadow that is taken by the hand: a translate_shadow or rotate_shadow is chosen, and its light is known.
fn swing(state: &State, hand: &Hand, at: Pos2) -> Option<Swing> {
    let (kind, params) = chosen(state)?;
    let turns = match kind.as_str() {
        "translate_shadow" => false,
        "rotate_shadow" => true,
        _ => return None,
    };
    let vector = |name: &str| -> Option<Vec3> { serde_json::from_value(params.get(name)?.clone()).ok() };
    let node = state.chosen()?.to_owned();
    Some(Swing {
        light: hand.shown.light?,
        from: hand.surface(at)?,
        offset: vector("offset").unwrap_or_default(),
        axis: vector("axis").unwrap_or(Vec3::Y).normalize_or(Vec3::Y),
        angle: params.get("angle").and_then(Json::as_f64).unwrap_or(0.0) as f32,
        turns,
        node,
    })
}
