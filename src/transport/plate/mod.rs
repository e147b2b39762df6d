//! Another renderer's pictures: their own surface points, and changes seen in a preview applied to them.
//!
//! ```text
//! passes    position and normal layers, in our axes
//! pinhole   the camera, from where pixels lie in space
//! edges     pixels between surfaces, put on one of them
//! samples   all of it: a plate as view samples
//! change    before and after of a preview -> the plate, light by light
//! ```

pub mod change;
mod edges;
pub mod passes;
mod pinhole;
pub mod samples;
