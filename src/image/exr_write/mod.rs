//! Writing OpenEXR: one part of scan lines, data window = display window, layers as dotted channel names.
//!
//! Equal pictures give equal bytes: no time stamps, attributes sorted by name. Not for: tiles, mip levels, deep pixels.

mod encoding;

pub use encoding::{Compression, Depth, Encoding};

use super::{Content, Image, Layer};
use crate::{Error, Result, atomic};
use exr::block::chunk::Chunk;
use exr::block::writer::ChunksWriter;
use exr::block::{UncompressedBlock, enumerate_ordered_header_block_indices};
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, ChannelDescription, LineOrder, SampleType, Text};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use exr::prelude::{Vec2, f16};
use rayon::prelude::*;
use std::io::Cursor;
use std::path::Path;

/// Largest number of a half float.
pub const HALF_MAX: f32 = 65504.0;

/// A channel as it goes into the file.
struct Channel<'a> {
    name: String,
    layer: &'a Layer,
    index: usize,
    kind: SampleType,
}

/// Writes all layers. `attributes` are added to the picture's own metadata, and win where names are equal. Returns
/// what the user should know: layers stored as float against the wish, values that are not finite.
///
/// # Errors
/// A file that cannot be written; layers of other sizes than the picture's, or of one name; a pattern of `encoding`
/// that matches no layer, or that would make ids half.
pub fn write(
    path: &Path,
    image: &Image,
    encoding: impl Into<Encoding>,
    attributes: &[(&str, &str)],
) -> Result<Vec<String>> {
    let (bytes, warnings) = encode(path, image, &encoding.into(), attributes)?;
    atomic::write(path, &bytes)?;
    Ok(warnings.into_iter().map(|warning| format!("{}: {warning}", path.display())).collect())
}

/// The bytes of the file; `path` only serves messages.
fn encode(
    path: &Path,
    image: &Image,
    encoding: &Encoding,
    attributes: &[(&str, &str)],
) -> Result<(Vec<u8>, Vec<String>)> {
    let failed = |message: String| Error::output(path, message, "check the names and sizes of the picture's layers");
    let mut warnings = Vec::new();
    let mut channels = Vec::new();
    for (layer, wish) in image.layers.iter().zip(encoding.wishes(image)?) {
        if layer.data.len() != image.width * image.height * layer.channels.len() {
            let found = format!("layer \"{}\" holds {} values", layer.title(), layer.data.len());
            return Err(failed(format!("{found}, not {} x {} pixels", image.width, image.height)));
        }
        let kind = sample_type(layer, wish, encoding.depth, &mut warnings);
        for (index, channel) in layer.channels.iter().enumerate() {
            channels.push(Channel { name: channel_name(layer, channel), layer, index, kind });
        }
    }
    channels.sort_by(|a, b| a.name.cmp(&b.name));
    if let Some(pair) = channels.windows(2).find(|pair| pair[0].name == pair[1].name) {
        return Err(failed(format!("two channels are called \"{}\"", pair[0].name)));
    }
    if channels.is_empty() || image.width == 0 || image.height == 0 {
        let message = format!("{} x {} pixels with {} channels", image.width, image.height, channels.len());
        return Err(failed(format!("an empty picture: {message}")));
    }
    let headers = [header(image, &channels, encoding.compression, attributes)];
    let mut file = Cursor::new(Vec::new());
    exr::block::write(&mut file, headers.iter().cloned().collect(), true, |meta, writer| {
        let blocks: Vec<_> = enumerate_ordered_header_block_indices(&headers).collect();
        let compress = |&(index, block)| {
            let data = UncompressedBlock::collect_block_data_from_lines(&meta.headers[0].channels, block, |line| {
                fill(&channels[line.location.channel], line.location.position.1 * image.width, line.value);
            });
            Ok((index, UncompressedBlock { index: block, data }.compress_to_chunk(&meta.headers)?))
        };
        let chunks: exr::error::Result<Vec<(usize, Chunk)>> = blocks.par_iter().map(compress).collect();
        chunks?.into_iter().try_for_each(|(index, chunk)| writer.write_chunk(index, chunk))
    })
    .map_err(|error| failed(error.to_string()))?;
    let mut bytes = file.into_inner();
    sort_attributes(&mut bytes);
    Ok((bytes, warnings))
}

/// `R` for the beauty, `Z` for a layer that is one channel of its own name, `indirect.R` for all others.
fn channel_name(layer: &Layer, channel: &str) -> String {
    if layer.name.is_empty() || (layer.channels.len() == 1 && layer.name == channel) {
        channel.to_owned()
    } else {
        format!("{}.{channel}", layer.name)
    }
}

