//! What a viewer looks at, and what has to be computed to see it.

use crate::graph::{Document, NodeEntry, split};
use crate::params::NodeType;
use crate::value::Kind;
use crate::{Error, Result};
use serde_json::{Map, json};
use std::sync::Arc;

/// A node and the number of its output.
pub type Output = (String, usize);

#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    pub at: Output,
    /// To be compared with.
    pub other: Option<Output>,
    /// A selection that is laid over the picture.
    pub mask: Option<Output>,
    /// Where from, in place of the recipe's camera.
    pub eye: Option<Eye>,
    /// The surfaces as they are, without the light.
    pub clay: bool,
    /// An edit of shadows: where the light of its shadow comes from is to be known.
    pub shadow: Option<String>,
}

impl Look {
    pub fn new(node: &str, output: usize) -> Self {
        Self { at: (node.to_owned(), output), other: None, mask: None, eye: None, clay: false, shadow: None }
    }
}

/// A free camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Metres, world.
    pub position: [f32; 3],
    pub target: [f32; 3],
    /// Degrees.
    pub fov_y: f32,
    /// Pixels.
    pub size: [u32; 2],
}

/// Types of nodes whose samples are the pixels of a picture.
pub const VIEWS: [&str; 2] = ["view_samples", "plate_samples"];

/// Nodes that a viewer adds for itself are called so; no node of a recipe is, see `Staging::new`.
const OWN: &str = "viewer_";

/// A recipe with what a viewer adds, and what to compute of it.
pub struct Staging {
    pub document: Document,
    pub picture: Output,
    pub other: Option<Output>,
    pub mask: Option<Output>,
    /// The view_samples that pixels belong to.
    pub samples: Option<String>,
    /// What is seen there.
    pub scene: Option<Output>,
    /// What an edited shadow is that of.
    pub lamp: Option<Output>,
    pub environment: Option<Output>,
}

impl Staging {
    /// # Errors
    /// `Usage` when there is nothing to be seen of what is looked at.
    pub fn new(document: &Document, look: &Look, registry: &[NodeType]) -> Result<Self> {
        let at = there(document, past_muted(document, &look.at, registry), registry);
        let kind = kind(document, &at, registry)?;
        let mut staging = Self {
            document: document.clone(),
            picture: at,
            other: look.other.clone().filter(|_| !look.clay),
            mask: look.mask.clone(),
            samples: None,
            scene: None,
            lamp: None,
            environment: None,
        };
        if let Some((name, entry)) = look.shadow.as_ref().and_then(|name| document.nodes.get_key_value(name)) {
            staging.environment = nearest(document, name, "environment").map(|node| (node, 0));
            staging.lamp = entry.inputs.get("light").and_then(|from| output_of(document, from, registry));
        }
        let view = nearest_of(document, &look.at.0, &VIEWS);
        match kind {
            Kind::Image | Kind::Ratio | Kind::Environment | Kind::Samples => staging.samples = view,
            Kind::Scene => staging.look_through(view, Some(&look.at), None),
            Kind::Camera => {
                let view = view.or_else(|| of_kind(document, &VIEWS));
                staging.look_through(view, None, Some(&look.at));
            }
            Kind::Selection => {
                staging.mask = Some(look.at.clone());
                let scene = nearest(document, &look.at.0, "scene").map(|scene| (scene, 0));
                let view = view.or_else(|| of_kind(document, &VIEWS));
                staging.look_through(view, scene.as_ref(), None);
            }
            other => {
                let message = format!("\"{}\" gives {}, which is no picture", look.at.0, other.name());
                return Err(Error::usage(message, seen_through(other)));
            }
        }
        if let Some(eye) = &look.eye {
            staging.place(eye, look.clay);
        }
        if look.clay
            && let Some(samples) = &staging.samples
        {
            staging.picture = (samples.clone(), 0);
        }
        if let Some(samples) = &staging.samples {
            let from = staging.document.nodes[samples].inputs.get("scene");
            staging.scene = from.and_then(|from| output_of(&staging.document, from, registry));
        }
        // A mask needs surfaces to lie on.
        staging.mask = staging.mask.filter(|_| staging.samples.is_some());
        let wanted: Vec<&str> = staging.targets().into_iter().map(|(node, _)| node).collect();
        staging.document = staging.document.upstream(&wanted).refreshed()?;
        Ok(staging)
    }

