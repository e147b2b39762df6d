//! The surface nearest to a point in space.

use crate::scene::bvh::Facet;
use crate::scene::{Geometry, SurfacePoint};
use glam::Vec3;

/// Cosine of how far a surface may be turned from an asked normal, on either side, to be the one that is meant.
const MEANT: f32 = 0.5;

pub struct Nearest {
    pub point: SurfacePoint,
    /// Weights of its triangle's second and third corner.
    pub barycentrics: [f32; 2],
    /// Metres.
    pub distance: f32,
}

/// The nearest surface point.
///
/// With a normal: on the side that looks that way, and of two surfaces about as near the one that is turned so (a point
/// in a corner is on the floor or on the wall). Without: on the front of the surface, unless the point lies clearly
/// behind it.
pub fn nearest(geometry: &Geometry, at: Vec3, normal: Option<Vec3>) -> Nearest {
    nearest_among(geometry, at, normal, None).expect("a geometry has triangles")
}

/// As `nearest`, on one object; `None` when it has no surface.
pub fn nearest_among(geometry: &Geometry, at: Vec3, normal: Option<Vec3>, object: Option<u32>) -> Option<Nearest> {
    // Positions in recipes are rounded.
    let slack = 1e3 * geometry.lift();
    let of_object = |facet: &Facet| object.is_none_or(|object| geometry.object[facet.triangle as usize] == object);
    let any = search(geometry, at, of_object)?;
    let (found, front) = match normal {
        Some(normal) => {
            let turned = |area_vector: Vec3| area_vector.dot(normal).abs() > MEANT * area_vector.length();
            let meant = search(geometry, at, |facet| of_object(facet) && turned(area_vector(facet)));
            let found = meant.filter(|meant| meant.distance <= any.distance + slack).unwrap_or(any);
            (found, geometry.area_vector(found.triangle).dot(normal) >= 0.0)
        }
        None => {
            let height = (at - Vec3::from(geometry.corners[any.triangle][0]))
                .dot(geometry.area_vector(any.triangle).normalize_or_zero());
            (any, height >= -slack)
        }
    };
    let point = geometry.surface_point(found.triangle, found.u, found.v, front);
    Some(Nearest { point, barycentrics: [found.u, found.v], distance: found.distance })
}

#[derive(Clone, Copy)]
struct Found {
    distance: f32,
    triangle: usize,
    u: f32,
    v: f32,
}

fn area_vector(facet: &Facet) -> Vec3 {
    Vec3::from(facet.edge_u).cross(Vec3::from(facet.edge_v))
}

/// Among equally near ones the lowest triangle.
fn search(geometry: &Geometry, at: Vec3, wanted: impl Fn(&Facet) -> bool) -> Option<Found> {
    let nodes = &geometry.bvh.nodes;
    let away = |index: u32| {
        let node = &nodes[index as usize];
        at.distance(at.clamp(node.low.into(), node.high.into()))
    };
    let mut best: Option<Found> = None;
    let mut todo = vec![(0u32, away(0))];
    while let Some((index, distance)) = todo.pop() {
        // The distance to a box may be rounded up by as much as that to a triangle in it is rounded down.
        if best.is_some_and(|best| distance > best.distance * 1.000_001) {
            continue;
        }
        let node = &nodes[index as usize];
        if node.count == 0 {
            let mut both = [(node.first, away(node.first)), (node.first + 1, away(node.first + 1))];
            both.sort_by(|a, b| b.1.total_cmp(&a.1));
            todo.extend(both);
            continue;
        }
        let leaf = &geometry.bvh.facets[node.first as usize..][..node.count as usize];
        for facet in leaf.iter().filter(|facet| wanted(facet)) {
            let (u, v) = closest(facet, at);
            let point = Vec3::from(facet.corner) + Vec3::from(facet.edge_u) * u + Vec3::from(facet.edge_v) * v;
            let found = Found { distance: point.distance(at), triangle: facet.triangle as usize, u, v };
            let better = |best: Found| (found.distance, found.triangle) < (best.distance, best.triangle);
            if best.is_none_or(better) {
                best = Some(found);
            }
        }
    }
    best
}

