//! Low-discrepancy points and the few maps that carry them to hemispheres and triangles. Same text in
//! `shaders/shared/sampling.wgsl`.

use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// Scrambles 32 bits (PCG output permutation; O'Neill 2014, Jarzynski and Olano 2020).
pub fn hash(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// [0, 1) from the top 24 bits, exact.
pub fn unit(x: u32) -> f32 {
    (x >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Two independent numbers for one seed: the shift that decorrelates one lattice from the next.
pub fn shift(seed: u32) -> Vec2 {
    let first = hash(seed);
    Vec2::new(unit(first), unit(hash(first ^ 0x9e37_79b9)))
}

/// Point `i` of `n` of a golden-ratio lattice, shifted on the torus (Cranley and Patterson 1976).
pub fn lattice(i: u32, n: u32, shift: Vec2) -> Vec2 {
    let u = (i as f32 + 0.5) / n as f32 + shift.x;
    let v = unit(i.wrapping_mul(2_654_435_769)) + shift.y;
    Vec2::new(u - u.floor(), v - v.floor())
}

/// A direction with density cos(theta) / pi about +Z.
pub fn cosine_direction(p: Vec2) -> Vec3 {
    let radius = p.x.sqrt();
    let (sin, cos) = (TAU * p.y).sin_cos();
    Vec3::new(radius * cos, radius * sin, (1.0 - p.x).max(0.0).sqrt())
}

/// Two unit vectors that make a right-handed frame with a unit normal (Duff et al. 2017).
pub fn frame(n: Vec3) -> (Vec3, Vec3) {
    let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// Barycentrics (second, third corner) uniform over a triangle; neighbours in the square stay neighbours
/// (Heitz 2019).
pub fn triangle(p: Vec2) -> Vec2 {
    if p.y > p.x {
        let u = p.x * 0.5;
        Vec2::new(u, p.y - u)
    } else {
        let v = p.y * 0.5;
        Vec2::new(p.x - v, v)
    }
}

/// A ray's origin lifted off the surface it starts from: by the rounding of coordinates, and no more. `floor` is the
/// scene's size times 1e-6.
pub fn lifted(position: Vec3, geometric_normal: Vec3, floor: f32) -> Vec3 {
    position + geometric_normal * (1e-5 * position.abs().max_element()).max(floor)
}
