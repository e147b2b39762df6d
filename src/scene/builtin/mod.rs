//! Scenes and environments that ship in the program: made here, no file needed.

mod builder;
mod hall;
mod room;
pub mod skies;
mod yard;

use crate::scene::Scene;

type Make = fn() -> Scene;

/// Of each: its name and what makes it.
const SCENES: &[(&str, Make)] = &[("hall", hall::hall), ("room", room::room), ("yard", yard::yard)];

pub fn names() -> impl Iterator<Item = &'static str> {
    SCENES.iter().map(|(name, _)| *name)
}

pub fn scene(name: &str) -> Option<Scene> {
    SCENES.iter().find(|(known, _)| *known == name).map(|(_, make)| make())
}
