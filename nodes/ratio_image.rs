//! A ratio as a layer of a picture, for programs that multiply.

use super::merge::same_size;
use crate::image::{Content, Image, Layer};
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The layer is called `ratio_NAME`; a plate times it is the plate with the shadow, or with the change. Stored as float.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RatioImage {
    /// Letters, digits and underscores.
    pub name: String,
}

impl Default for RatioImage {
    fn default() -> Self {
        Self { name: "shadow".to_owned() }
    }
}

impl Node for RatioImage {
    const INFO: Info = Info {
        name: "ratio_image",
        category: "image",
        summary: "Puts a ratio into a picture as a layer that other programs multiply by",
        inputs: &[
            Port::new("ratio", Kind::Ratio, "The shadow or the change"),
            Port::new(
                "image",
                Kind::Image,
                "The picture that gets the layer; without it, a picture of the ratio alone",
            )
            .optional(),
        ],
        outputs: &[Port::new("image", Kind::Image, "The picture with one more layer")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let ratio = inputs.need_ratio("ratio")?;
        let plain = !self.name.is_empty() && self.name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !plain {
            let message = format!("name is \"{}\"", self.name);
            return Err(Error::compute(message, "use letters, digits and underscores"));
        }
        let name = format!("ratio_{}", self.name);
        let data = ratio.values.iter().flat_map(|value| [value[0], value[1], value[2]]).collect();
        let layer = Layer::new(&name, &["R", "G", "B"], Content::Data, data);
        let alone = Image { width: ratio.width, height: ratio.height, layers: vec![layer.clone()], ..Image::default() };
        let Some(image) = inputs.image("image") else { return Ok(vec![Value::Image(Arc::new(alone))]) };
        same_size(&alone, image, ["ratio", "image"])?;
        ratio.foreign(image.colour_space).iter().for_each(|text| job.warn(text));
        if image.layer(&name).is_some() {
            let message = format!("the picture has a layer \"{name}\" already");
            return Err(Error::compute(message, "give the ratio another name"));
        }
        let mut image: Image = (**image).clone();
        image.layers.push(layer);
        Ok(vec![Value::Image(Arc::new(image))])
    }
}
