//! A parameter that changes over frames: keys and how to go from one to the next.
//!
//! `linear` and `smooth` take numbers and (nested) lists of numbers, component by component; `hold` takes anything.
//! `smooth` leaves and enters every key at rest: `t² (3 - 2 t)` of the way, so it never overshoots. Before the first
//! key and after the last their values hold. At a key the value is the key's, exactly.

use super::source::child;
use crate::names::suggest;
use serde_json::{Map, Value as Json};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    Linear,
    Smooth,
    Hold,
}

impl Interpolation {
    const NAMES: [(&'static str, Self); 3] = [("linear", Self::Linear), ("smooth", Self::Smooth), ("hold", Self::Hold)];
}

#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Frame and value; frames rise strictly.
    keys: Vec<(f64, Json)>,
    interpolation: Interpolation,
}

/// A pointer inside the curve, a message and a help.
pub type Complaint = (String, String, String);

/// Whether a parameter's value is written as a curve.
pub fn is_curve(value: &Json) -> bool {
    value.as_object().is_some_and(|object| object.contains_key("keys"))
}

impl Curve {
    /// # Errors
    /// All that is wrong with it.
    pub fn parse(object: &Map<String, Json>) -> Result<Self, Vec<Complaint>> {
        let mut complaints: Vec<Complaint> = Vec::new();
        let mut complain =
            |pointer: String, message: &str, help: String| complaints.push((pointer, message.into(), help));
        for name in object.keys().filter(|name| !["keys", "interpolation"].contains(&name.as_str())) {
            let help = suggest(name, ["keys", "interpolation"]);
            complain(child("", name), &format!("a curve has no field \"{name}\""), help);
        }
        let interpolation = match object.get("interpolation") {
            None => Interpolation::Linear,
            Some(given) => {
                let known = Interpolation::NAMES.iter().find(|(name, _)| given.as_str() == Some(name));
                known.map(|(_, interpolation)| *interpolation).unwrap_or_else(|| {
                    let names = Interpolation::NAMES.map(|(name, _)| name);
                    let help = given.as_str().map_or(format!("known: {}", names.join(", ")), |s| suggest(s, names));
                    complain("/interpolation".into(), &format!("there is no interpolation {given}"), help);
                    Interpolation::Hold
                })
            }
        };
        let mut keys: Vec<(f64, Json)> = Vec::new();
        match object.get("keys").and_then(Json::as_array) {
            None => complain("/keys".into(), "the keys of a curve are a list", "write [[frame, value], ...]".into()),
            Some(list) if list.is_empty() => {
                complain("/keys".into(), "a curve needs at least one key", "write [[frame, value], ...]".into());
            }
            Some(list) => {
                for (index, key) in list.iter().enumerate() {
                    let pointer = format!("/keys/{index}");
                    let pair = key.as_array().filter(|pair| pair.len() == 2);
                    let Some((frame, value)) = pair.and_then(|pair| Some((pair[0].as_f64()?, &pair[1]))) else {
                        complain(
                            pointer,
                            &format!("a key is a frame and a value, not {key}"),
                            "write [frame, value]".into(),
                        );
                        continue;
                    };
                    match keys.last() {
                        Some((before, _)) if *before >= frame => {
                            let message = format!("frame {frame} comes after frame {before}");
                            complain(pointer, &message, "sort the keys by frame, one key a frame".into());
                        }
                        Some((_, other)) if interpolation != Interpolation::Hold && !alike(value, other) => {
                            let message = format!("{value} cannot be interpolated with {other}");
                            let help = "numbers and lists of as many numbers can; for anything else use \"hold\"";
                            complain(pointer, &message, help.into());
                        }
                        None if interpolation != Interpolation::Hold && !alike(value, value) => {
                            let message = format!("{value} cannot be interpolated");
                            complain(pointer, &message, "use \"interpolation\": \"hold\"".into());
                        }
                        _ => keys.push((frame, value.clone())),
                    }
                }
            }
        }
        if complaints.is_empty() { Ok(Self { keys, interpolation }) } else { Err(complaints) }
    }

