//! Values over frames; points are dragged.

use super::Timeline;
use crate::editor::keys;
use crate::editor::window::look::named;
use crate::editor::window::state::State;
use egui::{Pos2, Ui, WidgetType};
use egui_plot::{Line, Plot, PlotPoints, Points};
use serde_json::{Value as Json, json};

impl Timeline {
    pub(super) fn plot(&mut self, state: &mut State, ui: &mut Ui) {
        let Some(node) = state.chosen().map(str::to_owned) else {
            ui.weak("choose a node with keys");
            return;
        };
        let tracks = tracks(state, &node);
        if tracks.is_empty() {
            ui.weak("no parameter of this node has keys: press a ◇ in the inspector");
            return;
        }
        ui.horizontal(|ui| {
            for param in tracks.iter().map(|track| &track.param).collect::<std::collections::BTreeSet<_>>() {
                let now = keys::interpolation(state.document(), &node, param);
                let mut wanted = now.clone();
                let list = egui::ComboBox::from_id_salt(param).selected_text(format!("{param}: {now}"));
                let list = list.show_ui(ui, |ui| {
                    for name in ["linear", "smooth", "hold"] {
                        ui.selectable_value(&mut wanted, name.to_owned(), name);
                    }
                });
                named(list.response, WidgetType::ComboBox, format!("interpolation of {param}"));
                if wanted != now {
                    state.change("interpolation", None, |document| {
                        keys::set_interpolation(document, &node, param, &wanted);
                        Ok(())
                    });
                }
            }
        });
        let [first, last] = state.document().frames;
        let params = state.entry(&node).map(|entry| entry.params.clone()).unwrap_or_default();
        let plot = Plot::new("curves").allow_drag(self.point.is_none()).show_axes([true, true]);
        let shown = plot.show(ui, |plot| {
            for track in &tracks {
                let value = &params[&track.param];
                let steps = ((last - first) * 4).clamp(1, 2000);
                let line = (0..=steps).filter_map(|i| {
                    let frame = first as f64 + (last - first) as f64 * i as f64 / steps as f64;
                    Some([frame, component(&keys::value_at(value, frame), track.component)?])
                });
                plot.line(Line::new(track.name(), PlotPoints::from_iter(line)));
                let points = Points::new(track.name(), PlotPoints::from(track.points.clone())).radius(5.0);
                plot.points(points);
            }
            plot.vline(egui_plot::VLine::new("now", state.frame as f64));
        });
        let response = named(shown.response, WidgetType::Other, "curves");
        let transform = shown.transform;
        let pressed = ui.input(|input| input.pointer.press_origin());
        if let (Some(at), None, true) = (pressed, &self.point, response.is_pointer_button_down_on()) {
            let is_near = |point: &[f64; 2]| {
                let screen: Pos2 = transform.position_from_point(&egui_plot::PlotPoint::new(point[0], point[1]));
                screen.distance(at) < 8.0
            };
            self.point = tracks.iter().find_map(|track| {
                let point = track.points.iter().find(|point| is_near(point))?;
                Some((track.param.clone(), track.component, point[0]))
            });
        }
        if let (Some((param, part, frame)), Some(at)) =
            (self.point.clone(), ui.input(|input| input.pointer.interact_pos()))
            && ui.input(|input| input.pointer.is_moving())
        {
            let to = transform.value_from_position(at);
            let (goal, height) = (to.x.round().clamp(first as f64, last as f64), (to.y * 1e3).round() / 1e3);
            let old = keys::value_at(&params[&param], frame).into_owned();
            state.change("move a key", Some("keys"), |document| {
                keys::move_key(document, &node, &param, frame, goal, Some(with_component(old, part, height)));
                Ok(())
            });
            self.point = Some((param, part, goal));
        }
        if !ui.input(|input| input.pointer.any_down()) && self.point.take().is_some() {
            state.session.end_drag();
        }
    }
}

/// A number that changes over time: a parameter, or a component of one.
struct Track {
    param: String,
    component: usize,
    is_part: bool,
    points: Vec<[f64; 2]>,
}

impl Track {
    fn name(&self) -> String {
        if self.is_part { format!("{}[{}]", self.param, self.component) } else { self.param.clone() }
    }
}

fn tracks(state: &State, node: &str) -> Vec<Track> {
    let Some(entry) = state.entry(node) else { return Vec::new() };
    let mut tracks = Vec::new();
    for param in entry.params.keys() {
        let Some(keys) = keys::keys(state.document(), node, param) else { continue };
        let parts = keys.first().and_then(|(_, value)| value.as_array()).map(Vec::len);
        for part in 0..parts.unwrap_or(1) {
            let point = |(frame, value): &(f64, Json)| Some([*frame, component(value, part)?]);
            let points: Vec<[f64; 2]> = keys.iter().filter_map(point).collect();
            if !points.is_empty() {
                tracks.push(Track { param: param.clone(), component: part, is_part: parts.is_some(), points });
            }
        }
    }
    tracks
}

fn component(value: &Json, part: usize) -> Option<f64> {
    value.get(part).unwrap_or(value).as_f64()
}

fn with_component(mut value: Json, part: usize, number: f64) -> Json {
    match value.get_mut(part) {
        Some(place) => {
            *place = json!(number);
            value
        }
        None => json!(number),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_come_and_go() {
        assert_eq!(with_component(json!([1, 2, 3]), 1, 5.0), json!([1, 5.0, 3]));
        assert_eq!(with_component(json!(2), 0, 5.0), json!(5.0));
        assert_eq!(component(&json!([1, 2]), 1), Some(2.0));
    }
}
