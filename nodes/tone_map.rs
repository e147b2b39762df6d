//! Brings scene-linear light into the range of a display.

use crate::image::{Image, Layer};
use crate::kernels;
use crate::kernels::tone_map::Operator;
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The result is still linear, now relative to the display's white: a PNG writer applies the sRGB curve. Alpha stays.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ToneMap {
    /// How light above the display's white is brought below it.
    pub operator: Operator,
    /// Multiplies light by 2 to this power before the operator.
    #[schemars(range(min = -20.0, max = 20.0), extend("unit" = "stops"))]
    pub exposure: f32,
    /// The luminance that `reinhard` maps to the display's white; other operators do not use it.
    #[schemars(range(min = 0.01, max = 1e6))]
    pub white: f32,
    /// Layers to map, `beauty` for the beauty. Empty: the beauty alone.
    pub layers: Vec<String>,
}

impl Default for ToneMap {
    fn default() -> Self {
        Self { operator: Operator::Reinhard, exposure: 0.0, white: 4.0, layers: Vec::new() }
    }
}

impl Node for ToneMap {
    const INFO: Info = Info {
        name: "tone_map",
        category: "image",
        summary: "Compresses scene-linear light into the range of a display",
        inputs: &[Port::new("image", Kind::Image, "Scene-linear picture")],
        outputs: &[Port::new("image", Kind::Image, "Linear display-referred picture; other layers as they were")],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.operator == Operator::None && self.exposure == 0.0).then_some("image")
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let image = inputs.need_image("image")?;
        let beauty = [String::new()];
        let names = if self.layers.is_empty() { &beauty[..] } else { &self.layers };
        let mut mapped: Image = (**image).clone();
        let mut not_finite = 0;
        for name in names {
            let layer = image.find(name).map_err(|e| Error::compute(e.message, e.help))?;
            let at = image.layers.iter().position(|other| std::ptr::eq(other, layer)).expect("found in this picture");
            mapped.layers[at] = self.apply(layer, job, &mut not_finite)?;
            job.progress.check()?;
        }
        if not_finite > 0 {
            job.note("pixels_not_finite", not_finite);
        }
        Ok(vec![Value::Image(Arc::new(mapped))])
    }
}

impl ToneMap {
    fn apply(&self, layer: &Layer, job: &Job, not_finite: &mut usize) -> Result<Layer> {
        let rgb = layer.need_rgb()?;
        let stride = layer.channels.len();
        let pixels: Vec<[f32; 4]> =
            layer.data.chunks_exact(stride).map(|pixel| [pixel[rgb[0]], pixel[rgb[1]], pixel[rgb[2]], 0.0]).collect();
        *not_finite += pixels.iter().filter(|pixel| !pixel.iter().all(|x| x.is_finite())).count();
        let mapped = kernels::tone_map(job.device, &pixels, self.operator, self.exposure, self.white)?;
        let mut data = layer.data.to_vec();
        for (pixel, mapped) in data.chunks_exact_mut(stride).zip(&mapped) {
            rgb.iter().zip(mapped).for_each(|(&at, &value)| pixel[at] = value);
        }
        Ok(layer.with_data(data))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Device;
    use crate::image::Content;
    use crate::node::{Key, NoMemo};
    use crate::progress::Progress;
    use std::path::Path;
    use std::sync::Mutex;

    fn run(node: &ToneMap) -> Result<Image> {
        let layers = vec![
            Layer::new("", &["R", "G", "B", "A"], Content::Colour, vec![4.0, 4.0, 4.0, 0.5, f32::NAN, 0.0, 0.0, 1.0]),
            Layer::new("indirect", &["B", "G", "R"], Content::Colour, vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
            Layer::new("Z", &["Z"], Content::Data, vec![7.0, 8.0]),
        ];
        let image = Value::Image(Arc::new(Image { width: 2, height: 1, layers, ..Image::default() }));
        let inputs = Inputs { info: &ToneMap::INFO, values: vec![Some((image, [Key::of(&[]); 4]))] };
        let notes = Mutex::default();
        let job = Job {
            device: &Device::Cpu,
            progress: Progress::silent(),
            memo: &NoMemo,
            frame: 0.0,
            fps: 24.0,
            base: Path::new(""),
            out: None,
            recipe: &String::new,
            key: Key::of(&[]),
            notes: &notes,
        };
        let values = node.run(&inputs, &job)?;
        let noted = notes.lock().unwrap().get("pixels_not_finite").is_some();
        assert_eq!(noted, node.layers.is_empty(), "only the beauty has a NaN");
        let Value::Image(image) = &values[0] else { panic!("an image") };
        Ok((**image).clone())
    }

    #[test]
    fn chosen_layers_are_mapped_and_others_keep_every_bit() {
        let image = run(&ToneMap::default()).unwrap();
        assert!(image.layers[0].data[..3].iter().all(|x| (x - 1.0).abs() < 1e-6), "{:?}", &image.layers[0].data[..]);
        assert_eq!(image.layers[0].data[3], 0.5, "alpha stays");
        assert!(image.layers[0].data[4].is_nan(), "NaN is not hidden");
        assert_eq!(image.layers[2].data[..], [7.0, 8.0]);
        let image = run(&ToneMap { layers: vec!["indirect".into()], exposure: 1.0, ..ToneMap::default() }).unwrap();
        assert_eq!(image.layers[0].data[0], 4.0);
        let red = 2.0 * (1.0 + 0.4252 / 16.0) / 1.4252;
        assert!(
            (image.layers[1].data[2] - red).abs() < 1e-5,
            "channels are found by name: {:?}",
            &image.layers[1].data[..]
        );
    }

    #[test]
    fn layers_that_cannot_be_mapped_are_refused() {
        for layer in ["Z", "inderect"] {
            assert!(run(&ToneMap { layers: vec![layer.into()], ..ToneMap::default() }).is_err(), "{layer}");
        }
    }

    #[test]
    fn only_a_change_is_computed() {
        assert_eq!(ToneMap { operator: Operator::None, ..ToneMap::default() }.pass_through(), Some("image"));
        assert_eq!(ToneMap::default().pass_through(), None);
        assert_eq!(ToneMap { operator: Operator::None, exposure: 1.0, ..ToneMap::default() }.pass_through(), None);
    }
}
