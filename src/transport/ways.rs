//! The way that light of an entry of a transfer row takes: how far, and from which side. Packed in 32 bits, so that a
//! change of light by distance or direction is two table look-ups an entry, whatever its formula.
//!
//! The high 16 bits are the base-2 logarithm of the distance in steps of 1/1024 octave from 2^-24 to 2^40 metres; the
//! low 16 bits are the direction towards the sender, octahedral (Meyer et al. 2010), 8 bits an axis: off by at most one degree.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Codes of either half.
pub const CODES: usize = 1 << 16;
/// Codes that one task works on.
const TILE: usize = 4096;
const STEPS: f32 = 1024.0;
const LOWEST: f32 = -24.0;

/// From a row's point to the mean position of a tree node. Of no length: the smallest distance, straight up.
#[inline]
pub fn pack(between: Vec3) -> u32 {
    let squared = between.length_squared();
    let octaves = 0.5 * squared.max(f32::MIN_POSITIVE).log2();
    let distance = ((octaves - LOWEST) * STEPS + 0.5).clamp(0.0, 65535.0) as u32;
    distance << 16 | direction_code(between)
}

#[inline]
fn direction_code(v: Vec3) -> u32 {
    let sum = v.x.abs() + v.y.abs() + v.z.abs();
    let mut p = if sum > 0.0 { Vec2::new(v.x, v.z) / sum } else { Vec2::ZERO };
    if v.y < 0.0 {
        p = (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * Vec2::new(sign(p.x), sign(p.y));
    }
    let code = (p * 127.5 + 127.5 + 0.5).clamp(Vec2::ZERO, Vec2::splat(255.0));
    (code.y as u32) << 8 | code.x as u32
}

fn sign(x: f32) -> f32 {
    if x >= 0.0 { 1.0 } else { -1.0 }
}

/// Metres of a distance code.
pub fn distance(code: usize) -> f32 {
    (code as f32 / STEPS + LOWEST).exp2()
}

/// The unit vector of a direction code.
pub fn direction(code: usize) -> Vec3 {
    let p = (Vec2::new((code & 255) as f32, (code >> 8) as f32) - 127.5) / 127.5;
    let y = 1.0 - p.x.abs() - p.y.abs();
    let p = if y < 0.0 { (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * Vec2::new(sign(p.x), sign(p.y)) } else { p };
    Vec3::new(p.x, y, p.y).normalize()
}

/// Factors of light by distance and by direction; `CODES` each.
#[derive(Clone, Debug, PartialEq)]
pub struct Factors {
    pub distance: Vec<f32>,
    pub direction: Vec<f32>,
}

impl Default for Factors {
    fn default() -> Self {
        Self { distance: vec![1.0; CODES], direction: vec![1.0; CODES] }
    }
}

impl Factors {
    /// Changed further, by distance in metres.
    pub fn by_distance(&mut self, factor: impl Fn(f32) -> f32 + Sync) {
        let codes = self.distance.par_iter_mut().enumerate().with_min_len(TILE);
        codes.for_each(|(code, value)| *value *= factor(distance(code)));
    }

    /// Changed further, by the unit vector towards the sender.
    pub fn by_direction(&mut self, factor: impl Fn(Vec3) -> f32 + Sync) {
        let codes = self.direction.par_iter_mut().enumerate().with_min_len(TILE);
        codes.for_each(|(code, value)| *value *= factor(direction(code)));
    }

    pub fn of(&self, way: u32) -> f32 {
        self.distance[(way >> 16) as usize] * self.direction[(way & 0xffff) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sampling::{hash, unit};

    #[test]
    fn a_way_comes_back() {
        for i in 0..10_000 {
            let v = Vec3::from_array([0, 1, 2].map(|k| unit(hash(3 * i + k)) - 0.5)) * 10f32.powi(i as i32 % 9 - 4);
            let way = pack(v);
            let (back, far) = (direction((way & 0xffff) as usize), distance((way >> 16) as usize));
            assert!(back.dot(v.normalize()) > 0.9998, "{v} came back as {back}");
            assert!((far / v.length() - 1.0).abs() < 5e-4, "{} m came back as {far} m", v.length());
        }
    }

    #[test]
    fn ugly_ways_have_codes() {
        let far = Vec3::splat(f32::MAX);
        for v in [Vec3::ZERO, Vec3::splat(1e-40), far, -Vec3::Y, Vec3::Y, Vec3::NEG_X, Vec3::Z] {
            assert!(direction((pack(v) & 0xffff) as usize).is_finite(), "{v}");
        }
        assert_eq!(pack(far) >> 16, 65535);
        assert_eq!(pack(Vec3::ZERO) >> 16, 0);
    }

    #[test]
    fn factors_multiply() {
        let mut factors = Factors::default();
        factors.by_distance(|d| d);
        factors.by_distance(|d| d);
        factors.by_direction(|v| 1.0 + v.y);
        let f = factors.of(pack(Vec3::new(0.0, 2.0, 0.0)));
        assert!((f / 8.0 - 1.0).abs() < 2e-3, "{f}");
    }
}
