//! From a recipe's text to a checked, sorted plan: `plan(&load(path)?)`. Knows nothing of values or of devices.

pub mod check;
pub mod curve;
pub mod document;
pub mod edit;
pub mod migrate;
pub mod params;
pub mod plan;
mod pretty;
pub mod problem;
mod read;
pub mod schema;
pub mod source;

pub use curve::Curve;
pub use document::{Comment, Document, NodeEntry, load};
pub use edit::split;
pub use params::{Checks, Param, Ready};
pub use plan::{Plan, Step, Wire};
pub use problem::{Place, Problem};
