//! A pinhole's seven unknowns, and the way downhill to where they fit.

use super::Sighting;
use glam::{DMat3, DQuat, DVec2, DVec3};

const STEPS: usize = 60;

#[derive(Clone, Copy)]
pub(super) struct Pose {
    /// Columns: right, up, backward.
    pub axes: DMat3,
    pub eye: DVec3,
    /// Pixels.
    pub focal: f64,
}

impl Pose {
    /// How far off in the picture, and how that changes with the seven unknowns: turning and moving along the camera's
    /// axes, logarithm of the focal length.
    pub fn miss(&self, s: &Sighting) -> (DVec2, [DVec2; 7]) {
        let p = self.axes.transpose() * (s.position - self.eye);
        // What comes to lie behind is far off.
        let depth = (-p.z).max(1e-3);
        let (x, y) = (p.x / depth, -p.y / depth);
        let off = DVec2::new(x, y) * self.focal - s.at;
        let by_point = |d: DVec3| {
            let scale = self.focal / depth;
            DVec2::new(d.x + x * d.z, -d.y + y * d.z) * scale
        };
        let turned = |axis: DVec3| by_point(-axis.cross(p));
        let moved = |axis: DVec3| by_point(-axis);
        let jacobian = [
            turned(DVec3::X),
            turned(DVec3::Y),
            turned(DVec3::Z),
            moved(DVec3::X),
            moved(DVec3::Y),
            moved(DVec3::Z),
            DVec2::new(x, y) * self.focal,
        ];
        (off, jacobian)
    }

    fn moved(&self, by: &[f64; 7], size: DVec2) -> Self {
        let turn = DQuat::from_scaled_axis(DVec3::new(by[0], by[1], by[2]));
        let eye = self.eye + self.axes * DVec3::new(by[3], by[4], by[5]);
        let focal = (self.focal * by[6].clamp(-1.0, 1.0).exp()).clamp(0.05 * size.y, 200.0 * size.y);
        Self { axes: self.axes * DMat3::from_quat(turn), eye, focal }
    }

    /// Of squared distances, each with its weight; beyond `near` they count for less and less (Geman, McClure 1985).
    fn cost(&self, sightings: &[Sighting], near: f64) -> f64 {
        let one = |s: &Sighting| {
            let square = self.miss(s).0.length_squared();
            if near.is_finite() { square / (1.0 + square / (near * near)) } else { square }
        };
        sightings.iter().map(one).sum()
    }
}

/// The pose downhill from one, and its cost.
pub(super) fn descend(mut pose: Pose, sightings: &[Sighting], size: DVec2, near: f64) -> (Pose, f64) {
    let (mut cost, mut damping) = (pose.cost(sightings, near), 1e-3);
    for _ in 0..STEPS {
        let (mut matrix, mut gradient) = ([[0.0; 7]; 7], [0.0; 7]);
        for s in sightings {
            let (off, jacobian) = pose.miss(s);
            let weight = if near.is_finite() { (1.0 + off.length_squared() / (near * near)).powi(-2) } else { 1.0 };
            for i in 0..7 {
                gradient[i] += weight * jacobian[i].dot(off);
                for j in 0..=i {
                    matrix[i][j] += weight * jacobian[i].dot(jacobian[j]);
                }
            }
        }
        let mut better = None;
        for _ in 0..8 {
            let mut damped = matrix;
            (0..7).for_each(|i| damped[i][i] += damping * damped[i][i].max(1e-12));
            let Some(step) = solve(damped, gradient.map(|g| -g)) else { break };
            let next = pose.moved(&step, size);
            let next_cost = next.cost(sightings, near);
            if next_cost < cost {
                better = Some((next, next_cost));
                damping = (0.2 * damping).max(1e-12);
                break;
            }
            damping *= 8.0;
        }
        let Some((next, next_cost)) = better else { break };
        let done = next_cost > cost * (1.0 - 1e-10);
        (pose, cost) = (next, next_cost);
        if done {
            break;
        }
    }
    (pose, cost)
}

/// `a x = b` for a symmetric, positive `a` (lower triangle), by Cholesky.
fn solve(mut a: [[f64; 7]; 7], mut b: [f64; 7]) -> Option<[f64; 7]> {
    for i in 0..7 {
        for j in 0..=i {
            let rest: f64 = (0..j).map(|k| a[i][k] * a[j][k]).sum();
            if i == j {
                let square = a[i][i] - rest;
                if square.is_nan() || square <= 0.0 {
                    return None;
                }
                a[i][i] = square.sqrt();
            } else {
                a[i][j] = (a[i][j] - rest) / a[j][j];
            }
        }
    }
    for i in 0..7 {
        b[i] = (b[i] - (0..i).map(|k| a[i][k] * b[k]).sum::<f64>()) / a[i][i];
    }
    for i in (0..7).rev() {
        b[i] = (b[i] - (i + 1..7).map(|k| a[k][i] * b[k]).sum::<f64>()) / a[i][i];
    }
    Some(b)
}