fn sample_type(layer: &Layer, wish: Option<Depth>, depth: Depth, warnings: &mut Vec<String>) -> SampleType {
    let not_finite = layer.data.par_iter().filter(|value| !value.is_finite()).count();
    if not_finite > 0 {
        warnings.push(format!("layer \"{}\": {not_finite} values are NaN or infinite", layer.title()));
    }
    if wish.unwrap_or(depth) == Depth::Float || (wish.is_none() && layer.content == Content::Data) {
        return SampleType::F32;
    }
    let above = layer.data.par_iter().filter(|value| value.is_finite() && value.abs() > HALF_MAX).count();
    if above == 0 {
        return SampleType::F16;
    }
    let title = layer.title();
    warnings.push(format!("layer \"{title}\": {above} values above 65504, half's largest; stored as float"));
    SampleType::F32
}

fn header(image: &Image, channels: &[Channel], compression: Compression, attributes: &[(&str, &str)]) -> Header {
    let describe = |channel: &Channel| ChannelDescription {
        name: text(&channel.name),
        sample_type: channel.kind,
        quantize_linearly: false,
        sampling: Vec2(1, 1),
    };
    let size = Vec2(image.width, image.height);
    let mut own = LayerAttributes::default();
    let interop = [("colorInteropID", image.colour_space.id())];
    let metadata = image.metadata.iter().map(|(name, value)| (name.as_str(), value.as_str()));
    let metadata = metadata.filter(|(name, _)| !names_missing_matte(image, name));
    for (name, value) in metadata.chain(interop).chain(attributes.iter().copied()) {
        own.other.insert(text(name), AttributeValue::Text(text(value)));
    }
    let mut shared = ImageAttributes::with_size(size);
    shared.chromaticities = Some(image.colour_space.chromaticities());
    Header::new(text(""), size, channels.iter().map(describe).collect())
        .with_encoding(compression.of_file(), BlockDescription::ScanLines, LineOrder::Increasing)
        .with_shared_attributes(shared)
        .with_attributes(own)
}

/// Whether an attribute `cryptomatte/<key>/...` belongs to a matte that is not in the picture any more.
fn names_missing_matte(image: &Image, attribute: &str) -> bool {
    let Some((key, _)) = attribute.strip_prefix("cryptomatte/").and_then(|rest| rest.split_once('/')) else {
        return false;
    };
    let name = format!("cryptomatte/{key}/name");
    let matte = image.metadata.iter().find(|(other, _)| *other == name);
    matte.is_none_or(|(_, matte)| image.layer(&format!("{matte}00")).is_none())
}

/// UTF-8, which `Text::from` would refuse above Latin-1.
fn text(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

/// Writes one line of one channel, starting at pixel `first`.
fn fill(channel: &Channel, first: usize, bytes: &mut [u8]) {
    let stride = channel.layer.channels.len();
    let values = channel.layer.data[first * stride + channel.index..].iter().step_by(stride);
    match channel.kind {
        SampleType::F16 => {
            for (sample, value) in bytes.as_chunks_mut::<2>().0.iter_mut().zip(values) {
                *sample = f16::from_f32(*value).to_ne_bytes();
            }
        }
        _ => {
            for (sample, value) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(values) {
                *sample = value.to_ne_bytes();
            }
        }
    }
}

/// The exr crate writes attributes in the order of a hash map, which differs from run to run. Sorts them by name in
/// place; none changes its length, so that offsets stay right.
fn sort_attributes(file: &mut [u8]) {
    const START: usize = 8; // magic number and version
    let after_zero = |from: usize| from + file[from..].iter().position(|&byte| byte == 0).expect("ends in zero") + 1;
    let mut attributes: Vec<&[u8]> = Vec::new();
    let mut at = START;
    while file[at] != 0 {
        let size = after_zero(after_zero(at));
        let length = u32::from_le_bytes(file[size..size + 4].try_into().expect("4 bytes")) as usize;
        let end = size + 4 + length;
        attributes.push(&file[at..end]);
        at = end;
    }
    attributes.sort();
    let sorted = attributes.concat();
    file[START..at].copy_from_slice(&sorted);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_channels() {
        let layer = |name, channels: &[&str]| Layer::new(name, channels, Content::Colour, vec![]);
        assert_eq!(channel_name(&layer("", &["R", "G", "B"]), "R"), "R");
        assert_eq!(channel_name(&layer("Z", &["Z"]), "Z"), "Z");
        assert_eq!(channel_name(&layer("P", &["X", "Y", "Z"]), "Z"), "P.Z");
        assert_eq!(channel_name(&layer("indirect", &["R", "G", "B"]), "R"), "indirect.R");
    }
}
