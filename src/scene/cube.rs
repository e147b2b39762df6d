//! Directions as texels of a cube: six square faces of n x n texels, n a power of two.
//!
//! Face `f` looks along axis `f / 2`, positive for even `f`: +X, -X, +Y, -Y, +Z, -Z. A point of it is
//! `sign e_a + u e_(a+1) + v e_(a+2)` (axes modulo 3), `u`, `v` in [-1, 1]; texel (x, y) has its centre at
//! `u = (2x + 1) / n - 1`, `v = (2y + 1) / n - 1`. Texel number: `(face n + y) n + x`.

use crate::{Error, Result};
use glam::Vec3;

pub const FACES: usize = 6;

/// As recipes name them; the order of the faces.
pub const FACE_NAMES: [&str; FACES] = ["right", "left", "top", "bottom", "front", "back"];

/// Sizes that faces may have.
pub const SIZES: std::ops::RangeInclusive<usize> = 32..=512;

/// # Errors
/// `Compute` for a size that is no power of two, or out of `SIZES`.
pub fn check_size(size: usize) -> Result<()> {
    match size.is_power_of_two() && SIZES.contains(&size) {
        true => Ok(()),
        false => Err(Error::compute(
            format!("a cube face of {size} texels; expected a power of two from {} to {}", SIZES.start(), SIZES.end()),
            "set face_size to 32, 64, 128, 256 or 512",
        )),
    }
}

/// Axis that a face looks along, and its sign.
#[inline]
pub fn axis(face: usize) -> (usize, f32) {
    (face / 2, if face.is_multiple_of(2) { 1.0 } else { -1.0 })
}

/// The point of a face at `u`, `v`: on the cube of half side 1, not normalised.
#[inline]
pub fn point(face: usize, u: f32, v: f32) -> Vec3 {
    let (a, sign) = axis(face);
    let mut point = [0.0; 3];
    point[a] = sign;
    point[(a + 1) % 3] = u;
    point[(a + 2) % 3] = v;
    point.into()
}

/// Middle of a texel along one side of a face.
#[inline]
pub fn middle(x: usize, size: usize) -> f32 {
    (2 * x + 1) as f32 / size as f32 - 1.0
}

/// The middle of a texel, on the cube of half side 1.
pub fn texel_point(texel: usize, size: usize) -> Vec3 {
    let (face, y, x) = (texel / (size * size), texel / size % size, texel % size);
    point(face, middle(x, size), middle(y, size))
}

/// Face and `u`, `v` that a direction (of any length, not zero) goes through.
pub fn project(direction: Vec3) -> (usize, f32, f32) {
    let a = direction.abs().max_position();
    let face = 2 * a + usize::from(direction[a] < 0.0);
    let scale = 1.0 / direction[a].abs();
    (face, direction[(a + 1) % 3] * scale, direction[(a + 2) % 3] * scale)
}

/// Number of the texel that a direction goes through.
pub fn texel_at(direction: Vec3, size: usize) -> usize {
    let (face, u, v) = project(direction);
    let place = |t: f32| (((t + 1.0) * 0.5 * size as f32) as usize).min(size - 1);
    (face * size + place(v)) * size + place(u)
}

/// Steradians of texel (x, y) of any face.
pub fn solid_angle(x: usize, y: usize, size: usize) -> f64 {
    let edge = |i: usize| 2.0 * i as f64 / size as f64 - 1.0;
    // Of the rectangle from the middle of the face to (u, v).
    let corner = |u: f64, v: f64| (u * v).atan2((u * u + v * v + 1.0).sqrt());
    let (left, right, low, high) = (edge(x), edge(x + 1), edge(y), edge(y + 1));
    corner(right, high) - corner(left, high) - corner(right, low) + corner(left, low)
}

/// Solid angles of the texels of a face, row by row.
pub fn solid_angles(size: usize) -> Vec<f32> {
    (0..size * size).map(|i| solid_angle(i % size, i / size, size) as f32).collect()
}

/// The number of a face by its name.
pub fn face_of(name: &str) -> Option<usize> {
    FACE_NAMES.iter().position(|known| *known == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_are_found_again_and_fill_the_sphere() {
        for size in [1, 2, 8, 64] {
            for texel in 0..FACES * size * size {
                assert_eq!(texel_at(texel_point(texel, size) * 3.7, size), texel);
            }
            let total: f64 = (0..size * size).map(|i| solid_angle(i % size, i / size, size)).sum();
            assert!((6.0 * total - 4.0 * std::f64::consts::PI).abs() < 1e-12, "{size}: {total}");
        }
        // Seen from the middle, a face of one texel is a sixth of all.
        assert!((solid_angle(0, 0, 1) - 4.0 * std::f64::consts::PI / 6.0).abs() < 1e-12);
    }

    #[test]
    fn faces_look_where_their_names_say() {
        for (name, axis) in [("right", Vec3::X), ("left", -Vec3::X), ("top", Vec3::Y), ("bottom", -Vec3::Y)] {
            assert_eq!(project(axis).0, face_of(name).unwrap());
            assert_eq!(point(face_of(name).unwrap(), 0.0, 0.0), axis);
        }
        assert_eq!(point(2, 0.25, -0.5), Vec3::new(-0.5, 1.0, 0.25));
        assert_eq!(face_of("up"), None);
        assert!(check_size(48).is_err() && check_size(16).is_err() && check_size(128).is_ok());
    }
}
