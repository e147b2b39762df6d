//! How far two layers are apart: figures over pixels, over blocks of one object, and structural similarity.
//!
//! `a` is what is judged, `b` the reference. Sums run in f64 over rows, and rows are added in order, so that a figure
//! does not depend on the number of threads.

mod blocks;
mod similarity;

pub use blocks::{BlockFigures, blocks};
pub use similarity::ssim;

use super::Layer;
use crate::{Error, Result};
use rayon::prelude::*;

/// Figures over all pixels. RMSE, percentile and means leave alpha and values that are not finite out; the rest counts them too.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Figures {
    /// Root of the mean squared difference.
    pub rmse: f64,
    /// 99 of 100 absolute differences are not larger (`percentile`).
    pub p99: f64,
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

    /// The 99th percentile, as `relative`.
    pub fn relative_p99(&self) -> f64 {
        relative(self.p99, self.mean_b)
    }

    /// (mean a - mean b) / mean b; the plain difference where the mean of the reference is 0.
    pub fn bias(&self) -> f64 {
        relative(self.mean_a - self.mean_b, self.mean_b)
    }

    pub fn equal(&self) -> bool {
        self.differing == 0 && self.left_out.is_empty()
    }
}

fn relative(difference: f64, mean: f64) -> f64 {
    if mean == 0.0 { difference } else { difference / mean.abs() }
}

/// The smallest of the values that `share` of them do not exceed (nearest rank); 0 of none.
fn percentile(values: &mut [f32], share: f64) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let rank = ((share * values.len() as f64).ceil() as usize).clamp(1, values.len());
    *values.select_nth_unstable_by(rank - 1, f32::total_cmp).1
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
    /// Absolute differences of what the sums count.
    differences: Vec<f32>,
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
                    row.differences.push((u - v).abs());
                    let (u, v) = (f64::from(u), f64::from(v));
                    row.squares += (u - v) * (u - v);
                    row.sum_a += u;
                    row.sum_b += v;
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
        all.differences.extend(row.differences);
        let (sum, part) = (&mut all.figures, row.figures);
        sum.differing += part.differing;
        sum.not_finite_a += part.not_finite_a;
        sum.not_finite_b += part.not_finite_b;
        sum.not_finite_differing += part.not_finite_differing;
        if part.max > sum.max {
            (sum.max, sum.max_at, sum.max_channel) = (part.max, part.max_at, part.max_channel);
        }
    }
    let count = all.differences.len().max(1) as f64;
    let only =
        |x: &Layer, y: &Layer| x.channels.iter().filter(|c| y.channel(c).is_none()).cloned().collect::<Vec<String>>();
    Ok(Figures {
        rmse: (all.squares / count).sqrt(),
        p99: f64::from(percentile(&mut all.differences, 0.99)),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Content;

    pub fn layer(data: Vec<f32>) -> Layer {
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
    fn percentile_is_of_the_nearest_rank() {
        let mut values: Vec<f32> = (1..=200).rev().map(|i| i as f32).collect();
        assert_eq!([0.5, 0.99, 0.991, 1.0].map(|share| percentile(&mut values, share)), [100.0, 198.0, 199.0, 200.0]);
        assert_eq!((percentile(&mut [7.0], 0.99), percentile(&mut [], 0.99)), (7.0, 0.0));
        // 2 of 300 values differ: less than one in a hundred; 4 of 300: more.
        let b = layer(vec![2.0; 300]);
        let with = |count: usize| {
            b.with_data((0..300).map(|i| if i % 70 == 0 && i / 70 < count { 5.0 } else { 2.0 }).collect())
        };
        assert_eq!([2, 4].map(|count| compare(&with(count), &b, 10).unwrap().relative_p99()), [0.0, 1.5]);
        assert!((compare(&with(4), &b, 10).unwrap().bias() - 0.02).abs() < 1e-12);
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
}
