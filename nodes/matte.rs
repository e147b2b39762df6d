//! Parts of a picture: by Cryptomatte, or by any channel.

use super::merge::same_size;
use crate::image::cryptomatte::Cryptomatte;
use crate::image::{Content, Image, Layer};
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::Selection;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Either `objects`, `materials` and `assets` by Cryptomatte, with its soft coverage (what is in all lists that are not
/// empty), or one channel of a layer.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Matte {
    /// Names of objects; patterns with `*`, `?` and `[...]`, or ids such as `f19c73fd`.
    pub objects: Vec<String>,
    /// Names of materials, likewise.
    pub materials: Vec<String>,
    /// Names of assets, likewise.
    pub assets: Vec<String>,
    /// A layer that is the matte, `beauty` for the beauty. With names: the Cryptomatte to look in, where there are
    /// several of a kind.
    pub layer: String,
    /// Its channel, such as `A` or `R`. Empty: the only one, or alpha, or all three where they are equal.
    pub channel: String,
}

impl Node for Matte {
    const INFO: Info = Info {
        name: "matte",
        category: "selection",
        summary: "Selects by Cryptomatte names, or by a channel of a picture",
        inputs: &[
            Port::new("image", Kind::Image, "A plate with Cryptomatte layers, or any picture"),
            Port::new("samples", Kind::Samples, "The surfaces that the pixels show")
                .reads(&[Facet::Geometry])
                .optional(),
        ],
        outputs: &[
            Port::new("selection", Kind::Selection, "Weights on the surfaces that the picture shows").needs("samples"),
            Port::new("matte", Kind::Image, "A picture of one channel, from 0 to 1"),
        ],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let image = inputs.need_image("image")?;
        let weights = if self.lists().iter().all(|(_, names)| names.is_empty()) {
            self.channel(image, job)?
        } else {
            self.named(image)?
        };
        let covered = weights.iter().map(|weight| f64::from(*weight)).sum::<f64>() / weights.len().max(1) as f64;
        job.note("covered", covered);
        if covered == 0.0 {
            job.warn("nothing is selected");
        }
        let (width, height) = (image.width, image.height);
        let layer = Layer::new("", &["Y"], Content::Data, weights);
        let matte = Image { width, height, layers: vec![layer], ..Image::default() };
        let selection = match inputs.whole_samples("samples") {
            Some(samples) => {
                let view = Image { width: samples.width, height: samples.height, ..Image::default() };
                same_size(&view, &matte, ["samples", "image"])?;
                Value::Selection(Arc::new(Selection::matte(samples, &matte.layers[0].data)))
            }
            None => Value::Absent(Kind::Selection),
        };
        Ok(vec![selection, Value::Image(Arc::new(matte))])
    }
}

impl Matte {
    fn lists(&self) -> [(&'static str, &[String]); 3] {
        [("CryptoObject", &self.objects), ("CryptoMaterial", &self.materials), ("CryptoAsset", &self.assets)]
    }

    fn named(&self, image: &Image) -> Result<Vec<f32>> {
        if !self.channel.is_empty() {
            let message = format!("names are given, and channel \"{}\"", self.channel);
            return Err(Error::compute(message, "give either names or a channel"));
        }
        let lists = self.lists().iter().filter(|(_, names)| !names.is_empty()).count();
        if lists > 1 && !self.layer.is_empty() {
            let message = format!("layer \"{}\" is one Cryptomatte, names are given for {lists}", self.layer);
            return Err(Error::compute(message, "leave layer empty, or use a matte node for each kind"));
        }
        let mut least: Option<Vec<f32>> = None;
        for (kind, names) in self.lists().into_iter().filter(|(_, names)| !names.is_empty()) {
            let wanted = if self.layer.is_empty() { kind } else { &self.layer };
            let matte = Cryptomatte::of(image, wanted).map_err(|e| Error::compute(e.message, e.help))?;
            let covered = matte.covered(names)?;
            least = Some(match least {
                Some(least) => least.iter().zip(&covered).map(|(a, b)| a.min(*b)).collect(),
                None => covered,
            });
        }
        Ok(least.expect("a list is not empty"))
    }

    fn channel(&self, image: &Image, job: &Job) -> Result<Vec<f32>> {
        if self.layer.is_empty() && self.channel.is_empty() {
            let help = "set objects, materials or assets for Cryptomatte, or layer and channel";
            return Err(Error::compute("nothing says what to select", help));
        }
        let layer = image.find(&self.layer).map_err(|e| Error::compute(e.message, e.help))?;
        let at = self.place(layer)?;
        let stride = layer.channels.len();
        let (mut outside, mut not_finite) = (0usize, 0usize);
        let weights = layer.data.iter().skip(at).step_by(stride).map(|value| {
            not_finite += usize::from(!value.is_finite());
            outside += usize::from(value.is_finite() && !(-1e-6..=1.0 + 1e-6).contains(value));
            if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.0 }
        });
        let weights = weights.collect();
        for (what, count) in [("NaN or infinite; taken as 0", not_finite), ("outside of 0 to 1; cut there", outside)] {
            if count > 0 {
                job.warn(format!("layer \"{}\": {count} values are {what}", layer.title()));
            }
        }
        Ok(weights)
    }

    fn place(&self, layer: &Layer) -> Result<usize> {
        let list = layer.channels.join(" ");
        if !self.channel.is_empty() {
            return layer.channel(&self.channel).ok_or_else(|| {
                let message = format!("layer \"{}\" has no channel \"{}\"", layer.title(), self.channel);
                Error::compute(message, format!("its channels are {list}"))
            });
        }
        let equal = |rgb: &[usize; 3]| {
            layer.data.chunks(layer.channels.len()).all(|p| p[rgb[0]] == p[rgb[1]] && p[rgb[0]] == p[rgb[2]])
        };
        let only = (layer.channels.len() == 1).then_some(0);
        let grey = || layer.rgb().filter(equal).map(|rgb| rgb[0]);
        only.or_else(|| layer.channel("A")).or_else(grey).ok_or_else(|| {
            let message = format!("layer \"{}\" has several channels: {list}", layer.title());
            Error::compute(message, "name one with channel")
        })
    }
}
