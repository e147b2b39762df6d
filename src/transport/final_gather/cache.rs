//! The irradiance cache: records of light at some places, and what they say of light at others.
//!
//! Record i, of mean distance `R_i` to what it sees, counts at a place p with normal n by (Ward et al. 1988, eq. 6; thesis
//! eq. 3.2)
//!
//! ```text
//! w_i(p) = 1 / e_i(p) - 1 / a,   e_i(p) = |p - p_i| / R_i + b_i sqrt(1 - n . n_i)
//! ```
//!
//! where `b_i` is 1 but for light from near the horizon, `e_i < a` and p does not lie in front of it; what is taken off
//! makes weights fade out instead of ending. Each adds its light with its gradients. `R_i` is no larger than that of any
//! record which lies where i counts, and the way to there (Křivánek et al. 2006), so that no record overlooks what its
//! neighbours see; and no smaller than what the picture can show.

use super::hemisphere::Gradients;
use super::index::Index;
use crate::scene::SurfacePoint;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// A place of the cache, and what was gathered there.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    pub place: SurfacePoint,
    /// Names its rays.
    pub seed: u32,
    /// Mean distance to what it sees, no larger than neighbours allow, m.
    pub radius: f32,
    /// How much faster than elsewhere its light changes with the normal, at least 1.
    pub bend: f32,
    /// About the width of a pixel there, m.
    pub footprint: f32,
    /// Rays so far.
    pub rays: u32,
    /// Mean squared error of its irradiance by the noise of its rays, all channels together.
    pub variance: f32,
}

/// What records are looked up by, in one cache line.
#[derive(Clone, Copy, Debug)]
struct Shape {
    position: Vec3,
    /// Beyond, it does not count, m².
    reach2: f32,
    normal: Vec3,
    /// 1 / R.
    inverse: f32,
    bend: f32,
    /// Where a record is made to count farther than its light allows, gradients are followed by this less.
    damping: f32,
    variance: f32,
    /// `Receivers::kind`.
    kind: u64,
}

/// How places are told apart.
pub trait Receivers: Sync {
    /// Weights a place.
    fn count(&self) -> usize;
    /// Places of one kind do not part ways.
    fn kind(&self, spot: &Spot) -> u64;
    /// A record at `here` says nothing of a place `there`.
    fn part_ways(&self, here: &Spot, there: &Spot) -> bool;
}

#[derive(Clone)]
pub struct Cache<'a> {
    /// `a`: the largest error that a record may have where it counts.
    error: f32,
    /// Of a pixel: what a record covers at least.
    pixels: f32,
    edits: &'a dyn Receivers,
    pub records: Vec<Record>,
    /// Weights of receivers, those of a record one after another.
    pub receivers: Vec<f32>,
    /// Of each record.
    pub light: Vec<Gradients>,
    /// Derivatives of the light by each receiver's weight, those of a record one after another, W/m²; by themselves, since
    /// most places do not ask for them. How they change with place matters only where weights do, and is left out.
    changes: Vec<Vec4>,
    shapes: Vec<Shape>,
    index: Index,
}

/// Records to add, in columns as the cache has them.
#[derive(Default)]
pub struct Fresh {
    pub records: Vec<Record>,
    pub receivers: Vec<f32>,
    pub light: Vec<Gradients>,
    pub changes: Vec<Vec4>,
}

/// A place that is asked about.
#[derive(Clone, Copy)]
pub struct Spot<'a> {
    pub point: &'a SurfacePoint,
    /// Weight of each receiver there.
    pub receivers: &'a [f32],
}

/// What the cache says of a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Irradiance, W/m².
    pub light: Vec4,
    /// Sum of weights; 0: nothing is known here.
    pub weight: f32,
    /// Mean squared error by noise.
    pub variance: f32,
}

impl<'a> Cache<'a> {
    pub fn new(error: f32, pixels: f32, edits: &'a dyn Receivers) -> Self {
        Self {
            error,
            pixels,
            edits,
            records: Vec::new(),
            receivers: Vec::new(),
            light: Vec::new(),
            changes: Vec::new(),
            shapes: Vec::new(),
            index: Index::default(),
        }
    }

