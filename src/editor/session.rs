//! An open recipe: what it is now, what it was, what is wrong with it, and whether it is saved.

use super::history::History;
use super::paths::rebase;
use crate::graph::{self, Checks, Document, Plan, Problem};
use crate::node::Info;
use crate::params::NodeType;
use crate::{Error, Result, atomic};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub struct Session {
    document: Arc<Document>,
    history: History,
    registry: &'static [NodeType],
    /// Where it is saved; `None`: nowhere yet.
    file: Option<PathBuf>,
    /// The recipe as it was last read or written; `None`: never, or not as it is in the file.
    saved: Option<Arc<Document>>,
    /// The text that its file had then.
    on_disk: Option<String>,
    problems: BTreeMap<String, Vec<Problem>>,
    checks: Checks,
    /// Grows with every change.
    version: u64,
    /// Grows with every change that a picture could show: not where nodes lie.
    content: u64,
}

/// What the file of a session has become.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnDisk {
    Same,
    Changed,
    Gone,
}

/// Problems that belong to no node.
const WHOLE: &str = "";

impl Session {
    pub fn new(registry: &'static [NodeType]) -> Self {
        Self::new_of(Document::empty(), registry)
    }

    /// A recipe to start from that is nowhere saved; as it is, it is no loss.
    pub fn new_of(document: Document, registry: &'static [NodeType]) -> Self {
        let document = Arc::new(document);
        Self::with(document.clone(), None, Some(document), None, registry)
    }

    /// # Errors
    /// `File` when it cannot be read, `Graph` when it is no recipe; problems of its nodes are no error.
    pub fn open(path: &Path, registry: &'static [NodeType]) -> Result<Self> {
        let document = graph::load(path)?;
        let (text, document) = (document.source().text.clone(), Arc::new(document));
        Ok(Self::with(document.clone(), Some(path.to_owned()), Some(document), Some(text), registry))
    }

    /// A recipe that is nowhere saved, such as one that was recovered; `file` is where it would be.
    pub fn recovered(document: Document, file: Option<PathBuf>, registry: &'static [NodeType]) -> Self {
        let text = file.as_ref().and_then(|file| std::fs::read_to_string(file).ok());
        Self::with(Arc::new(document), file, None, text, registry)
    }

    fn with(
        document: Arc<Document>,
        file: Option<PathBuf>,
        saved: Option<Arc<Document>>,
        on_disk: Option<String>,
        registry: &'static [NodeType],
    ) -> Self {
        let (history, problems, checks) = (History::default(), BTreeMap::new(), Checks::default());
        let mut session =
            Self { document, history, registry, file, saved, on_disk, problems, checks, version: 0, content: 0 };
        session.check();
        session
    }

    pub fn document(&self) -> &Arc<Document> {
        &self.document
    }

