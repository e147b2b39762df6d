//! Rows of glossy receivers: how much of the light that leaves each gather sample a surface reflects to the eye in its
//! highlight (thesis 5.3: the last bounce may be glossy).
//!
//! `L(v) = F0(v) sum_j w_j (A_j . basis(B)) + sum_j w_j (S_j . basis(B))` over the places j that view sample v
//! interpolates between, in W/(sr m²) from exitance B in W/m². `A` and `S` are parted by Schlick's Fresnel term (see
//! `kernels::glossy_rows`), so rows depend on roughness and the eye, and on no colour.

use crate::device::{Array, Device};
use crate::kernels::glossy_rows::{Lobe, Share, glossy_rows};
use crate::kernels::{interpolate, sparse_product};
use crate::progress::{Progress, Stage};
use crate::scene::{Geometry, SurfacePoint};
use crate::stored::{SectionReader, SectionWriter, Stored};
use crate::transport::pack::RowPacker;
use crate::transport::precompute::Quality;
use crate::transport::rows::{self, Grid, Spacing, Stencil};
use crate::transport::sparse::SparseRows;
use crate::transport::stored::{read_rows, write_rows};
use crate::transport::{Transfer, sampling};
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The lobe of highlights in indirect light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Gloss {
    /// Indirect light makes no highlights.
    None,
    /// Microfacets of GGX (Walter et al. 2007), as direct light has them: long tails.
    #[default]
    Ggx,
    /// Blinn-Phong microfacets (thesis), for comparison: no tails.
    Blinn,
}

#[derive(Clone, Debug)]
pub struct GlossyTransfer {
    /// Rows 2i and 2i + 1 are the parts `A` and `S` of place i, in the basis of the transfer.
    pub rows: SparseRows,
    /// View sample of each place.
    pub place_samples: Array<u32>,
    /// View samples on glossy surfaces, ascending.
    pub samples: Array<u32>,
    /// Places that each of `samples` interpolates between, and their weights.
    pub indices: Array<[u32; 4]>,
    pub weights: Array<[f32; 4]>,
    /// That were shot.
    pub rays: u64,
}

impl GlossyTransfer {
    pub fn bytes(&self) -> u64 {
        self.rows.bytes() + 4 * (self.place_samples.len() + 9 * self.samples.len()) as u64
    }

    pub fn places(&self) -> usize {
        self.place_samples.len()
    }

    /// What the exitance of the gather samples gives at `samples`, for `count` vectors at once: first `count` vectors of
    /// part `A`, to be multiplied by F0, then `count` of part `S`.
    ///
    /// Errors: the light was made for another number of gather samples.
    pub fn apply(
        &self,
        device: &Device,
        transfer: &Transfer,
        exitance: &[[f32; 4]],
        count: usize,
    ) -> Result<Vec<[f32; 4]>> {
        let products = sparse_product(device, &self.rows, &transfer.encode(device, exitance, count)?, count)?;
        let part = |which: usize| products.par_iter().skip(which).step_by(2).copied();
        let parts: Vec<[f32; 4]> = part(0).chain(part(1)).collect();
        interpolate(device, &self.indices, &self.weights, &parts, 2 * count)
    }
}

/// Names all that rows depend on besides the transfer: which materials are glossy, how rough and how strong those are,
/// and the model.
pub fn gloss_key(gloss: &[[f32; 4]], model: Gloss) -> [u8; 16] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&[model as u8]);
    for gloss in gloss {
        let (bits, weak) = Surface::of(gloss).map_or((0, false), |surface| (surface.bits, surface.weak));
        hasher.update(&bits.to_le_bytes()).update(&[weak.into()]);
    }
    hasher.finalize().as_bytes()[..16].try_into().expect("16 of 32 bytes")
}

/// What rows depend on of a material.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Surface {
    /// Of the width of the lobe; positive floats have the order of their bits.
    bits: u32,
    /// Not a metal: most of its light is diffuse.
    weak: bool,
}

impl Surface {
    /// Of a material with that `Material::gloss`, its width as `kernels::direct_light` takes it; `None` for a matte one.
    fn of(gloss: &[f32; 4]) -> Option<Self> {
        let strongest = gloss[..3].iter().fold(0.0f32, |a, b| a.max(*b));
        let alpha = (gloss[3] * gloss[3]).max(1e-3);
        (strongest > 0.0).then(|| Self { bits: alpha.to_bits(), weak: strongest <= WEAK })
    }

