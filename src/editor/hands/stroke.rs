//! Brush strokes: where they go, and how they grow.

use super::insert::free;
use super::light::rounded;
use crate::graph::{Document, split};
use crate::node::Info;
use crate::transport::selection::{Attached, Stroke, StrokeMode};
use crate::value::Kind;
use crate::{Error, Result};
use glam::Vec3;
use serde_json::Value as Json;

/// Points of a stroke are this part of its radius apart, at least.
const APART: f32 = 0.2;

/// The `paint` node that strokes for a node go to: itself, or what is connected to its `port`, or a new one there. What
/// else is connected to that port is kept, and painted upon.
///
/// # Errors
/// `Usage` when there is nothing to paint on, or no port of that name.
pub fn target(document: &mut Document, node: Option<(&str, &Info)>, port: Option<&str>, scene: &str) -> Result<String> {
    let Some((name, info)) = node else { return fresh(document, scene, None) };
    if info.name == "paint" {
        return Ok(name.to_owned());
    }
    let mut ports = info.inputs.iter().filter(|input| input.kind == Kind::Selection);
    let found = match port {
        Some(port) => ports.find(|input| input.name == port),
        None => ports.next(),
    };
    let Some(port) = found.map(|input| input.name) else { return fresh(document, scene, None) };
    let before = document.nodes[name].inputs.get(port).cloned();
    if let Some(before) = &before
        && document.nodes.get(split(before).0).is_some_and(|entry| entry.kind == "paint")
    {
        return Ok(split(before).0.to_owned());
    }
    let paint = fresh(document, scene, document.layout.get(name).copied())?;
    match before {
        None => document.connect(&paint, name, port)?,
        Some(before) => {
            let below = document.layout.get(&paint).copied().unwrap_or_default();
            let place = free(document, [below[0] + 110.0, below[1] + 110.0]);
            let union = document.add_node("select", place);
            document.connect(&before, &union, "a")?;
            document.connect(&paint, &union, "b")?;
            document.connect(&union, name, port)?;
        }
    }
    Ok(paint)
}

fn fresh(document: &mut Document, scene: &str, beside: Option<[f64; 2]>) -> Result<String> {
    let at = beside.map_or([0.0, 320.0], |at| [at[0] - 220.0, at[1] + 130.0]);
    let at = free(document, at);
    let name = document.add_node("paint", at);
    document
        .connect(scene, &name, "scene")
        .map_err(|_| Error::usage("there is no scene to paint on", "add a scene, and view what is made of it"))?;
    Ok(name)
}

/// Starts a stroke.
pub fn begin(document: &mut Document, paint: &str, like: &Stroke) -> Result<()> {
    let stroke = serde_json::to_value(like).expect("plain data");
    strokes(document, paint)?.push(stroke);
    Ok(())
}

/// Lets the last stroke run on to a point and its normal, unless that is too near to its end; says whether it does. On
/// another object than it is attached to, another stroke goes on.
pub fn extend(
    document: &mut Document,
    paint: &str,
    (point, normal): (Vec3, Vec3),
    radius: f32,
    attached: Option<&Attached>,
) -> Result<bool> {
    let strokes = strokes(document, paint)?;
    let Some(Json::Object(stroke)) = strokes.last_mut() else { return Ok(false) };
    let end = stroke.get("points").and_then(Json::as_array).and_then(|points| points.last()).and_then(vector);
    if end.is_some_and(|end| end.distance(point) < APART * radius) {
        return Ok(false);
    }
    let attached = attached.map(|attached| serde_json::to_value(attached).expect("plain data"));
    if stroke.get("attached") != attached.as_ref() {
        let mut other = stroke.clone();
        for (name, value) in [("points", point), ("normals", normal)] {
            other.insert(name.to_owned(), vec![Json::from(value.to_array().map(rounded).to_vec())].into());
        }
        match attached {
            Some(attached) => other.insert("attached".to_owned(), attached),
            None => other.remove("attached"),
        };
        strokes.push(other.into());
        return Ok(true);
    }
    for (name, value) in [("points", point), ("normals", normal)] {
        if let Some(list) = stroke.get_mut(name).and_then(Json::as_array_mut) {
            list.push(value.to_array().map(rounded).to_vec().into());
        }
    }
    Ok(true)
}

/// A stroke of one point.
pub fn dab(point: Vec3, normal: Vec3, radius: f32, hardness: f32, value: f32, erase: bool, adaptive: bool) -> Stroke {
    let mode = if erase { StrokeMode::Erase } else { StrokeMode::Add };
    let short = |v: Vec3| v.to_array().map(|x| rounded(x) as f32);
    let (points, normals) = (vec![short(point)], vec![short(normal)]);
    Stroke { points, normals, radius, hardness, value, mode, adaptive, attached: None }
}

