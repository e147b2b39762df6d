//! Makes indirect light arrive as if more of it came from one side (thesis figure 5.1c).

use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::edits::{Block, Change, Edit, Transit};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Light from the side of `axis` gains and light from the other side loses; over all directions the mean stays.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Directionality {
    /// Towards where light is to come from, in world space; need not have unit length.
    pub axis: [f32; 3],
    /// 0 leaves light as it is; 1 takes all of it from the lobe about the axis.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub amount: f32,
    /// Width of the lobe: 1 reaches all around and leaves only the opposite direction dark, larger is narrower.
    #[schemars(range(min = 0.0, max = 64.0))]
    pub focus: f32,
}

impl Default for Directionality {
    fn default() -> Self {
        Self { axis: [0.0, 1.0, 0.0], amount: 0.0, focus: 1.0 }
    }
}

const NAMES: &[Facet] = &[Facet::Geometry];

impl Node for Directionality {
    const INFO: Info = Info {
        name: "directionality",
        category: "indirect light",
        summary: "Makes indirect light arrive as if more of it came from one side",
        inputs: &[
            Port::new("receiver", Kind::Selection, "Where it arrives; without it, everywhere").optional().reads(NAMES),
            Port::new("edits", Kind::Edits, "Edits that come before this one").optional(),
        ],
        outputs: &[Port::new("edits", Kind::Edits, "The list with this edit at its end")],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        self.change().changes_nothing().then_some("edits")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        if self.axis() == Vec3::ZERO {
            let message = format!("axis {:?} has no direction", self.axis);
            return Err(Error::compute(message, "give the direction towards the light, such as [1, 0, 0]"));
        }
        let block = Block { caster: None, receiver: inputs.selection("receiver").cloned() };
        Ok(inputs.edits_and(Edit::Transit(Transit { block, change: self.change() })))
    }
}

impl Directionality {
    fn change(&self) -> Change {
        Change::Directionality { axis: self.axis(), amount: self.amount, focus: self.focus }
    }

    /// Of unit length, also where squares of its parts are beyond f32; 0 where it has no direction.
    fn axis(&self) -> Vec3 {
        let axis = Vec3::from(self.axis);
        (axis / axis.abs().max_element().max(f32::MIN_POSITIVE)).normalize_or_zero()
    }
}
