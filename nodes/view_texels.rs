//! A picture of texels on the surfaces that a camera sees: look at baked shadows from anywhere (thesis 6.4, 6.8).

use crate::Result;
use crate::image::{Content, Image, Layer};
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::atlas::look_up;
use crate::transport::lighting::surface_layers;
use crate::value::{Kind, Value};
use glam::Vec4;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Colour layers are looked up between texels; `P`, `N` and `Z` are the view's own. Several samples a pixel take the steps off
/// edges.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ViewTexels {}

impl Node for ViewTexels {
    const INFO: Info = Info {
        name: "view_texels",
        category: "in and out",
        summary: "Shows a picture made at texel_samples on the surfaces that a camera sees",
        inputs: &[
            Port::new("image", Kind::Image, "Made with the texel samples: a pixel a texel"),
            Port::new("texels", Kind::Samples, "The texel samples"),
            Port::new("samples", Kind::Samples, "The view to show them in"),
        ],
        outputs: &[Port::new("image", Kind::Image, "The same layers, seen by the camera; and P, N, Z")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let image = inputs.need_image("image")?;
        let (texels, view) = (inputs.need_whole_samples("texels")?, inputs.need_whole_samples("samples")?);
        let mut layers = Vec::new();
        let mut missed = 0;
        for layer in image.layers.iter().filter(|layer| layer.content == Content::Colour) {
            let channels = layer.channels.len().min(4);
            let four = |pixel: &[f32]| std::array::from_fn(|c| if c < channels { pixel[c] } else { 0.0 });
            let values: Vec<[f32; 4]> = layer.data.chunks_exact(layer.channels.len()).map(four).collect();
            let found = look_up(texels, &values, view)?;
            missed = found.missed;
            let pixels = view.resolve(|sample| Vec4::from_array(found.values[sample]));
            let data = pixels.iter().flat_map(|pixel| pixel.to_array().into_iter().take(channels)).collect();
            let names: Vec<&str> = layer.channels.iter().take(channels).map(String::as_str).collect();
            layers.push(Layer::new(&layer.name, &names, Content::Colour, data));
        }
        let alpha: Vec<[f32; 4]> =
            view.points.iter().map(|p| [0.0, 0.0, 0.0, f32::from(u8::from(p.exists()))]).collect();
        layers.extend(surface_layers(view, &alpha).into_iter().filter(|layer| layer.content == Content::Data));
        if missed > 0 {
            job.warn(format!("{missed} samples lie on surfaces too small for a texel; they are black"));
            job.note("samples_without_texel", missed);
        }
        let (width, height) = (view.width, view.height);
        Ok(vec![Value::Image(Arc::new(Image { width, height, layers, ..(**image).clone() }))])
    }
}
