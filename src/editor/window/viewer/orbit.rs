//! Free cameras: they turn about a point, go towards it, and slide beside it.

use crate::editor::look::Eye;
use crate::editor::shown::Shown;
use crate::scene::Camera;
use glam::{Quat, Vec2, Vec3};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// What it turns about; metres, world.
    pub target: Vec3,
    pub distance: f32,
    /// Radians, about the world's +Y.
    pub yaw: f32,
    /// Radians above the horizon.
    pub pitch: f32,
    /// Degrees.
    pub fov_y: f32,
}

/// No camera looks straight up or down: there is no way round from there.
const STEEPEST: f32 = 1.553;

impl Orbit {
    /// From where a picture was taken, about what it shows in its middle; `None` when that has no surfaces.
    pub fn around(shown: &Shown) -> Option<Self> {
        let samples = shown.samples.as_ref()?;
        let camera = &samples.camera;
        let (width, height) = (samples.width, samples.height);
        let middle = shown.point(width / 2, height / 2).map(|point| Vec3::from(point.position));
        let bounds = shown.scene.as_ref().map(|scene| scene.geometry.bounds());
        let target = middle.or(bounds.map(|(low, high)| 0.5 * (low + high)))?;
        Some(Self::of(camera, target))
    }

    fn of(camera: &Camera, target: Vec3) -> Self {
        let back = camera.position - target;
        let distance = back.length().max(1e-3);
        let pitch = (back.y / distance).asin().clamp(-STEEPEST, STEEPEST);
        Self { target, distance, yaw: back.x.atan2(back.z), pitch, fov_y: camera.fov_y.to_degrees().clamp(0.1, 170.0) }
    }

    fn back(&self) -> Vec3 {
        let (sin, cos) = self.pitch.sin_cos();
        Vec3::new(cos * self.yaw.sin(), sin, cos * self.yaw.cos())
    }

    pub fn eye(&self, size: [u32; 2]) -> Eye {
        let position = self.target + self.distance * self.back();
        Eye { position: position.to_array(), target: self.target.to_array(), fov_y: self.fov_y, size }
    }

    /// By a drag, in heights of the picture.
    pub fn turn(&mut self, by: Vec2) {
        self.yaw -= by.x * std::f32::consts::PI;
        self.pitch = (self.pitch + by.y * std::f32::consts::PI).clamp(-STEEPEST, STEEPEST);
    }

    /// Slides so that what lies at the target follows the pointer.
    pub fn slide(&mut self, by: Vec2) {
        let span = 2.0 * self.distance * (0.5 * self.fov_y.to_radians()).tan();
        let turn = Quat::from_rotation_y(self.yaw) * Quat::from_rotation_x(-self.pitch);
        self.target += turn * Vec3::new(-by.x, by.y, 0.0) * span;
    }

    /// Nearer by a factor.
    pub fn approach(&mut self, factor: f32) {
        self.distance = (self.distance / factor).clamp(1e-4, 1e7);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(orbit: &Orbit) -> Camera {
        let eye = orbit.eye([64, 48]);
        Camera::look_at("", eye.position.into(), eye.target.into(), eye.fov_y.to_radians())
    }

    #[test]
    fn it_starts_where_the_camera_is_and_slides_under_the_pointer() {
        let from = Camera::look_at("", Vec3::new(2.0, 3.0, 4.0), Vec3::new(0.0, 1.0, 0.0), 0.8);
        let mut orbit = Orbit::of(&from, Vec3::new(0.0, 1.0, 0.0));
        assert!(Vec3::from(orbit.eye([1, 1]).position).distance(from.position) < 1e-5);
        let (size, target) = (Vec2::new(640.0, 480.0), orbit.target);
        orbit.slide(Vec2::new(0.1, -0.05));
        let (now, _) = camera(&orbit).project(target, size).unwrap();
        assert!(now.distance(size * 0.5 + Vec2::new(48.0, -24.0)) < 0.5, "{now}");
        orbit.approach(2.0);
        assert!((orbit.distance - 0.5 * from.position.distance(target)).abs() < 1e-4);
        // What is turned goes with the pointer on the side that is seen.
        for by in [Vec2::new(0.1, 0.0), Vec2::new(0.0, 0.1)] {
            let near = orbit.target.lerp(orbit.eye([1, 1]).position.into(), 0.2);
            let mut turned = Orbit { ..orbit };
            turned.turn(by);
            let off = camera(&turned).project(near, size).unwrap().0 - 0.5 * size;
            let along = off.dot(by) / by.length();
            assert!(along > 5.0 && off.perp_dot(by).abs() < 0.1 * along, "{by}: {off}");
        }
        orbit.turn(Vec2::new(0.0, 99.0));
        assert!(camera(&orbit).world_from_camera.is_finite());
    }
}
