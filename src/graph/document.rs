//! A recipe as it is written: names, parameters and wires, in the order of the file, not yet checked against node
//! types (see `plan`).

use super::migrate;
use super::pretty;
use super::problem::Problem;
use super::source::{Part, Source, child};
use crate::names::suggest;
use crate::{Error, Result};
use indexmap::IndexMap;
use serde_json::{Map, Value as Json, json};
use std::path::{Path, PathBuf};

/// One node as written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeEntry {
    /// Name of the node type; empty when the recipe does not say one.
    pub kind: String,
    /// Values or curves.
    pub params: Map<String, Json>,
    /// Port to `"node"` or `"node.port"`.
    pub inputs: IndexMap<String, String>,
}

pub struct Document {
    pub path: PathBuf,
    /// Folder that relative paths start from.
    pub base: PathBuf,
    /// First and last.
    pub frames: [i64; 2],
    pub fps: f64,
    pub nodes: IndexMap<String, NodeEntry>,
    /// Where the editor draws each node.
    pub layout: IndexMap<String, [f64; 2]>,
    pub source: Source,
    /// What was found wrong while reading; `Plan::new` reports it together with what it finds itself.
    pub problems: Vec<Problem>,
    /// Parameters given on the command line: (node, parameter) to the argument's text.
    pub overrides: IndexMap<(String, String), String>,
}

/// Reads a recipe.
///
/// # Errors
/// `File` when it cannot be read, `Graph` when it is not a recipe at all. Other problems are kept in the document.
pub fn load(path: &Path) -> Result<Document> {
    let bytes = std::fs::read(path)
        .map_err(|error| Error::file(path, error.to_string(), "give the path of a recipe, a .json file"))?;
    let text = String::from_utf8(bytes)
        .map_err(|_| Error::file(path, "this is not UTF-8 text", "give the path of a recipe, a .json file"))?;
    Document::parse(path, &text)
}

impl Document {
    /// Reads a recipe from its text; `path` is what messages call it, and its folder is where relative paths start.
    ///
    /// # Errors
    /// `Graph` when the text is not JSON, or not a recipe of a known version.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let fail =
            |problem| Error::Graph { path: path.to_owned(), source_text: text.to_owned(), problems: vec![problem] };
        let (mut source, problems) = Source::parse(text).map_err(fail)?;
        if !source.root.is_object() {
            let help = "see `chiaro schema` for what a recipe looks like";
            return Err(fail(source.problem("", Part::Value, "a recipe is a JSON object", help)));
        }
        if let Err((message, help)) = migrate::migrate(&mut source.root) {
            let (pointer, part) =
                if source.root.get("chiaro").is_some() { ("/chiaro", Part::Value) } else { ("", Part::Value) };
            return Err(fail(source.problem(pointer, part, message, help)));
        }
        let mut reader = Reader { source: &source, problems };
        let root = source.root.as_object().expect("judged above");
        reader.fields("", root, &["chiaro", "frames", "fps", "nodes", "layout"], "a recipe");
        let frames = reader.frames(root.get("frames"));
        let fps = reader.fps(root.get("fps"));
        let nodes = reader.nodes(root.get("nodes"));
        let layout = reader.layout(root.get("layout"), &nodes);
        let problems = reader.problems;
        let base = match path.parent() {
            Some(folder) if folder != Path::new("") => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        let overrides = IndexMap::new();
        Ok(Self { path: path.to_owned(), base, frames, fps, nodes, layout, source, problems, overrides })
    }

    /// Applies one `NODE.PARAM=JSON` of the command line.
    ///
    /// # Errors
    /// `Usage` when it is not of that form or names no node. Whether the parameter exists and takes the value is
    /// checked by `Plan::new`.
    pub fn set(&mut self, argument: &str) -> Result<()> {
        let form = "write --set NODE.PARAM=JSON, as in --set bleed.brightness=2.5 or --set 'out.file=\"x.exr\"'";
        let split = argument.split_once('=').and_then(|(left, json)| Some((left.split_once('.')?, json)));
        let Some(((node, param), json)) = split else {
            return Err(Error::usage(format!("--set {argument}: this is not NODE.PARAM=JSON"), form));
        };
        let value: Json = serde_json::from_str(json).map_err(|_| {
            let help = format!("{form}; text needs its own quotes: '{node}.{param}=\"{json}\"'");
            Error::usage(format!("--set {argument}: {json} is not JSON"), help)
        })?;
        let Some(entry) = self.nodes.get_mut(node) else {
            let help = suggest(node, self.nodes.keys().map(String::as_str));
            return Err(Error::usage(format!("--set {argument}: there is no node \"{node}\""), help));
        };
        entry.params.insert(param.to_owned(), value);
        self.overrides.insert((node.to_owned(), param.to_owned()), argument.to_owned());
        Ok(())
    }

    pub fn to_json(&self) -> Json {
        let nodes: Map<String, Json> = self.nodes.iter().map(|(name, node)| (name.clone(), node.to_json())).collect();
        let mut root = json!({
            "chiaro": migrate::VERSION, "frames": self.frames, "fps": whole(self.fps), "nodes": nodes,
        });
        if !self.layout.is_empty() {
            let layout: Map<String, Json> =
                self.layout.iter().map(|(name, at)| (name.clone(), at.map(whole).to_vec().into())).collect();
            root["layout"] = layout.into();
        }
        root
    }

    /// The recipe's text: keys in their own order, whatever fits on a line on one line.
    pub fn to_text(&self) -> String {
        pretty::to_text(&self.to_json())
    }
}

