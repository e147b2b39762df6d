//! The file of sampled edits, for other programs too; what the numbers in it mean stands in the module above.
//!
//! # Layout, version 3
//!
//! All numbers are little-endian; `f32` is IEEE 754 binary32.
//!
//! | bytes | what |
//! |---|---|
//! | 0..8 | `89 65 64 69 74 73 0d 0a` (`\x89edits\r\n`) |
//! | 8..12 | u32: version, 3 |
//! | 12..16 | u32: bytes of the header, H |
//! | 16..20 | u32: CRC-32 (that of zlib and PNG) of bytes 0..16 followed by the header |
//! | 20..20 + H | the header: JSON, UTF-8 |
//! | from A | sections; A is the first multiple of 64 at or after 20 + H; what lies between is zero |
//!
//! The header is an object of
//! - `origin`: what the edits were sampled for: `geometry` (a hash), `triangles` (how many), `objects` (names by number),
//!   `bounds` (lower, upper corner, m), `width`, `height` (pixels), `across`, `down` (samples of a pixel), `camera`
//!   (`name`, `position`, `world_from_camera`: nine numbers, column by column: right, up, backward; `fov_y`: vertical,
//!   radians), `gather_samples` (M), `gather_layout`, `row_layout` (hashes). N = width x height x across x down.
//! - `sections`: a list of objects with `name`, `type` (`f32` or `u32`), `shape` (a list of one or two lengths, row-major),
//!   `offset` (from A, a multiple of 64), `bytes`, `crc32` (of these bytes). Sections lie in the order of the list, each at
//!   the first multiple of 64 after the one before; the file ends with the last.
//!
//! Sections, in this order; those marked (?) may be missing:
//!
//! | name | type, shape | what |
//! |---|---|---|
//! | `view.side` | u32 N | view samples, row-major by pixel from the upper left, samples of a pixel together: twice the triangle's number as the scene file lists them, and one more on its back; 4294967295 where nothing is seen |
//! | `view.barycentrics` | f32 N, 2 | weights of the triangle's second and third corner |
//! | `view.position` | f32 N, 3 | m, world: +Y up, right-handed; zero where nothing is seen |
//! | `view.normal` | f32 N, 3 | unit shading normal; zero where nothing is seen |
//! | `gather.side` | u32 M | gather samples, as view samples: twice the triangle's number, and one more on its back |
//! | `gather.barycentrics` | f32 M, 2 | weights of the triangle's second and third corner |
//! | `gather.position` | f32 M, 3 | m, world |
//! | `gather.normal` | f32 M, 3 | unit, on the side that the sample is on |
//! | `source.scale` (?) | f32 M, 3 | s_g, linear Rec.709; missing: 1 |
//! | `source.offset` (?) | f32 M, 3 | o_g, W/m²; missing: 0 |
//! | `eye.scale` (?) | f32 N, 3 | s_v; missing: 1 |
//! | `eye.offset` (?) | f32 N, 3 | o_v, W/(sr m²); missing: 0 |
//! | `touched` | u32 K | view samples that have rows; increasing |
//! | `slots` | u32 K, 4 | four rows of each, 0 to R - 1; 4294967295 for none |
//! | `weights` | f32 K, 4 | what each counts |
//! | `scale.starts` | u32 3 R + 1 | where the entries of each sparse row begin; row 3 r + c is channel c of row r |
//! | `scale.entries` | u32 | coefficients of S - 1 |
//! | `scale.step` | f32 3 R | what an integer coefficient of 1 stands for, by sparse row |
//! | `offset.starts`, `offset.entries`, `offset.step` (?) | as above | the same of O; missing: 0 |
//!
//! An entry of a sparse row is `index << (32 - b) | value` with `b = log2 M`: the number of a Haar coefficient in the high
//! b bits, an integer in two's complement in the others; the coefficient is `integer x step`. Indices of a row increase.
//!
//! Coefficient 0 is the mean times sqrt M. Coefficient i > 0 belongs to node i of the complete binary tree whose node 1 is
//! all gather samples, whose node n has the children 2 n (left) and 2 n + 1, and whose leaves M..2 M are the gather samples
//! in order: it adds `coefficient / sqrt(leaves of node i)` to all samples left under node i, and takes as much from those
//! right. `tests/read_edits.py` is a small reader.

use super::{Sampled, Vectors};
use crate::device::Array;
use crate::transport::SparseRows;
use crate::{Error, Result, atomic};
use bytemuck::Pod;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

pub(super) const MAGIC: [u8; 8] = *b"\x89edits\r\n";
pub(super) const VERSION: u32 = 3;
/// Bytes before the header.
pub(super) const PREFIX: usize = 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Type {
    F32,
    U32,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Section {
    pub name: String,
    #[serde(rename = "type")]
    pub kind: Type,
    pub shape: Vec<u64>,
    pub offset: u64,
    pub bytes: u64,
    pub crc32: u32,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Header {
    pub origin: super::Origin,
    pub sections: Vec<Section>,
}

/// The first multiple of 64 at or after a place; `None` beyond all places.
pub(super) fn aligned(place: u64) -> Option<u64> {
    place.checked_next_multiple_of(64)
}

/// The checksum of the prefix and the header.
pub(super) fn header_checksum(prefix: &[u8], header: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(prefix);
    hasher.update(header);
    hasher.finalize()
}

/// Sections as they are collected; numbers still in this machine's order of bytes.
#[derive(Default)]
struct Sections<'a>(Vec<(Section, Cow<'a, [u32]>)>);

