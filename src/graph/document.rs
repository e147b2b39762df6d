//! A recipe as it is written: names, parameters and wires, in the order of the file, not yet checked against node
//! types (see `plan`).

use super::migrate;
use super::pretty;
use super::problem::Problem;
use super::read::Reader;
use super::source::{Part, Source};
use crate::names::suggest;
use crate::{Error, Result};
use indexmap::IndexMap;
use serde_json::{Map, Value as Json, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// One node as written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NodeEntry {
    /// Name of the node type; empty when the recipe does not say one.
    pub kind: String,
    /// Values or curves.
    pub params: Map<String, Json>,
    /// Port to `"node"` or `"node.port"`.
    pub inputs: IndexMap<String, String>,
    /// Left out: what takes from it takes from its own input of the same kind instead (see `Plan`).
    pub muted: bool,
    /// Fields that this version does not know; written back as they are.
    pub other: Map<String, Json>,
}

/// A frame with words on it, behind the nodes of the editor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comment {
    pub text: String,
    /// Upper left corner, in the units of `layout`.
    pub at: [f64; 2],
    pub size: [f64; 2],
}

#[derive(Clone)]
pub struct Document {
    pub path: PathBuf,
    /// Folder that relative paths start from.
    pub base: PathBuf,
    /// First and last.
    pub frames: [i64; 2],
    pub fps: f64,
    /// Recipes that were made of one another share the nodes that are alike.
    pub nodes: IndexMap<String, Arc<NodeEntry>>,
    /// Where the editor draws each node.
    pub layout: IndexMap<String, [f64; 2]>,
    pub comments: Vec<Comment>,
    /// Fields that this version does not know; written back as they are.
    pub other: Map<String, Json>,
    /// Its text as it was read; `None`: changed since.
    pub(super) source: Option<Arc<Source>>,
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
        let (source, mut root, problems) = Source::parse(text).map_err(fail)?;
        if !root.is_object() {
            let help = "see `chiaro schema` for what a recipe looks like";
            return Err(fail(source.problem("", Part::Value, "a recipe is a JSON object", help)));
        }
        if let Err((message, help)) = migrate::migrate(&mut root) {
            let (pointer, part) =
                if root.get("chiaro").is_some() { ("/chiaro", Part::Value) } else { ("", Part::Value) };
            return Err(fail(source.problem(pointer, part, message, help)));
        }
        let mut reader = Reader { source: &source, problems };
        let root = root.as_object().expect("judged above");
        let other = reader.fields("", root, &["chiaro", "frames", "fps", "nodes", "layout", "comments"], "a recipe");
        let frames = reader.frames(root.get("frames"));
        let fps = reader.fps(root.get("fps"));
        let nodes = reader.nodes(root.get("nodes"));
        let layout = reader.layout(root.get("layout"), &nodes);
        let comments = reader.comments(root.get("comments"));
        let problems = reader.problems;
        let base = match path.parent() {
            Some(folder) if folder != Path::new("") => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        let overrides = IndexMap::new();
        let (path, source) = (path.to_owned(), Some(Arc::new(source)));
        Ok(Self { path, base, frames, fps, nodes, layout, comments, other, source, problems, overrides })
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
        let Some(entry) = self.entry_mut(node) else {
            let help = suggest(node, self.nodes.keys().map(String::as_str));
            return Err(Error::usage(format!("--set {argument}: there is no node \"{node}\""), help));
        };
        entry.params.insert(param.to_owned(), value);
        self.overrides.insert((node.to_owned(), param.to_owned()), argument.to_owned());
        Ok(())
    }

    /// The text that it was read from, or that it would be written as, and where in it everything is.
    pub fn source(&self) -> Arc<Source> {
        self.source.clone().unwrap_or_else(|| {
            let written = Source::parse(&self.to_text());
            Arc::new(written.unwrap_or_else(|problem| unreachable!("it is written as JSON: {}", problem.message)).0)
        })
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
        if !self.comments.is_empty() {
            root["comments"] = self.comments.iter().map(Comment::to_json).collect();
        }
        self.other.iter().for_each(|(name, value)| root[name] = value.clone());
        root
    }

    /// The recipe's text: keys in their own order, whatever fits on a line on one line.
    pub fn to_text(&self) -> String {
        pretty::to_text(&self.to_json())
    }
}

impl NodeEntry {
    /// As it is written.
    pub fn to_json(&self) -> Json {
        let mut node = json!({ "type": self.kind });
        if !self.params.is_empty() {
            node["params"] = self.params.clone().into();
        }
        if !self.inputs.is_empty() {
            let inputs: Map<String, Json> =
                self.inputs.iter().map(|(port, from)| (port.clone(), from.clone().into())).collect();
            node["inputs"] = inputs.into();
        }
        if self.muted {
            node["muted"] = true.into();
        }
        self.other.iter().for_each(|(name, value)| node[name] = value.clone());
        node
    }
}

impl Comment {
    fn to_json(&self) -> Json {
        let pair = |pair: [f64; 2]| pair.map(whole).to_vec();
        json!({ "text": self.text, "at": pair(self.at), "size": pair(self.size) })
    }
}

/// `24` rather than `24.0`.
fn whole(number: f64) -> Json {
    if number.fract() == 0.0 && number.abs() < 1e15 { Json::from(number as i64) } else { Json::from(number) }
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
