//! What travels on wires (DESIGN section 5). Values are immutable and shared; an edit makes a new one.

use crate::image::Image;
use crate::scene::{Camera, Environment, Scene};
use crate::stored::{SectionReader, SectionWriter, Stored};
use crate::transport::shadow::{DirectTransport, Lamp, Ratio, Visibility};
use crate::transport::{Edits, Samples, Selection, Transfer};
use std::sync::Arc;

/// The type of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    Scene,
    Camera,
    Samples,
    Transfer,
    Selection,
    Edits,
    Image,
    Environment,
    Visibility,
    Transport,
    Light,
    Ratio,
}

impl Kind {
    pub fn name(self) -> &'static str {
        match self {
            Self::Scene => "scene",
            Self::Camera => "camera",
            Self::Samples => "samples",
            Self::Transfer => "transfer",
            Self::Selection => "selection",
            Self::Edits => "edits",
            Self::Image => "image",
            Self::Environment => "environment",
            Self::Visibility => "visibility",
            Self::Transport => "transport",
            Self::Light => "light",
            Self::Ratio => "ratio",
        }
    }

    /// `Value::write` can keep it on disk.
    pub fn is_storable(self) -> bool {
        matches!(self, Self::Image | Self::Transfer)
    }
}

#[derive(Clone, Debug)]
pub enum Value {
    Scene(Arc<Scene>),
    Camera(Arc<Camera>),
    Samples(Arc<Samples>),
    Transfer(Arc<Transfer>),
    Selection(Arc<Selection>),
    Edits(Arc<Edits>),
    Image(Arc<Image>),
    Environment(Arc<Environment>),
    Visibility(Arc<Visibility>),
    Transport(Arc<DirectTransport>),
    Light(Arc<Lamp>),
    Ratio(Arc<Ratio>),
    /// Of an output whose `needs` is not connected: no wire of a plan leads to it.
    Absent(Kind),
}

impl Value {
    pub fn kind(&self) -> Kind {
        match self {
            Self::Scene(_) => Kind::Scene,
            Self::Camera(_) => Kind::Camera,
            Self::Samples(_) => Kind::Samples,
            Self::Transfer(_) => Kind::Transfer,
            Self::Selection(_) => Kind::Selection,
            Self::Edits(_) => Kind::Edits,
            Self::Image(_) => Kind::Image,
            Self::Environment(_) => Kind::Environment,
            Self::Visibility(_) => Kind::Visibility,
            Self::Transport(_) => Kind::Transport,
            Self::Light(_) => Kind::Light,
            Self::Ratio(_) => Kind::Ratio,
            Self::Absent(kind) => *kind,
        }
    }

    /// Memory held, in bytes; what the memory cache counts.
    pub fn bytes(&self) -> u64 {
        match self {
            Self::Scene(v) => v.bytes(),
            Self::Camera(_) => size_of::<Camera>() as u64,
            Self::Samples(v) => v.bytes(),
            Self::Transfer(v) => v.bytes(),
            Self::Selection(v) => v.bytes(),
            Self::Edits(v) => v.bytes(),
            Self::Image(v) => v.bytes(),
            Self::Environment(v) => v.bytes(),
            Self::Visibility(v) => v.bytes(),
            Self::Transport(v) => v.bytes(),
            Self::Light(v) => v.bytes(),
            Self::Ratio(v) => v.bytes(),
            Self::Absent(_) => 0,
        }
    }

    /// Lays the value out for the disk cache. Only for kinds that are storable; an arm here, one in `read`.
    pub fn write<'a>(&'a self, sections: &mut SectionWriter<'a>) {
        match self {
            Self::Image(image) => image.write(sections),
            Self::Transfer(transfer) => transfer.write(sections),
            other => panic!("{:?} is not storable", other.kind()),
        }
    }

    /// `None` when the sections are not what this version writes.
    pub fn read(kind: Kind, sections: &mut SectionReader) -> Option<Self> {
        match kind {
            Kind::Image => Image::read(sections).map(|image| Self::Image(Arc::new(image))),
            Kind::Transfer => Transfer::read(sections).map(|transfer| Self::Transfer(Arc::new(transfer))),
            _ => None,
        }
    }
}
