//! Whether two surface points of a picture lie on one surface, by position, normal and object: the range term of
//! bilateral filters over a picture (thesis 6.8, [SGN07]).

use crate::scene::{Camera, SurfacePoint};
use crate::transport::Samples;
use glam::Vec3;

/// A surface point as it is compared.
#[derive(Clone, Copy, Debug)]
pub struct Kin {
    pub position: Vec3,
    /// Zero where there is no surface.
    pub normal: Vec3,
    /// Of whatever number; `None` where objects are not known.
    pub object: Option<u32>,
    /// What a pixel covers across, metres.
    pub footprint: f32,
}

/// What a pixel covers of a plane that faces the camera at distance 1.
pub fn pixel_angle(camera: &Camera, height: usize) -> f32 {
    2.0 * (0.5 * camera.fov_y).tan() / height.max(1) as f32
}

impl Kin {
    pub fn new(point: &SurfacePoint, camera: &Camera, pixel_angle: f32) -> Self {
        let position = Vec3::from(point.position);
        let depth = (camera.position - position).dot(camera.world_from_camera.z_axis).abs();
        Self { position, normal: point.normal.into(), object: Some(point.object), footprint: depth * pixel_angle }
    }

    /// The sample nearest to the middle of each pixel.
    pub fn of_pixels(samples: &Samples) -> impl Fn(usize) -> Self + Sync + '_ {
        let (per_pixel, angle) = (samples.per_pixel(), pixel_angle(&samples.camera, samples.height));
        let middle = samples.down / 2 * samples.across + samples.across / 2;
        move |pixel| Self::new(&samples.points[pixel * per_pixel + middle], &samples.camera, angle)
    }

    /// [0, 1], the same either way round: 1 on one flat surface, and where neither point has one; 0 across a step of
    /// two pixels or a crease of 60 degrees. A step is what a curve of these normals does not explain. Between objects
    /// it may be a tenth of that, so that boards of one floor are one surface and a card before a wall is not.
    pub fn with(&self, other: &Self) -> f32 {
        let (a, b) = (self.normal, other.normal);
        match (a == Vec3::ZERO, b == Vec3::ZERO) {
            (false, false) => {}
            (true, true) => return 1.0,
            _ => return 0.0,
        }
        let crease = 2.0 * a.dot(b) - 1.0;
        if crease <= 0.0 {
            return 0.0;
        }
        let between = other.position - self.position;
        let off = between.dot(a).abs().max(between.dot(b).abs()) - 0.6 * between.length() * (a - b).length();
        let same = self.object.is_none() || other.object.is_none() || self.object == other.object;
        let allowed = if same { 1.0 } else { 0.1 } * self.footprint.max(other.footprint) + 1e-6;
        crease.min(1.0) * (2.0 - off / allowed).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kin(position: [f32; 3], normal: [f32; 3], object: u32) -> Kin {
        Kin { position: position.into(), normal: Vec3::from(normal), object: Some(object), footprint: 0.01 }
    }

    #[test]
    fn one_surface_or_two() {
        let up = [0.0, 1.0, 0.0];
        let here = kin([0.0; 3], up, 1);
        assert_eq!(here.with(&kin([3.0, 0.0, 0.0], up, 1)), 1.0);
        assert_eq!(here.with(&kin([0.1, 0.005, 0.0], up, 1)), 1.0, "half a pixel of step");
        assert_eq!(here.with(&kin([0.1, 0.025, 0.0], up, 1)), 0.0, "a step");
        assert_eq!(here.with(&kin([0.1, 0.0, 0.0], up, 2)), 1.0, "boards of one floor");
        assert_eq!(here.with(&kin([0.1, 0.005, 0.0], up, 2)), 0.0, "a card on it");
        assert_eq!(here.with(&kin([0.0; 3], [1.0, 0.0, 0.0], 1)), 0.0, "a corner");
        assert_eq!(here.with(&kin([0.0; 3], [0.0; 3], u32::MAX)), 0.0, "the sky");
        let sky = kin([0.0; 3], [0.0; 3], u32::MAX);
        assert_eq!(sky.with(&sky), 1.0);
        // A ball of 1 m: far along it, still on it.
        let ball = |angle: f32| kin([angle.sin(), angle.cos(), 0.0], [angle.sin(), angle.cos(), 0.0], 3);
        assert!(ball(0.0).with(&ball(0.4)) > 0.8);
        assert_eq!(ball(0.0).with(&ball(0.4)), ball(0.4).with(&ball(0.0)));
    }
}
