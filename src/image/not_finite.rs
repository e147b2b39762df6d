//! NaN and infinity in pictures: counted and named, and what is to become of them.

use super::{Image, Layer};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What becomes of values that are NaN or infinite. They are counted and named in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NotFinite {
    /// They are kept, with a warning.
    #[default]
    Pass,
    /// They are an error.
    Stop,
    /// They become 0, with a warning.
    Zero,
}

/// What is not finite in a layer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    pub layer: String,
    pub count: usize,
    /// Column, row and channel of the first.
    pub first: (usize, usize, String),
}

impl std::fmt::Display for Found {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Self { layer, count, first: (x, y, channel) } = self;
        let (values, are) = if *count == 1 { ("value", "is") } else { ("values", "are") };
        write!(f, "layer \"{layer}\": {count} {values} {are} NaN or infinite, the first at {x},{y} in {channel}")
    }
}

/// What to do about it.
pub const HELP: &str = "render the picture again, or set not_finite to zero or pass";

/// Looks through one layer of `width` pixels a row.
pub fn find(layer: &Layer, width: usize) -> Option<Found> {
    let count = layer.data.par_iter().filter(|value| !value.is_finite()).count();
    let at = layer.data.par_iter().position_first(|value| !value.is_finite())?;
    let (pixel, channel) = (at / layer.channels.len(), at % layer.channels.len());
    let first = (pixel % width, pixel / width, layer.channels[channel].clone());
    Some(Found { layer: layer.title().to_owned(), count, first })
}

impl NotFinite {
    /// Applies the choice to all layers; tells what was found.
    ///
    /// # Errors
    /// All that was found, under `Stop`.
    pub fn apply(self, image: &mut Image) -> Result<Vec<Found>, String> {
        let mut all = Vec::new();
        for layer in &mut image.layers {
            let Some(found) = find(layer, image.width) else { continue };
            all.push(found);
            if self == Self::Zero {
                let zero = |value: &f32| if value.is_finite() { *value } else { 0.0 };
                *layer = layer.with_data(layer.data.par_iter().map(zero).collect());
            }
        }
        if self == Self::Stop && !all.is_empty() {
            return Err(all.iter().map(Found::to_string).collect::<Vec<_>>().join("; "));
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Content;

    #[test]
    fn all_are_found_and_become_what_is_chosen() {
        let bad = vec![1.0, 2.0, 3.0, 4.0, f32::NAN, 6.0, 7.0, 8.0, f32::NEG_INFINITY, 1.0, 1.0, 1.0];
        let layers = vec![
            Layer::new("", &["R", "G", "B"], Content::Colour, vec![1.0; 12]),
            Layer::new("light", &["R", "G", "B"], Content::Colour, bad),
        ];
        let image = Image { width: 2, height: 2, layers, ..Image::default() };
        let found = [Found { layer: "light".into(), count: 2, first: (1, 0, "G".into()) }];
        let mut passed = image.clone();
        assert_eq!(NotFinite::Pass.apply(&mut passed).unwrap(), found);
        assert!(passed.layers[1].data[4].is_nan());
        let mut zeroed = image.clone();
        assert_eq!(NotFinite::Zero.apply(&mut zeroed).unwrap(), found);
        assert_eq!(zeroed.layers[1].data[..], [1.0, 2.0, 3.0, 4.0, 0.0, 6.0, 7.0, 8.0, 0.0, 1.0, 1.0, 1.0]);
        assert_eq!(NotFinite::Stop.apply(&mut zeroed).unwrap(), []);
        let error = NotFinite::Stop.apply(&mut image.clone()).unwrap_err();
        assert!(error.contains("\"light\": 2 values") && error.contains("at 1,0 in G"), "{error}");
    }
}
