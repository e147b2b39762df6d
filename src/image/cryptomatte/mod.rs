//! Cryptomatte 1.2: which objects (or materials, or assets) a pixel shows, and how much of each.
//!
//! A matte called `CryptoObject` lies in layers `CryptoObject00`, `01`, `02`: red and green are id and coverage of rank
//! 2N, blue and alpha of rank 2N + 1, sorted by coverage. Ids are hashes of names, kept as the bits of a float. Source:
//! Cryptomatte Specification 1.2.0 (Psyop).

mod hash;
mod rank;

pub use hash::{header_key, id};
pub use rank::{Ranked, rank};

use super::{Image, Layer, exr_read, names};
use crate::{Error, Result};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashSet};
use std::path::Path;

/// One matte of a picture.
#[derive(Clone, Debug)]
pub struct Cryptomatte {
    /// Name of the matte, such as `ViewLayer.CryptoObject`.
    pub name: String,
    pub width: usize,
    pub height: usize,
    /// Names by id; empty where the file carries no manifest.
    pub manifest: BTreeMap<u32, String>,
    /// Layers 00, 01, ... with four channels each.
    ranks: Vec<Layer>,
}

impl Cryptomatte {
    /// Reads the matte called `wanted` (`CryptoObject`, `CryptoMaterial`, ...) of a file, and nothing else of it.
    pub fn read(path: &Path, wanted: &str) -> Result<Self> {
        let file = exr_read::ExrFile::open(path)?;
        let names = file.layer_names();
        let matte = find_matte(&names, wanted).map_err(|e| Error::file(path, e.message, e.help))?;
        let indices: Vec<usize> = (0..names.len()).filter(|&i| matte_of(names[i]) == Some(matte.as_str())).collect();
        let image = file.read(&indices)?;
        Self::of(&image, wanted).map_err(|e| Error::file(path, e.message, e.help))
    }

    /// The matte called `wanted` of a picture.
    pub fn of(image: &Image, wanted: &str) -> std::result::Result<Self, names::NotFound> {
        let all: Vec<&str> = image.layers.iter().map(|layer| layer.name.as_str()).collect();
        let name = find_matte(&all, wanted)?;
        let mut ranks: Vec<Layer> =
            image.layers.iter().filter(|layer| matte_of(&layer.name) == Some(&name)).cloned().collect();
        ranks.sort_by(|a, b| a.name.cmp(&b.name));
        if let Some(short) = ranks.iter().find(|layer| layer.channels.len() != 4) {
            return Err(names::NotFound {
                message: format!("layer \"{}\" has {} channels; a Cryptomatte has 4", short.name, short.channels.len()),
                help: "write the matte's layers with R, G, B and A".to_owned(),
            });
        }
        Ok(Self { manifest: manifest(image, &name), name, width: image.width, height: image.height, ranks })
    }

    /// The mattes of a picture.
    pub fn names(image: &Image) -> Vec<String> {
        let mut names: Vec<String> =
            image.layers.iter().filter_map(|layer| matte_of(&layer.name)).map(str::to_owned).collect();
        names.dedup();
        names
    }

    /// The names of a matte by their ids; empty where the picture carries none.
    pub fn manifest_of(image: &Image, matte: &str) -> BTreeMap<u32, String> {
        manifest(image, matte)
    }

    /// Id and coverage of the object that covers most of a pixel. Id 0 is no object.
    pub fn first(&self, pixel: usize) -> (u32, f32) {
        let data = &self.ranks[0].data[4 * pixel..];
        (data[0].to_bits(), data[1])
    }

    /// Per pixel the id of the one object that covers more than `coverage` of it; 0 where there is none.
    pub fn whole(&self, coverage: f32) -> Vec<u32> {
        let pixels = self.ranks[0].data.len() / 4;
        (0..pixels).map(|pixel| self.first(pixel)).map(|(id, part)| if part > coverage { id } else { 0 }).collect()
    }

