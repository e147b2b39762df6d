//! What lies under the pointer, and where it lies on the screen.

use crate::editor::hands::handles::{self, Grip, Handle, Place};
use crate::editor::hands::ring;
use crate::editor::keys;
use crate::editor::shown::Shown;
use crate::editor::window::state::{State, Tool};
use crate::editor::window::viewer::picture::Mapping;
use crate::scene::SurfacePoint;
use crate::transport::selection::Attached;
use egui::{Color32, Pos2, Stroke, Ui};
use glam::{Vec2, Vec3};
use serde_json::{Map, Value as Json};

/// Points of the screen within which a handle is taken.
pub const REACH: f32 = 10.0;

/// A picture on the screen, and what its pixels lie on.
pub struct Hand<'a> {
    pub shown: &'a Shown,
    pub mapping: &'a Mapping,
}

impl Hand<'_> {
    /// The surface under a place of the screen.
    pub fn surface(&self, at: Pos2) -> Option<SurfacePoint> {
        let (samples, scene) = (self.shown.samples.as_ref()?, self.shown.scene.as_ref()?);
        let size = Vec2::new(samples.width as f32, samples.height as f32);
        let hit = scene.geometry.bvh.closest(&samples.camera.ray(self.mapping.to_picture(at), size));
        (hit.triangle != SurfacePoint::NOWHERE.triangle)
            .then(|| scene.geometry.surface_point(hit.triangle as usize, hit.u, hit.v, hit.front))
    }

    /// What paint on a surface goes with, if that ever moves.
    pub fn attached(&self, point: &SurfacePoint, frame: i64) -> Option<Attached> {
        let geometry = &self.shown.scene.as_ref()?.geometry;
        let object = geometry.objects[point.object as usize].clone();
        geometry.moves(point.object).then_some(Attached { object, frame })
    }

    pub fn to_screen(&self, place: Place) -> Option<Pos2> {
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
    pub fn beside(&self, point: Vec3, at: Pos2) -> Option<Vec3> {
        let samples = self.shown.samples.as_ref()?;
        let size = Vec2::new(samples.width as f32, samples.height as f32);
        let (_, depth) = samples.camera.project(point, size)?;
        let ray = samples.camera.ray(self.mapping.to_picture(at), size);
        Some(ray.origin + ray.direction * depth)
    }

    pub fn aspect(&self) -> f32 {
        self.mapping.size.x / self.mapping.size.y
    }

    pub fn handles(&self, state: &State) -> Vec<Handle> {
        let chosen = if state.tool == Tool::Point { chosen(state) } else { None };
        chosen.map_or_else(Vec::new, |(kind, params)| handles::handles(&kind, &params, self.aspect()))
    }

    pub fn draw_handles(&self, handles: &[Handle], ui: &Ui) {
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
pub fn chosen(state: &State) -> Option<(String, Map<String, Json>)> {
    let name = state.chosen()?;
    let (entry, node_type) = (state.entry(name)?, state.node_type(name)?);
    let mut params = (node_type.defaults)().as_object().cloned().unwrap_or_default();
    for (param, value) in &entry.params {
        params.insert(param.clone(), keys::value_at(value, state.frame as f64).into_owned());
    }
    Some((entry.kind.clone(), params))
}

/// Of the brush, metres, at the surface under the pointer.
pub fn radius(state: &State, hand: &Hand, at: Pos2) -> Option<f32> {
    let point = hand.surface(at)?;
    match state.brush.adaptive {
        true => ring::adaptive_radius(hand.shown, &point, state.brush.radius),
        false => Some(state.brush.radius),
    }
}
