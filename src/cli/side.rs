//! A layer of a picture, as the command line names it.

use crate::image::{Image, Layer, load};
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Smallest part of a pixel that an object must cover to be the only one that it shows.
pub const WHOLE: f32 = 0.99;

/// `FILE[:LAYER]`.
pub struct Side {
    pub path: PathBuf,
    pub layer: Option<String>,
}

impl Side {
    /// A colon parts file from layer only behind the extension of a picture, so that `C:\a.exr` is a file.
    pub fn parse(text: &str) -> Self {
        let whole = Self { path: text.into(), layer: None };
        if whole.path.is_file() {
            return whole;
        }
        let is_picture = |file: &str| load::EXTENSIONS.contains(&load::extension(Path::new(file)).as_str());
        let parts = text.match_indices(':').map(|(at, _)| (&text[..at], &text[at + 1..]));
        match parts.into_iter().find(|(file, _)| is_picture(file)) {
            Some((file, layer)) => Self { path: file.into(), layer: Some(layer.to_owned()) },
            None => whole,
        }
    }

    /// The layer `name`, multiplied by others of the file, and a picture of its size.
    ///
    /// # Errors
    /// `File` when the file or a layer is missing, `Usage` when layers have no channel in common.
    pub fn read(&self, name: &str, factors: &[String]) -> Result<(Layer, Image)> {
        let layers: Vec<&str> = std::iter::once(name).chain(factors.iter().map(String::as_str)).collect();
        let image = load::load(&self.path, Some(&layers))?;
        let find = |name: &str| image.find(name).map_err(|e| Error::file(&self.path, e.message, e.help));
        let mut layer = find(name)?.clone();
        for factor in factors {
            layer = multiply(&layer, find(factor)?)?;
        }
        Ok((layer, image))
    }
}

/// Channel by channel of the same name; a channel that the factor lacks stays as it is.
fn multiply(layer: &Layer, factor: &Layer) -> Result<Layer> {
    let places: Vec<Option<usize>> = layer.channels.iter().map(|channel| factor.channel(channel)).collect();
    if places.iter().all(Option::is_none) {
        let (name, other) = (layer.title(), factor.title());
        return Err(Error::usage(format!("--times: \"{name}\" and \"{other}\" have no channel in common"), ""));
    }
    let mut data = layer.data.to_vec();
    let factors = factor.data.chunks(factor.channels.len());
    for (pixel, factor) in data.chunks_mut(places.len()).zip(factors) {
        pixel.iter_mut().zip(&places).for_each(|(value, place)| *value *= place.map_or(1.0, |at| factor[at]));
    }
    Ok(layer.with_data(data))
}
