//! Reading a picture of any kind that is read: OpenEXR by its own reader, Radiance HDR, PNG and JPEG by crate image.

use super::{Content, Image, Layer, colour, exr_read, names};
use crate::{Error, Result};
use std::io::Read;
use std::path::Path;

/// Extensions of pictures that are read, in lower case.
pub const EXTENSIONS: [&str; 5] = ["exr", "hdr", "png", "jpg", "jpeg"];

/// Reads all layers, or only those named (see `names::find`), in that order. Pictures other than EXR have one layer,
/// the beauty; 8 and 16 bit values are taken as sRGB and become linear, premultiplied by alpha.
pub fn load(path: &Path, wanted: Option<&[&str]>) -> Result<Image> {
    if is_exr(path)? {
        return match wanted {
            Some(layers) => exr_read::read_layers(path, layers),
            None => exr_read::read(path),
        };
    }
    for name in wanted.unwrap_or(&[]) {
        names::find(&[""], name).map_err(|e| Error::file(path, e.message, "only EXR files have named layers"))?;
    }
    let damaged = |e: ::image::ImageError| {
        Error::file(path, format!("not a picture that is read, or damaged: {e}"), "give an EXR, HDR, PNG or JPEG file")
    };
    let reader = ::image::ImageReader::open(path).map_err(|e| missing(path, e))?;
    let decoded = reader.with_guessed_format().map_err(|e| missing(path, e))?.decode().map_err(damaged)?;
    Ok(from_decoded(decoded))
}

/// By its first bytes, or its name.
///
/// # Errors
/// `File` for what cannot be read.
pub fn is_exr(path: &Path) -> Result<bool> {
    let mut magic = [0; 4];
    let mut file = std::fs::File::open(path).map_err(|e| missing(path, e))?;
    // A file shorter than 4 bytes is no EXR either; the reader says what it is.
    let found = file.read(&mut magic).map_err(|e| missing(path, e))?;
    Ok(magic[..found] == [0x76, 0x2f, 0x31, 0x01] || extension(path) == "exr")
}

/// Extension in lower case; empty when there is none.
pub fn extension(path: &Path) -> String {
    path.extension().map_or(String::new(), |ext| ext.to_string_lossy().to_ascii_lowercase())
}

fn missing(path: &Path, error: std::io::Error) -> Error {
    Error::file(path, error.to_string(), "check the path and its permissions")
}

fn from_decoded(decoded: ::image::DynamicImage) -> Image {
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let linear = matches!(decoded.color(), ::image::ColorType::Rgb32F | ::image::ColorType::Rgba32F);
    let has_alpha = decoded.color().has_alpha();
    let mut data = if has_alpha { decoded.into_rgba32f().into_raw() } else { decoded.into_rgb32f().into_raw() };
    let channels: &[&str] = if has_alpha { &["R", "G", "B", "A"] } else { &["R", "G", "B"] };
    if !linear {
        for pixel in data.chunks_mut(channels.len()) {
            let alpha = pixel.get(3).copied().unwrap_or(1.0);
            pixel[..3].iter_mut().for_each(|value| *value = colour::linear_from_srgb(*value) * alpha);
        }
    }
    let layer = Layer::new("", channels, Content::Colour, data);
    Image { width, height, layers: vec![layer], ..Image::default() }
}
