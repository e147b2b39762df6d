//! Cuts a pattern out of a shadow (thesis figures 6.1 and 6.11).

use crate::image::Image;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::shadow::ratio::pattern::{Laid, Pattern, Shape as Mask, Tiles};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Light and shadow by turns.
    #[default]
    Stripes,
    /// Two by two squares a period.
    Checker,
    /// Round spots of light, one a period.
    Dots,
    /// The picture on port `pattern`, again and again: white stays in shadow, black is lit.
    Image,
}

/// Lets light through parts of a shadow; where there is none, nothing changes. Where a pixel covers more than the pattern
/// can show (far away, at grazing angles), it goes over into its mean; the report says on which share of the shadow
/// (`fading`, and `faded` where the mean alone is left).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RatioPattern {
    /// What is cut out.
    pub shape: Shape,
    /// Length of a period, of the picture's height for `image`: in heights of the picture, with samples in metres.
    pub scale: f32,
    /// Turns the pattern counter-clockwise.
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees"))]
    pub angle: f32,
    /// Moves the pattern right and up.
    #[schemars(extend("unit" = "periods"))]
    pub offset: [f32; 2],
    /// Share that stays in shadow; of stripes and dots.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub fill: f32,
    /// Width of edges: 0 hard, 1 as soft as fits.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub softness: f32,
    /// How much light comes through.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub strength: f32,
    /// With samples: the direction in which the pattern is projected onto surfaces, such as that of the light. Without
    /// it, each surface is seen along the axis x, y or z that its normal is nearest to.
    pub direction: Option<[f32; 3]>,
}

impl Default for RatioPattern {
    fn default() -> Self {
        Self {
            shape: Shape::Stripes,
            scale: 0.1,
            angle: 0.0,
            offset: [0.0; 2],
            fill: 0.5,
            softness: 0.0,
            strength: 1.0,
            direction: None,
        }
    }
}

impl Node for RatioPattern {
    const INFO: Info = Info {
        name: "ratio_pattern",
        category: "shadows",
        summary: "Lets light through a shadow in stripes, checks, dots or after a picture",
        inputs: &[
            Port::new("ratio", Kind::Ratio, "The shadow"),
            Port::new("pattern", Kind::Image, "The picture for shape image: its beauty, or its one layer").optional(),
            Port::new(
                "samples",
                Kind::Samples,
                "Surfaces that the pattern lies on; without them it lies on the screen",
            )
            .optional()
            .reads(&[Facet::Geometry]),
        ],
        outputs: &[Port::new("ratio", Kind::Ratio, "The shadow with the pattern")],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.strength == 0.0).then_some("ratio")
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let ratio = inputs.need_ratio("ratio")?;
        let shape = match self.shape {
            Shape::Stripes => Mask::Stripes,
            Shape::Checker => Mask::Checker,
            Shape::Dots => Mask::Dots,
            Shape::Image => {
                let Some(image) = inputs.image("pattern") else {
                    return Err(Error::compute("shape is image, and there is none", "connect a picture to pattern"));
                };
                Mask::Image(tiles(image, job)?)
            }
        };
        let pattern = Pattern { shape, fill: self.fill, softness: self.softness, strength: self.strength };
        let (samples, direction) = (inputs.whole_samples("samples"), self.direction.map(Vec3::from));
        let (angle, offset) = (self.angle.to_radians(), self.offset.into());
        let laid = Laid::new(ratio, samples, self.scale, angle, offset, direction)?;
        let (cut, told) = pattern.apply(ratio, &laid)?;
        job.note("fading", told.fading);
        job.note("faded", told.faded);
        if told.faded > 0.2 {
            let percent = (100.0 * told.faded).round();
            job.warn(format!("on {percent} % of the shadow pixels are too large for the pattern"));
        }
        Ok(vec![Value::Ratio(Arc::new(cut))])
    }
}

/// What is not finite stays in shadow, and is counted.
fn tiles(image: &Image, job: &Job) -> Result<Tiles> {
    let layer = match &image.layers[..] {
        [only] => only,
        _ => image.find("").map_err(|e| Error::compute(format!("pattern: {}", e.message), e.help))?,
    };
    let stride = layer.channels.len();
    let at = if stride == 1 { [0; 3] } else { layer.need_rgb()? };
    let mut bad = 0;
    let mut texel = |pixel: &[f32]| {
        let rgb = at.map(|channel| pixel[channel]);
        if rgb.iter().all(|x| x.is_finite()) {
            return rgb.map(|x| x.clamp(0.0, 1.0));
        }
        bad += 1;
        [1.0; 3]
    };
    let texels = layer.data.chunks_exact(stride.max(1)).map(&mut texel).collect();
    if bad > 0 {
        job.note("not_finite", bad);
        job.warn(format!("{bad} pixels of the pattern hold NaN or infinity; they are 1"));
    }
    Tiles::new(image.width, image.height, texels)
}