    /// How much of each pixel an object covers, in [0, 1].
    pub fn coverage(&self, id: u32) -> Vec<f32> {
        let pairs =
            |pixel: usize| self.ranks.iter().flat_map(move |rank| rank.data[4 * pixel..4 * pixel + 4].chunks(2));
        let covered = |pixel| pairs(pixel).filter(|pair| pair[0].to_bits() == id).map(|pair| pair[1]).sum::<f32>();
        (0..self.ranks[0].data.len() / 4).map(covered).collect()
    }

    /// How much of each pixel belongs to names that match one of `patterns`, in [0, 1]. A pattern without wildcards is
    /// found by its hash, so that it needs no manifest; an id can be given as eight hexadecimal digits.
    ///
    /// # Errors
    /// `Compute` for a pattern that is not well formed, or that matches nothing; wildcards without a manifest.
    pub fn covered(&self, patterns: &[String]) -> crate::Result<Vec<f32>> {
        let ids = self.matching(patterns)?;
        let one = |pixel: usize| {
            let pairs = self.ranks.iter().flat_map(|rank| rank.data[4 * pixel..4 * pixel + 4].chunks(2));
            let covered: f32 = pairs.filter(|pair| ids.contains(&pair[0].to_bits())).map(|pair| pair[1]).sum();
            // Not finite: nothing that is known to be covered.
            if covered.is_finite() { covered.clamp(0.0, 1.0) } else { 0.0 }
        };
        Ok((0..self.ranks[0].data.len() / 4).into_par_iter().with_min_len(4096).map(one).collect())
    }

    /// Ids of the names that match.
    fn matching(&self, patterns: &[String]) -> crate::Result<HashSet<u32>> {
        let present: HashSet<u32> = self
            .ranks
            .iter()
            .flat_map(|rank| rank.data.as_chunks::<2>().0)
            .filter(|pair| pair[1] > 0.0)
            .map(|pair| pair[0].to_bits())
            .collect();
        let names: Vec<&str> = self.manifest.values().map(String::as_str).collect();
        let mut ids = HashSet::new();
        for pattern in patterns {
            let wild = pattern.contains(['*', '?', '[', '{']);
            let given = (pattern.len() == 8).then(|| u32::from_str_radix(pattern, 16).ok()).flatten();
            match given.filter(|id| present.contains(id)).or(Some(id(pattern)).filter(|_| !wild)) {
                Some(id) if present.contains(&id) || self.manifest.contains_key(&id) => _ = ids.insert(id),
                Some(_) if self.manifest.is_empty() => {
                    let message = format!("{}: nothing here is called \"{pattern}\"", self.name);
                    let shown = self.list(present.iter().copied());
                    let help = format!("the file has no manifest, so only ids are known: {shown}");
                    return Err(crate::Error::compute(message, help));
                }
                None if self.manifest.is_empty() => {
                    let message = format!("{}: \"{pattern}\" has wildcards, but the file has no manifest", self.name);
                    let shown = self.list(present.iter().copied());
                    let help = format!("give whole names, which are found by their hash, or ids: {shown}");
                    return Err(crate::Error::compute(message, help));
                }
                _ => {
                    let chosen = crate::names::chosen(&self.name, std::slice::from_ref(pattern), &names)?;
                    let all = self.manifest.keys().zip(chosen);
                    ids.extend(all.filter(|(_, chosen)| *chosen).map(|(id, _)| *id));
                }
            }
        }
        Ok(ids)
    }

    fn list(&self, ids: impl Iterator<Item = u32>) -> String {
        const MOST: usize = 20;
        let mut titles: Vec<String> = ids.filter(|id| *id != 0).map(|id| self.title(id)).collect();
        titles.sort();
        let more = titles.len().saturating_sub(MOST);
        titles.truncate(MOST);
        let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
        titles.join(", ") + &rest
    }

    /// The name of an id, or the id in hexadecimal where the manifest has none.
    pub fn title(&self, id: u32) -> String {
        self.manifest.get(&id).cloned().unwrap_or_else(|| format!("{id:08x}"))
    }
}

