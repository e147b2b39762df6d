//! Widgets for values of parameters, one for each shape.

use super::curve;
use crate::editor::window::look::named;
use crate::fields::{Field, Range, Shape};
use egui::{ComboBox, DragValue, Response, Slider, TextEdit, Ui, WidgetType};
use serde_json::{Value as Json, json};
use std::collections::HashMap;

/// What was done to a value.
#[derive(Default)]
pub struct Changed {
    pub value: Option<Json>,
    /// A drag or some typing has ended.
    pub is_over: bool,
    pub pick_file: bool,
}

impl Changed {
    fn of(response: &Response, value: Json) -> Self {
        let is_over = response.drag_stopped() || response.lost_focus();
        Self { value: response.changed().then_some(value), is_over, pick_file: false }
    }

    fn now(value: Option<Json>) -> Self {
        Self { is_over: value.is_some(), value, pick_file: false }
    }
}

/// Texts that are not taken over before they are finished.
#[derive(Default)]
pub struct Drafts(HashMap<String, Draft>);

struct Draft {
    /// What it was begun from.
    from: String,
    text: String,
}

pub struct Typed {
    pub response: Response,
    /// Enter was pressed, or the text was left, with another text than before.
    pub done: Option<String>,
}

impl Drafts {
    pub fn line(&mut self, ui: &mut Ui, key: &str, now: &str, width: f32) -> Typed {
        self.edit(ui, key, now, |text| TextEdit::singleline(text).desired_width(width))
    }

    fn lines(&mut self, ui: &mut Ui, key: &str, now: &str) -> Typed {
        self.edit(ui, key, now, |text| {
            TextEdit::multiline(text).code_editor().desired_rows(2).desired_width(f32::INFINITY)
        })
    }

    fn edit(&mut self, ui: &mut Ui, key: &str, now: &str, edit: impl FnOnce(&mut String) -> TextEdit<'_>) -> Typed {
        let fresh = || Draft { from: now.to_owned(), text: now.to_owned() };
        let draft = self.0.entry(key.to_owned()).or_insert_with(fresh);
        let id = ui.id().with(key);
        if draft.from != now && !ui.memory(|memory| memory.has_focus(id)) {
            *draft = fresh();
        }
        let response = ui.add(edit(&mut draft.text).id(id));
        let done = (response.lost_focus() && draft.text != now).then(|| draft.text.clone());
        Typed { response, done }
    }
}

pub fn ui(drafts: &mut Drafts, node: &str, field: &Field, value: &Json, ui: &mut Ui) -> Changed {
    if !field.optional {
        return shaped(drafts, node, field, value, ui);
    }
    // Left out, or a value.
    let mut is_given = !value.is_null();
    let before = is_given;
    let given = ui.horizontal(|ui| {
        let name = format!("give {}", field.name);
        named(ui.checkbox(&mut is_given, ""), WidgetType::Checkbox, name).on_hover_text("without it: see its words");
        match before {
            true => shaped(drafts, node, field, value, ui),
            false => {
                ui.weak(hint(field));
                Changed::default()
            }
        }
    });
    match (before, is_given) {
        (false, true) => Changed::now(Some(start(field))),
        (true, false) => Changed::now(Some(Json::Null)),
        _ => given.inner,
    }
}

/// What a value left out stands for, where the words begin with it: `(0, 2, 0) Where ...`.
fn hint(field: &Field) -> String {
    let end = field.doc.strip_prefix('(').and_then(|rest| rest.split_once(')'));
    end.map_or_else(|| "not given".to_owned(), |(hint, _)| hint.to_owned())
}

