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

/// No sample of the keyframe lies near by on that object.
const NONE: u32 = u32::MAX;

/// Whether the columns of edits stand for the gather samples of `here`.
pub fn are_the_same(key: &Origin, here: &Origin) -> bool {
    (key.gather_samples, &key.gather_layout) == (here.gather_samples, &here.gather_layout)
}

/// Each gather sample of this frame takes what the nearest one of the keyframe has that lies on the same object and is turned
/// alike, by their addresses at one and the same time. Where the keyframe had none near by, nothing is edited. What is added
/// to the transfer (O) is a sum over samples, and is dealt out so that the sum stays.
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
    let here = Origin::of(geometry, transfer);
    // Samples of the keyframe may be fewer, and farther apart.
    let fewer = (key.origin.gather_samples as f32 / here.gather_samples as f32).min(1.0);
    let spacing = transfer.gather.spacing() / fewer.sqrt();
    let nearest = nearest_of(geometry, spacing, &key.gather, &gather);
    let shares = shares(&nearest, &nearest_of(geometry, spacing, &gather, &key.gather));
    let vector = |vector: &Option<Array<[f32; 4]>>, neutral: [f32; 4]| {
        let vector = vector.as_ref()?;
        let value = |from: &u32| if *from == NONE { neutral } else { vector[*from as usize] };
        Some(nearest.iter().map(value).collect::<Vec<_>>().into())
    };
    let rows = |rows: &SparseRows, is_sum: bool| {
        let make = |number: usize, dense: &mut Vec<[f32; 4]>, row: &mut Row| {
            dense.clear();
            dense.resize(rows.columns(), [0.0; 4]);
            let channel = |c: usize| rows.row(3 * number + c).map(move |(index, value)| (index, c, value));
            (0..3).flat_map(channel).for_each(|(index, c, value)| dense[index][c] = value);
            let then = haar_decode(dense)?;
            let mut now = vec![[0.0; 4]; nearest.len()];
            if is_sum {
                for (from, to, share) in &shares {
                    let (from, to) = (then[*from as usize], &mut now[*to as usize]);
                    *to = (Vec4::from_array(*to) + Vec4::from_array(from) * *share).to_array();
                }
            } else {
                let known = now.iter_mut().zip(&nearest).filter(|(_, from)| **from != NONE);
                known.for_each(|(now, from)| *now = then[*from as usize]);
            }
            let coefficients = haar_encode(&Device::Cpu, &now, 1)?;
            let some = (0u32..).zip(coefficients).map(|(i, value)| (i, Vec4::from_array(value).truncate()));
            row.coefficients.extend(some.filter(|(_, value)| *value != Vec3::ZERO));
            row.truncate(tolerance, most);
            Ok(())
        };
        row::rows(nearest.len(), rows.rows() / 3, Vec::new, make)
    };
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
        scales: rows(&key.scales, false)?,
        offsets: key.offsets.as_ref().map(|offsets| rows(offsets, true)).transpose()?,
    })
}

/// Who gives what part of a sum to whom: a sample of then to all samples of now that are nearest to it (`nearest`: of now in
/// then), or, where there is none, to the one that it is nearest to (`back`: of then in now).
fn shares(nearest: &[u32], back: &[u32]) -> Vec<(u32, u32, f32)> {
    let mut takers = vec![0u32; back.len()];
    nearest.iter().filter(|from| **from != NONE).for_each(|from| takers[*from as usize] += 1);
    let taken = (0u32..).zip(nearest).filter(|(_, from)| **from != NONE);
    let taken = taken.map(|(to, from)| (*from, to, 1.0 / takers[*from as usize] as f32));
    let left = (0u32..).zip(back).filter(|(from, to)| takers[*from as usize] == 0 && **to != NONE);
    taken.chain(left.map(|(from, to)| (from, *to, 1.0))).collect()
}

/// Farther apart than this times their distance from each other, samples have nothing to do with each other.
const NEAR: f32 = 4.0;

/// Of each of `now` the number of the one of `then`; `spacing`: metres between samples.
fn nearest_of(geometry: &Geometry, spacing: f32, then: &GatherPlaces, now: &GatherPlaces) -> Vec<u32> {
    let poses = largest_poses(geometry);
    let (low, high) = geometry.bounds_over_time();
    let place = |places: &GatherPlaces, i: usize| -> SurfacePoint {
        let (side, [u, v]) = (places.side[i], places.barycentrics[i]);
        let triangle = (side / 2) as usize;
        poses[geometry.object[triangle] as usize].surface_point(triangle, u, v, side % 2 == 0)
    };
    // Turned by 90 degrees is farther than `NEAR`.
    let of = |point: &SurfacePoint| {
        feature(point.position.into(), point.geometric_normal.into(), 0.5 * (low + high), NEAR * spacing)
    };
    let points: Vec<SurfacePoint> = (0..then.side.len()).map(|i| place(then, i)).collect();
    let mut members: Vec<(Vec<u32>, Vec<[f32; 6]>)> = vec![Default::default(); geometry.objects.len()];
    for (i, point) in (0u32..).zip(&points) {
        let (numbers, features) = &mut members[point.object as usize];
        numbers.push(i);
        features.push(of(point));
    }
    let trees: Vec<Option<ImmutableKdTree<f32, 6>>> = members
        .par_iter()
        .map(|(_, features)| (!features.is_empty()).then(|| ImmutableKdTree::new_from_slice(features)))
        .collect();
    let one = |i: usize| {
        let point = place(now, i);
        let Some(tree) = &trees[point.object as usize] else { return NONE };
        let found = members[point.object as usize].0[tree.nearest_one::<SquaredEuclidean>(&of(&point)).item as usize];
        let other = &points[found as usize];
        let alike = Vec3::from(point.geometric_normal).dot(other.geometric_normal.into()) > 0.0;
        let apart = Vec3::from(point.position).distance(other.position.into());
        if alike && apart <= NEAR * spacing { found } else { NONE }
    };
    (0..now.side.len()).into_par_iter().with_min_len(256).map(one).collect()
}

/// Of each object the pose in which it is largest: at some times it may be folded up.
fn largest_poses(geometry: &Geometry) -> Vec<&Geometry> {
    let poses = geometry.over_time();
    let areas: Vec<Vec<f64>> = poses
        .par_iter()
        .map(|pose| {
            let mut areas = vec![0.0; geometry.objects.len()];
            (0..pose.corners.len()).for_each(|i| areas[pose.object[i] as usize] += f64::from(pose.area(i)));
            areas
        })
        .collect();
    let largest = |object: usize| (0..poses.len()).max_by(|a, b| areas[*a][object].total_cmp(&areas[*b][object]));
    (0..geometry.objects.len()).map(|object| &poses[largest(object).expect("a pose")]).collect()
}
