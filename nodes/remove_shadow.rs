//! Fades shadows or removes them: what blocks the light lets it through (thesis 6.7.3).

use crate::Result;
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::shadow::ShadowChange;
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Light that comes from where no light is connected, samples that are not selected, and shadows of other groups keep
/// every bit.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RemoveShadow {
    /// Share of the shadow that goes; 1 removes it.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub amount: f32,
    /// The visibility group whose shadow it is; without it, of all objects.
    pub group: Option<String>,
}

impl Default for RemoveShadow {
    fn default() -> Self {
        Self { amount: 1.0, group: None }
    }
}

/// The inputs of all nodes that edit shadows.
pub const INPUTS: &[Port] = &[
    Port::new("visibility", Kind::Visibility, "What samples see, with edits that come before this one"),
    Port::new("light", Kind::Light, "Whose shadow; without it, that of all light").optional(),
    Port::new("selection", Kind::Selection, "Where; without it, everywhere").optional(),
];

/// The output of all nodes that edit shadows.
pub const OUTPUTS: &[Port] = &[Port::new("visibility", Kind::Visibility, "The same, with this edit at its end")];

impl Node for RemoveShadow {
    const INFO: Info = Info {
        name: "remove_shadow",
        category: "shadows",
        summary: "Fades or removes shadows under an environment",
        inputs: INPUTS,
        outputs: OUTPUTS,
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.amount == 0.0).then_some("visibility")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        inputs.visibility_and(self.group.as_deref(), ShadowChange::Fade { amount: self.amount })
    }
}
