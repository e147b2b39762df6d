//! A pinhole camera.

use glam::{Mat3, Vec3};

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
}
