//! Bends a shadow with a lattice of control points (thesis 6.7.5, figure 6.11).

use crate::node::{Info, Inputs, Job, Node, Port};
use crate::transport::shadow::ratio::frame::Units;
use crate::transport::shadow::ratio::lattice::Lattice;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Each cell of the lattice carries what was in its part of the frame to where its corners are (mean-value coordinates).
/// What the lattice leaves bare has no shadow; outside of the frame nothing changes unless a cell is pulled over it.
/// Where it is folded over itself the last cell is seen, counted from the upper left, row by row; the report counts
/// folded cells (`folded_cells`) and pixels under more than one (`doubled_pixels`).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RatioLattice {
    /// Cells down.
    #[schemars(range(min = 1, max = 64))]
    pub rows: u32,
    /// Cells across.
    #[schemars(range(min = 1, max = 64))]
    pub columns: u32,
    /// (rows + 1) x (columns + 1) control points, row by row from the upper left; y points down. Empty: nothing is bent.
    #[schemars(extend("unit" = "heights"))]
    pub points: Vec<[f64; 2]>,
    /// How far the points are moved from where nothing is bent: 1 all the way.
    pub amount: f64,
    /// The part of the picture that is bent: its upper left and lower right corner. Without it: all of the picture.
    #[schemars(extend("unit" = "heights"))]
    pub frame: Option<[[f64; 2]; 2]>,
}

impl Default for RatioLattice {
    fn default() -> Self {
        Self { rows: 3, columns: 4, points: Vec::new(), amount: 1.0, frame: None }
    }
}

impl Node for RatioLattice {
    const INFO: Info = Info {
        name: "ratio_lattice",
        category: "shadows",
        summary: "Bends a shadow with a lattice of control points",
        inputs: &[Port::new("ratio", Kind::Ratio, "The shadow")],
        outputs: &[Port::new("ratio", Kind::Ratio, "The bent shadow")],
        ..Info::NEW
    };

    fn pass_through(&self) -> Option<&'static str> {
        (self.points.is_empty() || self.amount == 0.0).then_some("ratio")
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let ratio = inputs.need_ratio("ratio")?;
        let units = Units::heights(ratio);
        if !self.amount.is_finite() {
            return Err(Error::compute(format!("amount is {}", self.amount), "give a finite number"));
        }
        let frame = self.frame.map_or([DVec2::ZERO, units.size(ratio)], |frame| frame.map(DVec2::from));
        let (rows, columns) = (self.rows as usize, self.columns as usize);
        let mut lattice = Lattice { rows, columns, frame, points: Vec::new() };
        lattice.points = self.points.iter().copied().map(DVec2::from).collect();
        lattice.check()?;
        for (point, rest) in lattice.points.iter_mut().zip(Lattice::rest(rows, columns, frame)) {
            *point = rest + (*point - rest) * self.amount;
        }
        let (bent, told) = lattice.apply(job.device, ratio, units)?;
        job.note("folded_cells", told.folded);
        if told.folded > 0 {
            job.note("doubled_pixels", told.doubled);
            let all = rows * columns;
            job.warn(format!("{} of {all} cells are folded, crossed or dented", told.folded));
        }
        Ok(vec![Value::Ratio(Arc::new(bent))])
    }
}
