//! Displays and views of OpenColorIO in a viewer.

use super::{BLOCK, Channel, Display, NOT_FINITE};
use crate::image::view_transform::{Source, ViewTransform, Views, Wish};
use crate::image::{Layer, colour};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::LazyLock;

/// The views that there are: ACES 2.0, then those of `$OCIO` or, without it, of the configuration that ships with the
/// library; or what is wrong with that configuration. Read once.
pub fn views() -> &'static Result<Vec<Wish>, String> {
    static VIEWS: LazyLock<Result<Vec<Wish>, String>> = LazyLock::new(|| {
        let source = Source::find("", std::path::Path::new(""));
        let list = Views::open(source.clone()).map_err(|error| error.to_string())?.list();
        let of = |(display, views): (String, Vec<String>)| {
            let wish = |view| Wish { source: source.clone(), display: display.clone(), view, input: String::new() };
            views.into_iter().map(wish).collect::<Vec<_>>()
        };
        Ok(std::iter::once(Wish::aces())
            .chain(list.into_iter().flat_map(of).filter(|wish| *wish != Wish::aces()))
            .collect())
    });
    &VIEWS
}

/// Through a view of OpenColorIO: channels are taken before it, gamma and codes come after.
pub(super) fn viewed(layer: &Layer, display: &Display, gain: f32, transform: &ViewTransform) -> Vec<[u8; 4]> {
    let stride = layer.channels.len().max(1);
    let rgb = layer.rgb().unwrap_or(if stride >= 3 { [0, 1, 2] } else { [0; 3] });
    let gamma = 1.0 / display.gamma.max(0.01);
    let mut out = vec![[0, 0, 0, 255]; layer.data.len() / stride];
    out.par_chunks_mut(BLOCK).zip(layer.data.par_chunks(BLOCK * stride)).for_each(|(out, data)| {
        let fetch = |pixel: &[f32]| {
            let colour = Vec3::from(rgb.map(|at| pixel[at]));
            let colour = match display.channel {
                Channel::All => colour,
                Channel::One(channel) => Vec3::splat(pixel[channel.min(stride - 1)]),
                Channel::Luminance => Vec3::splat(colour::luminance(colour)),
            };
            colour.extend(1.0).to_array()
        };
        let mut pixels: Vec<[f32; 4]> = data.chunks_exact(stride).map(fetch).collect();
        let finite: Vec<bool> = pixels.iter().map(|pixel| pixel.iter().all(|x| x.is_finite())).collect();
        transform.apply(&mut pixels, gain);
        for ((out, pixel), finite) in out.iter_mut().zip(pixels).zip(finite) {
            let code = |x: f32| (x.clamp(0.0, 1.0).powf(gamma) * 255.0 + 0.5) as u8;
            let shown = if finite { [pixel[0], pixel[1], pixel[2]].map(code) } else { NOT_FINITE };
            out[..3].copy_from_slice(&shown);
        }
    });
    out
}
