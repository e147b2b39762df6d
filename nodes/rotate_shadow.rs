//! Turns a shadow and leaves the light where it is (thesis 6.6, Rotation).

use crate::Error;
use crate::Result;
use crate::node::{Info, Inputs, Job, Node};
use crate::nodes::remove_shadow::{INPUTS, OUTPUTS};
use crate::transport::shadow::ShadowChange;
use crate::value::Value;
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The shadow falls as if the light had been turned the other way about the axis.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RotateShadow {
    /// World space; of any length but zero.
    pub axis: [f32; 3],
    /// Counter-clockwise, seen against the axis.
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees"))]
    pub angle: f32,
    /// The visibility group whose shadow it is; without it, of all objects.
    pub group: Option<String>,
}

impl Default for RotateShadow {
    fn default() -> Self {
        Self { axis: [0.0, 1.0, 0.0], angle: 0.0, group: None }
    }
}

impl Node for RotateShadow {
    const INFO: Info = Info {
        name: "rotate_shadow",
        category: "shadows",
        summary: "Turns a shadow while the light stays",
        inputs: INPUTS,
        outputs: OUTPUTS,
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.angle == 0.0).then_some("visibility")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let Some(axis) = Vec3::from(self.axis).try_normalize() else {
            let message = format!("rotate_shadow: the axis {:?} has no direction", self.axis);
            return Err(Error::compute(message, "set one of its components, for instance [0, 1, 0]"));
        };
        inputs.visibility_and(self.group.as_deref(), ShadowChange::Turn { axis, angle: self.angle.to_radians() })
    }
}
