//! Pictures on surfaces.

use crate::device::Array;

/// Texels in rows, first row first; clones share them.
#[derive(Clone, Debug)]
pub struct Picture<T = [f32; 3]> {
    pub width: usize,
    pub height: usize,
    pub texels: Array<T>,
    /// Of all texels.
    pub mean: T,
}

impl Picture<[f32; 3]> {
    /// `texels`: linear light, `width` x `height`, not empty.
    pub fn colour(width: usize, height: usize, texels: Vec<[f32; 3]>) -> Self {
        let mean = [0, 1, 2].map(|c| mean(texels.iter().map(|texel| texel[c])));
        Self { width, height, texels: texels.into(), mean }
    }
}

impl Picture<f32> {
    /// `texels`: `width` x `height`, not empty.
    pub fn grey(width: usize, height: usize, texels: Vec<f32>) -> Self {
        let mean = mean(texels.iter().copied());
        Self { width, height, texels: texels.into(), mean }
    }
}

/// Of something, not of nothing.
pub(super) fn mean(values: impl ExactSizeIterator<Item = f32>) -> f32 {
    let count = values.len() as f64;
    (values.map(f64::from).sum::<f64>() / count) as f32
}

/// A picture addressed by texture coordinates, wrapping, bilinear; v = 0 is the first row (glTF).
#[derive(Clone, Debug)]
pub struct Texture<T = [f32; 3]> {
    pub picture: Picture<T>,
    /// KHR_texture_transform: `uv' = [m0 m2; m1 m3] uv + [m4 m5]`.
    pub uv_from_uv: [f32; 6],
}

impl Texture<[f32; 3]> {
    pub fn sample(&self, uv: [f32; 2]) -> [f32; 3] {
        self.interpolated(uv, |a, b, t| [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * t))
    }
}

impl Texture<f32> {
    pub fn sample(&self, uv: [f32; 2]) -> f32 {
        self.interpolated(uv, |a, b, t| a + (b - a) * t)
    }
}

impl<T: Copy> Texture<T> {
    /// `mix(a, b, t)` goes from a to b as t goes from 0 to 1.
    fn interpolated(&self, uv: [f32; 2], mix: impl Fn(T, T, f32) -> T) -> T {
        let Picture { width, height, texels, .. } = &self.picture;
        let m = &self.uv_from_uv;
        let u = m[0] * uv[0] + m[2] * uv[1] + m[4];
        let v = m[1] * uv[0] + m[3] * uv[1] + m[5];
        let wrap = |x: f32, n: usize| {
            let x = if x.is_finite() { (x - x.floor()) * n as f32 - 0.5 } else { 0.0 };
            let low = x.floor();
            let index = |i: f32| (i as isize).rem_euclid(n as isize) as usize;
            (index(low), index(low + 1.0), x - low)
        };
        let (x0, x1, fx) = wrap(u, *width);
        let (y0, y1, fy) = wrap(v, *height);
        let row = |y: usize| mix(texels[y * width + x0], texels[y * width + x1], fx);
        mix(row(y0), row(y1), fy)
    }
}
