//! The mathematics of light transport: surface samples, gather samples, transfer rows, Haar, edits.

pub mod cluster;
pub mod compress;
pub mod edits;
pub mod gather;
pub mod precompute;
pub mod rows;
pub mod samples;
pub mod sampling;
pub mod selection;
pub mod sides;
pub mod sparse;
pub mod transfer;

pub use edits::Edits;
pub use samples::Samples;
pub use selection::Selection;
pub use sparse::SparseRows;
pub use transfer::{Basis, Transfer};
