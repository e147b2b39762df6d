//! Cuts a pattern out of a shadow (thesis figures 6.1 and 6.11): stripes, checks, dots, a picture.
//!
//! A pattern is a mask m in [0, 1], 1 where the shadow stays: `v' = v + (1 - v) strength (1 - m)`. It lies on the screen,
//! or in the world, projected onto surfaces. Edges are as soft as asked for and never harder than a pixel; where a pixel
//! covers more than the pattern can show, the pattern goes over into its mean, so that nothing shimmers.

mod place;
mod tiles;

pub use place::{Laid, Spot};
pub use tiles::Tiles;

use super::Ratio;
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

#[derive(Clone, Debug)]
pub enum Shape {
    /// Light and shadow by turns along the first axis.
    Stripes,
    /// Two squares a period along each axis.
    Checker,
    /// Round spots of light, one in each square of a period.
    Dots,
    /// A picture, as high as a period, again and again.
    Image(Tiles),
}

#[derive(Clone, Debug)]
pub struct Pattern {
    pub shape: Shape,
    /// Share of stripes, or of all around dots, that stays in shadow, [0, 1].
    pub fill: f32,
    /// Width of edges: 0 hard, 1 as soft as fits.
    pub softness: f32,
    /// How much light comes through the holes, [0, 1].
    pub strength: f32,
}

/// What is noted of a pattern; shares of the pixels that have a shadow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Told {
    /// Where the pattern is weaker than asked for, because a pixel covers too much of it.
    pub fading: f64,
    /// Where nothing but its mean is left.
    pub faded: f64,
}

impl Pattern {
    /// # Errors
    /// `Compute` for numbers outside of their range.
    pub fn check(&self) -> Result<()> {
        let numbers = [("fill", self.fill), ("softness", self.softness), ("strength", self.strength)];
        match numbers.iter().find(|(_, number)| !(0.0..=1.0).contains(number)) {
            Some((name, number)) => Err(Error::compute(format!("{name} is {number}"), "give a number from 0 to 1")),
            None => Ok(()),
        }
    }

    pub fn apply(&self, ratio: &Ratio, laid: &Laid) -> Result<(Ratio, Told)> {
        self.check()?;
        let mut values = ratio.values.to_vec();
        let rows = values.par_chunks_mut(ratio.width.max(1)).enumerate();
        let counts = rows.map(|(y, row)| {
            let mut counts = [0usize; 3];
            for (x, value) in row.iter_mut().enumerate() {
                let v = Vec3::from_slice(&value[..3]);
                if v == Vec3::ONE {
                    continue;
                }
                counts[0] += 1;
                let (mask, faded) = laid.mean_over_pixel(x, y, |spot| self.mask(spot));
                counts[1] += usize::from(faded > 0.0);
                counts[2] += usize::from(faded >= 1.0);
                let through = (1.0 - v) * (self.strength * (1.0 - mask));
                value[..3].copy_from_slice(&(v + through).to_array());
            }
            counts
        });
        let [shadow, fading, faded] = rows_sum(counts);
        let share = |count: usize| count as f64 / shadow.max(1) as f64;
        Ok((ratio.with(values), Told { fading: share(fading), faded: share(faded) }))
    }

    /// The mask at a spot, and how far it has gone over into its mean there, [0, 1].
    fn mask(&self, spot: Spot) -> (Vec3, f32) {
        let Spot { at, size } = spot;
        if !(at.is_finite() && size.is_finite()) {
            return (self.mean(), 1.0);
        }
        match &self.shape {
            Shape::Stripes => {
                let room = self.fill.min(1.0 - self.fill);
                let off = 0.5 * self.fill - ((at.x - at.x.floor()) - 0.5).abs();
                let faded = fade(size.x, room);
                let mask = ramp(off, (self.softness * room).max(size.x));
                (Vec3::splat(mask + (self.fill - mask) * faded), faded)
            }
            Shape::Checker => {
                let wave = |at: f32, size: f32| {
                    let off = ((at - at.floor()) - 0.5).abs() - 0.25;
                    let faded = fade(size, 0.5);
                    ((2.0 * ramp(off, (0.5 * self.softness).max(size)) - 1.0) * (1.0 - faded), faded)
                };
                let (u, faded) = wave(at.x, size.x);
                let (v, also) = wave(at.y, size.y);
                (Vec3::splat(0.5 + 0.5 * u * v), faded.max(also))
            }
            Shape::Dots => {
                let radius = self.radius();
                let off = ((at - at.floor()) - 0.5).length() - radius;
                let size = size.max_element();
                let faded = fade(size, radius);
                let mask = ramp(off, (self.softness * radius).max(size));
                (Vec3::splat(mask + (self.mean().x - mask) * faded), faded)
            }
            Shape::Image(tiles) => {
                let size = size.max_element();
                let faded = fade(size, 0.5);
                let mask = tiles.sample(at, size);
                (mask + (tiles.mean() - mask) * faded, faded)
            }
        }
    }

