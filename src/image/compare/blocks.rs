//! Figures over blocks of pixels that show one object.

use super::{check, percentile, relative};
use crate::image::Layer;
use crate::{Error, Result};

/// Figures over the blocks of one object, or of all.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct BlockFigures {
    /// Cryptomatte id; 0 for all objects together.
    pub object: u32,
    pub blocks: usize,
    /// Root of the mean squared difference of block averages, over the mean of the reference; all channels together.
    pub relative_rmse: f64,
    /// 99 of 100 absolute differences are not larger, over the mean of the reference.
    pub relative_p99: f64,
    /// (mean a - mean b) / mean b.
    pub bias: f64,
    /// Blocks left out because a value in them is not finite.
    pub not_finite: usize,
}

#[derive(Clone, Default)]
struct Sums {
    squares: f64,
    a: f64,
    b: f64,
    differences: Vec<f32>,
    blocks: usize,
    not_finite: usize,
}

impl Sums {
    fn figures(&mut self, object: u32) -> BlockFigures {
        let values = self.differences.len().max(1) as f64;
        let mean = self.b / values;
        BlockFigures {
            object,
            blocks: self.blocks,
            relative_rmse: relative((self.squares / values).sqrt(), mean),
            relative_p99: relative(f64::from(percentile(&mut self.differences, 0.99)), mean),
            bias: relative((self.a - self.b) / values, mean),
            not_finite: self.not_finite,
        }
    }
}

/// The measure that figures of accuracy are given in: averages over `size` x `size` blocks all of whose pixels show
/// the same object. `objects` holds the object of each pixel, 0 where it is not certain (`Cryptomatte::whole`).
/// Returns the figures of all blocks, then those of each object by falling number of blocks. Alpha is left out.
pub fn blocks(a: &Layer, b: &Layer, width: usize, objects: &[u32], size: usize) -> Result<Vec<BlockFigures>> {
    let mut channels = check(a, b, width)?;
    channels.retain(|&(i, _)| a.channels[i] != "A");
    let pixels = a.data.len() / a.channels.len();
    if objects.len() != pixels || size == 0 || channels.is_empty() {
        let found = format!("{pixels} pixels, objects of {} pixels, blocks of {size} x {size}", objects.len());
        return Err(Error::compute(found, "the objects must come from a picture of the same size; blocks from 1 up"));
    }
    let (step_a, step_b) = (a.channels.len(), b.channels.len());
    let mut sums = std::collections::BTreeMap::<u32, Sums>::new();
    let (columns, rows) = (width / size, pixels / width / size);
    for block in 0..columns * rows {
        let origin = (block / columns * width + block % columns) * size;
        let inside = || (0..size * size).map(|k| origin + k / size * width + k % size);
        let object = objects[origin];
        if object == 0 || inside().any(|pixel| objects[pixel] != object) {
            continue;
        }
        let sum = sums.entry(object).or_default();
        let mean = |layer: &Layer, step: usize, channel: usize| {
            let total: f64 = inside().map(|pixel| f64::from(layer.data[pixel * step + channel])).sum();
            total / (size * size) as f64
        };
        let means: Vec<(f64, f64)> = channels.iter().map(|&(i, j)| (mean(a, step_a, i), mean(b, step_b, j))).collect();
        if means.iter().any(|(u, v)| !u.is_finite() || !v.is_finite()) {
            sum.not_finite += 1;
            continue;
        }
        sum.blocks += 1;
        for (u, v) in means {
            sum.differences.push((u - v).abs() as f32);
            sum.squares += (u - v) * (u - v);
            sum.a += u;
            sum.b += v;
        }
    }
    let mut all = Sums::default();
    for sum in sums.values() {
        all.squares += sum.squares;
        all.a += sum.a;
        all.b += sum.b;
        all.differences.extend(&sum.differences);
        all.blocks += sum.blocks;
        all.not_finite += sum.not_finite;
    }
    let mut each: Vec<BlockFigures> = sums.iter_mut().map(|(&object, sum)| sum.figures(object)).collect();
    each.sort_by_key(|figures| std::cmp::Reverse(figures.blocks));
    each.insert(0, all.figures(0));
    Ok(each)
}

#[cfg(test)]
mod tests {
    use super::super::tests::layer;
    use super::*;

    #[test]
    fn blocks_by_hand() {
        // 4 x 2 pixels, two blocks of 2 x 2; the reference is 2 everywhere.
        let b = layer(vec![2.0; 24]);
        let mut data = vec![2.0; 24];
        data[0] = 6.0; // red of pixel 0: the block's average is 3 instead of 2
        let a = b.with_data(data);
        let found = blocks(&a, &b, 4, &[7, 7, 8, 8, 7, 7, 8, 8], 2).unwrap();
        assert_eq!(found.iter().map(|f| (f.object, f.blocks)).collect::<Vec<_>>(), [(0, 2), (7, 1), (8, 1)]);
        assert!((found[0].relative_rmse - (1.0f64 / 6.0).sqrt() / 2.0).abs() < 1e-12);
        assert!((found[1].relative_rmse - (1.0f64 / 3.0).sqrt() / 2.0).abs() < 1e-12);
        assert!((found[1].bias - 1.0 / 6.0).abs() < 1e-12);
        assert_eq!(found[2].relative_rmse, 0.0);
        assert!((found[0].relative_p99 - 0.5).abs() < 1e-12, "the largest of 6 values: 1 of 2");
        // A pixel of another object, or of none, takes its block out.
        let found = blocks(&a, &b, 4, &[7, 0, 8, 8, 7, 7, 8, 9], 2).unwrap();
        assert_eq!(found[0].blocks, 0);
        assert!(blocks(&a, &b, 4, &[7; 7], 2).is_err());
    }
}
