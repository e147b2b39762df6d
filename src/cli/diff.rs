//! `chiaro diff`: how far two pictures are apart.

use super::side::{Side, WHOLE};
use crate::image::cryptomatte::Cryptomatte;
use crate::image::exr_write::Depth;
use crate::image::{Image, Layer, compare, exr_write, load, names, png};
use crate::{Error, Result};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Compare two pictures, or layers of them; B is the reference
///
/// Without a layer on either side, all layers that both have are compared, and a layer that only one has is a
/// difference. Exit code 1 when the pictures differ by more than the limit.
#[derive(clap::Args, Debug, Clone)]
pub struct Args {
    /// What is judged: a file, and a layer of it (`render.exr:indirect`, `render.exr:beauty`)
    #[arg(value_name = "A[:LAYER]")]
    pub a: String,

    /// The reference
    #[arg(value_name = "B[:LAYER]")]
    pub b: String,

    /// Multiply one side by another layer of its file first, such as `B:Diffuse Color` for plates that keep light
    /// without surface colour
    #[arg(long, value_name = "A|B:LAYER")]
    pub times: Vec<String>,

    /// Average over blocks of N x N pixels, all of which show the same object
    #[arg(long, value_name = "N", requires = "objects", value_parser = clap::value_parser!(u16).range(1..))]
    pub blocks: Option<u16>,

    /// The picture whose Cryptomatte says which object a pixel shows
    #[arg(long, value_name = "PLATE.exr", requires = "blocks")]
    pub objects: Option<PathBuf>,

    /// Largest relative RMSE (RMSE over the mean of B, 0.02 is 2 %) that passes; of blocks when they are asked for.
    /// Without it, any difference fails
    #[arg(long, value_name = "X", value_parser = limit)]
    pub max_rmse: Option<f64>,

    /// Write the difference A - B: all layers as they are into .exr; of the beauty, or of the one layer that is
    /// compared, |A - B| over the mean of B, clipped, into .png
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

fn limit(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(limit) if limit >= 0.0 => Ok(limit),
        _ => Err("expected a number from 0 up, such as 0.02".to_owned()),
    }
}

/// Prints the figures; true when the pictures are equal, or within `--max-rmse`.
///
/// # Errors
/// Those of `report`.
pub fn run(args: &Args) -> Result<bool> {
    let (text, equal) = report(args)?;
    // A reader that has gone away (`| head`) is no error.
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
    Ok(equal)
}

/// The figures as text, and whether the pictures are equal, or within `--max-rmse`.
///
/// # Errors
/// `File` when a picture or layer is missing, `Usage` when the arguments contradict each other, `Compute` when the
/// pictures cannot be compared.
pub fn report(args: &Args) -> Result<(String, bool)> {
    let mut text = String::new();
    let sides = [Side::parse(&args.a), Side::parse(&args.b)];
    let factors = factors(&args.times)?;
    let pairs = pairs(&sides, &factors)?;
    let mut differences = Vec::new();
    let objects = match &args.objects {
        Some(path) => Some((path, Cryptomatte::read(path, "CryptoObject")?)),
        None => None,
    };
    let mut equal = true;
    for pair in &pairs {
        let (a, b) = match pair {
            Pair::Both { a, b, width, height } => {
                if let Some((path, matte)) = &objects
                    && (matte.width, matte.height) != (*width, *height)
                {
                    let found = format!("{} x {} pixels, the pictures {width} x {height}", matte.width, matte.height);
                    return Err(Error::file(path, found, "give the objects of the same view and size"));
                }
                (a, b)
            }
            Pair::Only { side, name } => {
                text += &format!("{}: only in {side}\n", names::title(name));
                equal = false;
                continue;
            }
        };
        let width = pair.width();
        let figures = compare::compare(a, b, width)?;
        text += &figures_text(a, b, &figures, compare::ssim(a, b, width));
        let mut judged = figures.relative();
        let mut seen = true;
        if let (Some(size), Some((_, matte))) = (args.blocks, &objects) {
            let blocks = compare::blocks(a, b, width, &matte.whole(WHOLE), usize::from(size))?;
            text += &blocks_text(&blocks, size, matte);
            judged = blocks[0].relative_rmse;
            seen = blocks[0].blocks > 0 && blocks[0].not_finite == 0;
        }
        equal &= match args.max_rmse {
            Some(limit) => judged <= limit && figures.not_finite_differing == 0 && seen,
            None => figures.equal(),
        };
        if args.out.is_some() {
            differences.push((compare::difference(a, b, width)?, figures.mean_b, width));
        }
    }
    if let Some(path) = &args.out {
        write_differences(path, differences)?;
    }
    Ok((text, equal))
}

