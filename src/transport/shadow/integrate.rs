//! Visibility times light (thesis 6.4): irradiance at samples, and the picture that it makes.
//!
//! What a sample receives is what its horizon lets in less what is hidden: `sum over H of E w d - sum over S of E w d`,
//! the first from its normal alone, the second from its rows, each dotted with the normal last. For runs both are sums of
//! integers, so their difference is exactly the sum over what is seen.

use super::tables::{HaarTables, Tables};
use super::visibility::{Data, Rows};
use super::{DirectTransport, Visibility, edited};
use crate::device::{Array, Device};
use crate::image::{Content, Layer};
use crate::kernels::run_light::{Element, Face, run_light};
use crate::kernels::sparse_product;
use crate::memo::{Key, Memo};
use crate::progress::Progress;
use crate::scene::cube::{FACE_NAMES, FACES};
use crate::transport::Samples;
use crate::transport::lighting::{layer, surface_layers};
use crate::{Error, Result};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// Samples that one task works on.
const BLOCK: usize = 4096;

/// The rows of each face; `None` where nothing is hidden.
pub type Shadows = [Option<Arc<Rows>>; FACES];

/// What all steps work with.
#[derive(Clone, Copy)]
pub struct Stage<'a> {
    pub device: &'a Device,
    pub memo: &'a dyn Memo,
    pub visibility: &'a Visibility,
    pub transport: &'a DirectTransport,
}

