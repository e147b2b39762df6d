//! How far two layers are apart: figures over pixels, over blocks of one object, and structural similarity.
//!
//! `a` is what is judged, `b` the reference. Sums run in f64 over rows, and rows are added in order, so that a figure
//! does not depend on the number of threads.

use super::{Layer, colour};
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;

/// Figures over all pixels. RMSE and means leave alpha and values that are not finite out; the rest counts them too.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Figures {
    /// Root of the mean squared difference.
    pub rmse: f64,
    pub mean_a: f64,
    pub mean_b: f64,
    /// Largest absolute difference, and where.
    pub max: f32,
    pub max_at: [usize; 2],
    pub max_channel: String,
    /// Values that are not equal (NaN equals NaN).
    pub differing: usize,
    /// Values that are NaN or infinite.
    pub not_finite_a: usize,
    pub not_finite_b: usize,
    /// Values that are not finite and not the same on both sides.
    pub not_finite_differing: usize,
    /// Channels that only one side has; they are not compared.
    pub left_out: Vec<String>,
}

impl Figures {
    /// RMSE over the mean of the reference; the plain RMSE where that mean is 0.
    pub fn relative(&self) -> f64 {
        relative(self.rmse, self.mean_b)
    }

    pub fn equal(&self) -> bool {
        self.differing == 0 && self.left_out.is_empty()
    }
}

fn relative(rmse: f64, mean: f64) -> f64 {
    if mean == 0.0 { rmse } else { rmse / mean.abs() }
}

/// Channels that both layers have: position in `a`, position in `b`.
fn common(a: &Layer, b: &Layer) -> Vec<(usize, usize)> {
    a.channels.iter().enumerate().filter_map(|(i, channel)| Some((i, b.channel(channel)?))).collect()
}

fn check(a: &Layer, b: &Layer, width: usize) -> Result<Vec<(usize, usize)>> {
    let size = |layer: &Layer| {
        let pixels = layer.data.len() / layer.channels.len().max(1);
        (width, pixels / width.max(1))
    };
    if size(a) != size(b) || a.data.is_empty() || !a.data.len().is_multiple_of(width * a.channels.len()) {
        let ((w, h), (_, other)) = (size(a), size(b));
        let message = format!("layers of {w} x {h} and {w} x {other} pixels cannot be compared");
        return Err(Error::compute(message, "compare pictures of one size, of at least one pixel"));
    }
    let channels = common(a, b);
    if channels.is_empty() {
        let message = format!(
            "no channel in common: {} has {}, {} has {}",
            a.title(),
            a.channels.join(" "),
            b.title(),
            b.channels.join(" ")
        );
        return Err(Error::compute(message, "name layers of the same kind"));
    }
    Ok(channels)
}

#[derive(Default)]
struct Row {
    squares: f64,
    sum_a: f64,
    sum_b: f64,
    count: usize,
    figures: Figures,
}

/// Compares two layers of `width` pixels a row, channel by channel of the same name.
pub fn compare(a: &Layer, b: &Layer, width: usize) -> Result<Figures> {
    let channels = check(a, b, width)?;
    let (step_a, step_b) = (a.channels.len(), b.channels.len());
    let row = |(y, (row_a, row_b)): (usize, (&[f32], &[f32]))| {
        let mut row = Row::default();
        let figures = &mut row.figures;
        for (x, (pixel_a, pixel_b)) in row_a.chunks(step_a).zip(row_b.chunks(step_b)).enumerate() {
            for &(i, j) in &channels {
                let (u, v) = (pixel_a[i], pixel_b[j]);
                let same = u == v || (u.is_nan() && v.is_nan());
                figures.differing += usize::from(!same);
                figures.not_finite_a += usize::from(!u.is_finite());
                figures.not_finite_b += usize::from(!v.is_finite());
                if !u.is_finite() || !v.is_finite() {
                    figures.not_finite_differing += usize::from(!same);
                    continue;
                }
                if (u - v).abs() > figures.max {
                    figures.max = (u - v).abs();
                    figures.max_at = [x, y];
                    a.channels[i].clone_into(&mut figures.max_channel);
                }
                if a.channels[i] != "A" || channels.len() == 1 {
                    let (u, v) = (f64::from(u), f64::from(v));
                    row.squares += (u - v) * (u - v);
                    row.sum_a += u;
                    row.sum_b += v;
                    row.count += 1;
                }
            }
        }
        row
    };
    let rows_a = a.data.par_chunks(step_a * width.max(1));
    let rows_b = b.data.par_chunks(step_b * width.max(1));
    let rows: Vec<Row> = rows_a.zip(rows_b).enumerate().map(row).collect();
    let mut all = Row::default();
    for row in rows {
        all.squares += row.squares;
        all.sum_a += row.sum_a;
        all.sum_b += row.sum_b;
        all.count += row.count;
        let (sum, part) = (&mut all.figures, row.figures);
        sum.differing += part.differing;
        sum.not_finite_a += part.not_finite_a;
        sum.not_finite_b += part.not_finite_b;
        sum.not_finite_differing += part.not_finite_differing;
        if part.max > sum.max {
            (sum.max, sum.max_at, sum.max_channel) = (part.max, part.max_at, part.max_channel);
        }
    }
    let count = all.count.max(1) as f64;
    let only =
        |x: &Layer, y: &Layer| x.channels.iter().filter(|c| y.channel(c).is_none()).cloned().collect::<Vec<String>>();
    Ok(Figures {
        rmse: (all.squares / count).sqrt(),
        mean_a: all.sum_a / count,
        mean_b: all.sum_b / count,
        left_out: [only(a, b), only(b, a)].concat(),
        ..all.figures
    })
}

