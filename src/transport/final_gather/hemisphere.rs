//! Rays over the hemisphere of a place in strata of equal cosine-weighted solid angle, and what they say together:
//! irradiance, and how it changes with place and with the normal (Ward and Heckbert 1992, eqs. for stratified rays).

use crate::kernels::trace_rays::{FAR, RayRecord};
use crate::scene::SurfacePoint;
use crate::transport::light_cache::Gradients;
use crate::transport::sampling;
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::{FRAC_1_PI, TAU};

/// Cells of a hemisphere: `elevations` by `azimuths`, each with one ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strata {
    pub elevations: u32,
    pub azimuths: u32,
}

impl Strata {
    /// At most `rays`, and at least half of them; cells about as wide as high.
    pub fn of(rays: u32) -> Self {
        let rays = rays.max(1);
        let elevations = ((rays as f32 * FRAC_1_PI).sqrt().round() as u32).max(1);
        Self { elevations, azimuths: (rays / elevations).max(1) }
    }

    pub fn rays(self) -> usize {
        (self.elevations * self.azimuths) as usize
    }
}

/// The hemisphere of one place.
pub struct Hemisphere {
    strata: Strata,
    normal: Vec3,
    axes: (Vec3, Vec3),
    origin: Vec3,
    geometric: Vec3,
    exists: bool,
}

impl Hemisphere {
    /// `lift`: as `Geometry::lift`.
    pub fn new(place: &SurfacePoint, strata: Strata, lift: f32) -> Self {
        let normal = Vec3::from(place.normal);
        let geometric = Vec3::from(place.geometric_normal);
        Self {
            strata,
            normal,
            axes: sampling::frame(normal),
            origin: sampling::lifted(place.position.into(), geometric, lift),
            geometric,
            exists: place.exists(),
        }
    }

    /// Fills in one ray a cell, azimuths of the uppermost elevation first; `seed` says where in its cell.
    pub fn rays(&self, seed: u32, rays: &mut [RayRecord]) {
        let Strata { elevations, azimuths } = self.strata;
        for (i, out) in rays.iter_mut().enumerate() {
            let (j, k) = (i as u32 / azimuths, i as u32 % azimuths);
            let within = sampling::shift(seed ^ (i as u32).wrapping_mul(0x9e37_79b9));
            let cell = Vec2::new(j as f32, k as f32) + within;
            let at = cell / Vec2::new(elevations as f32, azimuths as f32);
            let local = sampling::cosine_direction(at);
            let direction = self.axes.0 * local.x + self.axes.1 * local.y + self.normal * local.z;
            // Interpolated normals tilt some rays below the triangle itself.
            let is_above = self.exists && direction.dot(self.geometric) > 0.0;
            *out = match is_above {
                true => RayRecord {
                    origin: self.origin.to_array(),
                    t_max: FAR,
                    direction: direction.to_array(),
                    t_min: 0.0,
                },
                false => RayRecord::NONE,
            };
        }
    }

    /// What the rays' light says. `exitance`: of what each ray met, W/m²; `distances`: to there, m.
    pub fn gradients(&self, exitance: &[Vec4], distances: &[f32]) -> Gradients {
        let Strata { elevations, azimuths } = self.strata;
        let (m, n) = (elevations as usize, azimuths as usize);
        let share = 1.0 / (m * n) as f32;
        let mut all = Gradients::default();
        // sin, at the borders between elevations.
        let sin = |j: usize| (j as f32 / m as f32).sqrt();
        let (x, y) = self.axes;
        for k in 0..n {
            let before = (k + n - 1) % n;
            let (mut along, mut across, mut turned, mut value) = (Vec4::ZERO, Vec4::ZERO, Vec4::ZERO, Vec4::ZERO);
            for j in 0..m {
                let here = exitance[j * n + k];
                value += here;
                let middle = (j as f32 + 0.5) / m as f32;
                turned += here * (middle / (1.0 - middle)).sqrt();
                let distance = distances[j * n + k];
                if j > 0 {
                    let border = sin(j);
                    let nearest = distance.min(distances[(j - 1) * n + k]);
                    along += (here - exitance[(j - 1) * n + k]) * (border * (1.0 - border * border) / nearest);
                }
                let nearest = distance.min(distances[j * n + before]);
                across += (here - exitance[j * n + before]) * ((sin(j + 1) - sin(j)) / nearest);
            }
            let angle = |k: f32| {
                let (sin, cos) = (TAU * k / n as f32).sin_cos();
                x * cos + y * sin
            };
            let outwards = angle(k as f32 + 0.5);
            let sideways = self.normal.cross(outwards);
            let border = self.normal.cross(angle(k as f32));
            all.value += value * share;
            add(&mut all.turned, sideways, turned * share);
            add(&mut all.moved, outwards, along * (TAU / n as f32 * FRAC_1_PI));
            add(&mut all.moved, border, across * FRAC_1_PI);
        }
        all
    }

