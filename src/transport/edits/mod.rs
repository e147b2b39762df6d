//! Edits of indirect light (thesis 4.3, 5.3): an ordered list of changes to light on its way from gather samples to the
//! view. An edit is data: it never renders. `lighting` applies it in a preview; other renderers may in their own way.
//!
//! Each kind acts at one place of the path (thesis table 4.1), and light meets the places in this order, whatever the
//! order of the list; within a place, edits apply in the order of the list:
//!
//! ```text
//! source   B' = brushes(B)               light that leaves a surface, at each bounce
//! transit  E = sum_g edits(T(v,g) B'(g)) light between a caster and a receiver, before the receiver's reflectance
//! eye      L' = brushes(L)               indirect radiance from a surface to the camera, after its reflectance
//! ```
//!
//! `Sampled` edits (eqs. 5.2 to 5.5) act at all three: at the source after the brushes of the list, in transit before its
//! other edits, at the eye in the order of the list.

mod brushes;
mod transit;

pub use brushes::{IlluminationBrush, SourceBrush, SourceChange};
pub use transit::{Block, Change, Colour, Transit};

use crate::scene::Fingerprint;
use crate::transport::{Sampled, Selection};
use crate::{Error, Result};
use std::sync::Arc;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edits(pub Vec<Edit>);

#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    Source(SourceBrush),
    Transit(Transit),
    Eye(IlluminationBrush),
    Sampled(Arc<Sampled>),
}

impl Edit {
    /// The node type that makes such edits.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Source(_) => "source_brush",
            Self::Transit(transit) => match transit.change {
                Change::Colour(_) => "caster_receiver",
                Change::Falloff { .. } => "falloff",
                Change::Shadow { .. } => "indirect_shadow",
                Change::Directionality { .. } => "directionality",
            },
            Self::Eye(_) => "illumination_brush",
            Self::Sampled(_) => "scale_offset",
        }
    }

    /// All that it is limited to.
    pub fn selections(&self) -> impl Iterator<Item = &Arc<Selection>> {
        let [a, b] = match self {
            Self::Source(brush) => [&brush.selection, &None],
            Self::Transit(transit) => [&transit.block.caster, &transit.block.receiver],
            Self::Eye(brush) => [&brush.selection, &None],
            Self::Sampled(_) => [&None, &None],
        };
        a.iter().chain(b)
    }

    /// Light comes through it bit by bit.
    pub fn changes_nothing(&self) -> bool {
        match self {
            Self::Source(brush) => brush.changes_nothing(),
            Self::Transit(transit) => transit.change.changes_nothing(),
            Self::Eye(brush) => brush.changes_nothing(),
            Self::Sampled(sampled) => sampled.changes_nothing(),
        }
    }
}

impl Edits {
    /// The list with one more edit at its end, or the list itself when that edit changes nothing.
    pub fn and(&self, edit: Edit) -> Self {
        let more = Some(edit).filter(|edit| !edit.changes_nothing());
        Self(self.0.iter().cloned().chain(more).collect())
    }

    pub fn source(&self) -> impl Iterator<Item = &SourceBrush> {
        self.0.iter().filter_map(|edit| if let Edit::Source(brush) = edit { Some(brush) } else { None })
    }

    pub fn transit(&self) -> impl Iterator<Item = &Transit> {
        self.0.iter().filter_map(|edit| if let Edit::Transit(transit) = edit { Some(transit) } else { None })
    }

    pub fn eye(&self) -> impl Iterator<Item = &IlluminationBrush> {
        self.0.iter().filter_map(|edit| if let Edit::Eye(brush) = edit { Some(brush) } else { None })
    }

    pub fn sampled(&self) -> impl Iterator<Item = &Arc<Sampled>> {
        self.0.iter().filter_map(|edit| if let Edit::Sampled(sampled) = edit { Some(sampled) } else { None })
    }

    /// # Errors
    /// `Compute` when a selection names parts of another geometry, or more than one edit is sampled.
    pub fn check(&self, geometry: &Fingerprint) -> Result<()> {
        let sampled = self.sampled().count();
        if sampled > 1 {
            let help = "connect one of them, or sample all of their edits together with scale_offset";
            return Err(Error::compute(format!("the list holds {sampled} sampled edits, which do not stack"), help));
        }
        self.0.iter().flat_map(Edit::selections).try_for_each(|selection| selection.check(geometry))
    }

    pub fn bytes(&self) -> u64 {
        let each = |edit: &Edit| 128 + edit.selections().map(|selection| selection.bytes()).sum::<u64>();
        self.0.iter().map(each).sum::<u64>() + self.sampled().map(|sampled| sampled.bytes()).sum::<u64>()
    }
}
