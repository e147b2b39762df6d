//! Precomputes how light gets from all surfaces to a view (thesis 5.5.1, DESIGN section 7). Kept on disk.

use crate::Result;
use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::transport::Basis;
use crate::transport::blocks::Blocks;
use crate::transport::glossy::Gloss;
use crate::transport::precompute::{Estimator, Placement, Quality, Settings, precompute, precompute_part};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Transfer {
    /// Points that stand for all surfaces as sources of indirect light; a power of two.
    #[schemars(range(min = 2, max = 1048576))]
    pub gather_samples: u32,
    /// Asked relative error of indirect light (root mean square over 4 x 4-pixel blocks): rays a row and the places of
    /// rows follow from it.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub tolerance: f32,
    /// Times that light is reflected before it reaches the view.
    #[schemars(range(min = 1, max = 64))]
    pub bounces: u32,
    /// `rays` credits stratified rays where they land; `points` connects every row to every gather sample (thesis), for
    /// comparison.
    pub estimator: Estimator,
    /// `cut` keeps pairs of tree node and weight; `haar` the largest Haar coefficients (thesis), for comparison.
    pub basis: Basis,
    /// Haar coefficients kept a row.
    #[schemars(range(min = 1, max = 65536))]
    pub coefficients: u32,
    /// `adaptive` computes rows where the picture needs them and interpolates the light between; `every` one a sample.
    pub rows: Placement,
    /// Highlights of indirect light on surfaces that are not matte: `ggx` as direct light has them, `blinn` (thesis) for
    /// comparison, `none` for diffuse light alone. Relight computes what they need when it meets such a surface.
    pub glossy: Gloss,
}

impl Default for Transfer {
    fn default() -> Self {
        Self {
            gather_samples: 65536,
            tolerance: 0.02,
            bounces: 1,
            estimator: Estimator::Rays,
            basis: Basis::Cut,
            coefficients: 100,
            rows: Placement::Adaptive,
            glossy: Gloss::Ggx,
        }
    }
}

const PLACES: &[Facet] = &[Facet::Geometry];

impl Node for Transfer {
    const INFO: Info = Info {
        name: "transfer",
        category: "indirect light",
        summary: "How light gets from all surfaces to the view: the precomputation behind relight",
        inputs: &[
            Port::new("scene", Kind::Scene, "The surfaces").reads(PLACES),
            Port::new("samples", Kind::Samples, "The view").reads(PLACES),
        ],
        outputs: &[Port::new("transfer", Kind::Transfer, "Gather samples and the sparse gather-to-view matrix")],
        version: 3,
        stored: true,
        in_parts: true,
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let geometry = inputs.geometry("scene")?;
        let samples = inputs.need_whole_samples("samples")?;
        samples.check(&geometry)?;
        let settings = Settings {
            gather_samples: self.gather_samples as usize,
            bounces: self.bounces,
            basis: self.basis,
            coefficients: self.coefficients as usize,
            estimator: self.estimator,
            glossy: self.glossy,
            quality: Quality::of(self.tolerance, self.rows),
        };
        let blocks = Blocks { memo: job.memo, key: job.key };
        if let Some(part) = job.part {
            let computed = precompute_part(job.device, &geometry, samples, &settings, (&blocks, part), job.progress)?;
            job.note("blocks_computed", computed);
            return Ok(Vec::new());
        }
        let (transfer, cost) = precompute(job.device, &geometry, samples, &settings, &blocks, job.progress)?;
        job.note("rows", cost.rows);
        job.note("rays", cost.rays);
        if cost.kept > 0 {
            job.note("rays_kept", cost.kept);
        }
        if cost.found > 0 {
            job.note("rows_found", cost.found);
        }
        job.note("entries", cost.entries);
        job.note("entries_per_row", (cost.entries as f64 / cost.rows.max(1) as f64).round());
        if self.bounces > 1 {
            job.note("entries_between_gather_samples", cost.between);
        }
        job.note("rays_per_row", settings.quality.rays);
        Ok(vec![Value::Transfer(Arc::new(transfer))])
    }
}
