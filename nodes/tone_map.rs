//! Brings scene-linear light into the range of a display.

use crate::image::view_transform::{Source, ViewTransform, Wish};
use crate::image::{ColourSpace, Image, Layer, colour};
use crate::kernels;
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How light is brought into the range of a display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Operator {
    /// Exposure alone.
    None,
    /// The global operator of Reinhard and others, with a white point.
    #[default]
    Reinhard,
    /// ACES 2.0 for screens of ordinary range.
    Aces,
    /// Khronos PBR Neutral.
    Neutral,
    /// A display and view of OpenColorIO.
    Ocio,
}

/// The result is linear, relative to the display's white: a PNG writer applies the sRGB curve, and so writes just the
/// values that `aces` and `ocio` send to the display. Rec.709 primaries, or what the display has. Alpha stays.
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
    /// For `ocio`: the configuration, a file or `ocio://NAME`. Empty: that of `$OCIO`, or ACES 2.0 without it.
    pub config: String,
    /// For `ocio`: the display. Empty: the configuration's own choice.
    pub display: String,
    /// For `ocio`: the view of that display. Empty: the configuration's own choice.
    pub view: String,
    /// For `ocio`: what the configuration calls the picture's colour space. Empty: found from its ACES role.
    pub input: String,
    /// Layers to map, `beauty` for the beauty. Empty: the beauty alone.
    pub layers: Vec<String>,
}

impl Default for ToneMap {
    fn default() -> Self {
        let [config, display, view, input] = [(); 4].map(|()| String::new());
        let operator = Operator::Reinhard;
        Self { operator, exposure: 0.0, white: 4.0, config, display, view, input, layers: Vec::new() }
    }
}

impl Node for ToneMap {
    const INFO: Info = Info {
        name: "tone_map",
        category: "image",
        version: 2,
        summary: "Compresses scene-linear light into the range of a display",
        inputs: &[Port::new("image", Kind::Image, "Scene-linear picture")],
        outputs: &[Port::new(
            "image",
            Kind::Image,
            "Linear display-referred picture in Rec.709; other layers as they were",
        )],
        ..Info::NEW
    };

    fn files(&self) -> Vec<String> {
        let file = self.wish(Path::new("")).and_then(|wish| Some(wish.source.file()?.to_string_lossy().into_owned()));
        file.into_iter().collect()
    }

    fn linked_files(&self, base: &Path) -> Vec<PathBuf> {
        let transform = self.wish(base).and_then(|wish| wish.transform(ColourSpace::Rec709).ok());
        transform.map_or_else(Vec::new, |transform| transform.files.clone())
    }

    fn pass_through(&self) -> Option<&'static str> {
        (self.operator == Operator::None && self.exposure == 0.0).then_some("image")
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let image = inputs.need_image("image")?;
        let map = self.map(job, image.colour_space)?;
        // What is not mapped is brought along: a picture has one space.
        let mut mapped: Image = image.to_space(ColourSpace::Rec709);
        let beauty = [String::new()];
        let names = if self.layers.is_empty() { &beauty[..] } else { &self.layers };
        let mut not_finite = 0;
        for name in names {
            let at = mapped.place(name).map_err(|e| Error::compute(e.message, e.help))?;
            let source = match map {
                Map::Kernel(_) => mapped.layers[at].clone(),
                Map::View(_) => image.layers[at].clone(),
            };
            mapped.layers[at] = self.apply(&source, &map, job, &mut not_finite)?;
            job.progress.check()?;
        }
        if not_finite > 0 {
            job.note("pixels_not_finite", not_finite);
        }
        Ok(vec![Value::Image(Arc::new(mapped))])
    }
}

enum Map {
    Kernel(kernels::tone_map::Operator),
    View(Arc<ViewTransform>),
}

impl ToneMap {
    fn wish(&self, base: &Path) -> Option<Wish> {
        match self.operator {
            Operator::Ocio => {
                let source = Source::find(&self.config, base);
                let [display, view, input] = [&self.display, &self.view, &self.input].map(String::clone);
                Some(Wish { source, display, view, input })
            }
            Operator::Aces => Some(Wish::aces()),
            Operator::None | Operator::Reinhard | Operator::Neutral => None,
        }
    }

