//! From light as it was and as an edit made it to scale and offset, channel by channel: `edited = scale original +
//! offset` (thesis 5.5.2, Algorithm 11).
//!
//! The thesis divides where the original is above an epsilon and puts all into the offset where it is below, so a pixel
//! jumps when its light fades through the epsilon and the light then changes. Here both take over smoothly:
//!
//! ```text
//! scale  = (edited original + grey e²) / (original² + e²)      e² = (RELATIVE largest channel)² + FLOOR²
//! offset = edited - scale original
//! ```
//!
//! What scale and offset give for the light that they were made from is the edited light, whatever `e`. `e` says how
//! they share it: a channel far above `e` is scaled (up to a millionth), one that is dark beside the others or in the
//! dark altogether is offset. Its scale is then `grey`, what the edit does to grey light, so that an unlit surface that a
//! lamp reaches later is edited like its neighbours. Scales stay within `grey + edited / 2e` and `LARGEST`.

use crate::image::colour::LUMINANCE;
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;

/// A channel below this part of the largest channel is offset rather than scaled.
pub const RELATIVE: f64 = 1e-3;
/// Light below this, in its own unit (W/m², W/(sr m²)), is offset rather than scaled.
pub const FLOOR: f64 = 1e-6;
/// Scales are held within plus and minus this; the offset takes the rest.
pub const LARGEST: f64 = 65504.0;

/// One of each for every sample; fourth elements are 1 and 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fit {
    pub scale: Vec<[f32; 4]>,
    pub offset: Vec<[f32; 4]>,
}

/// Fits samples of equal number, the fourth element of which is not looked at.
///
/// # Errors
/// `Compute` when light is not finite, or the numbers differ.
pub fn fit(original: &[[f32; 4]], edited: &[[f32; 4]]) -> Result<Fit> {
    if original.len() != edited.len() {
        let message = format!("{} samples of light became {}", original.len(), edited.len());
        return Err(Error::compute(message, "this is a fault of the node that edits; please report it"));
    }
    let finite = |light: &[f32; 4]| light[..3].iter().all(|x| x.is_finite());
    let bad = (original, edited).into_par_iter().position_first(|(o, m)| !finite(o) || !finite(m));
    if let Some(at) = bad {
        let message =
            format!("sample {at}: light {:?} became {:?}; it must be finite", &original[at][..3], &edited[at][..3]);
        return Err(Error::compute(message, "look for infinite numbers in lights, materials and edits"));
    }
    let (scale, offset) = (original, edited)
        .into_par_iter()
        .with_min_len(4096)
        .map(|(original, edited)| {
            let [[a, b, c], [d, e, f]] = fit_one(rgb(original), rgb(edited));
            ([a, b, c, 1.0], [d, e, f, 0.0])
        })
        .unzip();
    Ok(Fit { scale, offset })
}

/// Scale and offset of one sample of finite light; `grey` by its luminance, which edits of hue and saturation keep, and 1
/// in the dark.
pub fn fit_one(original: [f32; 3], edited: [f32; 3]) -> [[f32; 3]; 2] {
    let luminance = |light: [f32; 3]| (0..3).map(|c| f64::from(LUMINANCE[c]) * f64::from(light[c])).sum::<f64>();
    let (o, m) = (luminance(original), luminance(edited));
    let grey = ((m * o + FLOOR * FLOOR) / (o * o + FLOOR * FLOOR)).clamp(-LARGEST, LARGEST);
    let (scale, offset) = fit_towards(original.into(), edited.into(), grey as f32);
    [scale.to_array(), offset.to_array()]
}

