//! Dodges, burns and tints the indirect light that surfaces show (thesis 4.4.4, Algorithm 6).

use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::edits::{Edit, IlluminationBrush as Brush};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Acts on the last segment of the light's path, from surface to camera, after all other edits and after the surface's
/// own colour; for touch-ups.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct IlluminationBrush {
    /// Factor: above 1 dodges, below 1 burns.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub scale: f32,
    /// Turns hues about the grey axis, red towards green; keeps luminance.
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees"))]
    pub hue: f32,
    /// 0 is grey, 1 as it is; keeps luminance.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub saturation: f32,
}

impl Default for IlluminationBrush {
    fn default() -> Self {
        Self { scale: 1.0, hue: 0.0, saturation: 1.0 }
    }
}

impl Node for IlluminationBrush {
    const INFO: Info = Info {
        name: "illumination_brush",
        category: "indirect light",
        summary: "Dodges, burns and tints the indirect light that surfaces show",
        inputs: &[
            Port::new("selection", Kind::Selection, "Where; without it, everywhere")
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
        Ok(inputs.edits_and(Edit::Eye(self.brush(inputs.selection("selection").cloned()))))
    }
}

impl IlluminationBrush {
    fn brush(&self, selection: Option<Arc<crate::transport::Selection>>) -> Brush {
        let Self { scale, hue, saturation } = *self;
        Brush { selection, scale, hue, saturation }
    }
}
