//! `builtin:room`: a box with a red and a teal wall, for colour bleeding.

use super::builder::Builder;
use crate::scene::{Camera, Light, LightKind, Material, Scene};
use glam::Vec3;

/// A room of 4 x 3 x 4 m, open towards the camera: a red wall on the left, a teal one on the right, an ochre block, a
/// polished ball, a small pedestal; a spot light on the red wall, a soft ceiling panel.
pub fn room() -> Scene {
    let mut room = Builder::default();
    let plaster = room.material("plaster", Material::matte([0.74, 0.72, 0.68]));
    let boards = room.material("boards", Material::matte([0.42, 0.33, 0.25]));
    let red = room.material("red", Material::matte([0.62, 0.05, 0.04]));
    let teal = room.material("teal", Material::matte([0.06, 0.34, 0.36]));
    let ochre = room.material("ochre", Material::matte([0.70, 0.52, 0.22]));
    let lacquer = Material { roughness: 0.32, specular: 1.0, ..Material::matte([0.55, 0.57, 0.62]) };
    let lacquer = room.material("lacquer", lacquer);
    let stone = room.material("stone", Material::matte([0.5, 0.5, 0.48]));
    let panel = room.material("panel", Material { emission: [6.0, 5.6, 5.0], ..Material::matte([0.8; 3]) });

    let (x, y, z) = (2.0, 3.0, 2.0);
    let v = Vec3::new;
    room.quad("floor", boards, [v(-x, 0.0, z), v(x, 0.0, z), v(x, 0.0, -z), v(-x, 0.0, -z)]);
    room.quad("ceiling", plaster, [v(-x, y, -z), v(x, y, -z), v(x, y, z), v(-x, y, z)]);
    room.quad("back_wall", plaster, [v(-x, 0.0, -z), v(x, 0.0, -z), v(x, y, -z), v(-x, y, -z)]);
    room.quad("left_wall", red, [v(-x, 0.0, z), v(-x, 0.0, -z), v(-x, y, -z), v(-x, y, z)]);
    room.quad("right_wall", teal, [v(x, 0.0, -z), v(x, 0.0, z), v(x, y, z), v(x, y, -z)]);
    room.cuboid("block", ochre, v(-0.85, 0.75, -0.55), v(0.9, 1.5, 0.9), 0.35);
    room.cuboid("pedestal", stone, v(0.9, 0.2, 0.35), v(0.8, 0.4, 0.8), -0.25);
    room.ball("ball", lacquer, v(0.9, 0.4 + 0.42, 0.35), 0.42);
    room.quad(
        "panel",
        panel,
        [v(0.5, y - 0.01, -1.2), v(1.4, y - 0.01, -1.2), v(1.4, y - 0.01, -0.3), v(0.5, y - 0.01, -0.3)],
    );

    let key = LightKind::Spot {
        position: v(0.4, 2.6, 1.8),
        direction: (v(-2.0, 1.15, 0.55) - v(0.4, 2.6, 1.8)).normalize(),
        inner: 0.34,
        outer: 0.5,
    };
    let lights = vec![Light { name: "key".into(), kind: key, intensity: Vec3::new(70.0, 63.0, 54.0) }];
    let camera = Camera::look_at("main", v(0.0, 1.5, 5.95), v(0.0, 1.45, 0.0), 38f32.to_radians());
    room.finish(lights, vec![camera])
}
