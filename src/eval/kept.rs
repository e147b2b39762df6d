//! Where nodes keep intermediate results (`Job::memo`, `Job::keep`): the memory cache, and the disk cache beneath it.

use super::disk::{Disk, Found};
use super::keys::SOURCES;
use super::memory::Memory;
use crate::node::{Key, Memo};
use crate::stored::{SectionReader, SectionWriter};
use crate::{Error, Result};
use std::any::Any;
use std::sync::Arc;

pub(super) struct Kept<'a> {
    pub memory: &'a Memory,
    pub disk: Option<&'a Disk>,
    /// Compute in spite of what lies on disk, and compare.
    pub verify: bool,
    /// Results are only good for what is left on disk.
    pub must_last: bool,
}

/// On disk, such a key must not meet that of an output, nor that of another version of the code.
fn on_disk(key: Key) -> Key {
    Key::of(&[b"kept", SOURCES.as_bytes(), &key.0])
}

fn warn_of_damage(disk: &Disk, key: Key) {
    tracing::warn!("damaged cache entry, computed again: {}", disk.path(key).display());
}

impl Memo for Kept<'_> {
    fn get(&self, key: Key) -> Option<Arc<dyn Any + Send + Sync>> {
        self.memory.get(key)
    }

    fn put(&self, key: Key, value: Arc<dyn Any + Send + Sync>, bytes: u64) {
        self.memory.put(key, value, bytes);
    }

    fn room(&self) -> u64 {
        self.memory.room()
    }

    fn load(&self, key: Key, read: &mut dyn FnMut(&mut SectionReader) -> Option<()>) -> bool {
        let Some(disk) = self.disk.filter(|_| !self.verify) else { return false };
        let key = on_disk(key);
        let found = disk.get(key, read);
        if found == Found::Damaged {
            warn_of_damage(disk, key);
        }
        found == Found::Value(())
    }

    fn save(&self, key: Key, sections: &SectionWriter) -> Result<()> {
        let Some(disk) = self.disk else { return Ok(()) };
        let key = on_disk(key);
        if self.verify {
            let found = disk.get(key, |found| {
                let mut same = true;
                for section in &sections.sections {
                    same &= found.vec::<u8>()? == **section;
                }
                Some(same)
            });
            match found {
                Found::Nothing => {}
                Found::Damaged => warn_of_damage(disk, key),
                Found::Value(true) => return Ok(()),
                Found::Value(false) => {
                    return Err(Error::compute(
                        format!("the cache holds something else than is computed now: {}", disk.path(key).display()),
                        "its key misses something that it depends on, or it was computed on another device; clear the cache",
                    ));
                }
            }
        }
        let lost = |what: String, help: &str| {
            let path = disk.path(key);
            Err(Error::output(path.parent().unwrap_or(&path), format!("a part of a precomputation {what}"), help))
        };
        match disk.put(key, sections) {
            Ok(false) if self.must_last => {
                lost("is larger than the cache may be".to_owned(), "allow it more with --cache-size")
            }
            Err(error) if self.must_last => {
                lost(format!("is not kept: {error}"), "make room, or name another folder with --cache")
            }
            Err(error) => {
                tracing::warn!("an intermediate result is not kept in the disk cache: {error}");
                Ok(())
            }
            Ok(_) => Ok(()),
        }
    }
}
