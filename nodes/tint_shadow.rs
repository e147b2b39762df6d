//! Colours shadows: what blocks the light lets one colour of it through (thesis 6.6).

use crate::Result;
use crate::node::{Info, Inputs, Job, Node};
use crate::nodes::remove_shadow::{INPUTS, OUTPUTS};
use crate::transport::shadow::ShadowChange;
use crate::value::Value;
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Visibility is a number per colour from here on. Black changes nothing, white removes the shadow.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TintShadow {
    /// Share of red, green and blue that comes through, linear.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub colour: [f32; 3],
    /// Times the colour.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub amount: f32,
    /// The visibility group whose shadow it is; without it, of all objects.
    pub group: Option<String>,
}

impl Default for TintShadow {
    fn default() -> Self {
        Self { colour: [0.0; 3], amount: 1.0, group: None }
    }
}

impl Node for TintShadow {
    const INFO: Info = Info {
        name: "tint_shadow",
        category: "shadows",
        summary: "Colours shadows under an environment",
        inputs: INPUTS,
        outputs: OUTPUTS,
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.amount == 0.0 || self.colour == [0.0; 3]).then_some("visibility")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let change = ShadowChange::Tint { amount: self.amount, colour: Vec3::from(self.colour) };
        inputs.visibility_and(self.group.as_deref(), change)
    }
}
