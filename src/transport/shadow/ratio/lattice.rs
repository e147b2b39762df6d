//! Bends a shadow with a lattice of control points: `w(x) = filter(v(mvc(x)))` (thesis 6.7.5), where mvc takes the
//! mean-value coordinates of x in its quadrilateral (Hormann and Floater 2006, "Mean value coordinates for arbitrary
//! planar polygons") to the same coordinates in the rectangle that the cell was.
//!
//! Where a lattice is folded over itself, the last cell (row by row) is seen. A cell that is folded or dented still
//! shows only what was in its own rectangle. What the lattice left bare has no shadow; outside of its frame nothing
//! changes.

use super::Ratio;
use super::frame::{Look, Units, place, warp};
use crate::device::Device;
use crate::kernels::ratio_warp::Place;
use crate::{Error, Result};
use glam::{DMat2, DVec2};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Cells along a side at most.
pub const MOST: usize = 64;

#[derive(Clone, Debug)]
pub struct Lattice {
    pub rows: usize,
    pub columns: usize,
    /// Upper left and lower right corner of the rectangle that is bent, in units of the picture.
    pub frame: [DVec2; 2],
    /// `(rows + 1) (columns + 1)` points, row by row.
    pub points: Vec<DVec2>,
}

/// What is noted of a lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Told {
    /// Cells that are turned over, crossed over, dented or flat.
    pub folded: usize,
    /// Pixels that more than one cell covers.
    pub doubled: usize,
}

impl Lattice {
    /// The points where nothing is bent.
    pub fn rest(rows: usize, columns: usize, [low, high]: [DVec2; 2]) -> Vec<DVec2> {
        let along = |i: usize, n: usize| i as f64 / n.max(1) as f64;
        (0..=rows)
            .flat_map(|y| {
                (0..=columns).map(move |x| low + (high - low) * DVec2::new(along(x, columns), along(y, rows)))
            })
            .collect()
    }

    /// # Errors
    /// As `check`.
    pub fn apply(&self, device: &Device, ratio: &Ratio, units: Units) -> Result<(Ratio, Told)> {
        self.check()?;
        let cells = self.cells();
        let rest = Self::rest(self.rows, self.columns, self.frame);
        let folded = cells.iter().filter(|corners| self.is_folded(corners)).count();
        let width = ratio.width;
        let doubled = AtomicUsize::new(0);
        let bent = warp(device, ratio, |first, places| {
            // A row and the one below it, which tells how far apart they look.
            let map = |y| self.row(&cells, &rest, units, y, width);
            let mut row = map(first);
            for (k, places) in places.chunks_mut(width).enumerate() {
                let below = map(first + k + 1);
                self.places(&cells, &rest, units, first + k, [&row, &below], places);
                doubled.fetch_add(row.doubled, Ordering::Relaxed);
                row = below;
            }
        })?;
        Ok((bent, Told { folded, doubled: doubled.into_inner() }))
    }

    /// # Errors
    /// `Compute` for a frame without area, too many or no cells, another number of points, and points that are not
    /// finite.
    pub fn check(&self) -> Result<()> {
        let (rows, columns) = (self.rows, self.columns);
        if !(1..=MOST).contains(&rows) || !(1..=MOST).contains(&columns) {
            let message = format!("a lattice of {rows} x {columns} cells");
            return Err(Error::compute(message, format!("give 1 to {MOST} rows and columns")));
        }
        let expected = (rows + 1) * (columns + 1);
        if self.points.len() != expected {
            let message = format!("{} points for {rows} rows and {columns} columns of cells", self.points.len());
            let help = format!("give {} rows of {} points, {expected} in all", rows + 1, columns + 1);
            return Err(Error::compute(message, help));
        }
        if let Some(at) = self.points.iter().position(|point| !point.is_finite() || point.abs().max_element() >= 1e6) {
            return Err(Error::compute(
                format!("point {at} is at {}", self.points[at]),
                "give points near the picture",
            ));
        }
        let [low, high] = self.frame;
        let size = high - low;
        if !low.is_finite() || !high.is_finite() || size.min_element() <= 1e-9 || size.max_element() >= 1e6 {
            let message = format!("a frame from {low} to {high} has no area");
            return Err(Error::compute(message, "give its upper left and its lower right corner"));
        }
        Ok(())
    }

