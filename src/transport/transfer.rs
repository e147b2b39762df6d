//! Transfer: how much of the light that leaves each gather sample arrives at each view sample (thesis eq. 5.1).
//!
//! `E(v) = sum_j weights[v][j] * rows[indices[v][j]] . basis(B)`, with `B` the radiant exitance of the gather samples and
//! `E` the irradiance at view samples, both W/m². Rows do not depend on lights or materials, so they outlive every
//! change of those.

use crate::device::{Array, Device};
use crate::kernels::{average_pyramid, haar_encode, interpolate, sparse_product};
use crate::transport::gather::Gather;
use crate::transport::precompute::Settings;
use crate::transport::samples::Samples;
use crate::transport::sparse::SparseRows;
use crate::{Error, Result};
use std::sync::Arc;

/// What the columns of rows stand for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// Nodes of the gather tree against a pyramid of averages: positive weights, no ringing.
    #[default]
    Cut,
    /// The largest coefficients of an orthonormal 1D Haar basis along the ordered gather samples (thesis 5.5.1).
    Haar,
}

impl Basis {
    /// Bits of a column for `count` gather samples.
    pub fn index_bits(self, count: usize) -> u32 {
        count.ilog2() + u32::from(self == Self::Cut)
    }
}

#[derive(Clone, Debug)]
pub struct Transfer {
    /// The view samples that rows are for.
    pub samples: Arc<Samples>,
    pub gather: Gather,
    /// What it was asked for: rows that edits need beyond these are computed alike.
    pub settings: Settings,
    /// Rows x basis functions.
    pub rows: SparseRows,
    /// View sample of each row.
    pub row_samples: Array<u32>,
    /// Rows that each view sample interpolates between, and their weights.
    pub indices: Array<[u32; 4]>,
    pub weights: Array<[f32; 4]>,
    /// Gather-to-gather rows, one a gather sample, when there is more than one bounce (thesis 3.1.1).
    pub between: Option<SparseRows>,
}

impl Transfer {
    pub fn bytes(&self) -> u64 {
        let between = self.between.as_ref().map_or(0, SparseRows::bytes);
        self.samples.bytes()
            + self.gather.bytes()
            + self.rows.bytes()
            + between
            + 32 * self.indices.len() as u64
            + 4 * self.row_samples.len() as u64
    }

    /// Coefficients of `count` vectors of light over the gather samples, one after another.
    pub fn encode(&self, device: &Device, light: &[[f32; 4]], count: usize) -> Result<Vec<[f32; 4]>> {
        match self.settings.basis {
            Basis::Cut => average_pyramid(device, light, count),
            Basis::Haar => haar_encode(device, light, count),
        }
    }

    /// Irradiance at the view samples from the exitance of the gather samples, for `count` vectors at once.
    ///
    /// Errors: the light was made for another number of gather samples.
    pub fn apply(&self, device: &Device, exitance: &[[f32; 4]], count: usize) -> Result<Vec<[f32; 4]>> {
        self.check(exitance.len(), count)?;
        let encoded = self.encode(device, exitance, count)?;
        let rows = sparse_product(device, &self.rows, &encoded, count)?;
        interpolate(device, &self.indices, &self.weights, &rows, count)
    }

    /// Irradiance at the gather samples from their own exitance: one more bounce.
    pub fn bounce(&self, device: &Device, exitance: &[[f32; 4]]) -> Result<Vec<[f32; 4]>> {
        self.check(exitance.len(), 1)?;
        match &self.between {
            Some(between) => sparse_product(device, between, &self.encode(device, exitance, 1)?, 1),
            None => Ok(vec![[0.0; 4]; exitance.len()]),
        }
    }

    fn check(&self, found: usize, count: usize) -> Result<()> {
        let expected = self.gather.count() * count;
        if found != expected {
            let message = format!("light at {found} gather samples, the transfer has {expected}");
            return Err(Error::compute(message, "connect the same scene to transfer and relight"));
        }
        Ok(())
    }
}
