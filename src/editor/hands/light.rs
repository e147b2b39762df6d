//! Placing lights (thesis 4.4.1): a press on a surface puts a light in front of it.

use super::insert::free;
use crate::graph::{Document, split};
use crate::{Error, Result};
use glam::Vec3;
use serde_json::json;

/// Where a light goes that is placed on a surface: off it, metres along its normal.
pub fn position(surface: Vec3, normal: Vec3, offset: f32) -> Vec3 {
    surface + normal * offset
}

/// Adds a point light to the scene that `lit`, a node, is lit by, and returns the new node's name. Only what is lit takes
/// from it: nothing else depends on lights.
///
/// # Errors
/// `Usage` when nothing before `lit` takes light from a scene.
pub fn place(document: &mut Document, lit: &str, position: Vec3) -> Result<String> {
    let source = source(document, lit).ok_or_else(|| {
        let help = "view a relight, or what is made of one; an environment lights what integrate gives";
        Error::usage(format!("\"{lit}\" is not lit by a scene"), help)
    })?;
    let (relight, from) = source;
    let beside = document.layout.get(&relight).copied().unwrap_or_default();
    let place = free(document, [beside[0] - 180.0, beside[1] - 110.0]);
    let name = document.add_node("light", place);
    document.connect(&from, &name, "scene")?;
    document.connect(&name, &relight, "scene")?;
    // A light of the scene is changed by name: each node has one of its own.
    document.set_param(&name, "name", Some(name.clone().into()));
    document.set_param(&name, "kind", Some("point".into()));
    place_at(document, &name, position);
    Ok(name)
}

/// Moves the light of a node.
pub fn place_at(document: &mut Document, node: &str, position: Vec3) {
    document.set_param(node, "position", Some(json!(position.to_array().map(rounded))));
}

/// To the tenth of a millimetre: recipes are read by people.
pub fn rounded(metres: f32) -> f64 {
    (f64::from(metres) * 1e4).round() / 1e4
}

/// The nearest relight, and what it takes as its scene.
fn source(document: &Document, lit: &str) -> Option<(String, String)> {
    let relight = crate::editor::look::nearest(document, lit, "relight")?;
    let from = document.nodes[&relight].inputs.get("scene")?.clone();
    document.nodes.contains_key(split(&from).0).then_some((relight, from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_light_goes_into_the_scene_that_is_relit() {
        let text = r#"{ "chiaro": 1, "nodes": {
            "room": { "type": "scene" }, "way": { "type": "transfer", "inputs": { "scene": "room" } },
            "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "way" } },
            "shown": { "type": "tone_map", "inputs": { "image": "lit" } }
        } }"#;
        let mut document = Document::parse(Path::new("x.json"), text).unwrap();
        let at = position(Vec3::new(1.0, 0.0, 2.0), Vec3::Y, 0.25);
        let first = place(&mut document, "shown", at).unwrap();
        assert_eq!(document.nodes["lit"].inputs["scene"], first);
        assert_eq!(document.nodes[&first].params["position"], json!([1.0, 0.25, 2.0]));
        let second = place(&mut document, "lit", at).unwrap();
        assert_eq!(document.nodes["lit"].inputs["scene"], second);
        assert_eq!(document.nodes[&second].inputs["scene"], first, "one behind the other");
        assert_ne!(document.nodes[&first].params["name"], document.nodes[&second].params["name"]);
        assert!(place(&mut document, "room", at).unwrap_err().help().contains("relight"));
    }
}
