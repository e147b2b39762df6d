//! Reading OpenEXR: single part and multipart, scan lines and tiles, half, float and uint, as layers of one size.
//!
//! A channel name is split at its last dot into layer and channel; in a multipart file, channels without a dot belong
//! to a layer named by their part. The picture has the size of the display window; what lies outside a data window
//! is 0. Not for: deep pixels, subsampled channels (both are errors), mip levels above the first (not read).

use super::{Content, Image, Layer, names};
use crate::{Error, Result};
use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::reader::Reader;
use exr::meta::attribute::{AttributeValue, Compression, IntegerBounds, SampleType};
use exr::meta::{MetaData, header::Header};
use exr::prelude::f16;
use rayon::prelude::*;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Larger pictures are refused: 2^28 pixels are 4 GiB a layer.
const MAX_PIXELS: u64 = 1 << 28;
/// Chunks that are decompressed together; bounds memory beside the layers themselves.
const BATCH: usize = 128;

/// One channel of a layer: where its samples lie in the blocks of a part.
struct Slot {
    part: usize,
    /// Bytes before it in a pixel: rows hold all samples of the first channel, then all of the second, ...
    offset: usize,
    kind: SampleType,
    name: String,
}

struct Plan {
    name: String,
    content: Content,
    slots: Vec<Slot>,
}

/// A file whose header has been read.
pub struct ExrFile {
    path: PathBuf,
    reader: Reader<BufReader<File>>,
    plans: Vec<Plan>,
    display: IntegerBounds,
    metadata: Vec<(String, String)>,
}

/// All layers of a file.
pub fn read(path: &Path) -> Result<Image> {
    let file = ExrFile::open(path)?;
    let all: Vec<usize> = (0..file.plans.len()).collect();
    file.read(&all)
}

/// Only the layers asked for, each once, in that order, under the names that they have in the file (see `names::find`).
pub fn read_layers(path: &Path, wanted: &[&str]) -> Result<Image> {
    let file = ExrFile::open(path)?;
    let names = file.layer_names();
    let find = |name: &&str| names::find(&names, name).map_err(|e| Error::file(path, e.message, e.help));
    let indices = wanted.iter().map(find).collect::<Result<Vec<usize>>>()?;
    drop(names);
    file.read(&indices)
}

impl ExrFile {
    pub fn open(path: &Path) -> Result<Self> {
        let failed = |error| explain(path, error);
        let file = File::open(path).map_err(|e| failed(exr::error::Error::Io(e)))?;
        let bytes = file.metadata().map_or(0, |data| data.len());
        let reader = exr::block::read(BufReader::new(file), false).map_err(failed)?;
        let headers = reader.headers();
        let first = headers.first().ok_or_else(|| Error::file(path, "an EXR file without parts", ""))?;
        let display = first.shared_attributes.display_window;
        for header in headers {
            check_part(path, header, bytes)?;
        }
        check_size(path, "display window", display, bytes, 1 << 26)?;
        Ok(Self {
            path: path.to_owned(),
            plans: plan_layers(headers),
            metadata: metadata(path, headers),
            display,
            reader,
        })
    }

    pub fn layer_names(&self) -> Vec<&str> {
        self.plans.iter().map(|plan| plan.name.as_str()).collect()
    }

    /// Reads the layers of these indices into `layer_names`, each once. Parts that hold none of them are not decoded.
    pub fn read(mut self, indices: &[usize]) -> Result<Image> {
        let mut plans: Vec<Option<Plan>> = self.plans.drain(..).map(Some).collect();
        let plans: Vec<Plan> = indices.iter().filter_map(|&index| plans[index].take()).collect();
        let (width, height) = (self.display.size.0, self.display.size.1);
        let mut buffers = Vec::with_capacity(plans.len());
        for plan in &plans {
            buffers.push(zeroed(&self.path, width * height * plan.slots.len())?);
        }
        let path = &self.path;
        let failed = |error| explain(path, error);
        let wanted = |part: usize| plans.iter().flat_map(|plan| &plan.slots).any(|slot| slot.part == part);
        let chunks = self
            .reader
            .filter_chunks(false, |_, _, block| wanted(block.layer) && block.level == exr::math::Vec2(0, 0))
            .map_err(failed)?;
        let meta = exr::block::reader::ChunksReader::meta_data(&chunks).clone();
        let mut chunks = chunks.map(|chunk| chunk.map_err(failed));
        loop {
            let batch = chunks.by_ref().take(BATCH).collect::<Result<Vec<Chunk>>>()?;
            if batch.is_empty() {
                break;
            }
            let blocks = batch
                .into_par_iter()
                .map(|chunk| {
                    check_chunk(path, &chunk, &meta)?;
                    UncompressedBlock::decompress_chunk(chunk, &meta, false).map_err(failed)
                })
                .collect::<Result<Vec<_>>>()?;
            plans.par_iter().zip(&mut buffers).for_each(|(plan, buffer)| {
                for block in &blocks {
                    scatter(block, &meta, plan, self.display, buffer);
                }
            });
        }
        let layers = plans.into_iter().zip(buffers).map(|(plan, data)| Layer {
            name: plan.name,
            content: plan.content,
            channels: plan.slots.into_iter().map(|slot| slot.name).collect(),
            data: data.into(),
        });
        Ok(Image { width, height, layers: layers.collect(), metadata: self.metadata })
    }
}

