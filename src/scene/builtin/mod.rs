//! Scenes and environments that ship in the program: made here, no file needed.

mod bare;
mod builder;
mod hall;
mod room;
pub mod skies;
mod walk;
mod yard;

use crate::scene::{Geometry, Scene};
use std::sync::Arc;

enum Make {
    Still(fn() -> Scene),
    /// Made for a time in seconds; it moves from 0 to so many.
    Moving(fn(f32) -> Scene, f32),
}

/// Of each: its name and what makes it.
const SCENES: &[(&str, Make)] = &[
    ("bare", Make::Still(bare::bare)),
    ("hall", Make::Still(hall::hall)),
    ("room", Make::Still(room::room)),
    ("walk", Make::Moving(walk::walk, walk::SECONDS)),
    ("yard", Make::Still(yard::yard)),
];

pub fn names() -> impl Iterator<Item = &'static str> {
    SCENES.iter().map(|(name, _)| *name)
}

fn make(name: &str) -> Option<&'static Make> {
    SCENES.iter().find(|(known, _)| *known == name).map(|(_, make)| make)
}

/// A scene as it is at first.
pub fn scene(name: &str) -> Option<Scene> {
    Some(match make(name)? {
        Make::Still(make) => make(),
        Make::Moving(make, _) => make(0.0),
    })
}

/// Seconds that a scene moves for; 0 for one that does not.
pub fn seconds(name: &str) -> f32 {
    match make(name) {
        Some(Make::Moving(_, seconds)) => *seconds,
        _ => 0.0,
    }
}

/// A scene that moves at a time, without its poses.
pub fn scene_at(name: &str, time: f32) -> Option<Scene> {
    match make(name)? {
        Make::Still(_) => None,
        Make::Moving(make, _) => Some(make(time)),
    }
}

/// Where the surfaces of a scene that moves are at `count` times spread evenly over it; none of one that does not.
pub fn poses(name: &str, count: usize) -> Arc<[Geometry]> {
    let time = |i: usize| seconds(name) * i as f32 / (count - 1) as f32;
    let pose = |i: usize| Some(Arc::unwrap_or_clone(scene_at(name, time(i))?.geometry));
    (0..count).map_while(pose).collect()
}
