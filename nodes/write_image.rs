//! Writes a picture: layered EXR, or one layer as PNG.

use crate::image::exr_write::{self, Compression, Depth, Encoding};
use crate::image::not_finite::{self, NotFinite};
use crate::image::{ColourSpace, Image, load, png};
use crate::node::{Info, Inputs, Job, Node, Port, frame_path};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// All layers; linear.
    Exr,
    /// One layer, 8 bits, sRGB, clipped to [0, 1].
    Png,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Names {
    /// Letters, digits and underscores; `ViewLayer.Diffuse Direct` is `Diffuse_Direct`, the beauty is `R G B A`.
    #[default]
    Plain,
    /// As they were read.
    AsRead,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WriteImage {
    /// `####`, `%04d` and `$F4` are the frame. Folders that are missing are made.
    pub file: String,
    /// Layers to write, `beauty` for the beauty. Empty: all of them into EXR, the beauty into PNG.
    pub layers: Vec<String>,
    /// By the file's extension when absent.
    pub format: Option<Format>,
    /// How EXR stores colour; data such as positions and depth is float.
    pub depth: Depth,
    /// Depth of single layers, by patterns of their names as written: `{ "indirect": "float", "ratio_*": "half" }`.
    pub layer_depth: IndexMap<String, Depth>,
    /// How EXR packs pixels; all ways keep every bit.
    pub compression: Compression,
    /// How layers are called in the file.
    pub names: Names,
    /// What the colours in the file are. Absent: what those of the picture are. PNG is always sRGB.
    pub colour_space: Option<ColourSpace>,
    /// What becomes of values that are NaN or infinite.
    pub not_finite: NotFinite,
}

impl Node for WriteImage {
    const INFO: Info = Info {
        name: "write_image",
        category: "image",
        summary: "Writes a picture as layered EXR or as PNG",
        inputs: &[Port::new("image", Kind::Image, "What to write")],
        uses_frame: true,
        ..Info::NEW
    };

    fn output_files(&self, frame: f64) -> Vec<String> {
        vec![frame_path(&self.file, frame)]
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let path = job.output(&frame_path(&self.file, job.frame));
        let format = self.format_of(&path)?;
        let mut image = self.chosen(inputs.need_image("image")?, format)?;
        if self.not_finite != NotFinite::Pass {
            let found =
                self.not_finite.apply(&mut image).map_err(|found| Error::output(&path, found, not_finite::HELP))?;
            found.iter().for_each(|found| job.warn(format!("{found}; written as 0")));
        }
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            let help = "check that the folder can be made, or name another";
            std::fs::create_dir_all(folder).map_err(|error| Error::output(&path, error.to_string(), help))?;
        }
        let warnings = match format {
            Format::Exr => {
                let (recipe, key) = ((job.recipe)(), job.key.to_string());
                let header = [("chiaro:recipe", recipe.as_str()), ("chiaro:key", key.as_str())];
                let (depth, layers) = (self.depth, self.layer_depth.clone());
                let encoding = Encoding { depth, layers, compression: self.compression };
                exr_write::write(&path, &image, encoding, &header)?
            }
            Format::Png => match &image.layers[..] {
                [layer] => png::write(&path, layer, image.width)?,
                layers => {
                    let message = format!("PNG holds one layer, {} are named", layers.len());
                    return Err(Error::output(&path, message, "name one layer, or write EXR"));
                }
            },
        };
        job.note("file", path.to_string_lossy());
        job.note("layers", image.layers.iter().map(|layer| layer.title()).collect::<Vec<_>>());
        warnings.iter().for_each(|warning| job.warn(warning));
        Ok(Vec::new())
    }
}

impl WriteImage {
    fn format_of(&self, path: &Path) -> Result<Format> {
        match (self.format, load::extension(path).as_str()) {
            (Some(format), _) => Ok(format),
            (None, "exr") => Ok(Format::Exr),
            (None, "png") => Ok(Format::Png),
            (None, other) => {
                let message = format!("the format of \".{other}\" files is not known");
                Err(Error::output(path, message, "end the file in .exr or .png, or set format"))
            }
        }
    }

    /// The layers to write, as they are written.
    fn chosen(&self, image: &Image, format: Format) -> Result<Image> {
        let find = |name: &str| image.find(name).cloned().map_err(|e| Error::compute(e.message, e.help));
        let layers = if !self.layers.is_empty() {
            self.layers.iter().map(|name| find(name)).collect::<Result<_>>()?
        } else if format == Format::Png {
            vec![find("")?]
        } else {
            image.layers.clone()
        };
        let space = match format {
            Format::Exr => self.colour_space.unwrap_or(image.colour_space),
            Format::Png => ColourSpace::Rec709,
        };
        let image = Image { layers, ..image.clone() }.to_space(space);
        Ok(if self.names == Names::Plain { image.with_plain_names() } else { image })
    }
}
