//! Edits sampled as scale and offset of the transfer matrix: what any stack of edits becomes for programs that know
//! nothing of its parts (thesis 5.3, eqs. 5.2 to 5.5).
//!
//! For view samples v (N, the picture's) and gather samples g (M), in each channel of linear Rec.709 light:
//!
//! ```text
//! B'(g) = s_g(g) B(g) + o_g(g)                               radiant exitance of gather samples
//! E(v)  = sum_g [ S(v,g) T(v,g) + O(v,g) ] B'(g)             irradiance at view samples
//! L'(v) = s_v(v) L(v) + o_v(v)                               indirect radiance from there to the camera
//! ```
//!
//! T is the unedited transfer, B the exitance after all bounces but the last, L = reflectance E / pi. A vector that is not
//! there is 1 (`s`) or 0 (`o`). The matrices are kept for touched view samples alone, as rows that neighbours share:
//!
//! ```text
//! S(v,g) = 1 + sum_j weights(v)[j] D_j(g)    O(v,g) = sum_j weights(v)[j] P_j(g)    j = 0..4
//! ```
//!
//! with D_j, P_j the scale and the offset row that slot j of v names (`UNTOUCHED`: both 0). A row is its largest
//! orthonormal 1D Haar coefficients along the gather samples (see `row`).
//!
//! Slot j belongs to slot j of the transfer's own interpolation (`Transfer::indices`, `Transfer::weights`), and a slot's
//! weight mostly is the transfer's, or that times the edit's weight at v. A preview multiplies the rows of a slot with each
//! other, then interpolates (`apply`):
//!
//! ```text
//! E(v) = sum_j w_j T_j.B' + weights_j [ (D_j T_j).B' + P_j.B' ]
//! ```
//!
//! Where transfer rows vary slowly that is the sum above; a renderer that has T at v itself uses S(v,g) as it stands.
//! For: holding and checking. Not for: how edits become scale and offset (`scale_offset`).

pub mod apply;
pub mod file;
pub mod fit;
pub mod origin;
pub mod patches;
mod read;
pub mod row;

pub use file::write;
pub use origin::Origin;
pub use read::read;

use crate::device::Array;
use crate::transport::selection::Digest;
use crate::transport::{Edit, Edits, SparseRows};
use crate::{Error, Result};
use rayon::prelude::*;

/// Among sides: none.
pub const NOWHERE: u32 = u32::MAX;
/// In a slot: no row.
pub const UNTOUCHED: u32 = crate::kernels::scaled_product::UNSCALED;

/// View samples, N in the order of `Samples`; zero where there is no surface.
#[derive(Clone, Debug, Default)]
pub struct ViewPlaces {
    /// Side of a triangle: twice the index among the scene's triangles, and one more on its back; `NOWHERE` for none.
    pub side: Array<u32>,
    /// Weights of the triangle's second and third corner.
    pub barycentrics: Array<[f32; 2]>,
    /// Metres, world.
    pub position: Array<[f32; 3]>,
    /// Unit shading normal.
    pub normal: Array<[f32; 3]>,
}

/// Gather samples, M in tree order.
#[derive(Clone, Debug, Default)]
pub struct GatherPlaces {
    /// Side of a triangle, as in `ViewPlaces`; none is nowhere.
    pub side: Array<u32>,
    /// Weights of the triangle's second and third corner.
    pub barycentrics: Array<[f32; 2]>,
    /// Metres, world.
    pub position: Array<[f32; 3]>,
    /// Unit normal of the triangle, on the side that the sample is on.
    pub normal: Array<[f32; 3]>,
}

/// A column of scales and one of offsets (eq. 5.5): fourth elements are 1 and 0. `None`: all 1, all 0.
#[derive(Clone, Debug, Default)]
pub struct Vectors {
    pub scale: Option<Array<[f32; 4]>>,
    pub offset: Option<Array<[f32; 4]>>,
}

#[derive(Clone, Debug)]
pub struct Parts {
    /// What it was sampled for.
    pub origin: Origin,
    pub view: ViewPlaces,
    pub gather: GatherPlaces,
    /// s_g and o_g, M.
    pub source: Vectors,
    /// s_v and o_v, N.
    pub eye: Vectors,
    /// View samples that have rows: increasing.
    pub touched: Array<u32>,
    /// Of each touched sample: four rows, `UNTOUCHED` for none, and what each counts.
    pub slots: Array<[u32; 4]>,
    pub weights: Array<[f32; 4]>,
    /// Haar coefficients of S - 1: three rows (red, green, blue) of M columns for each row that slots name.
    pub scales: SparseRows,
    /// Haar coefficients of O, as many rows.
    pub offsets: Option<SparseRows>,
}

/// Sound parts, and a hash of them.
#[derive(Clone, Debug)]
pub struct Sampled {
    parts: Parts,
    digest: Digest,
}

