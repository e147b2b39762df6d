//! Where a keyframe saw what this frame sees: its view samples go where their surfaces are now, and each view sample of
//! now takes the nearest three of the same object that are turned alike.

use crate::scene::{Geometry, SurfacePoint};
use crate::transport::Samples;
use crate::transport::feature::feature;
use crate::transport::sampled::origin::side;
use crate::transport::sampled::{NOWHERE, Sampled};
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;
use std::sync::OnceLock;

/// How a keyframe knows the place of a view sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// There is no surface at this sample.
    NoSurface,
    Seen,
    /// It was hidden there, or out of the picture: its nearest seen neighbours on the object stand in.
    Filled,
    /// Nothing of the object was seen there.
    Nothing,
}

/// View samples of a keyframe, and barycentric weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    pub found: Found,
    pub samples: [u32; 3],
    pub weights: [f32; 3],
}

impl Reach {
    /// Of a key without edits: any of its places does.
    pub(super) fn unedited(point: &SurfacePoint) -> Self {
        if point.exists() { Self::one(Found::Seen, 0) } else { Self::none(Found::NoSurface) }
    }

    pub(in crate::transport) const fn none(found: Found) -> Self {
        Self { found, samples: [0; 3], weights: [0.0; 3] }
    }

    pub(in crate::transport) fn one(found: Found, sample: u32) -> Self {
        Self { found, samples: [sample; 3], weights: [1.0, 0.0, 0.0] }
    }
}

/// Neighbours that are looked through for three that are turned alike.
const NEIGHBOURS: usize = 12;
/// Cosine of the angle between normals from which on two places are turned alike.
pub(in crate::transport) const ALIKE: f32 = 0.7;
/// A place was seen when the nearest sample lies within this times the distances between samples, then and now.
const WITHIN: f32 = 0.75;
/// Turning by 90 degrees is as far as six distances between samples.
const NORMAL: f32 = 4.0;

/// For each of this frame's view samples.
pub fn reproject(geometry: &Geometry, samples: &Samples, key: &Sampled) -> Vec<Reach> {
    let carried = Carried::new(geometry, key);
    let eye = Eye::of_samples(samples);
    let one = |v: usize| {
        let point = &samples.points[v];
        if !point.exists() {
            return Reach::none(Found::NoSurface);
        }
        // The very same place, as all are that hold still before a camera that does.
        let same = |sample: usize| {
            key.view.side.get(sample) == Some(&side(geometry, point))
                && key.view.barycentrics[sample] == samples.barycentrics[v]
        };
        if same(v) {
            return Reach::one(Found::Seen, v as u32);
        }
        carried.reach(point, eye.footprint(point.position.into(), point.normal.into()))
    };
    (0..samples.points.len()).into_par_iter().with_min_len(256).map(one).collect()
}

/// A pinhole's distance between samples on surfaces.
struct Eye {
    position: Vec3,
    /// Between rays, radians.
    angle: f32,
}

impl Eye {
    fn new(position: Vec3, fov_y: f32, height: usize) -> Self {
        Self { position, angle: 2.0 * (0.5 * fov_y).tan() / height as f32 }
    }

    fn of_samples(samples: &Samples) -> Self {
        Self::new(samples.camera.position, samples.camera.fov_y, samples.height * samples.down)
    }

    /// Metres, along the surface where it is seen at an angle.
    fn footprint(&self, position: Vec3, normal: Vec3) -> f32 {
        let way = self.position - position;
        let cosine = (way.normalize_or_zero().dot(normal)).abs().max(0.05);
        way.length() * self.angle / cosine
    }
}

/// The view samples of a keyframe where their surfaces are now.
pub(in crate::transport) struct Carried {
    position: Vec<Vec3>,
    normal: Vec<Vec3>,
    /// Distance to the next sample when it was seen, metres.
    footprint: Vec<f32>,
    /// By object: its samples, and a tree of them once that is asked for.
    objects: Vec<(Vec<u32>, OnceLock<ImmutableKdTree<f32, 6>>)>,
    centre: Vec3,
    normal_scale: f32,
}

