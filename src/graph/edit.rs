//! Changes of a recipe, as the editor makes them: each leaves a document that is as sound as it was before.

use super::document::{Document, NodeEntry};
use crate::names::suggest;
use crate::{Error, Result};
use indexmap::IndexMap;
use serde_json::{Map, Value as Json, json};
use std::path::Path;
use std::sync::Arc;

/// `"node"` or `"node.port"`, apart.
pub fn split(from: &str) -> (&str, Option<&str>) {
    from.split_once('.').map_or((from, None), |(node, port)| (node, Some(port)))
}

impl Document {
    /// An empty recipe.
    pub fn empty() -> Self {
        Self::empty_at(Path::new("untitled.json"))
    }

    /// An empty recipe for a file.
    pub fn empty_at(file: &Path) -> Self {
        Self::parse(file, r#"{ "chiaro": 1, "nodes": {} }"#)
            .unwrap_or_else(|error| unreachable!("an empty recipe is one: {error}"))
    }

    /// After changes: problems are found where they are now, in the text that it would be written as.
    ///
    /// # Errors
    /// `Graph` as `parse`; not for a document that was parsed before.
    pub fn refreshed(mut self) -> Result<Self> {
        self.source = None;
        // Changes make no problem of form, but may have taken one away.
        if !self.problems.is_empty() {
            let written = Self::parse(&self.path, &self.to_text())?;
            self = Self { overrides: self.overrides, ..written };
        }
        Ok(self)
    }

    /// Whether another recipe is written alike.
    pub fn is_same(&self, other: &Self) -> bool {
        (&self.layout, &self.comments, &self.other) == (&other.layout, &other.comments, &other.other)
            && self.computes_same(other)
    }

    /// Whether another recipe makes the same pictures: where nodes lie, and what is said of them, aside.
    pub fn computes_same(&self, other: &Self) -> bool {
        (&self.nodes, &self.overrides, &self.base) == (&other.nodes, &other.overrides, &other.base)
            && (self.frames, self.fps) == (other.frames, other.fps)
    }

    /// A name that no node has: this one, or with a number behind it.
    pub fn free_name(&self, wanted: &str) -> String {
        let stem = wanted.trim_end_matches(|c: char| c.is_ascii_digit());
        let stem = if stem.is_empty() { wanted } else { stem };
        let numbered = (2..).map(|number| format!("{stem}{number}"));
        std::iter::once(wanted.to_owned())
            .chain(numbered)
            .find(|name| !self.nodes.contains_key(name))
            .expect("numbers do not end")
    }

    /// To be changed; other recipes that share the node keep theirs.
    pub fn entry_mut(&mut self, node: &str) -> Option<&mut NodeEntry> {
        self.nodes.get_mut(node).map(Arc::make_mut)
    }

    /// Adds a node of a type, named after it, and returns its name.
    pub fn add_node(&mut self, kind: &str, at: [f64; 2]) -> String {
        let name = self.free_name(kind);
        let entry = NodeEntry { kind: kind.to_owned(), ..NodeEntry::default() };
        self.nodes.insert(name.clone(), Arc::new(entry));
        self.layout.insert(name.clone(), at);
        name
    }

    /// Takes nodes out, and the wires at them.
    pub fn remove_nodes(&mut self, names: &[String]) {
        self.nodes.retain(|name, _| !names.contains(name));
        self.layout.retain(|name, _| !names.contains(name));
        self.overrides.retain(|(name, _), _| !names.contains(name));
        let gone = |from: &str| names.iter().any(|name| name == split(from).0);
        for entry in self.nodes.values_mut().filter(|entry| entry.inputs.values().any(|from| gone(from))) {
            Arc::make_mut(entry).inputs.retain(|_, from| !gone(from));
        }
    }

    /// Gives a node another name, wherever it is named.
    ///
    /// # Errors
    /// `Usage` when there is no such node, the name cannot be one, or another node has it.
    pub fn rename(&mut self, old: &str, new: &str) -> Result<()> {
        if old == new {
            return Ok(());
        }
        let Some(at) = self.nodes.get_index_of(old) else { return Err(self.no_node(old)) };
        if new.is_empty() || !new.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            let help = "node names are made of A-Z, a-z, 0-9 and _";
            return Err(Error::usage(format!("\"{new}\" cannot be the name of a node"), help));
        }
        if self.nodes.contains_key(new) {
            return Err(Error::usage(format!("there is another node \"{new}\""), "choose another name"));
        }
        let (_, entry) = self.nodes.swap_remove_index(at).expect("it was found there");
        let (last, _) = self.nodes.insert_full(new.to_owned(), entry);
        // Back to where it was, with the one that was swapped into its place.
        self.nodes.swap_indices(at, last);
        self.layout = std::mem::take(&mut self.layout)
            .into_iter()
            .map(|(name, at)| (if name == old { new.to_owned() } else { name }, at))
            .collect();
        let is_old = |entry: &&mut Arc<NodeEntry>| entry.inputs.values().any(|from| split(from).0 == old);
        let takers = self.nodes.values_mut().filter(is_old);
        for from in takers.flat_map(|entry| Arc::make_mut(entry).inputs.values_mut()) {
            match split(from) {
                (node, None) if node == old => *from = new.to_owned(),
                (node, Some(port)) if node == old => *from = format!("{new}.{port}"),
                _ => {}
            }
        }
        Ok(())
    }

