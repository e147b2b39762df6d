//! Pictures: named layers of equal size, how they are read, written and compared.

pub mod colour;
pub mod compare;
pub mod cryptomatte;
pub mod exr_read;
pub mod exr_write;
pub mod load;
pub mod names;
pub mod png;
mod stored;

use crate::device::Array;

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
}

/// Scene-linear f32, Rec.709 primaries.
#[derive(Clone, Debug, Default)]
pub struct Image {
    pub width: usize,
    pub height: usize,
    pub layers: Vec<Layer>,
    /// Header text that travels with the picture, by name.
    pub metadata: Vec<(String, String)>,
}

impl Image {
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|layer| layer.name == name)
    }

    /// The layer of that name, with or without its leading `ViewLayer.`; the error names the layers there are.
    pub fn find(&self, name: &str) -> Result<&Layer, names::NotFound> {
        let names: Vec<&str> = self.layers.iter().map(|layer| layer.name.as_str()).collect();
        Ok(&self.layers[names::find(&names, name)?])
    }

    pub fn bytes(&self) -> u64 {
        self.layers.iter().map(|layer| 4 * layer.data.len() as u64).sum()
    }
}
