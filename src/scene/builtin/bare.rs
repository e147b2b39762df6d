//! `builtin:bare`: an empty room with a ceiling that glows, for what light without shadows costs.

use super::builder::Builder;
use crate::scene::{Camera, Material, Scene};
use glam::Vec3;

/// A closed room of 4 x 3 x 4 m with nothing in it, lit evenly by its ceiling. No lamps.
pub fn bare() -> Scene {
    let mut room = Builder::default();
    let plaster = room.material("plaster", Material::matte([0.74, 0.72, 0.68]));
    let boards = room.material("boards", Material::matte([0.42, 0.33, 0.25]));
    let panel = room.material("panel", Material { emission: [1.5, 1.4, 1.3], ..Material::matte([0.8; 3]) });
    let (x, y, z) = (2.0, 3.0, 2.0);
    let v = Vec3::new;
    room.quad("floor", boards, [v(-x, 0.0, z), v(x, 0.0, z), v(x, 0.0, -z), v(-x, 0.0, -z)]);
    room.quad("ceiling", panel, [v(-x, y, -z), v(x, y, -z), v(x, y, z), v(-x, y, z)]);
    room.quad("back_wall", plaster, [v(-x, 0.0, -z), v(x, 0.0, -z), v(x, y, -z), v(-x, y, -z)]);
    room.quad("front_wall", plaster, [v(x, 0.0, z), v(-x, 0.0, z), v(-x, y, z), v(x, y, z)]);
    room.quad("left_wall", plaster, [v(-x, 0.0, z), v(-x, 0.0, -z), v(-x, y, -z), v(-x, y, z)]);
    room.quad("right_wall", plaster, [v(x, 0.0, -z), v(x, 0.0, z), v(x, y, z), v(x, y, -z)]);
    let camera = Camera::look_at("main", v(0.0, 1.6, 1.9), v(0.0, 1.3, -1.0), 60f32.to_radians());
    room.finish(Vec::new(), vec![camera])
}
