//! Keys that name values by what they were computed from, and intermediate results that are kept under them.

use crate::Result;
use crate::stored::{MAPPED, SectionReader, SectionWriter, Stored};
use std::any::Any;
use std::sync::Arc;

/// 128 bits that name a value: a hash of all that it was computed from.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Key(pub [u8; 16]);

impl Key {
    /// Hashes labelled parts; lengths are hashed too, so parts cannot run into each other.
    pub fn of(parts: &[&[u8]]) -> Self {
        let mut hasher = blake3::Hasher::new();
        for part in parts {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part);
        }
        Self(hasher.finalize().as_bytes()[..16].try_into().expect("16 of 32 bytes"))
    }
}

impl std::fmt::Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl std::fmt::Debug for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Key({self})")
    }
}

/// One of several parts that a precomputation is cut into, so that several machines share the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// From 0.
    pub index: usize,
    pub count: usize,
}

impl Part {
    /// Blocks of work go round.
    pub fn has(&self, block: usize) -> bool {
        block % self.count == self.index
    }
}

/// Intermediate results that outlive one run of a node, under a key of the node's making.
pub trait Memo: Send + Sync {
    fn get(&self, key: Key) -> Option<Arc<dyn Any + Send + Sync>>;
    fn put(&self, key: Key, value: Arc<dyn Any + Send + Sync>, bytes: u64);

    /// Bytes that one result may have to be remembered at all.
    fn room(&self) -> u64;

    /// Hands `read` what `save` laid down under that key, if it lasted. False: there is nothing, or nothing sound, and
    /// what `read` has taken so far is void.
    fn load(&self, _key: Key, _read: &mut dyn FnMut(&mut SectionReader) -> Option<()>) -> bool {
        false
    }

    /// Lays a result down to last longer than the process, where there is room for that.
    ///
    /// # Errors
    /// `Compute` in the checked mode, when something else was laid down under that key.
    fn save(&self, _key: Key, _sections: &SectionWriter) -> Result<()> {
        Ok(())
    }
}

/// A memo that remembers nothing.
pub struct NoMemo;

impl Memo for NoMemo {
    fn get(&self, _: Key) -> Option<Arc<dyn Any + Send + Sync>> {
        None
    }
    fn put(&self, _: Key, _: Arc<dyn Any + Send + Sync>, _: u64) {}
    fn room(&self) -> u64 {
        0
    }
}

impl dyn Memo + '_ {
    /// Takes an intermediate result from the memory cache or computes it; `bytes` counts what the cache holds.
    pub fn remember<T: Send + Sync + 'static>(
        &self,
        key: Key,
        bytes: impl Fn(&T) -> u64,
        compute: impl FnOnce() -> Result<T>,
    ) -> Result<Arc<T>> {
        if let Some(found) = self.get(key).and_then(|any| any.downcast::<T>().ok()) {
            return Ok(found);
        }
        let value = Arc::new(compute()?);
        self.put(key, value.clone(), bytes(&value));
        Ok(value)
    }

    /// What was laid down under a key to last.
    pub fn find<T: Stored>(&self, key: Key) -> Option<T> {
        let mut found = None;
        let sound = self.load(key, &mut |sections| {
            found = T::read(sections);
            found.as_ref().map(|_| ())
        });
        found.filter(|_| sound)
    }

    /// Lays a value down to last.
    ///
    /// # Errors
    /// As `save`.
    pub fn lay_down<T: Stored>(&self, key: Key, value: &T) -> Result<()> {
        let mut sections = SectionWriter::default();
        value.write(&mut sections);
        self.save(key, &sections)
    }

    /// As `remember`, for what is dear to compute: looks into the disk cache too, and leaves the result there. Large
    /// parts of it then lie in the file and no more in memory (`stored::MAPPED`).
    pub fn keep<T: Stored + Send + Sync + 'static>(
        &self,
        key: Key,
        bytes: impl Fn(&T) -> u64,
        compute: impl FnOnce() -> Result<T>,
    ) -> Result<Arc<T>> {
        self.remember(key, bytes, || {
            if let Some(value) = self.find(key) {
                return Ok(value);
            }
            let value = compute()?;
            let mut sections = SectionWriter::default();
            value.write(&mut sections);
            self.save(key, &sections)?;
            let is_large = sections.sections.iter().any(|section| section.len() as u64 >= MAPPED);
            // What is large leaves memory for the file that it has just been written to.
            let spilled = if is_large { self.find(key) } else { None };
            Ok(spilled.unwrap_or(value))
        })
    }
}
