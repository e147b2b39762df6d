//! Points of a node's parameters that lie in the picture, and can be taken by the hand.

use super::light::rounded;
use glam::{Vec2, Vec3};
use serde_json::{Map, Value as Json, json};

/// Where a handle is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Metres, world.
    World(Vec3),
    /// Heights of the picture from its upper left corner, y down.
    Picture(Vec2),
}

#[derive(Clone, Debug, PartialEq)]
pub struct Handle {
    pub name: String,
    pub at: Place,
    /// Number of the handle that a line is drawn to; an arrow's tail.
    pub tail: Option<usize>,
    pub kind: Grip,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grip {
    Point,
    /// The head of an arrow.
    Arrow,
    /// Turns about its tail.
    Turn,
    /// Stretches away from its tail.
    Stretch,
}

/// Distance of the handles that turn and stretch from what they turn about, in heights.
const ARM: f32 = 0.16;

fn vec2(json: &Json) -> Option<Vec2> {
    let at = |i: usize| json.get(i).and_then(Json::as_f64).map(|x| x as f32);
    Some(Vec2::new(at(0)?, at(1)?))
}

fn vec3(json: &Json) -> Option<Vec3> {
    let at = |i: usize| json.get(i).and_then(Json::as_f64).map(|x| x as f32);
    Some(Vec3::new(at(0)?, at(1)?, at(2)?))
}

fn list(v: Vec2) -> Json {
    json!(v.to_array().map(rounded))
}

fn world(v: Vec3) -> Json {
    json!(v.to_array().map(rounded))
}

fn handle(name: &str, at: Place, tail: Option<usize>, kind: Grip) -> Handle {
    Handle { name: name.to_owned(), at, tail, kind }
}

/// Of a node with these parameters (all of them, at the frame), in a picture of `aspect` = width / height.
pub fn handles(kind: &str, params: &Map<String, Json>, aspect: f32) -> Vec<Handle> {
    let get = |name: &str| params.get(name).unwrap_or(&Json::Null);
    match kind {
        "light" => {
            vec3(get("position")).map(|at| handle("light", Place::World(at), None, Grip::Point)).into_iter().collect()
        }
        "shadow_gradient" => match (vec3(get("from")), vec3(get("to"))) {
            (Some(from), Some(to)) => vec![
                handle("from", Place::World(from), None, Grip::Point),
                handle("to", Place::World(to), Some(0), Grip::Arrow),
            ],
            _ => Vec::new(),
        },
        "ratio_grade" => {
            let end = |name: &str| vec2(&get("gradient")[name]);
            match (end("from"), end("to")) {
                (Some(from), Some(to)) => vec![
                    handle("from", Place::Picture(from), None, Grip::Point),
                    handle("to", Place::Picture(to), Some(0), Grip::Arrow),
                ],
                _ => Vec::new(),
            }
        }
        "ratio_transform" if get("space") != "uv" => transform(params, aspect),
        "ratio_lattice" => lattice(params, aspect)
            .into_iter()
            .enumerate()
            .map(|(i, at)| handle(&format!("point {i}"), Place::Picture(at), None, Grip::Point))
            .collect(),
        _ => Vec::new(),
    }
}

fn transform(params: &Map<String, Json>, aspect: f32) -> Vec<Handle> {
    if let Some(corners) = params.get("corners").and_then(Json::as_array) {
        let names = ["upper left", "upper right", "lower right", "lower left"];
        let corner = |(i, (at, name)): (usize, (&Json, &str))| {
            Some(handle(name, Place::Picture(vec2(at)?), i.checked_sub(1), Grip::Point))
        };
        return corners.iter().zip(names).enumerate().filter_map(corner).collect();
    }
    let (pivot, moved, angle) = pose(params, aspect);
    let way = |degrees: f32| Vec2::from_angle(-degrees.to_radians());
    vec![
        handle("move", Place::Picture(pivot + moved), None, Grip::Point),
        handle("turn", Place::Picture(pivot + moved + ARM * way(angle)), Some(0), Grip::Turn),
        handle("scale", Place::Picture(pivot + moved + 0.7 * ARM * way(angle - 45.0)), Some(0), Grip::Stretch),
    ]
}

fn pose(params: &Map<String, Json>, aspect: f32) -> (Vec2, Vec2, f32) {
    let pivot = params.get("pivot").and_then(vec2).unwrap_or(Vec2::new(0.5 * aspect, 0.5));
    let moved = params.get("translate").and_then(vec2).unwrap_or_default();
    let angle = params.get("rotate").and_then(Json::as_f64).unwrap_or(0.0) as f32;
    (pivot, moved, angle)
}

/// Control points, also where none is given yet.
fn lattice(params: &Map<String, Json>, aspect: f32) -> Vec<Vec2> {
    let count = |name: &str| params.get(name).and_then(Json::as_u64).unwrap_or(1).clamp(1, 64) as usize;
    let (rows, columns) = (count("rows"), count("columns"));
    let given = params.get("points").and_then(Json::as_array);
    let given: Vec<Vec2> = given.into_iter().flatten().filter_map(vec2).collect();
    if given.len() == (rows + 1) * (columns + 1) {
        return given;
    }
    let frame = params.get("frame").and_then(Json::as_array);
    let corner = |i: usize| frame.and_then(|frame| frame.get(i)).and_then(vec2);
    let low = corner(0).unwrap_or(Vec2::ZERO);
    let high = corner(1).unwrap_or(Vec2::new(aspect, 1.0));
    let at = |row: usize, column: usize| {
        low + (high - low) * Vec2::new(column as f32 / columns as f32, row as f32 / rows as f32)
    };
    (0..=rows).flat_map(|row| (0..=columns).map(move |column| (row, column))).map(|(r, c)| at(r, c)).collect()
}

/// The parameters that change when a handle goes from one place to another, with their new values.
pub fn dragged(
    kind: &str,
    params: &Map<String, Json>,
    aspect: f32,
    number: usize,
    from: Place,
    to: Place,
) -> Vec<(&'static str, Json)> {
    let by = match (from, to) {
        (Place::Picture(from), Place::Picture(to)) => to - from,
        _ => Vec2::ZERO,
    };
    match (kind, to) {
        ("light", Place::World(to)) => vec![("position", world(to))],
        ("shadow_gradient", Place::World(to)) => vec![(if number == 0 { "from" } else { "to" }, world(to))],
        ("ratio_grade", Place::Picture(to)) => {
            let mut gradient = params.get("gradient").cloned().unwrap_or_default();
            gradient[if number == 0 { "from" } else { "to" }] = list(to);
            vec![("gradient", gradient)]
        }
        ("ratio_lattice", Place::Picture(to)) => {
            let mut points = lattice(params, aspect);
            if let Some(point) = points.get_mut(number) {
                *point = to;
            }
            vec![("points", points.into_iter().map(list).collect())]
        }
        ("ratio_transform", Place::Picture(to)) => match params.get("corners").and_then(Json::as_array) {
            Some(corners) => {
                let mut corners = corners.clone();
                if let Some(corner) = corners.get_mut(number) {
                    *corner = list(to);
                }
                vec![("corners", corners.into())]
            }
            None => posed(params, aspect, number, by, to),
        },
        _ => Vec::new(),
    }
}

fn posed(params: &Map<String, Json>, aspect: f32, number: usize, by: Vec2, to: Vec2) -> Vec<(&'static str, Json)> {
    let (pivot, moved, _) = pose(params, aspect);
    let middle = pivot + moved;
    let arm = to - middle;
    match number {
        0 => vec![("translate", list(moved + by))],
        1 if arm.length() > 1e-4 => {
            let degrees = (-arm.y).atan2(arm.x).to_degrees();
            vec![("rotate", json!((f64::from(degrees) * 10.0).round() / 10.0))]
        }
        2 => {
            let scale = (arm.length() / (0.7 * ARM)).max(0.01);
            vec![("scale", json!([rounded(scale), rounded(scale)]))]
        }
        _ => Vec::new(),
    }
}

/// What a node gets when it is asked for handles that it has none of yet: an arrow across the picture, corners to pull.
pub fn begun(kind: &str, aspect: f32) -> Option<(&'static str, Json)> {
    match kind {
        "ratio_grade" => {
            let at = |share: f32| list(Vec2::new(0.5 * aspect, share));
            Some(("gradient", json!({ "from": at(0.25), "to": at(0.75) })))
        }
        "ratio_transform" => {
            let corners = [Vec2::ZERO, Vec2::new(aspect, 0.0), Vec2::new(aspect, 1.0), Vec2::new(0.0, 1.0)];
            Some(("corners", corners.into_iter().map(list).collect()))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nodes;

    fn params(kind: &str) -> Map<String, Json> {
        (nodes::find(kind).unwrap().defaults)().as_object().unwrap().clone()
    }

    /// A handle that is dragged is where it was dragged to.
    fn follows(kind: &str, mut params: Map<String, Json>, to: impl Fn(Place) -> Place) {
        for number in 0..handles(kind, &params, 1.5).len() {
            let from = handles(kind, &params, 1.5)[number].at;
            let wanted = to(from);
            for (name, value) in dragged(kind, &params, 1.5, number, from, wanted) {
                params.insert(name.to_owned(), value);
            }
            (nodes::find(kind).unwrap().parse)(params.clone()).unwrap_or_else(|error| panic!("{kind}: {error}"));
            let now = handles(kind, &params, 1.5)[number].at;
            let is_near = match (now, wanted) {
                (Place::Picture(a), Place::Picture(b)) => a.distance(b) < 2e-4,
                (Place::World(a), Place::World(b)) => a.distance(b) < 2e-4,
                _ => false,
            };
            // Handles that turn or stretch keep their distance, or their angle.
            let is_free = number == 0 || kind != "ratio_transform" || params["corners"].is_array();
            assert!(is_near || !is_free, "{kind} {number}: {now:?}, not {wanted:?}");
        }
    }

    #[test]
    fn handles_follow_the_hand() {
        let aside = |place: Place| match place {
            Place::Picture(at) => Place::Picture(at + Vec2::new(0.03, -0.02)),
            Place::World(at) => Place::World(at + Vec3::new(0.1, 0.2, 0.3)),
        };
        let mut lamp = params("light");
        assert!(handles("light", &lamp, 1.5).is_empty(), "a light of the scene stays where the scene has it");
        lamp.insert("position".to_owned(), json!([0.0, 1.0, 0.0]));
        follows("light", lamp, aside);
        follows("shadow_gradient", params("shadow_gradient"), aside);
        follows("ratio_lattice", params("ratio_lattice"), aside);
        follows("ratio_transform", params("ratio_transform"), aside);
        for kind in ["ratio_grade", "ratio_transform"] {
            let mut params = params(kind);
            let (name, value) = begun(kind, 1.5).unwrap();
            params.insert(name.to_owned(), value);
            assert!(handles(kind, &params, 1.5).len() >= 2);
            follows(kind, params, aside);
        }
        assert!(handles("scene", &params("scene"), 1.5).is_empty());
    }

    #[test]
    fn turning_and_stretching_by_hand() {
        let params = params("ratio_transform");
        let at = |number: usize| handles("ratio_transform", &params, 2.0)[number].at;
        let Place::Picture(middle) = at(0) else { panic!() };
        let to = Place::Picture(middle + Vec2::new(0.0, -0.3));
        assert_eq!(
            dragged("ratio_transform", &params, 2.0, 1, at(1), to),
            [("rotate", json!(90.0))],
            "up is a quarter"
        );
        let Place::Picture(stretch) = at(2) else { panic!() };
        let to = Place::Picture(middle + 2.0 * (stretch - middle));
        assert_eq!(dragged("ratio_transform", &params, 2.0, 2, at(2), to)[0].1, json!([2.0, 2.0]));
    }
}
