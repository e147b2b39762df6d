//! Which node of the gather tree a ray's hit is credited to. Same as `shaders/shared/credit.wgsl`, function by function.

use crate::scene::bvh::{Hit, Ray};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::gather::Gather;
use crate::transport::sampling;
use glam::{Vec2, Vec3};

/// A cosine-distributed ray about the point's shading normal, lifted off its surface.
pub fn unit_ray(point: &SurfacePoint, at: Vec2, lift: f32) -> Ray {
    let normal = Vec3::from(point.normal);
    let (x, y) = sampling::frame(normal);
    let local = sampling::cosine_direction(at);
    let origin = sampling::lifted(point.position.into(), point.geometric_normal.into(), lift);
    Ray { origin, direction: x * local.x + y * local.y + normal * local.z, t_max: f32::INFINITY }
}

/// The gather sample nearest to a hit, as the point sees it; `None` on a dead side. `spacing`: between gather samples.
pub fn leaf(geometry: &Geometry, gather: &Gather, point: &SurfacePoint, hit: &Hit, spacing: f32) -> Option<u32> {
    let leaf = gather.nearest(hit.triangle, [hit.u, hit.v], hit.front)?;
    if behind(point, &gather.points[leaf as usize]) {
        // The cell straddles the row's own surface: look again half a sample further out.
        let (u, v) = nudged(geometry, hit, Vec3::from(point.geometric_normal) * spacing);
        let other = gather.nearest(hit.triangle, [u, v], hit.front)?;
        if !behind(point, &gather.points[other as usize]) {
            return Some(other);
        }
    }
    Some(leaf)
}

/// The largest node above a leaf whose radius squared is at most `limit`, m².
pub fn climb(gather: &Gather, leaf: u32, limit: f32) -> u32 {
    let mut node = gather.count() as u32 + leaf;
    while node > 1 && gather.radius2[(node >> 1) as usize] <= limit {
        node >>= 1;
    }
    node
}

/// Radius squared, m², of the patch at a hit that one ray of `direction` stands for. `share`: pi over the ray's solid
/// angle.
pub fn patch(geometry: &Geometry, hit: &Hit, direction: Vec3, share: f32) -> f32 {
    let area_vector = geometry.area_vector(hit.triangle as usize);
    let facing = (area_vector.dot(direction).abs() / area_vector.length()).max(0.1);
    hit.t * hit.t / (share * facing)
}

/// A point cannot see a sample below its own surface.
fn behind(point: &SurfacePoint, sample: &SurfacePoint) -> bool {
    (Vec3::from(sample.position) - Vec3::from(point.position)).dot(point.geometric_normal.into()) < 0.0
}

/// Barycentrics of a hit moved along its triangle, clamped to stay on it.
pub fn nudged(geometry: &Geometry, hit: &Hit, by: Vec3) -> (f32, f32) {
    let [a, b, c] = geometry.corners[hit.triangle as usize].map(Vec3::from);
    let (edge_u, edge_v) = (b - a, c - a);
    let (uu, uv, vv) = (edge_u.dot(edge_u), edge_u.dot(edge_v), edge_v.dot(edge_v));
    let (du, dv) = (by.dot(edge_u), by.dot(edge_v));
    let determinant = uu * vv - uv * uv;
    // A sliver has no room to move in.
    if determinant.is_nan() || determinant <= 1e-6 * uu * vv {
        return (hit.u, hit.v);
    }
    let u = (hit.u + (du * vv - dv * uv) / determinant).clamp(0.0, 1.0);
    let v = (hit.v + (dv * uu - du * uv) / determinant).clamp(0.0, 1.0 - u);
    (u, v)
}
