//! Autosave: keeps the recipe aside on a thread of its own, because disks are slow when it matters.

use super::latest::Latest;
use super::recovery::Recovery;
use crate::Result;
use crate::graph::Document;
use std::path::PathBuf;
use std::sync::Arc;

pub struct Keeper(Latest<Message, Result<()>>);

enum Message {
    Keep(Arc<Document>, Option<PathBuf>),
    Forget,
}

impl Keeper {
    pub fn new(mut recovery: Recovery) -> Self {
        let work = move |message| match message {
            Message::Keep(document, file) => Some(recovery.keep(&document, file.as_deref())),
            Message::Forget => {
                recovery.forget();
                None
            }
        };
        Self(Latest::new("autosave", work, || {}))
    }

    /// The recipe has changed; `file` is where it would be saved.
    pub fn keep(&self, document: &Arc<Document>, file: Option<PathBuf>) {
        self.0.ask(Message::Keep(document.clone(), file));
    }

    /// It was saved, or given up.
    pub fn forget(&self) {
        self.0.ask(Message::Forget);
    }

    /// Whether the last recipe was kept that has been since it was last asked.
    ///
    /// # Errors
    /// As `Recovery::keep`.
    pub fn kept(&self) -> Option<Result<()>> {
        self.0.answer()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::editor::recovery::left;

    #[test]
    fn what_was_not_given_up_is_there_after_the_window() {
        let folder = tempfile::tempdir().unwrap();
        let keeper = Keeper::new(Recovery::new(folder.path()).unwrap());
        let mut document = Document::empty();
        for _ in 0..20 {
            document.add_node("scene", [0.0; 2]);
            keeper.keep(&Arc::new(document.clone()), None);
        }
        drop(keeper);
        let found = left(folder.path());
        assert_eq!(found[0].document.nodes.len(), 20, "the last is kept");
        found.into_iter().for_each(super::super::recovery::Left::discard);
        let keeper = Keeper::new(Recovery::new(folder.path()).unwrap());
        keeper.keep(&Arc::new(document), None);
        keeper.forget();
        drop(keeper);
        assert!(left(folder.path()).is_empty());
    }
}