/// Barycentrics (second, third corner) of a triangle's point nearest to `at`: inside, or on the nearest of the edges.
fn closest(facet: &Facet, at: Vec3) -> (f32, f32) {
    let (edge_u, edge_v) = (Vec3::from(facet.edge_u), Vec3::from(facet.edge_v));
    let p = at - Vec3::from(facet.corner);
    let (uu, uv, vv) = (edge_u.dot(edge_u), edge_u.dot(edge_v), edge_v.dot(edge_v));
    let (pu, pv) = (p.dot(edge_u), p.dot(edge_v));
    let determinant = uu * vv - uv * uv;
    let (u, v) = ((pu * vv - pv * uv) / determinant, (pv * uu - pu * uv) / determinant);
    // Written so that NaN (a sliver) goes to the edges.
    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
        return (u, v);
    }
    let along = |from: Vec3, edge: Vec3| ((p - from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
    let third = along(edge_u, edge_v - edge_u);
    let edges = [(along(Vec3::ZERO, edge_u), 0.0), (0.0, along(Vec3::ZERO, edge_v)), (1.0 - third, third)];
    let distance = |(u, v): (f32, f32)| (edge_u * u + edge_v * v).distance_squared(p);
    edges.into_iter().min_by(|a, b| distance(*a).total_cmp(&distance(*b))).expect("three edges")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;
    use crate::transport::sampling::{hash, unit};

    #[test]
    fn closest_points_of_a_triangle_by_hand() {
        let facet = Facet {
            corner: [1.0, 0.0, 0.0],
            edge_u: [2.0, 0.0, 0.0],
            edge_v: [0.0, 0.0, 2.0],
            triangle: 0,
            pad0: 0,
            pad1: 0,
        };
        for (at, expected) in [
            ([1.5, 9.0, 0.5], (0.25, 0.25)),
            ([0.0, 1.0, 0.0], (0.0, 0.0)),
            ([2.0, 1.0, -3.0], (0.5, 0.0)),
            ([-2.0, 0.0, 1.0], (0.0, 0.5)),
            ([9.0, 0.0, -1.0], (1.0, 0.0)),
            ([3.0, 0.0, 2.0], (0.5, 0.5)),
        ] {
            assert_eq!(closest(&facet, at.into()), expected, "{at:?}");
        }
    }

    /// Every triangle one after another gives the same.
    #[test]
    fn the_nearest_surface_is_the_nearest_of_all() {
        let geometry = builtin::scene("room").unwrap().geometry;
        for i in 0..500 {
            let [x, y, z] = [0, 1, 2].map(|axis| 6.0 * unit(hash(3 * i + axis)) - 3.0);
            let at = Vec3::new(x, y, z);
            let Nearest { point, barycentrics: [u, v], distance } = nearest(&geometry, at, None);
            let front = geometry.surface_point(point.triangle as usize, u, v, true);
            assert_eq!(front.position, point.position, "barycentrics are those of the point");
            let slow = geometry.bvh.facets.iter().map(|facet| {
                let (u, v) = closest(facet, at);
                (Vec3::from(facet.corner) + Vec3::from(facet.edge_u) * u + Vec3::from(facet.edge_v) * v).distance(at)
            });
            let slow = slow.fold(f32::INFINITY, f32::min);
            assert_eq!(distance, slow, "{at}");
            assert!((Vec3::from(point.position).distance(at) - distance).abs() < 1e-5, "{at}");
        }
    }

    #[test]
    fn a_normal_chooses_the_surface_and_its_side() {
        let geometry = builtin::scene("room").unwrap().geometry;
        let named = |at: [f32; 3], normal: Option<Vec3>| {
            let Nearest { point, .. } = nearest(&geometry, at.into(), normal);
            (geometry.objects[point.object as usize].as_str(), point.geometric_normal.map(|x| x.round() as i32))
        };
        let corner = [-1.9999, 0.0002, 0.0];
        assert_eq!(named(corner, Some(Vec3::Y)), ("floor", [0, 1, 0]));
        assert_eq!(named(corner, Some(Vec3::X)), ("left_wall", [1, 0, 0]));
        assert_eq!(named([0.0, 0.0, 1.5], Some(Vec3::NEG_Y)), ("floor", [0, -1, 0]));
        assert_eq!(named([0.0, 0.0, 1.5], None), ("floor", [0, 1, 0]));
        assert_eq!(named([0.0, -0.2, 1.5], None), ("floor", [0, -1, 0]), "clearly behind");
        assert_eq!(named([0.0, 0.1, 1.5], Some(Vec3::X)), ("floor", [0, 1, 0]), "no such surface near");
    }
}
