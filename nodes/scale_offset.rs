//! Samples edits as scale and offset of the transfer matrix (thesis 5.3): a form that other programs can apply.

use super::relight::stage;
use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::lighting::SceneLight;
use crate::transport::scale_offset::{Settings, sample};
use crate::transport::{Edit, Edits};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What it finds holds for the scene, the view and the transfer that it is given, and for the light at that moment where
/// edits are not linear in light; `write_edits` keeps it.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ScaleOffset {
    /// Haar coefficients of a row, at most.
    #[schemars(range(min = 1, max = 65536))]
    pub coefficients: u32,
    /// What a row may leave out, relative (root of the sum of squares).
    #[schemars(range(min = 0.0001, max = 1.0))]
    pub tolerance: f32,
    /// As in relight.
    #[schemars(range(min = 1, max = 4096))]
    pub light_samples: u32,
}

impl Default for ScaleOffset {
    fn default() -> Self {
        Self { coefficients: 100, tolerance: 0.01, light_samples: 16 }
    }
}

impl Node for ScaleOffset {
    const INFO: Info = Info {
        name: "scale_offset",
        category: "indirect light",
        summary: "Samples edits as scale and offset of the transfer, for other programs",
        inputs: &[
            Port::new("scene", Kind::Scene, "Lights and materials that the edits are sampled under").reads(&[
                Facet::Geometry,
                Facet::Materials,
                Facet::Lights,
            ]),
            Port::new("transfer", Kind::Transfer, "The matrix that they change"),
            Port::new("edits", Kind::Edits, "Edits to sample"),
        ],
        outputs: &[Port::new("edits", Kind::Edits, "One edit, sampled")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let (geometry, materials) = (inputs.geometry("scene")?, inputs.materials("scene")?);
        let transfer = inputs.need_transfer("transfer")?;
        transfer.samples.check(&geometry)?;
        let stage = stage(inputs, job, &geometry, transfer);
        let stuff = inputs.key("scene", Facet::Materials).expect("the scene is connected");
        let light = SceneLight::new(&stage, &materials, stuff, &inputs.lights("scene")?, self.light_samples)?;
        let settings = Settings { coefficients: self.coefficients as usize, tolerance: self.tolerance };
        let (sampled, cost) = sample(&light, inputs.need_edits("edits")?, settings)?;
        for (part, bytes) in sampled.bytes_by_part() {
            job.note(&format!("bytes_of_{part}"), bytes);
        }
        job.note("rows", cost.rows);
        job.note("coefficients", cost.coefficients);
        job.note("rows_cut_short", cost.cut_short);
        job.note("error", cost.error);
        job.note("changed_samples", cost.changed);
        if cost.cut_short > 0 {
            let (short, rows, most) = (cost.cut_short, cost.rows, self.coefficients);
            job.warn(format!(
                "{short} of {rows} rows need more than {most} coefficients for their tolerance; the picture is off by {:.2} %",
                100.0 * cost.error
            ));
        }
        Ok(vec![Value::Edits(Arc::new(Edits::default().and(Edit::Sampled(Arc::new(sampled)))))])
    }
}
