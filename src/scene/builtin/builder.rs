//! Puts a built-in scene together from simple shapes.

use crate::scene::geometry::{GeometryBuilder, Mesh};
use crate::scene::{Camera, Light, Material, Scene};
use glam::{Mat4, Quat, Vec2, Vec3};
use std::sync::Arc;

pub struct Builder {
    geometry: GeometryBuilder,
    materials: Vec<Material>,
    /// Of what is made next, in the world.
    place: Mat4,
    /// That a turned shape has around its axis.
    pub segments: u32,
}

impl Default for Builder {
    fn default() -> Self {
        Self { geometry: GeometryBuilder::default(), materials: Vec::new(), place: Mat4::IDENTITY, segments: 96 }
    }
}

impl Builder {
    /// For a scene in which something moves.
    pub fn moving() -> Self {
        Self { geometry: GeometryBuilder::of_moving(), ..Self::default() }
    }

    /// What `make` makes stands in a place against what is being made.
    pub fn placed(&mut self, place: Mat4, make: impl FnOnce(&mut Self)) {
        let before = self.place;
        self.place = before * place;
        make(self);
        self.place = before;
    }

    pub fn material(&mut self, name: &str, material: Material) -> u32 {
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
        self.geometry.add(object, &mesh, self.place * place).expect("built-in meshes are sound");
    }

    /// Counter-clockwise as seen from the front.
    pub fn quad(&mut self, object: &str, material: u32, corners: [Vec3; 4]) {
        self.mesh(object, material, &corners.map(|c| c.to_array()), None, &[0, 1, 2, 0, 2, 3], Mat4::IDENTITY);
    }

    /// `turn`: radians about +Y.
    pub fn cuboid(&mut self, object: &str, material: u32, centre: Vec3, size: Vec3, turn: f32) {
        let place = Mat4::from_scale_rotation_translation(size, Quat::from_rotation_y(turn), centre);
        for (axis, sign) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
            let normal = Vec3::AXES[axis] * sign;
            let (a, b) = (Vec3::AXES[(axis + 1) % 3] * sign, Vec3::AXES[(axis + 2) % 3]);
            let corner = |s: f32, t: f32| ((normal + a * s + b * t) * 0.5).to_array();
            let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            self.mesh(object, material, &corners, None, &[0, 1, 2, 0, 2, 3], place);
        }
    }

    pub fn ball(&mut self, object: &str, material: u32, centre: Vec3, radius: f32) {
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

    /// Turns a profile about the upright axis through `foot`: points of (radius, height), so ordered that the outside lies
    /// to the right of the way. Smooth along the profile where `smooth`, with an edge at each of its points otherwise.
    pub fn lathe(&mut self, object: &str, material: u32, foot: Vec3, profile: &[Vec2], smooth: bool) {
        let segments = self.segments;
        let last = profile.len() - 1;
        let place = Mat4::from_translation(foot);
        for band in 0..last {
            let at = |i: usize| {
                let (from, to) = if smooth { (i.saturating_sub(1), (i + 1).min(last)) } else { (band, band + 1) };
                let along = profile[to] - profile[from];
                (profile[i], Vec2::new(along.y, -along.x).normalize_or_zero())
            };
            let ring = |(point, normal): (Vec2, Vec2)| {
                (0..segments).map(move |segment| {
                    let (sin, cos) = (std::f32::consts::TAU * segment as f32 / segments as f32).sin_cos();
                    let turned = |p: Vec2| [p.x * sin, p.y, p.x * cos];
                    (turned(point), turned(normal))
                })
            };
            let (positions, normals): (Vec<_>, Vec<_>) = ring(at(band)).chain(ring(at(band + 1))).unzip();
            let indices: Vec<u32> = (0..segments)
                .flat_map(|s| {
                    let (a, b) = (s, (s + 1) % segments);
                    let (c, d) = (b + segments, a + segments);
                    // Of a band that ends on the axis, one triangle has no area.
                    let lower = (profile[band].x > 0.0).then_some([a, b, c]);
                    let upper = (profile[band + 1].x > 0.0).then_some([a, c, d]);
                    lower.into_iter().chain(upper).flatten()
                })
                .collect();
            self.mesh(object, material, &positions, Some(&normals), &indices, place);
        }
    }

    /// A torus: a tube around a circle about `axis`, which has length 1.
    pub fn ring(&mut self, object: &str, material: u32, centre: Vec3, axis: Vec3, radius: f32, tube: f32) {
        const AROUND: u32 = 72;
        const ACROSS: u32 = 16;
        let turn = |step: u32, steps: u32| (std::f32::consts::TAU * step as f32 / steps as f32).sin_cos();
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        for (s, t) in (0..AROUND).flat_map(|s| (0..ACROSS).map(move |t| (s, t))) {
            let ((sin, cos), (rise, out)) = (turn(s, AROUND), turn(t, ACROSS));
            let away = Vec3::new(sin, 0.0, cos);
            let normal = away * out + Vec3::Y * rise;
            positions.push((away * radius + normal * tube).to_array());
            normals.push(normal.to_array());
        }
        let at = |s: u32, t: u32| (s % AROUND) * ACROSS + t % ACROSS;
        let indices: Vec<u32> = (0..AROUND)
            .flat_map(|s| (0..ACROSS).map(move |t| (s, t)))
            .flat_map(|(s, t)| [at(s, t), at(s + 1, t), at(s + 1, t + 1), at(s, t), at(s + 1, t + 1), at(s, t + 1)])
            .collect();
        let place = Mat4::from_rotation_translation(Quat::from_rotation_arc(Vec3::Y, axis), centre);
        self.mesh(object, material, &positions, Some(&normals), &indices, place);
    }

    pub fn finish(self, lights: Vec<Light>, cameras: Vec<Camera>) -> Scene {
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
