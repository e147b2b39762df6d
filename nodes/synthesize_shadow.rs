//! A new shadow in a picture without one (thesis 6.7.4, eq. 6.2).

use super::visibility_ratio::colours;
use crate::image::Layer;
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::shadow::ratio::quotient::multiply;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// `c = removed x ratio` for each pixel and channel. Where a picture has beauty and `direct`, `direct` is multiplied and
/// the beauty changes by as much, so that direct and indirect light still add up to it. Where the ratio is 1 no bit
/// changes; alpha never does.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SynthesizeShadow {
    /// Layers to multiply, `beauty` for the beauty. Empty: the beauty and `direct`. A beauty that is named without
    /// `direct` is multiplied as a whole.
    pub layers: Vec<String>,
}

impl Node for SynthesizeShadow {
    const INFO: Info = Info {
        name: "synthesize_shadow",
        category: "shadows",
        summary: "Multiplies a picture without a shadow, or a plate, by a ratio",
        inputs: &[
            Port::new("image", Kind::Image, "The picture without the shadow, or a plate"),
            Port::new("ratio", Kind::Ratio, "The shadow to put in"),
        ],
        outputs: &[Port::new("image", Kind::Image, "The picture with the shadow; other layers as they were")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (image, ratio) = (inputs.need_image("image")?, inputs.need_ratio("ratio")?);
        ratio.check("the picture", image.width, image.height)?;
        let place = |layer: &Layer| image.layers.iter().position(|other| std::ptr::eq(other, layer)).expect("its own");
        let mut chosen = Vec::new();
        for name in &self.layers {
            chosen.push(place(image.find(name).map_err(|e| Error::compute(e.message, e.help))?));
        }
        if self.layers.is_empty() {
            let beauty = image.find("").ok();
            chosen.extend(beauty.into_iter().chain(image.layer("direct")).map(place));
        }
        chosen.dedup();
        if chosen.is_empty() {
            let names = image.layers.iter().map(Layer::title).collect::<Vec<_>>().join(", ");
            return Err(Error::compute(format!("no beauty and no layer direct; found {names}"), "name the layers"));
        }
        let direct = image.layer("direct").map(place).filter(|at| chosen.contains(at));
        let beauty = image.find("").ok().map(place).filter(|at| chosen.contains(at) && direct.is_some());

        let mut shaded = (**image).clone();
        let (mut not_finite, mut limited) = (0, 0);
        for &at in chosen.iter().filter(|at| Some(**at) != beauty) {
            let layer = &image.layers[at];
            let (data, met) = multiply(layer, colours(layer)?, ratio);
            shaded.layers[at] = layer.with_data(data);
            not_finite = met.not_finite.max(not_finite);
            limited += met.limited;
        }
        if let (Some(beauty), Some(direct)) = (beauty, direct) {
            let before = &image.layers[beauty];
            shaded.layers[beauty] = add_change(before, &image.layers[direct], &shaded.layers[direct])?;
        }
        if not_finite > 0 {
            job.note("not_finite", not_finite);
            job.warn(format!("{not_finite} pixels hold NaN or infinity; they stay as they are"));
        }
        if limited > 0 {
            job.note("limited", limited);
        }
        Ok(vec![Value::Image(Arc::new(shaded))])
    }
}

/// `beauty + (after - before)` in red, green and blue.
fn add_change(beauty: &Layer, before: &Layer, after: &Layer) -> Result<Layer> {
    let (own, other) = (colours(beauty)?, colours(before)?);
    let (stride, step) = (beauty.channels.len(), before.channels.len());
    let mut data = beauty.data.to_vec();
    data.par_chunks_mut(stride * 4096).enumerate().for_each(|(block, pixels)| {
        for (i, pixel) in pixels.chunks_exact_mut(stride).enumerate() {
            let first = (block * 4096 + i) * step;
            for (own, other) in own.iter().zip(other) {
                let (old, new) = (before.data[first + other], after.data[first + other]);
                if old != new && old.is_finite() {
                    pixel[*own] = (pixel[*own] - old + new).clamp(-f32::MAX, f32::MAX);
                }
            }
        }
    });
    Ok(beauty.with_data(data))
}
