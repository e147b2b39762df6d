//! From surfaces to rows: draws what hides a face from each sample, and keeps its shadows (thesis 6.4, Algorithm 13).
//!
//! Samples are taken in tiles; of a tile's masks only the compressed rows stay. What the rest will take is asked of the
//! machine as the work goes on, from what the rows so far have taken.

use super::haar::{self, Encoder, HaarBasis, Truncation};
use super::horizon;
use super::tiles::Tiles;
use super::visibility::{Basis, Data, Rows};
use crate::memo::Key;
use crate::progress::Stage;
use crate::scene::SurfacePoint;
use crate::scene::cube;
use crate::scene::{Environment, Geometry};
use crate::transport::runs::{self, RunsBuilder};
use crate::transport::sparse::SparseRowsBuilder;
use crate::{Error, Result, memory};
use glam::Vec3;
use rayon::prelude::*;

/// Bytes of a tile's masks.
const TILE: usize = 16 << 20;
/// Rows that one task encodes.
const BLOCK: usize = 64;

/// Of one face.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub face: usize,
    pub size: usize,
    pub basis: Basis,
    pub truncation: Truncation,
}

impl Settings {
    /// # Errors
    /// `Compute` for a size that faces cannot have, no coefficients, or a tolerance outside of [0, 1].
    pub fn check(&self) -> Result<()> {
        cube::check_size(self.size)?;
        let Truncation { coefficients, tolerance } = self.truncation;
        if coefficients == 0 || tolerance.is_some_and(|tolerance| !(0.0..=1.0).contains(&tolerance)) {
            let message = format!("rows of {coefficients} coefficients, tolerance {tolerance:?}");
            return Err(Error::compute(message, "set coefficients to at least 1, tolerance to null or from 0 to 1"));
        }
        Ok(())
    }
}

/// Where light comes from, texel by texel of a face: the only ones whose shadows are kept. `None` for a dark face.
pub fn wanted(environment: &Environment, face: usize) -> Option<Vec<u32>> {
    let texels = environment.size * environment.size;
    let word = |first: usize| (first..first + 32).rev().fold(0, |bits, i| bits << 1 | u32::from(environment.is_lit(i)));
    let lit: Vec<u32> = (face * texels..(face + 1) * texels).step_by(32).map(word).collect();
    lit.iter().any(|word| *word != 0).then_some(lit)
}

/// Which of all objects belong to each group, and the rest to a last one.
///
/// # Errors
/// `Compute` for a name that is no name, a pattern that matches nothing, an object that two groups want.
pub fn groups<'a>(
    wanted: impl IntoIterator<Item = (&'a str, &'a [String])>,
    geometry: &Geometry,
) -> Result<Vec<(String, Vec<u32>)>> {
    let names: Vec<&str> = geometry.objects.iter().map(String::as_str).collect();
    let mut owner: Vec<Option<usize>> = vec![None; names.len()];
    let mut groups: Vec<(String, Vec<u32>)> = Vec::new();
    for (name, patterns) in wanted {
        let is_name = !name.is_empty() && name.bytes().all(|c| c.is_ascii_alphanumeric() || c == b'_');
        if !is_name || name == REST {
            let message = format!("a visibility group cannot be called \"{name}\"");
            return Err(Error::compute(message, "use letters, digits and _; \"rest\" is what no group holds"));
        }
        if patterns.is_empty() {
            let message = format!("visibility group \"{name}\" lists no objects");
            return Err(Error::compute(message, "list names or patterns of objects, or leave the group out"));
        }
        let chosen = crate::names::chosen("object", patterns, &names)?;
        let objects: Vec<usize> = (0..names.len()).filter(|object| chosen[*object]).collect();
        for &object in &objects {
            if let Some(other) = owner[object] {
                let message = format!(
                    "object \"{}\" is in visibility groups \"{}\" and \"{name}\"",
                    names[object], groups[other].0
                );
                return Err(Error::compute(message, "give each object to one group"));
            }
            owner[object] = Some(groups.len());
        }
        groups.push((name.to_owned(), objects.into_iter().map(|object| object as u32).collect()));
    }
    let rest = (0..names.len()).filter(|object| owner[*object].is_none()).map(|object| object as u32);
    groups.push((if groups.is_empty() { ALL } else { REST }.to_owned(), rest.collect()));
    Ok(groups)
}

/// The only group, when none are asked for; and the last one otherwise.
const ALL: &str = "all";
const REST: &str = "rest";

/// Draws masks of points: bit set where open and above the horizon; `wanted` as `kernels::visibility_masks` takes it.
pub type Draw<'a> = dyn Fn(&[SurfacePoint], usize, usize, Option<&[u32]>) -> Result<Vec<u32>> + 'a;

/// Tiles that are kept, and how a tile of this face is named.
pub type Kept<'a> = (&'a Tiles<'a>, &'a dyn Fn(&[SurfacePoint]) -> Key);