    fn alpha(self) -> f32 {
        f32::from_bits(self.bits)
    }

    /// Rays a place: what a lobe of that width needs to be as free of noise as diffuse rows; a quarter of that where it
    /// adds little to them.
    fn rays(self, quality: &Quality) -> u32 {
        let most = quality.rays as f32;
        let wanted = most * self.alpha() * if self.weak { 0.25 } else { 1.0 };
        wanted.clamp(most / 16.0, most).round().max(16.0) as u32
    }
}

/// Reflectance at normal incidence of what is not a metal, at most.
const WEAK: f32 = 0.08;

/// The share of a ray's patch that credited nodes may have.
const CREDIT: f32 = 1.0 / 16.0;

/// Cells over the width of the lobe: what a smooth surface reflects varies by about that with place over distance.
const CELL: f32 = 0.5;

/// Casts and places the rows of all view samples whose material is glossy; `None` when there are none.
///
/// `gloss`: `Material::gloss` of each material of the scene.
///
/// # Errors
/// A material that `gloss` lacks; too little memory; `Cancelled`.
pub fn glossy_transfer(
    device: &Device,
    geometry: &Geometry,
    transfer: &Transfer,
    gloss: &[[f32; 4]],
    model: Gloss,
    progress: Progress,
) -> Result<Option<GlossyTransfer>> {
    let samples = &transfer.samples;
    // Materials that reflect alike share a pass over the picture.
    let mut surfaces: BTreeMap<Surface, Vec<u32>> = BTreeMap::new();
    for (sample, point) in samples.points.iter().enumerate().filter(|(_, p)| p.exists() && model != Gloss::None) {
        let Some(gloss) = gloss.get(point.material as usize) else {
            let message = format!("{} materials for a view that shows number {}", gloss.len(), point.material);
            return Err(Error::compute(message, "connect the same scene to transfer and relight"));
        };
        if let Some(surface) = Surface::of(gloss) {
            surfaces.entry(surface).or_default().push(sample as u32);
        }
    }
    if surfaces.is_empty() {
        return Ok(None);
    }
    let mut found: Vec<(u32, Stencil)> = Vec::new();
    let mut caster = Caster::new(device, geometry, transfer, model)?;
    let stage = progress.stage("glossy rows", surfaces.values().map(|samples| samples.len() as u64).sum());
    for (surface, shining) in surfaces {
        let first = caster.places.len() as u32;
        for (sample, mut stencil) in caster.place(surface, &shining, &stage)? {
            stencil.rows = stencil.rows.map(|row| row + first);
            found.push((sample, stencil));
        }
    }
    found.sort_unstable_by_key(|(sample, _)| *sample);
    Ok(Some(GlossyTransfer {
        rows: caster.packer.finish()?,
        place_samples: caster.places.into(),
        samples: found.iter().map(|(sample, _)| *sample).collect::<Vec<_>>().into(),
        indices: found.iter().map(|(_, stencil)| stencil.rows).collect::<Vec<_>>().into(),
        weights: found.iter().map(|(_, stencil)| stencil.weights).collect::<Vec<_>>().into(),
        rays: caster.rays,
    }))
}

/// Rays cast before rows are packed: bounds the memory between the two.
const BATCH_RAYS: usize = 2 << 20;

struct Caster<'a> {
    device: &'a Device,
    geometry: &'a Geometry,
    transfer: &'a Transfer,
    model: Gloss,
    packer: RowPacker,
    /// View samples that have rows.
    places: Vec<u32>,
    rays: u64,
}

impl<'a> Caster<'a> {
    fn new(device: &'a Device, geometry: &'a Geometry, transfer: &'a Transfer, model: Gloss) -> Result<Self> {
        let packer = RowPacker::new(&transfer.settings, transfer.gather.count())?;
        Ok(Self { device, geometry, transfer, model, packer, places: Vec::new(), rays: 0 })
    }

