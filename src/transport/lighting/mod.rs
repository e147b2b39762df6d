//! From lights to the light of view samples, with edits: the mathematics of the preview (thesis 4.5, 5.5.1).
//!
//! ```text
//! scene_light  light sources at view and gather samples
//! brushes   source brushes at gather samples
//! leaving   direct light at gather samples -> B', bounces and source brushes included
//! shares    parts of B', by caster and by what brushes touch
//! lane      one transfer matrix and the samples that its rows give light to
//! positions, reach, receivers  which of these samples, and which edits act there
//! paths     B' -> light at some samples, by way of falloff, direction and what is in between (path_edits)
//! transit   the list of edits between casters and receivers, in order
//! indirect  all of these, end to end
//! idle      edits that change nothing here
//! layers    irradiance -> radiance to the camera, illumination brushes, layers of a picture
//! sums      of light over samples
//! ```
//!
//! Every step keeps what it made under a key of what that was made from, so that a slider costs what it changes.

mod brushes;
mod idle;
mod indirect;
mod lane;
mod layers;
mod leaving;
mod path_edits;
mod paths;
mod positions;
mod reach;
mod receivers;
mod scene_light;
mod shares;
mod sums;
mod transit;

pub use indirect::{Indirect, Told};
pub use lane::{GlossyLanes, Lane};
pub(in crate::transport) use layers::layer;
pub use layers::{Shading, indirect_radiance, light_layers, place_layers, resolved_surface, surface_layers};
pub use leaving::{Leaving, leaving, source_vectors};
pub use paths::{Light, Paths};
pub use positions::Positions;
pub use scene_light::SceneLight;
pub use sums::sum;
pub use transit::{Arriving, Between, Gains};

use crate::Result;
use crate::device::{Array, Device};
use crate::memo::{Key, Memo};
use crate::progress::Progress;
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::selection::Weighed;
use crate::transport::{Selection, Transfer};
use std::sync::Arc;

/// Bytes of one element of light.
const VEC4: u64 = 16;

/// What all steps work with.
#[derive(Clone, Copy)]
pub struct Stage<'a> {
    pub device: &'a Device,
    pub memo: &'a dyn Memo,
    pub progress: Progress<'a>,
    pub geometry: &'a Geometry,
    pub transfer: &'a Transfer,
    /// Names the geometry and the transfer: where things are.
    pub place: Key,
}

impl Stage<'_> {
    /// Weights of a selection at the view samples.
    pub fn at_view(&self, selection: &Arc<Selection>) -> Result<Arc<Array<f32>>> {
        self.weights(b"view", selection, &self.transfer.samples.points)
    }

    /// Weights of a selection at the gather samples.
    pub fn at_gather(&self, selection: &Arc<Selection>) -> Result<Arc<Array<f32>>> {
        self.weights(b"gather", selection, &self.transfer.gather.points)
    }

    /// What is not known follows from what was weighed last there: most often a stroke that is being painted.
    fn weights(&self, what: &[u8], selection: &Arc<Selection>, points: &[SurfacePoint]) -> Result<Arc<Array<f32>>> {
        let key = Key::of(&[b"weights", what, &self.place.0, &selection.digest()]);
        let last = Key::of(&[b"weights", what, &self.place.0, b"last"]);
        let bytes = |weights: &Array<f32>| 4 * weights.len() as u64;
        self.memo.remember(key, bytes, || {
            let before = self.memo.get(last).and_then(|any| any.downcast::<Weighed>().ok());
            let weighed = Weighed::new(selection, points, before.as_deref());
            let weights = weighed.weights.clone();
            self.memo.put(last, Arc::new(weighed), bytes(&weights));
            Ok(weights)
        })
    }
}
