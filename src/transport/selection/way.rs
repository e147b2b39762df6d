//! How paint gets from the brush to a sample: straight over the surface, or round what stands on it.

use super::paint::Knot;
use crate::scene::bvh::Ray;
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::sampling;
use glam::Vec3;

/// A little above the surface: up from the sample, over, and down to the brush.
pub(super) struct Way<'a> {
    geometry: &'a Geometry,
    sample: Vec3,
    from: Vec3,
    to: Vec3,
    /// Along the surface and across the way, as long as it.
    side: Vec3,
}

/// Offsets of a detour that are tried first, of the largest that may matter.
const TRIES: [f32; 5] = [0.0625, 0.125, 0.25, 0.5, 1.0];
/// Halvings by which the least offset is then found.
const HALVINGS: usize = 3;
/// Detours longer than about twice this, relative to the straight way, are not looked for.
const FARTHEST: f32 = 4.0;

impl<'a> Way<'a> {
    pub fn new(geometry: &'a Geometry, knot: &Knot, point: &SurfacePoint) -> Self {
        let (at, normal, up) = (point.position.into(), Vec3::from(point.normal), point.geometric_normal.into());
        let raise = knot.raise + bulge(at - knot.position, normal, knot.normal);
        let sample = sampling::lifted(at, up, geometry.lift());
        let from = sampling::lifted(at, up, raise);
        let to = sampling::lifted(knot.position, knot.normal, raise);
        let side = (to - from).cross(normal + knot.normal).normalize_or_zero() * from.distance(to);
        Self { geometry, sample, from, to, side }
    }

    fn free(&self, a: Vec3, b: Vec3) -> bool {
        !self.geometry.bvh.any(&Ray { origin: a, direction: b - a, t_max: 1.0 })
    }

    pub fn is_free(&self) -> bool {
        self.free(self.from, self.to) && self.free(self.sample, self.from)
    }

    /// The length of the shortest free way over a point beside the middle, relative to the straight one; infinite where
    /// there is none short enough to be painted. `distance`: of the straight way, in radii.
    pub fn detour(&self, distance: f32) -> f32 {
        if !self.free(self.sample, self.from) {
            return f32::INFINITY;
        }
        let most = (0.5 * (1.0 / (distance * distance) - 1.0).max(0.0).sqrt()).min(FARTHEST);
        let side = |sign: f32| {
            let free = |offset: f32| {
                let over = self.from.midpoint(self.to) + self.side * (sign * offset);
                self.free(self.from, over) && self.free(over, self.to)
            };
            let Some(found) = TRIES.iter().position(|part| free(part * most)) else { return f32::INFINITY };
            let mut blocked = if found == 0 { 0.0 } else { TRIES[found - 1] * most };
            let mut open = TRIES[found] * most;
            for _ in 0..HALVINGS {
                let middle = 0.5 * (blocked + open);
                *(if free(middle) { &mut open } else { &mut blocked }) = middle;
            }
            open
        };
        let offset = side(1.0).min(side(-1.0));
        (1.0 + 4.0 * offset * offset).sqrt()
    }
}

/// How high a ball bulges over the chord `apart` between two of its points with these normals; 0 for a bowl.
fn bulge(apart: Vec3, normal: Vec3, other: Vec3) -> f32 {
    if apart.dot(normal - other) <= 0.0 {
        return 0.0;
    }
    // So that the raised chord clears the ball: its length times tan(angle / 4) / (2 cos(angle / 2)).
    let half = 0.5 * normal.dot(other).clamp(-1.0, 1.0);
    let (sin, cos) = ((0.5 - half).max(0.0).sqrt(), (0.5 + half).sqrt());
    apart.length() * sin / (2.0 * cos * (1.0 + cos))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two points of a unit ball, 60 degrees apart, raised until the chord touches it: by 1 / cos 30 - 1.
    #[test]
    fn a_raised_chord_clears_the_ball() {
        let at = |degrees: f32| Vec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
        let (a, b) = (at(0.0), at(60.0));
        assert!((bulge(b - a, b, a) - (1.0 / 30f32.to_radians().cos() - 1.0)).abs() < 1e-6);
        assert_eq!(bulge(b - a, -b, -a), 0.0, "from inside");
        assert_eq!(bulge(Vec3::X, Vec3::Y, Vec3::Y), 0.0, "flat");
    }
}