    /// Whether `node` takes from `source`, directly or not; every node does from itself.
    pub fn depends(&self, node: &str, source: &str) -> bool {
        let mut seen = vec![node];
        let mut next = 0;
        while let Some(name) = seen.get(next).copied() {
            next += 1;
            for from in self.nodes.get(name).into_iter().flat_map(|entry| entry.inputs.values()) {
                let (from, _) = split(from);
                if !seen.contains(&from) {
                    seen.push(from);
                }
            }
        }
        seen.contains(&source)
    }

    /// Leads `from` (`"node"` or `"node.port"`) to an input, in place of what was connected to it.
    ///
    /// # Errors
    /// `Usage` when a node does not exist, or would feed itself.
    pub fn connect(&mut self, from: &str, node: &str, port: &str) -> Result<()> {
        let (source, _) = split(from);
        for name in [source, node] {
            if !self.nodes.contains_key(name) {
                return Err(self.no_node(name));
            }
        }
        if self.depends(source, node) {
            let help = "take one of the wires between them out first";
            return Err(Error::usage(format!("\"{node}\" would feed itself through \"{source}\""), help));
        }
        if let Some(entry) = self.entry_mut(node) {
            entry.inputs.insert(port.to_owned(), from.to_owned());
        }
        Ok(())
    }

    pub fn disconnect(&mut self, node: &str, port: &str) {
        if let Some(entry) = self.entry_mut(node) {
            entry.inputs.shift_remove(port);
        }
    }

    /// Sets a parameter; `None`: to its default.
    pub fn set_param(&mut self, node: &str, param: &str, value: Option<Json>) {
        self.overrides.shift_remove(&(node.to_owned(), param.to_owned()));
        let Some(entry) = self.entry_mut(node) else { return };
        match value {
            Some(value) => drop(entry.params.insert(param.to_owned(), value)),
            None => drop(entry.params.shift_remove(param)),
        }
    }

    /// A part of the recipe as text: nodes, the wires between and into them, and where they lie.
    pub fn copy(&self, names: &[String]) -> String {
        let chosen = |name: &String| names.contains(name);
        let nodes: Map<String, Json> = self
            .nodes
            .iter()
            .filter(|(name, _)| chosen(name))
            .map(|(name, entry)| (name.clone(), entry.to_json()))
            .collect();
        let layout: Map<String, Json> =
            self.layout.iter().filter(|(name, _)| chosen(name)).map(|(name, at)| (name.clone(), json!(at))).collect();
        json!({ "chiaro": 1, "nodes": nodes, "layout": layout }).to_string()
    }

    /// Adds what was copied, moved, under names that are free; wires between the copies stay between them, others lead
    /// to where they came from, if that is here. Returns the new names.
    ///
    /// # Errors
    /// `Graph` when the text is no recipe.
    pub fn paste(&mut self, text: &str, by: [f64; 2]) -> Result<Vec<String>> {
        let part = Self::parse(&self.path, text)?;
        // Where they are is found when it is refreshed.
        self.problems.extend(part.problems);
        let mut names: IndexMap<String, String> = IndexMap::new();
        for (old, entry) in &part.nodes {
            let new = self.free_name(old);
            self.nodes.insert(new.clone(), entry.clone());
            let at = part.layout.get(old).copied().unwrap_or_default();
            self.layout.insert(new.clone(), [at[0] + by[0], at[1] + by[1]]);
            names.insert(old.clone(), new);
        }
        let known: Vec<String> = self.nodes.keys().cloned().collect();
        for new in names.values() {
            let entry = Arc::make_mut(&mut self.nodes[new]);
            for from in entry.inputs.values_mut() {
                let (node, port) = split(from);
                if let Some(copy) = names.get(node) {
                    *from = port.map_or_else(|| copy.clone(), |port| format!("{copy}.{port}"));
                }
            }
            entry.inputs.retain(|_, from| known.iter().any(|name| name == split(from).0));
        }
        Ok(names.into_values().collect())
    }

    /// Some nodes and all that they take from, as a recipe of its own; what is wrong elsewhere is not in it.
    pub fn upstream(&self, nodes: &[&str]) -> Self {
        let wanted = |name: &str| nodes.iter().any(|node| self.depends(node, name));
        let keep: Vec<String> = self.nodes.keys().filter(|name| wanted(name)).cloned().collect();
        let mut part = self.clone();
        part.nodes.retain(|name, _| keep.contains(name));
        part.layout.retain(|name, _| keep.contains(name));
        let inside = |pointer: &str| match pointer.strip_prefix("/nodes/").or_else(|| pointer.strip_prefix("/layout/"))
        {
            Some(rest) => keep.iter().any(|name| rest.split('/').next() == Some(name)),
            None => true,
        };
        part.problems.retain(|problem| inside(&problem.pointer));
        part
    }

