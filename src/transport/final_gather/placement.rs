//! Where records go: the picture is looked at from coarse to fine, and what no record covers gets one.
//!
//! Every round asks for one place in each block of pixels that is not covered; what the round gathers covers most of its
//! neighbours. So records depend on the picture alone, whatever the number of threads.

use super::cache::Cache;
use crate::scene::SurfacePoint;
use crate::transport::light_cache::Spot;
use rayon::prelude::*;
use std::cmp::Ordering;

/// Pixels along a side of the first blocks.
const COARSEST: usize = 32;
/// Of those in which one of what is left open gets a record; they are halved round by round.
const LARGEST: usize = 8;
/// Times that all is looked at before what is left then is taken whole.
const ROUNDS: usize = 3;

/// A picture's points, one a pixel.
#[derive(Clone, Copy)]
pub struct View<'a> {
    pub points: &'a [SurfacePoint],
    /// Weights of receivers, those of a pixel one after another.
    pub receivers: &'a [f32],
    pub width: usize,
    pub height: usize,
}

impl<'a> View<'a> {
    pub fn spot(&self, pixel: usize) -> Spot<'a> {
        let count = self.receivers.len() / self.points.len().max(1);
        Spot { point: &self.points[pixel], receivers: &self.receivers[pixel * count..][..count] }
    }
}

/// Hands out rounds of places until all are covered.
pub struct Placement<'a> {
    view: View<'a>,
    share: f32,
    /// What is covered stays so: new records do not make old ones count less far.
    is_settled: bool,
    step: usize,
    rounds: usize,
    /// Pixels along a side of the blocks of the next round; 0: all that was open had its turn.
    block: usize,
    /// Pixels that were not covered when last looked at; `None`: all are to be looked at.
    open: Option<Vec<usize>>,
}

impl<'a> Placement<'a> {
    /// `share`: of the error that the cache allows, what makes a pixel covered. `is_known`: the cache was filled for such a
    /// picture already, and only gaps are looked for.
    pub fn new(view: View<'a>, share: f32, is_known: bool) -> Self {
        let step = if is_known { 1 } else { COARSEST };
        Self { view, share, is_settled: false, step, rounds: 0, block: LARGEST, open: None }
    }

    /// All other pixels are covered, and stay so.
    pub fn of_gaps(view: View<'a>, gaps: Vec<usize>) -> Self {
        Self { is_settled: true, open: Some(gaps), ..Self::new(view, 1.0, true) }
    }

    /// Numbers of the pixels that get records next; nothing when all are covered.
    pub fn next(&mut self, cache: &Cache) -> Vec<usize> {
        while self.step > 1 {
            let step = self.step;
            self.step /= 2;
            let found = self.on_lattice(cache, step);
            if !found.is_empty() {
                return found;
            }
        }
        // Where each had its turn, none is left.
        let left = self.open.take().map(|open| if self.block == 0 { Vec::new() } else { self.still_open(cache, open) });
        let left = left.filter(|left| !left.is_empty() || self.is_settled);
        // New records may have made old ones count less far: all is looked at once more before the end.
        let left = left.unwrap_or_else(|| {
            (self.rounds, self.block) = (self.rounds + 1, LARGEST);
            self.still_open(cache, (0..self.view.points.len()).collect())
        });
        match self.rounds.cmp(&(ROUNDS + 1)) {
            Ordering::Less => {}
            Ordering::Equal => {
                // Or what is taken now would open gaps that nobody looks for.
                self.is_settled = true;
                return left;
            }
            Ordering::Greater => return Vec::new(),
        }
        let next = self.thinned(&left);
        self.block /= 2;
        self.open = Some(left);
        next
    }

    /// Records of the places that were given last leave old ones as they are.
    pub fn is_settled(&self) -> bool {
        self.is_settled
    }

    fn is_open(&self, cache: &Cache, pixel: usize) -> bool {
        let spot = self.view.spot(pixel);
        spot.point.exists() && !cache.columns.covers(&spot, self.share)
    }

    /// Every so many pixels along each axis, from half a step in.
    fn on_lattice(&self, cache: &Cache, step: usize) -> Vec<usize> {
        let View { width, height, .. } = self.view;
        let rows: Vec<usize> = (step / 2..height).step_by(step).collect();
        let row = |&y: &usize| {
            let pixels = (step / 2..width).step_by(step).map(move |x| y * width + x);
            pixels.filter(|pixel| self.is_open(cache, *pixel)).collect::<Vec<_>>()
        };
        rows.par_iter().flat_map_iter(row).collect()
    }

    fn still_open(&self, cache: &Cache, pixels: Vec<usize>) -> Vec<usize> {
        pixels.into_par_iter().with_min_len(1024).filter(|pixel| self.is_open(cache, *pixel)).collect()
    }

    /// One of each block of pixels.
    fn thinned(&self, open: &[usize]) -> Vec<usize> {
        let (width, size) = (self.view.width, self.block);
        let block = |pixel: usize| (pixel / width / size, pixel % width / size);
        let mut sorted: Vec<usize> = open.to_vec();
        sorted.par_sort_unstable_by_key(|&pixel| (block(pixel), pixel));
        let middle = |run: &[usize]| run[run.len() / 2];
        sorted.chunk_by(|a, b| block(*a) == block(*b)).map(middle).collect()
    }
}
