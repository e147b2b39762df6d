//! Brushes on the two ends of a light path: where light leaves a surface, and where it leaves for the camera.

use crate::image::colour;
use crate::transport::Selection;
use glam::{Mat3, Vec3};
use std::sync::Arc;

/// Changes the indirect light that surfaces send (thesis 4.4.3, Algorithm 5): `B' = B (1 + w (scale - 1)) + w offset`
/// for weight `w`. With more than one bounce, `scale` acts as a change of reflectance towards other surfaces, at each
/// bounce, and `offset` as light of the surface's own.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceBrush {
    /// Where; `None` is everywhere.
    pub selection: Option<Arc<Selection>>,
    /// Factor of radiant exitance, 0 or more.
    pub scale: f32,
    /// Radiant exitance, W/m²; linear Rec.709.
    pub offset: Vec3,
}

impl SourceBrush {
    pub fn changes_nothing(&self) -> bool {
        self.scale == 1.0 && self.offset == Vec3::ZERO
    }
}

/// Changes the indirect light that goes from surfaces to the camera, after their reflectance (thesis 4.4.4,
/// Algorithm 6): `L' = L + w (M L - L)`.
#[derive(Clone, Debug, PartialEq)]
pub struct IlluminationBrush {
    /// Where; `None` is everywhere.
    pub selection: Option<Arc<Selection>>,
    /// Factor: above 1 dodges, below 1 burns.
    pub scale: f32,
    /// Degrees.
    pub hue: f32,
    /// 0 grey, 1 as it is.
    pub saturation: f32,
}

impl IlluminationBrush {
    /// All three as one matrix on linear Rec.709.
    pub fn matrix(&self) -> Mat3 {
        colour::hue(self.hue) * colour::saturation(self.saturation) * self.scale
    }

    pub fn changes_nothing(&self) -> bool {
        self.matrix() == Mat3::IDENTITY
    }
}

/// What source brushes do together at some points: `B' = scale B + offset`; empty for nothing.
#[derive(Clone, Debug, Default)]
pub struct SourceChange {
    pub scale: Vec<f32>,
    /// W/m².
    pub offset: Vec<Vec3>,
}

impl SourceChange {
    /// One more brush, after the others; `weights`: at all `count` points, `None` for 1.
    pub fn add(&mut self, brush: &SourceBrush, weights: Option<&[f32]>, count: usize) {
        self.scale.resize(count, 1.0);
        self.offset.resize(count, Vec3::ZERO);
        for (i, (scale, offset)) in self.scale.iter_mut().zip(&mut self.offset).enumerate() {
            let weight = weights.map_or(1.0, |weights| weights[i]);
            let factor = 1.0 + weight * (brush.scale - 1.0);
            *scale *= factor;
            *offset = *offset * factor + brush.offset * weight;
        }
    }

    pub fn scale(&self, i: usize) -> f32 {
        self.scale.get(i).copied().unwrap_or(1.0)
    }

    pub fn offset(&self, i: usize) -> Vec3 {
        self.offset.get(i).copied().unwrap_or(Vec3::ZERO)
    }
}
