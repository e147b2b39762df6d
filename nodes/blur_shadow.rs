//! Softens shadows as if the light were larger (thesis 6.6, Shadow Blur).

use crate::Result;
use crate::node::{Info, Inputs, Job, Node};
use crate::nodes::remove_shadow::{INPUTS, OUTPUTS};
use crate::transport::shadow::ShadowChange;
use crate::value::Value;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What blocks the light is blurred over directions; the light itself stays as sharp and as strong as it is.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BlurShadow {
    /// Standard deviation of the Gaussian. A disc-shaped lamp of angular radius r has the softness of r / 2.
    #[schemars(range(min = 0.0, max = 60.0), extend("unit" = "degrees"))]
    pub angle: f32,
    /// The visibility group whose shadow it is; without it, of all objects.
    pub group: Option<String>,
}

impl Default for BlurShadow {
    fn default() -> Self {
        Self { angle: 0.0, group: None }
    }
}

impl Node for BlurShadow {
    const INFO: Info = Info {
        name: "blur_shadow",
        category: "shadows",
        summary: "Softens shadows as if the light were larger",
        inputs: INPUTS,
        outputs: OUTPUTS,
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.angle == 0.0).then_some("visibility")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        inputs.visibility_and(self.group.as_deref(), ShadowChange::Blur { angle: self.angle.to_radians() })
    }
}