    pub fn keys(&self) -> &[(f64, Json)] {
        &self.keys
    }

    pub fn at(&self, frame: f64) -> Json {
        let after = self.keys.partition_point(|(key, _)| *key <= frame);
        let Some((start, from)) = after.checked_sub(1).map(|index| &self.keys[index]) else {
            return self.keys[0].1.clone();
        };
        let Some((end, to)) = self.keys.get(after) else { return from.clone() };
        let t = (frame - start) / (end - start);
        match self.interpolation {
            Interpolation::Hold => from.clone(),
            Interpolation::Linear => mix(from, to, t),
            Interpolation::Smooth => mix(from, to, t * t * (3.0 - 2.0 * t)),
        }
    }
}

/// Two values that can be interpolated: numbers, or lists of the same shape.
fn alike(a: &Json, b: &Json) -> bool {
    match (a, b) {
        (Json::Number(_), Json::Number(_)) => true,
        (Json::Array(a), Json::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| alike(a, b)),
        _ => false,
    }
}

fn mix(from: &Json, to: &Json, t: f64) -> Json {
    match (from, to) {
        (Json::Array(a), Json::Array(b)) => a.iter().zip(b).map(|(a, b)| mix(a, b, t)).collect(),
        _ if from == to || t <= 0.0 => from.clone(),
        _ => match (from.as_f64(), to.as_f64()) {
            // Halves first: the difference of two huge numbers may not be finite.
            (Some(a), Some(b)) => Json::from(a * (1.0 - t) + b * t),
            _ => from.clone(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn curve(value: Json) -> Curve {
        Curve::parse(value.as_object().unwrap()).unwrap()
    }

    fn complaints(value: Json) -> Vec<String> {
        let found = Curve::parse(value.as_object().unwrap()).unwrap_err();
        found.into_iter().map(|(pointer, message, _)| format!("{pointer}: {message}")).collect()
    }

    #[test]
    fn linear_smooth_and_hold_by_hand() {
        let keys = json!([[1, 0.0], [5, 8.0], [6, -2.0]]);
        for (name, at_two) in [("linear", 2.0), ("smooth", 8.0 * (0.0625 * 2.5)), ("hold", 0.0)] {
            let curve = curve(json!({"keys": keys, "interpolation": name}));
            assert_eq!(curve.at(2.0).as_f64(), Some(at_two), "{name}");
            assert_eq!(curve.at(5.0), json!(8.0), "{name}: a key is its value exactly");
            assert_eq!(curve.at(-100.0), json!(0.0), "{name}: holds before");
            assert_eq!(curve.at(100.0), json!(-2.0), "{name}: holds after");
        }
        assert_eq!(curve(json!({"keys": [[0, 1], [2, 2]]})).at(1.0), json!(1.5), "linear unless said otherwise");
    }

    #[test]
    fn vectors_go_component_by_component_and_equal_values_stay_equal() {
        let curve = curve(json!({"keys": [[0, [0.1, 10, [4]]], [10, [0.1, 20, [8]]]]}));
        assert_eq!(curve.at(5.0), json!([0.1, 15.0, [6.0]]));
    }

    #[test]
    fn words_and_switches_only_hold() {
        let hold = curve(json!({"keys": [[1, "a"], [3, true]], "interpolation": "hold"}));
        assert_eq!((hold.at(2.9), hold.at(3.0)), (json!("a"), json!(true)));
        assert_eq!(complaints(json!({"keys": [[1, "a"], [3, "b"]]})).len(), 2);
        assert_eq!(complaints(json!({"keys": [[1, [1, 2]], [3, [1]]]})).len(), 1);
    }

    #[test]
    fn everything_wrong_is_said() {
        let found = complaints(json!({"keys": [[2, 1], [1, 1], [3], ["x", 2]], "interpolation": "smoth", "key": 1}));
        assert_eq!(found.len(), 5, "{found:#?}");
        assert_eq!(complaints(json!({"keys": []})).len(), 1);
        assert_eq!(complaints(json!({"keys": 3})).len(), 1);
    }
}
