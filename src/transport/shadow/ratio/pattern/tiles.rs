//! A picture as a pattern: it repeats both ways, and is looked up at the size that a pixel covers.

use crate::{Error, Result};
use glam::{Vec2, Vec3};

/// Levels of halved size down to one texel, each the mean over the area of its texels.
#[derive(Clone, Debug)]
pub struct Tiles {
    levels: Vec<Level>,
    aspect: f32,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    texels: Vec<Vec3>,
}

impl Tiles {
    /// Row-major from the top, RGB in [0, 1]: 1 keeps the shadow.
    ///
    /// # Errors
    /// `Compute` for a picture without pixels.
    pub fn new(width: usize, height: usize, texels: Vec<[f32; 3]>) -> Result<Self> {
        if width == 0 || height == 0 || texels.len() != width * height {
            return Err(Error::compute(
                format!("a pattern of {width} x {height} pixels"),
                "give a picture with pixels",
            ));
        }
        let mut levels = vec![Level { width, height, texels: texels.into_iter().map(Vec3::from).collect() }];
        while let Some(level) = levels.last().filter(|level| level.texels.len() > 1) {
            levels.push(level.halved());
        }
        Ok(Self { levels, aspect: width as f32 / height as f32 })
    }

    pub fn mean(&self) -> Vec3 {
        self.levels.last().expect("there is a first").texels[0]
    }

    /// `at`: (0, 0) is the lower left corner, a period is the height. `size`: what a pixel covers.
    pub fn sample(&self, at: Vec2, size: f32) -> Vec3 {
        let at = Vec2::new(at.x / self.aspect, -at.y);
        let at = at - at.floor();
        let fineness = (size * self.levels[0].height as f32).max(1.0).log2();
        let level = (fineness as usize).min(self.levels.len() - 1);
        let fine = self.levels[level].bilinear(at);
        match self.levels.get(level + 1) {
            Some(coarse) => fine.lerp(coarse.bilinear(at), fineness - level as f32),
            None => fine,
        }
    }
}

impl Level {
    /// Half the size, rounded up; each texel is the mean over the area that it covers, parts of texels included.
    fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let (across, down) = (overlaps(self.width, width), overlaps(self.height, height));
        let mut texels = Vec::with_capacity(width * height);
        for rows in &down {
            for columns in &across {
                let mut sum = Vec3::ZERO;
                for &(y, dy) in rows {
                    for &(x, dx) in columns {
                        sum += self.texels[y * self.width + x] * (dx * dy);
                    }
                }
                texels.push(sum);
            }
        }
        Self { width, height, texels }
    }

    fn bilinear(&self, at: Vec2) -> Vec3 {
        let place = at * Vec2::new(self.width as f32, self.height as f32) - 0.5;
        let low = place.floor();
        let part = place - low;
        let wrap = |i: f32, n: usize| (i as i64).rem_euclid(n as i64) as usize;
        let texel = |x: f32, y: f32| self.texels[wrap(y, self.height) * self.width + wrap(x, self.width)];
        let row = |y: f32| texel(low.x, y).lerp(texel(low.x + 1.0, y), part.x);
        row(low.y).lerp(row(low.y + 1.0), part.y)
    }
}

/// For each of `few` equal parts of a line: which of `many` equal parts it covers, and what share of it each is.
fn overlaps(many: usize, few: usize) -> Vec<Vec<(usize, f32)>> {
    let scale = many as f64 / few as f64;
    let part = |k: usize| {
        let (from, to) = (k as f64 * scale, (k + 1) as f64 * scale);
        let share = |i: usize| ((to.min((i + 1) as f64) - from.max(i as f64)) / scale) as f32;
        (from as usize..many.min(to.ceil() as usize)).map(|i| (i, share(i))).filter(|(_, share)| *share > 0.0).collect()
    };
    (0..few).map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_keep_the_mean_and_tiles_repeat() {
        for (width, height) in [(1, 1), (2, 2), (3, 5), (7, 1), (64, 48)] {
            let texels: Vec<[f32; 3]> = (0..width * height).map(|i| [(i * 37 % 11) as f32 / 10.0; 3]).collect();
            let mean = texels.iter().map(|t| t[0]).sum::<f32>() / texels.len() as f32;
            let tiles = Tiles::new(width, height, texels.clone()).unwrap();
            assert!((tiles.mean().x - mean).abs() < 1e-5, "{width} x {height}");
            // The middle of the first texel, upper left, and a period to each side.
            let at = Vec2::new(0.5 / height as f32, 1.0 - 0.5 / height as f32);
            let aspect = width as f32 / height as f32;
            for place in [at, at + Vec2::new(aspect, 0.0), at - Vec2::new(3.0 * aspect, 2.0)] {
                assert!((tiles.sample(place, 0.0).x - texels[0][0]).abs() < 1e-3, "{width} x {height} {place}");
            }
            assert!((tiles.sample(at, 1e6).x - mean).abs() < 1e-5);
        }
        assert!(Tiles::new(0, 3, vec![]).is_err());
    }
}
