//! Selections: weights in [0, 1] over surface points. A selection is a field, not a list of samples: view samples, gather
//! samples and texels can all be held against it, at any resolution.
//!
//! For: what nodes hand to edits. Not for: what is done where it is selected (`edits`).

mod bounds;
mod combine;
mod matte;
mod names;
mod paint;
mod stroke;
mod way;
mod weighed;

pub use combine::{Combined, Mode};
pub use matte::Matte;
pub use names::Names;
pub use paint::Painted;
pub use stroke::{Attached, Grounds, Laid, Stroke, StrokeMode};
pub use weighed::Weighed;

use super::Samples;
use crate::scene::{Fingerprint, Geometry, SurfacePoint};
use crate::{Error, Result};
use bounds::Bounds;
use rayon::prelude::*;
use std::sync::Arc;

/// A hash of content.
pub type Digest = [u8; 16];

#[derive(Clone, Debug, PartialEq)]
pub enum Selection {
    /// Surfaces of chosen objects that are made of chosen materials.
    Names(Names),
    /// Brush strokes on surfaces.
    Painted(Painted),
    /// The pixels of a picture, on the surfaces that they show.
    Matte(Matte),
    /// Other selections, put together.
    Combined(Combined),
}

/// Points that are worked on as one piece.
const BLOCK: usize = 4096;

impl Selection {
    /// Surfaces whose object matches one of `objects` and whose material matches one of `materials`; an empty list
    /// matches all.
    ///
    /// Errors: a glob that is not well formed, or that matches nothing (the error lists what there is).
    pub fn by_name(geometry: &Geometry, objects: &[String], materials: &[String]) -> Result<Self> {
        Ok(Self::Names(Names::new(geometry, objects, materials)?))
    }

    /// Where the strokes run; see `Painted::new`.
    pub fn painted(
        grounds: &Grounds,
        strokes: &[Stroke],
        surroundings: impl FnMut(Option<i64>, &[SurfacePoint]) -> Result<Vec<f32>>,
    ) -> Result<(Self, Laid)> {
        let (painted, laid) = Painted::new(grounds, strokes, surroundings)?;
        Ok((Self::Painted(painted), laid))
    }

    /// The weights of a picture's pixels, on the surfaces that they show; see `Matte::new`.
    pub fn matte(samples: &Samples, pixels: &[f32]) -> Self {
        Self::Matte(Matte::new(samples, pixels))
    }

    /// What `mode` makes of one or two selections; see `Mode`.
    ///
    /// Errors: `b` missing, or given where there is nothing to do for it; selections of two geometries.
    pub fn combined(mode: Mode, a: &Arc<Self>, b: Option<&Arc<Self>>) -> Result<Arc<Self>> {
        combine::combined(mode, a, b)
    }

    /// Of the geometry that it was made for.
    pub fn geometry(&self) -> &Fingerprint {
        match self {
            Self::Names(names) => names.geometry(),
            Self::Painted(painted) => painted.geometry(),
            Self::Matte(matte) => matte.geometry(),
            Self::Combined(combined) => combined.geometry(),
        }
    }

    /// # Errors
    /// `Compute` when the selection was made for another geometry.
    pub fn check(&self, fingerprint: &Fingerprint) -> Result<()> {
        if self.geometry() == fingerprint {
            return Ok(());
        }
        let message = "a selection was made in another scene, or in another state of it";
        Err(Error::compute(message, "connect the same scene to pick, paint and relight"))
    }

    /// In [0, 1]; 0 where there is no surface. Many points are faster with `weights`.
    pub fn weight(&self, point: &SurfacePoint) -> f32 {
        let mut weight = [0.0];
        self.evaluate(std::slice::from_ref(point), &mut weight);
        weight[0]
    }

    /// Of each point, the same bits as `weight`. Neighbours in the list should be neighbours in space.
    pub fn weights(&self, points: &[SurfacePoint]) -> Vec<f32> {
        let mut weights = vec![0.0; points.len()];
        let blocks = weights.par_chunks_mut(BLOCK).zip(points.par_chunks(BLOCK));
        blocks.for_each(|(weights, points)| self.evaluate(points, weights));
        weights
    }

    /// Boxes outside of which two selections have the same weights everywhere; `None`: they may differ anywhere.
    fn apart(&self, other: &Self) -> Option<Vec<Bounds>> {
        match (self, other) {
            (Self::Painted(a), Self::Painted(b)) => a.apart(b),
            (Self::Combined(a), Self::Combined(b)) => a.apart(b),
            _ => (self == other).then(Vec::new),
        }
    }

    /// One block, on this thread; `weights` come in as 0.
    fn evaluate(&self, points: &[SurfacePoint], weights: &mut [f32]) {
        match self {
            Self::Names(names) => names.evaluate(points, weights),
            Self::Painted(painted) => painted.evaluate(points, weights),
            Self::Matte(matte) => matte.evaluate(points, weights),
            Self::Combined(combined) => combined.evaluate(points, weights),
        }
    }

    /// Names the field: equal digests, equal weights everywhere.
    pub fn digest(&self) -> Digest {
        match self {
            Self::Names(names) => names.digest(),
            Self::Painted(painted) => painted.digest(),
            Self::Matte(matte) => matte.digest(),
            Self::Combined(combined) => combined.digest(),
        }
    }

    /// Memory held, without the geometry, which the scene counts.
    pub fn bytes(&self) -> u64 {
        match self {
            Self::Names(names) => names.bytes(),
            Self::Painted(painted) => painted.bytes(),
            Self::Matte(matte) => matte.bytes(),
            Self::Combined(combined) => combined.bytes(),
        }
    }
}

fn finish(hasher: &blake3::Hasher) -> Digest {
    hasher.finalize().as_bytes()[..16].try_into().expect("16 of 32 bytes")
}
