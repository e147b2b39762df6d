//! Edits that were sampled at keyframes, carried to another frame (thesis 5.3.4, 5.5.3, figure 5.5).
//!
//! Gather samples have the same addresses on surfaces at every frame, so columns stay columns (where the view makes it see
//! other sides of surfaces they do not: `columns`). View samples of a keyframe
//! move with the surfaces that they lie on; a view sample `v` of this frame takes from the three nearest of them
//! (`reproject`), by barycentric weights `b`, and then from both keyframes by the weights `t` of time:
//!
//! ```text
//! S(v,g) - 1 = sum_k t_k sum_i b_ki(v) (S_k(i,g) - 1)       O, s_v, o_v alike; s_g, o_g without b
//! ```
//!
//! Rows are wanted where the transfer of this frame has its own, for each of its rows once (`rows`).

mod columns;
pub(in crate::transport) mod reproject;
mod rows;

pub use reproject::{Found, Reach, reproject};

use crate::device::Array;
use crate::scene::Geometry;
use crate::transport::sampled::{GatherPlaces, Origin, Parts, Vectors, ViewPlaces};
use crate::transport::{Sampled, Transfer};
use crate::{Error, Result};
use glam::Vec4;
use rayon::prelude::*;

/// A keyframe, and what it counts at this frame.
pub struct Key<'a> {
    pub frame: i64,
    /// `None`: nothing is edited there.
    pub sampled: Option<&'a Sampled>,
    /// Of all that are given together 1.
    pub weight: f32,
}

#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Haar coefficients of a row, at most.
    pub coefficients: usize,
    /// L2 norm of what a row may leave out over that of the row.
    pub tolerance: f32,
}

/// What became of the view samples of this frame in the keyframes.
#[derive(Clone, Debug, Default)]
pub struct Told {
    /// By keyframe: frame, and shares of the samples on surfaces that were not seen there, and that are on objects of which
    /// nothing was seen there.
    pub keys: Vec<(i64, f64, f64)>,
    /// Share of the samples on surfaces that no keyframe saw.
    pub disoccluded: f64,
    pub rows: usize,
    /// Keyframes whose gather samples are not this frame's.
    pub of_other_samples: Vec<i64>,
    /// Of each view sample how much of its edits is filled in from elsewhere, [0, 1].
    pub filled: Vec<f32>,
}

/// # Errors
/// `Compute` for edits of another scene.
pub fn carry(geometry: &Geometry, transfer: &Transfer, keys: &[Key], settings: Settings) -> Result<(Sampled, Told)> {
    let origin = Origin::of(geometry, transfer);
    keys.iter().try_for_each(|key| check(key, &origin))?;
    let limits = (settings.tolerance, settings.coefficients);
    let moved = keys.iter().map(|key| match key.sampled {
        Some(sampled) if !columns::are_the_same(&sampled.origin, &origin) => {
            columns::carried(geometry, transfer, sampled, limits).map(Some)
        }
        _ => Ok(None),
    });
    let moved: Vec<Option<Sampled>> = moved.collect::<Result<_>>()?;
    let keys: Vec<Key> =
        keys.iter().zip(&moved).map(|(key, moved)| Key { sampled: moved.as_ref().or(key.sampled), ..*key }).collect();
    let keys = &keys[..];
    let samples = &transfer.samples;
    let reaches: Vec<Vec<Reach>> = keys
        .iter()
        .map(|key| match key.sampled {
            Some(sampled) => reproject(geometry, samples, sampled),
            None => samples.points.iter().map(Reach::unedited).collect(),
        })
        .collect();
    let view = View { keys, reaches: &reaches };
    let rows = rows::rows(transfer, &view, settings)?;
    let other = keys.iter().zip(&moved).filter(|(_, moved)| moved.is_some());
    let told =
        Told { of_other_samples: other.map(|(key, _)| key.frame).collect(), ..view.tell(rows.scales.rows() / 3) };
    let sampled = Sampled::new(Parts {
        origin,
        view: ViewPlaces::of(geometry, samples),
        gather: GatherPlaces::of(geometry, transfer),
        source: over_time(keys),
        eye: Vectors {
            scale: view.vector(|vectors| &vectors.scale, Vec4::ONE),
            offset: view.vector(|vectors| &vectors.offset, Vec4::ZERO),
        },
        touched: rows.touched.into(),
        slots: rows.slots.into(),
        weights: rows.weights.into(),
        scales: rows.scales,
        offsets: rows.offsets,
    })?;
    Ok((sampled, told))
}

