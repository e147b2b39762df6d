//! Pictures: named layers of equal size, how they are read, written and compared.

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

    pub fn bytes(&self) -> u64 {
        self.layers.iter().map(|layer| 4 * layer.data.len() as u64).sum()
    }
}
