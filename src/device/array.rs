//! Host memory with an identity, so that the GPU uploads it once and finds it again.

use crate::stored::SectionReader;
use memmap2::Mmap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

static NEXT: AtomicU64 = AtomicU64::new(1);

/// An immutable shared array. Clones share the memory and the identity.
pub struct Array<T> {
    /// Of the owner's values, at hand: kernels look at them in inner loops.
    start: *const T,
    length: usize,
    owner: Arc<Owner<T>>,
    id: u64,
}

/// Kept for its memory alone.
enum Owner<T> {
    Own {
        _values: Vec<T>,
    },
    /// Pages of a file, which the system takes back when memory runs short.
    Mapped {
        _pages: Mmap,
    },
}

// SAFETY: the values are only read, and live as long as their owner.
unsafe impl<T: Send + Sync> Send for Array<T> {}
// SAFETY: as above.
unsafe impl<T: Send + Sync> Sync for Array<T> {}

impl<T> Clone for Array<T> {
    fn clone(&self) -> Self {
        Self { owner: self.owner.clone(), ..*self }
    }
}

impl<T: bytemuck::Pod> Array<T> {
    /// The values that a map of a file holds; `None` where its length or place does not suit them. Nobody may change
    /// the file.
    pub fn mapped(map: Mmap) -> Option<Self> {
        let values = bytemuck::try_cast_slice::<u8, T>(&map).ok()?;
        let (start, length) = (values.as_ptr(), values.len());
        Some(Self {
            start,
            length,
            owner: Arc::new(Owner::Mapped { _pages: map }),
            id: NEXT.fetch_add(1, Ordering::Relaxed),
        })
    }

    /// The next section of an entry of the disk cache; a large one stays in its file.
    pub fn read(sections: &mut SectionReader) -> Option<Self> {
        match sections.map() {
            Some(map) => Self::mapped(map),
            None => sections.vec().map(Self::from),
        }
    }
}

impl<T> Array<T> {
    /// Never the same for two arrays made in one process.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Its values lie in a file.
    pub fn is_mapped(&self) -> bool {
        matches!(*self.owner, Owner::Mapped { .. })
    }
}

impl<T> From<Vec<T>> for Array<T> {
    fn from(data: Vec<T>) -> Self {
        let (start, length) = (data.as_ptr(), data.len());
        Self { start, length, owner: Arc::new(Owner::Own { _values: data }), id: NEXT.fetch_add(1, Ordering::Relaxed) }
    }
}

impl<T> Default for Array<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T> std::ops::Deref for Array<T> {
    type Target = [T];
    #[inline]
    fn deref(&self) -> &[T] {
        // SAFETY: the owner neither moves nor changes its values, and lives as long as this.
        unsafe { std::slice::from_raw_parts(self.start, self.length) }
    }
}

impl<T> std::fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Array<{}>(len {})", std::any::type_name::<T>(), self.len())
    }
}

impl<'a, T> IntoIterator for &'a Array<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
