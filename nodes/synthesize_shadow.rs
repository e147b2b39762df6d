//! A new shadow in a picture without one (thesis 6.7.4, eq. 6.2).

use crate::image::components::{self, Part};
use crate::image::{Image, Layer};
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::plate::change::carry;
use crate::transport::shadow::ratio::quotient::multiply;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// `c = removed x ratio` for each pixel and channel, or `c = image / original x ratio` for a picture that still has the
/// shadow. Where a picture has beauty and direct light (by the names that renderers give it), direct light is
/// multiplied and the beauty changes by as much, so that direct and indirect light still add up to it. Where the ratio
/// is 1 no bit changes; alpha never does.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SynthesizeShadow {
    /// Layers to multiply, `beauty` for the beauty. Empty: direct light, and the beauty with it. A beauty that is named
    /// without direct light is multiplied as a whole.
    pub layers: Vec<String>,
}

impl Node for SynthesizeShadow {
    const INFO: Info = Info {
        name: "synthesize_shadow",
        category: "shadows",
        version: 2,
        summary: "Multiplies a picture without a shadow, or a plate, by a ratio",
        inputs: &[
            Port::new("image", Kind::Image, "The picture without the shadow, or a plate"),
            Port::new("ratio", Kind::Ratio, "The shadow to put in"),
            Port::new("original", Kind::Ratio, "The shadow that the picture still has, to take out").optional(),
        ],
        outputs: &[Port::new("image", Kind::Image, "The picture with the shadow; other layers as they were")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (image, ratio) = (inputs.need_image("image")?, inputs.need_ratio("ratio")?);
        ratio.check("the picture", image.width, image.height)?;
        ratio.foreign(image.colour_space).iter().for_each(|text| job.warn(text));
        let original = inputs.ratio("original");
        if let Some(original) = original {
            original.check("the picture", image.width, image.height)?;
        }
        let direct = components::known(image).into_iter().find(|known| known.light == Part::Direct);
        let chosen = self.chosen(image, direct.map(|direct| direct.layer))?;
        let direct = direct.filter(|direct| chosen.contains(&direct.layer));
        let beauty = image.place("").ok().filter(|at| chosen.contains(at) && direct.is_some());

        let mut shaded: Image = (**image).clone();
        let (mut not_finite, mut limited) = (0, 0);
        for &at in chosen.iter().filter(|at| Some(**at) != beauty) {
            let layer = &image.layers[at];
            let (data, met) = multiply(layer, layer.need_rgb()?, ratio, original.map(|original| &**original));
            shaded.layers[at] = layer.with_data(data);
            not_finite = met.not_finite.max(not_finite);
            limited += met.limited;
        }
        if let (Some(beauty), Some(direct)) = (beauty, direct) {
            let (before, after) = (&image.layers[direct.layer], &shaded.layers[direct.layer]);
            let colour = direct.colour.map(|at| &image.layers[at]);
            shaded.layers[beauty] = carry(&image.layers[beauty], before, after, colour)?;
        }
        job.note("layers", chosen.iter().map(|at| image.layers[*at].title()).collect::<Vec<_>>());
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

impl SynthesizeShadow {
    /// Numbers of the layers that change.
    fn chosen(&self, image: &Image, direct: Option<usize>) -> Result<Vec<usize>> {
        let mut chosen = Vec::new();
        for name in &self.layers {
            chosen.push(image.place(name).map_err(|e| Error::compute(e.message, e.help))?);
        }
        if self.layers.is_empty() {
            chosen.extend(image.place("").ok().into_iter().chain(direct));
        }
        chosen.dedup();
        if chosen.is_empty() {
            let names = image.layers.iter().map(Layer::title).collect::<Vec<_>>().join(", ");
            return Err(Error::compute(format!("no beauty and no direct light; found {names}"), "name the layers"));
        }
        Ok(chosen)
    }
}
