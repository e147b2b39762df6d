//! Hands on the picture: what a press, a drag or a stroke does to the recipe. Each leaves ordinary nodes.
//!
//! ```text
//! insert   a node into wires that are there
//! light    placing a light off a surface (thesis 4.4.1)
//! stroke   brush strokes, in the `paint` node of a selection (4.4.3 to 4.4.5)
//! ring     where a brush reaches on the surfaces that are seen
//! find     the light of a painted shadow, and edits of that shadow (6.7.2)
//! shadow   how far light turns when its shadow is dragged
//! handles  points of a node's parameters that lie in the picture
//! ```

pub mod find;
pub mod handles;
mod insert;
pub mod light;
pub mod ring;
pub mod shadow;
pub mod stroke;

pub use find::find_light_of;
pub use handles::{Handle, Place};
pub use insert::insert_after;
