//! `builtin:hall`: glossy things between a blue and a sand-coloured wall, for edits on glossy receivers.

use super::builder::Builder;
use crate::scene::{Camera, Light, LightKind, Material, Scene};
use glam::{Vec2, Vec3};

const STEPS: usize = 6;

/// A hall of 5.6 x 3.2 x 4.8 m, open towards the camera: sand-coloured wall on the left, blue on the right, sky-blue
/// ceiling. Polished stairs run up the left wall under a hanging drum, an urn of the same gloss stands beside them; in
/// front of the blue wall a polished cone and ball, and a matte box. Spot lights on both walls, on the ball and up to the
/// ceiling, a soft panel. Cameras: `main`, `stairs` (stairs, drum, urn) and `shapes` (ball, cone, box).
pub fn hall() -> Scene {
    let mut hall = Builder::default();
    let gloss =
        |colour, roughness, metallic| Material { roughness, metallic, specular: 1.0, ..Material::matte(colour) };
    let plaster = hall.material("plaster", Material::matte([0.70, 0.69, 0.66]));
    let screed = hall.material("screed", Material::matte([0.52, 0.50, 0.47]));
    let sky = hall.material("sky", Material::matte([0.42, 0.56, 0.74]));
    let sand = hall.material("sand", Material::matte([0.70, 0.50, 0.30]));
    let blue = hall.material("blue", Material::matte([0.06, 0.15, 0.62]));
    let chalk = hall.material("chalk", Material::matte([0.76, 0.74, 0.70]));
    let marble = hall.material("marble", gloss([0.56, 0.54, 0.52], 0.2, 0.3));
    let glaze = hall.material("glaze", gloss([0.48, 0.50, 0.48], 0.16, 0.4));
    let enamel = hall.material("enamel", gloss([0.70, 0.68, 0.66], 0.22, 0.35));
    let amber = hall.material("amber", gloss([0.80, 0.38, 0.10], 0.25, 0.0));
    let drum = hall.material("drum", Material::matte([0.60, 0.58, 0.55]));
    let panel = hall.material("panel", Material { emission: [8.0, 7.7, 7.2], ..Material::matte([0.8; 3]) });

    let (x, y, z) = (2.8, 3.2, 2.4);
    let v = Vec3::new;
    hall.quad("floor", screed, [v(-x, 0.0, z), v(x, 0.0, z), v(x, 0.0, -z), v(-x, 0.0, -z)]);
    hall.quad("ceiling", sky, [v(-x, y, -z), v(x, y, -z), v(x, y, z), v(-x, y, z)]);
    hall.quad("back_wall", plaster, [v(-x, 0.0, -z), v(x, 0.0, -z), v(x, y, -z), v(-x, y, -z)]);
    hall.quad("left_wall", sand, [v(-x, 0.0, z), v(-x, 0.0, -z), v(-x, y, -z), v(-x, y, z)]);
    hall.quad("right_wall", blue, [v(x, 0.0, -z), v(x, 0.0, z), v(x, y, z), v(x, y, -z)]);
    let ceiling_panel =
        [v(-0.6, y - 0.01, -0.9), v(0.6, y - 0.01, -0.9), v(0.6, y - 0.01, 0.1), v(-0.6, y - 0.01, 0.1)];
    hall.quad("panel", panel, ceiling_panel);

    // Flush with the back wall; each step is its tread, its riser and its part of the flank.
    let (foot, tread, rise, front) = (-0.55, 0.36, 0.19, -1.1);
    for step in 0..STEPS {
        let right = foot - tread * step as f32;
        let left = if step + 1 == STEPS { -x } else { right - tread };
        let (low, top) = (rise * step as f32, rise * (step + 1) as f32);
        hall.quad("stairs", marble, [v(left, top, front), v(right, top, front), v(right, top, -z), v(left, top, -z)]);
        hall.quad("stairs", marble, [v(right, low, front), v(right, low, -z), v(right, top, -z), v(right, top, front)]);
        hall.quad(
            "stairs",
            marble,
            [v(left, 0.0, front), v(right, 0.0, front), v(right, top, front), v(left, top, front)],
        );
    }

    let p = Vec2::new;
    let side = [p(0.0, 0.0), p(0.3, 0.0), p(0.3, 0.8), p(0.0, 0.8)];
    hall.lathe("drum", drum, v(-1.5, 1.75, -1.6), &side, false);
    hall.cuboid("plinth", chalk, v(-2.0, 0.25, 0.2), v(0.55, 0.5, 0.55), 0.2);
    hall.lathe("urn", glaze, v(-2.0, 0.5, 0.2), &urn(), true);

    hall.ball("ball", amber, v(1.95, 0.5, 0.1), 0.5);
    hall.lathe("cone", enamel, v(1.1, 0.0, -1.15), &[p(0.0, 0.0), p(0.5, 0.0), p(0.0, 1.5)], false);
    hall.cuboid("box", chalk, v(0.35, 0.38, -0.25), v(0.72, 0.76, 0.72), 0.45);

    let spot = |name: &str, from: Vec3, to: Vec3, inner: f32, outer: f32, intensity: Vec3| {
        let kind = LightKind::Spot { position: from, direction: (to - from).normalize(), inner, outer };
        Light { name: name.into(), kind, intensity }
    };
    let lights = vec![
        spot("blue", v(0.3, 2.9, 1.6), v(x, 1.4, -0.4), 0.34, 0.5, v(56.0, 55.0, 53.0)),
        spot("sand", v(-0.3, 2.9, 1.9), v(-x, 1.5, 0.5), 0.3, 0.5, v(34.0, 31.0, 27.0)),
        spot("ball", v(1.3, 2.9, 1.5), v(1.95, 0.52, 0.1), 0.1, 0.16, v(44.0, 41.0, 37.0)),
        spot("up", v(-0.9, 1.7, 1.7), v(-0.8, y, -0.6), 0.4, 0.62, v(22.0, 21.5, 21.0)),
    ];
    let cameras = vec![
        Camera::look_at("main", v(0.0, 1.6, 6.7), v(0.0, 1.6, 0.0), 36f32.to_radians()),
        Camera::look_at("stairs", v(0.3, 1.8, 4.2), v(-1.4, 1.2, -1.0), 38f32.to_radians()),
        Camera::look_at("shapes", v(0.6, 1.6, 4.9), v(1.15, 0.75, -0.5), 32f32.to_radians()),
    ];
    hall.finish(lights, cameras)
}

