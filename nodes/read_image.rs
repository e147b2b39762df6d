//! Reads a picture: a renderer's plate, a matte, a texture.

use crate::image::not_finite::{self, NotFinite};
use crate::image::{ColourSpace, load};
use crate::node::{Info, Inputs, Job, Node, Port, frame_path};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReadImage {
    /// EXR, HDR, PNG or JPEG; `####`, `%04d` and `$F4` are the frame. 8 and 16 bit values are taken as sRGB.
    pub file: String,
    /// Read only this layer, which becomes the beauty; leading parts may be left out (`Diffuse Color` for
    /// `ViewLayer.Diffuse Color`). Empty: all layers, under their own names.
    pub layer: String,
    /// What its colours are. Absent: as the file's header says, linear Rec.709 where it says nothing.
    pub colour_space: Option<ColourSpace>,
    /// What becomes of values that are NaN or infinite.
    pub not_finite: NotFinite,
}

impl Node for ReadImage {
    const INFO: Info = Info {
        name: "read_image",
        category: "image",
        summary: "Reads a picture, or one layer of it",
        outputs: &[Port::new("image", Kind::Image, "All layers, or the one asked for as the beauty")],
        uses_frame: true,
        ..Info::NEW
    };

    fn files(&self) -> Vec<String> {
        vec![self.file.clone()]
    }

    fn uses_frame(&self, _base: &Path) -> bool {
        frame_path(&self.file, 0.0) != self.file
    }

    fn run(&self, _: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let path = job.path(&frame_path(&self.file, job.frame));
        let wanted = [self.layer.as_str()];
        let mut image = load::load(&path, (!self.layer.is_empty()).then_some(&wanted))?;
        if !self.layer.is_empty() {
            image.layers[0].name = String::new();
        }
        image.colour_space = self.colour_space.unwrap_or(image.colour_space);
        let found = self.not_finite.apply(&mut image).map_err(|found| Error::file(&path, found, not_finite::HELP))?;
        for found in found {
            job.note(&format!("not finite in {}", found.layer), found.count);
            job.warn(format!("{}: {found}", path.display()));
        }
        let names: Vec<&str> = image.layers.iter().map(|layer| layer.title()).collect();
        job.note("layers", names);
        job.note("size", vec![image.width, image.height]);
        job.note("colour_space", image.colour_space.id());
        Ok(vec![Value::Image(Arc::new(image))])
    }
}
