//! Moves a shadow as a picture: translate, rotate, scale, and a projective map by four corners (thesis 6.7.5).

use super::Ratio;
use super::frame::{Look, Units, place, warp};
use crate::device::Device;
use crate::{Error, Result};
use glam::{DMat2, DMat3, DVec2, DVec3};

/// In units of the picture (`frame`). Corners first, then scale, rotation and translation.
#[derive(Clone, Copy, Debug)]
pub struct Transform {
    pub translate: DVec2,
    /// Radians, counter-clockwise on the screen.
    pub rotate: f64,
    pub scale: DVec2,
    /// What rotation and scale leave where it is; `None`: the middle of the picture.
    pub pivot: Option<DVec2>,
    /// Where the picture's corners go: upper left, upper right, lower right, lower left.
    pub corners: Option<[DVec2; 4]>,
}

const CORNERS: [&str; 4] = ["upper left", "upper right", "lower right", "lower left"];

impl Transform {
    pub fn apply(&self, device: &Device, ratio: &Ratio, units: Units) -> Result<Ratio> {
        let source = self.inverse(units.size(ratio))?;
        warp(device, ratio, |first, places| {
            for (i, out) in places.iter_mut().enumerate() {
                let at = units.of_pixel(i % ratio.width, first + i / ratio.width);
                *out = place(units, look(&source, at));
            }
        })
    }

    /// From points of the result to points of the source, homogeneous; positive where they can be seen.
    ///
    /// # Errors
    /// `Compute` for numbers that are not finite, a scale of 0, corners in a line, crossed over or dented.
    fn inverse(&self, size: DVec2) -> Result<DMat3> {
        let numbers = [self.translate, self.scale, self.pivot.unwrap_or_default(), DVec2::splat(self.rotate)];
        if let Some(bad) = numbers.iter().flat_map(|v| v.to_array()).find(|x| !x.is_finite()) {
            return Err(Error::compute(format!("a parameter is {bad}"), "give finite numbers"));
        }
        if self.scale.x.abs() < 1e-9 || self.scale.y.abs() < 1e-9 {
            let message = format!("a scale of {} x {} leaves nothing", self.scale.x, self.scale.y);
            return Err(Error::compute(message, "give a scale above 0 (or below, to mirror)"));
        }
        let pivot = self.pivot.unwrap_or(0.5 * size);
        let moved = DMat3::from_translation(self.translate + pivot)
            // y points down: counter-clockwise is the other way round.
            * DMat3::from_angle(-self.rotate)
            * DMat3::from_scale(self.scale)
            * DMat3::from_translation(-pivot);
        let from_square = match self.corners {
            Some(corners) => {
                check(&corners)?;
                square_to(corners) * DMat3::from_scale(1.0 / size)
            }
            None => DMat3::IDENTITY,
        };
        let inverse = (moved * from_square).inverse();
        let middle = moved * from_square * (0.5 * size).extend(1.0);
        // The middle of the source is seen, whatever sign the matrix has.
        let sign = (inverse * (middle / middle.z)).z.signum();
        Ok(inverse * sign)
    }
}

fn look(source: &DMat3, point: DVec2) -> Option<Look> {
    let p = *source * point.extend(1.0);
    if p.z <= 1e-12 {
        return None;
    }
    let at = p.truncate() / p.z;
    let column = |axis: DVec3| (axis.truncate() - at * axis.z) / p.z;
    Some(Look { at, change: DMat2::from_cols(column(source.x_axis), column(source.y_axis)) })
}

/// The projective map that takes the unit square's corners, clockwise from (0, 0) as y points down, to four points
/// (Heckbert 1989, 2.2.3).
fn square_to([a, b, c, d]: [DVec2; 4]) -> DMat3 {
    let (u, v, sum) = (b - c, d - c, a - b + c - d);
    let whole = u.perp_dot(v);
    let (g, h) = (sum.perp_dot(v) / whole, u.perp_dot(sum) / whole);
    DMat3::from_cols((b - a + g * b).extend(g), (d - a + h * d).extend(h), a.extend(1.0))
}