    pub fn registry(&self) -> &'static [NodeType] {
        self.registry
    }

    pub fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }

    pub fn version(&self) -> u64 {
        self.version
    }

    /// Grows with every change that a picture could show.
    pub fn content(&self) -> u64 {
        self.content
    }

    pub fn history(&self) -> &History {
        &self.history
    }

    /// What the type of a node says of itself; `None` for a node of an unknown type, or none of that name.
    pub fn info(&self, node: &str) -> Option<&'static Info> {
        let entry = self.document.nodes.get(node)?;
        self.node_type(&entry.kind).map(|node_type| node_type.info)
    }

    pub fn node_type(&self, kind: &str) -> Option<&'static NodeType> {
        self.registry.iter().find(|node_type| node_type.info.name == kind)
    }

    /// What is wrong with a node.
    pub fn problems_of(&self, node: &str) -> &[Problem] {
        self.problems.get(node).map_or(&[], Vec::as_slice)
    }

    /// What is wrong with the recipe itself.
    pub fn problems_of_whole(&self) -> &[Problem] {
        self.problems_of(WHOLE)
    }

    pub fn problems(&self) -> impl Iterator<Item = &Problem> {
        self.problems.values().flatten()
    }

    pub fn problem_count(&self) -> usize {
        self.problems.values().map(Vec::len).sum()
    }

    /// Changes the recipe. Changes in a row with the same `mark` are undone as one.
    ///
    /// # Errors
    /// What `change` meets; nothing is changed then.
    pub fn change<T>(
        &mut self,
        label: &str,
        mark: Option<&str>,
        change: impl FnOnce(&mut Document) -> Result<T>,
    ) -> Result<T> {
        let mut document = (*self.document).clone();
        let value = change(&mut document)?;
        if document.is_same(&self.document) {
            return Ok(value);
        }
        let document = document.refreshed()?;
        self.history.record(label, mark, &self.document);
        self.replace(Arc::new(document));
        Ok(value)
    }

    /// A drag has ended.
    pub fn end_drag(&mut self) {
        self.history.close();
    }

    pub fn undo(&mut self) -> bool {
        let found = self.history.undo(&self.document);
        self.step(found)
    }

    pub fn redo(&mut self) -> bool {
        let found = self.history.redo(&self.document);
        self.step(found)
    }

    fn step(&mut self, found: Option<Arc<Document>>) -> bool {
        let stepped = found.is_some();
        if let Some(document) = found {
            self.replace(document);
        }
        stepped
    }

    fn replace(&mut self, document: Arc<Document>) {
        let before = std::mem::replace(&mut self.document, document);
        self.version += 1;
        let now = &self.document;
        if !before.computes_same(now) {
            self.content += 1;
            self.check();
        }
    }

    /// Sorts what is wrong by node.
    fn check(&mut self) {
        let problems = match Plan::again(&self.document, self.registry, &mut self.checks) {
            Err(Error::Graph { problems, .. }) => problems,
            Err(error) => {
                vec![Problem { message: error.to_string(), help: error.help().to_owned(), ..Problem::default() }]
            }
            Ok(_) => Vec::new(),
        };
        self.problems.clear();
        for problem in problems {
            let node = problem.pointer.strip_prefix("/nodes/").and_then(|rest| rest.split('/').next());
            let node = node.filter(|name| self.document.nodes.contains_key(*name)).unwrap_or(WHOLE).to_owned();
            self.problems.entry(node).or_default().push(problem);
        }
    }

    /// There is something that a closed window would lose.
    pub fn is_unsaved(&self) -> bool {
        self.saved.as_ref().is_none_or(|saved| !saved.is_same(&self.document))
    }

    /// Writes the recipe where it was read from.
    ///
    /// # Errors
    /// `Usage` when it has no file, `Output` when it cannot be written; the old file is then as it was.
    pub fn save(&mut self) -> Result<()> {
        match self.file.clone() {
            Some(file) => self.save_as(&file),
            None => Err(Error::usage("this recipe has no file yet", "save it under a name")),
        }
    }

    /// Writes the recipe to a file, which is its own from now on. Paths of files that it reads are written anew, from its
    /// folder.
    ///
    /// # Errors
    /// `Output` when it cannot be written; the old file is then as it was.
    pub fn save_as(&mut self, file: &Path) -> Result<()> {
        let is_new = self.file.as_deref() != Some(file);
        let mut document = (*self.document).clone();
        if is_new {
            rebase(&mut document, file.parent().unwrap_or(Path::new("")), self.registry);
        }
        let text = document.to_text();
        atomic::write(file, text.as_bytes())?;
        if is_new {
            self.file = Some(file.to_owned());
            self.replace(Arc::new(Document::parse(file, &text)?));
        }
        self.saved = Some(self.document.clone());
        self.on_disk = Some(text);
        Ok(())
    }

    /// Whether another program has changed the file since it was read or written.
    pub fn on_disk(&self) -> OnDisk {
        let Some(file) = &self.file else { return OnDisk::Same };
        match std::fs::read_to_string(file) {
            Ok(text) if Some(&text) == self.on_disk.as_ref() => OnDisk::Same,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => OnDisk::Gone,
            _ => OnDisk::Changed,
        }
    }

    /// Reads the file again; what was here can be had back by undo.
    ///
    /// # Errors
    /// As `open`; nothing is changed then.
    pub fn reload(&mut self) -> Result<()> {
        let Some(file) = self.file.clone() else { return Ok(()) };
        let document = graph::load(&file)?;
        let document = Arc::new(document);
        (self.saved, self.on_disk) = (Some(document.clone()), Some(document.source().text.clone()));
        self.history.record("reload the file", None, &self.document);
        self.replace(document);
        Ok(())
    }

    /// Keeps what is here, although the file has changed; saving will replace it.
    pub fn keep_mine(&mut self) {
        self.on_disk = self.file.as_ref().and_then(|file| std::fs::read_to_string(file).ok());
        self.saved = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nodes;
    use serde_json::json;

    fn bleed(folder: &Path) -> PathBuf {
        let text = r#"{ "chiaro": 1, "nodes": {
            "room": { "type": "scene", "params": { "file": "builtin:room" } },
            "odd": { "type": "from_the_future", "params": { "a": [1] }, "inputs": { "b": "room" } },
            "edit": { "type": "caster_receiver", "params": { "brightness": 2.0 } }
        } }"#;
        let file = folder.join("bleed.json");
        std::fs::write(&file, text).unwrap();
        file
    }

    #[test]
    fn changes_are_made_undone_and_saved() {
        let folder = tempfile::tempdir().unwrap();
        let file = bleed(folder.path());
        let mut session = Session::open(&file, nodes::ALL).unwrap();
        assert!(!session.is_unsaved() && session.on_disk() == OnDisk::Same);
        for brightness in [2.5, 3.0, 3.5] {
            let set = |document: &mut Document| {
                document.set_param("edit", "brightness", Some(json!(brightness)));
                Ok(())
            };
            session.change("brightness", Some("edit.brightness"), set).unwrap();
        }
        assert!(session.is_unsaved());
        session.save().unwrap();
        assert!(!session.is_unsaved());
        let again = Session::open(&file, nodes::ALL).unwrap();
        assert_eq!(again.document().nodes, session.document().nodes);
        assert_eq!(again.document().nodes["odd"].params["a"], json!([1]), "unknown nodes are saved unharmed");
        assert!(session.undo() && !session.undo());
        assert_eq!(session.document().nodes["edit"].params["brightness"], json!(2.0));
        assert!(session.redo() && !session.is_unsaved());
        let content = session.content();
        let moved = |document: &mut Document| {
            document.layout.insert("edit".to_owned(), [3.0, 4.0]);
            Ok(())
        };
        session.change("move", None, moved).unwrap();
        assert!(session.content() == content && session.is_unsaved(), "no picture shows where a node lies");
    }

    #[test]
    fn problems_are_told_at_their_node() {
        let folder = tempfile::tempdir().unwrap();
        let mut session = Session::open(&bleed(folder.path()), nodes::ALL).unwrap();
        assert!(session.problems_of("odd")[0].message.contains("from_the_future"));
        assert!(session.problems_of("room").is_empty() && session.info("odd").is_none());
        let wrong = |document: &mut Document| {
            document.set_param("edit", "brightness", Some(json!("much")));
            Ok(())
        };
        session.change("brightness", None, wrong).unwrap();
        assert_eq!((session.problems_of("edit").len(), session.problem_count()), (1, 2));
        // A change that fails changes nothing.
        let version = session.version();
        assert!(session.change("rename", None, |document| document.rename("room", "odd")).is_err());
        session.change("nothing", None, |_| Ok(())).unwrap();
        assert_eq!(session.version(), version);
    }

    #[test]
    fn a_file_that_changes_or_goes_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let file = bleed(folder.path());
        let mut session = Session::open(&file, nodes::ALL).unwrap();
        std::fs::write(&file, r#"{ "chiaro": 1, "nodes": {} }"#).unwrap();
        assert_eq!(session.on_disk(), OnDisk::Changed);
        session.reload().unwrap();
        assert!(session.document().nodes.is_empty() && session.on_disk() == OnDisk::Same);
        assert!(session.undo());
        assert_eq!(session.document().nodes.len(), 3);
        std::fs::write(&file, "nonsense").unwrap();
        assert!(session.reload().is_err() && session.document().nodes.len() == 3);
        session.keep_mine();
        assert!(session.on_disk() == OnDisk::Same && session.is_unsaved());
        std::fs::remove_file(&file).unwrap();
        assert_eq!(session.on_disk(), OnDisk::Gone);
    }

    #[test]
    fn a_recipe_that_cannot_be_saved_stays() {
        let folder = tempfile::tempdir().unwrap();
        let mut session = Session::new(nodes::ALL);
        assert!(!session.is_unsaved(), "nothing is no loss");
        session.change("add", None, |document| Ok(document.add_node("scene", [0.0; 2]))).unwrap();
        assert!(session.is_unsaved() && session.save().is_err());
        assert!(session.save_as(&folder.path().join("no/such/folder/x.json")).is_err());
        assert!(session.is_unsaved() && session.file().is_none());
        session.save_as(&folder.path().join("x.json")).unwrap();
        assert!(!session.is_unsaved());
        assert_eq!(session.document().base, folder.path());
        // Elsewhere it reads the same files.
        let read = |document: &mut Document| {
            document.set_param("scene", "file", Some(json!("scenes/room.glb")));
            Ok(())
        };
        session.change("file", None, read).unwrap();
        let elsewhere = folder.path().join("y");
        std::fs::create_dir(&elsewhere).unwrap();
        session.save_as(&elsewhere.join("x.json")).unwrap();
        assert_eq!(session.document().nodes["scene"].params["file"], json!("../scenes/room.glb"));
        let again = Session::open(&elsewhere.join("x.json"), nodes::ALL).unwrap();
        assert!(again.document().is_same(session.document()) && !session.is_unsaved());
    }
}
