//! Surfaces by the names of their objects and materials.

use super::{Digest, finish};
use crate::scene::{Fingerprint, Geometry, SurfacePoint};
use crate::{Error, Result};
use globset::{Glob, GlobSet, GlobSetBuilder};

/// 1 where both the object and the material are chosen, 0 elsewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct Names {
    geometry: Fingerprint,
    /// By number in the geometry.
    objects: Vec<bool>,
    materials: Vec<bool>,
}

impl Names {
    pub(super) fn new(geometry: &Geometry, objects: &[String], materials: &[String]) -> Result<Self> {
        Ok(Self {
            geometry: geometry.fingerprint,
            objects: chosen("object", objects, &geometry.objects)?,
            materials: chosen("material", materials, &geometry.material_names)?,
        })
    }

    pub(super) fn geometry(&self) -> &Fingerprint {
        &self.geometry
    }

    pub(super) fn evaluate(&self, points: &[SurfacePoint], weights: &mut [f32]) {
        let is = |list: &[bool], index: u32| list.get(index as usize).copied().unwrap_or(false);
        for (point, weight) in points.iter().zip(weights) {
            *weight = f32::from(u8::from(is(&self.objects, point.object) && is(&self.materials, point.material)));
        }
    }

    pub(super) fn digest(&self) -> Digest {
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"names").update(&self.geometry);
        for list in [&self.objects, &self.materials] {
            hasher.update(&(list.len() as u64).to_le_bytes());
            list.iter().for_each(|is| _ = hasher.update(&[u8::from(*is)]));
        }
        finish(&hasher)
    }

    pub(super) fn bytes(&self) -> u64 {
        (self.objects.len() + self.materials.len()) as u64
    }
}

fn chosen(what: &str, globs: &[String], names: &[String]) -> Result<Vec<bool>> {
    if globs.is_empty() {
        return Ok(vec![true; names.len()]);
    }
    for glob in globs {
        let set = set(what, std::slice::from_ref(glob))?;
        if !names.iter().any(|name| set.is_match(name)) {
            return Err(Error::compute(
                format!("no {what} of the scene is called \"{glob}\""),
                list(what, glob, names),
            ));
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

/// Names that fit into a message.
const FEW: usize = 12;

/// All names when they are few, else those nearest to the pattern and how many there are.
fn list(what: &str, glob: &str, names: &[String]) -> String {
    let text = glob.replace(['*', '?', '[', ']', '{', '}'], "").to_lowercase();
    // The plain sequence counts more than letters in common: "door" is nearer to "old_door_frame" than to "floor".
    let distance = |name: &String| {
        let lower = name.to_lowercase();
        let part = !text.is_empty() && (lower.contains(&text) || text.contains(&lower));
        (!part, strsim::damerau_levenshtein(&text, &lower))
    };
    let mut known: Vec<&String> = names.iter().collect();
    known.sort();
    known.dedup();
    known.sort_by_cached_key(|name| distance(name));
    let quoted = |names: &[&String]| names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
    match known.len() {
        0 => format!("the scene has no {what}s"),
        count if count <= FEW => format!("its {what}s, nearest first: {}", quoted(&known)),
        count => format!("of its {count} {what}s, the nearest are: {}", quoted(&known[..FEW])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| name.to_string()).collect()
    }

    #[test]
    fn few_names_are_listed_all_and_many_counted_nearest_first() {
        let few = names(&["floor", "left_wall", "ball", "floor"]);
        assert_eq!(list("object", "balls", &few), "its objects, nearest first: \"ball\", \"floor\", \"left_wall\"");
        assert_eq!(list("object", "*wall?", &few), "its objects, nearest first: \"left_wall\", \"ball\", \"floor\"");
        assert_eq!(list("material", "x", &[]), "the scene has no materials");
        let many: Vec<String> = (0..300).map(|i| format!("chair_{i:03}")).chain(["table".to_owned()]).collect();
        let text = list("object", "tabel", &many);
        assert!(text.starts_with("of its 301 objects, the nearest are: \"table\", \"chair_"), "{text}");
        assert_eq!(text.matches('"').count(), 2 * FEW);
    }

    #[test]
    fn a_pattern_that_matches_nothing_is_an_error_beside_one_that_does() {
        let error = chosen("object", &names(&["f*", "door"]), &names(&["floor", "wall"])).unwrap_err();
        assert_eq!(error.to_string(), "no object of the scene is called \"door\"");
        assert!(error.help().contains("\"floor\", \"wall\""), "{}", error.help());
        assert_eq!(chosen("object", &names(&["f*"]), &names(&["floor", "wall"])).unwrap(), [true, false]);
    }
}