/// Groups the channels of all parts into layers, in the order of the file.
fn plan_layers(headers: &[Header]) -> Vec<Plan> {
    let mut plans: Vec<Plan> = Vec::new();
    for (part, header) in headers.iter().enumerate() {
        let part_name = header.own_attributes.layer_name.as_ref().map_or(String::new(), |n| text(n.as_slice()));
        let plain: Vec<String> = header.channels.list.iter().map(|c| text(c.name.as_slice())).collect();
        let has_red = plain.iter().any(|name| names::canonical(name) == "R");
        let first_of_part = plans.len();
        let mut offset = 0;
        for (channel, full) in header.channels.list.iter().zip(&plain) {
            let (prefix, own) = names::split(full);
            let by_part = headers.len() > 1 && !part_name.is_empty() && !(part == 0 && has_red);
            let beauty = names::rank(names::canonical(own)) < 4 || (!has_red && names::canonical(own) == "Y");
            let layer = match prefix {
                "" if by_part => part_name.clone(),
                "" if beauty => String::new(),
                "" => own.to_owned(),
                prefix => prefix.to_owned(),
            };
            let slot = Slot { part, offset, kind: channel.sample_type, name: own.to_owned() };
            offset += channel.sample_type.bytes_per_sample();
            // A second part that repeats a layer (left and right eye) keeps it apart under the part's name.
            let layer = match plans[..first_of_part].iter().any(|plan| plan.name == layer) {
                true if layer.is_empty() => part_name.clone(),
                true => format!("{part_name}.{layer}"),
                false => layer,
            };
            match plans[first_of_part..].iter_mut().find(|plan| plan.name == layer) {
                Some(plan) => plan.slots.push(slot),
                None => plans.push(Plan { name: layer, content: Content::Data, slots: vec![slot] }),
            }
        }
        for plan in &mut plans[first_of_part..] {
            let known: Vec<&str> = plan.slots.iter().map(|slot| names::canonical(&slot.name)).collect();
            let distinct = (1..known.len()).all(|i| !known[..i].contains(&known[i]));
            if distinct {
                let known: Vec<String> = known.into_iter().map(str::to_owned).collect();
                plan.slots.iter_mut().zip(known).for_each(|(slot, name)| slot.name = name);
            }
            plan.slots.sort_by_key(|slot| names::rank(&slot.name));
            let coloured = plan.slots.iter().any(|slot| slot.name == "R") || plan.name.is_empty();
            let counted = plan.slots.iter().any(|slot| slot.kind == SampleType::U32);
            if coloured && !counted && !names::is_data(&plan.name) {
                plan.content = Content::Colour;
            }
        }
    }
    plans
}

/// Copies the part of a block that lies in the display window into an interleaved layer.
fn scatter(block: &UncompressedBlock, meta: &MetaData, plan: &Plan, display: IntegerBounds, out: &mut [f32]) {
    let header = &meta.headers[block.index.layer];
    let (columns, rows) = (block.index.pixel_size.0, block.index.pixel_size.1);
    let row_bytes = columns * header.channels.bytes_per_pixel;
    let window = header.own_attributes.layer_position;
    // In pixels of the picture; may be negative or beyond it.
    let left = block.index.pixel_position.0 as i64 + i64::from(window.0) - i64::from(display.position.0);
    let top = block.index.pixel_position.1 as i64 + i64::from(window.1) - i64::from(display.position.1);
    let (width, height) = (display.size.0 as i64, display.size.1 as i64);
    let from = (-left).clamp(0, columns as i64) as usize;
    let to = (width - left).clamp(from as i64, columns as i64) as usize;
    if from == to {
        return;
    }
    let stride = plan.slots.len();
    for (index, slot) in plan.slots.iter().enumerate().filter(|(_, slot)| slot.part == block.index.layer) {
        let size = slot.kind.bytes_per_sample();
        for row in (0..rows).filter(|&row| (0..height).contains(&(top + row as i64))) {
            let start = row * row_bytes + slot.offset * columns;
            let bytes = &block.data[start + from * size..start + to * size];
            let first = ((top + row as i64) * width + left + from as i64) as usize;
            let pixels = out[first * stride + index..].iter_mut().step_by(stride);
            match slot.kind {
                SampleType::F16 => fill(pixels, bytes, |b: [u8; 2]| f16::from_ne_bytes(b).to_f32()),
                SampleType::F32 => fill(pixels, bytes, f32::from_ne_bytes),
                SampleType::U32 => fill(pixels, bytes, |b: [u8; 4]| u32::from_ne_bytes(b) as f32),
            }
        }
    }
}

