//! From paint on a shadow to the light that it belongs to, and to edits of that shadow (thesis 6.7.2).

use super::insert::{free, insert_after};
use crate::editor::look::nearest;
use crate::graph::{Document, split};
use crate::{Error, Result};

/// Nodes that were added.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// A localize_light.
    pub light: String,
    /// What is chosen next.
    pub edit: String,
    /// An environment_image that shows the light.
    pub picture: String,
}

/// `find_light` as a change of the recipe.
pub fn find_light_of(selected: &[String]) -> impl FnOnce(&mut Document) -> Result<Found> {
    let selected = selected.to_vec();
    move |document| find_light(document, &selected)
}

/// Finds the light of the shadow that a chosen selection lies in: adds a localize_light and a picture of what it finds.
///
/// # Errors
/// `Usage` when no selection is chosen, or nothing in the recipe integrates an environment.
pub fn find_light(document: &mut Document, selected: &[String]) -> Result<Found> {
    let is_selection = |name: &&String| ["paint", "pick", "select"].contains(&document.nodes[*name].kind.as_str());
    let paint = selected.iter().rev().find(is_selection).cloned().ok_or_else(|| {
        Error::usage("no painted shadow is chosen", "paint inside of a shadow, and select the paint node")
    })?;
    let lacking = || {
        let help = "lights are found in an environment: add visibility and integrate";
        Error::usage("no node of the recipe integrates an environment", help)
    };
    let integrate = document.nodes.iter().find(|(_, entry)| entry.kind == "integrate").map(|(name, _)| name.clone());
    let integrate = integrate.ok_or_else(lacking)?;
    let seen = nearest(document, &integrate, "visibility").ok_or_else(lacking)?;
    let environment = document.nodes[&seen].inputs.get("environment");
    let environment =
        environment.or(document.nodes[&integrate].inputs.get("environment")).cloned().ok_or_else(lacking)?;
    let beside = document.layout.get(&paint).copied().unwrap_or_default();
    let place = free(document, [beside[0] + 220.0, beside[1]]);
    let light = document.add_node("localize_light", place);
    document.connect(&seen, &light, "visibility")?;
    document.connect(&environment, &light, "environment")?;
    document.connect(&paint, &light, "selection")?;
    // The brightest of what the shadow misses; all at once is `which` 0.
    document.set_param(&light, "which", Some(1.into()));
    let place = free(document, [beside[0] + 440.0, beside[1] + 120.0]);
    let picture = document.add_node("environment_image", place);
    document.connect(&environment, &picture, "environment")?;
    document.connect(&light, &picture, "light")?;
    Ok(Found { edit: light.clone(), light, picture })
}

/// Edits that a found light's shadow can have.
pub const SHADOW_EDITS: [(&str, &str); 6] = [
    ("remove_shadow", "Remove"),
    ("translate_shadow", "Move"),
    ("rotate_shadow", "Turn"),
    ("blur_shadow", "Blur"),
    ("tint_shadow", "Tint"),
    ("shadow_gradient", "Fade along an arrow"),
];

/// Adds an edit of the shadow of `light`, a localize_light, in front of what is integrated. Returns its name.
///
/// # Errors
/// `Usage` when nothing is integrated.
pub fn edit_shadow(document: &mut Document, light: &str, kind: &str) -> Result<String> {
    let integrate = document.nodes.iter().find(|(_, entry)| entry.kind == "integrate");
    let from = integrate.and_then(|(_, entry)| entry.inputs.get("visibility")).cloned();
    let from = from.filter(|from| document.nodes.contains_key(split(from).0)).ok_or_else(|| {
        Error::usage("no node of the recipe integrates a visibility", "add integrate, and connect it")
    })?;
    // What finds lights or shows what is seen goes on to look at the shadows as they were.
    let keep: Vec<(String, String)> = document
        .nodes
        .iter()
        .filter(|(_, entry)| entry.kind != "integrate")
        .flat_map(|(name, entry)| entry.inputs.iter().map(move |(port, wire)| (name, port, wire)))
        .filter(|(_, _, wire)| **wire == from)
        .map(|(name, port, _)| (name.clone(), port.clone()))
        .collect();
    let edit = insert_after(document, &from, kind, "visibility")?;
    for (node, port) in keep {
        document.connect(&from, &node, &port)?;
    }
    document.connect(light, &edit, "light")?;
    Ok(edit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn document() -> Document {
        let text = r#"{ "chiaro": 1, "nodes": {
            "yard": { "type": "scene" }, "night": { "type": "environment" },
            "seen": { "type": "visibility", "inputs": { "scene": "yard", "environment": "night" } },
            "dab": { "type": "paint", "inputs": { "scene": "yard" } },
            "lit": { "type": "integrate", "inputs": { "visibility": "seen", "environment": "night" } }
        } }"#;
        Document::parse(Path::new("x.json"), text).unwrap()
    }

    #[test]
    fn a_light_is_found_and_its_shadow_edited() {
        let mut document = document();
        let found = find_light(&mut document, &["dab".to_owned()]).unwrap();
        let light = &document.nodes[&found.light];
        assert_eq!(
            (&*light.inputs["visibility"], &*light.inputs["environment"], &*light.inputs["selection"]),
            ("seen", "night", "dab")
        );
        assert_eq!(document.nodes[&found.picture].inputs["light"], found.light);
        let edit = edit_shadow(&mut document, &found.light, "remove_shadow").unwrap();
        assert_eq!(document.nodes["lit"].inputs["visibility"], edit);
        assert_eq!(document.nodes[&edit].inputs["visibility"], "seen");
        assert_eq!(document.nodes[&found.light].inputs["visibility"], "seen", "no light is found in its own edit");
        let second = edit_shadow(&mut document, &found.light, "blur_shadow").unwrap();
        assert_eq!(document.nodes[&second].inputs["visibility"], edit);
        assert!(find_light(&mut document, &["yard".to_owned()]).is_err());
        let mut empty = Document::empty();
        assert!(edit_shadow(&mut empty, "x", "remove_shadow").is_err());
    }
}
