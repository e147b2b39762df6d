//! Edits of light where it leaves a surface, at any surface point (thesis Algorithm 5).

use crate::scene::SurfacePoint;
use crate::transport::Edits;
use crate::transport::edits::{SourceBrush, SourceChange};

/// The source brushes of a list.
#[derive(Clone, Debug, Default)]
pub struct SourceEdits {
    brushes: Vec<SourceBrush>,
}

impl SourceEdits {
    pub fn new(edits: &Edits) -> Self {
        Self { brushes: edits.source().cloned().collect() }
    }

    pub fn at(&self, points: &[SurfacePoint]) -> SourceChange {
        let mut change = SourceChange::default();
        for brush in &self.brushes {
            let weights = brush.selection.as_ref().map(|selection| selection.weights(points));
            change.add(brush, weights.as_deref(), points.len());
        }
        change
    }
}
