//! The mathematics of light transport: surface samples, gather samples, transfer rows, Haar, edits.

pub mod atlas;
pub mod atoms;
pub mod blocks;
pub mod cluster;
pub mod compress;
pub mod edits;
pub mod feature;
pub mod gather;
pub mod glossy;
pub mod hidden;
pub mod keyframes;
pub mod lighting;
pub mod nearest;
mod pack;
pub mod plate;
pub mod precompute;
pub mod rows;
pub mod runs;
pub mod sampled;
pub mod samples;
pub mod sampling;
pub mod scale_offset;
pub mod selection;
pub mod shadow;
pub mod sides;
pub mod sparse;
mod stored;
pub mod tone_curve;
pub mod transfer;
pub mod ways;

pub use edits::{Edit, Edits};
pub use sampled::Sampled;
pub use samples::Samples;
pub use selection::Selection;
pub use sparse::SparseRows;
pub use transfer::{Basis, Transfer};
