//! All-frequency shadows: visibility apart from light (thesis chapter 6).
//!
//! ```text
//! lamp        the part of an environment that a shadow belongs to
//! localize    which part that is, by what painted samples miss; regions: connected texels
//! edits       what to do to the shadow of a lamp at some samples
//! edited      doing it
//! horizon     the directions above a surface
//! haar        shadows of a face in a Haar basis, truncated
//! visibility  what samples see of the cube's faces, per group of objects, and its edits
//! bake        from surfaces to the rows of visibility
//! blind       samples that see nothing
//! together    groups as one; the mean shadow of some samples
//! direct      what light would do without shadows: an environment, and the samples it falls on
//! tables      an environment made ready to be summed over rows
//! integrate   visibility and light -> a picture
//! ratio       a shadow as a picture of factors
//! kinship     which points of a picture lie on one surface
//! antialias   smooth edges for one sample a pixel
//! ```

pub mod antialias;
pub mod bake;
pub mod blind;
pub mod direct;
pub mod edited;
pub mod edits;
pub mod haar;
pub mod horizon;
pub mod integrate;
pub mod kinship;
pub mod lamp;
pub mod localize;
pub mod ratio;
pub mod regions;
pub mod tables;
pub mod tiles;
mod together;
pub mod visibility;

pub use direct::DirectTransport;
pub use edits::{ShadowChange, ShadowEdit};
pub use lamp::Lamp;
pub use ratio::Ratio;
pub use visibility::{Basis, Group, Rows, Visibility};
