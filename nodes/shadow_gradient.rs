//! Lets a shadow fade along an arrow (thesis 6.6, Shadow Gradient).

use crate::Error;
use crate::Result;
use crate::node::{Info, Inputs, Job, Node};
use crate::nodes::remove_shadow::{INPUTS, OUTPUTS};
use crate::transport::shadow::ShadowChange;
use crate::value::Value;
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The shadow is whole at `from` and on its near side, and `amount` of it is gone at `to` and beyond.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ShadowGradient {
    /// Where the arrow starts, world space.
    #[schemars(extend("unit" = "metres"))]
    pub from: [f32; 3],
    /// Where it ends, world space.
    #[schemars(extend("unit" = "metres"))]
    pub to: [f32; 3],
    /// Share of the shadow that is gone at the arrow's end.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub amount: f32,
    /// The visibility group whose shadow it is; without it, of all objects.
    pub group: Option<String>,
}

impl Default for ShadowGradient {
    fn default() -> Self {
        Self { from: [0.0; 3], to: [0.0, 1.0, 0.0], amount: 1.0, group: None }
    }
}

impl Node for ShadowGradient {
    const INFO: Info = Info {
        name: "shadow_gradient",
        category: "shadows",
        summary: "Lets a shadow fade along an arrow",
        inputs: INPUTS,
        outputs: OUTPUTS,
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.amount == 0.0).then_some("visibility")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let (from, to) = (Vec3::from(self.from), Vec3::from(self.to));
        if (to - from).length_squared() < 1e-12 {
            let message = format!("shadow_gradient: the arrow has no length: from {from} to {to}");
            return Err(Error::compute(message, "move one of its ends"));
        }
        inputs.visibility_and(self.group.as_deref(), ShadowChange::Gradient { amount: self.amount, from, to })
    }
}
