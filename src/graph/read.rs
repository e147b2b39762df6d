//! Reads the fields of a recipe, and collects what is wrong with them.

use super::document::{Comment, NodeEntry};
use super::problem::Problem;
use super::source::{Part, Source, child};
use crate::names::suggest;
use indexmap::IndexMap;
use serde_json::{Map, Value as Json};
use std::sync::Arc;

/// Collects problems while it goes through the fields.
pub struct Reader<'a> {
    pub source: &'a Source,
    pub problems: Vec<Problem>,
}

impl<'a> Reader<'a> {
    fn complain(&mut self, pointer: &str, part: Part, message: impl Into<String>, help: impl Into<String>) {
        self.problems.push(self.source.problem(pointer, part, message, help));
    }

    /// Complains of fields that are not known, and returns them.
    pub fn fields(
        &mut self,
        pointer: &str,
        object: &Map<String, Json>,
        known: &[&str],
        what: &str,
    ) -> Map<String, Json> {
        let unknown = object.iter().filter(|(name, _)| !known.contains(&name.as_str()));
        let unknown: Map<String, Json> = unknown.map(|(name, value)| (name.clone(), value.clone())).collect();
        for name in unknown.keys() {
            let help = suggest(name, known.iter().copied());
            self.complain(&child(pointer, name), Part::Key, format!("{what} has no field \"{name}\""), help);
        }
        unknown
    }

    /// The members of an optional object.
    fn object(&mut self, pointer: &str, value: Option<&'a Json>, what: &str) -> Option<&'a Map<String, Json>> {
        let value = value?;
        let object = value.as_object();
        if object.is_none() {
            self.complain(pointer, Part::Value, format!("{what} is an object, not {}", kind_of(value)), "");
        }
        object
    }

    pub fn frames(&mut self, value: Option<&Json>) -> [i64; 2] {
        let Some(value) = value else { return [1, 1] };
        let pair = value.as_array().filter(|list| list.len() == 2);
        match pair.and_then(|list| Some([list[0].as_i64()?, list[1].as_i64()?])) {
            Some([first, last]) if first <= last => [first, last],
            Some([first, last]) => {
                let message = format!("the last frame, {last}, comes before the first, {first}");
                self.complain("/frames", Part::Value, message, format!("write [{last}, {first}]"));
                [1, 1]
            }
            None => {
                let help = "write the first and the last frame, as in [1, 24]";
                self.complain("/frames", Part::Value, format!("{value} is not a range of frames"), help);
                [1, 1]
            }
        }
    }

    pub fn fps(&mut self, value: Option<&Json>) -> f64 {
        let Some(value) = value else { return 24.0 };
        value.as_f64().filter(|fps| *fps > 0.0).unwrap_or_else(|| {
            self.complain("/fps", Part::Value, format!("{value} is not a frame rate"), "frames a second, above 0");
            24.0
        })
    }

    pub fn nodes(&mut self, value: Option<&'a Json>) -> IndexMap<String, Arc<NodeEntry>> {
        if value.is_none() {
            self.complain("", Part::Value, "the recipe has no \"nodes\"", "add \"nodes\": { ... }");
        }
        let mut nodes = IndexMap::new();
        for (name, value) in self.object("/nodes", value, "\"nodes\"").into_iter().flatten() {
            let pointer = child("/nodes", name);
            if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
                let help = "node names are made of A-Z, a-z, 0-9 and _";
                self.complain(&pointer, Part::Key, format!("\"{name}\" cannot be the name of a node"), help);
            }
            let Some(object) = self.object(&pointer, Some(value), "a node") else { continue };
            nodes.insert(name.clone(), Arc::new(self.node(&pointer, name, object)));
        }
        nodes
    }

