//! Visibility ratios out of two pictures, and shadows out of ratios (thesis 6.7.1, 6.7.4).

use super::Ratio;
use crate::image::Layer;
use rayon::prelude::*;

/// Ratios go no further than this either way, so that sums of them stay finite.
pub const LARGEST: f32 = 1e30;
/// Light below this share of the picture's mean is no light to compare with.
const DARK: f64 = 1e-6;
/// Shadows darker than this leave nothing to divide them out of.
const DEEP: f32 = 1.0 / 256.0;
/// Pixels that one task works on; sums run over whole blocks in order.
const BLOCK: usize = 4096;

/// What a division or a product met. Pixels, but for `limited`: values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Met {
    /// Pixels where a channel had no light to compare: its ratio is 1, or on its way there.
    pub undefined: usize,
    /// Pixels that hold NaN or infinity.
    pub not_finite: usize,
    /// Values too large, cut.
    pub limited: usize,
}

impl Met {
    fn and(self, other: Self) -> Self {
        Self {
            undefined: self.undefined + other.undefined,
            not_finite: self.not_finite + other.not_finite,
            limited: self.limited + other.limited,
        }
    }
}

/// `v = original / removed` per channel (eq. 6.1). Both layers have channels R, G, B (at `rgb`) and as many pixels.
///
/// Below `e`, a millionth of the mean of `removed`, the ratio goes over into 1: `v = 1 + t (original / removed - 1)`
/// with `t = (removed / e)^2`, which is finite, continuous, and 1 at 0. A pixel with NaN or infinity in either picture
/// has ratio 1. The fourth element is 1 where a channel has light above `e`.
pub fn divide(original: (&Layer, [usize; 3]), removed: (&Layer, [usize; 3])) -> (Vec<[f32; 4]>, Met) {
    let pixel = |(layer, rgb): (&Layer, [usize; 3]), i: usize| {
        let stride = layer.channels.len();
        rgb.map(|channel| layer.data[i * stride + channel])
    };
    let pixels = removed.0.data.len() / removed.0.channels.len().max(1);
    let blocks: Vec<(f64, usize)> = (0..pixels.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let light = (block * BLOCK..pixels.min((block + 1) * BLOCK)).map(|i| pixel(removed, i));
            light
                .filter(finite)
                .fold((0.0, 0), |(sum, n), c| (sum + c.iter().map(|x| f64::from(x.abs())).sum::<f64>(), n + 3))
        })
        .collect();
    let (sum, count) = blocks.iter().fold((0.0, 0), |(sum, n), block| (sum + block.0, n + block.1));
    let dark = (DARK * sum / count.max(1) as f64) as f32;

    let mut ratios = vec![[1.0; 4]; pixels];
    let met = ratios.par_chunks_mut(BLOCK).enumerate().map(|(block, ratios)| {
        let mut met = Met::default();
        for (i, ratio) in ratios.iter_mut().enumerate() {
            let (o, r) = (pixel(original, block * BLOCK + i), pixel(removed, block * BLOCK + i));
            if !finite(&o) || !finite(&r) {
                met.not_finite += 1;
                ratio[3] = 0.0;
                continue;
            }
            let lit = r.map(|r| r > 0.0 && r >= dark);
            for c in 0..3 {
                ratio[c] = quotient(o[c], r[c], dark);
                if ratio[c].abs() > LARGEST {
                    met.limited += 1;
                    ratio[c] = ratio[c].clamp(-LARGEST, LARGEST);
                }
            }
            ratio[3] = f32::from(lit.contains(&true));
            met.undefined += usize::from(lit.contains(&false));
        }
        met
    });
    let met = met.reduce(Met::default, Met::and);
    (ratios, met)
}

fn finite(rgb: &[f32; 3]) -> bool {
    rgb.iter().all(|x| x.is_finite())
}

fn quotient(original: f32, removed: f32, dark: f32) -> f32 {
    if removed >= dark && removed > 0.0 {
        return original / removed;
    }
    if removed <= 0.0 {
        return 1.0;
    }
    // t original / removed, without dividing by what may be too small.
    let t = removed / dark;
    1.0 - t * t + t * (original / dark)
}