/// Scale and offset of one sample of finite light.
pub fn fit_towards(original: Vec3, edited: Vec3, grey: f32) -> (Vec3, Vec3) {
    let original = original.to_array();
    let original = original.map(f64::from);
    let largest = original.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
    let e2 = (RELATIVE * largest).powi(2) + FLOOR * FLOOR;
    let (mut scales, mut offsets) = (Vec3::ZERO, Vec3::ZERO);
    for c in 0..3 {
        let (o, m) = (original[c], f64::from(edited[c]));
        let scale = ((m * o + f64::from(grey) * e2) / (o * o + e2)).clamp(-LARGEST, LARGEST) as f32;
        scales[c] = scale;
        offsets[c] = (m - f64::from(scale) * o) as f32;
    }
    (scales, offsets)
}

fn rgb(light: &[f32; 4]) -> [f32; 3] {
    [light[0], light[1], light[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::colour;
    use glam::Mat3;

    /// What scale and offset make of the light that they were fitted to.
    fn rebuilt(original: [f32; 3], [scale, offset]: [[f32; 3]; 2]) -> [f32; 3] {
        std::array::from_fn(|c| (f64::from(scale[c]) * f64::from(original[c]) + f64::from(offset[c])) as f32)
    }

    fn edits() -> Vec<(&'static str, Mat3)> {
        vec![
            ("brightness", Mat3::from_diagonal(Vec3::splat(3.0))),
            ("dark", Mat3::ZERO),
            ("hue", colour::hue(120.0)),
            ("grey", colour::saturation(0.0)),
            ("vivid", colour::saturation(3.0)),
            ("negative", Mat3::from_diagonal(Vec3::splat(-2.0))),
        ]
    }

    const COLOURS: [[f32; 3]; 5] =
        [[1.0, 1.0, 1.0], [1.0, 0.4, 0.1], [1.0, 0.0, 0.0], [0.0, 1e-3, 1.0], [1.0, 1.1e-3, 0.9e-3]];

    /// The largest second difference of a curve.
    fn bend(curve: &[f64]) -> f64 {
        curve.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).fold(0.0, f64::max)
    }

    /// Scale, offset and what they make, while light of one colour fades from `from` to zero in equal steps; per
    /// channel. Offset and light in units of `from`.
    fn fades(
        colour: [f32; 3],
        edit: Mat3,
        from: f32,
        fit: impl Fn([f32; 3], [f32; 3]) -> [[f32; 3]; 2],
    ) -> Vec<Vec<f64>> {
        const STEPS: usize = 2000;
        let mut curves = vec![Vec::new(); 9];
        for step in (0..=STEPS).rev() {
            let original = colour.map(|c| c * from * (step as f32 / STEPS as f32));
            let edited = (edit * Vec3::from(original)).to_array();
            let found = fit(original, edited);
            for (c, value) in rebuilt(original, found).into_iter().enumerate() {
                curves[c].push(f64::from(found[0][c]));
                curves[3 + c].push(f64::from(found[1][c] / from));
                curves[6 + c].push(f64::from(value / from));
            }
        }
        curves
    }

    /// Through and below the floor: a curve that goes from 0 to 3 with the floor at 1/20 of the way bends by up to
    /// 2 x 3 (20 / 2000)² = 6e-4 a step, and `grey` fades with it; a jump would be the height of the curve.
    #[test]
    fn nothing_jumps_while_light_fades_to_nothing() {
        for (name, edit) in edits() {
            for colour in COLOURS {
                for from in [20e-6, 1e-4, 1e-6] {
                    for (which, curve) in fades(colour, edit, from, fit_one).iter().enumerate() {
                        assert!(curve.iter().all(|x| x.is_finite()), "{name} of {colour:?}");
                        let steps_per_floor = 2000.0 * FLOOR / f64::from(from);
                        let most = 1e-6 + 16.0 * (1.0 / steps_per_floor).powi(2).min(1.0);
                        assert!(bend(curve) <= most, "{name} of {colour:?}, curve {which}: {} > {most}", bend(curve));
                    }
                }
                // Far above the floor scales stay as they are, and what is rebuilt is a straight line.
                for curve in &fades(colour, edit, 5.0, fit_one)[6..] {
                    assert!(bend(curve) <= 1e-6, "{name} of {colour:?}: {}", bend(curve));
                }
            }
        }
    }

    /// The thesis's own rule jumps, and the measure above sees it.
    #[test]
    fn a_threshold_would_jump() {
        let threshold = |original: [f32; 3], edited: [f32; 3]| {
            let mut both = [[0.0; 3]; 2];
            for c in 0..3 {
                let dark = f64::from(original[c]) <= 1e-6;
                (both[0][c], both[1][c]) = if dark { (0.0, edited[c]) } else { (edited[c] / original[c], 0.0) };
            }
            both
        };
        let curves = fades([1.0; 3], Mat3::from_diagonal(Vec3::splat(3.0)), 20e-6, threshold);
        assert!(bend(&curves[0]) > 1.0);
    }

    #[test]
    fn the_edited_light_comes_back_and_most_of_it_is_scaled() {
        for (name, edit) in edits() {
            for colour in COLOURS {
                for level in [1e-30f32, 1e-7, 1e-3, 1.0, 1e4, 1e20] {
                    let original = colour.map(|c| c * level);
                    let edited = (edit * Vec3::from(original)).to_array();
                    let found = fit_one(original, edited);
                    for (a, b) in rebuilt(original, found).into_iter().zip(edited) {
                        assert!((a - b).abs() <= 1e-6 * edited.iter().fold(level, |l, x| l.max(x.abs())), "{name}");
                    }
                    assert!(found.iter().flatten().all(|x| x.is_finite()), "{name} of {original:?}");
                }
            }
        }
        let [scale, offset] = fit_one([0.5, 0.25, 0.125], [1.0, 0.5, 0.25]);
        assert!(scale.iter().all(|s| (s - 2.0).abs() < 1e-4) && offset.iter().all(|o| o.abs() < 1e-4));
    }

    /// The hue of grey is nobody's: it stays as it is. A channel that is zero gets its light from the offset alone.
    #[test]
    fn hue_of_grey_and_a_channel_of_zero() {
        let turn = colour::hue(90.0);
        let grey = fit_one([0.3; 3], (turn * Vec3::splat(0.3)).to_array());
        assert!(grey[0].iter().all(|s| (s - 1.0).abs() < 1e-4), "{grey:?}");
        let red = [0.7, 0.0, 0.0];
        let turned = (turn * Vec3::from(red)).to_array();
        let [scale, offset] = fit_one(red, turned);
        assert_eq!(offset[1..], turned[1..]);
        assert!(scale.iter().all(|s| (-0.5..=1.5).contains(s)), "{scale:?}");
    }

    #[test]
    fn tiny_huge_and_negative_light_stay_bounded() {
        for o in [0.0, -0.0, 1e-45, 1e-38, 1e-20, 1e-6, 1.0, 1e19, f32::MAX, -1e-3, -f32::MAX] {
            for m in [0.0, 1e-45, 1.0, 1e30, f32::MAX, -f32::MAX, -1.0] {
                let both = fit_one([o, 0.0, 1e-10], [m, m, m]);
                assert!(both.iter().flatten().all(|x| x.is_finite()), "{o} to {m}: {both:?}");
                assert!(both[0].iter().all(|s| s.abs() <= LARGEST as f32), "{o} to {m}: {both:?}");
            }
        }
    }

    #[test]
    fn what_is_not_finite_is_refused_and_named() {
        let fine = [1.0, 2.0, 3.0, f32::NAN];
        assert_eq!(fit(&[fine], &[fine]).unwrap().scale[0][3], 1.0);
        for bad in [f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
            for (original, edited) in [([0.0, bad, 0.0, 0.0], fine), (fine, [0.0, 0.0, bad, 0.0])] {
                let error = fit(&[fine, original], &[fine, edited]).unwrap_err();
                assert!(error.to_string().contains("sample 1"), "{error}");
            }
        }
        assert!(fit(&[fine], &[]).is_err());
    }
}
