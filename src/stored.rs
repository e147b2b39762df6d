//! How a value is laid out in a file of the disk cache: a few sections, each a slice of plain data or a small JSON.
//!
//! A type that is worth keeping implements `Stored` and gets an arm in `Value::write` and `Value::read`. Not for
//! interchange: entries are of this machine's byte order, and are dropped when the code that computes them changes.

use memmap2::{Mmap, MmapOptions};
use std::borrow::Cow;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// Bytes of a section from which on it stays in its file.
pub const MAPPED: u64 = 64 << 20;

pub trait Stored {
    fn write<'a>(&'a self, sections: &mut SectionWriter<'a>);

    /// Reads the sections in the order of `write`. `None` when they are not what this type writes.
    fn read(sections: &mut SectionReader) -> Option<Self>
    where
        Self: Sized;
}

/// Something that there may be none of.
impl<T: Stored> Stored for Option<T> {
    fn write<'a>(&'a self, sections: &mut SectionWriter<'a>) {
        sections.value(&self.is_some());
        self.iter().for_each(|value| value.write(sections));
    }

    fn read(sections: &mut SectionReader) -> Option<Self> {
        if sections.value()? { Some(Some(T::read(sections)?)) } else { Some(None) }
    }
}

/// Collects sections; slices are borrowed until the file is written.
#[derive(Default)]
pub struct SectionWriter<'a> {
    pub sections: Vec<Cow<'a, [u8]>>,
}

impl<'a> SectionWriter<'a> {
    pub fn slice<T: bytemuck::NoUninit>(&mut self, data: &'a [T]) {
        self.sections.push(Cow::Borrowed(bytemuck::cast_slice(data)));
    }

    /// For small things: sizes, names.
    pub fn value(&mut self, value: &impl serde::Serialize) {
        self.sections.push(Cow::Owned(serde_json::to_vec(value).expect("plain data")));
    }
}

/// Where a section lies in its file, and the checksum that its bytes must have.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    pub offset: u64,
    pub bytes: u64,
    pub checksum: [u8; 32],
}

/// Hands out sections one after the other, each read straight into its place and checked before it is given.
pub struct SectionReader<'a> {
    file: &'a mut File,
    sections: std::slice::Iter<'a, Section>,
}

impl<'a> SectionReader<'a> {
    /// `sections` must lie within the file.
    pub fn new(file: &'a mut File, sections: &'a [Section]) -> Self {
        Self { file, sections: sections.iter() }
    }

    /// The next section as a slice of `T`; `None` when there is none, its size does not fit, or it is damaged.
    pub fn vec<T: bytemuck::Pod>(&mut self) -> Option<Vec<T>> {
        let section = self.sections.next()?;
        let bytes = usize::try_from(section.bytes).ok()?;
        let size = size_of::<T>();
        if size == 0 || !bytes.is_multiple_of(size) {
            return None;
        }
        let mut data: Vec<T> = bytemuck::allocation::try_zeroed_vec(bytes / size).ok()?;
        let place: &mut [u8] = bytemuck::cast_slice_mut(&mut data);
        self.file.seek(SeekFrom::Start(section.offset)).ok()?;
        self.file.read_exact(place).ok()?;
        (checksum(place) == section.checksum).then_some(data)
    }

    /// The next section as pages of its file, if it is large and sound: it takes no memory that others could need.
    /// Otherwise `None`, and the section is still to be taken.
    pub fn map(&mut self) -> Option<Mmap> {
        let section = *self.sections.as_slice().first().filter(|section| section.bytes >= MAPPED)?;
        let length = usize::try_from(section.bytes).ok()?;
        // SAFETY: entries of the cache are renamed into place and removed, but never written to.
        let map = unsafe { MmapOptions::new().offset(section.offset).len(length).map(&*self.file) }.ok()?;
        if checksum(&map) != section.checksum {
            return None;
        }
        // The pages that were read may go; they come back as they are needed.
        // SAFETY: nothing is written to the map, so that nothing is lost.
        #[cfg(unix)]
        let _ = unsafe { map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
        self.sections.next();
        Some(map)
    }

    pub fn value<T: serde::de::DeserializeOwned>(&mut self) -> Option<T> {
        serde_json::from_slice(&self.vec::<u8>()?).ok()
    }

    /// All sections have been taken.
    pub fn is_empty(&self) -> bool {
        self.sections.len() == 0
    }
}

/// BLAKE3, by all threads where that pays.
pub fn checksum(bytes: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    if bytes.len() >= 128 << 10 {
        hasher.update_rayon(bytes);
    } else {
        hasher.update(bytes);
    }
    *hasher.finalize().as_bytes()
}
