//! Moves a shadow as a picture (thesis 6.7.5).

use crate::Result;
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::shadow::ratio::frame::Units;
use crate::transport::shadow::ratio::transform::Transform;
use crate::value::{Kind, Value};
use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Space {
    /// Heights of the picture: (0, 0) is its upper left corner, y points down, pixels are square.
    #[default]
    Screen,
    /// Texture coordinates, for ratios of texel samples: (0, 0) is the picture's upper left corner, (1, 1) its lower
    /// right one.
    Uv,
}

/// Corners first, then scale, rotation and translation. Where the shadow's picture does not reach there is no shadow.
/// Made smaller, a shadow is averaged over what each pixel covers, down to a 64th.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RatioTransform {
    /// Units of all lengths.
    pub space: Space,
    /// Right and down.
    #[schemars(extend("unit" = "heights"))]
    pub translate: [f64; 2],
    /// Counter-clockwise.
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees"))]
    pub rotate: f64,
    /// Across and down; below 0 mirrors.
    pub scale: [f64; 2],
    /// The point that rotation and scale leave where it is. Without it: the middle of the picture.
    #[schemars(extend("unit" = "heights"))]
    pub pivot: Option<[f64; 2]>,
    /// Where the picture's corners go: upper left, upper right, lower right, lower left. Without it: they stay.
    #[schemars(extend("unit" = "heights"))]
    pub corners: Option<[[f64; 2]; 4]>,
}

impl Default for RatioTransform {
    fn default() -> Self {
        let (space, pivot, corners) = (Space::Screen, None, None);
        Self { space, translate: [0.0; 2], rotate: 0.0, scale: [1.0; 2], pivot, corners }
    }
}

impl Node for RatioTransform {
    const INFO: Info = Info {
        name: "ratio_transform",
        category: "shadows",
        summary: "Moves, turns, scales a shadow, or pulls it by four corners",
        inputs: &[Port::new("ratio", Kind::Ratio, "The shadow")],
        outputs: &[Port::new("ratio", Kind::Ratio, "The moved shadow")],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        let still = self.translate == [0.0; 2] && self.rotate == 0.0 && self.scale == [1.0; 2];
        (still && self.corners.is_none()).then_some("ratio")
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let ratio = inputs.need_ratio("ratio")?;
        let units = match self.space {
            Space::Screen => Units::heights(ratio),
            Space::Uv => Units::uv(ratio),
        };
        let transform = Transform {
            translate: self.translate.into(),
            rotate: self.rotate.to_radians(),
            scale: self.scale.into(),
            pivot: self.pivot.map(DVec2::from),
            corners: self.corners.map(|corners| corners.map(DVec2::from)),
        };
        Ok(vec![Value::Ratio(Arc::new(transform.apply(job.device, ratio, units)?))])
    }
}
