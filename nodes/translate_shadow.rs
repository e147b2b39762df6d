//! Moves a shadow and leaves the light where it is (thesis 6.6, Translation).

use crate::Result;
use crate::node::{Info, Inputs, Job, Node};
use crate::nodes::remove_shadow::{INPUTS, OUTPUTS};
use crate::transport::shadow::ShadowChange;
use crate::value::Value;
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The shadow falls as if the light stood elsewhere: for light through a point `p` of the cube of half side 1 around a
/// sample, what blocks it is looked up at `p - offset`. Moving visibility one way is moving the light the other way.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TranslateShadow {
    /// In world axes, on the cube of half side 1 around each sample: 0.1 is about 6 degrees.
    pub offset: [f32; 3],
    /// The visibility group whose shadow it is; without it, of all objects.
    pub group: Option<String>,
}

impl Default for TranslateShadow {
    fn default() -> Self {
        Self { offset: [0.0; 3], group: None }
    }
}

impl Node for TranslateShadow {
    const INFO: Info = Info {
        name: "translate_shadow",
        category: "shadows",
        summary: "Moves a shadow while the light stays",
        inputs: INPUTS,
        outputs: OUTPUTS,
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.offset == [0.0; 3]).then_some("visibility")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        inputs.visibility_and(self.group.as_deref(), ShadowChange::Move { offset: Vec3::from(self.offset) })
    }
}