    /// All that is to be computed.
    pub fn targets(&self) -> Vec<(&str, usize)> {
        let given = [Some(&self.picture), self.other.as_ref(), self.mask.as_ref(), self.scene.as_ref()];
        let given = given.into_iter().chain([self.lamp.as_ref(), self.environment.as_ref()]);
        let given = given.flatten().map(|(node, output)| (node.as_str(), *output));
        given.chain(self.samples.as_deref().map(|samples| (samples, 0))).collect()
    }

    /// Shows surfaces: through the nearest view, of another scene or camera where one is given.
    fn look_through(&mut self, view: Option<String>, scene: Option<&Output>, camera: Option<&Output>) {
        let mut entry = match &view {
            Some(view) => NodeEntry::clone(&self.document.nodes[view]),
            None => node("view_samples", Map::new()),
        };
        for (port, given) in [("scene", scene), ("camera", camera)] {
            if let Some((node, _)) = given {
                entry.inputs.insert(port.to_owned(), node.clone());
            }
        }
        if !entry.inputs.contains_key("scene") {
            let scene = of_kind(&self.document, &["scene"]).unwrap_or_default();
            entry.inputs.insert("scene".to_owned(), scene);
        }
        let name = self.add("view", entry);
        self.picture = (name.clone(), 0);
        self.samples = Some(name);
    }

    /// Puts a free camera in front of the view. What is lit there is computed anew; surfaces alone are a view of their
    /// own, so that the light is not.
    fn place(&mut self, eye: &Eye, clay: bool) {
        let Some(samples) = self.samples.clone() else { return };
        let Eye { position, target, fov_y, size: [width, height] } = *eye;
        let params = json!({ "position": position, "target": target, "fov_y": fov_y });
        let camera = self.add("camera", node("camera", params.as_object().cloned().unwrap_or_default()));
        let mut view = NodeEntry::clone(&self.document.nodes[&samples]);
        if view.kind != "view_samples" {
            // A plate is seen from one place; its scene from any.
            let Some(scene) = view.inputs.get("scene").cloned() else { return };
            view = node("view_samples", Map::new());
            view.inputs.insert("scene".to_owned(), scene);
        }
        view.inputs.insert("camera".to_owned(), camera);
        view.params.insert("width".to_owned(), width.into());
        view.params.insert("height".to_owned(), height.into());
        view.params.insert("samples_per_pixel".to_owned(), 1.into());
        match clay {
            true => self.samples = Some(self.add("eye", view)),
            false => drop(self.document.nodes.insert(samples, Arc::new(view))),
        }
    }

    fn add(&mut self, name: &str, entry: NodeEntry) -> String {
        let name = self.document.free_name(&format!("{OWN}{name}"));
        self.document.nodes.insert(name.clone(), Arc::new(entry));
        name
    }
}

fn node(kind: &str, params: Map<String, serde_json::Value>) -> NodeEntry {
    NodeEntry { kind: kind.to_owned(), params, ..NodeEntry::default() }
}

/// Whether a viewer has added it.
pub fn is_own(document: &Document, node: &str) -> bool {
    node.starts_with(OWN) && !document.nodes.contains_key(node)
}

/// What `"node"` or `"node.port"` leads to.
pub fn output_of(document: &Document, from: &str, registry: &[NodeType]) -> Option<Output> {
    let (name, port) = split(from);
    let kind = &document.nodes.get(name)?.kind;
    let info = registry.iter().find(|node_type| node_type.info.name == kind)?.info;
    let number = match port {
        Some(port) => info.outputs.iter().position(|output| output.name == port)?,
        None => 0,
    };
    (number < info.outputs.len()).then(|| (name.to_owned(), number))
}

