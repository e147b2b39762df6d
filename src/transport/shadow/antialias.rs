//! Smooth edges for pictures with one sample a pixel (thesis 6.8): a bilateral filter takes the picture to twice its
//! width and height, along surfaces, and a box takes it back.
//!
//! Both steps together are one stencil of 3 x 3 pixels, which depends on surfaces alone. It adds weighted differences
//! to a pixel: where all that it looks at is equal, no bit changes.

use super::kinship::{Kin, pixel_angle};
use crate::image::Layer;
use crate::transport::Samples;
use rayon::prelude::*;

/// The eight neighbours of a pixel, row by row.
const NEIGHBOURS: [(isize, isize); 8] = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];

pub struct Stencils {
    width: usize,
    height: usize,
    /// What each neighbour of each pixel gives to it; the pixel gives the rest.
    weights: Vec<[f32; 8]>,
    /// Quarters of pixels that see a surface which no pixel near them has: they keep their pixel's light.
    pub unmatched: usize,
}

impl Stencils {
    /// `fine`: four samples for each pixel of the picture. `own`: what the pixels themselves saw.
    pub fn new(fine: &Samples, own: &(impl Fn(usize) -> Kin + Sync)) -> Self {
        let (across, down) = (fine.width * fine.across, fine.height * fine.down);
        let (width, height) = (across / 2, down / 2);
        let angle = pixel_angle(&fine.camera, height);
        let quarter = |x: usize, y: usize| {
            let (pixel, part) =
                ((y / fine.down) * fine.width + x / fine.across, (y % fine.down) * fine.across + x % fine.across);
            Kin::new(&fine.points[pixel * fine.per_pixel() + part], &fine.camera, angle)
        };
        let mut weights = vec![[0.0; 8]; width * height];
        let rows = weights.par_chunks_mut(width.max(1)).enumerate();
        let unmatched = rows.map(|(y, row)| {
            let mut unmatched = 0;
            for (x, weights) in row.iter_mut().enumerate() {
                let around = |(dx, dy): (isize, isize)| {
                    let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
                    (x < width && y < height).then(|| own(y * width + x))
                };
                let middle = own(y * width + x);
                let near = NEIGHBOURS.map(around);
                for corner in 0..4 {
                    let (right, below) = (corner % 2, corner / 2);
                    let sample = quarter(2 * x + right, 2 * y + below);
                    unmatched += usize::from(!add(&sample, &middle, &near, [right, below], weights));
                }
            }
            unmatched
        });
        let unmatched = rows_sum(unmatched);
        Self { width, height, weights, unmatched }
    }

    pub fn bytes(&self) -> u64 {
        32 * self.weights.len() as u64
    }

    /// The layer with smooth edges, all of its channels. Pixels that are not finite stay as they are and give nothing to
    /// their neighbours; how many there are is the second result.
    pub fn apply(&self, layer: &Layer) -> (Vec<f32>, usize) {
        let stride = layer.channels.len();
        let source = &layer.data;
        let finite = |pixel: usize| source[pixel * stride..][..stride].iter().all(|x| x.is_finite());
        let mut data = source.to_vec();
        let rows = data.par_chunks_mut((stride * self.width).max(1)).enumerate();
        let bad = rows.map(|(y, row)| {
            let mut bad = 0;
            for (x, pixel) in row.chunks_exact_mut(stride).enumerate() {
                let i = y * self.width + x;
                if !finite(i) {
                    bad += 1;
                    continue;
                }
                for ((dx, dy), weight) in NEIGHBOURS.into_iter().zip(self.weights[i]) {
                    if weight == 0.0 {
                        continue;
                    }
                    let other = i.wrapping_add_signed(dy * self.width as isize + dx);
                    if finite(other) {
                        for (c, value) in pixel.iter_mut().enumerate() {
                            *value += weight * (source[other * stride + c] - source[i * stride + c]);
                        }
                    }
                }
            }
            bad
        });
        let bad = rows_sum(bad);
        (data, bad)
    }

    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }
}

