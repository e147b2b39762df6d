//! Names of layers that every compositor takes: `[A-Za-z0-9_]`, not starting with a digit, no `ViewLayer.` in front.

use super::cryptomatte::{header_key, matte_of};
use super::{Image, Layer, names};
use std::collections::{BTreeMap, BTreeSet, HashSet};

impl Image {
    /// The same picture with plain names: the beauty, whatever it is called, has none (its channels are `R G B A`);
    /// `ViewLayer.Diffuse Direct` is `Diffuse_Direct`, or `ViewLayer_Diffuse_Direct` where another layer would be
    /// called the same. Cryptomattes keep their headers.
    pub fn with_plain_names(&self) -> Self {
        let beauty = self.place("").ok();
        // The layers of a matte go together: they are named once, and numbered.
        let stem = |layer: &Layer| matte_of(&layer.name).unwrap_or(&layer.name).to_owned();
        let short = |stem: &str| plain(names::split(stem).1);
        let stems: BTreeSet<String> = self.layers.iter().map(stem).collect();
        let mut seen = HashSet::new();
        let twice: HashSet<String> =
            stems.iter().map(|stem| short(stem)).filter(|name| !seen.insert(name.clone())).collect();
        let (mut taken, mut mattes) = (HashSet::new(), BTreeMap::new());
        let mut layers = self.layers.clone();
        for (at, layer) in layers.iter_mut().enumerate() {
            let stem = stem(layer);
            let name = match short(&stem) {
                _ if Some(at) == beauty => String::new(),
                name if twice.contains(&name) => plain(&stem),
                name => name,
            };
            let name = match matte_of(&layer.name) {
                Some(old) => {
                    mattes.insert(old.to_owned(), name.clone());
                    name + &layer.name[old.len()..]
                }
                None => unused(&name, &taken),
            };
            layer.channels.iter_mut().for_each(|channel| *channel = plain(channel));
            taken.insert(name.clone());
            layer.name = name;
        }
        Self { layers, metadata: renamed(&self.metadata, &mattes), ..self.clone() }
    }
}

fn plain(name: &str) -> String {
    let mut plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if plain.starts_with(|c: char| c.is_ascii_digit()) {
        plain.insert(0, '_');
    }
    plain
}

fn unused(name: &str, taken: &HashSet<String>) -> String {
    if !taken.contains(name) {
        return name.to_owned();
    }
    let name = if name.is_empty() { "beauty" } else { name };
    let numbered = (2..).map(|number| format!("{name}_{number}"));
    numbered.into_iter().find(|name| !taken.contains(name)).expect("numbers do not end")
}

/// Headers of mattes under their new names; all others as they are.
fn renamed(metadata: &[(String, String)], mattes: &BTreeMap<String, String>) -> Vec<(String, String)> {
    let keys: BTreeMap<&str, &str> = metadata
        .iter()
        .filter_map(|(name, value)| Some((name.strip_prefix("cryptomatte/")?.strip_suffix("/name")?, value.as_str())))
        .collect();
    let rename = |(name, value): &(String, String)| {
        let parts = name.strip_prefix("cryptomatte/").and_then(|rest| rest.split_once('/'));
        let new = parts.and_then(|(key, field)| Some((mattes.get(*keys.get(key)?)?, field)));
        match new {
            Some((matte, "name")) => (format!("{}/name", header_key(matte)), matte.clone()),
            Some((matte, field)) => (format!("{}/{field}", header_key(matte)), value.clone()),
            None => (name.clone(), value.clone()),
        }
    };
    metadata.iter().map(rename).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Content;
    use crate::image::cryptomatte::Cryptomatte;

    fn image(names: &[&str]) -> Image {
        let layer = |name: &&str| Layer::new(name, &["R", "G", "B", "A"], Content::Colour, vec![0.5; 4]);
        Image { width: 1, height: 1, layers: names.iter().map(layer).collect(), ..Image::default() }
    }

    fn plainly(names: &[&str]) -> Vec<String> {
        image(names).with_plain_names().layers.into_iter().map(|layer| layer.name).collect()
    }

    #[test]
    fn names_by_hand() {
        let blender = ["ViewLayer.Combined", "ViewLayer.Diffuse Direct", "ViewLayer.CryptoObject00"];
        assert_eq!(plainly(&blender), ["", "Diffuse_Direct", "CryptoObject00"]);
        assert_eq!(plainly(&["", "indirect", "2nd light", "Schatten ü"]), ["", "indirect", "_2nd_light", "Schatten__"]);
        let two = ["A.Combined", "B.Combined", "A.Mist"];
        assert_eq!(plainly(&two), ["A_Combined", "B_Combined", "Mist"], "neither is the beauty");
        let three = ["A.CryptoObject00", "A.CryptoObject01", "B.CryptoObject00"];
        assert_eq!(plainly(&three), ["A_CryptoObject00", "A_CryptoObject01", "B_CryptoObject00"]);
        assert_eq!(plainly(&["a b", "a_b", "x.a-b"]), ["a_b", "a_b_2", "x_a_b"]);
    }

    #[test]
    fn a_matte_keeps_its_header() {
        let mut image = image(&["View.CryptoObject00", "View.CryptoObject01"]);
        let field = |name: &str, value: &str| (format!("cryptomatte/abcdef0/{name}"), value.to_owned());
        image.metadata = vec![
            field("manifest", r#"{"torus":"f19c73fd"}"#),
            field("name", "View.CryptoObject"),
            ("note".into(), "x".into()),
        ];
        let matte = Cryptomatte::of(&image.with_plain_names(), "CryptoObject").unwrap();
        assert_eq!((matte.name.as_str(), matte.title(0xf19c73fd).as_str()), ("CryptoObject", "torus"));
        let metadata = image.with_plain_names().metadata;
        assert!(metadata.iter().all(|(name, _)| name == "note" || name.starts_with(&header_key("CryptoObject"))));
        assert_eq!(metadata.len(), 3);
    }
}