    /// Places and casts rows for the view samples of alike surfaces; what each interpolates between, counted from the first of
    /// these rows.
    fn place(&mut self, surface: Surface, shining: &[u32], stage: &Stage) -> Result<Vec<(u32, Stencil)>> {
        let (samples, quality) = (&self.transfer.samples, self.transfer.settings.quality);
        let mut points = vec![SurfacePoint::NOWHERE; samples.points.len()];
        shining.iter().for_each(|&sample| points[sample as usize] = samples.points[sample as usize]);
        let spacing = Spacing { relative: quality.spacing.relative.min(CELL * surface.alpha()), ..quality.spacing };
        let lobe = Lobe {
            eye: samples.camera.position,
            alpha: surface.alpha(),
            blinn: self.model == Gloss::Blinn,
            rays: surface.rays(&quality),
            credit: CREDIT,
        };
        let mut measure = |places: &[usize], resolved: u64| self.cast(&points, &lobe, places, stage, resolved);
        let layout = rows::place(&Grid { points: &points, ..samples.grid() }, spacing, &mut measure)?;
        Ok(shining.iter().map(|&sample| (sample, layout.stencils[sample as usize])).collect())
    }

    /// Appends the rows of these samples; the distances that cells are held against.
    fn cast(
        &mut self,
        points: &[SurfacePoint],
        lobe: &Lobe,
        places: &[usize],
        stage: &Stage,
        resolved: u64,
    ) -> Result<Vec<[f32; 2]>> {
        let rays = lobe.rays as usize;
        let mut distances = Vec::with_capacity(places.len());
        for part in places.chunks((BATCH_RAYS / rays).max(1)) {
            self.packer.require_memory(2 * part.len(), rays, size_of::<Share>(), "glossy rows")?;
            let chosen: Array<SurfacePoint> = part.iter().map(|&i| points[i]).collect::<Vec<_>>().into();
            // Not the seeds of diffuse rows: noise of the two must not add up.
            let seeds: Array<u32> = part.iter().map(|&i| sampling::hash(!(i as u32))).collect::<Vec<_>>().into();
            let mut cast = glossy_rows(self.device, self.geometry, &self.transfer.gather, &chosen, &seeds, lobe)?;
            cast.shares.par_chunks_mut(rays).for_each(|shares| shares.sort_unstable_by_key(|share| share.node));
            let rows = (0..2 * part.len()).into_par_iter();
            self.packer
                .push(rows, |row, pairs| sum_nodes(&cast.shares[row / 2 * rays..][..rays], row % 2 == 1, pairs))?;
            // What is reflected moves with the eye's parallax, too: over the distance to the eye, as over that to what
            // is seen.
            distances.extend(cast.distances.iter().zip(&chosen).map(|(pair, point)| {
                let eye = (Vec3::from(point.position) - lobe.eye).length();
                pair.map(|distance| (distance.recip() + eye.recip()).recip())
            }));
            self.places.extend(part.iter().map(|&sample| sample as u32));
            self.rays += cast.shares.len() as u64;
            stage.advance(0)?;
        }
        stage.advance(resolved)?;
        Ok(distances)
    }
}

/// Adds up one of the two weights of shares that are sorted by node.
fn sum_nodes(shares: &[Share], fresnel: bool, row: &mut Vec<(u32, f32)>) {
    row.clear();
    for run in shares.chunk_by(|a, b| a.node == b.node) {
        let weight: f32 = run.iter().map(|share| if fresnel { share.fresnel } else { share.weight }).sum();
        if run[0].node != 0 && weight > 0.0 {
            row.push((run[0].node, weight));
        }
    }
}

impl Stored for GlossyTransfer {
    fn write<'a>(&'a self, sections: &mut SectionWriter<'a>) {
        sections.value(&self.rays);
        sections.slice(&self.place_samples);
        sections.slice(&self.samples);
        sections.slice(&self.indices);
        sections.slice(&self.weights);
        write_rows(&self.rows, sections);
    }

    fn read(sections: &mut SectionReader) -> Option<Self> {
        let rays = sections.value()?;
        let (place_samples, samples): (Vec<u32>, Vec<u32>) = (sections.vec()?, sections.vec()?);
        let (indices, weights): (Vec<[u32; 4]>, Vec<[f32; 4]>) = (sections.vec()?, sections.vec()?);
        let rows = read_rows(sections)?;
        let fits = rows.rows() == 2 * place_samples.len()
            && indices.len() == samples.len()
            && weights.len() == samples.len()
            && indices.iter().flatten().all(|&place| (place as usize) < place_samples.len());
        fits.then(|| Self {
            rows,
            place_samples: place_samples.into(),
            samples: samples.into(),
            indices: indices.into(),
            weights: weights.into(),
            rays,
        })
    }
}