    fn no_node(&self, name: &str) -> Error {
        Error::usage(format!("there is no node \"{name}\""), suggest(name, self.nodes.keys().map(String::as_str)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Document {
        Document::parse(Path::new("x/test.json"), text).unwrap()
    }

    fn chain() -> Document {
        parse(
            r#"{ "chiaro": 1, "nodes": {
                "a": { "type": "scene" },
                "b": { "type": "pick", "inputs": { "scene": "a" } },
                "c": { "type": "edit", "params": { "x": 1 }, "inputs": { "caster": "b.selection", "other": "a" } },
                "d": { "type": "later", "inputs": { "edits": "c" }, "new_field": [1, 2] }
            }, "layout": { "b": [10, 20], "c": [30, 20] } }"#,
        )
    }

    #[test]
    fn names_are_free_and_counted_on() {
        let mut document = chain();
        assert_eq!(document.add_node("pick", [0.0; 2]), "pick");
        assert_eq!(document.add_node("pick", [0.0; 2]), "pick2");
        assert_eq!(document.add_node("pick", [0.0; 2]), "pick3");
        assert_eq!(document.free_name("pick2"), "pick4");
        assert_eq!(document.free_name("7"), "7");
    }

    #[test]
    fn a_name_changes_wherever_it_is_named_and_the_order_stays() {
        let mut document = chain();
        document.rename("b", "wall").unwrap();
        assert_eq!(document.nodes.keys().collect::<Vec<_>>(), ["a", "wall", "c", "d"]);
        assert_eq!(document.nodes["c"].inputs["caster"], "wall.selection");
        assert_eq!(document.layout["wall"], [10.0, 20.0]);
        for (old, new) in [("zz", "y"), ("a", "c"), ("a", "a b"), ("a", "")] {
            let error = document.rename(old, new).unwrap_err();
            assert!(!error.help().is_empty(), "{error}");
        }
        document.rename("a", "a").unwrap();
    }

    #[test]
    fn wires_come_and_go_and_never_close_a_loop() {
        let mut document = chain();
        assert!(document.depends("d", "a") && !document.depends("a", "d") && document.depends("a", "a"));
        assert!(document.connect("d", "a", "lights").unwrap_err().to_string().contains("feed itself"));
        assert!(document.connect("a", "a", "lights").is_err() && document.connect("zz", "a", "lights").is_err());
        document.connect("a", "d", "scene").unwrap();
        document.disconnect("d", "edits");
        assert_eq!(document.nodes["d"].inputs.keys().collect::<Vec<_>>(), ["scene"]);
        document.remove_nodes(&["a".to_owned()]);
        assert!(document.nodes["d"].inputs.is_empty() && document.nodes["c"].inputs.len() == 1);
    }

    #[test]
    fn copies_keep_wires_between_them_and_lead_to_what_is_here() {
        let mut document = chain();
        let text = document.copy(&["b".to_owned(), "c".to_owned()]);
        let names = document.paste(&text, [5.0, 0.0]).unwrap();
        assert_eq!(names, ["b2", "c2"]);
        assert_eq!(document.nodes["c2"].inputs["caster"], "b2.selection");
        assert_eq!(document.nodes["c2"].inputs["other"], "a");
        assert_eq!(document.layout["c2"], [35.0, 20.0]);
        let mut elsewhere = Document::empty();
        elsewhere.paste(&text, [0.0; 2]).unwrap();
        assert_eq!(elsewhere.nodes["c"].inputs.keys().collect::<Vec<_>>(), ["caster"]);
        assert!(document.paste("nonsense", [0.0; 2]).is_err());
    }

    #[test]
    fn what_is_not_known_is_written_back() {
        let document = chain();
        assert_eq!(document.problems.len(), 1, "an unknown field is told");
        let again = document.clone().refreshed().unwrap();
        assert_eq!(again.nodes, document.nodes);
        assert_eq!(again.nodes["d"].other["new_field"], json!([1, 2]));
        assert_eq!(again.to_text(), document.to_text());
        let part = document.upstream(&["c"]);
        assert_eq!(part.nodes.keys().collect::<Vec<_>>(), ["a", "b", "c"]);
        assert!(part.problems.is_empty(), "the problem was in d");
    }

    #[test]
    fn parameters_are_set_and_reset() {
        let mut document = chain();
        document.set_param("c", "x", Some(json!(2.5)));
        assert_eq!(document.nodes["c"].params["x"], json!(2.5));
        document.set_param("c", "x", None);
        document.set_param("zz", "x", None);
        assert!(document.nodes["c"].params.is_empty());
    }
}