fn check(key: &Key, here: &Origin) -> Result<()> {
    let Some(sampled) = key.sampled else { return Ok(()) };
    let there = &sampled.origin;
    if (there.triangles, &there.objects) == (here.triangles, &here.objects) {
        return Ok(());
    }
    let differences = there.differences(here).join("; ");
    let found = format!("the edits of keyframe {} were sampled for another scene: {differences}", key.frame);
    Err(Error::compute(found, "sample them in the scene that they are carried to"))
}

/// Vectors of the gather samples, which are the same in all keyframes.
fn over_time(keys: &[Key]) -> Vectors {
    let mix = |of: fn(&Vectors) -> &Option<Array<[f32; 4]>>, neutral: Vec4| {
        let vectors: Vec<_> =
            keys.iter().map(|key| (key.weight, key.sampled.and_then(|sampled| of(&sampled.source).as_ref()))).collect();
        let count = vectors.iter().find_map(|(_, vector)| *vector)?.len();
        let value = |i: usize| {
            let one = |vector: Option<&Array<[f32; 4]>>| vector.map_or(neutral, |vector| Vec4::from_array(vector[i]));
            vectors.iter().map(|(weight, vector)| one(*vector) * *weight).sum::<Vec4>().to_array()
        };
        Some((0..count).into_par_iter().with_min_len(1 << 12).map(value).collect::<Vec<_>>().into())
    };
    Vectors { scale: mix(|vectors| &vectors.scale, Vec4::ONE), offset: mix(|vectors| &vectors.offset, Vec4::ZERO) }
}

/// The view samples of this frame, and where they are in each keyframe.
struct View<'a> {
    keys: &'a [Key<'a>],
    /// By keyframe.
    reaches: &'a [Vec<Reach>],
}

impl View<'_> {
    fn count(&self) -> usize {
        self.reaches.first().map_or(0, Vec::len)
    }

    /// Calls back with number of the key, view sample of it, and what that counts for sample `v`. Keys that have nothing of
    /// its object leave their part to the others.
    fn sources(&self, v: usize, mut take: impl FnMut(usize, usize, f32)) {
        let known = |k: &usize| self.reaches[*k][v].found != Found::Nothing;
        let all: f32 = (0..self.keys.len()).filter(known).map(|k| self.keys[k].weight).sum();
        if all <= 0.0 {
            return;
        }
        for k in (0..self.keys.len()).filter(known) {
            let (reach, weight) = (&self.reaches[k][v], self.keys[k].weight / all);
            for (sample, share) in reach.samples.into_iter().zip(reach.weights).filter(|(_, share)| *share > 0.0) {
                take(k, sample as usize, weight * share);
            }
        }
    }

    /// A vector at the eye; `None` where no key has one.
    fn vector(
        &self,
        of: impl Fn(&Vectors) -> &Option<Array<[f32; 4]>> + Sync,
        neutral: Vec4,
    ) -> Option<Array<[f32; 4]>> {
        let vectors: Vec<_> =
            self.keys.iter().map(|key| key.sampled.and_then(|sampled| of(&sampled.eye).as_ref())).collect();
        vectors.iter().flatten().next()?;
        let value = |v: usize| {
            let (mut sum, mut total) = (Vec4::ZERO, 0.0);
            self.sources(v, |k, sample, weight| {
                sum += vectors[k].map_or(neutral, |vector| Vec4::from_array(vector[sample])) * weight;
                total += weight;
            });
            if total > 0.0 { sum.to_array() } else { neutral.to_array() }
        };
        Some((0..self.count()).into_par_iter().with_min_len(1 << 12).map(value).collect::<Vec<_>>().into())
    }

    fn tell(&self, rows: usize) -> Told {
        let exists = |v: usize| self.reaches[0][v].found != Found::NoSurface;
        let there = (0..self.count()).filter(|v| exists(*v)).count().max(1) as f64;
        let share = |count: usize| count as f64 / there;
        let keys = self.keys.iter().zip(self.reaches).map(|(key, reaches)| {
            let count = |found: Found| reaches.iter().filter(|reach| reach.found == found).count();
            let nothing = count(Found::Nothing);
            (key.frame, share(count(Found::Filled) + nothing), share(nothing))
        });
        let is_seen = |k: usize, v: usize| self.reaches[k][v].found == Found::Seen;
        let nowhere = |v: &usize| exists(*v) && !(0..self.keys.len()).any(|k| is_seen(k, *v));
        let filled = |v: usize| {
            let unseen = (0..self.keys.len()).filter(|k| exists(v) && !is_seen(*k, v));
            unseen.map(|k| self.keys[k].weight).sum::<f32>().min(1.0)
        };
        Told {
            keys: keys.collect(),
            disoccluded: share((0..self.count()).filter(nowhere).count()),
            rows,
            of_other_samples: Vec::new(),
            filled: (0..self.count()).map(filled).collect(),
        }
    }
}
