//! Reading OpenEXR: single part and multipart, scan lines and tiles, half, float and uint, as layers of one size.
//!
//! A channel name is split at its last dot into layer and channel; in a multipart file, channels without a dot belong
//! to a layer named by their part. The picture has the size of the display window; what lies outside a data window
//! is 0. Not for: deep pixels, subsampled channels (both are errors), mip levels above the first (not read).

mod header;
mod layers;
mod soundness;

use super::{ColourSpace, Image, Layer, names};
use crate::{Error, Result};
use exr::block::UncompressedBlock;
use exr::block::chunk::Chunk;
use exr::block::reader::Reader;
use exr::meta::attribute::{IntegerBounds, SampleType};
use exr::meta::{MetaData, header::Header};
use exr::prelude::f16;
use header::{colour_space, metadata};
use layers::{Plan, plan_layers};
use rayon::prelude::*;
use soundness::{check_chunk, check_part, check_size, explain, zeroed};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Larger pictures are refused: 2^28 pixels are 4 GiB a layer.
const MAX_PIXELS: u64 = 1 << 28;
/// Chunks that are decompressed together; bounds memory beside the layers themselves.
const BATCH: usize = 128;

/// A file whose header has been read.
pub struct ExrFile {
    path: PathBuf,
    reader: Reader<BufReader<File>>,
    plans: Vec<Plan>,
    display: IntegerBounds,
    colour_space: ColourSpace,
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
        let aspect = first.shared_attributes.pixel_aspect;
        if (aspect - 1.0).abs() > 1e-3 {
            tracing::warn!("{}: pixels are {aspect} times as wide as high; they are taken as square", path.display());
        }
        let colour_space = colour_space(headers).unwrap_or_else(|found| {
            tracing::warn!("{}: colours are {found}, which is not known; taken as linear Rec.709", path.display());
            ColourSpace::default()
        });
        Ok(Self {
            path: path.to_owned(),
            plans: plan_layers(headers),
            metadata: metadata(headers),
            display,
            colour_space,
            reader,
        })
    }

    /// One for each part.
    pub fn headers(&self) -> &[Header] {
        self.reader.headers()
    }

    pub fn metadata(&self) -> &[(String, String)] {
        &self.metadata
    }

    pub fn colour_space(&self) -> ColourSpace {
        self.colour_space
    }

    pub fn display(&self) -> IntegerBounds {
        self.display
    }

    /// How the channels of each layer are stored: `half`, `float` or `uint`, several where they differ.
    pub fn stored(&self) -> Vec<String> {
        let name = |slot: &layers::Slot| match slot.kind {
            SampleType::F16 => "half",
            SampleType::F32 => "float",
            SampleType::U32 => "uint",
        };
        let kinds = |plan: &Plan| {
            let mut kinds: Vec<&str> = plan.slots.iter().map(name).collect();
            kinds.sort_unstable();
            kinds.dedup();
            kinds.join(" and ")
        };
        self.plans.iter().map(kinds).collect()
    }

    /// The picture without its pixels: size, layers of no values, header.
    pub fn outline(&self) -> Image {
        let layer = |plan: &Plan| Layer {
            name: plan.name.clone(),
            content: plan.content,
            channels: plan.slots.iter().map(|slot| slot.name.clone()).collect(),
            data: Vec::new().into(),
        };
        Image {
            width: self.display.size.0,
            height: self.display.size.1,
            layers: self.plans.iter().map(layer).collect(),
            colour_space: self.colour_space,
            metadata: self.metadata.clone(),
        }
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
        let (colour_space, metadata) = (self.colour_space, self.metadata);
        Ok(Image { width, height, layers: layers.collect(), colour_space, metadata })
    }
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
