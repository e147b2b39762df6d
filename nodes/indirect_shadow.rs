//! Weakens or removes shadows in indirect light (thesis 5.4.2).

use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::edits::{Block, Change, Edit, Transit};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What lies between caster and receiver, parts of the caster included, blocks less of the caster's light. Reflections
/// in glossy receivers stay.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct IndirectShadow {
    /// 0 leaves shadows as they are, 1 removes them.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub amount: f32,
}

impl Default for IndirectShadow {
    fn default() -> Self {
        Self { amount: 1.0 }
    }
}

const NAMES: &[Facet] = &[Facet::Geometry];

impl Node for IndirectShadow {
    const INFO: Info = Info {
        name: "indirect_shadow",
        category: "indirect light",
        summary: "Weakens or removes shadows in indirect light",
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

impl IndirectShadow {
    fn change(&self) -> Change {
        Change::Shadow { amount: self.amount }
    }
}
