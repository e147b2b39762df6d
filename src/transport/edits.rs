//! An ordered list of light-transport edits (thesis 4.3). An edit is data: it never renders. `lighting` applies it in a
//! preview; other renderers may apply it in their own way.

use crate::Result;
use crate::image::colour;
use crate::kernels::colour_edits::Knot;
use crate::scene::Fingerprint;
use crate::transport::Selection;
use crate::transport::tone_curve::ToneCurve;
use glam::Mat3;
use std::sync::Arc;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edits(pub Vec<Edit>);

#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    CasterReceiver(CasterReceiver),
}

/// Changes the irradiance that arrives at the receiver from the caster, before the receiver's reflectance (thesis
/// 4.4.2). A missing caster or receiver is the whole scene.
#[derive(Clone, Debug, PartialEq)]
pub struct CasterReceiver {
    pub caster: Option<Arc<Selection>>,
    pub receiver: Option<Arc<Selection>>,
    /// Factor.
    pub brightness: f32,
    /// 0 grey, 1 as it is.
    pub saturation: f32,
    /// Degrees.
    pub hue: f32,
    pub curve: ToneCurve,
}

impl CasterReceiver {
    /// Brightness, saturation and hue as one matrix on linear Rec.709: all three are linear in light.
    pub fn matrix(&self) -> Mat3 {
        colour::hue(self.hue) * colour::saturation(self.saturation) * self.brightness
    }

    /// Applied to luminance after the matrix; empty for none.
    pub fn knots(&self) -> Vec<Knot> {
        self.curve.knots()
    }

    pub fn changes_nothing(&self) -> bool {
        self.matrix() == Mat3::IDENTITY && self.curve == ToneCurve::None
    }
}

impl Edits {
    /// The list with one more edit at its end.
    pub fn and(&self, edit: Edit) -> Self {
        Self(self.0.iter().cloned().chain([edit]).collect())
    }

    /// # Errors
    /// `Compute` when a selection names parts of another geometry.
    pub fn check(&self, geometry: &Fingerprint) -> Result<()> {
        let selections = self.0.iter().flat_map(|Edit::CasterReceiver(edit)| [&edit.caster, &edit.receiver]);
        selections.flatten().try_for_each(|selection| selection.check(geometry))
    }

    pub fn bytes(&self) -> u64 {
        let selection = |s: &Option<Arc<Selection>>| s.as_ref().map_or(0, |s| s.bytes());
        let each = |Edit::CasterReceiver(edit): &Edit| 64 + selection(&edit.caster) + selection(&edit.receiver);
        self.0.iter().map(each).sum()
    }
}
