//! One panel: axes, lines and points.

use super::labels::Labels;
use super::{Drawn, Line, Panel, Scale, Shape, Stroke};
use crate::cli::chart::tables::significant;
use plotters::coord::Shift;
use plotters::coord::combinators::{LogCoord, WithKeyPoints};
use plotters::prelude::*;

type Axis = WithKeyPoints<LogCoord<f64>>;

pub fn draw<DB: DrawingBackend>(area: &DrawingArea<DB, Shift>, panel: &Panel, scale: Scale) -> Drawn<DB> {
    let axis = |[low, high]: [f64; 2]| {
        let [bold, light] = ticks([low, high]);
        (low..high).log_scale().with_key_points(bold).with_light_points(light)
    };
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, scale.text(18))
        .margin(12 * scale.0)
        .x_label_area_size(46 * scale.0)
        .y_label_area_size(64 * scale.0)
        .build_cartesian_2d(axis(panel.ranges[0]), axis(panel.ranges[1]))?;
    let grid = RGBColor(215, 215, 215);
    chart
        .configure_mesh()
        .x_desc(&panel.axes[0])
        .y_desc(&panel.axes[1])
        .x_label_formatter(&|value| significant(*value))
        .y_label_formatter(&|value| significant(*value))
        .label_style(scale.text(14))
        .axis_desc_style(scale.text(16))
        .axis_style(scale.line(&BLACK, 1))
        .bold_line_style(scale.line(&grid, 1))
        .light_line_style(scale.line(&grid.mix(0.4), 1))
        .set_all_tick_mark_size(5 * scale.0)
        .draw()?;
    for line in &panel.lines {
        let places = line.points.iter().map(|point| (point.place[0], point.place[1]));
        let plain = scale.line(&line.colour, 2);
        match line.stroke {
            Stroke::Solid => chart.draw_series(LineSeries::new(places, plain))?,
            Stroke::Dashed => chart.draw_series(DashedLineSeries::new(places, 7 * scale.0, 5 * scale.0, plain))?,
            Stroke::Band => chart.draw_series(LineSeries::new(places, scale.line(&line.colour.mix(0.3), 12)))?,
        };
    }
    let mut labels = Labels::new(chart.plotting_area(), scale);
    panel.lines.iter().flat_map(|line| &line.points).for_each(|point| labels.keep_clear(point.place));
    for line in &panel.lines {
        points(&chart, line, scale)?;
        for point in line.points.iter().filter(|point| !point.label.is_empty()) {
            labels.draw(point, line.colour)?;
        }
    }
    Ok(())
}

fn points<DB: DrawingBackend>(
    chart: &ChartContext<'_, DB, Cartesian2d<Axis, Axis>>,
    line: &Line,
    scale: Scale,
) -> Drawn<DB> {
    let area = chart.plotting_area();
    let (colour, px) = (line.colour, |units: i32| units * scale.0);
    for point in &line.points {
        let at = (point.place[0], point.place[1]);
        match point.shape {
            Shape::None => {}
            Shape::Dot => area.draw(&Circle::new(at, px(5), colour.filled()))?,
            Shape::Hollow => {
                area.draw(&Circle::new(at, px(4), WHITE.filled()))?;
                area.draw(&Circle::new(at, px(4), scale.line(&colour, 2)))?;
            }
            Shape::Ringed => {
                area.draw(&Circle::new(at, px(5), colour.filled()))?;
                area.draw(&Circle::new(at, px(10), scale.line(&BLACK, 2)))?;
            }
            Shape::Cross => area.draw(&plotters::element::Cross::new(at, px(4), scale.line(&colour, 2)))?,
        }
    }
    Ok(())
}

/// Values that have a label, and those that have a fine line. Of many decades only 1, then 1, 2 and 5 of each are
/// named.
fn ticks([low, high]: [f64; 2]) -> [Vec<f64>; 2] {
    let named: &[i32] = match high / low {
        ratio if ratio > 1000.0 => &[1],
        ratio if ratio > 15.0 => &[1, 2, 5],
        _ => &[1, 2, 3, 4, 5, 6, 8],
    };
    let decades = low.log10().floor() as i32..=high.log10().floor() as i32;
    let (mut bold, mut light) = (Vec::new(), Vec::new());
    for (decade, digit) in decades.flat_map(|decade| (1..10).map(move |digit| (decade, digit))) {
        // Divided where the power is negative: 0.3 is 3 / 10, not 3 x 0.1.
        let power = 10f64.powi(decade.abs());
        let value = if decade < 0 { f64::from(digit) / power } else { f64::from(digit) * power };
        if (low..=high).contains(&value) {
            if named.contains(&digit) { bold.push(value) } else { light.push(value) }
        }
    }
    [bold, light]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_of_many_decades_are_few() {
        assert_eq!(ticks([0.25, 0.9]), [vec![0.3, 0.4, 0.5, 0.6, 0.8], vec![0.7, 0.9]]);
        assert_eq!(ticks([0.9, 30.0])[0], [1.0, 2.0, 5.0, 10.0, 20.0]);
        assert_eq!(ticks([0.05, 5000.0])[0], [0.1, 1.0, 10.0, 100.0, 1000.0]);
    }
}
