//! Writes a picture: layered EXR, or one layer as PNG.

use crate::image::exr_write::{self, Depth};
use crate::image::{Image, load, png};
use crate::node::{Info, Inputs, Job, Node, Port, frame_path};
use crate::value::{Kind, Value};
use crate::{Error, Result};
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

#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WriteImage {
    /// `####`, `%04d` and `$F4` are the frame. Folders that are missing are made.
    pub file: String,
    /// Layers to write, `beauty` for the beauty. Empty: all of them into EXR, the beauty into PNG.
    pub layers: Vec<String>,
    /// By the file's extension when absent.
    pub format: Option<Format>,
    /// How EXR stores colour; data such as positions and depth is always float.
    pub depth: Depth,
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
        let image = self.chosen(inputs.need_image("image")?, &path)?;
        let format = self.format_of(&path)?;
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            let help = "check that the folder can be made, or name another";
            std::fs::create_dir_all(folder).map_err(|error| Error::output(&path, error.to_string(), help))?;
        }
        let warnings = match format {
            Format::Exr => {
                let (recipe, key) = ((job.recipe)(), job.key.to_string());
                let header = [("chiaro:recipe", recipe.as_str()), ("chiaro:key", key.as_str())];
                exr_write::write(&path, &image, self.depth, &header)?
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

    /// The layers to write.
    fn chosen(&self, image: &Image, path: &Path) -> Result<Image> {
        let find = |name: &str| image.find(name).cloned().map_err(|e| Error::compute(e.message, e.help));
        let layers = if !self.layers.is_empty() {
            self.layers.iter().map(|name| find(name)).collect::<Result<_>>()?
        } else if self.format_of(path)? == Format::Png {
            vec![find("")?]
        } else {
            image.layers.clone()
        };
        Ok(Image { width: image.width, height: image.height, layers, metadata: image.metadata.clone() })
    }
}
