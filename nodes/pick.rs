//! Selects surfaces by the names of their objects and materials.

use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::Selection;
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A surface is picked when its object matches one of `objects` and its material one of `materials`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Pick {
    /// Patterns with `*`, `?` and `[...]`; empty: any object.
    pub objects: Vec<String>,
    /// Patterns with `*`, `?` and `[...]`; empty: any material.
    pub materials: Vec<String>,
}

impl Node for Pick {
    const INFO: Info = Info {
        name: "pick",
        category: "selection",
        summary: "Selects surfaces by object and material names",
        inputs: &[Port::new("scene", Kind::Scene, "Where the names come from").reads(&[Facet::Geometry])],
        outputs: &[Port::new("selection", Kind::Selection, "1 on what is picked, 0 elsewhere")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let geometry = inputs.geometry("scene")?;
        let selection = Selection::by_name(&geometry, &self.objects, &self.materials)?;
        Ok(vec![Value::Selection(Arc::new(selection))])
    }
}
