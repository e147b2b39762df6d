//! What was not saved when the program ended: every change is written aside, so that it can be had back.
//!
//! One file a window, beside a lock that the window holds: a file whose lock is free was left by a program that did not
//! end by itself.

use crate::graph::Document;
use crate::{Error, Result, atomic};
use serde::{Deserialize, Serialize};
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

/// Of one window.
pub struct Recovery {
    file: PathBuf,
    /// Held for as long as the window lives.
    lock: File,
    lock_file: PathBuf,
    written: Option<String>,
}

#[derive(Serialize, Deserialize)]
struct Kept {
    /// Where the recipe would be saved.
    file: Option<PathBuf>,
    /// What paths in it start from.
    path: PathBuf,
    recipe: String,
}

/// A recipe that was left behind.
pub struct Left {
    pub document: Document,
    /// Where it would be saved.
    pub file: Option<PathBuf>,
    pub seconds_ago: u64,
    kept: PathBuf,
}

const SUFFIX: &str = "recovery";

impl Recovery {
    /// In `folder`, which is made if need be.
    ///
    /// # Errors
    /// `Output` when nothing can be written there.
    pub fn new(folder: &Path) -> Result<Self> {
        let fail = |error: std::io::Error| {
            Error::output(folder, format!("changes cannot be kept aside: {error}"), "save often, or make room")
        };
        std::fs::create_dir_all(folder).map_err(fail)?;
        for number in 1.. {
            let lock_file = folder.join(format!("{number}.lock"));
            let file = folder.join(format!("{number}.{SUFFIX}"));
            let lock = File::options().create(true).append(true).open(&lock_file).map_err(fail)?;
            match lock.try_lock() {
                // What another program has left there is not written over.
                Ok(()) if !file.exists() => return Ok(Self { file, lock, lock_file, written: None }),
                Ok(()) | Err(TryLockError::WouldBlock) => {}
                Err(TryLockError::Error(error)) => return Err(fail(error)),
            }
        }
        unreachable!("numbers do not end")
    }

    /// Keeps the recipe as it is now; `file` is where it would be saved. Does nothing when it is kept already.
    ///
    /// # Errors
    /// `Output` when it cannot be written; what was kept before is then still there.
    pub fn keep(&mut self, document: &Document, file: Option<&Path>) -> Result<()> {
        let recipe = document.to_text();
        if self.written.as_ref() == Some(&recipe) {
            return Ok(());
        }
        let kept = Kept { file: file.map(Path::to_owned), path: document.path.clone(), recipe };
        atomic::write(&self.file, &serde_json::to_vec(&kept).expect("plain data"))?;
        self.written = Some(kept.recipe);
        Ok(())
    }

    /// There is nothing to be lost: the recipe was saved, or given up.
    pub fn forget(&mut self) {
        self.written = None;
        let _ = std::fs::remove_file(&self.file);
    }
}

impl Drop for Recovery {
    fn drop(&mut self) {
        // What was not forgotten before was not given up: a window may be lost in many ways.
        let _ = self.lock.unlock();
        let _ = std::fs::remove_file(&self.lock_file);
    }
}

/// What programs that are no more have left in `folder`, the newest first. Files that are no recipes are passed by.
pub fn left(folder: &Path) -> Vec<Left> {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let kept = files.filter(|path| path.extension().is_some_and(|suffix| suffix == SUFFIX));
    let mut left: Vec<Left> = kept.filter(|path| is_orphan(path)).filter_map(|path| read(&path)).collect();
    left.sort_by_key(|left| left.seconds_ago);
    left
}

fn is_orphan(kept: &Path) -> bool {
    match File::options().append(true).open(kept.with_extension("lock")) {
        Ok(lock) => lock.try_lock().is_ok(),
        Err(_) => true,
    }
}

fn read(path: &Path) -> Option<Left> {
    let kept: Kept = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    let document = Document::parse(&kept.path, &kept.recipe).ok()?;
    let age = path.metadata().ok()?.modified().ok()?.elapsed().unwrap_or_default();
    Some(Left { document, file: kept.file, seconds_ago: age.as_secs(), kept: path.to_owned() })
}

impl Left {
    /// It was taken, or is not wanted.
    pub fn discard(self) {
        let _ = std::fs::remove_file(&self.kept);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(nodes: usize) -> Document {
        let mut document = Document::empty();
        (0..nodes).for_each(|_| drop(document.add_node("scene", [0.0; 2])));
        document
    }

    #[test]
    fn what_a_lost_program_left_is_found_once() {
        let folder = tempfile::tempdir().unwrap();
        let mut lost = Recovery::new(folder.path()).unwrap();
        lost.keep(&document(2), Some(Path::new("/x/bleed.json"))).unwrap();
        assert!(left(folder.path()).is_empty(), "its window lives");
        // As a killed program: nothing is tidied up, but the lock goes.
        lost.lock.unlock().unwrap();
        std::mem::forget(lost);
        let mut next = Recovery::new(folder.path()).unwrap();
        next.keep(&document(1), None).unwrap();
        let found = left(folder.path());
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].document.nodes.len(), found[0].file.as_deref()), (2, Some(Path::new("/x/bleed.json"))));
        found.into_iter().for_each(Left::discard);
        assert!(left(folder.path()).is_empty());
        next.forget();
        drop(next);
        let names = std::fs::read_dir(folder.path()).unwrap().flatten().map(|entry| entry.file_name());
        assert_eq!(names.filter(|name| name.to_string_lossy().ends_with(SUFFIX)).count(), 0);
    }

    #[test]
    fn windows_do_not_meet_and_rubbish_is_passed_by() {
        let folder = tempfile::tempdir().unwrap();
        let mut windows: Vec<Recovery> = (0..3).map(|_| Recovery::new(folder.path()).unwrap()).collect();
        windows.iter_mut().enumerate().for_each(|(i, window)| window.keep(&document(i), None).unwrap());
        assert_eq!(windows.iter().map(|window| &window.file).collect::<std::collections::HashSet<_>>().len(), 3);
        windows[0].forget();
        assert!(!windows[0].file.exists());
        std::fs::write(folder.path().join("9.recovery"), "rubbish").unwrap();
        assert!(left(folder.path()).is_empty());
        assert!(Recovery::new(Path::new("/proc/no/such")).is_err());
    }
}
