//! Pixels of a picture as weights of the surfaces that they show.
//!
//! A point has the weight of the nearest sample on the same object; so what the camera does not see of an object goes
//! with what it sees nearest to it, and an object that it does not see at all is not selected.

use super::{Digest, finish};
use crate::device::Array;
use crate::scene::{Fingerprint, SurfacePoint};
use crate::transport::Samples;
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub struct Matte {
    geometry: Fingerprint,
    digest: Digest,
    /// Of the samples in the tree, in [0, 1].
    weights: Array<f32>,
    objects: Array<u32>,
    /// Metres; the fourth coordinate keeps objects farther apart than anything within one.
    tree: Arc<ImmutableKdTree<f32, 4>>,
    apart: f32,
}

impl PartialEq for Matte {
    fn eq(&self, other: &Self) -> bool {
        self.digest == other.digest
    }
}

impl Matte {
    /// `pixels`: weights in [0, 1], one a pixel of `samples`. All samples of a pixel have its weight.
    pub(super) fn new(samples: &Samples, pixels: &[f32]) -> Self {
        let per_pixel = samples.per_pixel();
        let there: Vec<usize> = (0..samples.points.len()).filter(|i| samples.points[*i].exists()).collect();
        let point = |i: &usize| samples.points[*i];
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for i in &there {
            (low, high) = (low.min(point(i).position.into()), high.max(point(i).position.into()));
        }
        let apart = if there.is_empty() { 1.0 } else { 1e4 * (high - low).length().max(1.0) };
        let places: Vec<[f32; 4]> = there.par_iter().map(|i| place(&point(i), apart)).collect();
        let weights: Vec<f32> = there.iter().map(|i| pixels[i / per_pixel]).collect();
        let objects: Vec<u32> = there.iter().map(|i| point(i).object).collect();
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"matte").update(&samples.geometry);
        hasher.update_rayon(bytemuck::cast_slice(&places)).update_rayon(bytemuck::cast_slice(&weights));
        Self {
            geometry: samples.geometry,
            digest: finish(&hasher),
            tree: Arc::new(ImmutableKdTree::new_from_slice(&places)),
            weights: weights.into(),
            objects: objects.into(),
            apart,
        }
    }

    pub(super) fn geometry(&self) -> &Fingerprint {
        &self.geometry
    }

    pub(super) fn evaluate(&self, points: &[SurfacePoint], weights: &mut [f32]) {
        if self.weights.is_empty() {
            return;
        }
        for (point, weight) in points.iter().zip(weights).filter(|(point, _)| point.exists()) {
            let nearest = self.tree.nearest_one::<SquaredEuclidean>(&place(point, self.apart)).item as usize;
            if self.objects[nearest] == point.object {
                *weight = self.weights[nearest];
            }
        }
    }

    pub(super) fn digest(&self) -> Digest {
        self.digest
    }

    pub(super) fn bytes(&self) -> u64 {
        // In the tree: four coordinates and a number each.
        (4 + 4 + 20) * self.weights.len() as u64
    }
}

fn place(point: &SurfacePoint, apart: f32) -> [f32; 4] {
    let [x, y, z] = point.position;
    [x, y, z, apart * point.object as f32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Device;
    use crate::scene::{Camera, Geometry, builtin};
    use crate::transport::Selection;
    use crate::transport::sampling::{hash, unit};

    fn view(geometry: &Geometry, size: (u32, u32), per_pixel: u32) -> Samples {
        let camera = Camera::look_at("", Vec3::new(0.3, 1.2, 4.0), Vec3::new(0.0, 1.0, 0.0), 0.8);
        Samples::view(&Device::Cpu, geometry, &camera, size, per_pixel).unwrap()
    }

    #[test]
    fn pixels_get_their_own_weights_back() {
        let geometry = builtin::scene("room").unwrap().geometry;
        for per_pixel in [1, 4] {
            let samples = view(&geometry, (160, 120), per_pixel);
            let pixels: Vec<f32> = (0..160 * 120).map(|i| unit(hash(i))).collect();
            let matte = Selection::matte(&samples, &pixels);
            for (i, weight) in matte.weights(&samples.points).into_iter().enumerate() {
                let expected = if samples.points[i].exists() { pixels[i / per_pixel as usize] } else { 0.0 };
                assert_eq!(weight, expected, "sample {i}");
            }
            assert!(matte != Selection::matte(&samples, &vec![0.5; 160 * 120]));
            assert!(matte.check(&geometry.fingerprint).is_ok());
        }
    }

    /// Hidden points go with what is seen of the same object, not with what stands in front of them.
    #[test]
    fn what_is_hidden_goes_with_its_object() {
        let geometry = builtin::scene("room").unwrap().geometry;
        let samples = view(&geometry, (160, 120), 1);
        let block = geometry.objects.iter().position(|name| name == "block").unwrap() as u32;
        let pixels: Vec<f32> = samples.points.iter().map(|point| f32::from(point.object == block)).collect();
        let matte = Selection::matte(&samples, &pixels);
        for triangle in 0..geometry.corners.len() {
            for front in [false, true] {
                let point = geometry.surface_point(triangle, 0.3, 0.3, front);
                assert_eq!(matte.weight(&point), f32::from(point.object == block), "triangle {triangle}");
            }
        }
        // The block out of sight: it goes with nothing, though everything round it is selected.
        let hide = |point: &SurfacePoint| if point.object == block { SurfacePoint::NOWHERE } else { *point };
        let without = Samples { points: samples.points.iter().map(hide).collect::<Vec<_>>().into(), ..samples.clone() };
        let all = Selection::matte(&without, &vec![1.0; pixels.len()]);
        for triangle in 0..geometry.corners.len() {
            let point = geometry.surface_point(triangle, 0.3, 0.3, true);
            assert_eq!(all.weight(&point), f32::from(point.object != block), "triangle {triangle}");
        }
        let unseen = Samples { points: vec![SurfacePoint::NOWHERE; samples.points.len()].into(), ..samples };
        let nothing = Selection::matte(&unseen, &pixels);
        assert_eq!(nothing.weight(&geometry.surface_point(0, 0.3, 0.3, true)), 0.0);
    }
}
