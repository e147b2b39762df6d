//! Connected parts of a cube's texels, across the edges of its faces.

use crate::scene::cube::{self, FACES};

/// The texels that touch one, at sides and corners: eight, or seven in a corner of the cube, where three faces meet.
pub fn neighbours(texel: usize, size: usize) -> impl Iterator<Item = usize> {
    let (face, y, x) = (texel / (size * size), texel / size % size, texel % size);
    const AROUND: [(isize, isize); 8] = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
    AROUND.into_iter().filter_map(move |(dx, dy)| {
        match (x.checked_add_signed(dx).filter(|x| *x < size), y.checked_add_signed(dy).filter(|y| *y < size)) {
            (Some(x), Some(y)) => Some((face * size + y) * size + x),
            (None, None) => None,
            (x, y) => {
                // On the next face, half a texel down from the edge.
                let place = |at: Option<usize>, d: isize| at.map_or(d as f32, |at| cube::middle(at, size));
                let mut point = cube::point(face, place(x, dx), place(y, dy));
                point[face / 2] *= 1.0 - 1.0 / size as f32;
                Some(cube::texel_at(point, size))
            }
        }
    })
}

/// The connected parts of the texels that are `inside`, each sorted, in the order of their first texels.
pub fn regions(inside: &[bool], size: usize) -> Vec<Vec<usize>> {
    assert_eq!(inside.len(), FACES * size * size);
    let mut left = inside.to_vec();
    let mut regions = Vec::new();
    for first in 0..inside.len() {
        if !std::mem::take(&mut left[first]) {
            continue;
        }
        let mut region = vec![first];
        let mut next = 0;
        while next < region.len() {
            let open: Vec<usize> = neighbours(region[next], size).filter(|near| left[*near]).collect();
            open.iter().for_each(|near| left[*near] = false);
            region.extend(open);
            next += 1;
        }
        region.sort_unstable();
        regions.push(region);
    }
    regions
}

/// Texels around some, ring by ring: those at one step, at two, ... up to `rings`.
pub fn rings(
    around: &[usize],
    rings: usize,
    size: usize,
    mut may: impl FnMut(usize, usize) -> bool,
) -> Vec<Vec<usize>> {
    let mut seen = vec![false; FACES * size * size];
    around.iter().for_each(|texel| seen[*texel] = true);
    let mut found: Vec<Vec<usize>> = Vec::with_capacity(rings);
    for _ in 0..rings {
        let mut ring = Vec::new();
        for &from in found.last().map_or(around, Vec::as_slice) {
            for near in neighbours(from, size) {
                if !seen[near] && may(from, near) {
                    seen[near] = true;
                    ring.push(near);
                }
            }
        }
        found.push(ring);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn neighbours_are_near_and_mutual() {
        for size in [2, 8, 32] {
            for texel in 0..FACES * size * size {
                let around: Vec<usize> = neighbours(texel, size).collect();
                let (x, y) = (texel % size, texel / size % size);
                let corner = (x == 0 || x == size - 1) && (y == 0 || y == size - 1);
                assert_eq!(around.len(), if corner { 7 } else { 8 });
                let mut once = around.clone();
                once.sort_unstable();
                once.dedup();
                assert!(once.len() == around.len() && !around.contains(&texel));
                for near in around {
                    assert!(neighbours(near, size).any(|back| back == texel), "{texel} of {size} is no neighbour");
                    let [a, b] = [texel, near].map(|i| cube::texel_point(i, size).normalize());
                    assert!(a.angle_between(b) < 2.9 * 2.0 / size as f32, "{size}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn a_region_runs_across_edges_and_two_that_do_not_touch_are_two() {
        let size = 32;
        // Two caps: around the middle of an edge of the cube, and around a corner of it.
        let caps = [Vec3::new(1.0, 1.0, 0.0), Vec3::new(-1.0, 1.0, -1.0)].map(Vec3::normalize);
        let near = |texel: usize, cap: Vec3| cube::texel_point(texel, size).normalize().angle_between(cap) < 0.3;
        let inside: Vec<bool> = (0..FACES * size * size).map(|i| caps.iter().any(|cap| near(i, *cap))).collect();
        let found = regions(&inside, size);
        assert_eq!(found.len(), 2);
        assert_eq!(found.iter().map(Vec::len).sum::<usize>(), inside.iter().filter(|inside| **inside).count());
        let faces = |region: &[usize]| {
            let mut faces: Vec<usize> = region.iter().map(|texel| texel / (size * size)).collect();
            faces.dedup();
            faces
        };
        assert_eq!([faces(&found[0]), faces(&found[1])], [vec![0, 2], vec![1, 2, 5]]);
        assert!(regions(&vec![false; inside.len()], size).is_empty());
        assert_eq!(regions(&vec![true; inside.len()], size).len(), 1);
    }

    #[test]
    fn rings_grow_by_one_texel() {
        let size = 8;
        let middle = (2 * size + 4) * size + 4;
        let found = rings(&[middle], 3, size, |_, _| true);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [8, 16, 24]);
        assert!(rings(&[middle], 2, size, |_, _| false).iter().all(Vec::is_empty));
    }
}
