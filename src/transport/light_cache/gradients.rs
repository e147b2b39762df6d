//! Light of a record, and how it changes around.

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4};

/// Light at a place, and its first derivatives; linear RGB and an unused fourth.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Gradients {
    /// Irradiance, W/m².
    pub value: Vec4,
    /// By a move of the place along world x, y, z; W/m³.
    pub moved: [Vec4; 3],
    /// By a turn of the normal about world x, y, z; W/m² a radian.
    pub turned: [Vec4; 3],
}

impl Gradients {
    /// At a place `by` farther on, whose normal is turned by `turn` (axis times sine).
    #[inline]
    pub fn at(&self, by: Vec3, turn: Vec3) -> Vec4 {
        let moved = self.moved[0] * by.x + self.moved[1] * by.y + self.moved[2] * by.z;
        let turned = self.turned[0] * turn.x + self.turned[1] * turn.y + self.turned[2] * turn.z;
        self.value + moved + turned
    }

    /// `self (1 - t) + other t`.
    pub fn mix(&self, other: &Self, t: f32) -> Self {
        let each = |a: [Vec4; 3], b: [Vec4; 3]| [0, 1, 2].map(|i| a[i].lerp(b[i], t));
        Self {
            value: self.value.lerp(other.value, t),
            moved: each(self.moved, other.moved),
            turned: each(self.turned, other.turned),
        }
    }

    pub fn times(&self, factor: f32) -> Self {
        let each = |a: [Vec4; 3]| a.map(|a| a * factor);
        Self { value: self.value * factor, moved: each(self.moved), turned: each(self.turned) }
    }

    pub fn plus(&self, other: &Self) -> Self {
        let each = |a: [Vec4; 3], b: [Vec4; 3]| [0, 1, 2].map(|i| a[i] + b[i]);
        Self {
            value: self.value + other.value,
            moved: each(self.moved, other.moved),
            turned: each(self.turned, other.turned),
        }
    }
}
