//! All-frequency shadows: visibility apart from light (thesis chapter 6).
//!
//! ```text
//! lamp        the part of an environment that a shadow belongs to
//! edits       what to do to the shadow of a lamp at some samples
//! visibility  what samples see of the cube's faces, per group of objects, and its edits
//! direct      what light would do without shadows: an environment, and the samples it falls on
//! ratio       a shadow as a picture of factors
//! kinship     which points of a picture lie on one surface
//! antialias   smooth edges for one sample a pixel
//! ```

pub mod antialias;
pub mod direct;
pub mod edits;
pub mod kinship;
pub mod lamp;
pub mod ratio;
pub mod visibility;

pub use direct::DirectTransport;
pub use edits::{ShadowChange, ShadowEdit};
pub use lamp::Lamp;
pub use ratio::Ratio;
pub use visibility::{Group, Visibility};
