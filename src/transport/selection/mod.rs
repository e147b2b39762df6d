//! Selections: weights in [0, 1] over surface points, as fields that any sample can be held against.

use crate::scene::{Fingerprint, Geometry, SurfacePoint};
use crate::{Error, Result};
use globset::{Glob, GlobSet, GlobSetBuilder};
use rayon::prelude::*;

/// A hash of content.
pub type Digest = [u8; 16];

#[derive(Clone, Debug, PartialEq)]
pub enum Selection {
    /// Surfaces of chosen objects that are made of chosen materials, by number in one geometry.
    Names { geometry: Fingerprint, objects: Vec<bool>, materials: Vec<bool> },
}

impl Selection {
    /// Surfaces whose object matches one of `objects` and whose material matches one of `materials`; an empty list
    /// matches all.
    ///
    /// Errors: a glob that is not well formed, or that matches nothing (the error lists what there is).
    pub fn by_name(geometry: &Geometry, objects: &[String], materials: &[String]) -> Result<Self> {
        Ok(Self::Names {
            geometry: geometry.fingerprint,
            objects: chosen("object", objects, &geometry.objects)?,
            materials: chosen("material", materials, &geometry.material_names)?,
        })
    }

    /// # Errors
    /// `Compute` when the selection names parts of another geometry.
    pub fn check(&self, fingerprint: &Fingerprint) -> Result<()> {
        match self {
            Self::Names { geometry, .. } if geometry == fingerprint => Ok(()),
            Self::Names { .. } => {
                let message = "a selection was made in another scene, or in another state of it";
                Err(Error::compute(message, "connect the same scene to pick and relight"))
            }
        }
    }

    pub fn weight(&self, point: &SurfacePoint) -> f32 {
        match self {
            Self::Names { objects, materials, .. } => {
                let is = |list: &[bool], index: u32| list.get(index as usize).copied().unwrap_or(false);
                f32::from(u8::from(is(objects, point.object) && is(materials, point.material)))
            }
        }
    }

    pub fn weights(&self, points: &[SurfacePoint]) -> Vec<f32> {
        points.par_iter().with_min_len(4096).map(|point| self.weight(point)).collect()
    }

    /// Names the field: equal digests, equal weights everywhere.
    pub fn digest(&self) -> Digest {
        let mut hasher = blake3::Hasher::new();
        match self {
            Self::Names { geometry, objects, materials } => {
                hasher.update(b"names").update(geometry);
                for list in [objects, materials] {
                    hasher.update(&(list.len() as u64).to_le_bytes());
                    list.iter().for_each(|is| _ = hasher.update(&[u8::from(*is)]));
                }
            }
        }
        hasher.finalize().as_bytes()[..16].try_into().expect("16 of 32 bytes")
    }

    pub fn bytes(&self) -> u64 {
        match self {
            Self::Names { objects, materials, .. } => (objects.len() + materials.len()) as u64,
        }
    }
}

fn chosen(what: &str, globs: &[String], names: &[String]) -> Result<Vec<bool>> {
    if globs.is_empty() {
        return Ok(vec![true; names.len()]);
    }
    for glob in globs {
        let set = set(what, std::slice::from_ref(glob))?;
        if !names.iter().any(|name| set.is_match(name)) {
            let known = names.iter().map(String::as_str);
            let help = crate::names::suggest(glob, known);
            return Err(Error::compute(format!("no {what} of the scene is called \"{glob}\""), help));
        }
    }
    let set = set(what, globs)?;
    Ok(names.iter().map(|name| set.is_match(name)).collect())
}

fn set(what: &str, globs: &[String]) -> Result<GlobSet> {
    let mut builder = GlobSetBuilder::new();
    for glob in globs {
        let glob = Glob::new(glob).map_err(|e| {
            Error::compute(
                format!("{what} pattern \"{glob}\": {}", e.kind()),
                "use * and ? as wildcards, [..] for sets",
            )
        })?;
        builder.add(glob);
    }
    builder.build().map_err(|e| Error::compute(format!("{what} patterns: {e}"), "use fewer or shorter patterns"))
}