    /// Corners of each cell, row by row, as numbers of points: clockwise on the screen from the upper left.
    fn cells(&self) -> Vec<[usize; 4]> {
        let across = self.columns + 1;
        let cell = |row: usize, column: usize| {
            let first = row * across + column;
            [first, first + 1, first + across + 1, first + across]
        };
        (0..self.rows).flat_map(|row| (0..self.columns).map(move |column| cell(row, column))).collect()
    }

    fn is_folded(&self, corners: &[usize; 4]) -> bool {
        let at = |k: usize| self.points[corners[k % 4]];
        (0..4).any(|k| (at(k + 1) - at(k)).perp_dot(at(k + 2) - at(k + 1)) <= 0.0)
    }

    /// Where a row of pixels lies in the cells.
    fn row(&self, cells: &[[usize; 4]], rest: &[DVec2], units: Units, y: usize, width: usize) -> Row {
        let height = units.of_pixel(0, y).y;
        let mut owners = vec![NONE; width];
        let mut doubled = 0;
        for (n, corners) in cells.iter().enumerate() {
            for [from, to] in spans(&corners.map(|at| self.points[at]), height) {
                // Middles of pixels in [from, to).
                let pixel = |x: f64| ((x * units.0.x - 0.5).ceil().max(0.0) as usize).min(width);
                for owner in &mut owners[pixel(from)..pixel(to).max(pixel(from))] {
                    doubled += usize::from(*owner != NONE);
                    *owner = n;
                }
            }
        }
        let source = |(x, n): (usize, &usize)| match *n {
            NONE => DVec2::ZERO,
            n => self.source(cells[n], rest, units.of_pixel(x, y)),
        };
        let sources = owners.iter().enumerate().map(source).collect();
        Row { owners, sources, doubled }
    }

    fn source(&self, cell: [usize; 4], rest: &[DVec2], at: DVec2) -> DVec2 {
        mean_value(&cell.map(|at| self.points[at]), &cell.map(|at| rest[at]), at)
    }

    /// Fills a row of pixels; `rows`: it and the one below.
    fn places(&self, cells: &[[usize; 4]], rest: &[DVec2], units: Units, y: usize, rows: [&Row; 2], out: &mut [Place]) {
        let [low, high] = self.frame;
        let [row, below] = rows;
        for (x, out) in out.iter_mut().enumerate() {
            let (at, n, source) = (units.of_pixel(x, y), row.owners[x], row.sources[x]);
            if n == NONE {
                let bare = at.cmpge(low).all() && at.cmplt(high).all();
                *out = place(units, (!bare).then_some(Look { at, change: DMat2::IDENTITY }));
                continue;
            }
            // The next pixel of the same cell has been mapped already.
            let right = match row.owners.get(x + 1) {
                Some(next) if *next == n => (row.sources[x + 1] - source) * units.0.x,
                _ => (self.source(cells[n], rest, at + DVec2::X * STEP) - source) / STEP,
            };
            let down = match below.owners[x] {
                next if next == n => (below.sources[x] - source) * units.0.y,
                _ => (self.source(cells[n], rest, at + DVec2::Y * STEP) - source) / STEP,
            };
            *out = place(units, Some(Look { at: source, change: DMat2::from_cols(right, down) }));
        }
    }
}

/// What covers the pixels of a row.
struct Row {
    /// Numbers of cells, or `NONE`.
    owners: Vec<usize>,
    /// What each pixel looks at.
    sources: Vec<DVec2>,
    /// Pixels under more than one cell.
    doubled: usize,
}

const NONE: usize = usize::MAX;

/// For differences, in units of the picture: far below a pixel, far above the rounding of positions.
const STEP: f64 = 1e-5;

