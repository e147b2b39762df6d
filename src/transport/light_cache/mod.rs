//! What look-ups of an irradiance cache read: plain data, by columns, that the kernel `cached_light` reads as it is.
//!
//! ```text
//! gradients   light of a record, and how it changes around
//! look_up     which records count at a place, how much, and the light that they make
//! index       which records are to be asked there
//! parting     which of them say nothing of it
//! ```
//!
//! Where records come from: `final_gather::cache`.

mod gradients;
pub mod index;
mod look_up;
mod parting;

pub use gradients::Gradients;
pub use index::Index;
pub use look_up::{Found, Shape};
pub use parting::{Parting, Spot};

use glam::Vec4;

/// Records, by columns; `count` is that of `parting`.
#[derive(Clone)]
pub struct Columns {
    /// `a`: the largest error that a record may have where it counts.
    pub error: f32,
    pub parting: Parting,
    /// One a record.
    pub shapes: Vec<Shape>,
    /// One a record.
    pub light: Vec<Gradients>,
    /// Weights of receivers, `count` a record.
    pub receivers: Vec<f32>,
    /// Derivatives of the light by each receiver's weight, `count` a record, W/m²; by themselves, since most places do not
    /// ask for them. How they change with place matters only where weights do, and is left out.
    pub changes: Vec<Vec4>,
    /// Of the shapes.
    pub index: Index,
}

impl Columns {
    pub fn new(error: f32, parting: Parting) -> Self {
        Self {
            error,
            parting,
            shapes: Vec::new(),
            light: Vec::new(),
            receivers: Vec::new(),
            changes: Vec::new(),
            index: Index::default(),
        }
    }

    /// Weights of receivers at a record.
    #[inline]
    pub fn receivers_of(&self, record: usize) -> &[f32] {
        &self.receivers[record * self.parting.count..][..self.parting.count]
    }
}
