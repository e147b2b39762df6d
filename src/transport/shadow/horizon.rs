//! The directions above a surface, `H`: texels of a cube's face whose middle lies in front of it.

use crate::scene::cube;
use crate::transport::runs;
use glam::Vec3;
use std::ops::Range;

/// Whether the texel (x, y) of a face lies above the horizon of a surface of that normal.
#[inline]
pub fn above(normal: Vec3, face: usize, x: usize, y: usize, size: usize) -> bool {
    normal.dot(cube::point(face, cube::middle(x, size), cube::middle(y, size))) > 0.0
}

/// Hands `each` the runs of texels above the horizon, in order; none for a normal of 0.
///
/// The height over the horizon is linear over a face, and rises or falls along every line of texels, rounding included:
/// two ends tell of a line whether it is cut, and about where.
pub fn spans(normal: Vec3, face: usize, size: usize, mut each: impl FnMut(Range<usize>)) {
    let last = size - 1;
    match [(0, 0), (last, 0), (0, last), (last, last)].map(|(x, y)| above(normal, face, x, y, size)) {
        [true, true, true, true] => return each(0..size * size),
        [false, false, false, false] => return,
        _ => {}
    }
    let mut span = 0..0;
    for y in 0..size {
        let open = Ramp::new(normal, face, y, size).above();
        let open = y * size + open.start..y * size + open.end;
        if open.start == span.end {
            span.end = open.end;
        } else if !open.is_empty() {
            if !span.is_empty() {
                each(span);
            }
            span = open;
        }
    }
    if !span.is_empty() {
        each(span);
    }
}

/// The height over the horizon along a line of texels: `(before + u slope) + behind`, which rounds as the dot product of
/// `above` does.
struct Ramp {
    before: f32,
    slope: f32,
    behind: f32,
    /// Texels along a side, and 1 over it, which is exact.
    size: usize,
    step: f32,
}

impl Ramp {
    #[inline]
    fn new(normal: Vec3, face: usize, y: usize, size: usize) -> Self {
        let (axis, sign) = cube::axis(face);
        let (v, [a, b, c]) = (cube::middle(y, size), normal.to_array());
        let (before, slope, behind) = match axis {
            0 => (sign * a, b, v * c),
            1 => (v * a + sign * b, c, 0.0),
            _ => (v * b, a, sign * c),
        };
        Self { before, slope, behind, size, step: 1.0 / size as f32 }
    }

    #[inline]
    fn at(&self, x: usize) -> f32 {
        let u = (2 * x + 1) as f32 * self.step - 1.0;
        (self.before + u * self.slope) + self.behind
    }

    /// The columns above the horizon.
    #[inline]
    fn above(&self) -> Range<usize> {
        let size = self.size;
        let (first, last) = (self.at(0), self.at(size - 1));
        // The first column of those from 1 on that is not as column 0: where a straight line says, or near it.
        let change = || {
            let above = first > 0.0;
            let mut x = ((first / (first - last) * (size - 1) as f32) as usize).clamp(1, size - 1);
            while x > 1 && (self.at(x - 1) > 0.0) != above {
                x -= 1;
            }
            while x < size - 1 && (self.at(x) > 0.0) == above {
                x += 1;
            }
            x
        };
        match (first > 0.0, last > 0.0) {
            (true, true) => 0..size,
            (false, false) => 0..0,
            (true, false) => 0..change(),
            (false, true) => change()..size,
        }
    }
}

/// Sets the bits of the texels above the horizon and clears the others; `size * size / 32` words.
pub fn mask(normal: Vec3, face: usize, size: usize, mask: &mut [u32]) {
    mask.fill(0);
    spans(normal, face, size, |span| runs::fill(mask, span));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::cube::FACES;

    #[test]
    fn runs_are_what_each_texel_says() {
        let size = 32;
        let mut normals = vec![Vec3::X, -Vec3::Y, Vec3::ZERO, Vec3::new(0.6, 0.8, 0.0), Vec3::splat(-0.57735)];
        normals.extend((0..200).map(|i| {
            let angle = i as f32 * 2.399_963;
            let z = 1.0 - (i as f32 + 0.5) / 100.0;
            Vec3::new(angle.cos() * (1.0 - z * z).sqrt(), angle.sin() * (1.0 - z * z).sqrt(), z)
        }));
        for normal in normals {
            let mut open = 0;
            for face in 0..FACES {
                let mut found = vec![!0; size * size / 32];
                mask(normal, face, size, &mut found);
                let mut end = 0;
                spans(normal, face, size, |span| {
                    assert!(!span.is_empty() && (span.start > end || end == 0), "{normal} {face}: runs touch");
                    end = span.end;
                });
                for texel in 0..size * size {
                    let expected = above(normal, face, texel % size, texel / size, size);
                    assert_eq!(found[texel / 32] >> (texel % 32) & 1 == 1, expected, "{normal} {face} {texel}");
                    open += usize::from(expected);
                }
            }
            // Half of all directions, but for those that lie on the horizon.
            let half = FACES * size * size / 2;
            assert!(normal == Vec3::ZERO || open.abs_diff(half) < 4 * size, "{normal}: {open} of {half}");
        }
    }
}