/// Foot, belly, neck and lip, from the ground up; closed by its own bottom inside.
fn urn() -> Vec<Vec2> {
    const POINTS: [(f32, f32); 12] = [
        (0.0, 0.0),
        (0.15, 0.0),
        (0.16, 0.03),
        (0.09, 0.10),
        (0.17, 0.26),
        (0.28, 0.46),
        (0.30, 0.60),
        (0.22, 0.76),
        (0.11, 0.86),
        (0.10, 0.93),
        (0.17, 1.02),
        (0.0, 1.0),
    ];
    // Catmull-Rom through the points: round without many of them.
    let at = |i: isize| Vec2::from(POINTS[i.clamp(0, POINTS.len() as isize - 1) as usize]);
    let mut profile: Vec<Vec2> = (0..POINTS.len() as isize - 1)
        .flat_map(|i| {
            (0..8).map(move |part| {
                let t = part as f32 / 8.0;
                let [a, b, c, d] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
                let curve = b * 2.0
                    + (c - a) * t
                    + (a * 2.0 - b * 5.0 + c * 4.0 - d) * (t * t)
                    + (b * 3.0 - a - c * 3.0 + d) * (t * t * t);
                (curve * 0.5).max(Vec2::ZERO)
            })
        })
        .collect();
    profile.push(at(POINTS.len() as isize - 1));
    profile
}