/// The parts of a horizontal line that lie in a polygon of four corners, however it is crossed over.
fn spans(corners: &[DVec2; 4], y: f64) -> impl Iterator<Item = [f64; 2]> {
    let mut crossings = [f64::INFINITY; 4];
    let mut count = 0;
    for k in 0..4 {
        // Neighbours share an edge: it is cut at the same point from either side.
        let (mut a, mut b) = (corners[k], corners[(k + 1) % 4]);
        if a.y > b.y {
            std::mem::swap(&mut a, &mut b);
        }
        if a.y <= y && y < b.y {
            crossings[count] = a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x);
            count += 1;
        }
    }
    crossings.sort_by(f64::total_cmp);
    (0..count / 2).map(move |k| [crossings[2 * k], crossings[2 * k + 1]])
}

/// The point with the mean-value coordinates in `rest` that `at` has in `corners`, kept inside of `rest`, a rectangle.
fn mean_value(corners: &[DVec2; 4], rest: &[DVec2; 4], at: DVec2) -> DVec2 {
    let s = corners.map(|corner| corner - at);
    let r = s.map(DVec2::length);
    let size = s[0].abs().max_element() + s[1].abs().max_element() + s[2].abs().max_element() + f64::MIN_POSITIVE;
    if let Some(k) = r.iter().position(|r| *r <= 1e-14 * size) {
        return rest[k];
    }
    // tan(a/2) of the angle at `at` between corner k and the next one.
    let mut halves = [0.0; 4];
    for k in 0..4 {
        let next = (k + 1) % 4;
        let (area, dot) = (s[k].perp_dot(s[next]), s[k].dot(s[next]));
        if area.abs() <= 1e-14 * r[k] * r[next] && dot < 0.0 {
            // On the edge: as far along as it is.
            return rest[k] + (rest[next] - rest[k]) * (r[k] / (r[k] + r[next]));
        }
        // (|a| |b| - a.b) / (a x b), in the form that does not cancel.
        halves[k] = if dot > 0.0 { area / (r[k] * r[next] + dot) } else { (r[k] * r[next] - dot) / area };
    }
    let weights: [f64; 4] = std::array::from_fn(|k| (halves[(k + 3) % 4] + halves[k]) / r[k]);
    let total: f64 = weights.iter().sum();
    let point = rest.iter().zip(weights).map(|(rest, weight)| *rest * weight).sum::<DVec2>() / total;
    let middle = 0.5 * (rest[0] + rest[2]);
    // Of a crossed cell the weights may cancel.
    if point.is_finite() { point.clamp(rest[0], rest[2]) } else { middle }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f64, y: f64) -> DVec2 {
        DVec2::new(x, y)
    }

    const SQUARE: [DVec2; 4] = [DVec2::ZERO, DVec2::new(1.0, 0.0), DVec2::new(1.0, 1.0), DVec2::new(0.0, 1.0)];

    #[test]
    fn mean_value_coordinates_are_linear_and_meet_corners_and_edges() {
        let near = |a: DVec2, b: DVec2| assert!(a.distance(b) < 1e-12, "{a} {b}");
        let affine = |p: DVec2| v(3.0 + 2.0 * p.x + 0.5 * p.y, 1.0 - 0.25 * p.x + p.y);
        let bent = [v(0.1, 0.2), v(1.3, -0.1), v(1.6, 1.2), v(-0.2, 0.9)];
        for at in [v(0.5, 0.5), v(0.01, 0.97), v(0.999, 0.2), v(1e-9, 0.3)] {
            near(mean_value(&SQUARE.map(affine), &SQUARE, affine(at)), at);
        }
        for k in 0..4 {
            near(mean_value(&bent, &SQUARE, bent[k]), SQUARE[k]);
            let (edge, from) = (bent[k].lerp(bent[(k + 1) % 4], 0.3), SQUARE[k].lerp(SQUARE[(k + 1) % 4], 0.3));
            near(mean_value(&bent, &SQUARE, edge), from);
            // Just inside of the edge, no jump.
            let inside = edge.lerp(v(0.7, 0.5), 1e-7);
            assert!(mean_value(&bent, &SQUARE, inside).distance(from) < 1e-5);
        }
        // By hand: in a kite with the point on its axis of symmetry the two sides weigh the same.
        let kite = [v(-1.0, 0.0), v(0.0, -1.0), v(3.0, 0.0), v(0.0, 1.0)];
        let found = mean_value(&kite, &SQUARE, v(0.0, 0.0));
        // tan(45 deg) = 1 everywhere: weights 2/1, 2/1, 2/3, 2/1.
        near(found, (SQUARE[0] * 2.0 + SQUARE[1] * 2.0 + SQUARE[2] * (2.0 / 3.0) + SQUARE[3] * 2.0) / (20.0 / 3.0));
    }

    #[test]
    fn nothing_escapes_a_crossed_cell() {
        let crossed = [v(0.0, 0.0), v(1.0, 1.0), v(1.0, 0.0), v(0.0, 1.0)];
        for i in 0..400 {
            let at = v(0.05 * f64::from(i % 20), 0.05 * f64::from(i / 20));
            let point = mean_value(&crossed, &SQUARE, at);
            assert!(point.is_finite() && point.cmpge(DVec2::ZERO).all() && point.cmple(DVec2::ONE).all(), "{at}");
        }
        assert_eq!(spans(&crossed, 0.25).collect::<Vec<_>>(), [[0.0, 0.25], [0.75, 1.0]]);
        assert_eq!(spans(&SQUARE, 0.25).collect::<Vec<_>>(), [[0.0, 1.0]]);
        assert_eq!(spans(&SQUARE, 1.0).count(), 0);
    }

    /// A line of ratios 0 to 9, two cells side by side.
    #[test]
    fn cells_by_hand() {
        let values: Vec<[f32; 4]> = (0..40).map(|i| [(i % 10) as f32 / 10.0, 0.0, 0.0, 1.0]).collect();
        let ratio = Ratio { width: 10, height: 4, values: values.into(), ..Ratio::default() };
        let units = Units::heights(&ratio);
        let frame = [DVec2::ZERO, v(2.5, 1.0)];
        let bend = |change: &dyn Fn(&mut [DVec2])| {
            let mut points = Lattice::rest(1, 2, frame);
            change(&mut points);
            let lattice = Lattice { rows: 1, columns: 2, frame, points };
            let (warped, told) = lattice.apply(&Device::Cpu, &ratio, units).unwrap();
            (warped.values[10..20].iter().map(|v| v[0]).collect::<Vec<_>>(), told)
        };
        let plain: Vec<f32> = (0..10).map(|i| i as f32 / 10.0).collect();
        assert_eq!(bend(&|_| {}), (plain.clone(), Told { folded: 0, doubled: 0 }));
        // All moved right by two pixels: what is left bare has no shadow.
        let moved = [&[1.0, 1.0][..], &plain[..8]].concat();
        assert_eq!(bend(&|points| points.iter_mut().for_each(|p| p.x += 0.5)).0, moved);
        // The right half folded over the left one: mirrored, seen, and counted.
        let (folded, told) = bend(&|points| [2, 5].iter().for_each(|at| points[*at].x = 0.0));
        assert_eq!(told, Told { folded: 1, doubled: 20 });
        assert!(folded[..5].iter().zip([0.9, 0.8, 0.7, 0.6, 0.5]).all(|(a, b)| (a - b).abs() < 1e-6), "{folded:?}");
        assert_eq!(folded[5..], [1.0; 5]);
    }

    #[test]
    fn wrong_lattices_are_refused() {
        let ratio = Ratio { width: 1, height: 1, values: vec![[1.0; 4]].into(), ..Ratio::default() };
        let good = Lattice { rows: 1, columns: 1, frame: [DVec2::ZERO, DVec2::ONE], points: SQUARE.to_vec() };
        let said = |lattice: Lattice| {
            let error = lattice.apply(&Device::Cpu, &ratio, Units::heights(&ratio)).unwrap_err();
            format!("{error} {}", error.help())
        };
        assert!(
            said(Lattice { points: SQUARE[..3].to_vec(), ..good.clone() }).contains("2 rows of 2 points, 4 in all")
        );
        assert!(said(Lattice { rows: 0, ..good.clone() }).contains("0 x 1"));
        assert!(said(Lattice { frame: [DVec2::ONE, DVec2::ZERO], ..good.clone() }).contains("no area"));
        let mut points = SQUARE.to_vec();
        points[2].x = f64::NAN;
        assert!(said(Lattice { points, ..good }).contains("point 2"));
    }
}
