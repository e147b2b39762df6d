//! Compares two pictures: their difference as a picture, figures in the report.

use crate::image::{Image, compare};
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Compare {
    /// Layers to compare, `beauty` for the beauty. Empty: all that both pictures have.
    pub layers: Vec<String>,
}

impl Node for Compare {
    const INFO: Info = Info {
        name: "compare",
        category: "image",
        summary: "The difference of two pictures, and how large it is",
        inputs: &[
            Port::new("a", Kind::Image, "What is judged"),
            Port::new("b", Kind::Image, "The reference, of the same size"),
        ],
        outputs: &[Port::new("image", Kind::Image, "a - b, layer by layer; the figures are in the report")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (a, b) = (inputs.need_image("a")?, inputs.need_image("b")?);
        super::merge::same_size(a, b, ["a", "b"])?;
        let a = &a.to_space(b.colour_space);
        let shared = a.layers.iter().filter(|layer| b.layer(&layer.name).is_some()).map(|layer| layer.name.clone());
        let names: Vec<String> = if self.layers.is_empty() { shared.collect() } else { self.layers.clone() };
        if names.is_empty() {
            let message = "the pictures have no layer in common";
            return Err(Error::compute(message, "name the layers to compare"));
        }
        let mut image = Image { width: a.width, height: a.height, colour_space: b.colour_space, ..Image::default() };
        for name in &names {
            let find = |image: &Image| image.find(name).cloned().map_err(|e| Error::compute(e.message, e.help));
            let (left, right) = (find(a)?, find(b)?);
            let figures = compare::compare(&left, &right, a.width)?;
            let mut note = serde_json::to_value(&figures).expect("figures are plain data");
            note["relative_rmse"] = figures.relative().into();
            note["ssim"] = compare::ssim(&left, &right, a.width).into();
            job.note(left.title(), note);
            image.layers.push(compare::difference(&left, &right, a.width)?);
        }
        Ok(vec![Value::Image(Arc::new(image))])
    }
}