/// `c w` for the channels at `rgb`, or `c w / v` for a picture that still has the shadow `v` (eq. 6.2); others stay.
/// What is not finite in the picture stays as it is, in its own pixel. All are of one size.
pub fn multiply(layer: &Layer, rgb: [usize; 3], ratio: &Ratio, original: Option<&Ratio>) -> (Vec<f32>, Met) {
    let stride = layer.channels.len();
    let mut data = layer.data.to_vec();
    let tasks = data.par_chunks_mut(stride * BLOCK).enumerate();
    let met = tasks.map(|(block, pixels)| {
        let mut met = Met::default();
        for (i, pixel) in pixels.chunks_exact_mut(stride).enumerate() {
            let at = block * BLOCK + i;
            let ratio = ratio.values[at];
            let before = original.map_or([1.0; 4], |original| original.values[at]);
            met.not_finite += usize::from(!finite(&rgb.map(|at| pixel[at])));
            for (c, &at) in rgb.iter().enumerate() {
                let product = pixel[at] * if original.is_some() { exchange(ratio[c], before[c]) } else { ratio[c] };
                if pixel[at].is_finite() {
                    met.limited += usize::from(!product.is_finite());
                    pixel[at] = product.clamp(-f32::MAX, f32::MAX);
                }
            }
        }
        met
    });
    let met = met.reduce(Met::default, Met::and);
    (data, met)
}

/// `w / v`. In the depth of the old shadow v there is nothing left to recover: the factor goes over into 1 there, without
/// a step, and grows no larger than `w / (2 DEEP)`.
fn exchange(w: f32, v: f32) -> f32 {
    let [w, v, deep] = [w, v, DEEP].map(f64::from);
    if w == v { 1.0 } else { ((w * v + deep * deep) / (v * v + deep * deep)) as f32 }
}