    fn map(&self, job: &Job, pixels: ColourSpace) -> Result<Map> {
        use kernels::tone_map::Operator as Kernel;
        Ok(match (self.operator, self.wish(job.base)) {
            (_, Some(wish)) => {
                job.note("view", wish.title());
                Map::View(wish.transform(pixels)?)
            }
            (Operator::Reinhard, _) => Map::Kernel(Kernel::Reinhard),
            (Operator::Neutral, _) => Map::Kernel(Kernel::Neutral),
            _ => Map::Kernel(Kernel::None),
        })
    }

    fn apply(&self, layer: &Layer, map: &Map, job: &Job, not_finite: &mut usize) -> Result<Layer> {
        let rgb = layer.need_rgb()?;
        let stride = layer.channels.len();
        let fetch = |pixel: &[f32]| [pixel[rgb[0]], pixel[rgb[1]], pixel[rgb[2]], 0.0];
        let mut pixels: Vec<[f32; 4]> = layer.data.chunks_exact(stride).map(fetch).collect();
        *not_finite += pixels.iter().filter(|pixel| !pixel.iter().all(|x| x.is_finite())).count();
        match map {
            Map::Kernel(operator) => {
                pixels = kernels::tone_map(job.device, &pixels, *operator, self.exposure, self.white)?;
            }
            Map::View(transform) => {
                transform.apply(&mut pixels, self.exposure.exp2());
                let linear =
                    |pixel: &mut [f32; 4]| pixel[..3].iter_mut().for_each(|x| *x = colour::linear_from_srgb(*x));
                pixels.par_iter_mut().for_each(linear);
            }
        }
        let mut data = layer.data.to_vec();
        for (pixel, mapped) in data.chunks_exact_mut(stride).zip(&pixels) {
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
    use std::sync::Mutex;

    fn run(node: &ToneMap) -> Result<Image> {
        let layers = vec![
            Layer::new("", &["R", "G", "B", "A"], Content::Colour, vec![4.0, 4.0, 4.0, 0.5, f32::NAN, 0.0, 0.0, 1.0]),
            Layer::new("indirect", &["B", "G", "R"], Content::Colour, vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
            Layer::new("Z", &["Z"], Content::Data, vec![7.0, 8.0]),
        ];
        let image = Value::Image(Arc::new(Image { width: 2, height: 1, layers, ..Image::default() }));
        let inputs = Inputs {
            info: &ToneMap::INFO,
            values: vec![Some((image, [Key::of(&[]); 4]))],
            at_frames: vec![],
            connected: vec![true],
        };
        let notes = Mutex::default();
        let job = Job::alone(&Device::Cpu, &NoMemo, &notes);
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

    /// The values that a PNG gets are those that the display is sent.
    #[test]
    fn views_of_ocio_come_out_as_they_are_sent() {
        let aces = |exposure: f32| run(&ToneMap { operator: Operator::Aces, exposure, ..ToneMap::default() }).unwrap();
        let mut sent = [[4.0, 4.0, 4.0, 1.0]];
        Wish::aces().transform(ColourSpace::Rec709).unwrap().apply(&mut sent, 0.5);
        let beauty = &aces(-1.0).layers[0];
        assert!((colour::srgb_from_linear(beauty.data[0]) - sent[0][0]).abs() < 1e-5, "{:?}", &beauty.data[..4]);
        assert!(beauty.data[3] == 0.5 && beauty.data[4].is_nan(), "alpha and NaN stay");
        assert!(aces(0.0).layers[0].data[0] > beauty.data[0]);
        let own = ToneMap { operator: Operator::Ocio, ..ToneMap::default() };
        if std::env::var_os("OCIO").is_none() {
            assert_eq!(run(&own).unwrap().layers[0].data[..4], aces(0.0).layers[0].data[..4], "ACES without $OCIO");
            assert!(own.files().is_empty());
        }
        let named = ToneMap { config: "no/config.ocio".into(), ..own };
        assert_eq!(named.files(), ["no/config.ocio"]);
        assert!(run(&named).unwrap_err().to_string().contains("no/config.ocio"));
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
