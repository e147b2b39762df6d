//! Reads the file of sampled edits (see `file`): whatever bytes it is given, it answers with sound edits or with what is
//! wrong, and takes no more memory than the file is long.

use super::file::{Header, MAGIC, PREFIX, Section, Type, VERSION, aligned, header_checksum};
use super::{GatherPlaces, Parts, Sampled, Vectors, ViewPlaces};
use crate::device::Array;
use crate::transport::SparseRows;
use crate::transport::sparse::EntryFormat;
use crate::{Error, Result};
use bytemuck::Pod;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// # Errors
/// `File` when it cannot be read, is no file of sampled edits, is of a newer version, or is damaged.
pub fn read(path: &Path) -> Result<Sampled> {
    let missing = |error: std::io::Error| Error::file(path, error.to_string(), "check the path");
    let mut file = File::open(path).map_err(missing)?;
    let length = file.metadata().map_err(missing)?.len();
    let mut reader = Reader { path, file: &mut file, length, begin: 0, sections: Vec::new().into_iter().peekable() };
    let header = reader.header()?;
    reader.lay_out(header.sections)?;
    let parts = reader.parts(header.origin)?;
    Sampled::new(parts).map_err(|error| reader.damaged(error.to_string()))
}

struct Reader<'a> {
    path: &'a Path,
    file: &'a mut File,
    /// Of the file.
    length: u64,
    /// Where sections begin.
    begin: u64,
    /// Those that are still to be taken.
    sections: std::iter::Peekable<std::vec::IntoIter<Section>>,
}

