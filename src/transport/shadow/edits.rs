//! Edits of shadows (thesis 6.6, 6.7.3), as data.
//!
//! What a sample does not see is a shadow only above its horizon: `S = H - V`, with `H` the half of all directions in
//! front of its surface. Every edit is linear in `S` and the picture is lit by `V' = H (1 - S')`, so what has no shadow
//! never changes. An edit changes the directions of its lamp `m(w)` at the samples of its selection `a(x)`:
//!
//! ```text
//! S'(x, w) = S(x, w) + a(x) m(w) (E[S](x, w) - S(x, w))
//! Fade      E[S](w) = (1 - amount) S(w)
//! Gradient  as Fade, its amount running from 0 at `from` to `amount` at `to`, along the line between them
//! Move      E[S](w) = S(p - offset)       p: where w meets the cube of half side 1
//! Turn      E[S](w) = S(rotation^-1 w)
//! Blur      E[S](w) = mean of S over directions near w, Gaussian of standard deviation `angle`
//! Tint      E[S](w) = (1 - amount colour) S(w), per channel
//! ```
//! Edits of one group act on what its objects block, before those of all objects act on what all block together.

use super::{Lamp, Visibility};
use crate::transport::Selection;
use crate::{Error, Result};
use glam::Vec3;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub struct ShadowEdit {
    /// Objects whose shadow it changes; `None`: of all.
    pub group: Option<String>,
    /// `None`: all light.
    pub lamp: Option<Arc<Lamp>>,
    /// Where; `None`: everywhere.
    pub selection: Option<Arc<Selection>>,
    pub change: ShadowChange,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShadowChange {
    /// Share of the shadow that goes, [0, 1].
    Fade { amount: f32 },
    /// Points in world space, metres.
    Gradient { amount: f32, from: Vec3, to: Vec3 },
    /// On the cube of half side 1.
    Move { offset: Vec3 },
    /// Unit axis, radians.
    Turn { axis: Vec3, angle: f32 },
    /// Radians.
    Blur { angle: f32 },
    /// Light that comes through, linear RGB in [0, 1].
    Tint { amount: f32, colour: Vec3 },
}

impl ShadowChange {
    /// It changes each direction by itself, and looks nowhere else.
    pub fn is_pointwise(&self) -> bool {
        matches!(self, Self::Fade { .. } | Self::Gradient { .. } | Self::Tint { .. })
    }
}

impl Visibility {
    /// The same, with one more edit at the end of its list.
    ///
    /// # Errors
    /// A group that it does not have; a lamp of another size, a selection of another geometry.
    pub fn and(&self, edit: ShadowEdit) -> Result<Self> {
        if let Some(group) = &edit.group
            && !self.groups.iter().any(|known| known.name == *group)
        {
            let known: Vec<&str> = self.groups.iter().map(|group| group.name.as_str()).collect();
            let message = format!("there is no visibility group \"{group}\"; there are {}", known.join(", "));
            return Err(Error::compute(message, "name one of them, or add it to `groups` of the visibility node"));
        }
        if let Some(lamp) = &edit.lamp {
            lamp.check(self.size)?;
        }
        if let Some(selection) = &edit.selection {
            selection.check(&self.samples.geometry)?;
        }
        let mut all = self.clone();
        all.edits.push(edit);
        Ok(all)
    }
}
