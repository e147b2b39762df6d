//! What samples see of an environment: rows per group of objects and cube face, and edits of them.

use super::ShadowEdit;
use crate::transport::Samples;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub struct Visibility {
    pub samples: Arc<Samples>,
    /// Texels along a side of each face.
    pub size: usize,
    /// A sample sees what no group hides. The last group holds all objects that no other does.
    pub groups: Vec<Group>,
    /// In order.
    pub edits: Vec<ShadowEdit>,
}

/// Objects that cast shadows together.
#[derive(Clone, Debug)]
pub struct Group {
    pub name: String,
}

impl Visibility {
    pub fn bytes(&self) -> u64 {
        0
    }
}