/// A value to start from.
fn start(field: &Field) -> Json {
    let hint = hint(field);
    let numbers: Vec<f64> = hint.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match &field.shape {
        Shape::Number(range) => {
            let wanted = numbers.first().copied().unwrap_or(0.0);
            number(range.clamp(wanted), range)
        }
        Shape::Switch => json!(true),
        Shape::Text => json!(""),
        Shape::Choice(choices) => json!(choices.iter().find(|choice| **choice == hint).or(choices.first())),
        Shape::Vector(count) => {
            let filled: Vec<f64> = (0..*count).map(|i| numbers.get(i).copied().unwrap_or(0.0)).collect();
            json!(filled)
        }
        // Corners of the unit square, or two across it.
        Shape::Points(2, Some(4)) => json!([[0, 0], [1, 0], [1, 1], [0, 1]]),
        Shape::Points(size, Some(count)) => (0..*count).map(|i| json!(vec![i; *size])).collect(),
        Shape::Points(_, None) | Shape::Texts => json!([]),
        Shape::Groups => json!({}),
        Shape::Json => Json::Null,
    }
}

fn number(value: f64, range: &Range) -> Json {
    if range.integer { json!(value as i64) } else { json!(value) }
}

fn shaped(drafts: &mut Drafts, node: &str, field: &Field, value: &Json, ui: &mut Ui) -> Changed {
    let name = field.name.as_str();
    match &field.shape {
        Shape::Number(range) => number_ui(field, range, value, ui),
        Shape::Switch => {
            let mut on = value.as_bool().unwrap_or(false);
            let response = named(ui.checkbox(&mut on, ""), WidgetType::Checkbox, name);
            Changed::now(response.changed().then(|| json!(on)))
        }
        Shape::Text => text_ui(drafts, node, field, value, ui),
        Shape::Choice(choices) => {
            let now = value.as_str().unwrap_or_default();
            let mut chosen = None;
            let list = ComboBox::from_id_salt(name).selected_text(now).show_ui(ui, |ui| {
                for choice in choices {
                    if ui.selectable_label(choice == now, choice).clicked() {
                        chosen = Some(json!(choice));
                    }
                }
            });
            named(list.response, WidgetType::ComboBox, name);
            Changed::now(chosen)
        }
        Shape::Vector(count) => vector_ui(field, *count, value, ui),
        Shape::Json if name == "curve" => curve::ui(value, ui),
        Shape::Texts => texts_ui(drafts, node, field, value, ui),
        Shape::Points(..) | Shape::Groups | Shape::Json => json_ui(drafts, node, field, value, ui),
    }
}

/// Slides where the range is short enough for a hand, else is dragged.
fn number_ui(field: &Field, range: &Range, value: &Json, ui: &mut Ui) -> Changed {
    let mut now = value.as_f64().unwrap_or(0.0);
    let unit = if field.unit.is_empty() { String::new() } else { format!(" {}", field.unit) };
    let response = match (range.least, range.most) {
        (Some(least), Some(most)) if most - least <= 720.0 => {
            let slider = Slider::new(&mut now, least..=most).suffix(unit).clamping(egui::SliderClamping::Always);
            ui.add(if range.integer { slider.integer() } else { slider.max_decimals(4) })
        }
        (least, most) => {
            let span = least.unwrap_or(f64::NEG_INFINITY)..=most.unwrap_or(f64::INFINITY);
            let speed = if range.integer { 1.0 } else { (now.abs() * 0.01).max(0.005) };
            ui.add(DragValue::new(&mut now).range(span).speed(speed).suffix(unit).max_decimals(4))
        }
    };
    let response = named(response, WidgetType::DragValue, field.name.as_str());
    Changed::of(&response, number(range.clamp(now), range))
}

fn vector_ui(field: &Field, count: usize, value: &Json, ui: &mut Ui) -> Changed {
    let mut now: Vec<f64> = (0..count).map(|i| value.get(i).and_then(Json::as_f64).unwrap_or(0.0)).collect();
    let is_colour = count == 3 && ["colour", "tint"].iter().any(|word| field.name.contains(word));
    let axes = if is_colour { ["r", "g", "b", "a"] } else { ["x", "y", "z", "w"] };
    let mut all = Changed::default();
    ui.horizontal(|ui| {
        if is_colour {
            let mut colour = [0, 1, 2].map(|i| now[i] as f32);
            let response = ui.color_edit_button_rgb(&mut colour);
            let response = named(response, WidgetType::ColorButton, format!("colour of {}", field.name));
            if response.changed() {
                now = colour.iter().map(|x| (f64::from(*x) * 1e4).round() / 1e4).collect();
                all.value = Some(json!(now));
            }
        }
        for i in 0..count {
            let axis = axes.get(i).copied().unwrap_or("");
            let response = ui.add(DragValue::new(&mut now[i]).speed(0.01).max_decimals(4).prefix(format!("{axis} ")));
            let response = named(response, WidgetType::DragValue, format!("{} {axis}", field.name));
            all.is_over |= response.drag_stopped() || response.lost_focus();
            if response.changed() {
                all.value = Some(json!(now));
            }
        }
        if !field.unit.is_empty() {
            ui.weak(&field.unit);
        }
    });
    all
}