/// A picture of shadow alone as a ratio: each pixel's red, green and blue, or its one channel; `inverted` where 1 is in
/// the shadow. What is not finite has ratio 1.
pub fn of_pass(layer: &Layer, channels: [usize; 3], inverted: bool) -> (Vec<[f32; 4]>, Met) {
    let ratio = |pixel: &[f32]| -> [f32; 4] {
        let [r, g, b] = channels.map(|at| if inverted { 1.0 - pixel[at] } else { pixel[at] });
        if finite(&[r, g, b]) {
            let [r, g, b] = [r, g, b].map(|x| x.clamp(-LARGEST, LARGEST));
            return [r, g, b, 1.0];
        }
        [1.0, 1.0, 1.0, 0.0]
    };
    let values: Vec<[f32; 4]> = layer.data.par_chunks(layer.channels.len()).map(ratio).collect();
    let not_finite = values.par_iter().filter(|value| value[3] == 0.0).count();
    (values, Met { not_finite, ..Met::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Content;

    const RGB: [&str; 3] = ["R", "G", "B"];

    fn layer(data: &[f32]) -> Layer {
        Layer::new("", &RGB, Content::Colour, data.to_vec())
    }

    fn over(o: &[f32], r: &[f32]) -> (Vec<[f32; 4]>, Met) {
        divide((&layer(o), [0, 1, 2]), (&layer(r), [0, 1, 2]))
    }

    #[test]
    fn ratios_by_hand() {
        let (ratios, met) = over(&[0.25, 1.0, 3.0, 0.0, 0.0, 0.0], &[1.0, 0.5, 2.0, 1.0, 0.0, 0.0]);
        assert_eq!(ratios, [[0.25, 2.0, 1.5, 1.0], [0.0, 1.0, 1.0, 1.0]]);
        assert_eq!(met, Met { undefined: 1, ..Met::default() });
        let (ratios, met) = over(&[0.5; 6], &[0.0; 6]);
        assert_eq!((ratios, met.undefined), (vec![[1.0, 1.0, 1.0, 0.0]; 2], 2));
        let (ratios, met) = over(&[f32::NAN, 1.0, 1.0, 1.0, 1.0, 1.0], &[1.0, 1.0, 1.0, 1.0, f32::INFINITY, 1.0]);
        assert_eq!((ratios, met.not_finite), (vec![[1.0, 1.0, 1.0, 0.0]; 2], 2));
        assert!(over(&[], &[]).0.is_empty());
    }

    /// Close to the dark the ratio neither jumps nor grows without bounds, and equal pictures have ratio 1 all the way.
    #[test]
    fn ratios_go_over_into_one_in_the_dark() {
        let mut before = None;
        for step in 0..4000 {
            let removed = 1e-9 * 1.005f32.powi(step);
            let v = quotient(2e-6, removed, 1e-6);
            assert!(v.is_finite() && (0.0..=2.1).contains(&v), "{removed} {v}");
            assert!(before.is_none_or(|b: f32| (b - v).abs() < 0.02), "{removed}: {before:?} {v}");
            assert!((quotient(removed, removed, 1e-6) - 1.0).abs() < 2e-7);
            before = Some(v);
        }
        assert_eq!([quotient(1.0, 0.0, 1e-6), quotient(1.0, -1.0, 1e-6), quotient(1.0, 0.0, 0.0)], [1.0; 3]);
        let (ratios, met) = over(&[3e38; 3], &[1e-30, 1e-30, 1e-30]);
        assert_eq!((ratios, met.limited), (vec![[LARGEST, LARGEST, LARGEST, 1.0]], 3));
    }

    #[test]
    fn products_by_hand() {
        let ratio = Ratio {
            width: 2,
            height: 1,
            values: vec![[0.5, 1.0, 2.0, 1.0], [1e30, 0.0, 1.0, 0.0]].into(),
            ..Ratio::default()
        };
        let (data, met) = multiply(&layer(&[1.0, 2.0, 3.0, 1e20, f32::NAN, f32::INFINITY]), [0, 1, 2], &ratio, None);
        assert_eq!(data[..4], [0.5, 2.0, 6.0, f32::MAX]);
        assert!(data[4].is_nan() && data[5] == f32::INFINITY);
        assert_eq!(met, Met { undefined: 0, not_finite: 1, limited: 1 });
    }

    /// A shadow taken out and put in again changes nothing; taken out alone, what was under it comes back.
    #[test]
    fn an_old_shadow_is_divided_out() {
        let one = |v: [f32; 3]| Ratio {
            width: 1,
            height: 1,
            values: vec![[v[0], v[1], v[2], 1.0]].into(),
            ..Ratio::default()
        };
        let exchanged = |w, v| multiply(&layer(&[0.2, 0.4, 0.0]), [0, 1, 2], &one(w), Some(&one(v))).0;
        assert_eq!(exchanged([0.3, 0.7, 0.0], [0.3, 0.7, 0.0]), [0.2, 0.4, 0.0]);
        let lit = exchanged([1.0; 3], [0.5, 0.25, 0.0]);
        assert!((lit[0] - 0.4).abs() < 1e-4 && (lit[1] - 1.6).abs() < 1e-3 && lit[2] == 0.0, "{lit:?}");
        let mut last = exchange(1.0, 1e-6);
        for step in 0..4000 {
            let factor = exchange(1.0, 1e-6 * 1.005f32.powi(step));
            assert!(
                (0.0..=129.0).contains(&factor) && (factor - last).abs() < 0.01 * factor.max(1.0),
                "{last} {factor}"
            );
            last = factor;
        }
    }

    #[test]
    fn passes_by_hand() {
        let pass = Layer::new("shadow", &["Y"], Content::Data, vec![0.25, 1.0, f32::NAN]);
        let (values, met) = of_pass(&pass, [0; 3], false);
        assert_eq!(values, [[0.25, 0.25, 0.25, 1.0], [1.0; 4], [1.0, 1.0, 1.0, 0.0]]);
        assert_eq!(met.not_finite, 1);
        assert_eq!(of_pass(&layer(&[0.25, 0.5, 1.0]), [0, 1, 2], true).0, [[0.75, 0.5, 0.0, 1.0]]);
    }
}