impl<'a> Sections<'a> {
    fn put<T: Pod>(&mut self, name: &str, kind: Type, data: &'a [T]) {
        self.add(name, kind, (size_of::<T>() / 4, data.len()), Cow::Borrowed(bytemuck::cast_slice(data)));
    }

    /// The first three of four elements.
    fn colours(&mut self, name: &str, data: &Option<Array<[f32; 4]>>) {
        if let Some(data) = data {
            let words = data.iter().flat_map(|value| [value[0], value[1], value[2]]).map(f32::to_bits).collect();
            self.add(name, Type::F32, (3, data.len()), Cow::Owned(words));
        }
    }

    fn rows(&mut self, name: &str, rows: &'a SparseRows) {
        self.put(&format!("{name}.starts"), Type::U32, rows.offsets());
        self.put(&format!("{name}.entries"), Type::U32, rows.entries());
        self.put(&format!("{name}.step"), Type::F32, rows.scale());
    }

    fn add(&mut self, name: &str, kind: Type, (wide, count): (usize, usize), words: Cow<'a, [u32]>) {
        let shape = if wide == 1 { vec![count as u64] } else { vec![count as u64, wide as u64] };
        let bytes = 4 * words.len() as u64;
        self.0.push((Section { name: name.to_owned(), kind, shape, offset: 0, bytes, crc32: 0 }, words));
    }
}

/// Writes the file, whole or not at all; gives its size.
///
/// # Errors
/// `Output`.
pub fn write(path: &Path, sampled: &Sampled) -> Result<u64> {
    let mut sections = Sections::default();
    sections.put("view.side", Type::U32, &sampled.view.side);
    sections.put("view.barycentrics", Type::F32, &sampled.view.barycentrics);
    sections.put("view.position", Type::F32, &sampled.view.position);
    sections.put("view.normal", Type::F32, &sampled.view.normal);
    sections.put("gather.side", Type::U32, &sampled.gather.side);
    sections.put("gather.barycentrics", Type::F32, &sampled.gather.barycentrics);
    sections.put("gather.position", Type::F32, &sampled.gather.position);
    sections.put("gather.normal", Type::F32, &sampled.gather.normal);
    for (name, Vectors { scale, offset }) in [("source", &sampled.source), ("eye", &sampled.eye)] {
        sections.colours(&format!("{name}.scale"), scale);
        sections.colours(&format!("{name}.offset"), offset);
    }
    sections.put("touched", Type::U32, &sampled.touched);
    sections.put("slots", Type::U32, &sampled.slots);
    sections.put("weights", Type::F32, &sampled.weights);
    sections.rows("scale", &sampled.scales);
    sampled.offsets.iter().for_each(|rows| sections.rows("offset", rows));

    let mut sections = sections.0;
    sections.par_iter_mut().for_each(|(section, words)| {
        if cfg!(target_endian = "big") {
            words.to_mut().iter_mut().for_each(|word| *word = word.to_le());
        }
        section.crc32 = crc32fast::hash(bytemuck::cast_slice(words));
    });
    let mut end = 0u64;
    for (section, _) in &mut sections {
        section.offset = end.next_multiple_of(64);
        end = section.offset + section.bytes;
    }
    let header = Header { origin: sampled.origin.clone(), sections: sections.iter().map(|s| s.0.clone()).collect() };
    let header = serde_json::to_vec(&header).expect("plain data");
    let too_long = |_| Error::output(path, "the names of objects are longer than 4 GiB", "shorten them");
    let length = u32::try_from(header.len()).map_err(too_long)?;
    let mut prefix = [&MAGIC[..], &VERSION.to_le_bytes(), &length.to_le_bytes()].concat();
    prefix.extend(header_checksum(&prefix, &header).to_le_bytes());
    let mut size = 0usize;
    atomic::replace(path, |file| {
        let mut out = std::io::BufWriter::with_capacity(1 << 20, file);
        let mut put = |bytes: &[u8], align: bool| {
            let padding = if align { size.next_multiple_of(64) - size } else { 0 };
            size += padding + bytes.len();
            out.write_all(&[0; 64][..padding]).and_then(|()| out.write_all(bytes))
        };
        put(&prefix, false)?;
        put(&header, false)?;
        sections.iter().try_for_each(|(_, words)| put(bytemuck::cast_slice(words), true))?;
        out.flush()
    })
    .map_err(|error| Error::output(path, error.to_string(), "check that the folder exists and can be written to"))?;
    Ok(size as u64)
}