    fn node(&mut self, pointer: &str, name: &str, object: &'a Map<String, Json>) -> NodeEntry {
        let other = self.fields(pointer, object, &["type", "params", "inputs", "muted"], "a node");
        let mut node = NodeEntry { other, ..NodeEntry::default() };
        match object.get("muted") {
            None => {}
            Some(Json::Bool(muted)) => node.muted = *muted,
            Some(other) => {
                let message = format!("\"muted\" is true or false, not {}", kind_of(other));
                self.complain(&child(pointer, "muted"), Part::Value, message, "");
            }
        }
        match object.get("type") {
            Some(Json::String(kind)) if !kind.is_empty() => node.kind = kind.clone(),
            Some(Json::String(_)) => {
                let help = "`chiaro nodes` lists the types";
                self.complain(
                    &child(pointer, "type"),
                    Part::Value,
                    format!("the type of node \"{name}\" is empty"),
                    help,
                );
            }
            Some(other) => {
                let message = format!("a type is a name in quotes, not {}", kind_of(other));
                self.complain(&child(pointer, "type"), Part::Value, message, "");
            }
            None => {
                let message = format!("node \"{name}\" does not say its type");
                self.complain(pointer, Part::Key, message, "add \"type\": \"...\"; `chiaro nodes` lists the types");
            }
        }
        let params = self.object(&child(pointer, "params"), object.get("params"), "\"params\"");
        node.params = params.cloned().unwrap_or_default();
        let inputs_pointer = child(pointer, "inputs");
        for (port, from) in self.object(&inputs_pointer, object.get("inputs"), "\"inputs\"").into_iter().flatten() {
            match from {
                Json::String(from) => drop(node.inputs.insert(port.clone(), from.clone())),
                other => {
                    let message = format!("an input is the name of a node in quotes, not {}", kind_of(other));
                    self.complain(&child(&inputs_pointer, port), Part::Value, message, "\"node\" or \"node.port\"");
                }
            }
        }
        node
    }

    pub fn layout(
        &mut self,
        value: Option<&'a Json>,
        nodes: &IndexMap<String, Arc<NodeEntry>>,
    ) -> IndexMap<String, [f64; 2]> {
        let mut layout = IndexMap::new();
        for (name, value) in self.object("/layout", value, "\"layout\"").into_iter().flatten() {
            let pointer = child("/layout", name);
            if !nodes.contains_key(name) {
                let help = suggest(name, nodes.keys().map(String::as_str));
                self.complain(&pointer, Part::Key, format!("there is no node \"{name}\" to lay out"), help);
            }
            let pair = value.as_array().filter(|list| list.len() == 2);
            match pair.and_then(|list| Some([list[0].as_f64()?, list[1].as_f64()?])) {
                Some(at) => drop(layout.insert(name.clone(), at)),
                None => self.complain(&pointer, Part::Value, format!("{value} is not a position"), "write [x, y]"),
            }
        }
        layout
    }

    pub fn comments(&mut self, value: Option<&'a Json>) -> Vec<Comment> {
        let Some(value) = value else { return Vec::new() };
        let Some(list) = value.as_array() else {
            let message = format!("\"comments\" is a list, not {}", kind_of(value));
            self.complain("/comments", Part::Value, message, "");
            return Vec::new();
        };
        let pair = |value: &Json| {
            let list = value.as_array().filter(|list| list.len() == 2)?;
            Some([list[0].as_f64()?, list[1].as_f64()?])
        };
        let comment = |value: &Json| {
            let text = value["text"].as_str()?.to_owned();
            Some(Comment { text, at: pair(&value["at"])?, size: pair(&value["size"])? })
        };
        let mut comments = Vec::new();
        for (index, value) in list.iter().enumerate() {
            match comment(value) {
                Some(comment) => comments.push(comment),
                None => {
                    let help = "write { \"text\": \"...\", \"at\": [x, y], \"size\": [w, h] }";
                    self.complain(&format!("/comments/{index}"), Part::Value, "this is not a comment", help);
                }
            }
        }
        comments
    }
}

fn kind_of(value: &Json) -> &'static str {
    match value {
        Json::Null => "null",
        Json::Bool(_) => "true or false",
        Json::Number(_) => "a number",
        Json::String(_) => "a text",
        Json::Array(_) => "a list",
        Json::Object(_) => "an object",
    }
}