fn fill<'a, const N: usize>(pixels: impl Iterator<Item = &'a mut f32>, bytes: &[u8], value: impl Fn([u8; N]) -> f32) {
    for (pixel, sample) in pixels.zip(bytes.as_chunks::<N>().0) {
        *pixel = value(*sample);
    }
}

/// Custom text attributes of all parts, by name; the first part that has a name decides.
fn metadata(path: &Path, headers: &[Header]) -> Vec<(String, String)> {
    let mut found = std::collections::BTreeMap::new();
    for header in headers {
        for (name, value) in header.own_attributes.other.iter().chain(&header.shared_attributes.other) {
            if let AttributeValue::Text(value) = value {
                let (name, value) = (text(name.as_slice()), text(value.as_slice()));
                if name == "colorInteropID" && !matches!(value.as_str(), "lin_rec709_scene" | "data" | "unknown") {
                    tracing::warn!("{}: colours are {value}; they are taken as linear Rec.709", path.display());
                }
                found.entry(name).or_insert(value);
            }
        }
    }
    // These say how this file is built, not what it shows.
    found.remove("colorInteropID");
    found.remove("BlenderMultiChannel");
    found.into_iter().collect()
}

/// Text in headers is UTF-8 in most files, Latin-1 in old ones.
fn text(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| byte as char).collect(),
    }
}

fn check_part(path: &Path, header: &Header, file_bytes: u64) -> Result<()> {
    if header.deep {
        return Err(Error::file(path, "holds deep pixels, which are not read", "flatten the picture first"));
    }
    if let Some(channel) = header.channels.list.iter().find(|channel| channel.sampling != exr::math::Vec2(1, 1)) {
        let name = text(channel.name.as_slice());
        let help = "write the picture with a sample for every pixel (RGB, not luminance and chroma)";
        return Err(Error::file(path, format!("channel \"{name}\" is subsampled, which is not read"), help));
    }
    check_size(path, "data window", header.data_window(), file_bytes, 0)
}

/// Refuses windows that no sound file of that many bytes has, before memory is asked for. Black compresses to a
/// thousandth; `spare` allows for a small data window in a large display window.
fn check_size(path: &Path, what: &str, window: IntegerBounds, file_bytes: u64, spare: u64) -> Result<()> {
    let pixels = (window.size.0 as u64).saturating_mul(window.size.1 as u64);
    let plausible = file_bytes.saturating_mul(4096).saturating_add(spare);
    if pixels == 0 || pixels > MAX_PIXELS || pixels > plausible {
        let message = format!("{what} of {} x {} pixels in a file of {file_bytes} bytes", window.size.0, window.size.1);
        return Err(Error::file(path, message, "the header is damaged, or the picture is larger than 2^28 pixels"));
    }
    Ok(())
}

/// A DWA chunk begins with eleven counters, which the exr crate takes at their word when it asks for memory.
fn check_chunk(path: &Path, chunk: &Chunk, meta: &MetaData) -> Result<()> {
    let bytes = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        _ => return Ok(()),
    };
    let Some(header) = meta.headers.get(chunk.layer_index) else { return Ok(()) };
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let place = header.get_block_data_indices(&chunk.compressed_block);
    let place = place.and_then(|tile| header.get_absolute_block_pixel_coordinates(tile));
    let size = place.map_err(|error| explain(path, error))?.size;
    if bytes.len() == size.area() * header.channels.bytes_per_pixel {
        return Ok(()); // did not get smaller, and so is stored as it was
    }
    // Blocks are padded to 8 x 8 pixels; nothing in one takes more than twice its bytes.
    let padded = (size.0 as u64 + 8) * (size.1 as u64 + 8);
    let limit = 2 * padded * header.channels.bytes_per_pixel as u64 + 4096;
    let counters = bytes.as_chunks::<8>().0.iter().take(11).map(|bytes| u64::from_le_bytes(*bytes));
    if counters.max().is_some_and(|most| most > limit) {
        return Err(Error::file(path, "damaged: a DWA block says that it is larger than it can be", "write it again"));
    }
    Ok(())
}

fn zeroed(path: &Path, len: usize) -> Result<Vec<f32>> {
    bytemuck::allocation::try_zeroed_vec(len).map_err(|()| {
        Error::file(path, format!("needs {} MiB for one layer, more than there is", len >> 18), "read fewer layers")
    })
}

fn explain(path: &Path, error: exr::error::Error) -> Error {
    use exr::error::Error as Exr;
    match error {
        Exr::Io(error) => Error::file(path, error.to_string(), "check the path and its permissions"),
        Exr::NotSupported(what) => Error::file(path, format!("EXR feature not supported: {what}"), ""),
        Exr::Invalid(what) => {
            Error::file(path, format!("not an OpenEXR file, or damaged or cut short: {what}"), "write the file again")
        }
        Exr::Aborted => Error::Cancelled,
    }
}
