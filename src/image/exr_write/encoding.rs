//! How the numbers of a picture are stored: half or float, layer by layer, and how they are packed.

use crate::image::{Image, Layer, cryptomatte};
use crate::{Error, Result, names};
use indexmap::IndexMap;

/// How colour is stored; data (positions, depth, ids) is always float.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Depth {
    /// 16 bits, three decimal digits, up to 65504; a colour layer that goes above it is stored as float.
    #[default]
    Half,
    /// 32 bits.
    Float,
}

/// How the pixels are packed; all of these keep every bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Compression {
    /// As they are.
    None,
    /// Runs of equal bytes.
    Rle,
    /// Deflate over one line: quick for programs that read line by line.
    Zips,
    /// Deflate over 16 lines.
    #[default]
    Zip,
    /// Wavelets: smallest for noisy pictures.
    Piz,
}

impl Compression {
    pub(super) fn of_file(self) -> exr::meta::attribute::Compression {
        use exr::meta::attribute::Compression as File;
        match self {
            Self::None => File::Uncompressed,
            Self::Rle => File::RLE,
            Self::Zips => File::ZIP1,
            Self::Zip => File::ZIP16,
            Self::Piz => File::PIZ,
        }
    }
}

/// How a picture is stored.
#[derive(Clone, Debug, Default)]
pub struct Encoding {
    pub depth: Depth,
    /// Depth of layers whose titles match a pattern, the last one deciding; data that is named may be half, too.
    pub layers: IndexMap<String, Depth>,
    pub compression: Compression,
}

impl From<Depth> for Encoding {
    fn from(depth: Depth) -> Self {
        Self { depth, ..Self::default() }
    }
}

impl Encoding {
    /// Of each layer what is wished for; `None` where nothing is wished but the picture's own depth.
    pub(super) fn wishes(&self, image: &Image) -> Result<Vec<Option<Depth>>> {
        let titles: Vec<&str> = image.layers.iter().map(Layer::title).collect();
        let mut wishes = vec![None; titles.len()];
        for (pattern, depth) in &self.layers {
            let chosen = names::chosen("layer", std::slice::from_ref(pattern), &titles)?;
            for (at, _) in chosen.iter().enumerate().filter(|(_, chosen)| **chosen) {
                if *depth == Depth::Half && cryptomatte::matte_of(&image.layers[at].name).is_some() {
                    let message = format!("layer \"{}\" holds ids, which half cannot", titles[at]);
                    return Err(Error::compute(message, "leave Cryptomatte layers at float"));
                }
                wishes[at] = Some(*depth);
            }
        }
        Ok(wishes)
    }
}
