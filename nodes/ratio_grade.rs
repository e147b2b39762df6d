//! Darkness and colour of a shadow (thesis 6.7.5).

use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::shadow::ratio::grade::Grade;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::{DVec2, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gradient {
    /// Where nothing changes.
    pub from: [f64; 2],
    /// Where all does.
    pub to: [f64; 2],
}

/// Works on the shadow, 1 - ratio: where there is none, none appears.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RatioGrade {
    /// Darkness: 0 takes the shadow away, 1 leaves it, 2 is as if it fell twice (ratio squared).
    #[schemars(range(min = 0.0, max = 10.0))]
    pub strength: f32,
    /// Turns the hue of the shadow (of the light that it takes away), red towards green.
    #[schemars(range(min = -360.0, max = 360.0), extend("unit" = "degrees"))]
    pub hue: f32,
    /// 0 makes the shadow grey, 1 leaves its colour.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub saturation: f32,
    /// Factor of the light that is left in the depth of the shadow; its edge stays. Black stays black.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub brightness: f32,
    /// Light that comes through, linear red, green and blue: (0, 0, 0) for none, (0, 0, 1) for all of the blue.
    pub tint: [f32; 3],
    /// Points of the picture, in heights from its upper left corner, y down: nothing changes at `from` and before, all
    /// at `to` and after. With strength 0 the shadow fades out along the line.
    pub gradient: Option<Gradient>,
}

impl Default for RatioGrade {
    fn default() -> Self {
        Self { strength: 1.0, hue: 0.0, saturation: 1.0, brightness: 1.0, tint: [0.0; 3], gradient: None }
    }
}

impl Node for RatioGrade {
    const INFO: Info = Info {
        name: "ratio_grade",
        category: "shadows",
        summary: "Darkness, hue, saturation, brightness, tint and gradient of a shadow",
        inputs: &[Port::new("ratio", Kind::Ratio, "The shadow")],
        outputs: &[Port::new("ratio", Kind::Ratio, "The graded shadow")],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        self.grade().changes_nothing().then_some("ratio")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let ratio = inputs.need_ratio("ratio")?;
        self.check()?;
        Ok(vec![Value::Ratio(Arc::new(self.grade().apply(ratio)))])
    }
}

impl RatioGrade {
    fn grade(&self) -> Grade {
        let gradient = self.gradient.map(|line| [DVec2::from(line.from), DVec2::from(line.to)]);
        let Self { strength, hue, saturation, brightness, tint, .. } = *self;
        Grade { strength, hue, saturation, brightness, tint: Vec3::from(tint), gradient }
    }

    fn check(&self) -> Result<()> {
        let wrong = |name: &str, value: f64, help: &str| Err(Error::compute(format!("{name} is {value}"), help));
        for (name, value) in
            [("strength", self.strength), ("saturation", self.saturation), ("brightness", self.brightness)]
        {
            if !(0.0..=1e3).contains(&value) {
                return wrong(name, value.into(), "give a number of 0 or more, 1 for no change");
            }
        }
        if !self.hue.is_finite() {
            return wrong("hue", self.hue.into(), "give degrees");
        }
        if let Some(bad) = self.tint.iter().find(|channel| !(0.0..=1.0).contains(*channel)) {
            return wrong("a channel of tint", (*bad).into(), "give a number from 0 to 1");
        }
        if let Some(Gradient { from, to }) = self.gradient {
            let length = DVec2::from(from).distance(to.into());
            if !(length > 1e-9 && length.is_finite()) {
                return wrong("the length of the gradient", length, "give two points");
            }
        }
        Ok(())
    }
}
