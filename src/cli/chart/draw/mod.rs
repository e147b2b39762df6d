//! Draws lines on logarithmic axes, as SVG and as PNG. What they mean is not known here.

mod labels;
mod panel;

use crate::{Error, Result};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::sync::Once;

/// Units across and down; a panel's width is a share of it.
const SIZE: (u32, u32) = (1280, 640);

/// Pixels of a unit.
#[derive(Clone, Copy)]
struct Scale(i32);

impl Scale {
    fn text(self, size: i32) -> TextStyle<'static> {
        ("sans-serif", size * self.0).into_text_style(&(1, 1)).color(&RGBColor(30, 30, 30))
    }

    /// Of a text, in pixels.
    fn width(self, label: &str, size: i32) -> i32 {
        self.text(size).font.box_size(label).map_or(0, |(width, _)| width as i32)
    }

    fn line(self, colour: &impl Color, width: i32) -> ShapeStyle {
        colour.stroke_width((width * self.0) as u32)
    }
}

/// Colours that people with any kind of colour vision tell apart (Okabe and Ito 2008), darkest first.
pub const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(60, 60, 60),
];

/// A figure of panels side by side.
pub struct Figure {
    pub title: String,
    /// Lines of small print under the panels.
    pub notes: Vec<String>,
    /// What colours mean; drawn when there is more than one.
    pub legend: Vec<(RGBColor, String)>,
    pub panels: Vec<Panel>,
}

/// Lines over two logarithmic axes.
pub struct Panel {
    pub title: String,
    pub axes: [String; 2],
    /// First and last value of each axis; positive.
    pub ranges: [[f64; 2]; 2],
    pub lines: Vec<Line>,
}

pub struct Line {
    pub colour: RGBColor,
    pub stroke: Stroke,
    /// From left to right, inside the panel's ranges.
    pub points: Vec<Mark>,
}

/// One point of a line.
pub struct Mark {
    pub place: [f64; 2],
    pub label: String,
    pub shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stroke {
    Solid,
    Dashed,
    /// Broad and pale, behind the others.
    Band,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    None,
    Dot,
    Hollow,
    /// A dot with a ring around it.
    Ringed,
    Cross,
}

impl Panel {
    /// Ranges that hold all values of a kind, with room around them and at least a factor of 4 wide. Values that are not
    /// positive have no place; `None` when there are no others.
    pub fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
        let (low, high) = values
            .filter(|value| *value > 0.0 && value.is_finite())
            .fold((f64::INFINITY, 0.0f64), |(low, high), value| (low.min(value), high.max(value)));
        if high == 0.0 {
            return None;
        }
        let more = (2.0 / (high / low).sqrt()).max(1.3);
        Some([low / more, high * more])
    }
}

/// # Errors
/// `Compute` where the drawing fails.
pub fn svg(figure: &Figure) -> Result<String> {
    let mut text = String::new();
    draw(&SVGBackend::with_string(&mut text, SIZE).into_drawing_area(), figure, Scale(1))
        .map_err(|error| fault(&error))?;
    Ok(text)
}

/// # Errors
/// `Compute` where the drawing fails.
pub fn png(figure: &Figure) -> Result<Vec<u8>> {
    // Twice as fine as its units, for screens that are.
    let scale = Scale(2);
    let size = (SIZE.0 * scale.0 as u32, SIZE.1 * scale.0 as u32);
    let mut pixels = vec![0; 3 * (size.0 * size.1) as usize];
    draw(&BitMapBackend::with_buffer(&mut pixels, size).into_drawing_area(), figure, scale)
        .map_err(|error| fault(&error))?;
    let picture = image::RgbImage::from_raw(size.0, size.1, pixels).expect("three bytes a pixel");
    let mut file = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut file, image::ImageFormat::Png).map_err(|error| fault(&error))?;
    Ok(file.into_inner())
}

fn fault(error: &dyn std::fmt::Display) -> Error {
    Error::compute(format!("the chart cannot be drawn: {error}"), "its table is written; please report this")
}

type Drawn<DB> = std::result::Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

fn draw<DB: DrawingBackend>(root: &DrawingArea<DB, Shift>, figure: &Figure, scale: Scale) -> Drawn<DB> {
    font();
    root.fill(&WHITE)?;
    let px = |units: i32| units * scale.0;
    let legend = figure.legend.len() > 1;
    let (head, rest) = root.split_vertically(px(if legend { 74 } else { 46 }));
    let (middle, foot) = rest.split_vertically(rest.dim_in_pixel().1 as i32 - px(14 + 18 * figure.notes.len() as i32));
    head.draw(&Text::new(figure.title.clone(), (px(20), px(14)), scale.text(24)))?;
    if legend {
        let mut x = px(20);
        for (colour, label) in &figure.legend {
            head.draw(&Rectangle::new([(x, px(55)), (x + px(22), px(60))], colour.filled()))?;
            head.draw(&Text::new(label.clone(), (x + px(28), px(49)), scale.text(16)))?;
            x += px(28 + 26) + scale.width(label, 16);
        }
    }
    for (line, note) in figure.notes.iter().enumerate() {
        foot.draw(&Text::new(note.clone(), (px(20), px(4 + 18 * line as i32)), scale.text(14)))?;
    }
    for (area, panel) in middle.split_evenly((1, figure.panels.len())).iter().zip(&figure.panels) {
        panel::draw(area, panel, scale)?;
    }
    root.present()
}

/// The font that the editor has too; the system's are not asked, so that a chart is the same everywhere.
fn font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let registered =
            plotters::style::register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT);
        registered.unwrap_or_else(|_| unreachable!("it is a font"));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_their_values() {
        let [low, high] = Panel::range([3.0, 0.0, 200.0, f64::NAN].into_iter()).unwrap();
        assert!(low < 3.0 && low > 1.0 && high > 200.0 && high < 300.0);
        let [low, high] = Panel::range([5.0].into_iter()).unwrap();
        assert!((low - 2.5).abs() < 1e-12 && (high - 10.0).abs() < 1e-12);
        assert_eq!(Panel::range([0.0, -1.0].into_iter()), None);
    }
}
