//! An environment made ready to be summed: radiance x direction x solid angle, for all samples alike (thesis 6.4, with
//! the cosine and the reflectance taken out of the transport of diffuse surfaces).
//!
//! A texel gives a vector per colour, `E w d`; its dot product with a normal is irradiance. For runs the texels of a face
//! are summed up in reading order, in fixed point: every position of the sum is rounded once, so the light of a run is off
//! by at most one unit however long it is, and a unit is the light of the whole cube over 2^31.

use crate::device::{Array, Device};
use crate::kernels::run_light::Element;
use crate::kernels::{haar_encode, haar2d_encode};
use crate::scene::Environment;
use crate::scene::cube::{self, FACES};
use crate::transport::shadow::haar::HaarBasis;
use crate::transport::shadow::horizon;
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Sums of whole faces, and of the cube, stay below 2^31 with room for a unit of rounding a run.
const MOST: f64 = 2_147_000_000.0;

/// Running sums for rows of runs, and for horizons.
#[derive(Clone, Debug)]
pub struct Tables {
    /// Texels along a side of each face.
    pub size: usize,
    /// W/m² that 1 stands for, by channel.
    pub unit: [f64; 3],
    /// Per face with light `size * size + 1` sums.
    pub faces: [Option<Array<Element>>; FACES],
}

/// What texel `i` of all gives, by channel: W/m² along x, y and z.
fn vectors(environment: &Environment, weights: Option<&[f32]>, i: usize) -> [DVec3; 3] {
    let [r, g, b, angle] = environment.radiance[i].map(f64::from);
    let weight = weights.map_or(1.0, |weights| f64::from(weights[i]));
    let direction = cube::texel_point(i, environment.size).as_dvec3().normalize() * (angle * weight);
    [direction * r, direction * g, direction * b]
}

fn check_weights(environment: &Environment, weights: Option<&[f32]>) -> Result<()> {
    let texels = environment.radiance.len();
    match weights {
        Some(weights) if weights.len() != texels => {
            let message = format!("weights of {} texels for an environment of {texels}", weights.len());
            Err(Error::compute(message, "give environment and light the same face_size"))
        }
        Some(weights) if !weights.iter().all(|weight| weight.is_finite()) => {
            Err(Error::compute("a light's weights are not all numbers", "find the light again"))
        }
        _ => Ok(()),
    }
}

impl Tables {
    /// Of all light, or of the part that `weights` (6 n n) leave of each texel.
    ///
    /// # Errors
    /// `Compute` for another number of weights, or weights that are not finite.
    pub fn new(environment: &Environment, weights: Option<&[f32]>) -> Result<Self> {
        check_weights(environment, weights)?;
        let (size, texels) = (environment.size, environment.size * environment.size);
        let totals = |face: usize| {
            let mut sums = [DVec3::ZERO; 3];
            for i in face * texels..(face + 1) * texels {
                let vectors = vectors(environment, weights, i);
                (0..3).for_each(|c| sums[c] += vectors[c].abs());
            }
            sums
        };
        let sums: Vec<[DVec3; 3]> = (0..FACES).into_par_iter().map(totals).collect();
        let unit: [f64; 3] =
            std::array::from_fn(|c| sums.iter().map(|face| face[c]).sum::<DVec3>().max_element() / MOST);
        let faces: Vec<Option<Array<Element>>> = (0..FACES)
            .into_par_iter()
            .map(|face| {
                let lit = sums[face].iter().any(|sum| sum.max_element() > 0.0);
                lit.then(|| running_sums(environment, weights, face, unit).into())
            })
            .collect();
        Ok(Self { size, unit, faces: faces.try_into().unwrap_or_else(|_| unreachable!("one a face")) })
    }

    pub fn bytes(&self) -> u64 {
        self.faces.iter().flatten().map(|table| 48 * table.len() as u64).sum()
    }

