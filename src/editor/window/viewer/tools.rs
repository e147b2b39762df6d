//! Tools: what the hand does on the picture, each ending in ordinary nodes.

use super::picture::{self, Mapping};
use super::{Camera, Viewer};
use crate::editor::hands::handles::{self, Grip, Handle, Place};
use crate::editor::hands::{light, ring, shadow, stroke};
use crate::editor::keys;
use crate::editor::look::nearest;
use crate::editor::shown::Shown;
use crate::editor::window::state::{State, Tool};
use crate::scene::SurfacePoint;
use crate::scene::bvh::Ray;
use egui::{Color32, PointerButton, Pos2, Response, Stroke, Ui};
use glam::{Vec2, Vec3};
use serde_json::{Map, Value as Json, json};

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

/// Points of the screen within which a handle is taken.
const REACH: f32 = 10.0;

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

/// A picture on the screen, and what its pixels lie on.
struct Hand<'a> {
    shown: &'a Shown,
    mapping: &'a Mapping,
}

impl Hand<'_> {
    /// The surface under a place of the screen.
    fn surface(&self, at: Pos2) -> Option<SurfacePoint> {
        let (samples, scene) = (self.shown.samples.as_ref()?, self.shown.scene.as_ref()?);
        let size = Vec2::new(samples.width as f32, samples.height as f32);
        let hit = scene.geometry.bvh.closest(&samples.camera.ray(self.mapping.to_picture(at), size));
        (hit.triangle != SurfacePoint::NOWHERE.triangle)
            .then(|| scene.geometry.surface_point(hit.triangle as usize, hit.u, hit.v, hit.front))
    }

    fn to_screen(&self, place: Place) -> Option<Pos2> {
        match place {
            Place::Picture(at) => Some(self.mapping.to_screen(at * self.mapping.size.y)),
            Place::World(point) => {
                let samples = self.shown.samples.as_ref()?;
                let size = Vec2::new(samples.width as f32, samples.height as f32);
                samples.camera.project(point, size).map(|(at, _)| self.mapping.to_screen(at))
            }
        }
    }

    /// Through the pointer, at the depth of a point.
    fn beside(&self, point: Vec3, at: Pos2) -> Option<Vec3> {
        let samples = self.shown.samples.as_ref()?;
        let size = Vec2::new(samples.width as f32, samples.height as f32);
        let (_, depth) = samples.camera.project(point, size)?;
        let ray: Ray = samples.camera.ray(self.mapping.to_picture(at), size);
        Some(ray.origin + ray.direction * depth)
    }

    fn aspect(&self) -> f32 {
        self.mapping.size.x / self.mapping.size.y
    }

    fn handles(&self, state: &State) -> Vec<Handle> {
        let Some((kind, params)) = chosen(state) else { return Vec::new() };
        if state.tool != Tool::Point {
            return Vec::new();
        }
        handles::handles(&kind, &params, self.aspect())
    }

    fn draw_handles(&self, handles: &[Handle], ui: &Ui) {
        let painter = ui.painter_at(self.mapping.pane);
        let (line, fill) = (Stroke::new(1.5, Color32::from_rgb(255, 170, 50)), Color32::from_rgb(255, 170, 50));
        let shade = Stroke::new(3.0, Color32::from_black_alpha(140));
        let places: Vec<Option<Pos2>> = handles.iter().map(|handle| self.to_screen(handle.at)).collect();
        for (handle, at) in handles.iter().zip(&places) {
            let Some(at) = *at else { continue };
            if let Some(tail) = handle.tail.and_then(|tail| places.get(tail).copied().flatten()) {
                painter.line_segment([tail, at], shade);
                match handle.kind {
                    Grip::Arrow => painter.arrow(tail, at - tail, line),
                    _ => drop(painter.line_segment([tail, at], line)),
                }
            }
            match handle.kind {
                Grip::Stretch => {
                    painter.rect_filled(egui::Rect::from_center_size(at, egui::Vec2::splat(9.0)), 0.0, fill);
                }
                Grip::Turn => drop(painter.circle(at, 6.0, Color32::TRANSPARENT, line)),
                _ => drop(painter.circle(at, 5.0, fill, Stroke::new(1.0, Color32::BLACK))),
            }
        }
    }
}

/// Type and all parameters of the chosen node at the frame.
fn chosen(state: &State) -> Option<(String, Map<String, Json>)> {
    let name = state.chosen()?;
    let (entry, node_type) = (state.entry(name)?, state.node_type(name)?);
    let mut params = (node_type.defaults)().as_object().cloned().unwrap_or_default();
    for (param, value) in &entry.params {
        params.insert(param.clone(), keys::value_at(value, state.frame as f64));
    }
    Some((entry.kind.clone(), params))
}

/// Where the brush will paint, and where a light will stand.
fn hover(viewer: &Viewer, state: &State, hand: &Hand, at: Pos2, ui: &Ui) {
    let painter = ui.painter_at(hand.mapping.pane);
    match state.tool {
        Tool::Point => {}
        Tool::Brush => {
            let pixel = hand.mapping.to_picture(at);
            let colour = if state.brush.erase { Color32::from_rgb(120, 200, 255) } else { Color32::WHITE };
            for (share, width) in [(1.0, 1.5), (state.brush.hardness, 0.75)] {
                let Some(radius) = radius(state, hand, at) else { continue };
                let ring = ring::ring(hand.shown, pixel, radius * share);
                let points: Vec<Pos2> = ring.into_iter().map(|at| hand.mapping.to_screen(at)).collect();
                if points.len() > 2 {
                    painter.add(egui::Shape::closed_line(points.clone(), Stroke::new(width + 1.5, Color32::BLACK)));
                    painter.add(egui::Shape::closed_line(points, Stroke::new(width, colour)));
                }
            }
        }
        Tool::Light => {
            let Some(point) = hand.surface(at) else { return };
            let stands = light::position(point.position.into(), point.normal.into(), viewer.offset);
            if let Some(top) = hand.to_screen(Place::World(stands)) {
                painter.line_segment([at, top], Stroke::new(1.5, Color32::YELLOW));
                painter.circle_filled(top, 5.0, Color32::YELLOW);
            }
        }
    }
}

/// Of the brush, metres, at the surface under the pointer.
fn radius(state: &State, hand: &Hand, at: Pos2) -> Option<f32> {
    let point = hand.surface(at)?;
    match state.brush.adaptive {
        true => ring::adaptive_radius(hand.shown, &point, state.brush.radius),
        false => Some(state.brush.radius),
    }
}

fn begin(viewer: &Viewer, state: &mut State, hand: &Hand, handles: &[Handle], at: Pos2) -> Option<Drag> {
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
            let dab = stroke::dab(
                point.position.into(),
                point.normal.into(),
                brush.radius,
                brush.hardness,
                brush.value,
                brush.erase,
                brush.adaptive,
            );
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
    let view = nearest(document, &node, "view_samples");
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

fn follow(drag: &Drag, offset: f32, state: &mut State, hand: &Hand, at: Pos2, is_free: bool) {
    match drag {
        Drag::Stroke { paint, radius } => {
            let Some(point) = hand.surface(at) else { return };
            state.change("paint", Some("paint"), |document| {
                stroke::extend(document, paint, point.position.into(), point.normal.into(), *radius)
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
            let place = super::super::graph::free_place(state);
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
