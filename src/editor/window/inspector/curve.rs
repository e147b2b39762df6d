//! A tone curve: points that are dragged, added by a press and taken out by a right click; or a gamma.

use super::field::Changed;
use crate::editor::window::look::named;
use crate::transport::tone_curve::ToneCurve;
use egui::{Color32, ComboBox, DragValue, Pos2, Rect, Sense, Stroke, Ui, WidgetType, pos2, vec2};
use serde_json::{Value as Json, json};

pub fn ui(value: &Json, ui: &mut Ui) -> Changed {
    let mode = match value {
        Json::Object(object) if object.contains_key("gamma") => "gamma",
        Json::Object(_) => "points",
        _ => "none",
    };
    let mut wanted = mode;
    let list = ComboBox::from_id_salt("curve").selected_text(mode).show_ui(ui, |ui| {
        for mode in ["none", "gamma", "points"] {
            ui.selectable_value(&mut wanted, mode, mode);
        }
    });
    named(list.response, WidgetType::ComboBox, "curve");
    if wanted != mode {
        let value = match wanted {
            "gamma" => json!({ "gamma": { "gamma": 1.0, "pivot": 1.0 } }),
            "points" => json!({ "points": [[0.0, 0.0], [1.0, 1.0]] }),
            _ => json!("none"),
        };
        return Changed { value: Some(value), is_over: true, pick_file: false };
    }
    match mode {
        "gamma" => gamma(&value["gamma"], ui),
        "points" => points(value, ui),
        _ => Changed::default(),
    }
}

fn gamma(value: &Json, ui: &mut Ui) -> Changed {
    let get = |name: &str| value[name].as_f64().unwrap_or(1.0);
    let (mut gamma, mut pivot) = (get("gamma"), get("pivot"));
    let mut changed = Changed::default();
    ui.horizontal(|ui| {
        for (name, number) in [("gamma", &mut gamma), ("pivot", &mut pivot)] {
            ui.label(name);
            let response =
                ui.add(DragValue::new(number).speed(0.01).range(if name == "gamma" { 0.1..=10.0 } else { 1e-6..=1e6 }));
            let response = named(response, WidgetType::DragValue, format!("curve {name}"));
            changed.is_over |= response.drag_stopped() || response.lost_focus();
            if response.changed() {
                changed.value = Some(Json::Null);
            }
        }
    });
    changed.value = changed.value.map(|_| json!({ "gamma": { "gamma": gamma, "pivot": pivot } }));
    changed
}

fn read(value: &Json) -> Vec<[f64; 2]> {
    serde_json::from_value(value["points"].clone()).unwrap_or_default()
}

fn points(value: &Json, ui: &mut Ui) -> Changed {
    let mut points = read(value);
    let most = points.iter().flatten().fold(1.0, |most: f64, x| most.max(*x));
    let side = ui.available_width().min(220.0);
    let (rect, response) = ui.allocate_exact_size(vec2(side, side), Sense::click_and_drag());
    let response = named(response, WidgetType::Other, "tone curve")
        .on_hover_text("drag points; press to add one; right click takes one out");
    let to_screen =
        |[x, y]: [f64; 2]| pos2(rect.left() + (x / most) as f32 * side, rect.bottom() - (y / most) as f32 * side);
    draw(value, &points, most, rect, to_screen, ui);
    let at = |pos: Pos2| {
        let x = f64::from((pos.x - rect.left()) / side) * most;
        let y = f64::from((rect.bottom() - pos.y) / side) * most;
        [x, y].map(|x| (x.max(0.0) * 1e3).round() / 1e3)
    };
    let near = |pos: Pos2, points: &[[f64; 2]]| points.iter().position(|point| to_screen(*point).distance(pos) < 12.0);
    let held = ui.id().with("held");
    let mut changed = Changed { is_over: response.drag_stopped(), ..Changed::default() };
    let pressed = ui.input(|input| input.pointer.press_origin());
    if response.secondary_clicked()
        && let Some(number) = response.interact_pointer_pos().and_then(|pos| near(pos, &points))
        && points.len() > 2
    {
        points.remove(number);
        changed = Changed { value: Some(json!({ "points": points })), is_over: true, pick_file: false };
    } else if (response.drag_started() || response.clicked())
        && let Some(pos) = pressed.or(response.interact_pointer_pos())
    {
        let number = near(pos, &points).unwrap_or_else(|| {
            let point = at(pos);
            let number = points.partition_point(|other| other[0] < point[0]);
            points.insert(number, point);
            changed.value = Some(json!({ "points": points }));
            number
        });
        ui.data_mut(|data| data.insert_temp(held, number));
    } else if response.dragged()
        && let (Some(number), Some(pos)) =
            (ui.data(|data| data.get_temp::<usize>(held)), response.interact_pointer_pos())
        && number < points.len()
    {
        let mut point = at(pos);
        // Points keep their order.
        let low = number.checked_sub(1).map_or(0.0, |before| points[before][0] + 1e-3);
        let high = points.get(number + 1).map_or(f64::INFINITY, |after| after[0] - 1e-3);
        point[0] = point[0].max(low).min(high.max(low));
        points[number] = point;
        changed.value = Some(json!({ "points": points }));
    }
    changed
}

fn draw(value: &Json, points: &[[f64; 2]], most: f64, rect: Rect, to_screen: impl Fn([f64; 2]) -> Pos2, ui: &Ui) {
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let grid = Stroke::new(0.5, ui.visuals().weak_text_color());
    for i in 1..4 {
        let share = i as f32 / 4.0;
        painter.vline(rect.left() + share * rect.width(), rect.y_range(), grid);
        painter.hline(rect.x_range(), rect.top() + share * rect.height(), grid);
    }
    painter.line_segment([rect.left_bottom(), rect.right_top()], grid);
    if let Ok(curve) = serde_json::from_value::<ToneCurve>(value.clone()) {
        let line = (0..=64).map(|i| {
            let x = most * f64::from(i) / 64.0;
            to_screen([x, f64::from(curve.at(x as f32))])
        });
        painter.line(line.collect(), Stroke::new(2.0, Color32::from_rgb(255, 170, 50)));
    }
    for point in points {
        painter.circle_filled(to_screen(*point), 4.0, ui.visuals().text_color());
    }
}
