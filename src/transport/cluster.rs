//! Orders gather samples by hierarchical clustering in position and normal, so that a Haar basis along them is smooth
//! (thesis 5.3.2; Hašan et al. 2006) and every node of the tree is a compact patch.

use crate::scene::SurfacePoint;
use glam::Vec3;
use rayon::prelude::*;

/// The permutation that puts a power of two of points into tree order: halves are split at the median of whichever
/// spreads most, a coordinate or a component of the normal.
pub fn order(points: &[SurfacePoint]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    split(points, &mut order);
    order
}

fn split(points: &[SurfacePoint], part: &mut [u32]) {
    if part.len() < 2 {
        return;
    }
    let spread = |get: &dyn Fn(&SurfacePoint) -> Vec3| {
        let (low, high) = part
            .iter()
            .map(|&i| get(&points[i as usize]))
            .fold((Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY)), |(low, high), v| {
                (low.min(v), high.max(v))
            });
        high - low
    };
    let in_space = spread(&|point| point.position.into());
    // Opposite normals count as much as half the patch.
    let in_normal = spread(&|point| point.geometric_normal.into()) * (0.25 * in_space.length());
    let axis = |v: Vec3| {
        if v.x >= v.y && v.x >= v.z {
            0
        } else if v.y >= v.z {
            1
        } else {
            2
        }
    };
    let by_normal = in_normal.max_element() > in_space.max_element();
    let axis = axis(if by_normal { in_normal } else { in_space });
    let value = |&i: &u32| {
        let point = &points[i as usize];
        if by_normal { point.geometric_normal[axis] } else { point.position[axis] }
    };
    let middle = part.len() / 2;
    // Equal values are told apart by number: the order is the same on every machine.
    part.select_nth_unstable_by(middle, |a, b| value(a).total_cmp(&value(b)).then(a.cmp(b)));
    let (left, right) = part.split_at_mut(middle);
    if left.len() > 512 {
        rayon::join(|| split(points, left), || split(points, right));
    } else {
        split(points, left);
        split(points, right);
    }
}

/// Same object and material.
pub fn same_stuff(a: &SurfacePoint, b: &SurfacePoint) -> bool {
    a.object == b.object && a.material == b.material
}

/// Squared radius about its centroid of every node of the tree over ordered points (2M, index 0 unused). Infinite where
/// the mean normal is short (a patch that goes round a corner cannot stand for its samples), and where objects or
/// materials meet (light of one caster must not be credited to another).
pub fn squared_radii(points: &[SurfacePoint]) -> Vec<f32> {
    let count = points.len();
    let mut radius2 = vec![0.0; 2 * count];
    radius2[..count].par_iter_mut().enumerate().skip(1).for_each(|(node, radius2)| {
        let level = node.ilog2();
        let span = count >> level;
        let leaves = &points[(node - (1 << level)) * span..][..span];
        let mean = |get: &dyn Fn(&SurfacePoint) -> Vec3| leaves.iter().map(get).sum::<Vec3>() / span as f32;
        let centre = mean(&|point| point.position.into());
        let normal = mean(&|point| point.geometric_normal.into());
        let mixed = leaves.iter().any(|leaf| !same_stuff(leaf, &leaves[0]));
        *radius2 = if mixed || normal.length_squared() < 0.9 {
            f32::INFINITY
        } else {
            leaves.iter().map(|point| (Vec3::from(point.position) - centre).length_squared()).fold(0.0, f32::max)
        };
    });
    radius2
}