/// Four corners that a rectangle can be seen with: no three in a line, not crossed, not dented.
fn check(corners: &[DVec2; 4]) -> Result<()> {
    let help =
        "corners go around: upper left, upper right, lower right, lower left; each inside angle below 180 degrees";
    if let Some(at) = corners.iter().position(|corner| !corner.is_finite()) {
        return Err(Error::compute(format!("the {} corner is at {}", CORNERS[at], corners[at]), "give finite numbers"));
    }
    let turn = |i: usize, j: usize, k: usize| (corners[j] - corners[i]).perp_dot(corners[k] - corners[j]);
    let extent = corners.iter().map(|c| c.distance_squared(corners[0])).fold(0.0, f64::max);
    for left_out in 0..4 {
        let [i, j, k] = [1, 2, 3].map(|step| (left_out + step) % 4);
        if turn(i, j, k).abs() <= 1e-9 * extent {
            let message = format!("the corners {}, {} and {} lie in one line", CORNERS[i], CORNERS[j], CORNERS[k]);
            return Err(Error::compute(message, help));
        }
    }
    let left: Vec<bool> = (0..4).map(|i| turn((i + 3) % 4, i, (i + 1) % 4) > 0.0).collect();
    match left.iter().filter(|left| **left).count() {
        0 | 4 => Ok(()),
        2 => Err(Error::compute("the corners are crossed over: two sides meet", help)),
        odd => {
            let at = left.iter().position(|left| *left == (odd == 1)).expect("one turns the other way");
            Err(Error::compute(format!("the {} corner lies inside the triangle of the others", CORNERS[at]), help))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAME: Transform =
        Transform { translate: DVec2::ZERO, rotate: 0.0, scale: DVec2::ONE, pivot: None, corners: None };

    fn v(x: f64, y: f64) -> DVec2 {
        DVec2::new(x, y)
    }

    fn source(transform: Transform, point: DVec2) -> DVec2 {
        look(&transform.inverse(v(2.0, 1.0)).unwrap(), point).unwrap().at
    }

    #[test]
    fn points_by_hand() {
        let near = |a: DVec2, b: DVec2| assert!(a.distance(b) < 1e-12, "{a} {b}");
        near(source(SAME, v(0.3, 0.7)), v(0.3, 0.7));
        near(source(Transform { translate: v(0.1, 0.2), ..SAME }, v(0.3, 0.7)), v(0.2, 0.5));
        near(source(Transform { scale: v(2.0, 0.5), ..SAME }, v(1.4, 0.6)), v(1.2, 0.7));
        // What was right of the middle is above it after a quarter counter-clockwise.
        let quarter = Transform { rotate: std::f64::consts::FRAC_PI_2, ..SAME };
        near(source(quarter, v(1.0, 0.2)), v(1.3, 0.5));
        near(source(Transform { pivot: Some(v(0.0, 0.0)), ..quarter }, v(0.0, -0.2)), v(0.2, 0.0));
        let corners = [v(0.2, 0.1), v(1.5, 0.0), v(1.8, 0.9), v(0.1, 0.8)];
        let projective = Transform { corners: Some(corners), ..SAME };
        for (corner, from) in corners.iter().zip([v(0.0, 0.0), v(2.0, 0.0), v(2.0, 1.0), v(0.0, 1.0)]) {
            near(source(projective, *corner), from);
        }
        // A line stays a line: the diagonals cross where they crossed.
        let crossing = |[a, b, c, d]: [DVec2; 4]| {
            let t = (b - a).perp_dot(d - b) / (c - a).perp_dot(d - b);
            a + (c - a) * t
        };
        near(source(projective, crossing(corners)), v(1.0, 0.5));
        // Mirrored corners are a mirror.
        let mirror = [v(2.0, 0.0), v(0.0, 0.0), v(0.0, 1.0), v(2.0, 1.0)];
        near(source(Transform { corners: Some(mirror), ..SAME }, v(0.3, 0.7)), v(1.7, 0.7));
    }

    #[test]
    fn how_places_move_is_how_they_differ() {
        let corners = Some([v(0.2, 0.1), v(1.5, 0.0), v(1.8, 0.9), v(0.1, 0.8)]);
        let map = Transform { corners, rotate: 0.3, scale: v(0.7, 1.2), ..SAME }.inverse(v(2.0, 1.0)).unwrap();
        let (at, step) = (v(0.9, 0.4), 1e-6);
        let change = look(&map, at).unwrap().change;
        for (axis, column) in [(v(step, 0.0), change.x_axis), (v(0.0, step), change.y_axis)] {
            let slope = (look(&map, at + axis).unwrap().at - look(&map, at - axis).unwrap().at) / (2.0 * step);
            assert!(slope.distance(column) < 1e-6 * column.length(), "{slope} {column}");
        }
    }

    #[test]
    fn corners_that_no_rectangle_has_are_named() {
        let said = |corners| Transform { corners: Some(corners), ..SAME }.inverse(v(1.0, 1.0)).unwrap_err().to_string();
        let [a, b, c, d] = [v(0.0, 0.0), v(1.0, 0.0), v(1.0, 1.0), v(0.0, 1.0)];
        assert!(said([a, v(0.5, 0.0), b, d]).contains("upper left, upper right and lower right lie in one line"));
        assert!(said([a, a, c, d]).contains("in one line"));
        assert!(said([a, c, b, d]).contains("crossed over"));
        assert!(said([a, b, v(0.3, 0.3), d]).contains("lower right corner lies inside"));
        assert!(said([a, d, v(0.3, 0.3), b]).contains("lower right corner lies inside"));
        assert!(said([a, b, v(f64::NAN, 0.3), d]).contains("lower right corner is at"));
        assert!(Transform { scale: v(0.0, 1.0), ..SAME }.inverse(v(1.0, 1.0)).is_err());
        assert!(Transform { rotate: f64::NAN, ..SAME }.inverse(v(1.0, 1.0)).is_err());
    }
}
