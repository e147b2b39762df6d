//! Where the gather tree's nodes lie: what decides whether an edit is the same all over a node.

use crate::scene::SurfacePoint;
use glam::Vec3;
use rayon::prelude::*;

/// One of each for the 2M nodes of the tree over M gather samples; node 0 is unused.
#[derive(Clone, Debug, Default)]
pub struct Patches {
    /// Mean position of a node's samples, metres, world.
    pub centre: Vec<Vec3>,
    /// Mean of their normals: the shorter, the more the patch bends.
    pub normal: Vec<Vec3>,
    /// Of the smallest sphere about `centre` that holds them, metres; 0 for leaves.
    pub radius: Vec<f32>,
}

impl Patches {
    /// `points` in tree order, a power of two of them.
    pub fn new(points: &[SurfacePoint]) -> Self {
        let count = points.len();
        let nodes = (0..2 * count).into_par_iter().with_min_len(64).map(|node| {
            let level = node.max(1).ilog2();
            let span = count >> level;
            let first = (node - (1 << level).min(node)) * span;
            let leaves = &points[first..][..span];
            let mean = |get: fn(&SurfacePoint) -> [f32; 3]| {
                leaves.iter().map(|point| Vec3::from(get(point))).sum::<Vec3>() / span as f32
            };
            let centre = mean(|point| point.position);
            let far = |point: &SurfacePoint| (Vec3::from(point.position) - centre).length_squared();
            let radius = if span == 1 { 0.0 } else { leaves.iter().map(far).fold(0.0, f32::max).sqrt() };
            (centre, (mean(|point| point.geometric_normal), radius))
        });
        let (centre, (normal, radius)) = nodes.unzip();
        Self { centre, normal, radius }
    }

    /// Gather samples, M.
    pub fn count(&self) -> usize {
        self.radius.len() / 2
    }

    pub fn bytes(&self) -> u64 {
        28 * self.radius.len() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_points_in_a_row() {
        let point = |x: f32, up: f32| SurfacePoint {
            position: [x, 0.0, 0.0],
            geometric_normal: [0.0, up, 0.0],
            ..SurfacePoint::NOWHERE
        };
        let patches = Patches::new(&[point(0.0, 1.0), point(2.0, 1.0), point(6.0, 1.0), point(8.0, -1.0)]);
        assert_eq!(patches.count(), 4);
        let x: Vec<f32> = patches.centre[1..].iter().map(|c| c.x).collect();
        assert_eq!(x, [4.0, 1.0, 7.0, 0.0, 2.0, 6.0, 8.0]);
        assert_eq!(patches.radius[1..], [4.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        let up: Vec<f32> = patches.normal[1..].iter().map(|n| n.y).collect();
        assert_eq!(up, [0.5, 1.0, 0.0, 1.0, 1.0, 1.0, -1.0]);
    }
}