impl Stage<'_> {
    /// # Errors
    /// `Compute` unless visibility and transport have one size of faces and the same samples.
    pub fn check(&self) -> Result<()> {
        let (size, other) = (self.visibility.size, self.transport.environment.size);
        if size != other {
            let message =
                format!("visibility has faces of {size} x {size} texels, the environment of {other} x {other}");
            return Err(Error::compute(message, "set face_size of both nodes to the same number"));
        }
        self.check_samples(&self.transport.samples)
    }

    /// # Errors
    /// `Compute` unless the visibility was made for these samples.
    pub fn check_samples(&self, theirs: &Samples) -> Result<()> {
        let ours = &self.visibility.samples;
        if ours.geometry != theirs.geometry {
            let message = "visibility and transport were made for different scenes, or different states of one";
            return Err(Error::compute(message, "connect the same scene to view_samples, visibility and transport"));
        }
        let same =
            ours.points.id() == theirs.points.id() || ours.points.par_chunks(BLOCK).eq(theirs.points.par_chunks(BLOCK));
        if !same {
            let size = |s: &Samples| format!("{} x {} pixels with {} samples", s.width, s.height, s.per_pixel());
            let message = format!("visibility is of {}, the light falls on {} elsewhere", size(ours), size(theirs));
            return Err(Error::compute(message, "connect the same samples to visibility, transport and integrate"));
        }
        Ok(())
    }

    /// Running sums of the environment, or of the part that weights (6 n n) leave of it.
    pub fn tables(&self, weights: Option<&Array<f32>>) -> Result<Arc<Tables>> {
        let environment = &self.transport.environment;
        let key = self.light_key(b"tables", weights);
        self.memo.remember(key, Tables::bytes, || Tables::new(environment, weights.map(|weights| &weights[..])))
    }

    fn light_key(&self, what: &[u8], weights: Option<&Array<f32>>) -> Key {
        let light = self.transport.environment.radiance.id().to_le_bytes();
        Key::of(&[b"shadow", what, &light, &weights.map_or(0, |weights| weights.id()).to_le_bytes()])
    }

    /// What all groups hide before edits, face by face.
    pub fn shadows(&self) -> Result<Shadows> {
        let mut all = [const { None }; FACES];
        for (face, together) in all.iter_mut().enumerate() {
            let groups = self.visibility.face(face);
            *together = match groups.as_slice() {
                [] | [_] => self.visibility.together(face)?,
                groups => {
                    let ids: Vec<u8> = groups.iter().flat_map(|rows| rows.id().to_le_bytes()).collect();
                    let key = Key::of(&[b"shadows together", &ids]);
                    let made = self.memo.remember(
                        key,
                        |rows: &Option<Arc<Rows>>| rows.iter().map(|rows| rows.bytes()).sum(),
                        || self.visibility.together(face),
                    )?;
                    (*made).clone()
                }
            };
        }
        Ok(all)
    }

    /// Sums above each sample's horizon.
    pub fn open(&self, weights: Option<&Array<f32>>) -> Result<Arc<Vec<Element>>> {
        let points = &self.visibility.samples.points;
        let key = Key::of(&[&self.light_key(b"open", weights).0, &points.id().to_le_bytes()]);
        self.memo.remember(
            key,
            |sums: &Vec<Element>| 48 * sums.len() as u64,
            || {
                let normals: Vec<Vec3> = points.iter().map(|point| point.normal.into()).collect();
                Ok(self.tables(weights)?.open(&normals))
            },
        )
    }

    /// Irradiance at each sample of the light that weights leave, with these shadows in it; W/m², RGB.
    ///
    /// # Errors
    /// `Compute` for weights that do not fit the environment, and what the device meets.
    pub fn irradiance(&self, shadows: &Shadows, weights: Option<&Array<f32>>) -> Result<Vec<[f32; 4]>> {
        let (tables, open) = (self.tables(weights)?, self.open(weights)?);
        let points = &self.visibility.samples.points;
        let mut light = vec![[0.0; 4]; points.len()];
        let hidden = run_light(self.device, &run_faces(shadows, &tables), points.len())?;
        light.par_chunks_mut(BLOCK).enumerate().for_each(|(block, light)| {
            for (i, light) in light.iter_mut().enumerate() {
                let i = block * BLOCK + i;
                let seen = std::array::from_fn(|k| open[i][k].wrapping_sub(hidden[i][k]));
                *light = tables.irradiance(&seen, points[i].normal.into());
            }
        });
        self.take_haar(shadows, weights, &mut light, -1.0)?;
        light.par_iter_mut().with_min_len(BLOCK).for_each(|light| *light = light.map(|light| light.max(0.0)));
        Ok(light)
    }

    /// Irradiance that these shadows keep from each sample, of the light that weights leave; W/m², RGB.
    ///
    /// # Errors
    /// As `irradiance`.
    pub fn hidden(&self, shadows: &Shadows, weights: Option<&Array<f32>>) -> Result<Vec<[f32; 4]>> {
        let tables = self.tables(weights)?;
        let points = &self.visibility.samples.points;
        let sums = run_light(self.device, &run_faces(shadows, &tables), points.len())?;
        let mut light: Vec<[f32; 4]> =
            sums.par_iter().zip(&points[..]).map(|(sum, point)| tables.irradiance(sum, point.normal.into())).collect();
        self.take_haar(shadows, weights, &mut light, 1.0)?;
        Ok(light)
    }

    /// Adds `factor` times what rows in a Haar basis hide.
    fn take_haar(
        &self,
        shadows: &Shadows,
        weights: Option<&Array<f32>>,
        light: &mut [[f32; 4]],
        factor: f32,
    ) -> Result<()> {
        let points = &self.visibility.samples.points;
        for (face, rows) in shadows.iter().enumerate() {
            let Some(Data::Haar(basis, matrix)) = rows.as_ref().map(|rows| &rows.data) else { continue };
            let key = Key::of(&[&self.light_key(b"haar", weights).0, &[*basis as u8]]);
            let environment = &self.transport.environment;
            let weights = weights.map(|weights| &weights[..]);
            let tables = self
                .memo
                .remember(key, HaarTables::bytes, || HaarTables::new(self.device, environment, weights, *basis))?;
            let Some(table) = &tables.faces[face] else { continue };
            let sums = sparse_product(self.device, matrix, table, 3)?;
            let count = points.len();
            light.par_chunks_mut(BLOCK).enumerate().for_each(|(block, light)| {
                for (i, light) in light.iter_mut().enumerate() {
                    let i = block * BLOCK + i;
                    let along = |axis: usize| Vec4::from_array(sums[axis * count + i]);
                    let [x, y, z] = points[i].normal;
                    let hidden = along(0) * x + along(1) * y + along(2) * z;
                    *light = (Vec4::from_array(*light) + hidden * factor).to_array();
                }
            });
        }
        Ok(())
    }

    /// Light falls from these faces, but nothing is known of their shadows.
    pub fn faces_without_shadows(&self) -> Vec<&'static str> {
        let lit = self.transport.environment.lit_faces();
        (0..FACES).filter(|f| lit[*f] && self.visibility.face(*f).is_empty()).map(|f| FACE_NAMES[f]).collect()
    }

    /// The layers of the picture: beauty (with what surfaces emit), `direct` (radiance, albedo included), `albedo`, `P`,
    /// `N`, `Z`; averages over the samples of a pixel, black with alpha 0 where there is no surface.
    ///
    /// # Errors
    /// As `check` and `irradiance`; `Cancelled`.
    pub fn layers(&self, progress: Progress) -> Result<Vec<Layer>> {
        self.check()?;
        let light = match self.visibility.edits.is_empty() {
            true => self.irradiance(&self.shadows()?, None)?,
            false => edited::irradiance(self, progress)?,
        };
        let DirectTransport { samples, reflectance, emission, .. } = self.transport;
        let direct = samples.resolve(|i| {
            let reflectance = Vec4::from_array(reflectance[i]);
            // The fourth element counts coverage.
            (reflectance * Vec4::from_array(light[i]) * FRAC_1_PI).with_w(reflectance.w)
        });
        let emitted = match emission.is_empty() {
            true => Vec::new(),
            false => samples.resolve(|i| Vec4::from_array(emission[i])),
        };
        let key = Key::of(&[b"shadow surface", &samples.points.id().to_le_bytes(), &reflectance.id().to_le_bytes()]);
        let bytes = |layers: &Vec<Layer>| layers.iter().map(|layer| 4 * layer.data.len() as u64).sum();
        let fixed = self.memo.remember(key, bytes, || Ok(surface_layers(samples, reflectance)))?;
        let pixels = direct.len();
        let beauty = |p: usize| (direct[p] + emitted.get(p).copied().unwrap_or(Vec4::ZERO)).to_array();
        let moving = [
            layer("", &["R", "G", "B", "A"], Content::Colour, pixels, beauty),
            layer("direct", &["R", "G", "B"], Content::Colour, pixels, |p| direct[p].truncate().to_array()),
        ];
        Ok(moving.into_iter().chain(fixed.iter().cloned()).collect())
    }
}

/// The faces that have both runs and light.
fn run_faces<'a>(shadows: &'a Shadows, tables: &'a Tables) -> Vec<Face<'a>> {
    let face = |(rows, table): (&'a Option<Arc<Rows>>, &'a Option<Array<Element>>)| match (&rows.as_ref()?.data, table)
    {
        (Data::Runs(runs), Some(table)) => Some(Face { runs, table }),
        _ => None,
    };
    shadows.iter().zip(&tables.faces).filter_map(face).collect()
}
