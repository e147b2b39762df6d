//! Undo and redo: snapshots of the recipe. A recipe is small, and a snapshot cannot go wrong.

use crate::graph::Document;
use std::sync::Arc;

/// Snapshots that are kept.
const MOST: usize = 500;

#[derive(Default)]
pub struct History {
    past: Vec<Snapshot>,
    future: Vec<Snapshot>,
    /// Changes with this mark belong to the one before.
    open: Option<String>,
}

struct Snapshot {
    /// What was done to it, for the menu.
    label: String,
    document: Arc<Document>,
}

impl History {
    /// Before a change: `document` as it is. Changes in a row with the same `mark` (a drag) are undone as one; `None`
    /// stands alone.
    pub fn record(&mut self, label: &str, mark: Option<&str>, document: &Arc<Document>) {
        self.future.clear();
        if mark.is_some() && self.open.as_deref() == mark {
            return;
        }
        self.open = mark.map(str::to_owned);
        self.past.push(Snapshot { label: label.to_owned(), document: document.clone() });
        if self.past.len() > MOST {
            self.past.remove(0);
        }
    }

    /// A drag goes on.
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// The next change is one of its own, whatever its mark.
    pub fn close(&mut self) {
        self.open = None;
    }

    /// The document before the last change.
    pub fn undo(&mut self, now: &Arc<Document>) -> Option<Arc<Document>> {
        self.step(now, true)
    }

    /// The document before the last undo.
    pub fn redo(&mut self, now: &Arc<Document>) -> Option<Arc<Document>> {
        self.step(now, false)
    }

    fn step(&mut self, now: &Arc<Document>, back: bool) -> Option<Arc<Document>> {
        self.open = None;
        let (from, to) = if back { (&mut self.past, &mut self.future) } else { (&mut self.future, &mut self.past) };
        let snapshot = from.pop()?;
        to.push(Snapshot { label: snapshot.label, document: now.clone() });
        Some(snapshot.document)
    }

    /// What undo would take back.
    pub fn undo_label(&self) -> Option<&str> {
        self.past.last().map(|snapshot| snapshot.label.as_str())
    }

    /// What redo would do again.
    pub fn redo_label(&self) -> Option<&str> {
        self.future.last().map(|snapshot| snapshot.label.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A document with as many nodes.
    fn with(nodes: usize) -> Arc<Document> {
        let mut document = Document::empty();
        (0..nodes).for_each(|_| drop(document.add_node("scene", [0.0; 2])));
        Arc::new(document)
    }

    #[test]
    fn forth_and_back() {
        let mut history = History::default();
        history.record("add", None, &with(0));
        history.record("add more", None, &with(1));
        assert_eq!(history.undo_label(), Some("add more"));
        let one = history.undo(&with(2)).unwrap();
        assert_eq!(one.nodes.len(), 1);
        assert_eq!(history.undo(&one).unwrap().nodes.len(), 0);
        assert!(history.undo(&with(0)).is_none());
        assert_eq!(history.redo(&with(0)).unwrap().nodes.len(), 1);
        assert_eq!(history.redo_label(), Some("add more"));
        history.record("another way", None, &one);
        assert!(history.redo(&with(1)).is_none(), "what was undone is left behind");
    }

    #[test]
    fn a_drag_is_undone_as_one() {
        let mut history = History::default();
        for nodes in 0..5 {
            history.record("drag", Some("bleed.brightness"), &with(nodes));
        }
        history.close();
        history.record("drag", Some("bleed.brightness"), &with(5));
        history.record("other", Some("bleed.hue"), &with(6));
        assert_eq!(history.undo(&with(7)).unwrap().nodes.len(), 6);
        assert_eq!(history.undo(&with(6)).unwrap().nodes.len(), 5);
        assert_eq!(history.undo(&with(5)).unwrap().nodes.len(), 0);
    }

    #[test]
    fn the_oldest_is_forgotten() {
        let mut history = History::default();
        (0..MOST + 10).for_each(|_| history.record("add", None, &with(0)));
        assert_eq!(history.past.len(), MOST);
    }
}