/// Layers to multiply each side by.
fn factors(times: &[String]) -> Result<[Vec<String>; 2]> {
    let mut factors = [Vec::new(), Vec::new()];
    for text in times {
        match text.split_once(':') {
            Some(("A", layer)) => factors[0].push(layer.to_owned()),
            Some(("B", layer)) => factors[1].push(layer.to_owned()),
            _ => {
                let message = format!("--times \"{text}\": expected A:LAYER or B:LAYER");
                return Err(Error::usage(message, "for example --times \"B:Diffuse Color\""));
            }
        }
    }
    Ok(factors)
}

enum Pair {
    Both { a: Layer, b: Layer, width: usize, height: usize },
    Only { side: &'static str, name: String },
}

impl Pair {
    fn width(&self) -> usize {
        match self {
            Self::Both { width, .. } => *width,
            Self::Only { .. } => 0,
        }
    }
}

/// The layers to compare: those named, or all.
fn pairs(sides: &[Side; 2], factors: &[Vec<String>; 2]) -> Result<Vec<Pair>> {
    let named = sides[0].layer.is_some() || sides[1].layer.is_some() || factors.iter().any(|list| !list.is_empty());
    if !named {
        let [a, b] = [load::load(&sides[0].path, None)?, load::load(&sides[1].path, None)?];
        same_size(sides, &a, &b)?;
        let mut pairs: Vec<Pair> = Vec::new();
        for layer in &a.layers {
            pairs.push(match b.layer(&layer.name) {
                Some(other) => both(layer.clone(), other.clone(), &a),
                None => Pair::Only { side: "A", name: layer.name.clone() },
            });
        }
        let rest = b.layers.iter().filter(|layer| a.layer(&layer.name).is_none());
        pairs.extend(rest.map(|layer| Pair::Only { side: "B", name: layer.name.clone() }));
        return Ok(pairs);
    }
    let read = |index: usize| -> Result<(Layer, Image)> {
        let side = &sides[index];
        // A layer named on one side only is meant on both.
        let name = side.layer.as_deref().or(sides[1 - index].layer.as_deref()).unwrap_or("");
        side.read(name, &factors[index])
    };
    let ((a, image_a), (b, image_b)) = (read(0)?, read(1)?);
    same_size(sides, &image_a, &image_b)?;
    Ok(vec![both(a, b, &image_a)])
}

fn both(a: Layer, b: Layer, image: &Image) -> Pair {
    Pair::Both { a, b, width: image.width, height: image.height }
}

fn same_size(sides: &[Side; 2], a: &Image, b: &Image) -> Result<()> {
    if a.colour_space != b.colour_space {
        let (one, other) = (a.colour_space.id(), b.colour_space.id());
        tracing::warn!("colours are {one} in A and {other} in B; they are compared as they are");
    }
    if (a.width, a.height) == (b.width, b.height) {
        return Ok(());
    }
    let size = |side: &Side, image: &Image| format!("{} has {} x {}", side.path.display(), image.width, image.height);
    let message = format!("sizes differ: {}, {} pixels", size(&sides[0], a), size(&sides[1], b));
    Err(Error::compute(message, "compare pictures of one size"))
}

fn figures_text(a: &Layer, b: &Layer, figures: &compare::Figures, ssim: Option<f64>) -> String {
    let mut text = a.title().to_owned();
    if a.name != b.name {
        text += &format!(" against {}", b.title());
    }
    text += if figures.differing == 0 { ": equal\n" } else { "\n" };
    let mut line = |name: &str, value: String| text += &format!("  {name:<20} {value}\n");
    line("RMSE", format!("{:.6e}, relative {:.6}", figures.rmse, figures.relative()));
    line("mean", format!("{:.6e}, reference {:.6e}", figures.mean_a, figures.mean_b));
    if figures.max > 0.0 {
        let [x, y] = figures.max_at;
        line("largest difference", format!("{:.6e} at {x},{y} in {}", figures.max, figures.max_channel));
    }
    line("values that differ", figures.differing.to_string());
    let [in_a, in_b] = [figures.not_finite_a, figures.not_finite_b];
    if in_a + in_b > 0 {
        line("NaN or infinite", format!("A {in_a}, B {in_b}, not the same {}", figures.not_finite_differing));
    }
    if !figures.left_out.is_empty() {
        line("only on one side", figures.left_out.join(" "));
    }
    if let Some(ssim) = ssim {
        line("SSIM", format!("{ssim:.6}"));
    }
    text
}

fn blocks_text(figures: &[compare::BlockFigures], size: u16, matte: &Cryptomatte) -> String {
    let heading = format!("blocks of {size} x {size}");
    let mut text = format!("  {heading:<28} {:>8} {:>14} {:>10}\n", "blocks", "relative RMSE", "bias");
    for one in figures {
        let name = if one.object == 0 { "all objects".to_owned() } else { matte.title(one.object) };
        let (error, bias) = (100.0 * one.relative_rmse, 100.0 * one.bias);
        text += &format!("    {name:<26} {:>8} {error:>12.3} % {bias:>+8.3} %", one.blocks);
        if one.not_finite > 0 {
            text += &format!("   {} blocks left out: NaN or infinite", one.not_finite);
        }
        text.push('\n');
    }
    text
}

/// Layers of `a - b`, each with the mean of b and its width.
fn write_differences(path: &Path, mut layers: Vec<(Layer, f64, usize)>) -> Result<()> {
    let Some(width) = layers.first().map(|(.., width)| *width) else {
        return Err(Error::usage("--out: the pictures have no layer in common", "name the layers: A.exr:LAYER"));
    };
    let warnings = match load::extension(path).as_str() {
        "png" => {
            let one = layers.len() == 1;
            let Some((layer, mean, _)) = layers.iter().find(|(layer, ..)| one || layer.name.is_empty()) else {
                let message =
                    format!("--out {}: {} layers are compared, none the beauty", path.display(), layers.len());
                return Err(Error::usage(message, "name one layer, A.exr:LAYER, or write .exr"));
            };
            let scale = if *mean == 0.0 { 1.0 } else { (1.0 / mean.abs()) as f32 };
            // Alpha would hide what it is meant to show.
            let keep: Vec<usize> = (0..layer.channels.len()).filter(|&i| layer.channels[i] != "A").collect();
            let pixels = layer.data.chunks(layer.channels.len());
            let data = pixels.flat_map(|pixel| keep.iter().map(|&i| pixel[i].abs() * scale)).collect();
            let channels: Vec<&str> = keep.iter().map(|&i| layer.channels[i].as_str()).collect();
            png::write(path, &Layer::new("", &channels, layer.content, data), width)?
        }
        "exr" => {
            if let [(only, ..)] = &mut layers[..] {
                only.name = String::new();
            }
            let height = layers[0].0.data.len() / layers[0].0.channels.len() / width;
            let layers = layers.into_iter().map(|(layer, ..)| layer).collect();
            exr_write::write(path, &Image { width, height, layers, ..Image::default() }, Depth::Float, &[])?
        }
        _ => {
            return Err(Error::usage(
                format!("--out {}: expected .exr or .png", path.display()),
                "name it difference.exr",
            ));
        }
    };
    warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    Ok(())
}
