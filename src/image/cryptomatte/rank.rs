//! Writing Cryptomatte: what the samples of a pixel show, as ranks of id and coverage.

use super::hash::{header_key, id};
use crate::image::{Content, Layer};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A matte as layers, and what goes into the header for it.
pub struct Ranked {
    /// `NAME00`, `NAME01`, ... with R, G, B, A: id and coverage of two ranks each.
    pub layers: Vec<Layer>,
    pub metadata: Vec<(String, String)>,
    /// Pixels that show more than there are ranks: their smallest parts are lost.
    pub cut: usize,
    /// Names that others share their id with.
    pub collisions: Vec<String>,
}

/// Ranks the names that the samples of each pixel show. `shown` gives the number of a name in `names` for each sample,
/// those of a pixel together; numbers beyond the list are no surface. `ranks` is rounded up to an even number.
pub fn rank(matte: &str, names: &[String], shown: &[u32], per_pixel: usize, ranks: usize) -> Ranked {
    let ids: Vec<u32> = names.iter().map(|name| id(name)).collect();
    let pixels = shown.len() / per_pixel.max(1);
    let count = ranks.div_ceil(2).max(1);
    let mut data = vec![vec![0.0f32; 4 * pixels]; count];
    let one = |samples: &[u32]| {
        let mut found: Vec<(u32, u32)> = Vec::with_capacity(4);
        for id in samples.iter().filter_map(|sample| ids.get(*sample as usize)) {
            match found.iter_mut().find(|(known, _)| known == id) {
                Some((_, hits)) => *hits += 1,
                None => found.push((*id, 1)),
            }
        }
        // The largest first; among equals the order must not depend on the order of samples.
        found.sort_by_key(|(id, hits)| (std::cmp::Reverse(*hits), *id));
        found
    };
    let ranked: Vec<Vec<(u32, u32)>> = shown.par_chunks(per_pixel.max(1)).with_min_len(1024).map(one).collect();
    for (pixel, found) in ranked.iter().enumerate() {
        for (place, (id, hits)) in found.iter().take(2 * count).enumerate() {
            let at = 4 * pixel + 2 * (place % 2);
            data[place / 2][at] = f32::from_bits(*id);
            data[place / 2][at + 1] = *hits as f32 / per_pixel as f32;
        }
    }
    let layer = |(number, data)| Layer::new(&format!("{matte}{number:02}"), &["R", "G", "B", "A"], Content::Data, data);
    let layers = data.into_iter().enumerate().map(layer).collect();
    let cut = ranked.iter().filter(|found| found.len() > 2 * count).count();
    let (metadata, collisions) = header(matte, names, &ids);
    Ranked { layers, metadata, cut, collisions }
}

fn header(matte: &str, names: &[String], ids: &[u32]) -> (Vec<(String, String)>, Vec<String>) {
    let (mut owners, mut collisions) = (BTreeMap::<u32, &str>::new(), Vec::new());
    for (name, id) in names.iter().zip(ids) {
        if *owners.entry(*id).or_insert(name) != name {
            collisions.push(name.clone());
        }
    }
    let manifest: BTreeMap<&str, String> =
        names.iter().zip(ids).map(|(name, id)| (name.as_str(), format!("{id:08x}"))).collect();
    let manifest = serde_json::to_string(&manifest).expect("names and numbers");
    let fields =
        [("conversion", "uint32_to_float32"), ("hash", "MurmurHash3_32"), ("manifest", &manifest), ("name", matte)];
    let key = header_key(matte);
    (fields.map(|(field, value)| (format!("{key}/{field}"), value.to_owned())).to_vec(), collisions)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::image::cryptomatte::Cryptomatte;

    fn names(list: &[&str]) -> Vec<String> {
        list.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn coverage_by_hand() {
        let (torus, floor) = (0, 1);
        let shown = [torus, floor, floor, floor, 9, 9, torus, 9, 9, 9, 9, 9];
        let Ranked { layers, metadata, cut, collisions } =
            rank("CryptoObject", &names(&["torus", "floor"]), &shown, 4, 1);
        assert_eq!((layers.len(), cut, collisions.len()), (1, 0, 0));
        let bits = |name: &str| f32::from_bits(id(name)).to_bits();
        let data: Vec<u32> = layers[0].data.iter().map(|value| value.to_bits()).collect();
        let (quarter, most) = (0.25f32.to_bits(), 0.75f32.to_bits());
        assert_eq!(data[..4], [bits("floor"), most, bits("torus"), quarter]);
        assert_eq!(data[4..], [bits("torus"), quarter, 0, 0, 0, 0, 0, 0]);
        let image = Image { width: 3, height: 1, layers, metadata, ..Image::default() };
        let matte = Cryptomatte::of(&image, "CryptoObject").unwrap();
        assert_eq!(matte.manifest.values().collect::<Vec<_>>(), ["floor", "torus"].iter().collect::<Vec<_>>());
        assert_eq!(matte.coverage(id("torus")), [0.25, 0.25, 0.0]);
    }

    #[test]
    fn what_has_no_rank_is_counted() {
        let ranked = rank("m", &names(&["a", "b", "c", "d"]), &[0, 1, 2, 3, 0, 0, 1, 1], 4, 2);
        assert_eq!((ranked.layers.len(), ranked.cut), (1, 1));
        assert_eq!(rank("m", &names(&["a", "b", "c"]), &[0, 1, 2], 3, 3).layers.len(), 2);
        let empty = rank("m", &[], &[7; 4], 1, 6);
        assert!(empty.layers.len() == 3 && empty.layers.iter().all(|layer| layer.data.iter().all(|x| *x == 0.0)));
    }

    /// The order of samples within a pixel changes nothing.
    #[test]
    fn equal_parts_have_an_order() {
        let list = names(&["a", "b"]);
        let [one, other] = [[0, 1], [1, 0]].map(|shown| rank("m", &list, &shown, 2, 2));
        assert_eq!(one.layers[0].data[..], other.layers[0].data[..]);
    }
}
