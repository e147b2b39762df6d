//! Host memory with an identity, so that the GPU uploads it once and finds it again.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

static NEXT: AtomicU64 = AtomicU64::new(1);

/// An immutable shared array. Clones share the memory and the identity.
#[derive(Clone)]
pub struct Array<T> {
    data: Arc<Vec<T>>,
    id: u64,
}

impl<T> Array<T> {
    /// Never the same for two arrays made in one process.
    pub fn id(&self) -> u64 {
        self.id
    }
}

impl<T> From<Vec<T>> for Array<T> {
    fn from(data: Vec<T>) -> Self {
        Self { data: Arc::new(data), id: NEXT.fetch_add(1, Ordering::Relaxed) }
    }
}

impl<T> Default for Array<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T> std::ops::Deref for Array<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        &self.data
    }
}

impl<T> std::fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Array<{}>(len {})", std::any::type_name::<T>(), self.data.len())
    }
}

impl<'a, T> IntoIterator for &'a Array<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.data.iter()
    }
}
