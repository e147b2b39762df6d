//! Edits of a keyframe whose gather samples are not this frame's, for those of this frame: a camera that comes to see
//! another room has light gathered from there, too, and the samples are spread over more surfaces.

use crate::Result;
use crate::device::{Array, Device};
use crate::kernels::{haar_decode, haar_encode};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::feature::feature;
use crate::transport::sampled::row::{self, Row};
use crate::transport::sampled::{GatherPlaces, Origin, Parts, Sampled, Vectors};
use crate::transport::{SparseRows, Transfer};
use glam::{Vec3, Vec4};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

/// No sample of the keyframe lies on that object.
const NONE: u32 = u32::MAX;

/// Whether the columns of edits stand for the gather samples of `here`.
pub fn are_the_same(key: &Origin, here: &Origin) -> bool {
    (key.gather_samples, &key.gather_layout) == (here.gather_samples, &here.gather_layout)
}

/// Each gather sample of this frame takes what the nearest one of the keyframe has that lies on the same object, by their
/// addresses at one and the same time; objects that had none are not edited.
///
/// # Errors
/// None but a coefficient that is not finite.
pub fn carried(
    geometry: &Geometry,
    transfer: &Transfer,
    key: &Sampled,
    (tolerance, most): (f32, usize),
) -> Result<Sampled> {
    let gather = GatherPlaces::of(geometry, transfer);
    let nearest = nearest(geometry, transfer.gather.spacing(), &key.gather, &gather);
    let vector = |vector: &Option<Array<[f32; 4]>>, neutral: [f32; 4]| {
        let vector = vector.as_ref()?;
        let value = |from: &u32| if *from == NONE { neutral } else { vector[*from as usize] };
        Some(nearest.iter().map(value).collect::<Vec<_>>().into())
    };
    let rows = |rows: &SparseRows| {
        let make = |number: usize, dense: &mut Vec<[f32; 4]>, row: &mut Row| {
            dense.clear();
            dense.resize(rows.columns(), [0.0; 4]);
            let channel = |c: usize| rows.row(3 * number + c).map(move |(index, value)| (index, c, value));
            (0..3).flat_map(channel).for_each(|(index, c, value)| dense[index][c] = value);
            let then = haar_decode(dense)?;
            let now: Vec<[f32; 4]> =
                nearest.iter().map(|from| if *from == NONE { [0.0; 4] } else { then[*from as usize] }).collect();
            let coefficients = haar_encode(&Device::Cpu, &now, 1)?;
            let some = (0u32..).zip(coefficients).map(|(i, value)| (i, Vec4::from_array(value).truncate()));
            row.coefficients.extend(some.filter(|(_, value)| *value != Vec3::ZERO));
            row.truncate(tolerance, most);
            Ok(())
        };
        row::rows(nearest.len(), rows.rows() / 3, Vec::new, make)
    };
    let here = Origin::of(geometry, transfer);
    let origin =
        Origin { gather_samples: here.gather_samples, gather_layout: here.gather_layout, ..key.origin.clone() };
    Sampled::new(Parts {
        origin,
        view: key.view.clone(),
        source: Vectors { scale: vector(&key.source.scale, [1.0; 4]), offset: vector(&key.source.offset, [0.0; 4]) },
        gather,
        eye: key.eye.clone(),
        touched: key.touched.clone(),
        slots: key.slots.clone(),
        weights: key.weights.clone(),
        scales: rows(&key.scales)?,
        offsets: key.offsets.as_ref().map(rows).transpose()?,
    })
}

/// Of each of `now` the number of the one of `then`; `spacing`: metres between samples.
fn nearest(geometry: &Geometry, spacing: f32, then: &GatherPlaces, now: &GatherPlaces) -> Vec<u32> {
    let pose = &geometry.over_time()[0];
    let (low, high) = geometry.bounds_over_time();
    let place = |places: &GatherPlaces, i: usize| -> SurfacePoint {
        let (side, [u, v]) = (places.side[i], places.barycentrics[i]);
        pose.surface_point((side / 2) as usize, u, v, side % 2 == 0)
    };
    let of = |point: &SurfacePoint| {
        feature(point.position.into(), point.geometric_normal.into(), 0.5 * (low + high), 4.0 * spacing)
    };
    let mut members: Vec<(Vec<u32>, Vec<[f32; 6]>)> = vec![Default::default(); geometry.objects.len()];
    for i in 0..then.side.len() {
        let point = place(then, i);
        let (numbers, features) = &mut members[point.object as usize];
        numbers.push(i as u32);
        features.push(of(&point));
    }
    let trees: Vec<Option<ImmutableKdTree<f32, 6>>> = members
        .par_iter()
        .map(|(_, features)| (!features.is_empty()).then(|| ImmutableKdTree::new_from_slice(features)))
        .collect();
    let one = |i: usize| {
        let point = place(now, i);
        let Some(tree) = &trees[point.object as usize] else { return NONE };
        members[point.object as usize].0[tree.nearest_one::<SquaredEuclidean>(&of(&point)).item as usize]
    };
    (0..now.side.len()).into_par_iter().with_min_len(256).map(one).collect()
}
