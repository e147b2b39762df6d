//! Edits of light between a caster and a receiver: a block of the transfer matrix, and what becomes of it.

use crate::image::colour;
use crate::kernels::colour_edits::Knot;
use crate::transport::Selection;
use crate::transport::tone_curve::ToneCurve;
use glam::{Mat3, Vec3};
use std::sync::Arc;

/// The part of the transfer matrix where the caster's columns meet the receiver's rows (thesis 5.4.1), with soft edges:
/// the weight of a path is `receiver(v) caster(g)`. `None` is the whole scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    pub caster: Option<Arc<Selection>>,
    pub receiver: Option<Arc<Selection>>,
}

/// Light on a path of weight `w` becomes `(1 - w) old + w changed`.
#[derive(Clone, Debug, PartialEq)]
pub struct Transit {
    pub block: Block,
    pub change: Change,
}

impl Transit {
    pub fn is_colour(&self) -> bool {
        matches!(self.change, Change::Colour(_))
    }

    /// It is not linear in light.
    pub fn has_curve(&self) -> bool {
        matches!(&self.change, Change::Colour(colour) if colour.curve != ToneCurve::None)
    }
}

#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    Colour(Colour),
    /// Light falls off with another power of distance (thesis 5.4.2): times `(d / distance)^(2 - exponent)`.
    Falloff {
        /// 2 is physical.
        exponent: f32,
        /// Metres: light from that far stays as it is.
        distance: f32,
    },
    /// What lies between caster and receiver blocks less light: visibility `V` becomes `V + amount (1 - V)`.
    Shadow {
        /// 0 as it is, 1 as if nothing were in between; below 0 is refused.
        amount: f32,
    },
    /// Light arrives as if more of it came from one side (thesis figure 5.1c): times
    /// `1 + amount ((focus + 1) ((1 + cos) / 2)^focus - 1)`, `cos` between the path and `axis`; over all directions the
    /// mean of the factor is 1.
    Directionality {
        /// Unit vector towards where light is to come from, world.
        axis: Vec3,
        /// [0, 1].
        amount: f32,
        /// 0 or more; 1 a wide lobe, larger is narrower.
        focus: f32,
    },
}

/// Changes the colour of what arrives (thesis 4.4.2): brightness, saturation and hue, then a curve on its luminance.
#[derive(Clone, Debug, PartialEq)]
pub struct Colour {
    /// Factor.
    pub brightness: f32,
    /// 0 grey, 1 as it is.
    pub saturation: f32,
    /// Degrees.
    pub hue: f32,
    pub curve: ToneCurve,
}

impl Colour {
    /// Brightness, saturation and hue as one matrix on linear Rec.709: all three are linear in light.
    pub fn matrix(&self) -> Mat3 {
        colour::hue(self.hue) * colour::saturation(self.saturation) * self.brightness
    }

    /// Applied to luminance after the matrix; empty for none.
    pub fn knots(&self) -> Vec<Knot> {
        self.curve.knots()
    }
}

impl Change {
    pub fn changes_nothing(&self) -> bool {
        match self {
            Self::Colour(colour) => colour.matrix() == Mat3::IDENTITY && colour.curve == ToneCurve::None,
            Self::Falloff { exponent, .. } => *exponent == 2.0,
            Self::Shadow { amount } => *amount == 0.0,
            Self::Directionality { amount, focus, .. } => *amount == 0.0 || *focus == 0.0,
        }
    }
}