fn text_ui(drafts: &mut Drafts, node: &str, field: &Field, value: &Json, ui: &mut Ui) -> Changed {
    let key = format!("{node}.{}", field.name);
    let is_file = field.name == "file";
    let (typed, pick_file) = ui
        .horizontal(|ui| {
            let width = ui.available_width() - if is_file { 40.0 } else { 8.0 };
            let typed = drafts.line(ui, &key, value.as_str().unwrap_or_default(), width.max(60.0));
            let pick = is_file && named(ui.button("…"), WidgetType::Button, "choose a file").clicked();
            (typed, pick)
        })
        .inner;
    named(typed.response, WidgetType::TextEdit, field.name.as_str());
    Changed { pick_file, ..Changed::now(typed.done.map(Json::from)) }
}

/// One a line: names may hold anything else.
fn texts_ui(drafts: &mut Drafts, node: &str, field: &Field, value: &Json, ui: &mut Ui) -> Changed {
    let key = format!("{node}.{}", field.name);
    let now: Vec<&str> = value.as_array().into_iter().flatten().filter_map(Json::as_str).collect();
    let typed = drafts.lines(ui, &key, &now.join("\n"));
    named(typed.response, WidgetType::TextEdit, field.name.as_str())
        .on_hover_text("one name a line; * and ? stand for any");
    let list = |text: String| {
        let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        json!(lines)
    };
    Changed::now(typed.done.map(list))
}

/// Anything else, as the recipe has it.
fn json_ui(drafts: &mut Drafts, node: &str, field: &Field, value: &Json, ui: &mut Ui) -> Changed {
    let key = format!("{node}.{}", field.name);
    let count = value.as_array().map_or(String::new(), |list| format!("{} entries", list.len()));
    let fault = ui.id().with("fault");
    let changed = egui::CollapsingHeader::new(format!("as text {count}")).id_salt(&key).show(ui, |ui| {
        let typed = drafts.lines(ui, &key, &value.to_string());
        named(typed.response, WidgetType::TextEdit, field.name.as_str());
        if let Some(message) = ui.data(|data| data.get_temp::<String>(fault)) {
            ui.colored_label(ui.visuals().error_fg_color, format!("this is not JSON: {message}"));
        }
        let read = serde_json::from_str::<Json>(&typed.done?);
        match &read {
            Ok(_) => ui.data_mut(|data| data.remove::<String>(fault)),
            Err(error) => drop(ui.data_mut(|data| data.insert_temp(fault, error.to_string()))),
        }
        read.ok()
    });
    Changed::now(changed.body_returned.flatten())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::fields;
    use crate::nodes;

    /// What a switch of an optional parameter starts from is a value that the node takes.
    #[test]
    fn values_to_start_from_are_taken() {
        for node_type in nodes::ALL {
            for field in fields(node_type).into_iter().filter(|field| field.optional && field.shape != Shape::Json) {
                let mut params = serde_json::Map::new();
                params.insert(field.name.clone(), start(&field));
                let name = format!("{}.{} = {}", node_type.info.name, field.name, start(&field));
                if let Err(error) = (node_type.parse)(params) {
                    panic!("{name}: {error}");
                }
            }
        }
    }

    #[test]
    fn words_in_front_are_what_it_starts_from() {
        let position =
            fields(nodes::find("light").unwrap()).into_iter().find(|field| field.name == "position").unwrap();
        assert_eq!(start(&position), json!([0.0, 2.0, 0.0]));
    }
}
