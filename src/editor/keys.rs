//! Parameters that change over time, as the editor changes them: keys are set, moved and taken out.

use crate::graph::{Document, curve};
use serde_json::{Map, Value as Json, json};
use std::borrow::Cow;

/// Keys of a parameter, in order; `None` when it does not change over time.
pub fn keys(document: &Document, node: &str, param: &str) -> Option<Vec<(f64, Json)>> {
    let value = document.nodes.get(node)?.params.get(param)?;
    let list = value.as_object().filter(|_| curve::is_curve(value))?.get("keys")?.as_array()?;
    Some(list.iter().filter_map(|key| Some((key.get(0)?.as_f64()?, key.get(1)?.clone()))).collect())
}

/// How it goes from key to key.
pub fn interpolation(document: &Document, node: &str, param: &str) -> String {
    let value = document.nodes.get(node).and_then(|entry| entry.params.get(param));
    let name = value.and_then(|value| value.get("interpolation")).and_then(Json::as_str);
    name.unwrap_or("linear").to_owned()
}

/// The value at a frame; the parameter itself where it does not change over time.
pub fn value_at(value: &Json, frame: f64) -> Cow<'_, Json> {
    let object = value.as_object().filter(|_| curve::is_curve(value));
    let curve = object.and_then(|object| curve::Curve::parse(object).ok());
    curve.map_or(Cow::Borrowed(value), |curve| Cow::Owned(curve.at(frame)))
}

/// Sets a value: at the frame where the parameter has keys, and for good where it has none.
pub fn set(document: &mut Document, node: &str, param: &str, value: Json, frame: i64) {
    match keys(document, node, param) {
        Some(_) => set_key(document, node, param, value, frame as f64),
        None => document.set_param(node, param, Some(value)),
    }
}

/// Makes a key, in place of the one that is there.
pub fn set_key(document: &mut Document, node: &str, param: &str, value: Json, frame: f64) {
    let mut list = keys(document, node, param).unwrap_or_default();
    let at = list.partition_point(|(other, _)| *other < frame);
    match list.get_mut(at) {
        Some((other, old)) if *other == frame => *old = value,
        _ => list.insert(at, (frame, value)),
    }
    write(document, node, param, &list);
}

/// Takes a key out; the last one leaves its value.
pub fn remove_key(document: &mut Document, node: &str, param: &str, frame: f64) {
    let Some(mut list) = keys(document, node, param) else { return };
    match &list[..] {
        [(only, value)] if *only == frame => {
            let value = value.clone();
            document.set_param(node, param, Some(value));
        }
        _ => {
            list.retain(|(other, _)| *other != frame);
            write(document, node, param, &list);
        }
    }
}

/// Moves a key to another frame, where it takes the place of what is there; with another value, if one is given.
pub fn move_key(document: &mut Document, node: &str, param: &str, from: f64, to: f64, value: Option<Json>) {
    let Some(list) = keys(document, node, param) else { return };
    let Some((_, old)) = list.iter().find(|(frame, _)| *frame == from).cloned() else { return };
    let mut list: Vec<(f64, Json)> = list.into_iter().filter(|(frame, _)| *frame != from && *frame != to).collect();
    let at = list.partition_point(|(frame, _)| *frame < to);
    list.insert(at, (to, value.unwrap_or(old)));
    write(document, node, param, &list);
}

pub fn set_interpolation(document: &mut Document, node: &str, param: &str, name: &str) {
    let Some(list) = keys(document, node, param) else { return };
    write(document, node, param, &list);
    if let Some(Json::Object(curve)) = document.entry_mut(node).and_then(|entry| entry.params.get_mut(param)) {
        curve.insert("interpolation".to_owned(), name.into());
    }
}

fn write(document: &mut Document, node: &str, param: &str, list: &[(f64, Json)]) {
    let whole = |frame: f64| if frame.fract() == 0.0 { json!(frame as i64) } else { json!(frame) };
    let keys: Vec<Json> = list.iter().map(|(frame, value)| json!([whole(*frame), value])).collect();
    let before = document.nodes.get(node).and_then(|entry| entry.params.get(param));
    let mut curve: Map<String, Json> =
        before.filter(|value| curve::is_curve(value)).and_then(Json::as_object).cloned().unwrap_or_default();
    // What cannot be mixed holds.
    let mixes = |value: &Json| value.is_number() || value.is_array();
    if !list.iter().all(|(_, value)| mixes(value)) {
        curve.insert("interpolation".to_owned(), "hold".into());
    }
    curve.insert("keys".to_owned(), keys.into());
    document.set_param(node, param, Some(curve.into()));
}

/// Frames with keys of any of these nodes, each once, in order.
pub fn frames<'a>(document: &Document, nodes: impl Iterator<Item = &'a str>) -> Vec<f64> {
    let mut frames: Vec<f64> = nodes
        .filter_map(|node| document.nodes.get_key_value(node))
        .flat_map(|(node, entry)| entry.params.keys().filter_map(|param| keys(document, node, param)))
        .flatten()
        .map(|(frame, _)| frame)
        .collect();
    frames.sort_by(f64::total_cmp);
    frames.dedup();
    frames
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn document() -> Document {
        let text = r#"{ "chiaro": 1, "nodes": { "a": { "type": "x", "params": { "b": 2.0, "word": "on" } } } }"#;
        Document::parse(Path::new("x.json"), text).unwrap()
    }

    #[test]
    fn keys_come_move_and_go() {
        let mut document = document();
        set(&mut document, "a", "b", json!(3.0), 5);
        assert_eq!(document.nodes["a"].params["b"], json!(3.0), "without keys it is for good");
        for (frame, value) in [(10.0, 1.0), (1.0, 0.0), (20.0, 2.0)] {
            set_key(&mut document, "a", "b", json!(value), frame);
        }
        set(&mut document, "a", "b", json!(5.0), 10);
        let all = |document: &Document| keys(document, "a", "b").unwrap();
        assert_eq!(all(&document), [(1.0, json!(0.0)), (10.0, json!(5.0)), (20.0, json!(2.0))]);
        assert_eq!(*value_at(&document.nodes["a"].params["b"], 5.5), json!(2.5));
        move_key(&mut document, "a", "b", 1.0, 20.0, None);
        assert_eq!(all(&document), [(10.0, json!(5.0)), (20.0, json!(0.0))]);
        set_interpolation(&mut document, "a", "b", "smooth");
        set_key(&mut document, "a", "b", json!(1.0), 15.0);
        assert_eq!(interpolation(&document, "a", "b"), "smooth", "a new key does not change how");
        assert_eq!(frames(&document, ["a", "gone"].into_iter()), [10.0, 15.0, 20.0]);
        for frame in [10.0, 15.0, 20.0] {
            remove_key(&mut document, "a", "b", frame);
        }
        assert_eq!(document.nodes["a"].params["b"], json!(0.0), "the last key leaves its value");
        set_key(&mut document, "a", "word", json!("on"), 1.0);
        assert_eq!(interpolation(&document, "a", "word"), "hold");
        assert!(document.refreshed().unwrap().problems.is_empty());
    }
}
