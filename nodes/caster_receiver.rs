//! Changes the indirect light that one set of surfaces sends to another (thesis 4.4.2, Algorithm 4).

use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::edits::{Block, Change, Colour, Edit, Transit};
use crate::transport::tone_curve::ToneCurve;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Acts on irradiance, before the receiver's own colour: brightness, saturation and hue first, then the curve.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CasterReceiver {
    /// Factor of the light.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub brightness: f32,
    /// 0 is grey, 1 as it is; keeps luminance.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub saturation: f32,
    /// Turns hues about the grey axis, red towards green; keeps luminance.
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees"))]
    pub hue: f32,
    /// A curve on the light's intensity: softer or steeper falloff.
    pub curve: ToneCurve,
}

impl Default for CasterReceiver {
    fn default() -> Self {
        Self { brightness: 1.0, saturation: 1.0, hue: 0.0, curve: ToneCurve::None }
    }
}

const NAMES: &[Facet] = &[Facet::Geometry];

impl Node for CasterReceiver {
    const INFO: Info = Info {
        name: "caster_receiver",
        category: "indirect light",
        summary: "Changes the indirect light that casters send to receivers",
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
        if let Some(fault) = self.curve.fault() {
            return Err(Error::compute(format!("curve: {fault}"), "correct the curve parameter"));
        }
        let block =
            Block { caster: inputs.selection("caster").cloned(), receiver: inputs.selection("receiver").cloned() };
        Ok(inputs.edits_and(Edit::Transit(Transit { block, change: self.change() })))
    }
}

impl CasterReceiver {
    fn change(&self) -> Change {
        let Self { brightness, saturation, hue, curve } = self.clone();
        Change::Colour(Colour { brightness, saturation, hue, curve })
    }
}
