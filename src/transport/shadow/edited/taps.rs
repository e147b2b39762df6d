//! Sums over directions near a direction, on the texels of a cube.

use crate::kernels::shadow_filter::Tap;
use crate::scene::cube::{self, FACES};
use glam::Vec3;
use rayon::prelude::*;

/// Bilinear look-up at a direction among texel middles: up to four taps, of weights that sum to 1. `source` is a
/// texel number. Across an edge of the cube, the neighbour is the texel that lies there.
pub fn bilinear(direction: Vec3, size: usize) -> Vec<Tap> {
    let (face, u, v) = cube::project(direction);
    let place = |t: f32| 0.5 * ((t + 1.0) * size as f32 - 1.0);
    let (x, y) = (place(u), place(v));
    let (left, low) = (x.floor(), y.floor());
    let (right_share, high_share) = (x - left, y - low);
    let middle = |i: f32| (2.0 * i + 1.0) / size as f32 - 1.0;
    let mut taps: Vec<Tap> = Vec::with_capacity(4);
    for (i, j, weight) in [
        (left, low, (1.0 - right_share) * (1.0 - high_share)),
        (left + 1.0, low, right_share * (1.0 - high_share)),
        (left, low + 1.0, (1.0 - right_share) * high_share),
        (left + 1.0, low + 1.0, right_share * high_share),
    ] {
        // What rounding left of a middle that is hit exactly is no tap.
        if weight < 1e-5 {
            continue;
        }
        let source = cube::texel_at(cube::point(face, middle(i), middle(j)), size) as u32;
        match taps.iter_mut().find(|tap| tap.source == source) {
            Some(tap) => tap.weight += weight,
            None => taps.push(Tap { source, weight }),
        }
    }
    let total: f32 = taps.iter().map(|tap| tap.weight).sum();
    taps.iter_mut().for_each(|tap| tap.weight /= total);
    taps
}

/// Gaussian weights of the texels of a cube around one of them.
pub struct Gaussian {
    size: usize,
    /// Unit directions and solid angles of all texels.
    texels: Vec<(Vec3, f32)>,
    /// Standard deviation, radians.
    deviation: f32,
}

/// Standard deviations beyond which nothing counts.
const REACH: f32 = 3.0;

impl Gaussian {
    pub fn new(size: usize, deviation: f32) -> Self {
        let angles = cube::solid_angles(size);
        let texel = |i: usize| (cube::texel_point(i, size).normalize(), angles[i % (size * size)]);
        Self { size, texels: (0..FACES * size * size).into_par_iter().map(texel).collect(), deviation }
    }

    /// Taps around a texel, of weights that sum to 1; `source` is a texel number.
    pub fn around(&self, texel: usize) -> Vec<Tap> {
        let centre = self.texels[texel].0;
        let least = (REACH * self.deviation).min(std::f32::consts::PI).cos();
        let mut taps: Vec<Tap> = self
            .near(texel)
            .filter_map(|source| {
                let (direction, solid_angle) = self.texels[source];
                let cosine = centre.dot(direction);
                (cosine >= least || source == texel).then(|| {
                    // The chord: exact for small angles, where the arc cosine is not.
                    let angle = 2.0 * (0.5 * (direction - centre).length()).min(1.0).asin();
                    let weight = solid_angle * (-0.5 * (angle / self.deviation).powi(2)).exp();
                    Tap { source: source as u32, weight }
                })
            })
            .collect();
        let total: f32 = taps.iter().map(|tap| tap.weight).sum();
        taps.iter_mut().for_each(|tap| tap.weight /= total);
        taps
    }

    /// All texels that may be within reach, each once.
    fn near(&self, texel: usize) -> Box<dyn Iterator<Item = usize> + '_> {
        let n = self.size;
        // Texels are smallest in a face's corners: a third of the angle that they take in its middle.
        let radius = (REACH * self.deviation * n as f32 * 1.5).ceil() as i64 + 1;
        if radius * 2 >= n as i64 {
            return Box::new(0..self.texels.len());
        }
        let (face, y, x) = (texel / (n * n), (texel / n % n) as i64, (texel % n) as i64);
        let middle = |i: i64| (2 * i + 1) as f32 / n as f32 - 1.0;
        let mut found: Vec<usize> = (y - radius..=y + radius)
            .flat_map(|j| (x - radius..=x + radius).map(move |i| (i, j)))
            .map(|(i, j)| cube::texel_at(cube::point(face, middle(i), middle(j)), n))
            .collect();
        found.sort_unstable();
        found.dedup();
        Box::new(found.into_iter())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_middle_is_found_alone_and_half_way_is_half() {
        for texel in [0, 5, 1023, 3 * 1024 + 77] {
            let taps = bilinear(cube::texel_point(texel, 32), 32);
            assert_eq!(taps.len(), 1, "{taps:?}");
            assert_eq!(taps[0], Tap { source: texel as u32, weight: 1.0 });
        }
        let between = 0.5 * (cube::texel_point(40, 32) + cube::texel_point(41, 32));
        let taps = bilinear(between, 32);
        assert_eq!(taps.iter().map(|tap| tap.source).collect::<Vec<_>>(), [40, 41]);
        assert!(taps.iter().all(|tap| (tap.weight - 0.5).abs() < 1e-5));
        // Past the last texel of a face, the next face's.
        let edge = bilinear(cube::point(0, 0.999, 0.01), 32);
        let faces: std::collections::BTreeSet<u32> = edge.iter().map(|tap| tap.source / 1024).collect();
        assert_eq!(faces.into_iter().collect::<Vec<_>>(), [0, 2]);
    }

    #[test]
    fn gaussians_are_even_round_and_as_wide_as_asked() {
        for (size, deviation) in [(64, 0.06), (16, 0.3), (8, 1.0)] {
            let gaussian = Gaussian::new(size, deviation);
            for texel in [0, size * size / 2 + size / 2, 4 * size * size + size - 1] {
                let taps = gaussian.around(texel);
                let total: f32 = taps.iter().map(|tap| tap.weight).sum();
                assert!((total - 1.0).abs() < 1e-5);
                let centre = gaussian.texels[texel].0;
                let mean: Vec3 = taps.iter().map(|tap| gaussian.texels[tap.source as usize].0 * tap.weight).sum();
                assert!(mean.normalize().dot(centre) > 0.9995, "{size} {deviation} {texel}: {mean}");
                let square =
                    |tap: &Tap| centre.angle_between(gaussian.texels[tap.source as usize].0).powi(2) * tap.weight;
                let found = (0.5 * taps.iter().map(square).sum::<f32>()).sqrt();
                // Of a plane; on the sphere and cut off at three deviations, a little less.
                assert!(
                    (found / deviation - 1.0).abs() < if deviation < 0.5 { 0.06 } else { 0.25 },
                    "{found} {deviation}"
                );
            }
        }
    }
}