/// The layer `a - b`, of the channels that both have.
pub fn difference(a: &Layer, b: &Layer, width: usize) -> Result<Layer> {
    let channels = check(a, b, width)?;
    let (step_a, step_b) = (a.channels.len(), b.channels.len());
    let mut data = vec![0.0; channels.len() * (a.data.len() / step_a)];
    let pixels = a.data.par_chunks(step_a).zip(b.data.par_chunks(step_b));
    data.par_chunks_mut(channels.len()).zip(pixels).for_each(|(out, (u, v))| {
        out.iter_mut().zip(&channels).for_each(|(out, &(i, j))| *out = u[i] - v[j]);
    });
    let names: Vec<&str> = channels.iter().map(|&(i, _)| a.channels[i].as_str()).collect();
    Ok(Layer::new(&a.name, &names, a.content, data))
}

/// Figures over the blocks of one object, or of all.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct BlockFigures {
    /// Cryptomatte id; 0 for all objects together.
    pub object: u32,
    pub blocks: usize,
    /// Root of the mean squared difference of block averages, over the mean of the reference; all channels together.
    pub relative_rmse: f64,
    /// (mean a - mean b) / mean b.
    pub bias: f64,
    /// Blocks left out because a value in them is not finite.
    pub not_finite: usize,
}

#[derive(Clone, Copy, Default)]
struct Sums {
    squares: f64,
    a: f64,
    b: f64,
    values: usize,
    blocks: usize,
    not_finite: usize,
}