impl NodeEntry {
    fn to_json(&self) -> Json {
        let mut node = json!({ "type": self.kind });
        if !self.params.is_empty() {
            node["params"] = self.params.clone().into();
        }
        if !self.inputs.is_empty() {
            let inputs: Map<String, Json> =
                self.inputs.iter().map(|(port, from)| (port.clone(), from.clone().into())).collect();
            node["inputs"] = inputs.into();
        }
        node
    }
}

/// `24` rather than `24.0`.
fn whole(number: f64) -> Json {
    if number.fract() == 0.0 && number.abs() < 1e15 { Json::from(number as i64) } else { Json::from(number) }
}

/// Collects problems while it goes through the fields.
struct Reader<'a> {
    source: &'a Source,
    problems: Vec<Problem>,
}

impl<'a> Reader<'a> {
    fn complain(&mut self, pointer: &str, part: Part, message: impl Into<String>, help: impl Into<String>) {
        self.problems.push(self.source.problem(pointer, part, message, help));
    }

    fn fields(&mut self, pointer: &str, object: &Map<String, Json>, known: &[&str], what: &str) {
        for name in object.keys().filter(|name| !known.contains(&name.as_str())) {
            let help = suggest(name, known.iter().copied());
            self.complain(&child(pointer, name), Part::Key, format!("{what} has no field \"{name}\""), help);
        }
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

    fn frames(&mut self, value: Option<&Json>) -> [i64; 2] {
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

    fn fps(&mut self, value: Option<&Json>) -> f64 {
        let Some(value) = value else { return 24.0 };
        value.as_f64().filter(|fps| *fps > 0.0).unwrap_or_else(|| {
            self.complain("/fps", Part::Value, format!("{value} is not a frame rate"), "frames a second, above 0");
            24.0
        })
    }

    fn nodes(&mut self, value: Option<&'a Json>) -> IndexMap<String, NodeEntry> {
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
            nodes.insert(name.clone(), self.node(&pointer, name, object));
        }
        nodes
    }

    fn node(&mut self, pointer: &str, name: &str, object: &'a Map<String, Json>) -> NodeEntry {
        self.fields(pointer, object, &["type", "params", "inputs"], "a node");
        let mut node = NodeEntry::default();
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

    fn layout(&mut self, value: Option<&'a Json>, nodes: &IndexMap<String, NodeEntry>) -> IndexMap<String, [f64; 2]> {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Document {
        Document::parse(Path::new("x/test.json"), text).unwrap()
    }

    #[test]
    fn written_back_in_the_same_order() {
        let text = r#"{
  "chiaro": 1,
  "frames": [1, 24],
  "fps": 24,
  "nodes": {
    "z": { "type": "scene", "params": { "file": "s.glb", "scale": 0.5 } },
    "a": { "type": "relight", "inputs": { "scene": "z", "edits": "q.edits" } }
  },
  "layout": { "z": [0, 0], "a": [220.5, 0] }
}
"#;
        let document = parse(text);
        assert!(document.problems.is_empty(), "{:?}", document.problems);
        assert_eq!(document.base, Path::new("x"));
        let written = document.to_text();
        assert_eq!(parse(&written).to_json(), document.to_json());
        let order = |text: &str| ["\"z\": {", "\"a\": {", "\"layout\""].map(|word| text.find(word).unwrap());
        assert!(order(&written).is_sorted(), "{written}");
        assert_eq!(parse(&written).to_text(), written);
    }

    #[test]
    fn all_problems_of_the_form_at_once() {
        let document = parse(
            r#"{"chiaro": 1, "frame": [1, 2], "fps": 0, "frames": [3, 1], "nodes": {
                "a b": {"type": "x"}, "c": {"typ": "x", "inputs": {"i": 3}}, "d": [], "e": {"type": 1, "params": 2}
            }, "layout": {"f": [1], "c": [0, 1, 2]}}"#,
        );
        let found: Vec<&str> = document.problems.iter().map(|problem| problem.message.as_str()).collect();
        for expected in [
            "a recipe has no field \"frame\"",
            "0 is not a frame rate",
            "the last frame, 1, comes before the first, 3",
            "\"a b\" cannot be the name of a node",
            "a node has no field \"typ\"",
            "node \"c\" does not say its type",
            "an input is the name of a node in quotes, not a number",
            "a node is an object, not a list",
            "a type is a name in quotes, not a number",
            "\"params\" is an object, not a number",
            "there is no node \"f\" to lay out",
            "[1] is not a position",
            "[0,1,2] is not a position",
        ] {
            assert!(found.contains(&expected), "{expected} is not in {found:#?}");
        }
        assert_eq!(found.len(), 13);
        assert!(document.problems.iter().all(|problem| problem.place.is_some()));
    }

    #[test]
    fn overrides_are_read_or_refused() {
        let mut document = parse(r#"{"chiaro": 1, "nodes": {"bleed": {"type": "x"}}}"#);
        document.set("bleed.brightness=2.5").unwrap();
        document.set("bleed.name=\"a.b=c\"").unwrap();
        assert_eq!(document.nodes["bleed"].params["brightness"], json!(2.5));
        assert_eq!(document.nodes["bleed"].params["name"], json!("a.b=c"));
        for (wrong, word) in [("bleed", "not NODE"), ("bled.x=1", "no node"), ("bleed.x=abc", "not JSON")] {
            let error = document.set(wrong).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(word) && !error.help().is_empty(), "{error}");
        }
    }
}
