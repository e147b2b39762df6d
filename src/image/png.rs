//! Writing one layer as an 8-bit sRGB PNG: what a screen shows without a view transform. Clips to [0, 1].

use super::{Layer, colour};
use crate::{Error, Result, atomic};
use rayon::prelude::*;
use std::io::Cursor;
use std::path::Path;

/// Writes a layer of one channel as grey, of three as colour, of four as colour with (unpremultiplied) alpha. Values
/// that are not finite become 0. Returns what the user should know (also logged).
pub fn write(path: &Path, layer: &Layer, width: usize) -> Result<Vec<String>> {
    let stride = layer.channels.len();
    let kind = match stride {
        1 => ::image::ColorType::L8,
        3 => ::image::ColorType::Rgb8,
        4 => ::image::ColorType::Rgba8,
        _ => {
            let message = format!("layer \"{}\" has {stride} channels; PNG takes 1, 3 or 4", layer.title());
            return Err(Error::output(path, message, "write it as EXR, or name another layer"));
        }
    };
    let pixels = layer.data.len() / stride;
    let failed = |message: String| Error::output(path, message, "check the size of the picture");
    if width == 0 || pixels == 0 || !pixels.is_multiple_of(width) {
        return Err(failed(format!("layer \"{}\" holds {pixels} pixels in rows of {width}", layer.title())));
    }
    let mut bytes = vec![0u8; layer.data.len()];
    bytes.par_chunks_mut(stride).zip(layer.data.par_chunks(stride)).for_each(|(out, pixel)| encode(pixel, out));
    let side = |length: usize| u32::try_from(length).map_err(|_| failed(format!("{length} pixels are too many")));
    let mut file = Cursor::new(Vec::new());
    let (width, height) = (side(width)?, side(pixels / width)?);
    ::image::write_buffer_with_format(&mut file, &bytes, width, height, kind, ::image::ImageFormat::Png)
        .map_err(|error| failed(error.to_string()))?;
    atomic::write(path, file.get_ref())?;
    let not_finite = layer.data.par_iter().filter(|value| !value.is_finite()).count();
    if not_finite == 0 {
        return Ok(Vec::new());
    }
    let warning = format!(
        "{}: layer \"{}\": {not_finite} values are NaN or infinite; written as 0",
        path.display(),
        layer.title()
    );
    Ok(vec![warning])
}

fn encode(pixel: &[f32], out: &mut [u8]) {
    let finite = |value: f32| if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.0 };
    let byte = |value: f32| (value * 255.0 + 0.5) as u8;
    let alpha = pixel.get(3).map_or(1.0, |&alpha| finite(alpha));
    for (out, &value) in out.iter_mut().zip(pixel).take(3) {
        let straight = if alpha > 0.0 && value.is_finite() { value / alpha } else { 0.0 };
        *out = byte(colour::srgb_from_linear(finite(straight)));
    }
    if let Some(out) = out.get_mut(3) {
        *out = byte(alpha);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_by_hand() {
        let mut out = [0; 4];
        encode(&[0.215_861, 2.0, -1.0, 1.0], &mut out);
        assert_eq!(out, [128, 255, 0, 255]);
        encode(&[0.5, f32::NAN, f32::INFINITY, 0.5], &mut out);
        assert_eq!(out, [255, 0, 0, 128]);
        encode(&[0.5, 0.0, 0.0, 0.0], &mut out);
        assert_eq!(out, [0, 0, 0, 0]);
        let mut grey = [0];
        encode(&[1.0], &mut grey);
        assert_eq!(grey, [255]);
    }
}
