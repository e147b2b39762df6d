//! Boxes along the axes.

use glam::Vec3;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub low: Vec3,
    pub high: Vec3,
}

impl Bounds {
    /// `None` of nothing.
    pub fn of(points: impl Iterator<Item = Vec3>) -> Option<Self> {
        let around = |bounds: Option<Self>, p: Vec3| match bounds {
            None => Some(Self { low: p, high: p }),
            Some(Self { low, high }) => Some(Self { low: low.min(p), high: high.max(p) }),
        };
        points.fold(None, around)
    }

    pub fn meets(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && self.high.cmpge(other.low).all()
    }

    pub fn holds(&self, point: Vec3) -> bool {
        self.low.cmple(point).all() && self.high.cmpge(point).all()
    }
}
