//! Tiles of a bake that outlive it: what is left to compute when something else has moved, or when others compute a part.
//!
//! A tile's shadows on one face follow from its samples and from what of a group stands in that face's quarter of space as
//! the tile sees it. So a tile is named by just that, and is found again when anything else has moved.

use super::visibility::Rows;
use crate::Result;
use crate::memo::{Key, Memo, Part};
use crate::scene::cube;
use crate::scene::{Geometry, SurfacePoint};
use glam::Vec3;
use rayon::prelude::*;
use std::cell::Cell;
use std::sync::Arc;

pub struct Tiles<'a> {
    memo: &'a dyn Memo,
    part: Option<Part>,
    /// Tiles are worth remembering.
    moves: bool,
    lift: f32,
    /// Of each object: lowest and highest corner, and a name for where all of it is.
    objects: Vec<Option<([Vec3; 2], Key)>>,
    /// Found, and computed.
    pub counts: Cell<[usize; 2]>,
}

impl<'a> Tiles<'a> {
    /// `part`: of the tiles that are not there yet, these are computed and left on disk.
    pub fn new(memo: &'a dyn Memo, geometry: &Geometry, part: Option<Part>) -> Self {
        let mut corners: Vec<Vec<[[f32; 3]; 3]>> = vec![Vec::new(); geometry.objects.len()];
        for (triangle, object) in geometry.corners.iter().zip(&geometry.object[..]) {
            corners[*object as usize].push(*triangle);
        }
        let place = |triangles: &Vec<[[f32; 3]; 3]>| {
            let points = || triangles.as_flattened().iter().map(|corner| Vec3::from(*corner));
            let bounds = [points().reduce(Vec3::min)?, points().reduce(Vec3::max)?];
            Some((bounds, Key::of(&[bytemuck::cast_slice(triangles)])))
        };
        let objects = corners.par_iter().map(place).collect();
        Self { memo, part, moves: !geometry.poses.is_empty(), lift: geometry.lift(), objects, counts: Cell::default() }
    }

    /// Names the shadows that `casting` objects throw on samples from a face; `how`: all else that they depend on.
    pub fn key(&self, points: &[SurfacePoint], casting: &[u32], face: usize, how: Key) -> Key {
        let there = || points.iter().filter(|point| point.exists()).map(|point| Vec3::from(point.position));
        let Some(bounds) = there().reduce(Vec3::min).zip(there().reduce(Vec3::max)) else {
            return Key::of(&[b"empty visibility tile", &how.0, &points.len().to_le_bytes()]);
        };
        // Samples are lifted off their surfaces by as much (`sampling::lifted`).
        let farthest = bounds.0.abs().max(bounds.1.abs()).max_element();
        let slack = 2.0 * (1e-5 * farthest).max(self.lift);
        let reaches = |object: &u32| {
            let (of_object, key) = self.objects[*object as usize]?;
            sees(bounds, of_object, face, slack).then_some(key)
        };
        let keys: Vec<Key> = casting.iter().filter_map(reaches).collect();
        let mut parts: Vec<&[u8]> = vec![b"visibility tile", &how.0, bytemuck::cast_slice(points)];
        let lift = self.lift.to_le_bytes();
        parts.push(&lift);
        parts.extend(keys.iter().map(|key| &key.0[..]));
        Key::of(&parts)
    }

    /// Whether this run computes that tile, should nobody have.
    pub fn is_ours(&self, tile: usize) -> bool {
        self.part.is_none_or(|part| part.has(tile))
    }

    /// A part is asked for, not the whole.
    pub fn is_part(&self) -> bool {
        self.part.is_some()
    }

    /// Tiles are kept one by one, for others or for later.
    pub fn keeps(&self) -> bool {
        self.moves || self.is_part()
    }

    pub fn find(&self, key: Key) -> Option<Rows> {
        let remembered = self.memo.get(key).and_then(|any| any.downcast::<Rows>().ok());
        let found = remembered.map(|rows| (*rows).clone()).or_else(|| self.memo.find(key));
        let [reused, computed] = self.counts.get();
        self.counts.set(if found.is_some() { [reused + 1, computed] } else { [reused, computed] });
        found
    }

    /// # Errors
    /// As `Memo::save`.
    pub fn keep(&self, key: Key, rows: &Rows) -> Result<()> {
        let [reused, computed] = self.counts.get();
        self.counts.set([reused, computed + 1]);
        if self.is_part() {
            self.memo.lay_down(key, rows)?;
        }
        if self.moves {
            self.memo.put(key, Arc::new(rows.clone()), rows.bytes());
        }
        Ok(())
    }
}

/// Whether any of what lies within `object` may be seen through a face from anywhere within `tile`; `slack`: metres that
/// samples may be lifted by.
fn sees(tile: (Vec3, Vec3), [low, high]: [Vec3; 2], face: usize, slack: f32) -> bool {
    let (axis, sign) = cube::axis(face);
    // All ways from the tile to the object.
    let (nearest, farthest) = (low - tile.1 - slack, high - tile.0 + slack);
    let depth = if sign > 0.0 { farthest[axis] } else { -nearest[axis] };
    let aside = |side: usize| {
        let side = (axis + side) % 3;
        if nearest[side] > 0.0 { nearest[side] } else { (-farthest[side]).max(0.0) }
    };
    depth >= 0.0 && aside(1) <= depth && aside(2) <= depth
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sampling::{hash, unit};

    /// Every way between two boxes goes through a face that `sees` does not rule out.
    #[test]
    fn no_face_is_ruled_out_that_anything_is_seen_through() {
        let mut ruled_out = 0;
        for seed in 0..400u32 {
            let random = |i: u32| 4.0 * unit(hash(seed * 64 + i)) - 2.0;
            let vector = |i: u32| Vec3::new(random(i), random(i + 1), random(i + 2));
            let [a, b, c, d] = [vector(0), vector(3) * 0.3, vector(6), vector(9) * 0.3].map(|v| v * 2.0);
            let (tile, object) = ((a.min(a + b), a.max(a + b)), [c.min(c + d), c.max(c + d)]);
            for face in 0..cube::FACES {
                ruled_out += usize::from(!sees(tile, object, face, 0.0));
            }
            for i in 0..50 {
                let inside = |i: u32, low: Vec3, high: Vec3| {
                    low + (high - low) * Vec3::new(unit(hash(i)), unit(hash(i + 1)), unit(hash(i + 2)))
                };
                let way = inside(1000 + 6 * i, object[0], object[1]) - inside(1003 + 6 * i, tile.0, tile.1);
                let (face, ..) = cube::project(way);
                assert!(sees(tile, object, face, 0.0), "{way} through {face}");
            }
        }
        assert!(ruled_out > 1000, "{ruled_out} of 2400: nothing is gained");
    }
}
