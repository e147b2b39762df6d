//! Changes how indirect light falls off with distance (thesis 5.4.2, figure 5.2c).

use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::edits::{Block, Change, Edit, Transit};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Light from afar gains and light from near loses when `exponent` is below 2, and the other way round above it; light
/// from `distance` away stays as it is. Light from nearer than gather samples are apart counts as from there.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Falloff {
    /// The power of distance that light falls off with; 2 is physical.
    #[schemars(range(min = -4.0, max = 8.0))]
    pub exponent: f32,
    /// From there, light arrives as it does without the edit.
    #[schemars(range(min = 1e-6, max = 1e6), extend("unit" = "metres"))]
    pub distance: f32,
}

impl Default for Falloff {
    fn default() -> Self {
        Self { exponent: 2.0, distance: 1.0 }
    }
}

const NAMES: &[Facet] = &[Facet::Geometry];

impl Node for Falloff {
    const INFO: Info = Info {
        name: "falloff",
        category: "indirect light",
        summary: "Changes how indirect light falls off with distance",
        inputs: &[
            Port::new("caster", Kind::Selection, "Where the light comes from; without it, everywhere")
                .optional()
                .reads(NAMES),
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
        let block =
            Block { caster: inputs.selection("caster").cloned(), receiver: inputs.selection("receiver").cloned() };
        Ok(inputs.edits_and(Edit::Transit(Transit { block, change: self.change() })))
    }
}

impl Falloff {
    fn change(&self) -> Change {
        Change::Falloff { exponent: self.exponent, distance: self.distance }
    }
}
