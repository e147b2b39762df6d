//! The irradiance cache: records of light at some places (Ward et al. 1988; thesis 3.2), of which `light_cache` makes light
//! at others.
//!
//! `R_i`, how far record i counts, is no larger than that of any record which lies where i counts, and the way to there
//! (Křivánek et al. 2006), so that no record overlooks what its neighbours see; and no smaller than what the picture can
//! show.

use crate::scene::SurfacePoint;
use crate::transport::light_cache::{Columns, Gradients, Index, Parting, Shape, Spot};
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

#[derive(Clone)]
pub struct Cache {
    /// Of a pixel: what a record covers at least.
    pixels: f32,
    pub records: Vec<Record>,
    /// What look-ups read of them.
    pub columns: Columns,
}

/// Records to add, in columns as the cache has them.
#[derive(Default)]
pub struct Fresh {
    pub records: Vec<Record>,
    pub receivers: Vec<f32>,
    pub light: Vec<Gradients>,
    pub changes: Vec<Vec4>,
}

impl Cache {
    pub fn new(error: f32, pixels: f32, parting: Parting) -> Self {
        Self { pixels, records: Vec::new(), columns: Columns::new(error, parting) }
    }

    /// Largest error of a record where it counts (`a`).
    pub fn error(&self) -> f32 {
        self.columns.error
    }

    /// The place of a record.
    pub fn spot(&self, record: usize) -> Spot<'_> {
        Spot { point: &self.records[record].place, receivers: self.columns.receivers_of(record) }
    }

    /// How many rays the records that count at a place have; `None` where there are none.
    pub fn rays_near(&self, spot: &Spot) -> Option<u32> {
        let (mut total, mut rays) = (0.0, 0.0);
        self.columns.visit(spot, |record, weight, _| {
            total += weight;
            rays += weight * self.records[record].rays as f32;
            true
        });
        (total > 0.0).then(|| (rays / total) as u32)
    }

    /// Makes records count less far; `refresh` then.
    pub fn tighten(&mut self, error: f32, pixels: f32) {
        (self.columns.error, self.pixels) = (error, pixels);
    }

    /// Adds records, and lets all of them see each other's distances; where old ones are `settled`, new ones alone see
    /// them. `refresh` when no more come.
    pub fn extend(&mut self, fresh: Fresh, settled: bool) {
        let old = self.records.len();
        self.records.extend(fresh.records);
        self.columns.receivers.extend(fresh.receivers);
        self.columns.light.extend(fresh.light);
        self.columns.changes.extend(fresh.changes);
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
            self.columns.index.near(at, |other| {
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
        let (error, pixels) = (self.error(), self.pixels);
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
                material: record.place.material,
                kind: self.columns.parting.kind(record.place.material, self.columns.receivers_of(number)),
                pad: [0; 3],
            }
        };
        let light = self.columns.light[first..].par_iter();
        let shapes: Vec<Shape> = light.enumerate().with_min_len(1024).map(shape).collect();
        self.columns.shapes.truncate(first);
        self.columns.shapes.extend(shapes);
    }

    fn reindex(&mut self) {
        let spheres: Vec<(Vec3, f32)> = self.columns.shapes.iter().map(|s| (s.position, s.reach2.sqrt())).collect();
        self.columns.index = Index::new(&spheres);
    }

    /// Takes one more set of rays into a record.
    pub fn refine(&mut self, record: usize, light: &Gradients, changes: &[Vec4], rays: u32) {
        let here = &mut self.records[record];
        // Strata make the error of a set fall faster than by the root of its rays.
        let [before, more] = [here.rays, rays].map(|rays| (rays as f32).powf(1.5));
        let share = more / (before + more);
        let columns = &mut self.columns;
        let apart = (light.value - columns.light[record].value).truncate().length_squared();
        // One difference says little: what the rays so far say counts as much.
        here.variance = 0.5 * (apart * share * (1.0 - share) + here.variance * (1.0 - share));
        columns.light[record] = columns.light[record].mix(light, share);
        let count = columns.parting.count;
        for (old, new) in columns.changes[record * count..].iter_mut().zip(changes) {
            *old = old.lerp(*new, share);
        }
        here.rays += rays;
    }
}

/// Light that comes from near the horizon alone changes much with the normal: a turn by `1 / bend` of what others stand
/// changes it as much.
fn bend(light: &Gradients) -> f32 {
    let steepest = light.turned.iter().map(|by| by.truncate().length_squared()).sum::<f32>().sqrt();
    (steepest / light.value.truncate().length().max(1e-20)).clamp(1.0, 10.0)
}