/// The rows of one face; `stage` advances by samples. `None` when `kept` is asked for a part.
///
/// # Errors
/// `Compute` when memory does not suffice, and what `draw` meets; `Cancelled`.
pub fn face(
    draw: &Draw,
    points: &[SurfacePoint],
    settings: &Settings,
    wanted: Option<&[u32]>,
    kept: Option<Kept>,
    stage: &Stage,
) -> Result<Option<Rows>> {
    settings.check()?;
    let Settings { face, size, .. } = *settings;
    let words = size * size / 32;
    let tile = (TILE / (4 * words)).max(BLOCK);
    let name = format!("shadows of {} samples on face \"{}\"", points.len(), cube::FACE_NAMES[face]);
    let help = "lower face_size, coefficients or the number of samples";
    memory::require((3 * TILE + 8 * points.len()) as u64, &name, help)?;
    let mut builder = Builder::new(settings)?;
    let mut done = 0;
    let compute = |part: &[SurfacePoint], builder: &mut Builder| {
        let mut masks = draw(part, face, size, wanted)?;
        hide(&mut masks, part, settings, wanted);
        builder.push(&masks, settings)
    };
    let is_part = kept.is_some_and(|(tiles, _)| tiles.is_part());
    for (number, part) in points.chunks(tile).enumerate() {
        match kept {
            None => compute(part, &mut builder)?,
            Some((tiles, name)) => {
                let key = name(part);
                match tiles.find(key) {
                    Some(rows) => builder.append(&rows)?,
                    None if !tiles.is_ours(number) => {}
                    None if tiles.keeps() => {
                        let mut alone = Builder::new(settings)?;
                        compute(part, &mut alone)?;
                        let rows = Rows { size, data: alone.finish()? };
                        tiles.keep(key, &rows)?;
                        builder.append(&rows)?;
                    }
                    None => compute(part, &mut builder)?,
                }
            }
        }
        done += part.len();
        // As much again for each sample to come as for those that are done.
        let left = u128::from(builder.bytes()) * (points.len() - done) as u128 / done as u128;
        memory::require(left as u64, &name, help)?;
        stage.advance(part.len() as u64)?;
    }
    Ok(if is_part { None } else { Some(Rows { size, data: builder.finish()? }) })
}

/// Turns masks of what is open into masks of what is hidden above the horizon, of the texels that are wanted.
fn hide(masks: &mut [u32], points: &[SurfacePoint], settings: &Settings, wanted: Option<&[u32]>) {
    let Settings { face, size, .. } = *settings;
    let words = size * size / 32;
    let chunks = masks.par_chunks_mut(BLOCK * words).zip(points.par_chunks(BLOCK));
    chunks.for_each_init(
        || (Vec3::ZERO, vec![0; words]),
        |(normal, above), (masks, points)| {
            for (mask, point) in masks.chunks_exact_mut(words).zip(points) {
                // Neighbours often share their horizon; that of no normal at all is empty.
                if Vec3::from(point.normal) != *normal {
                    *normal = point.normal.into();
                    horizon::mask(*normal, face, size, above);
                    above.iter_mut().zip(wanted.unwrap_or(&[])).for_each(|(above, wanted)| *above &= wanted);
                }
                mask.iter_mut().zip(above.iter()).for_each(|(mask, above)| *mask = above & !*mask);
            }
        },
    );
}

enum Builder {
    Runs(RunsBuilder),
    Haar(HaarBasis, SparseRowsBuilder),
}

impl Builder {
    fn new(settings: &Settings) -> Result<Self> {
        Ok(match settings.basis.haar() {
            None => Self::Runs(RunsBuilder::new(settings.size)),
            Some(basis) => Self::Haar(basis, SparseRowsBuilder::new(haar::format(settings.size))?),
        })
    }

    fn bytes(&self) -> u64 {
        match self {
            Self::Runs(builder) => builder.bytes(),
            Self::Haar(_, builder) => 8 * builder.rows() as u64 + 4 * builder.entries() as u64,
        }
    }

    /// Appends rows of the same settings.
    fn append(&mut self, rows: &Rows) -> Result<()> {
        match (self, &rows.data) {
            (Self::Runs(builder), Data::Runs(runs)) => builder.append(runs),
            (Self::Haar(_, builder), Data::Haar(_, rows)) => builder.append(rows),
            _ => Err(Error::compute("a kept tile of another basis", "clear the cache")),
        }
    }

    /// Appends the rows of masks of what is hidden.
    fn push(&mut self, masks: &[u32], settings: &Settings) -> Result<()> {
        let words = settings.size * settings.size / 32;
        let blocks = masks.par_chunks(BLOCK * words);
        match self {
            Self::Runs(builder) => {
                let encode = |masks: &[u32]| {
                    let (mut list, mut ends) = (Vec::new(), Vec::with_capacity(BLOCK));
                    for mask in masks.chunks_exact(words) {
                        runs::toggles(mask, &mut list);
                        ends.push(list.len());
                    }
                    (list, ends)
                };
                for (list, ends) in blocks.map(encode).collect::<Vec<_>>() {
                    let mut start = 0;
                    for end in ends {
                        builder.push(&list[start..end])?;
                        start = end;
                    }
                }
            }
            Self::Haar(basis, builder) => {
                let format = haar::format(settings.size);
                let encoder = || Encoder::new(settings.size, *basis, settings.truncation);
                let encode = |encoder: &mut Encoder, masks: &[u32]| {
                    let (mut entries, mut rows) = (Vec::new(), Vec::with_capacity(BLOCK));
                    for mask in masks.chunks_exact(words) {
                        let scale = format.pack_row(encoder.mask(mask), &mut entries)?;
                        rows.push((entries.len(), scale));
                    }
                    Ok((entries, rows))
                };
                for (entries, rows) in blocks.map_init(encoder, encode).collect::<Result<Vec<_>>>()? {
                    let mut start = 0;
                    for (end, scale) in rows {
                        builder.push_packed(&entries[start..end], scale)?;
                        start = end;
                    }
                }
            }
        }
        Ok(())
    }

    fn finish(self) -> Result<Data> {
        Ok(match self {
            Self::Runs(builder) => Data::Runs(builder.finish()?),
            Self::Haar(basis, builder) => Data::Haar(basis, builder.finish()?),
        })
    }
}
