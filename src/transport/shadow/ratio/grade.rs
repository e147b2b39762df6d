//! Darkness and colour of a shadow (thesis 6.7.5: gradients and recolouring as operations on ratios).

use super::Ratio;
use super::frame::Units;
use crate::image::colour;
use glam::{DVec2, Mat3, Vec3};
use rayon::prelude::*;

/// On the shadow `S = 1 - v` per channel, in this order:
///
/// ```text
/// strength    S k up to 1; above, v^k: as if the shadow fell k times. Never below 0.
/// hue, saturation, tint    (1 - tint) (hue saturation S)
/// brightness  v (1 + (b - 1) S): what light is left, times b in the depth of the shadow
/// gradient    how much of all this: 0 at `from`, 1 at `to`
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grade {
    /// 0 or more; 0 is no shadow, 1 as it is.
    pub strength: f32,
    /// Degrees.
    pub hue: f32,
    pub saturation: f32,
    pub brightness: f32,
    /// Light that comes through, linear RGB, 0 for none.
    pub tint: Vec3,
    /// Points of the picture, in heights.
    pub gradient: Option<[DVec2; 2]>,
}

impl Grade {
    pub const NONE: Self =
        Self { strength: 1.0, hue: 0.0, saturation: 1.0, brightness: 1.0, tint: Vec3::ZERO, gradient: None };

    pub fn changes_nothing(&self) -> bool {
        let Self { strength, brightness, tint, .. } = *self;
        strength == 1.0 && brightness == 1.0 && tint == Vec3::ZERO && self.matrix() == Mat3::IDENTITY
    }

    fn matrix(&self) -> Mat3 {
        Mat3::from_diagonal(1.0 - self.tint) * colour::hue(self.hue) * colour::saturation(self.saturation)
    }

    pub fn apply(&self, ratio: &Ratio) -> Ratio {
        let units = Units::heights(ratio);
        let matrix = self.matrix();
        let line = self.gradient.map(|[from, to]| (from, (to - from) / (to - from).length_squared().max(1e-12)));
        let mut values = ratio.values.to_vec();
        values.par_chunks_mut(ratio.width.max(1)).enumerate().for_each(|(y, row)| {
            for (x, value) in row.iter_mut().enumerate() {
                let v = Vec3::from_slice(&value[..3]);
                if v == Vec3::ONE {
                    continue;
                }
                let share =
                    line.map_or(1.0, |(from, along)| (units.of_pixel(x, y) - from).dot(along).clamp(0.0, 1.0) as f32);
                let graded = if share > 0.0 { self.value(matrix, v) } else { v };
                let mixed = if share < 1.0 { v + (graded - v) * share } else { graded };
                value[..3].copy_from_slice(&mixed.to_array());
            }
        });
        ratio.with(values)
    }

    fn value(&self, matrix: Mat3, v: Vec3) -> Vec3 {
        let k = self.strength;
        let darker = |v: f32| match k {
            1.0 => v,
            k if k < 1.0 => 1.0 - k * (1.0 - v),
            _ if v > 0.0 => v.powf(k).min(super::quotient::LARGEST),
            _ => v,
        };
        let mut v = Vec3::from(v.to_array().map(darker));
        if matrix != Mat3::IDENTITY {
            v = 1.0 - matrix * (1.0 - v);
        }
        if self.brightness != 1.0 {
            let change = self.brightness - 1.0;
            // Where removal darkened (v above 1) there is no shadow to brighten.
            v = Vec3::from(v.to_array().map(|v| if v < 1.0 { v * (1.0 + change * (1.0 - v)) } else { v }));
        }
        v
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graded(grade: Grade, v: [f32; 3]) -> [f32; 3] {
        let ratio = Ratio { width: 1, height: 1, values: vec![[v[0], v[1], v[2], 1.0]].into(), ..Ratio::default() };
        let found = grade.apply(&ratio).values[0];
        [found[0], found[1], found[2]]
    }

    #[track_caller]
    fn near(a: [f32; 3], b: [f32; 3]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
    }

    #[test]
    fn values_by_hand() {
        let shade = [0.5, 0.2, 0.0];
        near(graded(Grade::NONE, shade), shade);
        near(graded(Grade { strength: 0.5, ..Grade::NONE }, shade), [0.75, 0.6, 0.5]);
        near(graded(Grade { strength: 2.0, ..Grade::NONE }, shade), [0.25, 0.04, 0.0]);
        assert_eq!(graded(Grade { strength: 0.0, ..Grade::NONE }, shade), [1.0; 3]);
        assert_eq!(graded(Grade { strength: 0.0, ..Grade::NONE }, [3.0, -1.0, 1e30]), [1.0; 3]);
        near(graded(Grade { tint: Vec3::new(1.0, 0.5, 0.0), ..Grade::NONE }, shade), [1.0, 0.6, 0.0]);
        near(graded(Grade { brightness: 2.0, ..Grade::NONE }, shade), [0.75, 0.36, 0.0]);
        near(graded(Grade { brightness: 0.0, ..Grade::NONE }, shade), [0.25, 0.04, 0.0]);
        // Saturation 0: the luminance of the shadow in all channels.
        let grey = 1.0 - (0.2126 * 0.5 + 0.7152 * 0.8 + 0.0722);
        near(graded(Grade { saturation: 0.0, ..Grade::NONE }, shade), [grey; 3]);
        assert!(graded(Grade { strength: 5.0, ..Grade::NONE }, [1e30, -2.0, 0.5]).iter().all(|v| v.is_finite()));
    }

    #[test]
    fn no_shadow_stays_none_whatever_is_done() {
        let all = Grade {
            strength: 1.7,
            hue: 40.0,
            saturation: 2.0,
            brightness: 0.3,
            tint: Vec3::new(0.1, 0.9, 0.4),
            gradient: Some([DVec2::ZERO, DVec2::ONE]),
        };
        assert_eq!(graded(all, [1.0; 3]), [1.0; 3]);
    }

    #[test]
    fn a_gradient_runs_from_one_point_to_the_other() {
        let ratio = Ratio { width: 4, height: 1, values: vec![[0.0, 0.0, 0.0, 1.0]; 4].into(), ..Ratio::default() };
        let gradient = Some([DVec2::new(0.5, 0.0), DVec2::new(2.5, 0.0)]);
        let fade = Grade { strength: 0.0, gradient, ..Grade::NONE }.apply(&ratio);
        assert_eq!(fade.values.iter().map(|v| v[0]).collect::<Vec<_>>(), [0.0, 0.5, 1.0, 1.0]);
    }
}
