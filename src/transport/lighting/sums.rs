//! Sums of light over samples, in parallel and in a fixed order.

use super::positions::TILE;
use glam::Vec4;
use rayon::prelude::*;

/// Adds `count` elements of vectors of light up, in order.
pub fn sum(count: usize, vectors: &[&[[f32; 4]]]) -> Vec<[f32; 4]> {
    let parts: Vec<At> = vectors.iter().map(|vector| At::everywhere(vector)).collect();
    sum_at(count, &parts)
}

/// Light at some places.
pub struct At<'a> {
    /// Ascending; `None`: everywhere.
    pub places: Option<&'a [u32]>,
    /// What counts of it, one a place; `None`: all.
    pub weights: Option<&'a [f32]>,
    pub light: Given<'a>,
}

#[derive(Clone, Copy)]
pub enum Given<'a> {
    /// One element a place.
    Each(&'a [[f32; 4]]),
    /// Rows, and per place four of them and their weights: `kernels::interpolate`, without a vector in between.
    Between { rows: &'a [[f32; 4]], indices: &'a [[u32; 4]], weights: &'a [[f32; 4]] },
}

impl<'a> At<'a> {
    pub fn everywhere(light: &'a [[f32; 4]]) -> Self {
        Self { places: None, weights: None, light: Given::Each(light) }
    }

    /// Hands out what lies in `start..end`: places counted from `start`, and light.
    fn within(&self, start: usize, end: usize, mut take: impl FnMut(usize, Vec4)) {
        let at = |place: usize| self.places.map_or(place, |places| places.partition_point(|&p| (p as usize) < place));
        let mut each = |i: usize, light: Vec4| {
            let place = self.places.map_or(i, |places| places[i] as usize);
            take(place - start, self.weights.map_or(light, |weights| light * weights[i]));
        };
        let range = at(start)..at(end);
        match self.light {
            Given::Each(light) => range.for_each(|i| each(i, Vec4::from_array(light[i]))),
            Given::Between { rows, indices, weights } => range.for_each(|i| {
                let mut sum = Vec4::ZERO;
                for (&row, &weight) in indices[i].iter().zip(&weights[i]) {
                    if weight != 0.0 {
                        sum += Vec4::from_array(rows[row as usize]) * weight;
                    }
                }
                each(i, sum);
            }),
        }
    }
}

/// `count` elements: the sum of light at some places, in order; 0 where there is none.
pub fn sum_at(count: usize, parts: &[At]) -> Vec<[f32; 4]> {
    // Zeroed by all threads: memory that is handed out again is not zero yet.
    let mut total: Vec<[f32; 4]> = rayon::iter::repeat_n([0.0; 4], count).with_min_len(TILE).collect();
    change_at(&mut total, parts, |sum, more| sum + more);
    total
}

/// All light without that at some places, in order.
pub fn without(all: &[[f32; 4]], parts: &[At]) -> Vec<[f32; 4]> {
    let mut left: Vec<[f32; 4]> = all.par_iter().with_min_len(TILE).copied().collect();
    change_at(&mut left, parts, |left, less| left - less);
    left
}

/// Puts light in the place of what was there.
pub fn put_at(total: &mut [[f32; 4]], part: At) {
    change_at(total, &[part], |_, light| light);
}

fn change_at(total: &mut [[f32; 4]], parts: &[At], with: impl Fn(Vec4, Vec4) -> Vec4 + Sync) {
    total.par_chunks_mut(TILE).enumerate().for_each(|(tile, total)| {
        for part in parts {
            part.within(tile * TILE, tile * TILE + total.len(), |place, light| {
                total[place] = with(Vec4::from_array(total[place]), light).to_array();
            });
        }
    });
}
