//! Content hashes of input files, each file read once for as long as its size and time stay the same.

use crate::node::{Key, frame_path};
use crate::params::AnyNode;
use crate::{Error, Result};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::SystemTime;

/// Scenes that ship in the program are named so, and are no files.
const BUILTIN: &str = "builtin:";

#[derive(Default)]
pub struct FileHashes {
    known: Mutex<HashMap<PathBuf, Known>>,
}

/// The hash of a file when it had that size and time.
#[derive(Clone, Copy)]
struct Known {
    bytes: u64,
    time: Option<SystemTime>,
    key: Key,
}

impl FileHashes {
    /// # Errors
    /// `File` when it cannot be read.
    pub fn of(&self, path: &Path) -> Result<Key> {
        let fail = |error: std::io::Error| match error.kind() {
            std::io::ErrorKind::NotFound => {
                let help = "check the name; relative paths start from the recipe's folder";
                Error::file(path, "there is no such file", help)
            }
            _ => Error::file(path, format!("cannot be read: {error}"), ""),
        };
        let about = std::fs::metadata(path).map_err(fail)?;
        if about.is_dir() {
            return Err(Error::file(path, "this is a folder", "name a file"));
        }
        let (bytes, time) = (about.len(), about.modified().ok());
        let known = self.known.lock().expect("no panic while hashing").get(path).copied();
        if let Some(known) = known.filter(|known| known.bytes == bytes && known.time == time) {
            return Ok(known.key);
        }
        let content = std::fs::read(path).map_err(fail)?;
        let key = Key::of(&[&crate::stored::checksum(&content)]);
        self.known.lock().expect("no panic while hashing").insert(path.to_owned(), Known { bytes, time, key });
        Ok(key)
    }

    /// The hash of all files that a node reads at a frame.
    ///
    /// # Errors
    /// `File` when one that the node names cannot be read.
    pub fn of_node(&self, node: &dyn AnyNode, base: &Path, frame: f64) -> Result<Key> {
        let mut parts = Vec::new();
        for file in node.files().iter().filter(|file| !file.starts_with(BUILTIN)) {
            parts.push(self.of(&base.join(frame_path(file, frame)))?);
        }
        for file in node.linked_files(base) {
            // One that is missing is for the node to complain of: it knows who refers to it.
            parts.push(self.of(&base.join(file)).unwrap_or(Key::of(&[b"missing"])));
        }
        let parts: Vec<&[u8]> = parts.iter().map(|key| &key.0[..]).collect();
        Ok(Key::of(&parts))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_is_what_counts() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        std::fs::write(&a, "same").unwrap();
        std::fs::write(&b, "same").unwrap();
        let hashes = FileHashes::default();
        let before = hashes.of(&a).unwrap();
        assert_eq!(before, hashes.of(&b).unwrap());
        std::fs::write(&a, "other").unwrap();
        assert_ne!(before, hashes.of(&a).unwrap(), "noticed by the same hasher");
        assert_eq!(hashes.of(&folder.path().join("c")).unwrap_err().exit_code(), 3);
        assert!(hashes.of(folder.path()).unwrap_err().to_string().contains("folder"));
    }
}
