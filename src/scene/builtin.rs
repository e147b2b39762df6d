//! Scenes that ship in the program: made here, no file needed.

use crate::scene::geometry::{GeometryBuilder, Mesh};
use crate::scene::{Camera, Light, LightKind, Material, Scene};
use glam::{Mat4, Quat, Vec3};
use std::sync::Arc;

pub const NAMES: &[&str] = &["room"];

pub fn scene(name: &str) -> Option<Scene> {
    (name == "room").then(room)
}

/// A room of 4 x 3 x 4 m, open towards the camera: a red wall on the left, a teal one on the right, an ochre block, a
/// polished ball, a small pedestal; a spot light on the red wall, a soft ceiling panel.
fn room() -> Scene {
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

#[derive(Default)]
struct Builder {
    geometry: GeometryBuilder,
    materials: Vec<Material>,
}

impl Builder {
    fn material(&mut self, name: &str, material: Material) -> u32 {
        self.materials.push(Material { name: name.into(), ..material });
        self.materials.len() as u32 - 1
    }

    fn mesh(
        &mut self,
        object: &str,
        material: u32,
        positions: &[[f32; 3]],
        normals: Option<&[[f32; 3]]>,
        indices: &[u32],
        place: Mat4,
    ) {
        let object = self.geometry.object(object);
        let mesh = Mesh { positions, normals, uvs: None, indices, material };
        self.geometry.add(object, &mesh, place).expect("built-in meshes are sound");
    }

    /// Counter-clockwise as seen from the front.
    fn quad(&mut self, object: &str, material: u32, corners: [Vec3; 4]) {
        self.mesh(object, material, &corners.map(|c| c.to_array()), None, &[0, 1, 2, 0, 2, 3], Mat4::IDENTITY);
    }

    /// `turn`: radians about +Y.
    fn cuboid(&mut self, object: &str, material: u32, centre: Vec3, size: Vec3, turn: f32) {
        let place = Mat4::from_scale_rotation_translation(size, Quat::from_rotation_y(turn), centre);
        for (axis, sign) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
            let normal = Vec3::AXES[axis] * sign;
            let (a, b) = (Vec3::AXES[(axis + 1) % 3] * sign, Vec3::AXES[(axis + 2) % 3]);
            let corner = |s: f32, t: f32| ((normal + a * s + b * t) * 0.5).to_array();
            let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            self.mesh(object, material, &corners, None, &[0, 1, 2, 0, 2, 3], place);
        }
    }

    fn ball(&mut self, object: &str, material: u32, centre: Vec3, radius: f32) {
        const RINGS: u32 = 48;
        const SEGMENTS: u32 = 96;
        let unit: Vec<[f32; 3]> = (0..=RINGS)
            .flat_map(|ring| {
                let (sin, cos) = (std::f32::consts::PI * ring as f32 / RINGS as f32).sin_cos();
                (0..SEGMENTS).map(move |segment| {
                    let (s, c) = (std::f32::consts::TAU * segment as f32 / SEGMENTS as f32).sin_cos();
                    [sin * s, cos, sin * c]
                })
            })
            .collect();
        let at = |ring: u32, segment: u32| ring * SEGMENTS + segment % SEGMENTS;
        let indices: Vec<u32> = (0..RINGS)
            .flat_map(|ring| (0..SEGMENTS).map(move |segment| (ring, segment)))
            .flat_map(|(r, s)| {
                let upper = [at(r, s), at(r + 1, s), at(r + 1, s + 1)];
                let lower = [at(r, s), at(r + 1, s + 1), at(r, s + 1)];
                // At the poles one of the two has no area.
                let mut both = Vec::new();
                if r + 1 < RINGS {
                    both.extend(upper);
                }
                if r > 0 {
                    both.extend(lower);
                }
                both
            })
            .collect();
        let place = Mat4::from_scale_rotation_translation(Vec3::splat(radius), Quat::IDENTITY, centre);
        self.mesh(object, material, &unit, Some(&unit), &indices, place);
    }

    fn finish(self, lights: Vec<Light>, cameras: Vec<Camera>) -> Scene {
        let names = self.materials.iter().map(|material| material.name.clone()).collect();
        let geometry = self.geometry.finish(names).expect("built-in scenes have triangles");
        Scene {
            geometry: Arc::new(geometry),
            materials: Arc::new(self.materials),
            lights: Arc::new(lights),
            cameras: Arc::new(cameras),
        }
    }
}