impl std::ops::Deref for Sampled {
    type Target = Parts;
    fn deref(&self) -> &Parts {
        &self.parts
    }
}

impl PartialEq for Sampled {
    fn eq(&self, other: &Self) -> bool {
        self.digest == other.digest
    }
}

impl Sampled {
    /// # Errors
    /// `Compute` when lengths do not fit each other, an index is out of range, or a number is not finite.
    pub fn new(parts: Parts) -> Result<Self> {
        match parts.fault() {
            None => Ok(Self { digest: parts.digest(), parts }),
            Some(fault) => Err(Error::compute(format!("sampled edits are damaged: {fault}"), "sample the edits anew")),
        }
    }

    /// Equal digests, equal edits.
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// Light comes through them bit by bit.
    pub fn changes_nothing(&self) -> bool {
        let Vectors { scale, offset } = &self.source;
        let vectors = [scale, offset, &self.eye.scale, &self.eye.offset];
        self.touched.is_empty() && vectors.iter().all(|vector| vector.is_none())
    }

    /// Scale (and offset) rows, each for all three channels.
    pub fn rows(&self) -> usize {
        self.scales.rows() / 3
    }

    /// Bytes of memory by part: what it was sampled for, vectors, slots, rows.
    pub fn bytes_by_part(&self) -> [(&'static str, u64); 4] {
        let vector = |vector: &Option<Array<[f32; 4]>>| vector.as_ref().map_or(0, |vector| 16 * vector.len() as u64);
        let vectors = |vectors: &Vectors| vector(&vectors.scale) + vector(&vectors.offset);
        [
            ("places", 36 * self.view.position.len() as u64 + 36 * self.gather.side.len() as u64),
            ("vectors", vectors(&self.source) + vectors(&self.eye)),
            ("slots", 36 * self.touched.len() as u64),
            ("rows", self.scales.bytes() + self.offsets.as_ref().map_or(0, SparseRows::bytes)),
        ]
    }

    pub fn bytes(&self) -> u64 {
        self.bytes_by_part().iter().map(|(_, bytes)| bytes).sum()
    }
}

/// The one sampled edit of a list that holds nothing else.
///
/// # Errors
/// `Compute`: what the list holds instead.
pub fn only(edits: &Edits) -> Result<&Sampled> {
    let found = match &edits.0[..] {
        [Edit::Sampled(sampled)] => return Ok(sampled),
        [] => "no edit at all".to_owned(),
        list => {
            let sampled = edits.sampled().count();
            format!("{} edits, {sampled} of them sampled", list.len())
        }
    };
    let help = "put scale_offset before it: that makes one sampled edit of any list that changes something";
    Err(Error::compute(format!("one sampled edit is asked for, the list holds {found}"), help))
}

impl Parts {
    /// What is wrong with them, if anything.
    fn fault(&self) -> Option<String> {
        let (view, gather) = (self.origin.view_samples(), self.origin.gather_samples);
        let length = |what: &str, found: usize, expected: usize| {
            (found != expected).then(|| format!("{what}: {found} elements, expected {expected}"))
        };
        let vector = |what: &str, vector: &Option<Array<[f32; 4]>>, expected: usize| {
            let vector = vector.as_ref()?;
            length(what, vector.len(), expected).or_else(|| finite(what, vector))
        };
        let lengths = || {
            length("view.side", self.view.side.len(), view)
                .or_else(|| length("view.barycentrics", self.view.barycentrics.len(), view))
                .or_else(|| length("view.position", self.view.position.len(), view))
                .or_else(|| length("view.normal", self.view.normal.len(), view))
                .or_else(|| length("gather.side", self.gather.side.len(), gather))
                .or_else(|| length("gather.barycentrics", self.gather.barycentrics.len(), gather))
                .or_else(|| length("gather.position", self.gather.position.len(), gather))
                .or_else(|| length("gather.normal", self.gather.normal.len(), gather))
                .or_else(|| length("slots", self.slots.len(), self.touched.len()))
                .or_else(|| length("weights", self.weights.len(), self.touched.len()))
        };
        let numbers = || {
            finite("view.barycentrics", &self.view.barycentrics)
                .or_else(|| finite("view.position", &self.view.position))
                .or_else(|| finite("view.normal", &self.view.normal))
                .or_else(|| finite("gather.barycentrics", &self.gather.barycentrics))
                .or_else(|| finite("gather.position", &self.gather.position))
                .or_else(|| finite("gather.normal", &self.gather.normal))
                .or_else(|| finite("weights", &self.weights))
        };
        let vectors = || {
            vector("source.scale", &self.source.scale, gather)
                .or_else(|| vector("source.offset", &self.source.offset, gather))
                .or_else(|| vector("eye.scale", &self.eye.scale, view))
                .or_else(|| vector("eye.offset", &self.eye.offset, view))
        };
        let rows = || {
            let offsets = self.offsets.as_ref().and_then(|rows| rows_fault("offset rows", rows, gather));
            let counts = || length("offset rows", self.offsets.as_ref()?.rows(), self.scales.rows());
            rows_fault("scale rows", &self.scales, gather).or(offsets).or_else(counts)
        };
        self.origin.fault().or_else(lengths).or_else(numbers).or_else(vectors).or_else(rows).or_else(|| self.indices())
    }

