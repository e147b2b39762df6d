//! Merges two pictures, layer by layer.

use crate::image::{Content, Image, Layer, colour};
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Operation {
    /// a + b (1 - alpha of a); colours are premultiplied.
    #[default]
    Over,
    /// a + b
    Add,
    /// a b
    Multiply,
    /// a / b; 0 where b is 0.
    Divide,
    /// a + b - a b where both are in [0, 1], the larger elsewhere.
    Screen,
    /// |a - b|
    Difference,
    /// a; with `amount` or a mask, part a and part b.
    Mix,
}

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Merge {
    /// How a and b are put together.
    pub operation: Operation,
    /// How much of the result replaces b: 0 is b, 1 is the result.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub amount: f32,
    /// Layers to merge, `beauty` for the beauty. Empty: all colour layers that both pictures have.
    pub layers: Vec<String>,
}

impl Default for Merge {
    fn default() -> Self {
        Self { operation: Operation::Over, amount: 1.0, layers: Vec::new() }
    }
}

impl Node for Merge {
    const INFO: Info = Info {
        name: "merge",
        category: "image",
        summary: "Merges two pictures: over, add, multiply, divide, screen, difference, mix",
        inputs: &[
            Port::new("a", Kind::Image, "In front; the numerator"),
            Port::new("b", Kind::Image, "Behind; the denominator. Layers that are not merged are taken from here"),
            Port::new("mask", Kind::Image, "Where to merge: the one channel of its beauty, or its luminance")
                .optional(),
        ],
        outputs: &[Port::new("image", Kind::Image, "b with the merged layers")],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.amount == 0.0).then_some("b")
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (a, b) = (inputs.need_image("a")?, inputs.need_image("b")?);
        same_size(a, b, ["a", "b"])?;
        let a = &a.to_space(b.colour_space);
        let mask = match inputs.image("mask") {
            Some(mask) => {
                same_size(mask, b, ["mask", "b"])?;
                Some(weights(mask)?)
            }
            None => None,
        };
        let mut merged: Image = (**b).clone();
        let by_zero = AtomicUsize::new(0);
        for (at, front) in self.chosen(a, b)? {
            let alpha = alpha_of(a, front);
            let amount = |pixel: usize| self.amount * mask.as_ref().map_or(1.0, |mask| mask[pixel]);
            merged.layers[at] = self.apply(front, &b.layers[at], b.width, &alpha, amount, &by_zero)?;
        }
        let by_zero = by_zero.into_inner();
        if by_zero > 0 {
            job.note("divided by zero", by_zero);
            job.warn(format!("{by_zero} values were divided by zero; the result there is 0"));
        }
        Ok(vec![Value::Image(Arc::new(merged))])
    }
}

impl Merge {
    /// The layers to merge: index in b, and the layer of a.
    fn chosen<'a>(&self, a: &'a Image, b: &Image) -> Result<Vec<(usize, &'a Layer)>> {
        let found = if self.layers.is_empty() {
            let colour = b.layers.iter().enumerate().filter(|(_, layer)| layer.content == Content::Colour);
            colour.filter_map(|(at, layer)| Some((at, a.layer(&layer.name)?))).collect()
        } else {
            let find = |name: &String| -> Result<(usize, &'a Layer)> {
                let missing = |port, e: crate::image::names::NotFound| {
                    Error::compute(format!("input \"{port}\": {}", e.message), e.help)
                };
                let behind = b.find(name).map_err(|e| missing("b", e))?;
                let at = b.layers.iter().position(|layer| std::ptr::eq(layer, behind)).expect("found in this picture");
                Ok((at, a.find(name).map_err(|e| missing("a", e))?))
            };
            self.layers.iter().map(find).collect::<Result<Vec<_>>>()?
        };
        if found.is_empty() {
            let list = |image: &Image| image.layers.iter().map(Layer::title).collect::<Vec<_>>().join(", ");
            let message = format!("no colour layer in common: a has {}, b has {}", list(a), list(b));
            return Err(Error::compute(message, "name the layers to merge"));
        }
        Ok(found)
    }

    fn apply(
        &self,
        a: &Layer,
        b: &Layer,
        width: usize,
        alpha: &Alpha,
        amount: impl Fn(usize) -> f32 + Sync,
        by_zero: &AtomicUsize,
    ) -> Result<Layer> {
        let sources = sources(a, b)?;
        let (step_a, step_b) = (a.channels.len(), b.channels.len());
        let mut data = b.data.to_vec();
        data.par_chunks_mut(step_b * width.max(1)).enumerate().for_each(|(y, row)| {
            let mut zeros = 0;
            for (x, pixel) in row.chunks_mut(step_b).enumerate() {
                let at = y * width + x;
                let (front, alpha, amount) = (&a.data[at * step_a..][..step_a], alpha.at(at), amount(at));
                for (value, source) in pixel.iter_mut().zip(&sources) {
                    let result = match (self.operation, *source) {
                        // Coverage is not light: only what covers, and what replaces, changes it.
                        (Operation::Over, Source::Alpha) => alpha + *value * (1.0 - alpha),
                        (Operation::Mix, Source::Alpha) => alpha,
                        (_, Source::Alpha) => continue,
                        (operation, Source::Channel(channel)) => {
                            zeros += usize::from(operation == Operation::Divide && *value == 0.0 && amount != 0.0);
                            merge(operation, front[channel], *value, alpha)
                        }
                    };
                    *value = if amount == 1.0 { result } else { *value + amount * (result - *value) };
                }
            }
            by_zero.fetch_add(zeros, Ordering::Relaxed);
        });
        Ok(b.with_data(data))
    }
}

