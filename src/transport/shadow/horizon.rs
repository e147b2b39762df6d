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
/// two ends tell of a line whether it is cut, and a binary search where.
pub fn spans(normal: Vec3, face: usize, size: usize, mut each: impl FnMut(Range<usize>)) {
    let last = size - 1;
    match [(0, 0), (last, 0), (0, last), (last, last)].map(|(x, y)| above(normal, face, x, y, size)) {
        [true, true, true, true] => return each(0..size * size),
        [false, false, false, false] => return,
        _ => {}
    }
    let mut span = 0..0;
    for y in 0..size {
        let open = line(normal, face, y, size);
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

/// The columns of a line that are above the horizon.
fn line(normal: Vec3, face: usize, y: usize, size: usize) -> Range<usize> {
    let is_above = |x: usize| above(normal, face, x, y, size);
    // The first column of those from 1 on that is not as column 0.
    let change = || {
        let (mut low, mut high) = (0, size - 1);
        let first = is_above(0);
        while high - low > 1 {
            let middle = (low + high) / 2;
            if is_above(middle) == first { low = middle } else { high = middle }
        }
        high
    };
    match (is_above(0), is_above(size - 1)) {
        (true, true) => 0..size,
        (false, false) => 0..0,
        (true, false) => 0..change(),
        (false, true) => change()..size,
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
