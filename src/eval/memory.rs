//! The memory cache: bounded by bytes, least recently used goes first.

use crate::node::{Key, Memo};
use std::any::Any;
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex};

type Shared = Arc<dyn Any + Send + Sync>;

/// What a key names: the outputs of a node, or an intermediate result of a node's own (`Job::memo`).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Space {
    Outputs,
    Memo,
}

pub struct Memory {
    bound: u64,
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    entries: HashMap<(Space, Key), Entry>,
    /// When each entry was last used.
    by_use: BTreeMap<u64, (Space, Key)>,
    clock: u64,
    bytes: u64,
}

struct Entry {
    value: Shared,
    bytes: u64,
    used: u64,
}

impl Memory {
    /// Holds at most `bound` bytes.
    pub fn new(bound: u64) -> Self {
        Self { bound, inner: Mutex::default() }
    }

    pub fn bytes(&self) -> u64 {
        self.inner.lock().expect("no panic in the cache").bytes
    }

    pub fn outputs<T: Send + Sync + 'static>(&self, key: Key) -> Option<Arc<T>> {
        self.take((Space::Outputs, key))?.downcast().ok()
    }

    pub fn put_outputs(&self, key: Key, value: Shared, bytes: u64) {
        self.insert((Space::Outputs, key), value, bytes);
    }

    fn take(&self, name: (Space, Key)) -> Option<Shared> {
        let inner = &mut *self.inner.lock().expect("no panic in the cache");
        let entry = inner.entries.get_mut(&name)?;
        inner.by_use.remove(&entry.used);
        inner.clock += 1;
        entry.used = inner.clock;
        inner.by_use.insert(entry.used, name);
        Some(entry.value.clone())
    }

    fn insert(&self, name: (Space, Key), value: Shared, bytes: u64) {
        let inner = &mut *self.inner.lock().expect("no panic in the cache");
        inner.remove(name);
        if bytes > self.bound {
            return;
        }
        while inner.bytes + bytes > self.bound {
            let (_, oldest) =
                *inner.by_use.first_key_value().map(|(used, name)| (used, *name)).as_ref().expect("bytes");
            inner.remove(oldest);
        }
        inner.clock += 1;
        let used = inner.clock;
        inner.by_use.insert(used, name);
        inner.bytes += bytes;
        inner.entries.insert(name, Entry { value, bytes, used });
    }
}

impl Inner {
    fn remove(&mut self, name: (Space, Key)) {
        if let Some(entry) = self.entries.remove(&name) {
            self.by_use.remove(&entry.used);
            self.bytes -= entry.bytes;
        }
    }
}

impl Memo for Memory {
    fn get(&self, key: Key) -> Option<Shared> {
        self.take((Space::Memo, key))
    }

    fn put(&self, key: Key, value: Shared, bytes: u64) {
        self.insert((Space::Memo, key), value, bytes);
    }

    /// A quarter of what there is: something else is wanted, too.
    fn room(&self) -> u64 {
        self.bound / 4
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(name: u8) -> Key {
        Key([name; 16])
    }

    #[test]
    fn the_least_recently_used_goes_first() {
        let memory = Memory::new(100);
        for name in 0..4 {
            memory.put_outputs(key(name), Arc::new(name), 25);
        }
        assert_eq!(memory.outputs::<u8>(key(0)).as_deref(), Some(&0), "touched");
        memory.put_outputs(key(9), Arc::new(9u8), 30);
        assert_eq!(
            [0, 1, 2, 3, 9].map(|name| memory.outputs::<u8>(key(name)).is_some()),
            [true, false, false, true, true]
        );
        assert_eq!(memory.bytes(), 80);
    }

    #[test]
    fn what_is_too_large_is_not_kept_and_the_same_key_is_replaced() {
        let memory = Memory::new(100);
        memory.put_outputs(key(1), Arc::new(1u8), 60);
        memory.put_outputs(key(2), Arc::new(2u8), 101);
        memory.put_outputs(key(1), Arc::new(3u8), 70);
        assert_eq!(memory.outputs::<u8>(key(1)).as_deref(), Some(&3));
        assert!(memory.outputs::<u8>(key(2)).is_none());
        assert_eq!(memory.bytes(), 70);
    }

    #[test]
    fn a_nodes_own_results_do_not_meet_its_outputs() {
        let memory = Memory::new(100);
        memory.put_outputs(key(1), Arc::new(1u8), 1);
        memory.put(key(1), Arc::new("own"), 1);
        assert_eq!(memory.outputs::<u8>(key(1)).as_deref(), Some(&1));
        assert_eq!(*memory.get(key(1)).unwrap().downcast::<&str>().unwrap(), "own");
    }
}