    pub fn error(&self) -> f32 {
        self.error
    }

    pub fn spot(&self, record: usize) -> Spot<'_> {
        let count = self.edits.count();
        Spot { point: &self.records[record].place, receivers: &self.receivers[record * count..][..count] }
    }

    /// Makes records count less far; `refresh` then.
    pub fn tighten(&mut self, error: f32, pixels: f32) {
        (self.error, self.pixels) = (error, pixels);
    }

    /// Adds records, and lets all of them see each other's distances; where old ones are `settled`, new ones alone see
    /// them. `refresh` when no more come.
    pub fn extend(&mut self, fresh: Fresh, settled: bool) {
        let old = self.records.len();
        self.records.extend(fresh.records);
        self.receivers.extend(fresh.receivers);
        self.light.extend(fresh.light);
        self.changes.extend(fresh.changes);
        let changing = if settled { old } else { 0 };
        self.reshape(changing);
        self.reindex();
        self.clamp(changing, old);
        // The index still holds each record where it counts, and where it did.
        self.reshape(changing);
    }

    /// `R_i` of records from `changing` on, by the distances of all that lie where they count; those before `new` did see
    /// each other.
    fn clamp(&mut self, changing: usize, new: usize) {
        let records = &self.records;
        // Of positive numbers, the bits are in their order.
        let radii: Vec<AtomicU32> = records.iter().map(|record| AtomicU32::new(record.radius.to_bits())).collect();
        records.par_iter().enumerate().with_min_len(64).for_each(|(number, there)| {
            let at = Vec3::from(there.place.position);
            self.index.near(at, |other| {
                let i = other as usize;
                if i >= changing && (i >= new || number >= new) && i != number {
                    let radius = there.radius + at.distance(records[i].place.position.into());
                    radii[i].fetch_min(radius.to_bits(), Ordering::Relaxed);
                }
                true
            });
        });
        let radii = radii.into_iter().map(|radius| f32::from_bits(radius.into_inner()));
        self.records.iter_mut().zip(radii).for_each(|(record, radius)| record.radius = radius);
    }

    /// Makes look-ups follow the records.
    pub fn refresh(&mut self) {
        self.reshape(0);
        self.reindex();
    }

    /// Shapes of records from `first` on.
    fn reshape(&mut self, first: usize) {
        let (error, pixels) = (self.error, self.pixels);
        let shape = |(number, light): (usize, &Gradients)| {
            let number = first + number;
            let record = &self.records[number];
            let radius = record.radius.max(pixels * record.footprint / error).max(1e-20);
            Shape {
                position: record.place.position.into(),
                reach2: (error * radius).powi(2),
                normal: record.place.normal.into(),
                inverse: 1.0 / radius,
                bend: record.bend.max(bend(light)),
                damping: (record.radius / radius).min(1.0),
                variance: record.variance,
                kind: self.edits.kind(&self.spot(number)),
            }
        };
        let light = self.light[first..].par_iter();
        let shapes: Vec<Shape> = light.enumerate().with_min_len(1024).map(shape).collect();
        self.shapes.truncate(first);
        self.shapes.extend(shapes);
    }

    fn reindex(&mut self) {
        let spheres: Vec<(Vec3, f32)> = self.shapes.iter().map(|s| (s.position, s.reach2.sqrt())).collect();
        self.index = Index::new(&spheres);
    }

    /// The light at a place.
    #[inline]
    pub fn look_up(&self, spot: &Spot) -> Found {
        self.look_up_with(spot, |_, _| {})
    }

    /// As `look_up`; `tell` hears which records count, and how much.
    #[inline]
    pub fn look_up_with(&self, spot: &Spot, mut tell: impl FnMut(usize, f32)) -> Found {
        let normal = Vec3::from(spot.point.normal);
        let (mut total, mut variance, mut light) = (0.0, 0.0, Vec4::ZERO);
        let count = self.edits.count();
        self.visit(spot, |record, weight, by| {
            let shape = &self.shapes[record];
            let (by, turn) = (by * shape.damping, shape.normal.cross(normal));
            tell(record, weight);
            total += weight;
            variance += weight * weight * shape.variance;
            let all = &self.light[record];
            let mut here = all.at(by, turn);
            for e in 0..count {
                let apart = spot.receivers[e] - self.receivers[record * count + e];
                if apart != 0.0 {
                    here += self.changes[record * count + e] * apart;
                }
            }
            // Gradients lead below what can be, edits may lead there on purpose.
            light += here.max(all.value.min(Vec4::ZERO)) * weight;
            true
        });
        if total > 0.0 {
            light /= total;
            variance /= total * total;
        }
        Found { light, weight: total, variance }
    }

    /// How many rays the records that count at a place have; `None` where there are none.
    pub fn rays_near(&self, spot: &Spot) -> Option<u32> {
        let (mut total, mut rays) = (0.0, 0.0);
        self.visit(spot, |record, weight, _| {
            total += weight;
            rays += weight * self.records[record].rays as f32;
            true
        });
        (total > 0.0).then(|| (rays / total) as u32)
    }

    /// Takes one more set of rays into a record.
    pub fn refine(&mut self, record: usize, light: &Gradients, changes: &[Vec4], rays: u32) {
        let here = &mut self.records[record];
        // Strata make the error of a set fall faster than by the root of its rays.
        let [before, more] = [here.rays, rays].map(|rays| (rays as f32).powf(1.5));
        let share = more / (before + more);
        let apart = (light.value - self.light[record].value).truncate().length_squared();
        // One difference says little: what the rays so far say counts as much.
        here.variance = 0.5 * (apart * share * (1.0 - share) + here.variance * (1.0 - share));
        self.light[record] = self.light[record].mix(light, share);
        let count = self.edits.count();
        for (old, new) in self.changes[record * count..].iter_mut().zip(changes) {
            *old = old.lerp(*new, share);
        }
        here.rays += rays;
    }

    /// Whether a record counts at a place whose error there is below `share` of what it may be.
    #[inline]
    pub fn covers(&self, spot: &Spot, share: f32) -> bool {
        let least = (1.0 / share - 1.0) / self.error;
        let mut covered = false;
        self.visit(spot, |_, weight, _| {
            covered = weight >= least;
            !covered
        });
        covered
    }

    /// The records that count at a place: number, weight, and way from there. False ends it.
    #[inline]
    pub fn visit(&self, spot: &Spot, mut take: impl FnMut(usize, f32, Vec3) -> bool) {
        if self.shapes.is_empty() {
            return;
        }
        let (at, normal) = (Vec3::from(spot.point.position), Vec3::from(spot.point.normal));
        let kind = self.edits.kind(spot);
        self.index.near(at, |record| {
            let shape = &self.shapes[record as usize];
            let by = at - shape.position;
            let squared = by.length_squared();
            if squared >= shape.reach2 {
                return true;
            }
            // 1 - n . n_i, and exactly 0 for a record's own place.
            let turned = 0.5 * normal.distance_squared(shape.normal);
            let error = squared.sqrt() * shape.inverse + shape.bend * turned.sqrt();
            // In front of it, a place sees what the record has behind itself.
            if error >= self.error || by.dot(normal + shape.normal) * shape.inverse < -0.1 * self.error {
                return true;
            }
            if shape.kind != kind && self.edits.part_ways(&self.spot(record as usize), spot) {
                return true;
            }
            let weight = 1.0 / error.max(1e-3 * self.error) - 1.0 / self.error;
            weight <= 0.0 || take(record as usize, weight, by)
        });
    }
}

/// Light that comes from near the horizon alone changes much with the normal: a turn by `1 / bend` of what others stand
/// changes it as much.
fn bend(light: &Gradients) -> f32 {
    let steepest = light.turned.iter().map(|by| by.truncate().length_squared()).sum::<f32>().sqrt();
    (steepest / light.value.truncate().length().max(1e-20)).clamp(1.0, 10.0)
}
