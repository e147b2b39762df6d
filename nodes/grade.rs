//! Grades layers of a picture, one pixel at a time.

use crate::image::{Image, Layer, colour};
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// `gamma(hue saturation (2^exposure multiply c) + offset)`, in this order; alpha stays.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Grade {
    /// Layers to grade, `beauty` for the beauty. Empty: the beauty alone.
    pub layers: Vec<String>,
    /// Multiplies by 2 to this power.
    #[schemars(range(min = -20.0, max = 20.0), extend("unit" = "stops"))]
    pub exposure: f32,
    /// Factor of red, green and blue.
    pub multiply: [f32; 3],
    /// 0 is grey, 1 as it is; keeps luminance.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub saturation: f32,
    /// Turns hues about the grey axis, red towards green; keeps luminance.
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees"))]
    pub hue: f32,
    /// Added to red, green and blue.
    pub offset: [f32; 3],
    /// Raises values above 0 to the power 1 / gamma; others stay.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub gamma: f32,
}

impl Default for Grade {
    fn default() -> Self {
        Self {
            layers: Vec::new(),
            exposure: 0.0,
            multiply: [1.0; 3],
            saturation: 1.0,
            hue: 0.0,
            offset: [0.0; 3],
            gamma: 1.0,
        }
    }
}

impl Node for Grade {
    const INFO: Info = Info {
        name: "grade",
        category: "image",
        summary: "Exposure, factor, saturation, hue, offset and gamma of chosen layers",
        inputs: &[Port::new("image", Kind::Image, "What to grade")],
        outputs: &[Port::new("image", Kind::Image, "The graded picture; other layers as they were")],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        let linear = self.matrix() == Mat3::IDENTITY;
        (linear && self.offset == [0.0; 3] && self.gamma == 1.0).then_some("image")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let image = inputs.need_image("image")?;
        if !(self.gamma > 0.0 && self.gamma.is_finite()) {
            return Err(Error::compute(format!("gamma {} is not above 0", self.gamma), "set gamma to 1 or so"));
        }
        let beauty = [String::new()];
        let names = if self.layers.is_empty() { &beauty[..] } else { &self.layers };
        let mut graded: Image = (**image).clone();
        for name in names {
            let layer = image.find(name).map_err(|e| Error::compute(e.message, e.help))?;
            let at = image.layers.iter().position(|other| std::ptr::eq(other, layer)).expect("found in this picture");
            graded.layers[at] = self.apply(layer, image.width)?;
        }
        Ok(vec![Value::Image(Arc::new(graded))])
    }
}

impl Grade {
    /// The linear part.
    fn matrix(&self) -> Mat3 {
        let factor = Vec3::from(self.multiply) * self.exposure.exp2();
        colour::hue(self.hue) * colour::saturation(self.saturation) * Mat3::from_diagonal(factor)
    }

    fn apply(&self, layer: &Layer, width: usize) -> Result<Layer> {
        let Some(rgb) = layer.rgb() else {
            let message = format!("layer \"{}\" has {}, not R G B", layer.title(), layer.channels.join(" "));
            return Err(Error::compute(message, "grade colour layers"));
        };
        let (matrix, offset, power) = (self.matrix(), Vec3::from(self.offset), 1.0 / self.gamma);
        let curve = |value: f32| if power != 1.0 && value > 0.0 { value.powf(power) } else { value };
        let stride = layer.channels.len();
        let mut data = layer.data.to_vec();
        data.par_chunks_mut(stride * width.max(1)).for_each(|row| {
            for pixel in row.chunks_mut(stride) {
                let graded = matrix * Vec3::from(rgb.map(|at| pixel[at])) + offset;
                rgb.iter().zip(graded.to_array()).for_each(|(&at, value)| pixel[at] = curve(value));
            }
        });
        Ok(layer.with_data(data))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Content;

    #[test]
    fn pixels_by_hand() {
        let layer = Layer::new("", &["R", "G", "B", "A"], Content::Colour, vec![0.1, 0.2, 0.4, 0.5]);
        let grade = |grade: Grade| grade.apply(&layer, 1).unwrap().data.to_vec();
        let close = |a: &[f32], b: &[f32]| assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
        close(&grade(Grade::default()), &[0.1, 0.2, 0.4, 0.5]);
        close(&grade(Grade { exposure: 1.0, ..Grade::default() }), &[0.2, 0.4, 0.8, 0.5]);
        let grey = 0.2126 * 0.1 + 0.7152 * 0.2 + 0.0722 * 0.4;
        close(&grade(Grade { saturation: 0.0, ..Grade::default() }), &[grey, grey, grey, 0.5]);
        let grade_all = Grade { multiply: [2.0, 1.0, 0.0], offset: [0.05, -1.0, 0.25], gamma: 2.0, ..Grade::default() };
        close(&grade(grade_all), &[0.5, -0.8, 0.5, 0.5]);
    }

    #[test]
    fn only_a_change_is_computed() {
        assert_eq!(Grade::default().pass_through(), Some("image"));
        assert_eq!(Grade { hue: 360.0, ..Grade::default() }.pass_through(), Some("image"));
        assert_eq!(Grade { hue: 1.0, ..Grade::default() }.pass_through(), None);
        assert_eq!(Grade { gamma: 1.1, ..Grade::default() }.pass_through(), None);
    }
}