    /// Of a dot, in periods.
    fn radius(&self) -> f32 {
        ((1.0 - self.fill) / std::f32::consts::PI).sqrt().min(0.5)
    }

    fn mean(&self) -> Vec3 {
        match &self.shape {
            Shape::Stripes => Vec3::splat(self.fill),
            Shape::Checker => Vec3::splat(0.5),
            Shape::Dots => Vec3::splat(1.0 - std::f32::consts::PI * self.radius().powi(2)),
            Shape::Image(tiles) => tiles.mean(),
        }
    }
}

fn rows_sum(rows: impl ParallelIterator<Item = [usize; 3]>) -> [usize; 3] {
    rows.reduce(|| [0; 3], |a, b| std::array::from_fn(|k| a[k] + b[k]))
}

/// From 0 to 1 over `width` about 0.
fn ramp(off: f32, width: f32) -> f32 {
    (0.5 + off / width.max(1e-6)).clamp(0.0, 1.0)
}

/// How far a part of `room` is gone where a pixel covers `size` (both in periods): it is whole up to its own width, and
/// gone at twice that.
fn fade(size: f32, room: f32) -> f32 {
    (size / room.max(1e-6) - 1.0).clamp(0.0, 1.0)
}

/// A point of the pattern's plane in periods, in front of its axes turned by `angle` (radians, counter-clockwise).
fn turned(at: Vec2, angle: f32) -> Vec2 {
    Vec2::from_angle(-angle).rotate(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(shape: Shape) -> Pattern {
        Pattern { shape, fill: 0.5, softness: 0.0, strength: 1.0 }
    }

    fn at(pattern: &Pattern, x: f32, y: f32, size: f32) -> f32 {
        pattern.mask(Spot { at: Vec2::new(x, y), size: Vec2::splat(size) }).0.x
    }

    #[test]
    fn shapes_by_hand() {
        let stripes = pattern(Shape::Stripes);
        assert_eq!([0.1, 0.3, 0.7, 0.9, -0.1, -0.5].map(|x| at(&stripes, x, 0.3, 0.0)), [0.0, 1.0, 1.0, 0.0, 0.0, 1.0]);
        assert!((at(&Pattern { softness: 1.0, ..stripes }, 0.25 + 0.125, 0.0, 0.0) - 0.75).abs() < 1e-6);
        let checker = pattern(Shape::Checker);
        assert_eq!(
            [(0.1, 0.1), (0.5, 0.1), (0.5, 0.5), (0.1, 0.5)].map(|(x, y)| at(&checker, x, y, 0.0)),
            [1.0, 0.0, 1.0, 0.0]
        );
        let dots = Pattern { fill: 1.0 - std::f32::consts::PI * 0.09, ..pattern(Shape::Dots) };
        assert_eq!([0.5, 0.75, 0.85, 1.0].map(|x| at(&dots, x, 0.5, 0.0)), [0.0, 0.0, 1.0, 1.0]);
    }

    /// Over whole periods the mask has its mean, however large a pixel is, and a large one sees nothing else.
    #[test]
    fn means_stay_and_large_pixels_see_nothing_else() {
        let picture = Tiles::new(2, 2, vec![[0.0; 3], [1.0; 3], [0.25; 3], [0.75; 3]]).unwrap();
        for shape in [Shape::Stripes, Shape::Checker, Shape::Dots, Shape::Image(picture)] {
            for softness in [0.0, 0.5, 1.0] {
                let pattern = Pattern { softness, ..pattern(shape.clone()) };
                for size in [0.0, 0.1, 0.3, 0.45, 0.6, 0.9, 2.0, 1e9, f32::INFINITY] {
                    let n = 200;
                    let sum: f32 = (0..n * n)
                        .map(|i| at(&pattern, (i % n) as f32 / n as f32, (i / n) as f32 / n as f32, size))
                        .sum();
                    let (mean, expected) = (sum / (n * n) as f32, pattern.mean().x);
                    assert!((mean - expected).abs() < 0.06, "{:?} {softness} {size}: {mean}", pattern.shape);
                    if size >= 1.0 {
                        let found = pattern.mask(Spot { at: Vec2::new(0.3, 0.9), size: Vec2::splat(size) });
                        assert_eq!(found, (pattern.mean(), 1.0));
                    }
                }
            }
        }
    }
}
