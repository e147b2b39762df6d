//! Curves on the intensity of light: how a caster/receiver edit makes falloff softer or steeper (thesis 4.4.2).

use crate::kernels::colour_edits::{Knot, evaluate};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What becomes of the luminance of the edited light.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ToneCurve {
    /// No curve.
    #[default]
    None,
    /// `pivot (x / pivot)^(1 / gamma)`: above 1 lifts dim light and softens falloff, below 1 deepens it; light of
    /// luminance `pivot` (W/m²) stays.
    Gamma {
        #[schemars(range(min = 0.1, max = 10.0))]
        gamma: f32,
        #[serde(default = "one")]
        #[schemars(range(min = 1e-6, max = 1e6))]
        pivot: f32,
    },
    /// A smooth curve through two or more points `[luminance in, luminance out]` in rising order; between two points it
    /// never overshoots, beyond the ends it goes on straight. There is no light to scale at luminance 0, so a curve that
    /// does not start there falls to it over the last thousandth of the way from its first point.
    Points(#[schemars(length(min = 2))] Vec<[f32; 2]>),
}

fn one() -> f32 {
    1.0
}

/// Knots a decade in the table of a gamma curve of this power: the cubic between them is off by less than 1e-4 of the
/// value.
fn per_decade(power: f32) -> i32 {
    (5.0 * power).ceil().max(6.0) as i32
}

/// Part of the way from a curve's first point to luminance 0 over which it falls to nothing.
const FADE: f32 = 1.0 / 1024.0;

/// Decades that the table reaches to either side of the pivot: what it holds stays within f32.
fn decades(power: f32) -> i32 {
    (30.0 / power).clamp(1.0, 6.0) as i32
}

impl ToneCurve {
    /// What is wrong with the parameters, if anything.
    pub fn fault(&self) -> Option<String> {
        match self {
            Self::None => None,
            Self::Gamma { gamma, pivot } if *gamma > 0.0 && *pivot > 0.0 && gamma.is_finite() && pivot.is_finite() => {
                None
            }
            Self::Gamma { gamma, pivot } => Some(format!("gamma {gamma} and pivot {pivot} must be above 0")),
            Self::Points(points) if points.len() < 2 => {
                Some(format!("it has {} of the two or more points that a curve needs", points.len()))
            }
            Self::Points(points) => {
                if let Some(bad) = points.iter().find(|p| !p.iter().all(|x| x.is_finite() && *x >= 0.0)) {
                    return Some(format!("point {bad:?} is not a pair of numbers from 0 up"));
                }
                if let Some(falls) = points.windows(2).find(|pair| pair[0][0] >= pair[1][0]) {
                    return Some(format!("point {:?} does not lie right of {:?}", falls[1], falls[0]));
                }
                let knots = self.knots();
                let steep = knots.iter().find(|knot| !(knot.y.is_finite() && knot.slope.is_finite()))?;
                Some(format!("points about {} lie too close together: the curve is too steep for numbers", steep.x))
            }
        }
    }

    /// What becomes of a luminance.
    pub fn at(&self, luminance: f32) -> f32 {
        match &self.knots()[..] {
            [] => luminance,
            knots => evaluate(knots, luminance),
        }
    }

    /// Cubic Hermite knots; empty for no curve.
    pub fn knots(&self) -> Vec<Knot> {
        match self {
            Self::None => Vec::new(),
            Self::Gamma { gamma, pivot } => {
                let power = 1.0 / gamma;
                let (step, reach) = (per_decade(power), decades(power) * per_decade(power));
                let table = (-reach..=reach).map(|i| {
                    let x = pivot * 10f32.powf(i as f32 / step as f32);
                    let y = pivot * (x / pivot).powf(power);
                    Knot::new(x, y, power * y / x)
                });
                from_nothing(table.collect())
            }
            Self::Points(points) => from_nothing(monotone(points)),
        }
    }
}

/// Slopes that keep each piece between its ends (Fritsch and Carlson 1980, with the harmonic mean of Fritsch and
/// Butland 1984).
fn monotone(points: &[[f32; 2]]) -> Vec<Knot> {
    let secant: Vec<f32> = points.windows(2).map(|p| (p[1][1] - p[0][1]) / (p[1][0] - p[0][0])).collect();
    let slope = |i: usize| match (i.checked_sub(1).map(|i| secant[i]), secant.get(i)) {
        (Some(a), Some(&b)) if a * b > 0.0 => {
            let (left, right) = (points[i][0] - points[i - 1][0], points[i + 1][0] - points[i][0]);
            let (wa, wb) = (2.0 * right + left, right + 2.0 * left);
            (wa + wb) / (wa / a + wb / b)
        }
        (Some(_), Some(_)) => 0.0,
        (Some(a), None) => a,
        (None, Some(&b)) => b,
        (None, None) => 1.0,
    };
    points.iter().enumerate().map(|(i, [x, y])| Knot::new(*x, *y, slope(i))).collect()
}

/// A curve is a gain on light, and where it is above 0 at luminance 0, the gain has no bound: light that fades out would
/// stay, and then go all at once. Two knots more bring such a curve to 0 in time.
fn from_nothing(mut knots: Vec<Knot>) -> Vec<Knot> {
    let [first, second] = [knots[0], knots[1]];
    let at = FADE * if first.x > 0.0 { first.x } else { second.x };
    let y = first.y + (at - first.x) * first.slope;
    let lifts_black = first.y - first.x * first.slope > 0.0;
    if !lifts_black || at <= 0.0 || y <= 0.0 {
        return knots;
    }
    let secant = y / at;
    let slope = (2.0 * secant - first.slope).min(3.0 * secant);
    knots.splice(..usize::from(first.x <= 0.0), [Knot::new(0.0, 0.0, slope), Knot::new(at, y, first.slope)]);
    knots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_that_lift_black_start_from_nothing() {
        for points in [vec![[0.0, 0.5], [1.0, 1.0]], vec![[0.5, 0.5], [1.0, 0.25]], vec![[0.25, 1.0], [1.0, 1.25]]] {
            let knots = ToneCurve::Points(points.clone()).knots();
            assert_eq!((knots[0].x, knots[0].y), (0.0, 0.0), "{knots:?}");
            assert!(knots.windows(2).all(|pair| pair[0].x < pair[1].x), "{knots:?}");
            assert!(
                points.iter().skip(usize::from(points[0][0] == 0.0)).all(|p| knots.iter().any(|k| [k.x, k.y] == *p))
            );
        }
        let through = ToneCurve::Points(vec![[0.0, 0.0], [1.0, 3.0]]);
        assert_eq!(through.knots().len(), 2, "nothing to add");
        let lift = ToneCurve::Gamma { gamma: 2.0, pivot: 1.0 }.knots();
        assert_eq!((lift[0].x, lift[0].y), (0.0, 0.0));
        assert!(ToneCurve::Gamma { gamma: 0.5, pivot: 1.0 }.knots()[0].x > 0.0, "falls to 0 by itself");
    }

    #[test]
    fn straight_points_make_a_straight_line() {
        let knots = ToneCurve::Points(vec![[0.0, 0.0], [1.0, 2.0], [4.0, 8.0]]).knots();
        assert!(knots.iter().all(|knot| (knot.slope - 2.0).abs() < 1e-6), "{knots:?}");
    }

    #[test]
    fn a_peak_is_flat() {
        let knots = ToneCurve::Points(vec![[0.0, 0.0], [1.0, 1.0], [2.0, 0.5]]).knots();
        assert_eq!(knots[1].slope, 0.0);
    }

    #[test]
    fn faults_are_named() {
        for bad in [
            ToneCurve::Points(vec![]),
            ToneCurve::Points(vec![[1.0, 2.0]]),
            ToneCurve::Points(vec![[0.0, 0.0], [1e-45, 1.0]]),
            ToneCurve::Points(vec![[1.0, 0.0], [1.0, 1.0]]),
            ToneCurve::Points(vec![[0.0, f32::NAN]]),
            ToneCurve::Gamma { gamma: 0.0, pivot: 1.0 },
        ] {
            assert!(bad.fault().is_some(), "{bad:?}");
        }
        assert!(ToneCurve::Points(vec![[0.0, 1.0], [2.0, 0.0]]).fault().is_none());
    }
}