    fn indices(&self) -> Option<String> {
        let (view, rows) = (self.origin.view_samples(), self.scales.rows() / 3);
        let triangles = self.origin.triangles;
        let is_there = |side: &u32| ((*side / 2) as usize) < triangles;
        if let Some(at) = self.gather.side.iter().position(|side| !is_there(side)) {
            return Some(format!("gather sample {at} is on side {} of {triangles} triangles", self.gather.side[at]));
        }
        let on_scene = |side: &u32| *side == NOWHERE || is_there(side);
        if let Some(at) = self.view.side.iter().position(|side| !on_scene(side)) {
            return Some(format!("view sample {at} is on side {} of {triangles} triangles", self.view.side[at]));
        }
        if let Some(at) = self.touched.windows(2).position(|pair| pair[0] >= pair[1]) {
            return Some(format!("touched: view sample {} follows {}", self.touched[at + 1], self.touched[at]));
        }
        if let Some(last) = self.touched.last().filter(|last| **last as usize >= view) {
            return Some(format!("touched: view sample {last} of {view}"));
        }
        let there = |row: &u32| *row == UNTOUCHED || (*row as usize) < rows;
        let wrong = self.slots.par_iter().position_first(|slots| !slots.iter().all(there))?;
        Some(format!("slots of view sample {}: rows {:?} of {rows}", self.touched[wrong], self.slots[wrong]))
    }

    fn digest(&self) -> Digest {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&serde_json::to_vec(&self.origin).expect("plain data"));
        let mut part = |bytes: &[u8]| {
            hasher.update(&(bytes.len() as u64).to_le_bytes()).update_rayon(bytes);
        };
        part(bytemuck::cast_slice(&self.view.side));
        part(bytemuck::cast_slice(&self.view.barycentrics));
        part(bytemuck::cast_slice(&self.view.position));
        part(bytemuck::cast_slice(&self.view.normal));
        part(bytemuck::cast_slice(&self.gather.side));
        part(bytemuck::cast_slice(&self.gather.barycentrics));
        part(bytemuck::cast_slice(&self.gather.position));
        part(bytemuck::cast_slice(&self.gather.normal));
        for vector in [&self.source.scale, &self.source.offset, &self.eye.scale, &self.eye.offset] {
            part(&[u8::from(vector.is_some())]);
            vector.iter().for_each(|vector| part(bytemuck::cast_slice(vector)));
        }
        part(bytemuck::cast_slice(&self.touched));
        part(bytemuck::cast_slice(&self.slots));
        part(bytemuck::cast_slice(&self.weights));
        for rows in [Some(&self.scales), self.offsets.as_ref()].into_iter().flatten() {
            part(bytemuck::cast_slice(rows.offsets()));
            part(bytemuck::cast_slice(rows.entries()));
            part(bytemuck::cast_slice(rows.scale()));
        }
        hasher.finalize().as_bytes()[..16].try_into().expect("16 of 32 bytes")
    }
}

fn finite<const C: usize>(what: &str, values: &[[f32; C]]) -> Option<String> {
    let bad = |value: &[f32; C]| !value.iter().all(|x| x.is_finite());
    let at = values.par_iter().with_min_len(1 << 14).position_first(bad)?;
    Some(format!("{what}: element {at} is {:?}", values[at]))
}

/// Three rows of M columns for each, coefficients in the order of their numbers.
fn rows_fault(what: &str, rows: &SparseRows, columns: usize) -> Option<String> {
    if rows.columns() != columns || !rows.format().signed || !rows.rows().is_multiple_of(3) {
        let (found, signed) = (rows.columns(), rows.format().signed);
        return Some(format!("{what}: {} of {found} columns, signed: {signed}; expected {columns}, true", rows.rows()));
    }
    let unpack = |entry: &u32| rows.format().unpack(*entry).0;
    let in_order = |row: &usize| {
        let range = rows.offsets()[*row] as usize..rows.offsets()[*row + 1] as usize;
        rows.entries()[range].is_sorted_by(|a, b| unpack(a) < unpack(b))
    };
    let row = (0..rows.rows()).into_par_iter().with_min_len(256).find_first(|row| !in_order(row))?;
    Some(format!("{what}: the coefficients of row {row} are not in order"))
}
