//! Headers and chunks that no sound file has are refused before memory is asked for.

use super::MAX_PIXELS;
use super::header::text;
use crate::{Error, Result};
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::meta::MetaData;
use exr::meta::attribute::{Compression, IntegerBounds};
use exr::meta::header::Header;
use std::path::Path;

pub(super) fn check_part(path: &Path, header: &Header, file_bytes: u64) -> Result<()> {
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
pub(super) fn check_size(path: &Path, what: &str, window: IntegerBounds, file_bytes: u64, spare: u64) -> Result<()> {
    let pixels = (window.size.0 as u64).saturating_mul(window.size.1 as u64);
    let plausible = file_bytes.saturating_mul(4096).saturating_add(spare);
    if pixels == 0 || pixels > MAX_PIXELS || pixels > plausible {
        let message = format!("{what} of {} x {} pixels in a file of {file_bytes} bytes", window.size.0, window.size.1);
        return Err(Error::file(path, message, "the header is damaged, or the picture is larger than 2^28 pixels"));
    }
    Ok(())
}

/// A DWA chunk begins with eleven counters, which the exr crate takes at their word when it asks for memory.
pub(super) fn check_chunk(path: &Path, chunk: &Chunk, meta: &MetaData) -> Result<()> {
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

pub(super) fn zeroed(path: &Path, len: usize) -> Result<Vec<f32>> {
    bytemuck::allocation::try_zeroed_vec(len).map_err(|()| {
        Error::file(path, format!("needs {} MiB for one layer, more than there is", len >> 18), "read fewer layers")
    })
}

pub(super) fn explain(path: &Path, error: exr::error::Error) -> Error {
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
