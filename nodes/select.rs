//! Puts selections together.

use crate::Result;
use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::Selection;
use crate::transport::selection::Mode;
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Soft edges stay soft; a selection united or intersected with itself is itself.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Select {
    /// `union`: the larger weight; `intersect`: the smaller; `subtract`: of `a` what is not in `b`; `invert`: what is not
    /// in `a`.
    pub mode: Mode,
}

impl Node for Select {
    const INFO: Info = Info {
        name: "select",
        category: "selection",
        summary: "Union, intersection, difference or inverse of selections",
        inputs: &[
            Port::new("a", Kind::Selection, "A selection"),
            Port::new("b", Kind::Selection, "Another one, of the same scene; not for invert").optional(),
        ],
        outputs: &[Port::new("selection", Kind::Selection, "What the mode makes of them")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let selection = Selection::combined(self.mode, inputs.need_selection("a")?, inputs.selection("b"))?;
        Ok(vec![Value::Selection(selection)])
    }
}
