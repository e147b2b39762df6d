//! What moved between two moments of the same surfaces, and what rays meet now that met something else, or the same, then.
//!
//! For: casting anew only the rays that a moved surface can change (thesis 5.3.4 leaves a moved object to a whole new
//! precomputation).

use crate::scene::Geometry;
use crate::scene::bvh::{Bvh, Hit, Ray, intersect};
use crate::scene::geometry::NONE;
use crate::scene::wide::{SLACK, inverse};
use glam::Vec3;

/// Surfaces that are elsewhere, or of another shape, than they were.
pub struct Change {
    /// Per triangle.
    moved: Vec<bool>,
    /// Of the triangles that moved, where they are now.
    bvh: Bvh,
    bounds: (Vec3, Vec3),
}

impl Change {
    /// `before`: where the same triangles were; `None` when there was another number of them.
    pub fn since(before: &[[[f32; 3]; 3]], now: &Geometry) -> Option<Self> {
        if before.len() != now.corners.len() {
            return None;
        }
        let moved: Vec<bool> = before.iter().zip(&now.corners[..]).map(|(before, now)| before != now).collect();
        let is_there = |triangle: &u32| moved[*triangle as usize] && !now.is_flat(*triangle as usize);
        let there: Vec<u32> = (0..moved.len() as u32).filter(is_there).collect();
        let bvh = if there.is_empty() { Bvh::default() } else { Bvh::build(&now.corners, &there) };
        let corners = there.iter().flat_map(|triangle| now.corners[*triangle as usize]).map(Vec3::from);
        let nothing = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let bounds = corners.fold(nothing, |(low, high), corner| (low.min(corner), high.max(corner)));
        Some(Self { moved, bvh, bounds })
    }

    /// Whether a ray that met this triangle (`NONE`: nothing) need not look for other still ones.
    pub fn keeps(&self, met: u32) -> bool {
        met == NONE || !self.moved[met as usize]
    }

    /// Whether a ray may meet what moved before `t`; errs on the side of yes, as the hierarchy does.
    fn is_near(&self, ray: &Ray, t: f32) -> bool {
        let inverse = Vec3::from(inverse(ray.direction));
        let (a, b) = ((self.bounds.0 - ray.origin) * inverse, (self.bounds.1 - ray.origin) * inverse);
        let (near, far) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(t));
        near <= far * SLACK
    }

    /// What `now.bvh.closest` finds, bit by bit, for a ray that met the triangle `met` (`NONE`: nothing) before.
    pub fn closest(&self, now: &Geometry, ray: &Ray, met: u32) -> Hit {
        let still = match met {
            NONE => Hit { t: ray.t_max, ..Hit::MISS },
            met if self.moved[met as usize] => return now.bvh.closest(ray),
            met => match intersect(met, &now.corners[met as usize], ray) {
                Some(hit) => hit,
                None => return now.bvh.closest(ray),
            },
        };
        let moved = match self.is_near(ray, still.t) {
            true => self.bvh.closest(&Ray { t_max: still.t, ..*ray }),
            false => Hit::MISS,
        };
        if moved.triangle == NONE {
            return if still.triangle == NONE { Hit::MISS } else { still };
        }
        // Among equals the lowest number, as in the whole.
        if moved.t < still.t || moved.triangle < still.triangle { moved } else { still }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::geometry::{GeometryBuilder, Mesh};
    use crate::transport::sampling::{hash, unit};
    use glam::Mat4;

    /// Crossing panels; those of odd number stand elsewhere at `time` 1.
    fn panels(time: f32) -> Geometry {
        let mut builder = GeometryBuilder::of_moving();
        let positions = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
        let mesh = Mesh { positions: &positions, normals: None, uvs: None, indices: &[0, 1, 2, 0, 2, 3], material: 0 };
        for i in 0..40u32 {
            let random = |k: u32| 2.0 * unit(hash(i * 16 + k)) - 1.0;
            let place = Vec3::new(random(0), random(1), random(2)) * 2.0;
            let shift = if i % 2 == 1 { Vec3::new(0.5, 0.2, -0.4) * time } else { Vec3::ZERO };
            // Every fifth lies in one plane with others: rays meet several at once.
            let turn = if i % 5 == 0 { 0.0 } else { 3.0 * random(3) };
            let place = if i % 5 == 0 { place.with_z(0.0) } else { place };
            let object = builder.object(&format!("panel {i}"));
            let shift = if i % 5 == 0 { shift.with_z(0.0) } else { shift };
            builder.add(object, &mesh, Mat4::from_translation(place + shift) * Mat4::from_rotation_y(turn)).unwrap();
        }
        builder.finish(vec!["paper".into()]).unwrap()
    }

    #[test]
    fn rays_meet_what_they_meet_in_the_whole() {
        let (then, now) = (panels(0.0), panels(1.0));
        let change = Change::since(&then.corners, &now).unwrap();
        let (mut kept, mut differ) = (0, 0);
        for i in 0..20_000u32 {
            let random = |k: u32| 2.0 * unit(hash(!(i * 8 + k))) - 1.0;
            let (origin, towards) =
                (Vec3::new(random(0), random(1), random(2)), Vec3::new(random(3), random(4), random(5)));
            let ray = Ray { origin: origin * 4.0, direction: towards, t_max: f32::INFINITY };
            let (before, whole) = (then.bvh.closest(&ray), now.bvh.closest(&ray));
            assert_eq!(change.closest(&now, &ray, before.triangle), whole, "ray {i}, which met {before:?}");
            kept += usize::from(change.keeps(before.triangle));
            differ += usize::from(before != whole);
        }
        assert!(kept > 10_000 && differ > 1000, "{kept} kept, {differ} differ: too few to tell");
    }

    #[test]
    fn another_number_of_triangles_is_another_scene() {
        let now = panels(0.0);
        assert!(Change::since(&now.corners[1..], &now).is_none());
        let nothing = Change::since(&now.corners, &now).unwrap();
        assert!((0..now.corners.len() as u32).all(|triangle| nothing.keeps(triangle)));
    }
}
