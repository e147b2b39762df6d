//! A picture in the disk cache.

use super::{ColourSpace, Content, Image, Layer};
use crate::stored::{SectionReader, SectionWriter, Stored};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Header {
    width: usize,
    height: usize,
    colour_space: ColourSpace,
    metadata: Vec<(String, String)>,
    /// Name, channels, whether it is colour.
    layers: Vec<(String, Vec<String>, bool)>,
}

impl Stored for Image {
    fn write<'a>(&'a self, sections: &mut SectionWriter<'a>) {
        let describe = |layer: &Layer| (layer.name.clone(), layer.channels.clone(), layer.content == Content::Colour);
        sections.value(&Header {
            width: self.width,
            height: self.height,
            colour_space: self.colour_space,
            metadata: self.metadata.clone(),
            layers: self.layers.iter().map(describe).collect(),
        });
        self.layers.iter().for_each(|layer| sections.slice(&layer.data));
    }

    fn read(sections: &mut SectionReader) -> Option<Self> {
        let Header { width, height, colour_space, metadata, layers } = sections.value()?;
        let pixels = width.checked_mul(height)?;
        let layers = layers.into_iter().map(|(name, channels, colour)| {
            let data: Vec<f32> = sections.vec()?;
            let content = if colour { Content::Colour } else { Content::Data };
            (data.len() == pixels * channels.len()).then(|| Layer { name, channels, content, data: data.into() })
        });
        Some(Self { width, height, layers: layers.collect::<Option<_>>()?, colour_space, metadata })
    }
}
