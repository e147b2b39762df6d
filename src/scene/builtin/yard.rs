//! `builtin:yard`: things that cast shadows under an open sky, for shadow design.

use super::builder::Builder;
use crate::scene::{Camera, Material, Scene};
use glam::{Vec2, Vec3};

const STEPS: usize = 4;
const BARS: usize = 9;

/// A paved yard: stairs at the back on the left with a railing in front of them (`bar0` to `bar8`, `handrail`), five
/// rings that hang in one another (`ring0` to `ring4`) on a plinth, a dome in front of the rings, and a figure (`body`, `head`).
/// No lights: lit by an environment. Cameras: `main`, `rings` and `stairs`.
pub fn yard() -> Scene {
    let mut yard = Builder::default();
    let paving = yard.material("paving", Material::matte([0.58, 0.56, 0.53]));
    let stone = yard.material("stone", Material::matte([0.68, 0.65, 0.60]));
    let iron = yard.material("iron", Material::matte([0.16, 0.18, 0.20]));
    let clay = yard.material("clay", Material::matte([0.66, 0.40, 0.28]));
    let lime = yard.material("lime", Material::matte([0.78, 0.76, 0.72]));
    let paints = [[0.10, 0.26, 0.62], [0.62, 0.48, 0.08], [0.06, 0.06, 0.07], [0.08, 0.44, 0.18], [0.62, 0.08, 0.10]];
    let v = Vec3::new;

    yard.quad("ground", paving, [v(-9.0, 0.0, 7.0), v(9.0, 0.0, 7.0), v(9.0, 0.0, -9.0), v(-9.0, 0.0, -9.0)]);
    let (rise, tread) = (0.22, 0.5);
    for step in 0..STEPS {
        let depth = tread * (STEPS - step) as f32;
        let centre = v(-2.9, rise * (step as f32 + 0.5), -2.0 - tread * step as f32 - 0.5 * depth);
        yard.cuboid("stairs", stone, centre, v(3.4, rise, depth), 0.0);
    }
    for bar in 0..BARS {
        let x = -4.1 + 0.34 * bar as f32;
        yard.cuboid(&format!("bar{bar}"), iron, v(x, 0.5, -1.35), v(0.05, 1.0, 0.05), 0.0);
    }
    yard.cuboid("handrail", iron, v(-2.74, 1.03, -1.35), v(2.95, 0.07, 0.09), 0.0);

    yard.cuboid("plinth", stone, v(1.9, 0.2, -0.5), v(3.2, 0.4, 0.5), 0.0);
    for (ring, paint) in paints.into_iter().enumerate() {
        let material = yard.material(&format!("paint{ring}"), Material::matte(paint));
        let below = ring % 2 == 1;
        let centre = v(0.84 + 0.53 * ring as f32, if below { 0.93 } else { 1.36 }, -0.5);
        // Turned a little out of one plane, so that they pass through one another.
        let axis = v(if below { 0.14 } else { -0.14 }, if below { 0.1 } else { -0.1 }, 1.0).normalize();
        yard.ring(&format!("ring{ring}"), material, centre, axis, 0.46, 0.055);
    }
    yard.ball("dome", lime, v(2.75, -0.35, 1.2), 1.1);

    let p = Vec2::new;
    let body =
        [(0.0, 0.0), (0.27, 0.0), (0.29, 0.06), (0.2, 0.35), (0.15, 0.62), (0.2, 0.86), (0.13, 1.02), (0.0, 1.05)];
    yard.lathe("body", clay, v(-0.75, 0.0, 0.6), &body.map(|(x, y)| p(x, y)), true);
    yard.ball("head", clay, v(-0.75, 1.2, 0.6), 0.21);

    let cameras = vec![
        Camera::look_at("main", v(-0.7, 4.7, 8.2), v(-0.2, 0.1, 0.1), 38f32.to_radians()),
        Camera::look_at("rings", v(1.6, 3.3, 5.6), v(2.0, 0.4, 0.4), 36f32.to_radians()),
        Camera::look_at("stairs", v(-2.2, 2.9, 4.2), v(-2.6, 0.2, -1.4), 40f32.to_radians()),
    ];
    yard.finish(Vec::new(), cameras)
}
