//! How alike two pictures look on a screen.

use crate::image::{Layer, colour};
use glam::Vec3;
use rayon::prelude::*;

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