/// What a muted node passes on.
fn past_muted(document: &Document, output: &Output, registry: &[NodeType]) -> Output {
    let mut at = output.clone();
    // No way is longer than there are nodes.
    for _ in 0..document.nodes.len() {
        let Some(entry) = document.nodes.get(&at.0).filter(|entry| entry.muted) else { break };
        let Some(node_type) = registry.iter().find(|node_type| node_type.info.name == entry.kind) else { break };
        let Some(wanted) = node_type.info.outputs.get(at.1) else { break };
        let same = node_type.info.inputs.iter().find(|port| port.kind == wanted.kind);
        let from = same.and_then(|port| entry.inputs.get(port.name));
        let Some(before) = from.and_then(|from| output_of(document, from, registry)) else { break };
        at = before;
    }
    at
}

/// The output, or the first of the node that is there, where it needs an input that is not connected.
fn there(document: &Document, (name, output): Output, registry: &[NodeType]) -> Output {
    let outputs = || {
        let entry = document.nodes.get(&name)?;
        let info = registry.iter().find(|node_type| node_type.info.name == entry.kind)?.info;
        let is_there = |at: usize| info.outputs[at].needs.is_none_or(|needed| entry.inputs.contains_key(needed));
        let wanted = Some(output).filter(|at| *at >= info.outputs.len() || is_there(*at));
        wanted.or_else(|| (0..info.outputs.len()).find(|at| is_there(*at)))
    };
    let found = outputs().unwrap_or(output);
    (name, found)
}

fn kind(document: &Document, (name, output): &Output, registry: &[NodeType]) -> Result<Kind> {
    let Some(entry) = document.nodes.get(name) else {
        return Err(Error::usage(format!("there is no node \"{name}\""), "view another node"));
    };
    let Some(node_type) = registry.iter().find(|node_type| node_type.info.name == entry.kind) else {
        let message = format!("\"{name}\" is of a type that this version does not know: \"{}\"", entry.kind);
        return Err(Error::usage(message, "view another node; this one is kept as it is"));
    };
    node_type.info.outputs.get(*output).map(|port| port.kind).ok_or_else(|| {
        let message = format!("\"{name}\" has no output to be shown");
        Error::usage(message, "view the node in front of it")
    })
}

/// What to look at in place of a value that is no picture.
fn seen_through(kind: Kind) -> &'static str {
    match kind {
        Kind::Transfer | Kind::Edits => "view a relight that it is connected to",
        Kind::Visibility | Kind::Transport => "view an integrate that it is connected to",
        Kind::Light => "view an environment_image that it is connected to",
        _ => "view a node that makes a picture of it",
    }
}

/// The node of a type that is fewest wires before `from`, itself included.
pub fn nearest(document: &Document, from: &str, kind: &str) -> Option<String> {
    nearest_of(document, from, &[kind])
}

/// The same for a node of one of several types.
pub fn nearest_of(document: &Document, from: &str, kinds: &[&str]) -> Option<String> {
    let mut seen = vec![from];
    let mut next = 0;
    while let Some(name) = seen.get(next).copied() {
        next += 1;
        let Some(entry) = document.nodes.get(name) else { continue };
        if kinds.contains(&entry.kind.as_str()) {
            return Some(name.to_owned());
        }
        for (before, _) in entry.inputs.values().map(|from| split(from)) {
            if !seen.contains(&before) {
                seen.push(before);
            }
        }
    }
    None
}

