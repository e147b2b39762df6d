//! Autosave: keeps the recipe aside on a thread of its own, because disks are slow when it matters.

use super::recovery::Recovery;
use crate::Error;
use crate::graph::Document;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

pub struct Keeper {
    work: Option<Sender<Message>>,
    failed: Receiver<Error>,
    thread: Option<JoinHandle<()>>,
}

enum Message {
    Keep(Arc<Document>, Option<PathBuf>),
    Forget,
}

impl Keeper {
    pub fn new(mut recovery: Recovery) -> Self {
        let (work, jobs) = channel();
        let (sender, failed) = channel();
        let serve = move || {
            while let Ok(mut job) = jobs.recv() {
                while let Ok(newer) = jobs.try_recv() {
                    job = newer;
                }
                match job {
                    Message::Keep(document, file) => {
                        if let Err(error) = recovery.keep(&document, file.as_deref()) {
                            let _ = sender.send(error);
                        }
                    }
                    Message::Forget => recovery.forget(),
                }
            }
        };
        let thread = std::thread::Builder::new().name("autosave".to_owned()).spawn(serve).ok();
        Self { work: Some(work), failed, thread }
    }

    /// The recipe has changed; `file` is where it would be saved.
    pub fn keep(&self, document: &Arc<Document>, file: Option<PathBuf>) {
        self.send(Message::Keep(document.clone(), file));
    }

    /// It was saved, or given up.
    pub fn forget(&self) {
        self.send(Message::Forget);
    }

    fn send(&self, message: Message) {
        if let Some(work) = &self.work {
            let _ = work.send(message);
        }
    }

    /// What went wrong since it was last asked.
    pub fn failed(&self) -> Option<Error> {
        self.failed.try_iter().last()
    }
}

impl Drop for Keeper {
    /// What was asked for is done first.
    fn drop(&mut self) {
        self.work = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
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
