//! What the cache says of a place: which records count there, how much, and the light that they make.
//!
//! Record i, of mean distance `R_i` to what it sees, counts at a place p with normal n by (Ward et al. 1988, eq. 6; thesis
//! eq. 3.2)
//!
//! ```text
//! w_i(p) = 1 / e_i(p) - 1 / a,   e_i(p) = |p - p_i| / R_i + b_i sqrt(1 - n . n_i)
//! ```
//!
//! where `b_i` is 1 but for light from near the horizon, `e_i < a` and p does not lie in front of it; what is taken off
//! makes weights fade out instead of ending. Each adds its light with its gradients.

use super::{Columns, Spot};
use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4};

/// What records are looked up by, in one cache line (64 bytes; same layout in WGSL).
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Shape {
    pub position: Vec3,
    /// Beyond, it does not count, m².
    pub reach2: f32,
    pub normal: Vec3,
    /// 1 / R.
    pub inverse: f32,
    pub bend: f32,
    /// Where a record is made to count farther than its light allows, gradients are followed by this less.
    pub damping: f32,
    pub variance: f32,
    /// Index into the scene's materials.
    pub material: u32,
    /// `Parting::kind`.
    pub kind: u32,
    pub pad: [u32; 3],
}

/// What the cache says of a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Irradiance, W/m².
    pub light: Vec4,
    /// Sum of weights; 0: nothing is known here.
    pub weight: f32,
    /// Mean squared error by noise.
    pub variance: f32,
}

impl Columns {
    /// The light at a place.
    #[inline]
    pub fn look_up(&self, spot: &Spot) -> Found {
        self.look_up_with(spot, |_, _| {})
    }

    /// As `look_up`; `tell` hears which records count, and how much.
    #[inline]
    pub fn look_up_with(&self, spot: &Spot, mut tell: impl FnMut(usize, f32)) -> Found {
        let normal = Vec3::from(spot.point.normal);
        let (mut total, mut variance, mut light) = (0.0, 0.0, Vec4::ZERO);
        let (count, kind) = (self.parting.count, self.parting.kind(spot.point.material, spot.receivers));
        self.visit(spot, |record, weight, by| {
            let shape = &self.shapes[record];
            let (by, turn) = (by * shape.damping, shape.normal.cross(normal));
            tell(record, weight);
            total += weight;
            variance += weight * weight * shape.variance;
            let all = &self.light[record];
            let mut here = all.at(by, turn);
            if shape.kind != kind {
                let changes = &self.changes[record * count..][..count];
                for ((there, own), change) in spot.receivers.iter().zip(self.receivers_of(record)).zip(changes) {
                    here += *change * (there - own);
                }
            }
            // Gradients lead below what can be, edits may lead there on purpose.
            light += here.max(all.value.min(Vec4::ZERO)) * weight;
            true
        });
        if total > 0.0 {
            light /= total;
            variance /= total * total;
        }
        Found { light, weight: total, variance }
    }

    /// Whether a record counts at a place whose error there is below `share` of what it may be.
    #[inline]
    pub fn covers(&self, spot: &Spot, share: f32) -> bool {
        let least = (1.0 / share - 1.0) / self.error;
        let mut covered = false;
        self.visit(spot, |_, weight, _| {
            covered = weight >= least;
            !covered
        });
        covered
    }

    /// The records that count at a place: number, weight, and way from there. False ends it.
    #[inline]
    pub fn visit(&self, spot: &Spot, mut take: impl FnMut(usize, f32, Vec3) -> bool) {
        if self.shapes.is_empty() {
            return;
        }
        let (at, normal) = (Vec3::from(spot.point.position), Vec3::from(spot.point.normal));
        let kind = self.parting.kind(spot.point.material, spot.receivers);
        self.index.near(at, |record| {
            let shape = &self.shapes[record as usize];
            let by = at - shape.position;
            let squared = by.length_squared();
            if squared >= shape.reach2 {
                return true;
            }
            // 1 - n . n_i, and exactly 0 for a record's own place.
            let turned = 0.5 * normal.distance_squared(shape.normal);
            let error = squared.sqrt() * shape.inverse + shape.bend * turned.sqrt();
            // In front of it, a place sees what the record has behind itself.
            if error >= self.error || by.dot(normal + shape.normal) * shape.inverse < -0.1 * self.error {
                return true;
            }
            let makeup = |record| (shape.material, self.receivers_of(record));
            if shape.kind != kind
                && self.parting.part_ways(makeup(record as usize), (spot.point.material, spot.receivers))
            {
                return true;
            }
            let weight = 1.0 / error.max(1e-3 * self.error) - 1.0 / self.error;
            weight <= 0.0 || take(record as usize, weight, by)
        });
    }
}
