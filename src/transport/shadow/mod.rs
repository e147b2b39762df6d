//! All-frequency shadows: visibility apart from light (thesis chapter 6).
//!
//! ```text
//! lamp        the part of an environment that a shadow belongs to
//! localize    which part that is, by what painted samples miss; regions: connected texels
//! edits       what to do to the shadow of a lamp at some samples
//! visibility  what samples see of the cube's faces, per group of objects, and its edits
//! direct      what light would do without shadows: an environment, and the samples it falls on
//! ratio       a shadow as a picture of factors
//! ```

pub mod direct;
pub mod edits;
pub mod lamp;
pub mod localize;
pub mod ratio;
pub mod regions;
pub mod visibility;

pub use direct::DirectTransport;
pub use edits::{ShadowChange, ShadowEdit};
pub use lamp::Lamp;
pub use ratio::Ratio;
pub use visibility::{Group, Visibility};
