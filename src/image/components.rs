//! The kinds of light that a renderer keeps apart in its plates, found by the names that renderers give them.
//!
//! | light | Blender | Arnold | Karma, RenderMan | chiaro |
//! |---|---|---|---|---|
//! | direct | `Diffuse Direct` | `diffuse_direct` | `directdiffuse` | `direct` |
//! | indirect | `Diffuse Indirect` | `diffuse_indirect` | `indirectdiffuse` | `indirect` |
//!
//! Blender's are without surface colour: radiance = pass x `Diffuse Color`. Those of the others are radiance.

use super::{Image, Layer, names};
use crate::{Error, Result};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The part of a picture's light that a layer holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    Direct,
    Indirect,
}

impl Part {
    pub const ALL: [Self; 2] = [Self::Direct, Self::Indirect];

    /// The layer of chiaro's own pictures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Indirect => "indirect",
        }
    }

    /// Without case, blanks and underscores.
    fn known_as(self) -> [&'static str; 4] {
        match self {
            Self::Direct => ["direct", "diffusedirect", "directdiffuse", "diffdir"],
            Self::Indirect => ["indirect", "diffuseindirect", "indirectdiffuse", "diffind"],
        }
    }
}

/// Blender's passes of light are without surface colour, which these are.
const COLOUR: [&str; 2] = ["diffusecolor", "diffcol"];
const COLOURLESS: [&str; 4] = ["diffusedirect", "diffuseindirect", "diffdir", "diffind"];

/// How one light of a plate is called.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Named {
    pub light: Part,
    /// The layer that holds it.
    pub layer: String,
    /// The layer that it is to be multiplied by to be radiance. Empty: it is radiance.
    #[serde(default)]
    pub colour: String,
}

/// One light of a picture: numbers of its layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Component {
    pub light: Part,
    pub layer: usize,
    pub colour: Option<usize>,
}

/// The lights that the picture's layers are known to hold, at most one of each kind.
pub fn known(image: &Image) -> Vec<Component> {
    let home = image.place("").map_or("", |beauty| names::split(&image.layers[beauty].name).0);
    // Layers of the beauty's own view layer before those of others.
    let bare = |layer: &Layer| names::bare(names::split(&layer.name).1);
    let find = |known: &[&str]| {
        let is = |layer: &&Layer| known.contains(&bare(layer).as_str()) && layer.rgb().is_some();
        let mut found: Vec<&Layer> = image.layers.iter().filter(is).collect();
        found.sort_by_key(|layer| names::split(&layer.name).0 != home);
        let first = *found.first()?;
        image.layers.iter().position(|layer| std::ptr::eq(layer, first))
    };
    let colour = find(&COLOUR);
    let component = |part: &Part| {
        let layer = find(&part.known_as())?;
        let is_without = COLOURLESS.contains(&bare(&image.layers[layer]).as_str());
        Some(Component { light: *part, layer, colour: colour.filter(|_| is_without) })
    };
    Part::ALL.iter().filter_map(component).collect()
}

/// The lights that the user names.
///
/// # Errors
/// `Compute` for a layer that is not there, or has no red, green and blue; a light that is named twice.
pub fn named(image: &Image, list: &[Named]) -> Result<Vec<Component>> {
    let mut found: Vec<Component> = Vec::new();
    for Named { light, layer, colour } in list {
        if found.iter().any(|other| other.light == *light) {
            let message = format!("components: \"{}\" is named twice", light.name());
            return Err(Error::compute(message, "name each light once"));
        }
        let colour = if colour.is_empty() { None } else { Some(coloured(image, colour)?) };
        let place = coloured(image, layer)?;
        if found.iter().any(|other| other.layer == place) {
            let message = format!("components: layer \"{layer}\" is named for two lights");
            return Err(Error::compute(message, "name each layer once"));
        }
        found.push(Component { light: *light, layer: place, colour });
    }
    Ok(found)
}

/// The number of a layer of red, green and blue.
///
/// # Errors
/// `Compute` for a layer that is not there, or that has other channels.
pub fn coloured(image: &Image, name: &str) -> Result<usize> {
    let place = image.place(name).map_err(|e| Error::compute(e.message, e.help))?;
    image.layers[place].need_rgb().map(|_| place)
}

/// The colour of one pixel of a layer; `rgb` says where it is.
pub fn colour_at(layer: &Layer, rgb: [usize; 3], pixel: usize) -> Vec3 {
    let first = pixel * layer.channels.len();
    Vec3::from(rgb.map(|channel| layer.data[first + channel]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Content;

    fn image(layers: &[&str]) -> Image {
        let layer = |name: &&str| Layer::new(name, &["R", "G", "B"], Content::Colour, vec![0.5; 3]);
        Image { width: 1, height: 1, layers: layers.iter().map(layer).collect(), ..Image::default() }
    }

    fn found(layers: &[&str]) -> Vec<(Part, usize, Option<usize>)> {
        known(&image(layers)).iter().map(|c| (c.light, c.layer, c.colour)).collect()
    }

    #[test]
    fn lights_are_found_by_the_names_that_renderers_give_them() {
        let (direct, indirect) = (Part::Direct, Part::Indirect);
        assert_eq!(found(&["", "direct", "indirect", "albedo"]), [(direct, 1, None), (indirect, 2, None)]);
        let blender = ["V.Combined", "V.Diffuse Direct", "V.Diffuse Indirect", "V.Diffuse Color"];
        assert_eq!(found(&blender), [(direct, 1, Some(3)), (indirect, 2, Some(3))]);
        assert_eq!(found(&["", "Diffuse_Indirect", "Diffuse_Color"]), [(indirect, 1, Some(2))]);
        let arnold = ["RGBA", "diffuse_direct", "diffuse_indirect", "diffuse_albedo"];
        assert_eq!(found(&arnold), [(direct, 1, None), (indirect, 2, None)]);
        let karma = ["C", "directdiffuse", "diffuse_color"];
        assert_eq!(found(&karma), [(direct, 1, None)], "radiance, whatever else there is");
        assert_eq!(found(&["", "indirectDiffuse", "directDiffuse"]), [(direct, 2, None), (indirect, 1, None)]);
        assert_eq!(found(&["", "specular"]), []);
        let two = ["A.Diffuse Direct", "B.Combined", "B.Diffuse Direct"];
        assert_eq!(found(&two), [(direct, 2, None)], "of the view layer that has the beauty");
    }

    #[test]
    fn lights_are_named_once_and_must_be_there() {
        let image = image(&["", "rawLight", "diffuseFilter"]);
        let one = |layer: &str| Named { light: Part::Direct, layer: layer.into(), colour: "diffuseFilter".into() };
        let expected = Component { light: Part::Direct, layer: 1, colour: Some(2) };
        assert_eq!(named(&image, &[one("rawLight")]).unwrap(), [expected]);
        assert!(named(&image, &[one("rawLight"), one("rawLight")]).is_err());
        assert!(named(&image, &[one("rawLihgt")]).unwrap_err().to_string().contains("rawLihgt"));
    }
}
