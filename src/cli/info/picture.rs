//! What is in a picture.

use super::list;
use crate::image::cryptomatte::{Cryptomatte, matte_of};
use crate::image::exr_read::ExrFile;
use crate::image::{Content, Image, Layer, load, names};
use crate::{Error, Result};
use serde::Serialize;
use std::path::Path;

/// The header field that carries the recipe.
const RECIPE: &str = "chiaro:recipe";

#[derive(Serialize)]
pub struct Picture {
    file: String,
    /// As people call it.
    format: &'static str,
    size: [usize; 2],
    /// Linear space of its colours.
    colours: &'static str,
    parts: usize,
    compression: Vec<String>,
    /// Left, top, width, height, where they are not the picture.
    data_windows: Vec<[i64; 4]>,
    layers: Vec<LayerInfo>,
    cryptomattes: Vec<Matte>,
    header: Vec<(String, String)>,
}

#[derive(Serialize)]
struct LayerInfo {
    name: String,
    /// Found as the beauty.
    beauty: bool,
    channels: Vec<String>,
    /// Positions, depth, ids: not colour.
    data: bool,
    /// `half`, `float` or `uint`; several where channels differ.
    stored: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    values: Option<Values>,
}

#[derive(Serialize)]
struct Values {
    least: f32,
    mean: f64,
    largest: f32,
    not_finite: usize,
}

#[derive(Serialize)]
struct Matte {
    name: String,
    /// Those in the manifest; `None` where there is no manifest.
    names: Option<Vec<String>>,
}

/// # Errors
/// `File` for what cannot be read.
pub fn describe(path: &Path, values: bool) -> Result<Picture> {
    let is_exr = load::is_exr(path)?;
    if !is_exr {
        let image = load::load(path, None)?;
        return Ok(of_image(path, &image, values));
    }
    let file = ExrFile::open(path)?;
    let (stored, display) = (file.stored(), file.display());
    let mut windows: Vec<[i64; 4]> = Vec::new();
    let mut compression: Vec<String> = Vec::new();
    for header in file.headers() {
        let window = header.data_window();
        let [left, top] = [window.position.0, window.position.1].map(i64::from);
        let window_of = [left, top, window.size.0 as i64, window.size.1 as i64];
        if window != display && !windows.contains(&window_of) {
            windows.push(window_of);
        }
        let packed = header.compression.to_string();
        if !compression.contains(&packed) {
            compression.push(packed);
        }
    }
    let (parts, colours) = (file.headers().len(), file.colour_space().id());
    let image = match values {
        true => load::load(path, None)?,
        false => file.outline(),
    };
    let mut picture = of_image(path, &image, values);
    picture.layers.iter_mut().zip(&stored).for_each(|(layer, stored)| layer.stored.clone_from(stored));
    Ok(Picture { format: "OpenEXR", parts, compression, colours, data_windows: windows, ..picture })
}

fn of_image(path: &Path, image: &Image, values: bool) -> Picture {
    let beauty = image.place("").ok();
    let layer = |(at, layer): (usize, &Layer)| LayerInfo {
        name: layer.name.clone(),
        beauty: Some(at) == beauty,
        channels: layer.channels.clone(),
        data: layer.content == Content::Data,
        stored: String::new(),
        // Ids are no numbers to average.
        values: (values && matte_of(&layer.name).is_none()).then(|| measure(layer)),
    };
    let format = match load::extension(path).as_str() {
        "hdr" => "Radiance HDR",
        "png" => "PNG",
        _ => "JPEG",
    };
    Picture {
        file: path.display().to_string(),
        format,
        size: [image.width, image.height],
        colours: image.colour_space.id(),
        parts: 1,
        compression: Vec::new(),
        data_windows: Vec::new(),
        layers: image.layers.iter().enumerate().map(layer).collect(),
        cryptomattes: mattes(image),
        header: image.metadata.clone(),
    }
}

fn measure(layer: &Layer) -> Values {
    let finite = || layer.data.iter().filter(|value| value.is_finite());
    let count = finite().count();
    Values {
        least: finite().fold(f32::INFINITY, |least, value| least.min(*value)),
        mean: finite().map(|value| f64::from(*value)).sum::<f64>() / count.max(1) as f64,
        largest: finite().fold(f32::NEG_INFINITY, |most, value| most.max(*value)),
        not_finite: layer.data.len() - count,
    }
}

fn short(value: f64) -> String {
    if value == 0.0 || (1e-3..1e5).contains(&value.abs()) { format!("{value:.5}") } else { format!("{value:.3e}") }
}

fn mattes(image: &Image) -> Vec<Matte> {
    let describe = |name: String| {
        let manifest = Cryptomatte::manifest_of(image, &name);
        Matte { name, names: (!manifest.is_empty()).then(|| manifest.into_values().collect()) }
    };
    Cryptomatte::names(image).into_iter().map(describe).collect()
}

/// The recipe in a picture's header.
///
/// # Errors
/// `File` for what cannot be read, and for a picture that carries none.
pub fn recipe(path: &Path) -> Result<String> {
    let missing = || Error::file(path, "carries no recipe", "only EXR files written by chiaro know how they were made");
    if !load::is_exr(path)? {
        return Err(missing());
    }
    let file = ExrFile::open(path)?;
    let found = file.metadata().iter().find(|(name, _)| name == RECIPE);
    found.map(|(_, recipe)| recipe.clone()).ok_or_else(missing)
}

impl Picture {
    pub fn text(&self) -> String {
        let [width, height] = self.size;
        let mut text = format!("{}: {}, {width} x {height} pixels", self.file, self.format);
        if self.parts > 1 {
            text += &format!(", {} parts", self.parts);
        }
        if !self.compression.is_empty() {
            text += &format!(", {}", self.compression.join(" and "));
        }
        text += &format!(", {}\n", self.colours);
        for [left, top, width, height] in &self.data_windows {
            text += &format!("  a data window of {width} x {height} at {left},{top}\n");
        }
        let wide = self.layers.iter().map(|layer| names::title(&layer.name).chars().count()).max().unwrap_or(0).min(48);
        for layer in &self.layers {
            let (title, channels) = (names::title(&layer.name), layer.channels.join(" "));
            let mut line = format!("  {title:<wide$}  {channels:<8} {:<6}", layer.stored);
            if let Some(Values { least, mean, largest, not_finite }) = &layer.values {
                let [least, largest, mean] = [f64::from(*least), f64::from(*largest), *mean].map(short);
                line += &format!(" {least:>10} .. {largest:<10} mean {mean:<10}");
                if *not_finite > 0 {
                    line += &format!(" {not_finite} NaN or infinite");
                }
            }
            if layer.beauty && !layer.name.is_empty() {
                line += " (the beauty)";
            }
            text += line.trim_end();
            text.push('\n');
        }
        for matte in &self.cryptomattes {
            text += &match &matte.names {
                Some(names) => format!("  Cryptomatte {}: {}\n", matte.name, list(names)),
                None => format!("  Cryptomatte {}: no manifest\n", matte.name),
            };
        }
        for (name, value) in self.header.iter().filter(|(name, _)| !name.starts_with("cryptomatte/")) {
            let line = value.lines().next().unwrap_or("");
            let long = value.lines().nth(1).is_some() || line.chars().count() > 80;
            text += &match name.as_str() {
                RECIPE => "  made by a recipe: print it with --recipe\n".to_owned(),
                _ if long => format!("  {name}: {}...\n", line.chars().take(80).collect::<String>()),
                _ => format!("  {name}: {line}\n"),
            };
        }
        text
    }
}
