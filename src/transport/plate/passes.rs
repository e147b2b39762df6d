//! Position and normal passes of a plate, in our axes.

use crate::image::cryptomatte::Cryptomatte;
use crate::image::{Image, Layer, names};
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which axis points up in the plate's world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// glTF, Maya, Houdini, Karma, Arnold.
    #[default]
    Y,
    /// Blender, 3ds Max.
    Z,
}

impl UpAxis {
    pub fn other(self) -> Self {
        match self {
            Self::Y => Self::Z,
            Self::Z => Self::Y,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// To glTF's axes.
    pub fn to_ours(self, v: Vec3) -> Vec3 {
        match self {
            Self::Y => v,
            Self::Z => Vec3::new(v.x, v.z, -v.y),
        }
    }
}

/// What a plate says of the surfaces that it shows; one entry a pixel.
pub struct Passes {
    pub width: usize,
    pub height: usize,
    /// World, metres; averages over the pixel.
    pub positions: Vec<Vec3>,
    /// Averages over the pixel: unit length where it shows one plane, shorter where it shows several, zero for nothing.
    pub normals: Vec<Vec3>,
    /// Pixels whose position or normal is not finite; they are taken as nothing.
    pub not_finite: usize,
}

/// Averages of normals shorter than this are of nothing.
const NOTHING: f32 = 0.02;

impl Passes {
    /// Empty names: those that renderers give. `scale`: metres to the plate's unit.
    ///
    /// # Errors
    /// `Compute` for layers that are not there, or have less than three channels.
    pub fn read(image: &Image, position: &str, normal: &str, up: UpAxis, scale: f32) -> Result<Self> {
        let positions = vectors(find(image, position, &names::POSITION, "position_layer")?)?;
        let normals = vectors(find(image, normal, &names::NORMAL, "normal_layer")?)?;
        let pairs = positions.into_par_iter().zip(normals);
        let pairs: Vec<(Vec3, Vec3, bool)> = pairs
            .map(|(position, normal)| {
                let finite = position.is_finite() && normal.is_finite();
                if !finite || normal.length() < NOTHING {
                    return (Vec3::ZERO, Vec3::ZERO, finite);
                }
                (up.to_ours(position) * scale, up.to_ours(normal), true)
            })
            .collect();
        let not_finite = pairs.iter().filter(|(.., finite)| !finite).count();
        let positions = pairs.iter().map(|(position, ..)| *position).collect();
        let normals = pairs.iter().map(|(_, normal, _)| *normal).collect();
        Ok(Self { width: image.width, height: image.height, positions, normals, not_finite })
    }

    pub fn exists(&self, pixel: usize) -> bool {
        self.normals[pixel] != Vec3::ZERO
    }
}

/// The object or material that covers most of each pixel, as numbers from 0 in the order of their ids; all 0 where the
/// plate has no such Cryptomatte.
pub fn indices(image: &Image, matte: &str) -> Vec<u32> {
    let pixels = image.width * image.height;
    let Ok(matte) = Cryptomatte::of(image, matte) else { return vec![0; pixels] };
    let ids: Vec<u32> = (0..pixels).map(|pixel| matte.first(pixel).0).collect();
    let mut distinct = ids.clone();
    distinct.sort_unstable();
    distinct.dedup();
    ids.iter().map(|id| distinct.binary_search(id).expect("it is among them") as u32).collect()
}

fn find<'a>(image: &'a Image, name: &str, known: &[&str], parameter: &str) -> Result<&'a Layer> {
    if !name.is_empty() {
        return image.find(name).map_err(|e| Error::compute(format!("{parameter}: {}", e.message), e.help));
    }
    let is = |layer: &&Layer| known.contains(&names::bare(names::split(&layer.name).1).as_str());
    image.layers.iter().find(is).ok_or_else(|| {
        let list = image.layers.iter().map(Layer::title).collect::<Vec<_>>().join(", ");
        let message = format!("no layer is called {}; found {list}", known[..2].join(" or "));
        Error::compute(message, format!("name the layer with {parameter}, or render the plate with that pass"))
    })
}

fn vectors(layer: &Layer) -> Result<Vec<Vec3>> {
    let xyz = || Some([layer.channel("X")?, layer.channel("Y")?, layer.channel("Z")?]);
    let Some(at) = xyz().or_else(|| layer.rgb()) else {
        let message = format!("layer \"{}\" has {}, not X Y Z", layer.title(), layer.channels.join(" "));
        return Err(Error::compute(message, "name a layer of vectors"));
    };
    let pixels = layer.data.par_chunks_exact(layer.channels.len());
    Ok(pixels.map(|pixel| Vec3::from(at.map(|channel| pixel[channel]))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Content;

    #[test]
    fn passes_by_hand() {
        let xyz = ["X", "Y", "Z"];
        let layers = vec![
            Layer::new("V.Position", &xyz, Content::Data, vec![1.0, 2.0, 3.0, 9.0, 9.0, 9.0, f32::NAN, 0.0, 0.0]),
            Layer::new("V.Normal", &["R", "G", "B"], Content::Data, vec![0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        ];
        let image = Image { width: 3, height: 1, layers, ..Image::default() };
        let passes = Passes::read(&image, "", "", UpAxis::Z, 0.5).unwrap();
        assert_eq!(passes.positions, [Vec3::new(0.5, 1.5, -1.0), Vec3::ZERO, Vec3::ZERO]);
        assert_eq!(passes.normals, [Vec3::new(0.0, 0.5, 0.0), Vec3::ZERO, Vec3::ZERO]);
        assert_eq!((passes.not_finite, passes.exists(0), passes.exists(1)), (1, true, false));
        let ours = Passes::read(&image, "Position", "V.Normal", UpAxis::Y, 1.0).unwrap();
        assert_eq!(ours.positions[0], Vec3::new(1.0, 2.0, 3.0));
        let error = Passes::read(&image, "Positon", "", UpAxis::Y, 1.0).err().unwrap();
        assert!(error.to_string().contains("position_layer") && error.help().contains("V.Position"), "{error}");
        let error = Passes::read(&Image::default(), "", "", UpAxis::Y, 1.0).err().unwrap();
        assert!(error.to_string().contains("p or position"), "{error}");
        assert_eq!(indices(&image, "CryptoObject"), [0; 3]);
    }
}
