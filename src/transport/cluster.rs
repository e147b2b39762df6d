//! Orders gather samples by hierarchical clustering in position and normal, so that a Haar basis along them is smooth
//! (thesis 5.3.2; Hašan et al. 2006) and every node of the tree is a compact patch.

use crate::scene::SurfacePoint;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// The permutation that puts a power of two of points into tree order. Objects stay whole for as long as halves of equal
/// size allow: a caster is then a few nodes of the tree, and a Haar row limited to it a few coefficients. Within one
/// object, halves are split at the median of whichever spreads most, a coordinate or a component of the normal.
pub fn order(points: &[SurfacePoint]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let stuff = |i: u32| (points[i as usize].object, points[i as usize].material);
    order.sort_by_key(|&i| stuff(i));
    split(points, &mut order);
    order
}

/// `part` holds each object in one run.
fn split(points: &[SurfacePoint], part: &mut [u32]) {
    if part.len() < 2 {
        return;
    }
    let middle = part.len() / 2;
    let run = line_up(points, part, middle);
    let axis = Axis::widest(points, &part[run.clone()]);
    // Equal values are told apart by number: the order is the same on every machine.
    let value = |i: &u32| axis.of(&points[*i as usize]);
    let at = middle - run.start;
    part[run].select_nth_unstable_by(at, |a, b| value(a).total_cmp(&value(b)).then(a.cmp(b)));
    let (left, right) = part.split_at_mut(middle);
    if left.len() > 512 {
        rayon::join(|| split(points, left), || split(points, right));
    } else {
        split(points, left);
        split(points, right);
    }
}

/// Lines the runs of a part up along the axis in which the part is widest; the run that holds `middle`.
fn line_up(points: &[SurfacePoint], part: &mut [u32], middle: usize) -> Range<usize> {
    let mut runs: Vec<Vec<u32>> =
        part.chunk_by(|&a, &b| same_stuff(&points[a as usize], &points[b as usize])).map(<[u32]>::to_vec).collect();
    if runs.len() == 1 {
        return 0..part.len();
    }
    let spread = spread(points, part, |point| point.position.into());
    let axis = spread.max_position();
    let centre = |run: &[u32]| run.iter().map(|&i| points[i as usize].position[axis]).sum::<f32>() / run.len() as f32;
    runs.sort_by(|a, b| centre(a).total_cmp(&centre(b)));
    part.copy_from_slice(&runs.concat());
    let mut end = 0;
    let lengths = runs.iter().map(Vec::len);
    let run = lengths.map(|length| {
        end += length;
        end - length..end
    });
    run.into_iter().find(|run| run.contains(&middle)).expect("the runs make up the part")
}

/// What points are split by.
enum Axis {
    Position(usize),
    Normal(usize),
}

impl Axis {
    /// In which these points spread most; opposite normals count as much as half their width.
    fn widest(points: &[SurfacePoint], part: &[u32]) -> Self {
        let in_space = spread(points, part, |point| point.position.into());
        let in_normal = spread(points, part, |point| point.geometric_normal.into()) * (0.25 * in_space.length());
        match in_normal.max_element() > in_space.max_element() {
            true => Self::Normal(in_normal.max_position()),
            false => Self::Position(in_space.max_position()),
        }
    }

    fn of(&self, point: &SurfacePoint) -> f32 {
        match self {
            Self::Position(axis) => point.position[*axis],
            Self::Normal(axis) => point.geometric_normal[*axis],
        }
    }
}

fn spread(points: &[SurfacePoint], part: &[u32], get: impl Fn(&SurfacePoint) -> Vec3) -> Vec3 {
    let values = part.iter().map(|&i| get(&points[i as usize]));
    let (low, high) =
        values.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    high - low
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sampling::{hash, unit};

    #[test]
    fn an_order_is_a_permutation_that_keeps_objects_whole() {
        let points: Vec<SurfacePoint> = (0..1024)
            .map(|i| SurfacePoint {
                object: hash(i) % 5,
                material: 0,
                position: [0, 1, 2].map(|k| unit(hash(3 * i + k))),
                ..SurfacePoint::NOWHERE
            })
            .collect();
        let order = order(&points);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, &number)| i as u32 == number));
        let runs = order.chunk_by(|&a, &b| same_stuff(&points[a as usize], &points[b as usize])).count();
        // By place alone it would be about 800.
        assert!(runs <= 30, "5 objects in {runs} runs");
    }
}
