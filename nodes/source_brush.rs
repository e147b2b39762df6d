//! Changes the indirect light that surfaces send (thesis 4.4.3, Algorithm 5).

use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::edits::{Edit, SourceBrush as Brush};
use crate::value::{Kind, Value};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Acts where light leaves a surface towards other surfaces; the surface itself looks as before, unless light comes back
/// to it by further bounces.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SourceBrush {
    /// Factor of the light that the surfaces send.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub scale: f32,
    /// Light that they send besides (radiant exitance, red, green, blue): makes any object a light source.
    #[schemars(inner(range(min = 0.0, max = 1e6)), extend("unit" = "W/m²"))]
    pub offset: [f32; 3],
}

impl Default for SourceBrush {
    fn default() -> Self {
        Self { scale: 1.0, offset: [0.0; 3] }
    }
}

impl Node for SourceBrush {
    const INFO: Info = Info {
        name: "source_brush",
        category: "indirect light",
        summary: "Makes surfaces send more or less indirect light, or light of their own",
        inputs: &[
            Port::new("selection", Kind::Selection, "Surfaces that send; without it, all")
                .optional()
                .reads(&[Facet::Geometry]),
            Port::new("edits", Kind::Edits, "Edits that come before this one").optional(),
        ],
        outputs: &[Port::new("edits", Kind::Edits, "The list with this edit at its end")],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        self.brush(None).changes_nothing().then_some("edits")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        Ok(inputs.edits_and(Edit::Source(self.brush(inputs.selection("selection").cloned()))))
    }
}

impl SourceBrush {
    fn brush(&self, selection: Option<Arc<crate::transport::Selection>>) -> Brush {
        Brush { selection, scale: self.scale, offset: Vec3::from(self.offset) }
    }
}