    /// Adds light that comes from a single place `way` off, whose surface has that normal: `light`, the irradiance that it
    /// gives here, which must not be dark.
    pub fn add_place(&self, all: &mut Gradients, light: Vec4, way: Vec3, normal: Vec3) {
        let squared = way.length_squared();
        all.value += light;
        // The derivative of (way . normal here) (way . normal there) / |way|^4 over itself, where a move shortens the way.
        let moved = way * (4.0 / squared) - self.normal / way.dot(self.normal) - normal / way.dot(normal);
        add(&mut all.moved, moved - self.normal * moved.dot(self.normal), light);
        add(&mut all.turned, self.normal.cross(way) / way.dot(self.normal), light);
    }

    /// Where rays start.
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    pub fn geometric(&self) -> Vec3 {
        self.geometric
    }

    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Harmonic mean of the distances, and the least of them, m.
    pub fn reach(distances: &[f32]) -> [f32; 2] {
        let inverse: f32 = distances.iter().map(|distance| 1.0 / distance).sum();
        [distances.len() as f32 / inverse.max(1e-30), distances.iter().copied().fold(FAR, f32::min)]
    }
}

fn add(to: &mut [Vec4; 3], direction: Vec3, light: Vec4) {
    to[0] += light * direction.x;
    to[1] += light * direction.y;
    to[2] += light * direction.z;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light from a smooth field of exitance over a room around the origin: a value and first derivatives that the rays
    /// must find.
    struct Room;

    impl Room {
        /// A sphere of radius 2 about the origin; brighter towards +x and up.
        fn exitance(place: Vec3, ray: &RayRecord) -> (Vec4, f32) {
            let direction = Vec3::from(ray.direction);
            let b = place.dot(direction);
            let t = -b + (b * b - place.length_squared() + 4.0).sqrt();
            let hit = place + direction * t;
            (Vec4::splat(2.0 + hit.x + 0.7 * hit.y * hit.y + 0.3 * hit.z), t)
        }

        fn gradients(place: Vec3, normal: Vec3, strata: Strata, seed: u32) -> Gradients {
            let point = SurfacePoint {
                position: place.to_array(),
                normal: normal.to_array(),
                geometric_normal: normal.to_array(),
                object: 0,
                ..SurfacePoint::NOWHERE
            };
            let hemisphere = Hemisphere::new(&point, strata, 0.0);
            let mut rays = vec![RayRecord::NONE; strata.rays()];
            hemisphere.rays(seed, &mut rays);
            let (light, distances): (Vec<_>, Vec<_>) = rays.iter().map(|ray| Self::exitance(place, ray)).unzip();
            hemisphere.gradients(&light, &distances)
        }
    }

    #[test]
    fn strata_hold_about_as_many_rays_as_asked() {
        for rays in 1..5000 {
            let found = Strata::of(rays).rays() as u32;
            assert!(found <= rays && 2 * found >= rays, "{rays}: {found}");
        }
    }

    /// Against differences of the irradiance itself, found with many rays.
    #[test]
    fn gradients_are_those_of_the_irradiance() {
        let many = Strata::of(60_000);
        for (place, normal) in [
            (Vec3::new(0.3, -0.2, 0.4), Vec3::Y),
            (Vec3::new(-0.5, 0.1, 0.2), Vec3::new(0.6, 0.0, 0.8)),
            (Vec3::new(0.2, 0.6, -0.3), Vec3::new(-0.48, -0.6, 0.64)),
        ] {
            let value = |place: Vec3, normal: Vec3| Room::gradients(place, normal, many, 1).value.x;
            let found = Room::gradients(place, normal, Strata::of(4096), 7);
            assert!((found.value.x / value(place, normal) - 1.0).abs() < 2e-3);
            let (u, v) = sampling::frame(normal);
            let size = found.moved.map(|g| g.x.abs()).into_iter().fold(0.3, f32::max);
            for axis in [u, v] {
                let step = 0.05;
                let truth = (value(place + axis * step, normal) - value(place - axis * step, normal)) / (2.0 * step);
                let moved = found.at(axis, Vec3::ZERO).x - found.value.x;
                assert!((moved - truth).abs() < 0.1 * size, "along {axis}: {moved}, by differences {truth}");
                let turned = |angle: f32| (normal * angle.cos() + axis.cross(normal) * angle.sin()).normalize();
                let truth = (value(place, turned(step)) - value(place, turned(-step))) / (2.0 * step);
                let turn = found.at(Vec3::ZERO, axis).x - found.value.x;
                assert!((turn - truth).abs() < 0.05 * found.value.x, "about {axis}: {turn}, by differences {truth}");
            }
            // The plane's own direction has no say.
            assert!((found.at(normal, Vec3::ZERO).x - found.value.x).abs() < 1e-4);
        }
    }
}
