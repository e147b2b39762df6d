//! Sums of light over samples, in parallel and in a fixed order.

use super::positions::TILE;
use glam::Vec4;
use rayon::prelude::*;

/// Adds `count` elements of vectors of light up, in order.
pub fn sum(count: usize, vectors: &[&[[f32; 4]]]) -> Vec<[f32; 4]> {
    let mut total = vec![[0.0; 4]; count];
    add_all(&mut total, vectors);
    total
}

/// Adds vectors of as many elements to a sum, in order.
pub fn add_all(total: &mut [[f32; 4]], vectors: &[&[[f32; 4]]]) {
    total.par_chunks_mut(TILE).enumerate().for_each(|(tile, total)| {
        for vector in vectors {
            for (sum, more) in total.iter_mut().zip(&vector[tile * TILE..]) {
                *sum = (Vec4::from_array(*sum) + Vec4::from_array(*more)).to_array();
            }
        }
    });
}

/// Light at some places, one element each.
pub struct At<'a> {
    /// Ascending; `None`: everywhere.
    pub places: Option<&'a [u32]>,
    /// What counts of it; `None`: all.
    pub weights: Option<&'a [f32]>,
    pub light: &'a [[f32; 4]],
}

impl At<'_> {
    /// What lies in `start..end`: places counted from `start`, and light.
    fn within(&self, start: usize, end: usize) -> impl Iterator<Item = (usize, Vec4)> {
        let at = |place: usize| self.places.map_or(place, |places| places.partition_point(|&p| (p as usize) < place));
        (at(start)..at(end)).map(move |i| {
            let light = Vec4::from_array(self.light[i]);
            let place = self.places.map_or(i, |places| places[i] as usize);
            (place - start, self.weights.map_or(light, |weights| light * weights[i]))
        })
    }
}

/// Adds light at some places to the sum at all, in order.
pub fn add_at(total: &mut [[f32; 4]], parts: &[At]) {
    change_at(total, parts, |sum, more| sum + more);
}

/// Takes light at some places away from that at all, in order.
pub fn take_at(total: &mut [[f32; 4]], parts: &[At]) {
    change_at(total, parts, |sum, less| sum - less);
}

/// Puts light in the place of what was there.
pub fn put_at(total: &mut [[f32; 4]], part: At) {
    change_at(total, &[part], |_, light| light);
}

fn change_at(total: &mut [[f32; 4]], parts: &[At], change: impl Fn(Vec4, Vec4) -> Vec4 + Sync) {
    total.par_chunks_mut(TILE).enumerate().for_each(|(tile, total)| {
        for part in parts {
            for (place, light) in part.within(tile * TILE, tile * TILE + total.len()) {
                total[place] = change(Vec4::from_array(total[place]), light).to_array();
            }
        }
    });
}
