//! Small pictures of values, for nodes.

use super::display::{self, Display};
use super::shown::map;
use crate::image::{Content, Image, Layer};
use crate::transport::Samples;
use crate::value::Value;

#[derive(Clone, Debug, PartialEq)]
pub struct Thumb {
    pub width: usize,
    pub height: usize,
    /// RGBA, row by row.
    pub pixels: Vec<[u8; 4]>,
}

/// Pixels across and down that a thumb has at most.
const SIZE: [usize; 2] = [120, 72];

/// `None` for values that are no pictures.
pub fn thumb(value: &Value) -> Option<Thumb> {
    let image = match value {
        Value::Image(image) => {
            let layer = image.layer("").or(image.layers.first())?;
            small(layer.data.as_ref(), layer, image.width, image.height)
        }
        Value::Ratio(ratio) => {
            let like = Layer::new("", &["R", "G", "B", "A"], Content::Colour, Vec::new());
            small(bytemuck::cast_slice(&ratio.values), &like, ratio.width, ratio.height)
        }
        Value::Samples(samples) => normals(samples),
        Value::Environment(environment) => map(environment, SIZE[0]),
        _ => return None,
    };
    let display = Display { layer: image.layers[0].name.clone(), ..Display::default() };
    let pixels = display::pixels(&image, &display)?;
    Some(Thumb { width: image.width, height: image.height, pixels })
}

/// Width and height that fit, and pixels of the picture to one of the thumb.
fn fit(width: usize, height: usize) -> (usize, usize, f64) {
    let step = (width as f64 / SIZE[0] as f64).max(height as f64 / SIZE[1] as f64).max(1.0);
    let fitted = |n: usize| ((n as f64 / step) as usize).max(1);
    (fitted(width), fitted(height), step)
}

/// One pixel of each block: cheap, and what is a thumb's pixel is a pixel of the picture.
fn small(data: &[f32], like: &Layer, width: usize, height: usize) -> Image {
    let (w, h, step) = fit(width, height);
    let stride = like.channels.len();
    let at = |i: usize, n: usize| (((i as f64 + 0.5) * step) as usize).min(n - 1);
    let pixels = (0..w * h).flat_map(|i| {
        let from = (at(i / w, height) * width + at(i % w, width)) * stride;
        data[from..from + stride].iter().copied()
    });
    let layer = like.with_data(pixels.collect());
    Image { width: w, height: h, layers: vec![layer], ..Image::default() }
}

fn normals(samples: &Samples) -> Image {
    let (w, h, step) = fit(samples.width, samples.height);
    let pixels = (0..w * h).flat_map(|i| {
        let at = |i: usize, n: usize| (((i as f64 + 0.5) * step) as usize).min(n - 1);
        let pixel = at(i / w, samples.height) * samples.width + at(i % w, samples.width);
        let point = &samples.points[pixel * samples.per_pixel()];
        point.normal.map(|x| if point.exists() { 0.5 + 0.5 * x } else { 0.0 })
    });
    let layer = Layer::new("", &["R", "G", "B"], Content::Colour, pixels.collect());
    Image { width: w, height: h, layers: vec![layer], ..Image::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn a_thumb_is_small_and_keeps_the_shape() {
        let data = (0..640 * 480).flat_map(|i| [if i % 640 < 320 { 1.0 } else { 0.0 }, 0.0, 0.0]).collect();
        let layers = vec![Layer::new("", &["R", "G", "B"], Content::Colour, data)];
        let image = Image { width: 640, height: 480, layers, ..Image::default() };
        let thumb = thumb(&Value::Image(Arc::new(image))).unwrap();
        assert_eq!((thumb.width, thumb.height), (96, 72));
        assert_eq!((thumb.pixels[0], thumb.pixels[95]), ([255, 0, 0, 255], [0, 0, 0, 255]));
        assert_eq!(fit(10, 1000), (1, 72, 1000.0 / 72.0));
        assert_eq!(fit(3, 3), (3, 3, 1.0));
    }
}