fn merge(operation: Operation, a: f32, b: f32, alpha: f32) -> f32 {
    match operation {
        Operation::Over => a + b * (1.0 - alpha),
        Operation::Add => a + b,
        Operation::Multiply => a * b,
        Operation::Divide => {
            if b == 0.0 {
                0.0
            } else {
                a / b
            }
        }
        Operation::Screen => {
            let shown = 0.0..=1.0;
            if shown.contains(&a) && shown.contains(&b) { a + b - a * b } else { a.max(b) }
        }
        Operation::Difference => (a - b).abs(),
        Operation::Mix => a,
    }
}

/// Where a channel of b finds its partner in a.
#[derive(Clone, Copy)]
enum Source {
    Alpha,
    Channel(usize),
}

/// Channels of the same name; a layer of one channel serves all.
fn sources(a: &Layer, b: &Layer) -> Result<Vec<Source>> {
    let source = |channel: &String| match a.channel(channel) {
        _ if channel == "A" => Some(Source::Alpha),
        Some(at) => Some(Source::Channel(at)),
        None if a.channels.len() == 1 => Some(Source::Channel(0)),
        None => None,
    };
    b.channels.iter().map(source).collect::<Option<_>>().ok_or_else(|| {
        let (left, right) = (a.channels.join(" "), b.channels.join(" "));
        let message = format!("layer \"{}\" has {left} in a, {right} in b", b.title());
        Error::compute(message, "merge layers with the same channels, or with one channel in a")
    })
}

/// Coverage of a: of the layer itself, else of its picture's beauty, else 1.
struct Alpha<'a>(Option<(&'a [f32], usize, usize)>);

impl Alpha<'_> {
    fn at(&self, pixel: usize) -> f32 {
        self.0.map_or(1.0, |(data, stride, channel)| data[pixel * stride + channel])
    }
}

fn alpha_of<'a>(image: &'a Image, layer: &'a Layer) -> Alpha<'a> {
    let of = |layer: &'a Layer| Some((&layer.data[..], layer.channels.len(), layer.channel("A")?));
    Alpha(of(layer).or_else(|| of(image.layer("")?)))
}

/// Weight of each pixel.
fn weights(mask: &Image) -> Result<Vec<f32>> {
    let layer = match &mask.layers[..] {
        [only] => only,
        _ => mask.find("").map_err(|e| Error::compute(format!("mask: {}", e.message), e.help))?,
    };
    let pixels = layer.data.chunks(layer.channels.len().max(1));
    match (layer.rgb(), layer.channels.len()) {
        (_, 1) => Ok(layer.data.to_vec()),
        (Some(rgb), _) => Ok(pixels.map(|pixel| colour::luminance(Vec3::from(rgb.map(|at| pixel[at])))).collect()),
        (None, _) => {
            let message = format!("mask: layer \"{}\" has {}", layer.title(), layer.channels.join(" "));
            Err(Error::compute(message, "give a mask of one channel, or of R, G and B"))
        }
    }
}

/// An error with both sizes where they differ.
pub(super) fn same_size(a: &Image, b: &Image, names: [&str; 2]) -> Result<()> {
    if (a.width, a.height) == (b.width, b.height) {
        return Ok(());
    }
    let size = |name: &str, image: &Image| format!("{name} has {} x {}", image.width, image.height);
    let message = format!("sizes differ: {}, {} pixels", size(names[0], a), size(names[1], b));
    Err(Error::compute(message, "give pictures of one size"))
}
