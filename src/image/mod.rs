//! Pictures: named layers of equal size, how they are read, written and compared.

pub mod colour;
mod colour_space;
pub mod compare;
pub mod components;
pub mod cryptomatte;
pub mod exr_read;
pub mod exr_write;
pub mod load;
pub mod names;
pub mod not_finite;
mod plain;
pub mod png;
mod stored;
pub mod view_transform;

pub use colour_space::ColourSpace;

use crate::device::Array;
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;

/// Pixels that one task works on.
const BLOCK: usize = 4096;

/// What the numbers of a layer are; colour may be stored as half, data (positions, depth, ids) never.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    Colour,
    Data,
}

/// One named layer: `channels.len()` interleaved f32 values a pixel, row-major, first row at the top.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Empty for the beauty; `indirect`, `P`, ... otherwise.
    pub name: String,
    /// `["R", "G", "B"]`, `["R", "G", "B", "A"]`, `["X", "Y", "Z"]`, `["Z"]`, ...
    pub channels: Vec<String>,
    pub content: Content,
    pub data: Array<f32>,
}

impl Layer {
    pub fn new(name: &str, channels: &[&str], content: Content, data: Vec<f32>) -> Self {
        let channels = channels.iter().map(|&channel| channel.to_owned()).collect();
        Self { name: name.to_owned(), channels, content, data: data.into() }
    }

    /// The same layer with other numbers.
    pub fn with_data(&self, data: Vec<f32>) -> Self {
        Self { name: self.name.clone(), channels: self.channels.clone(), content: self.content, data: data.into() }
    }

    /// The same layer with other colours; `rgb` says where they are (see `rgb`).
    pub fn map_rgb(&self, rgb: [usize; 3], change: impl Fn(Vec3) -> Vec3 + Sync) -> Self {
        let stride = self.channels.len();
        let mut data = self.data.to_vec();
        data.par_chunks_mut(stride * BLOCK).for_each(|pixels| {
            for pixel in pixels.chunks_exact_mut(stride) {
                let changed = change(Vec3::from(rgb.map(|at| pixel[at]))).to_array();
                rgb.iter().zip(changed).for_each(|(at, value)| pixel[*at] = value);
            }
        });
        self.with_data(data)
    }

    /// How the layer is called in messages: the beauty has no name of its own.
    pub fn title(&self) -> &str {
        names::title(&self.name)
    }

    /// Position of a channel within a pixel.
    pub fn channel(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|channel| channel == name)
    }

    /// Positions of red, green and blue, where the layer has all three.
    pub fn rgb(&self) -> Option<[usize; 3]> {
        Some([self.channel("R")?, self.channel("G")?, self.channel("B")?])
    }

    /// As `rgb`.
    ///
    /// # Errors
    /// `Compute` for a layer that has other channels.
    pub fn need_rgb(&self) -> Result<[usize; 3]> {
        self.rgb().ok_or_else(|| {
            let message = format!("layer \"{}\" has {}, not R G B", self.title(), self.channels.join(" "));
            Error::compute(message, "name a colour layer")
        })
    }
}

/// Scene-linear f32.
#[derive(Clone, Debug, Default)]
pub struct Image {
    pub width: usize,
    pub height: usize,
    pub layers: Vec<Layer>,
    /// Of all layers of colour.
    pub colour_space: ColourSpace,
    /// Header text that travels with the picture, by name.
    pub metadata: Vec<(String, String)>,
}

impl Image {
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|layer| layer.name == name)
    }

    /// The layer of that name, with or without its leading `ViewLayer.`; the error names the layers there are.
    pub fn find(&self, name: &str) -> std::result::Result<&Layer, names::NotFound> {
        Ok(&self.layers[self.place(name)?])
    }

    /// The number of the layer of that name; see `find`.
    pub fn place(&self, name: &str) -> std::result::Result<usize, names::NotFound> {
        let names: Vec<&str> = self.layers.iter().map(|layer| layer.name.as_str()).collect();
        names::find(&names, name)
    }

    /// The same colours in another space; layers of data, and of less than red, green and blue, stay as they are.
    pub fn to_space(&self, space: ColourSpace) -> Self {
        if space == self.colour_space {
            return self.clone();
        }
        let matrix = self.colour_space.to(space);
        let convert = |layer: &Layer| match layer.rgb() {
            Some(rgb) if layer.content == Content::Colour => layer.map_rgb(rgb, |colour| matrix * colour),
            _ => layer.clone(),
        };
        Self { layers: self.layers.iter().map(convert).collect(), colour_space: space, ..self.clone() }
    }

    pub fn bytes(&self) -> u64 {
        self.layers.iter().map(|layer| 4 * layer.data.len() as u64).sum()
    }
}