impl Sums {
    fn figures(&self, object: u32) -> BlockFigures {
        let values = self.values.max(1) as f64;
        let mean = self.b / values;
        BlockFigures {
            object,
            blocks: self.blocks,
            relative_rmse: relative((self.squares / values).sqrt(), mean),
            bias: if mean == 0.0 { (self.a - self.b) / values } else { (self.a - self.b) / self.b.abs() },
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
        sum.values += means.len();
        for (u, v) in means {
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
        all.values += sum.values;
        all.blocks += sum.blocks;
        all.not_finite += sum.not_finite;
    }
    let mut each: Vec<BlockFigures> = sums.iter().map(|(&object, sum)| sum.figures(object)).collect();
    each.sort_by_key(|figures| std::cmp::Reverse(figures.blocks));
    each.insert(0, all.figures(0));
    Ok(each)
}

/// Structural similarity of what a screen shows: luminance clipped to [0, 1] and sRGB-encoded, windows of 8 x 8 pixels
/// every 4 pixels, K1 = 0.01, K2 = 0.03 (Wang et al. 2004, with a flat window). 1 is equal. Only for layers with R, G
/// and B on both sides.
pub fn ssim(a: &Layer, b: &Layer, width: usize) -> Option<f64> {
    let shown = |layer: &Layer| -> Option<Vec<f32>> {
        let [r, g, b] = layer.rgb()?;
        let encode = |p: &[f32]| {
            let luminance = colour::luminance(Vec3::new(p[r], p[g], p[b]));
            colour::srgb_from_linear(if luminance.is_finite() { luminance.clamp(0.0, 1.0) } else { 0.0 })
        };
        Some(layer.data.par_chunks(layer.channels.len()).map(encode).collect())
    };
    let (a, b) = (shown(a)?, shown(b)?);
    if a.len() != b.len() || a.is_empty() {
        return None;
    }
    let height = a.len() / width;
    let (wide, high) = (width.min(8), height.min(8));
    let window = |x: usize, y: usize| {
        let mut sums = [0.0f64; 5];
        for pixel in (y..y + high).flat_map(|y| (x..x + wide).map(move |x| y * width + x)) {
            let (u, v) = (f64::from(a[pixel]), f64::from(b[pixel]));
            [u, v, u * u, v * v, u * v].iter().zip(&mut sums).for_each(|(value, sum)| *sum += value);
        }
        let [u, v, uu, vv, uv] = sums.map(|sum| sum / (wide * high) as f64);
        let (c1, c2) = (0.01 * 0.01, 0.03 * 0.03);
        (2.0 * u * v + c1) * (2.0 * (uv - u * v) + c2) / ((u * u + v * v + c1) * ((uu - u * u) + (vv - v * v) + c2))
    };
    let line = |y: usize| (0..=width - wide).step_by(4).map(|x| window(x, y)).sum::<f64>();
    let starts: Vec<usize> = (0..=height - high).step_by(4).collect();
    let lines: Vec<f64> = starts.par_iter().map(|&y| line(y)).collect();
    let windows = starts.len() * (0..=width - wide).step_by(4).count();
    Some(lines.iter().sum::<f64>() / windows as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Content;

    fn layer(data: Vec<f32>) -> Layer {
        Layer::new("", &["R", "G", "B"], Content::Colour, data)
    }

    #[test]
    fn figures_by_hand() {
        let b = layer(vec![1.0; 6]);
        let a = b.with_data(vec![1.0, 1.0, 1.0, 1.0, 4.0, 1.0]);
        let figures = compare(&a, &b, 2).unwrap();
        assert_eq!(figures.rmse, 1.5f64.sqrt()); // 3^2 / 6 values
        assert_eq!((figures.max, figures.max_at, figures.max_channel.as_str()), (3.0, [1, 0], "G"));
        assert_eq!(figures.differing, 1);
        assert!(!figures.equal() && compare(&b, &b, 2).unwrap().equal());
        assert_eq!(difference(&a, &b, 2).unwrap().data[..], [0.0, 0.0, 0.0, 0.0, 3.0, 0.0]);
    }

    #[test]
    fn smallest_change_is_seen() {
        let b = layer((0..3 * 64).map(|i| i as f32 / 64.0).collect());
        for texel in [0, 77, 191] {
            let mut data = b.data.to_vec();
            data[texel] = f32::from_bits(data[texel].to_bits() + 1);
            assert!(!compare(&b.with_data(data), &b, 8).unwrap().equal());
        }
        let mut data = b.data.to_vec();
        data[30] += 0.4;
        assert!(ssim(&b.with_data(data), &b, 8).unwrap() < 1.0 - 1e-5);
        assert!((ssim(&b, &b, 8).unwrap() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn not_finite_is_counted_and_left_out() {
        let b = layer(vec![1.0, f32::NAN, 1.0]);
        let a = b.with_data(vec![1.0, f32::NAN, f32::INFINITY]);
        let figures = compare(&a, &b, 1).unwrap();
        assert_eq!((figures.not_finite_a, figures.not_finite_b, figures.not_finite_differing), (2, 1, 1));
        assert_eq!((figures.rmse, figures.differing), (0.0, 1));
        assert_eq!(ssim(&a, &b, 1), Some(1.0), "both shown as black");
    }

    #[test]
    fn sizes_and_channels_must_fit() {
        let b = layer(vec![1.0; 6]);
        assert!(compare(&layer(vec![1.0; 3]), &b, 1).is_err());
        let depth = Layer::new("Z", &["Z"], Content::Data, vec![1.0; 2]);
        assert!(compare(&depth, &b, 2).unwrap_err().to_string().contains("no channel in common"));
        let rgba = Layer::new("", &["R", "G", "B", "A"], Content::Colour, vec![1.0; 8]);
        let figures = compare(&rgba, &b, 2).unwrap();
        assert_eq!((figures.left_out, figures.rmse), (vec!["A".to_owned()], 0.0));
    }

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
        // A pixel of another object, or of none, takes its block out.
        let found = blocks(&a, &b, 4, &[7, 0, 8, 8, 7, 7, 8, 9], 2).unwrap();
        assert_eq!(found[0].blocks, 0);
        assert!(blocks(&a, &b, 4, &[7; 7], 2).is_err());
    }
}