impl Reader<'_> {
    fn damaged(&self, what: impl Into<String>) -> Error {
        Error::file(self.path, what, "the file is damaged: write it again with write_edits, or take another copy")
    }

    fn bytes(&mut self, at: u64, place: &mut [u8]) -> Result<()> {
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(place));
        read.map_err(|error| self.damaged(error.to_string()))
    }

    fn header(&mut self) -> Result<Header> {
        let mut prefix = [0; PREFIX];
        if self.length < PREFIX as u64 {
            return Err(self.damaged(format!("{} bytes are too few for a file of sampled edits", self.length)));
        }
        self.bytes(0, &mut prefix)?;
        let word = |at: usize| u32::from_le_bytes([prefix[at], prefix[at + 1], prefix[at + 2], prefix[at + 3]]);
        if prefix[..8] != MAGIC {
            let help = "read_edits takes what write_edits wrote; pictures are read by read_image";
            return Err(Error::file(self.path, "is no file of sampled edits", help));
        }
        let (version, bytes) = (word(8), u64::from(word(12)));
        if version != VERSION {
            let message = format!("is of version {version} of sampled edits; this program reads version {VERSION}");
            let help =
                if version > VERSION { "read it with a newer chiaro" } else { "sample and write the edits anew" };
            return Err(Error::file(self.path, message, help));
        }
        if bytes > self.length - PREFIX as u64 {
            return Err(self.damaged(format!("ends within its header of {bytes} bytes")));
        }
        let mut header = vec![0; bytes as usize];
        self.bytes(PREFIX as u64, &mut header)?;
        if header_checksum(&prefix[..16], &header) != word(16) {
            return Err(self.damaged("the checksum of its header is wrong"));
        }
        let end = PREFIX as u64 + bytes;
        self.begin = aligned(end).unwrap_or(end);
        serde_json::from_slice(&header).map_err(|error| self.damaged(format!("its header: {error}")))
    }

    /// Takes the list of sections in when they fill the rest of the file without gap or overlap.
    fn lay_out(&mut self, sections: Vec<Section>) -> Result<()> {
        let mut end = 0u64;
        for Section { name, shape, offset, bytes, .. } in &sections {
            let elements = shape.iter().try_fold(1u64, |product, &length| product.checked_mul(length));
            let fits =
                (1..=2).contains(&shape.len()) && elements.and_then(|count| count.checked_mul(4)) == Some(*bytes);
            if !fits {
                return Err(self.damaged(format!("section \"{name}\": {bytes} bytes cannot hold shape {shape:?}")));
            }
            if aligned(end) != Some(*offset) {
                return Err(
                    self.damaged(format!("section \"{name}\" begins at {offset}, the one before ends at {end}"))
                );
            }
            end = offset.checked_add(*bytes).ok_or_else(|| self.damaged(format!("section \"{name}\" is endless")))?;
        }
        let whole = self.begin.checked_add(end);
        if whole != Some(self.length) {
            let whole = whole.map_or("endless".to_owned(), |whole| format!("{whole} bytes"));
            return Err(self.damaged(format!("is {} bytes long; its header says {whole}", self.length)));
        }
        self.sections = sections.into_iter().peekable();
        Ok(())
    }

    /// The next section, which must be of that name, type and width: as elements of `T`, checked.
    fn take<T: Pod>(&mut self, name: &str, kind: Type) -> Result<Array<T>> {
        let Some(section) = self.sections.next() else {
            return Err(self.damaged(format!("section \"{name}\" is missing")));
        };
        let width = if section.shape.len() == 2 { section.shape[1] } else { 1 };
        if section.name != name || section.kind != kind || width != size_of::<T>() as u64 / 4 {
            let Section { name: found, kind: of, shape, .. } = &section;
            let (of, kind) = (format!("{of:?}").to_lowercase(), format!("{kind:?}").to_lowercase());
            let expected = format!("\"{name}\" of {kind}, {} to an element", size_of::<T>() / 4);
            return Err(self.damaged(format!("section \"{found}\" is of {of}, shape {shape:?}; expected {expected}")));
        }
        // Not longer than the file: `lay_out` has seen to it.
        let count = section.shape[0] as usize;
        let memory = |_| Error::compute(format!("{count} elements of {name} do not fit into memory"), "free memory");
        let mut data: Vec<T> = bytemuck::allocation::try_zeroed_vec(count).map_err(memory)?;
        self.bytes(self.begin + section.offset, bytemuck::cast_slice_mut(&mut data))?;
        if crc32fast::hash(bytemuck::cast_slice(&data)) != section.crc32 {
            return Err(self.damaged(format!("the checksum of section \"{name}\" is wrong")));
        }
        if cfg!(target_endian = "big") {
            bytemuck::cast_slice_mut::<T, u32>(&mut data).iter_mut().for_each(|word| *word = u32::from_le(*word));
        }
        Ok(data.into())
    }

    fn next_is(&mut self, name: &str) -> bool {
        self.sections.peek().is_some_and(|section| section.name == name)
    }

    /// `fourth`: the element that the file does not keep.
    fn colours(&mut self, name: &str, fourth: f32) -> Result<Option<Array<[f32; 4]>>> {
        if !self.next_is(name) {
            return Ok(None);
        }
        let colours = self.take::<[f32; 3]>(name, Type::F32)?;
        Ok(Some(colours.iter().map(|[r, g, b]| [*r, *g, *b, fourth]).collect::<Vec<_>>().into()))
    }

    fn vectors(&mut self, name: &str) -> Result<Vectors> {
        let scale = self.colours(&format!("{name}.scale"), 1.0)?;
        Ok(Vectors { scale, offset: self.colours(&format!("{name}.offset"), 0.0)? })
    }

    fn rows(&mut self, name: &str, index_bits: u32) -> Result<SparseRows> {
        let starts = self.take::<u32>(&format!("{name}.starts"), Type::U32)?;
        let entries = self.take::<u32>(&format!("{name}.entries"), Type::U32)?;
        let step = self.take::<f32>(&format!("{name}.step"), Type::F32)?;
        let rows = SparseRows::new(starts, entries, step, EntryFormat { index_bits, signed: true });
        rows.map_err(|error| self.damaged(format!("{name} rows: {error}")))
    }

    fn parts(&mut self, origin: super::Origin) -> Result<Parts> {
        if let Some(fault) = origin.fault() {
            return Err(self.damaged(fault));
        }
        let index_bits = origin.gather_samples.ilog2();
        let view = ViewPlaces {
            side: self.take("view.side", Type::U32)?,
            barycentrics: self.take("view.barycentrics", Type::F32)?,
            position: self.take("view.position", Type::F32)?,
            normal: self.take("view.normal", Type::F32)?,
        };
        let gather = GatherPlaces {
            side: self.take("gather.side", Type::U32)?,
            barycentrics: self.take("gather.barycentrics", Type::F32)?,
            position: self.take("gather.position", Type::F32)?,
            normal: self.take("gather.normal", Type::F32)?,
        };
        let source = self.vectors("source")?;
        let eye = self.vectors("eye")?;
        let touched = self.take("touched", Type::U32)?;
        let slots = self.take("slots", Type::U32)?;
        let weights = self.take("weights", Type::F32)?;
        let scales = self.rows("scale", index_bits)?;
        let offsets = if self.next_is("offset.starts") { Some(self.rows("offset", index_bits)?) } else { None };
        if let Some(section) = self.sections.next() {
            return Err(self.damaged(format!("section \"{}\" is not known here", section.name)));
        }
        Ok(Parts { origin, view, gather, source, eye, touched, slots, weights, scales, offsets })
    }
}
