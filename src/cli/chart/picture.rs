//! What a chart shows: error over seconds, cold beside warm, a line for each series.

use super::Caches;
use super::beside::Other;
use super::draw::{COLOURS, Figure, Line, Mark, Panel, Shape, Stroke};
use super::measure::Found;
use super::series::{self, Series};
use super::spec::Spec;
use plotters::style::RGBColor;

const FRONT: RGBColor = RGBColor(150, 150, 150);

/// `fronts` says of each point whether no other beats it, by `Caches`.
pub fn figure(spec: &Spec, found: &Found, fronts: &[[bool; 2]], others: &[Other]) -> Figure {
    let all = series::series(&found.points);
    let mut legend: Vec<(RGBColor, String)> =
        all.iter().enumerate().map(|(at, series)| (colour(at), series.title())).collect();
    legend.extend(others.iter().enumerate().map(|(at, other)| (colour(all.len() + at), other.name.clone())));
    let measure = match spec.objects {
        Some(_) => {
            format!("error: relative RMSE of blocks of {0} x {0} pixels, against {1}", spec.blocks, found.reference)
        }
        None => format!("error: relative RMSE of pixels, against {}", found.reference),
    };
    let marks = "gray band and filled points: the Pareto front; ring: the default";
    let mut notes = vec![format!("{measure}; {}; {marks}", found.devices.join(", "))];
    if let [only] = &all[..] {
        notes.push(format!("labels: {}", only.swept));
    }
    if !spec.why.is_empty() {
        notes.push(format!("default: {}", spec.why));
    }
    let panels = Caches::BOTH.map(|caches| panel(spec, found, fronts, &all, others, caches));
    Figure { title: spec.title.clone(), notes, legend, panels: panels.into() }
}

fn colour(at: usize) -> RGBColor {
    COLOURS[at % COLOURS.len()]
}

fn panel(spec: &Spec, found: &Found, fronts: &[[bool; 2]], all: &[Series], others: &[Other], caches: Caches) -> Panel {
    let places = || {
        let own = found.points.iter().map(|point| point.place(caches));
        own.chain(others.iter().flat_map(|other| other.places.iter().copied())).map(|[s, error]| [s, 100.0 * error])
    };
    let seconds = Panel::range(places().map(|[seconds, _]| seconds)).unwrap_or([0.1, 10.0]);
    let errors = Panel::range(places().map(|[_, error]| error)).unwrap_or([0.01, 1.0]);
    // No error at all has no place on a logarithmic axis: such points lie at its foot.
    let place = |[seconds, error]: [f64; 2]| [seconds, (100.0 * error).max(errors[0])];
    let on_front = |at: &usize| fronts[*at][caches as usize];
    let mut front: Vec<usize> = (0..found.points.len()).filter(on_front).collect();
    front.sort_by(|a, b| {
        found.points[*a].seconds[caches as usize].total_cmp(&found.points[*b].seconds[caches as usize])
    });
    let bare =
        |at: &usize| Mark { place: place(found.points[*at].place(caches)), label: String::new(), shape: Shape::None };
    let mut lines = vec![Line { colour: FRONT, stroke: Stroke::Band, points: front.iter().map(bare).collect() }];
    for (at, series) in all.iter().enumerate() {
        let mark = |at: &usize| {
            let point = &found.points[*at];
            let shape = match (spec.is_default(&point.settings), on_front(at)) {
                (true, _) => Shape::Ringed,
                (_, true) => Shape::Dot,
                _ => Shape::Hollow,
            };
            Mark { place: place(point.place(caches)), label: series::value(point), shape }
        };
        let points = series.points.iter().map(mark).collect();
        lines.push(Line { colour: colour(at), stroke: Stroke::Solid, points });
    }
    for (at, other) in others.iter().enumerate() {
        let mark = |place_of: &[f64; 2]| Mark { place: place(*place_of), label: String::new(), shape: Shape::Cross };
        let points = other.places.iter().map(mark).collect();
        lines.push(Line { colour: colour(all.len() + at), stroke: Stroke::Dashed, points });
    }
    let axes = ["seconds".to_owned(), "error, %".to_owned()];
    Panel { title: caches.title().to_owned(), axes, ranges: [seconds, errors], lines }
}