    /// The light above the horizon of each normal, if nothing hid any of it.
    pub fn open(&self, normals: &[Vec3]) -> Vec<Element> {
        /// Samples that one task sums, and remembers the normals of: neighbours often share theirs.
        const BLOCK: usize = 2048;
        let mut sums = vec![[0; 12]; normals.len()];
        sums.par_chunks_mut(BLOCK).zip(normals.par_chunks(BLOCK)).for_each(|(sums, normals)| {
            let mut known: HashMap<[u32; 3], Element> = HashMap::new();
            for (sum, normal) in sums.iter_mut().zip(normals) {
                *sum = *known.entry(normal.to_array().map(f32::to_bits)).or_insert_with(|| self.above(*normal));
            }
        });
        sums
    }

    fn above(&self, normal: Vec3) -> Element {
        let mut sum = [0i32; 12];
        for (face, table) in self.faces.iter().enumerate() {
            let Some(table) = table else { continue };
            horizon::spans(normal, face, self.size, |span| {
                let (start, end) = (&table[span.start], &table[span.end]);
                (0..12).for_each(|i| sum[i] = sum[i].wrapping_add(end[i].wrapping_sub(start[i])));
            });
        }
        sum
    }

    /// Irradiance from a sum, W/m²; never negative.
    pub fn irradiance(&self, sum: &Element, normal: Vec3) -> [f32; 4] {
        let normal = normal.as_dvec3();
        let mut light = [0.0; 4];
        for c in 0..3 {
            let along = DVec3::new(f64::from(sum[c]), f64::from(sum[4 + c]), f64::from(sum[8 + c]));
            light[c] = (normal.dot(along) * self.unit[c]).max(0.0) as f32;
        }
        light
    }
}

fn running_sums(environment: &Environment, weights: Option<&[f32]>, face: usize, unit: [f64; 3]) -> Vec<Element> {
    let texels = environment.size * environment.size;
    let per_unit = unit.map(|unit| if unit > 0.0 { 1.0 / unit } else { 0.0 });
    let mut sums = [DVec3::ZERO; 3];
    let mut table = Vec::with_capacity(texels + 1);
    table.push([0; 12]);
    for i in face * texels..(face + 1) * texels {
        let vectors = vectors(environment, weights, i);
        let mut element = [0; 12];
        for c in 0..3 {
            sums[c] += vectors[c] * per_unit[c];
            (0..3).for_each(|axis| element[4 * axis + c] = sums[c][axis].round() as i32);
        }
        table.push(element);
    }
    table
}

/// The same vectors in a Haar basis: per face with light three of n n elements, for x, y and z, one after another.
#[derive(Clone, Debug)]
pub struct HaarTables {
    pub size: usize,
    pub faces: [Option<Vec<[f32; 4]>>; FACES],
}

impl HaarTables {
    /// # Errors
    /// As `Tables::new`, and what the device meets.
    pub fn new(device: &Device, environment: &Environment, weights: Option<&[f32]>, basis: HaarBasis) -> Result<Self> {
        check_weights(environment, weights)?;
        let (size, texels) = (environment.size, environment.size * environment.size);
        let mut faces = [const { None }; FACES];
        for (face, encoded) in faces.iter_mut().enumerate() {
            let mut values = vec![[0.0; 4]; 3 * texels];
            for i in 0..texels {
                let vectors = vectors(environment, weights, face * texels + i);
                for (axis, c) in (0..3).flat_map(|axis| (0..3).map(move |c| (axis, c))) {
                    values[axis * texels + i][c] = vectors[c][axis] as f32;
                }
            }
            if values.iter().any(|value| *value != [0.0; 4]) {
                *encoded = Some(match basis {
                    HaarBasis::Square => haar2d_encode(device, &values, size, 3)?,
                    HaarBasis::Line => haar_encode(device, &values, 3)?,
                });
            }
        }
        Ok(Self { size, faces })
    }

    pub fn bytes(&self) -> u64 {
        self.faces.iter().flatten().map(|table| 16 * table.len() as u64).sum()
    }
}
