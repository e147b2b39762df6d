//! Environments that ship in the program: latitude-longitude maps made here, no file needed.

use crate::scene::LatLong;
use glam::Vec3;
use std::f32::consts::{PI, TAU};

const WIDTH: usize = 1024;
const HEIGHT: usize = 512;

type Radiance = fn(Vec3) -> Vec3;

/// Of each: its name and its radiance by direction.
const SKIES: &[(&str, Radiance)] = &[("lamps", lamps), ("sky", sky)];

pub fn names() -> impl Iterator<Item = &'static str> {
    SKIES.iter().map(|(name, _)| *name)
}

pub fn map(name: &str) -> Option<LatLong> {
    let (_, radiance) = SKIES.iter().find(|(known, _)| *known == name)?;
    let pixels = (0..WIDTH * HEIGHT).map(|i| {
        let azimuth = ((i % WIDTH) as f32 + 0.5) / WIDTH as f32 * TAU - PI;
        let elevation = 0.5 * PI - ((i / WIDTH) as f32 + 0.5) / HEIGHT as f32 * PI;
        radiance(direction(azimuth, elevation)).to_array()
    });
    LatLong::new(WIDTH, HEIGHT, pixels.collect()).ok()
}

/// Angles in radians; azimuth from +X towards +Z.
fn direction(azimuth: f32, elevation: f32) -> Vec3 {
    Vec3::new(elevation.cos() * azimuth.cos(), elevation.sin(), elevation.cos() * azimuth.sin())
}

fn from_degrees(azimuth: f32, elevation: f32) -> Vec3 {
    direction(azimuth.to_radians(), elevation.to_radians())
}

/// 0 below `from`, 1 above `to`, smooth between.
fn step(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// An even day: blue above, pale at the horizon, dark ground, and a sun disc of 6 degrees across with a soft rim, at 40
/// degrees above the horizon between +X and +Z. The sun gives 3.4 W/m² to a surface that faces it, the sky 2.
fn sky(towards: Vec3) -> Vec3 {
    let horizon = Vec3::new(0.80, 0.85, 0.92);
    let zenith = Vec3::new(0.26, 0.44, 0.86);
    let ground = Vec3::new(0.13, 0.12, 0.11);
    let air = horizon.lerp(zenith, towards.y.max(0.0).sqrt());
    let angle = towards.angle_between(from_degrees(35.0, 40.0)).to_degrees();
    let sun = Vec3::new(420.0, 385.0, 330.0) * (1.0 - step(2.75, 3.25, angle));
    ground.lerp(air, step(-0.03, 0.03, towards.y)) + sun
}

/// Darkness with three lamps on the side of +Z: a warm disc of 8 degrees across (2.2 W/m² to a surface that faces it), a
/// wide cool panel of 24 x 16 degrees (1.1 W/m²) and a small green disc of 4 degrees across (0.5 W/m²).
fn lamps(towards: Vec3) -> Vec3 {
    let darkness = Vec3::new(0.006, 0.007, 0.009);
    let disc =
        |azimuth, elevation, radius: f32| towards.angle_between(from_degrees(azimuth, elevation)) < radius.to_radians();
    let centre = from_degrees(130.0, 22.0);
    let right = Vec3::Y.cross(centre).normalize();
    let (across, along) = (towards.dot(right), towards.dot(centre.cross(right)));
    let half = |degrees: f32| degrees.to_radians().sin();
    let panel = towards.dot(centre) > 0.0 && across.abs() < half(12.0) && along.abs() < half(8.0);
    let warm = if disc(48.0, 35.0, 4.0) { Vec3::new(170.0, 140.0, 95.0) } else { Vec3::ZERO };
    let cool = if panel { Vec3::new(6.0, 9.5, 14.0) } else { Vec3::ZERO };
    let green = if disc(88.0, 58.0, 2.0) { Vec3::new(70.0, 160.0, 90.0) } else { Vec3::ZERO };
    darkness + warm + cool + green
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skies_are_as_bright_as_they_say() {
        assert_eq!(names().collect::<Vec<_>>(), ["lamps", "sky"]);
        assert!(map("night").is_none());
        // Light from a lamp alone, on a surface that faces it: green channel.
        let lit = |name: &str, towards: Vec3, radius: f32| {
            let environment = map(name).unwrap().cube(128, 0.0, 1.0).unwrap();
            let texels = environment.radiance.iter().enumerate();
            let near = texels.map(|(i, texel)| (super::super::super::cube::texel_point(i, 128).normalize(), texel));
            near.filter(|(at, _)| at.angle_between(towards).to_degrees() < radius)
                .map(|(at, texel)| texel[1] * texel[3] * at.dot(towards))
                .sum::<f32>()
        };
        for (name, azimuth, elevation, radius, expected) in [
            ("sky", 35.0, 40.0, 4.5, 3.3),
            ("lamps", 48.0, 35.0, 6.0, 2.2),
            ("lamps", 130.0, 22.0, 16.0, 1.1),
            ("lamps", 88.0, 58.0, 4.0, 0.6),
        ] {
            let found = lit(name, from_degrees(azimuth, elevation), radius);
            assert!((found - expected).abs() < 0.05 * expected, "{name}: {found}, not {expected}");
        }
    }
}