fn of_kind(document: &Document, kinds: &[&str]) -> Option<String> {
    document.nodes.iter().find(|(_, entry)| kinds.contains(&entry.kind.as_str())).map(|(name, _)| name.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nodes;
    use std::path::Path;

    fn document() -> Document {
        let text = json!({ "chiaro": 1, "nodes": {
            "room": { "type": "scene", "params": { "file": "builtin:room" } },
            "lamp": { "type": "light", "inputs": { "scene": "room" } },
            "view": { "type": "view_samples", "inputs": { "scene": "room" } },
            "way": { "type": "transfer", "inputs": { "scene": "room", "samples": "view" } },
            "wall": { "type": "pick", "inputs": { "scene": "room" } },
            "edit": { "type": "caster_receiver", "inputs": { "caster": "wall" } },
            "lit": { "type": "relight", "inputs": { "scene": "lamp", "transfer": "way", "edits": "edit" } },
            "sky": { "type": "environment" },
            "odd": { "type": "later" },
        }});
        Document::parse(Path::new("test.json"), &text.to_string()).unwrap()
    }

    fn staged(look: Look) -> Staging {
        Staging::new(&document(), &look, nodes::ALL).unwrap()
    }

    #[test]
    fn pictures_are_seen_as_they_are_and_surfaces_through_a_view() {
        let lit = staged(Look::new("lit", 0));
        assert_eq!((lit.picture.0.as_str(), lit.samples.as_deref()), ("lit", Some("view")));
        assert_eq!(lit.scene, Some(("room".to_owned(), 0)));
        assert!(!lit.document.nodes.contains_key("sky"), "what is not looked at is left out");
        let lamp = staged(Look::new("lamp", 0));
        let view = &lamp.document.nodes[lamp.samples.as_ref().unwrap()];
        assert_eq!((view.kind.as_str(), view.inputs["scene"].as_str()), ("view_samples", "lamp"));
        let wall = staged(Look::new("wall", 0));
        assert_eq!(wall.mask, Some(("wall".to_owned(), 0)));
        assert!(is_own(&document(), wall.samples.as_ref().unwrap()) && !is_own(&document(), "view"));
        assert!(staged(Look::new("sky", 0)).samples.is_none());
        for (node, word) in [("edit", "relight"), ("odd", "another node"), ("gone", "another node")] {
            let error = Staging::new(&document(), &Look::new(node, 0), nodes::ALL).err().unwrap();
            assert!(error.help().contains(word), "{error}: {}", error.help());
        }
    }

    #[test]
    fn plates_are_views_and_what_is_not_there_is_not_shown() {
        let text = json!({ "chiaro": 1, "nodes": {
            "room": { "type": "scene", "params": { "file": "builtin:room" } },
            "plate": { "type": "read_image", "params": { "file": "plate.exr" } },
            "view": { "type": "plate_samples", "inputs": { "image": "plate", "scene": "room" } },
            "way": { "type": "transfer", "inputs": { "scene": "room", "samples": "view" } },
            "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "way" } },
            "wall": { "type": "pick", "inputs": { "scene": "room" } },
            "part": { "type": "matte", "inputs": { "image": "plate" } },
            "whole": { "type": "matte", "inputs": { "image": "plate", "samples": "view" } },
        }});
        let document = Document::parse(Path::new("test.json"), &text.to_string()).unwrap();
        let staged = |look: Look| Staging::new(&document, &look, nodes::ALL).unwrap();
        assert_eq!(staged(Look::new("lit", 0)).samples.as_deref(), Some("view"));
        assert_eq!(staged(Look::new("part", 0)).picture, ("part".to_owned(), 1), "without samples, the matte");
        assert_eq!(staged(Look::new("whole", 0)).mask, Some(("whole".to_owned(), 0)));
        let wall = staged(Look::new("wall", 0));
        assert_eq!(wall.document.nodes[wall.samples.as_ref().unwrap()].kind, "plate_samples");
        let eye = Eye { position: [0.0, 1.0, 5.0], target: [0.0; 3], fov_y: 40.0, size: [64, 48] };
        let free = staged(Look { eye: Some(eye), clay: true, ..Look::new("lit", 0) });
        let view = &free.document.nodes[free.samples.as_ref().unwrap()];
        assert_eq!((view.kind.as_str(), view.inputs["scene"].as_str()), ("view_samples", "room"));
    }

    #[test]
    fn a_free_camera_goes_in_front_of_the_view_or_of_one_of_its_own() {
        let eye = Eye { position: [0.0, 1.0, 5.0], target: [0.0; 3], fov_y: 40.0, size: [64, 48] };
        let clay = staged(Look { eye: Some(eye), clay: true, ..Look::new("lit", 0) });
        assert_eq!(clay.picture.0, *clay.samples.as_ref().unwrap());
        assert!(!clay.document.nodes.contains_key("way"), "no light is computed");
        let lit = staged(Look { eye: Some(eye), ..Look::new("lit", 0) });
        let view = &lit.document.nodes["view"];
        assert_eq!(view.params["width"], 64);
        assert_eq!(lit.document.nodes[&view.inputs["camera"]].kind, "camera");
    }
}
