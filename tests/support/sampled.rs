//! Sampled edits of every kind in the built-in room, made of numbers that mean nothing.

use chiaro::scene::Geometry;
use chiaro::transport::sampled::row::{Field, rows};
use chiaro::transport::sampled::{GatherPlaces, Origin, Parts, UNTOUCHED, Vectors, ViewPlaces};
use chiaro::transport::sampling::{hash, unit};
use chiaro::transport::{SparseRows, Transfer};
use glam::Vec3;

pub fn random(seed: u32) -> f32 {
    unit(hash(seed))
}

/// Nothing touched, no vectors.
pub fn untouched(geometry: &Geometry, transfer: &Transfer) -> Parts {
    let none = rows(transfer.gather.count(), 0, || (), |_, (), _| Ok(())).unwrap();
    Parts {
        origin: Origin::of(geometry, transfer),
        view: ViewPlaces::of(geometry, &transfer.samples),
        gather: GatherPlaces::of(geometry, transfer),
        source: Vectors::default(),
        eye: Vectors::default(),
        touched: vec![].into(),
        slots: vec![].into(),
        weights: vec![].into(),
        scales: none,
        offsets: None,
    }
}

/// A value for each gather sample.
pub struct Dense(pub Vec<Vec3>);

impl Field for Dense {
    fn constant(&mut self, _: usize) -> Option<Vec3> {
        None
    }
    fn leaf(&mut self, node: usize) -> Vec3 {
        self.0[node - self.0.len()]
    }
}

pub fn dense_rows(count: usize, number: usize, value: impl Fn(usize, usize) -> Vec3 + Sync) -> SparseRows {
    rows(
        count,
        number,
        || (),
        |row, (), out| {
            out.fill(count, &mut Dense((0..count).map(|sample| value(row, sample)).collect()));
            Ok(())
        },
    )
    .unwrap()
}

/// Every part there is: vectors, soft slots, rows that neighbours share, offsets; two of three view samples are touched.
pub fn everything(geometry: &Geometry, transfer: &Transfer) -> Parts {
    let (view, gather) = (transfer.samples.points.len(), transfer.gather.count());
    let number = 12;
    let vector = |seed: u32, count: usize, low: f32, high: f32, last: f32| {
        let value = |i: u32| low + (high - low) * random(seed ^ i);
        let values = (0..count as u32).map(|i| [value(3 * i), value(3 * i + 1), value(3 * i + 2), last]);
        values.collect::<Vec<_>>().into()
    };
    let touched: Vec<u32> = (0..view as u32).filter(|v| !hash(*v).is_multiple_of(3)).collect();
    let slot = |row: u32| if row.is_multiple_of(5) { UNTOUCHED } else { row % number };
    let slots: Vec<_> = touched.iter().map(|v| transfer.indices[*v as usize].map(slot)).collect();
    let weight = |v: &u32| transfer.weights[*v as usize].map(|w| if v.is_multiple_of(2) { w } else { 0.5 * w });
    let weights: Vec<_> = touched.iter().map(weight).collect();
    let smooth = |row: usize, sample: usize, scale: f32| {
        let p = Vec3::from(transfer.gather.points[sample].position) * (1.0 + 0.1 * row as f32);
        Vec3::new((p.x + p.y).sin(), (p.y - p.z).cos(), (p.z + p.x).sin()) * scale
    };
    Parts {
        source: Vectors {
            scale: Some(vector(1, gather, 0.0, 3.0, 1.0)),
            offset: Some(vector(2, gather, -0.1, 0.1, 0.0)),
        },
        eye: Vectors { scale: Some(vector(3, view, 0.0, 3.0, 1.0)), offset: Some(vector(4, view, -0.1, 0.1, 0.0)) },
        touched: touched.into(),
        slots: slots.into(),
        weights: weights.into(),
        scales: dense_rows(gather, number as usize, |row, sample| smooth(row, sample, 0.8)),
        offsets: Some(dense_rows(gather, number as usize, |row, sample| smooth(row + 20, sample, 1e-4))),
        ..untouched(geometry, transfer)
    }
}
