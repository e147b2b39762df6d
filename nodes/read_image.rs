//! Reads a picture: a renderer's plate, a matte, a texture.

use crate::Result;
use crate::image::load;
use crate::node::{Info, Inputs, Job, Node, Port, frame_path};
use crate::value::{Kind, Value};
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
        let not_finite = |layer: &crate::image::Layer| layer.data.iter().filter(|value| !value.is_finite()).count();
        for (layer, count) in
            image.layers.iter().map(|layer| (layer, not_finite(layer))).filter(|(_, count)| *count > 0)
        {
            let (path, layer) = (path.display(), layer.title());
            job.warn(format!("{path}: layer \"{layer}\": {count} values are NaN or infinite"));
            job.note(&format!("not finite in {layer}"), count);
        }
        let names: Vec<&str> = image.layers.iter().map(|layer| layer.title()).collect();
        job.note("layers", names);
        job.note("size", vec![image.width, image.height]);
        Ok(vec![Value::Image(Arc::new(image))])
    }
}