fn rows_sum(rows: impl ParallelIterator<Item = usize>) -> usize {
    rows.sum()
}

/// Adds what neighbours give to one quarter of a pixel. Weights of the four nearest pixels: bilinear times kinship; where
/// none of them is kin, those of all nine. False where none of those is either.
fn add(
    sample: &Kin,
    middle: &Kin,
    near: &[Option<Kin>; 8],
    [right, below]: [usize; 2],
    weights: &mut [f32; 8],
) -> bool {
    let towards = [if right == 1 { 1 } else { -1 }, if below == 1 { 1 } else { -1 }];
    for all in [false, true] {
        // Tents of a pixel at a quarter of one from its middle: 3/4 and 1/4.
        let tent = |d: isize, towards: isize| match d {
            0 => 0.75,
            d if d == towards => 0.25,
            _ if all => 0.125,
            _ => 0.0,
        };
        let weight = |k: usize| {
            let (dx, dy) = NEIGHBOURS[k];
            let tents = tent(dx, towards[0]) * tent(dy, towards[1]);
            near[k].as_ref().filter(|_| tents > 0.0).map_or(0.0, |kin| tents * sample.with(kin))
        };
        let shares: [f32; 8] = std::array::from_fn(weight);
        let total = 0.5625 * sample.with(middle) + shares.iter().sum::<f32>();
        if total > 1e-3 {
            weights.iter_mut().zip(shares).for_each(|(weight, share)| *weight += 0.25 * share / total);
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Device;
    use crate::image::Content;
    use crate::scene::builtin;

    fn stencils() -> (Stencils, Samples) {
        let room = builtin::scene("room").unwrap();
        let view =
            |size, per_pixel| Samples::view(&Device::Cpu, &room.geometry, &room.cameras[0], size, per_pixel).unwrap();
        let own = view((48, 36), 1);
        let stencils = Stencils::new(&view((48, 36), 4), &Kin::of_pixels(&own));
        let twice = Stencils::new(&view((96, 72), 1), &Kin::of_pixels(&own));
        assert_eq!(stencils.weights, twice.weights, "four samples a pixel, or twice the size");
        (stencils, own)
    }

    #[test]
    fn nothing_changes_a_flat_region_and_objects_do_not_mix_within_themselves() {
        let (stencils, own) = stencils();
        let flat = Layer::new("", &["R", "G", "B", "A"], Content::Colour, [0.3, 0.1, 7.7, 1.0].repeat(48 * 36));
        assert_eq!(stencils.apply(&flat), (flat.data.to_vec(), 0));
        // Each object in its own grey: only pixels at borders change, and stay between their neighbours.
        let object = |i: usize| own.points[i].object as f32;
        let grey = Layer::new("", &["Y"], Content::Colour, (0..48 * 36).map(object).collect());
        let (smooth, _) = stencils.apply(&grey);
        let mut changed = 0;
        for (i, value) in smooth.iter().enumerate() {
            let (x, y) = (i % 48, i / 48);
            let around: Vec<f32> = (0..48 * 36)
                .filter(|j: &usize| (j % 48).abs_diff(x) <= 1 && (j / 48).abs_diff(y) <= 1)
                .map(|j| grey.data[j])
                .collect();
            let (low, high) = around.iter().fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
            assert!((low - 1e-4..=high + 1e-4).contains(value));
            assert!(low < high || *value == grey.data[i]);
            changed += usize::from(*value != grey.data[i]);
        }
        assert!((40..900).contains(&changed), "{changed} pixels changed");
    }

    #[test]
    fn what_is_not_finite_stays_alone() {
        let (stencils, _) = stencils();
        let mut data = vec![0.5; 48 * 36];
        data[700] = f32::NAN;
        let layer = Layer::new("", &["Y"], Content::Colour, data);
        let (smooth, bad) = stencils.apply(&layer);
        assert_eq!((bad, smooth.iter().filter(|x| x.is_nan()).count()), (1, 1));
        assert!(smooth.iter().filter(|x| !x.is_nan()).all(|x| *x == 0.5));
    }
}