/// `ViewLayer.CryptoObject00` -> `ViewLayer.CryptoObject`.
pub fn matte_of(layer: &str) -> Option<&str> {
    let (matte, digits) = layer.split_at_checked(layer.len().checked_sub(2)?)?;
    let numbered = digits.bytes().all(|byte| byte.is_ascii_digit());
    (numbered && names::split(matte).1.to_ascii_lowercase().contains("crypto")).then_some(matte)
}

fn find_matte(layers: &[&str], wanted: &str) -> std::result::Result<String, names::NotFound> {
    let mut mattes: Vec<&str> = layers.iter().filter_map(|layer| matte_of(layer)).collect();
    mattes.dedup();
    if mattes.is_empty() {
        let message = "no Cryptomatte; found no layers such as CryptoObject00".to_owned();
        return Err(names::NotFound { message, help: "render the picture with Cryptomatte for objects".to_owned() });
    }
    // Arnold's `crypto_object` is `CryptoObject`.
    let bare = |name: &str| names::split(name).1.to_ascii_lowercase().replace('_', "");
    let alike: Vec<&&str> = mattes.iter().filter(|matte| bare(matte) == bare(wanted)).collect();
    if let ([only], false) = (&alike[..], mattes.contains(&wanted)) {
        return Ok((**only).to_owned());
    }
    names::find(&mattes, wanted).map(|index| mattes[index].to_owned())
}

/// Names by id out of the header `cryptomatte/<7 characters>/manifest` of the matte with that name.
fn manifest(image: &Image, matte: &str) -> BTreeMap<u32, String> {
    let field = |key: &str, end: &str| {
        image.metadata.iter().find(|(name, _)| name.strip_suffix(end) == Some(key)).map(|(_, value)| value.as_str())
    };
    let mut keys = image.metadata.iter().filter_map(|(name, _)| {
        let key = name.strip_suffix("/name")?;
        key.starts_with("cryptomatte/").then_some(key)
    });
    let Some(key) = keys.find(|key| field(key, "/name") == Some(matte)) else {
        tracing::warn!("{matte}: no manifest in the header; objects are called by their ids");
        return BTreeMap::new();
    };
    let Some(text) = field(key, "/manifest") else {
        tracing::warn!("{matte}: the manifest is not in the header; objects are called by their ids");
        return BTreeMap::new();
    };
    match serde_json::from_str::<BTreeMap<String, String>>(text) {
        Ok(ids) => ids.into_iter().filter_map(|(name, id)| Some((u32::from_str_radix(&id, 16).ok()?, name))).collect(),
        Err(error) => {
            tracing::warn!("{matte}: damaged manifest ({error}); objects are called by their ids");
            BTreeMap::new()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Content;

    #[test]
    fn reads_ranks_and_names() {
        let (a, b) = (f32::from_bits(id("torus")), f32::from_bits(id("floor")));
        let rank = |name, data| Layer::new(name, &["R", "G", "B", "A"], Content::Data, data);
        let metadata = [
            ("cryptomatte/1234567/name", "View.CryptoObject"),
            ("cryptomatte/1234567/manifest", r#"{"torus":"f19c73fd"}"#),
        ];
        let image = Image {
            width: 2,
            height: 1,
            layers: vec![rank("View.CryptoObject00", vec![a, 0.75, b, 0.25, b, 1.0, 0.0, 0.0])],
            metadata: metadata.map(|(name, value)| (name.to_owned(), value.to_owned())).to_vec(),
            ..Image::default()
        };
        let matte = Cryptomatte::of(&image, "CryptoObject").unwrap();
        assert_eq!(matte.whole(0.99), [0, id("floor")]);
        assert_eq!(matte.coverage(id("floor")), [0.25, 1.0]);
        assert_eq!(matte.title(id("torus")), "torus");
        assert_eq!(matte.title(id("floor")), "7819c83c");
        assert!(Cryptomatte::of(&image, "CryptoMaterial").is_err());
    }
}
