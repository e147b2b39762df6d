//! Labels of points, where they cover neither a point nor each other.

use super::{Drawn, Mark, Scale, Shape};
use plotters::coord::CoordTranslate;
use plotters::prelude::*;

const SIZE: i32 = 14;

pub struct Labels<'a, DB: DrawingBackend, CT: CoordTranslate<From = (f64, f64)>> {
    area: &'a DrawingArea<DB, CT>,
    scale: Scale,
    /// Left, top, right and bottom in pixels.
    taken: Vec<[i32; 4]>,
}

impl<'a, DB: DrawingBackend, CT: CoordTranslate<From = (f64, f64)>> Labels<'a, DB, CT> {
    pub fn new(area: &'a DrawingArea<DB, CT>, scale: Scale) -> Self {
        Self { area, scale, taken: Vec::new() }
    }

    pub fn keep_clear(&mut self, place: [f64; 2]) {
        let (x, y) = self.area.map_coordinate(&(place[0], place[1]));
        let near = 5 * self.scale.0;
        self.taken.push([x - near, y - near, x + near, y + near]);
    }

    /// Beside its point; not at all where there is no room for it.
    pub fn draw(&mut self, point: &Mark, colour: RGBColor) -> Drawn<DB> {
        let (x, y) = self.area.map_coordinate(&(point.place[0], point.place[1]));
        let (wide, high) = (self.scale.width(&point.label, SIZE), SIZE * self.scale.0);
        let far = self.scale.0 * if point.shape == Shape::Ringed { 14 } else { 9 };
        let corners = [
            (x + far, y - high - 2),
            (x + far, y + 2),
            (x - far - wide, y - high - 2),
            (x - far - wide, y + 2),
            (x - wide / 2, y - far - high),
            (x - wide / 2, y + far),
        ];
        let inside = self.area.get_pixel_range();
        let fits = |&(left, top): &(i32, i32)| {
            let (right, bottom) = (left + wide, top + high);
            let is_inside =
                inside.0.start <= left && right <= inside.0.end && inside.1.start <= top && bottom <= inside.1.end;
            is_inside && !self.taken.iter().any(|[l, t, r, b]| left < *r && *l < right && top < *b && *t < bottom)
        };
        let Some((left, top)) = corners.into_iter().find(fits) else { return Ok(()) };
        self.taken.push([left, top, left + wide, top + high]);
        let area = self.area.strip_coord_spec();
        let origin = (inside.0.start, inside.1.start);
        area.draw(&Text::new(
            point.label.clone(),
            (left - origin.0, top - origin.1),
            self.scale.text(SIZE).color(&colour),
        ))
    }
}
