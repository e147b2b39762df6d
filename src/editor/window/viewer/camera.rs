//! What a viewer sees through.

use super::orbit::Orbit;
use crate::editor::window::state::State;

#[derive(Clone, Debug, PartialEq)]
pub enum Camera {
    /// That of the recipe, as in production: it does not move.
    Recipe,
    Free(Box<Free>),
    /// None: it shows environments.
    Environment,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Free {
    /// Set once there is a scene to be seen.
    pub orbit: Option<Orbit>,
    /// With its light, which is computed anew from there; otherwise the surfaces alone.
    pub lit: bool,
    /// Pixels.
    pub size: [u32; 2],
}

impl Camera {
    pub fn free() -> Self {
        Self::Free(Box::default())
    }

    /// A free camera starts where the main one is, and looks at what that sees in its middle. `room`: pixels.
    pub fn place(&mut self, state: &State, room: egui::Vec2) {
        let Self::Free(free) = self else { return };
        // In steps, so that a dragged border does not ask for a picture a pixel.
        let fit = |length: f32, most: u32| (((length / 32.0) as u32) * 32).clamp(64, most);
        free.size = [fit(room.x, 800), fit(room.y, 600)];
        if free.orbit.is_none() {
            free.orbit = state.last.as_ref().and_then(Orbit::around);
        }
    }
}