impl Carried {
    pub fn new(geometry: &Geometry, key: &Sampled) -> Self {
        let (view, camera) = (&key.view, &key.origin.camera);
        let eye = Eye::new(camera.position, camera.fov_y, key.origin.height * key.origin.down);
        let place = |i: usize| {
            let side = view.side[i];
            if side == NOWHERE {
                return (Vec3::ZERO, (Vec3::ZERO, 0.0));
            }
            let [u, v] = view.barycentrics[i];
            let point = geometry.surface_point((side / 2) as usize, u, v, side % 2 == 0);
            let footprint = eye.footprint(view.position[i].into(), view.normal[i].into());
            (Vec3::from(point.position), (Vec3::from(point.normal), footprint))
        };
        let all = (0..view.side.len()).into_par_iter().with_min_len(1 << 12).map(place);
        let (position, (normal, footprint)): (Vec<Vec3>, (Vec<Vec3>, Vec<f32>)) = all.unzip();
        let mut members: Vec<Vec<u32>> = vec![Vec::new(); geometry.objects.len()];
        for (i, side) in view.side.iter().enumerate().filter(|(_, side)| **side != NOWHERE) {
            members[geometry.object[(side / 2) as usize] as usize].push(i as u32);
        }
        let (low, high) = geometry.bounds();
        let centre = 0.5 * (low + high);
        let mut sizes: Vec<f32> = footprint.iter().copied().filter(|size| *size > 0.0).collect();
        let middle = sizes.len() / 2;
        let median = (middle < sizes.len()).then(|| *sizes.select_nth_unstable_by(middle, f32::total_cmp).1);
        let normal_scale = NORMAL * median.unwrap_or(1.0);
        let objects = members.into_iter().map(|members| (members, OnceLock::new())).collect();
        Self { position, normal, footprint, objects, centre, normal_scale }
    }

    fn tree(&self, members: &[u32]) -> ImmutableKdTree<f32, 6> {
        let place =
            |&i: &u32| feature(self.position[i as usize], self.normal[i as usize], self.centre, self.normal_scale);
        let features: Vec<[f32; 6]> = members.iter().map(place).collect();
        ImmutableKdTree::new_from_slice(&features)
    }

    /// `footprint`: distance between this frame's samples there.
    pub fn reach(&self, point: &SurfacePoint, footprint: f32) -> Reach {
        let (members, tree) = &self.objects[point.object as usize];
        if members.is_empty() {
            return Reach::none(Found::Nothing);
        }
        let tree = tree.get_or_init(|| self.tree(members));
        let (at, normal) = (Vec3::from(point.position), Vec3::from(point.normal));
        let query = feature(at, normal, self.centre, self.normal_scale);
        let count = NonZero::new(NEIGHBOURS).expect("some");
        let near = tree.nearest_n::<SquaredEuclidean>(&query, count);
        let near = || near.iter().map(|found| members[found.item as usize]);
        let alike = || near().filter(|&i| self.normal[i as usize].dot(normal) >= ALIKE);
        let mut three = alike().take(3);
        let Some(nearest) = three.next() else {
            let nearest = near().next().expect("an object has samples");
            return Reach::one(Found::Filled, nearest);
        };
        let away = self.position[nearest as usize].distance(at);
        if away > WITHIN * (footprint + self.footprint[nearest as usize]) {
            return Reach::one(Found::Filled, nearest);
        }
        let (Some(second), Some(third)) = (three.next(), three.next()) else { return Reach::one(Found::Seen, nearest) };
        let samples = [nearest, second, third];
        let weights = barycentric(at, normal, samples.map(|i| self.position[i as usize]));
        Reach { found: Found::Seen, samples, weights }
    }
}

/// Weights of three points for a place, seen along the normal; where the three are about in line or the place lies outside,
/// what is possible: none is negative, and they sum to 1.
pub(in crate::transport) fn barycentric(at: Vec3, normal: Vec3, [a, b, c]: [Vec3; 3]) -> [f32; 3] {
    let flat = |v: Vec3| v - normal * v.dot(normal);
    let (u, v, p) = (flat(b - a), flat(c - a), flat(at - a));
    let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
    let determinant = uu * vv - uv * uv;
    let weights = if determinant > 1e-3 * uu * vv {
        let (s, t) = ((p.dot(u) * vv - p.dot(v) * uv) / determinant, (p.dot(v) * uu - p.dot(u) * uv) / determinant);
        [1.0 - s - t, s, t].map(|weight| weight.max(0.0))
    } else {
        let longest = uu.max(vv).max(1e-20);
        [a, b, c].map(|corner| 1.0 / (flat(at - corner).length_squared() + 1e-4 * longest))
    };
    let sum: f32 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn barycentric_weights_by_hand() {
        let corners = [[0.0, 5.0, 0.0], [4.0, 5.0, 0.0], [0.0, 5.0, 4.0]].map(Vec3::from);
        let weights = |x: f32, z: f32| barycentric(Vec3::new(x, 9.0, z), Vec3::Y, corners);
        assert_eq!(weights(0.0, 0.0), [1.0, 0.0, 0.0]);
        assert_eq!(weights(1.0, 2.0), [0.25, 0.25, 0.5]);
        assert_eq!(weights(-1.0, 2.0), [0.6, 0.0, 0.4], "outside: nothing negative");
        let line = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]].map(Vec3::from);
        let [a, b, c] = barycentric(Vec3::new(1.0, 0.0, 0.0), Vec3::Y, line);
        assert!((a + b + c - 1.0).abs() < 1e-6 && b > 0.99, "{a} {b} {c}");
        let same = barycentric(Vec3::ONE, Vec3::Y, [Vec3::ONE; 3]);
        assert!(same.iter().all(|weight| (weight - 1.0 / 3.0).abs() < 1e-6), "{same:?}");
    }
}
