//! A pinhole camera.

use super::bvh::Ray;
use glam::{Mat3, Vec2, Vec3};

/// Looks along its own -Z with +Y up (glTF).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Camera {
    pub name: String,
    /// Metres, world.
    pub position: Vec3,
    /// Columns: the camera's right, up and backward axes in world space.
    pub world_from_camera: Mat3,
    /// Vertical field of view, radians.
    pub fov_y: f32,
}

impl Camera {
    /// Looks from `position` at `target`, with the world's +Y as up (or +Z when looking straight up or down).
    pub fn look_at(name: &str, position: Vec3, target: Vec3, fov_y: f32) -> Self {
        let back = (position - target).normalize_or(Vec3::Z);
        let up = if back.y.abs() > 0.9999 { Vec3::Z } else { Vec3::Y };
        let right = up.cross(back).normalize();
        let world_from_camera = Mat3::from_cols(right, back.cross(right), back);
        Self { name: name.to_owned(), position, world_from_camera, fov_y }
    }

    /// Half of the picture's width and height, one unit in front of the camera.
    fn half(&self, size: Vec2) -> Vec2 {
        (0.5 * self.fov_y).tan() * Vec2::new(size.x / size.y, 1.0)
    }

    /// The ray through a place of a picture of `size` pixels; `at` counts from its upper left corner.
    pub fn ray(&self, at: Vec2, size: Vec2) -> Ray {
        let across = (2.0 * at / size - 1.0) * self.half(size);
        let direction = self.world_from_camera * Vec3::new(across.x, -across.y, -1.0);
        Ray { origin: self.position, direction, t_max: f32::INFINITY }
    }

    /// Where a point lies in a picture of `size` pixels, and how far in front of the camera (m); `None` when it lies
    /// behind.
    pub fn project(&self, point: Vec3, size: Vec2) -> Option<(Vec2, f32)> {
        let inside = self.world_from_camera.transpose() * (point - self.position);
        let depth = -inside.z;
        let across = Vec2::new(inside.x, -inside.y) / depth / self.half(size);
        (depth > 0.0 && across.is_finite()).then(|| (0.5 * (across + 1.0) * size, depth))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_ray_lie_where_it_goes_through() {
        let camera = Camera::look_at("", Vec3::new(1.0, 2.0, 5.0), Vec3::new(0.0, 1.0, -1.0), 0.7);
        let size = Vec2::new(640.0, 480.0);
        assert!(camera.project(Vec3::new(0.0, 1.0, -1.0), size).unwrap().0.distance(size / 2.0) < 1e-3);
        for at in [Vec2::new(3.0, 470.0), Vec2::new(320.0, 10.0), Vec2::new(-50.0, 900.0)] {
            let ray = camera.ray(at, size);
            let (found, depth) = camera.project(ray.origin + 7.0 * ray.direction, size).unwrap();
            assert!(found.distance(at) < 1e-2 && (depth - 7.0).abs() < 1e-4, "{found} for {at}");
        }
        assert!(camera.project(Vec3::new(1.0, 2.0, 6.0), size).is_none(), "behind");
    }
}