fn vector(json: &Json) -> Option<Vec3> {
    let list = json.as_array()?;
    let at = |i: usize| list.get(i).and_then(Json::as_f64).map(|x| x as f32);
    Some(Vec3::new(at(0)?, at(1)?, at(2)?))
}

fn strokes<'a>(document: &'a mut Document, paint: &str) -> Result<&'a mut Vec<Json>> {
    let entry = document.entry_mut(paint).filter(|entry| entry.kind == "paint");
    let Some(entry) = entry else {
        return Err(Error::usage(format!("\"{paint}\" is no paint node"), "paint on another node"));
    };
    let strokes = entry.params.entry("strokes").or_insert_with(|| Json::Array(Vec::new()));
    strokes.as_array_mut().ok_or_else(|| {
        let help = "take the keys of its parameter strokes out first";
        Error::usage(format!("the strokes of \"{paint}\" change over time"), help)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nodes;
    use std::path::Path;

    fn document() -> Document {
        let text = r#"{ "chiaro": 1, "nodes": {
            "room": { "type": "scene" }, "wall": { "type": "pick", "inputs": { "scene": "room" } },
            "edit": { "type": "caster_receiver", "inputs": { "caster": "wall" } }
        }, "layout": { "edit": [400, 0] } }"#;
        Document::parse(Path::new("x.json"), text).unwrap()
    }

    #[test]
    fn strokes_go_where_they_are_meant_to() {
        let mut document = document();
        let edit = nodes::find("caster_receiver").unwrap().info;
        let paint = target(&mut document, Some(("edit", edit)), Some("receiver"), "room").unwrap();
        assert_eq!(document.nodes["edit"].inputs["receiver"], paint);
        assert_eq!(target(&mut document, Some(("edit", edit)), Some("receiver"), "room").unwrap(), paint, "once");
        let info = nodes::find("paint").unwrap().info;
        assert_eq!(target(&mut document, Some((&paint, info)), None, "room").unwrap(), paint);
        // What was picked stays picked.
        let more = target(&mut document, Some(("edit", edit)), Some("caster"), "room").unwrap();
        let union = &document.nodes["edit"].inputs["caster"];
        assert_eq!(document.nodes[union].inputs["a"], "wall");
        assert_eq!(document.nodes[union].inputs["b"], more);
        let alone = target(&mut document, None, None, "room").unwrap();
        assert!(![&paint, &more].contains(&&alone));
        assert!(target(&mut document, None, None, "gone").is_err());
    }

    #[test]
    fn a_stroke_grows_by_steps_that_can_be_seen() {
        let mut document = document();
        let paint = target(&mut document, None, None, "room").unwrap();
        begin(&mut document, &paint, &dab(Vec3::ZERO, Vec3::Y, 0.5, 0.5, 1.0, false, false)).unwrap();
        let mut to = |x: f32| extend(&mut document, &paint, (Vec3::new(x, 0.0, 0.0), Vec3::Y), 0.5, None).unwrap();
        assert!(!to(0.05) && to(0.15) && !to(0.2) && to(0.3));
        let strokes: Vec<Stroke> = serde_json::from_value(document.nodes[&paint].params["strokes"].clone()).unwrap();
        assert_eq!((strokes.len(), strokes[0].points.len(), strokes[0].normals.len()), (1, 3, 3));
        assert!(begin(&mut document, "edit", &strokes[0]).is_err());
    }

    #[test]
    fn a_stroke_that_comes_to_something_that_moves_goes_on_as_another() {
        let mut document = document();
        let paint = target(&mut document, None, None, "room").unwrap();
        begin(&mut document, &paint, &dab(Vec3::ZERO, Vec3::Y, 0.5, 0.25, 0.75, true, true)).unwrap();
        let on = |object: &str| Some(Attached { object: object.to_owned(), frame: 7 });
        for (x, object) in [(1.0, None), (2.0, on("a")), (3.0, on("a")), (4.0, on("b")), (5.0, None)] {
            let at = (Vec3::new(x, 0.0, 0.0), Vec3::Y);
            assert!(extend(&mut document, &paint, at, 0.5, object.as_ref()).unwrap());
        }
        let strokes: Vec<Stroke> = serde_json::from_value(document.nodes[&paint].params["strokes"].clone()).unwrap();
        let found: Vec<_> = strokes.iter().map(|stroke| (stroke.points.len(), stroke.attached.clone())).collect();
        assert_eq!(found, [(2, None), (2, on("a")), (1, on("b")), (1, None)]);
        for stroke in &strokes {
            assert_eq!((stroke.hardness, stroke.value, stroke.adaptive), (0.25, 0.75, true));
            assert_eq!((stroke.mode, stroke.normals.len()), (StrokeMode::Erase, stroke.points.len()));
        }
    }
}
