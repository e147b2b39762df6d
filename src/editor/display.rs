//! A layer as the viewer shows it: exposure, a view transform, gamma, single channels and false colour. Only what is
//! seen changes, never the picture.

mod views;

pub use views::views;

use crate::image::view_transform::Wish;
use crate::image::{ColourSpace, Content, Image, Layer, colour};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use std::sync::LazyLock;

/// Pixels that one task maps.
const BLOCK: usize = 4096;

#[derive(Clone, Debug, PartialEq)]
pub struct Display {
    /// Empty for the beauty.
    pub layer: String,
    /// Stops.
    pub exposure: f32,
    /// On top of the view transform; 1 changes nothing.
    pub gamma: f32,
    pub transform: Transform,
    pub channel: Channel,
    /// Stops of luminance as colours.
    pub false_colour: bool,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Transform {
    /// The sRGB curve alone.
    Plain,
    /// Luminance L to L / (1 + L), then the sRGB curve.
    Reinhard,
    /// A display and view of OpenColorIO. Data is shown plain.
    View(Wish),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    All,
    /// One of the layer's, as grey.
    One(usize),
    Luminance,
}

impl Default for Display {
    fn default() -> Self {
        Self {
            layer: String::new(),
            exposure: 0.0,
            gamma: 1.0,
            transform: Transform::Plain,
            channel: Channel::All,
            false_colour: false,
        }
    }
}

/// False colour: what luminance, in stops over 0.18, has which colour. Between them colours run into each other.
pub const ZONES: [(f32, [u8; 3]); 7] = [
    (-6.0, [60, 0, 90]),
    (-4.0, [20, 60, 200]),
    (-2.0, [0, 150, 160]),
    (0.0, [110, 110, 110]),
    (1.5, [60, 170, 40]),
    (2.5, [240, 210, 0]),
    (4.0, [230, 20, 20]),
];

/// What is not finite is shown so, whatever else is set.
pub const NOT_FINITE: [u8; 3] = [255, 0, 255];

/// RGBA of each pixel, row by row, alpha 255; `None` when the picture has no such layer.
///
/// Data is brought into range first: unit vectors from -1..1 to 0..1, other numbers over their largest.
pub fn pixels(image: &Image, display: &Display) -> Option<Vec<[u8; 4]>> {
    let layer = image.layer(&display.layer)?;
    let stride = layer.channels.len().max(1);
    let (scale, offset) = range(layer);
    let (rgb, gain) = (layer.rgb(), display.exposure.exp2());
    if let (Transform::View(wish), Content::Colour, false) = (&display.transform, layer.content, display.false_colour) {
        return Some(match wish.transform(image.colour_space) {
            Ok(transform) => views::viewed(layer, display, gain, &transform),
            Err(error) => {
                // Not as if it were that view.
                tracing::warn!("{}: {error}", wish.title());
                let [r, g, b] = NOT_FINITE;
                vec![[r, g, b, 255]; layer.data.len() / stride]
            }
        });
    }
    let matrix = match layer.content {
        Content::Colour => image.colour_space.to(ColourSpace::Rec709),
        Content::Data => Mat3::IDENTITY,
    };
    let fetch = |pixel: &[f32]| -> Vec3 {
        let at = |channel: usize| (pixel.get(channel).copied().unwrap_or(0.0) * scale + offset) * gain;
        let all = || match (rgb, stride) {
            (Some(rgb), _) => matrix * Vec3::from(rgb.map(at)),
            (None, 3..) => Vec3::new(at(0), at(1), at(2)),
            _ => Vec3::splat(at(0)),
        };
        match display.channel {
            Channel::All => all(),
            Channel::One(channel) => Vec3::splat(at(channel.min(stride - 1))),
            Channel::Luminance => Vec3::splat(colour::luminance(all())),
        }
    };
    let mut out = vec![[0, 0, 0, 255]; layer.data.len() / stride];
    out.par_chunks_mut(BLOCK).zip(layer.data.par_chunks(BLOCK * stride)).for_each(|(out, data)| {
        for (out, pixel) in out.iter_mut().zip(data.chunks_exact(stride)) {
            let value = fetch(pixel);
            let shown = match value.is_finite() {
                false => NOT_FINITE,
                true if display.false_colour => zone(colour::luminance(value)),
                true => encoded(value, display),
            };
            out[..3].copy_from_slice(&shown);
        }
    });
    Some(out)
}

/// Scale and offset that bring data into 0..1.
fn range(layer: &Layer) -> (f32, f32) {
    if layer.content == Content::Colour {
        return (1.0, 0.0);
    }
    let finite = || layer.data.par_iter().copied().filter(|x| x.is_finite());
    let (least, most) = (finite().reduce(|| 0.0, f32::min), finite().reduce(|| 0.0, f32::max));
    match () {
        () if (-1.001..0.0).contains(&least) && most <= 1.001 => (0.5, 0.5),
        () if most > 1.001 || least < 0.0 => (1.0 / (most - least).max(f32::MIN_POSITIVE), -least / (most - least)),
        () => (1.0, 0.0),
    }
}

fn encoded(value: Vec3, display: &Display) -> [u8; 3] {
    let value = match display.transform {
        Transform::Plain | Transform::View(_) => value,
        Transform::Reinhard => value / (1.0 + colour::luminance(value).max(0.0)),
    };
    let gamma = 1.0 / display.gamma.max(0.01);
    value.to_array().map(|x| {
        let x = x.clamp(0.0, 1.0);
        CODES.of(if gamma == 1.0 { x } else { x.powf(gamma) })
    })
}

/// sRGB codes without a power: of each range of numbers that share their upper half the least code, and of each code the
/// least number that has it.
struct Codes {
    least: Vec<u8>,
    from: [f32; 257],
}

static CODES: LazyLock<Codes> = LazyLock::new(Codes::new);

/// By its power.
fn code(x: f32) -> u8 {
    (colour::srgb_from_linear(x) * 255.0 + 0.5) as u8
}

impl Codes {
    fn new() -> Self {
        let from = std::array::from_fn(|wanted| {
            // Numbers from 0 up are in the order of their bits.
            let (mut low, mut high) = (0, 1f32.to_bits() + 1);
            while low < high {
                let middle = (low + high) / 2;
                if usize::from(code(f32::from_bits(middle))) < wanted { low = middle + 1 } else { high = middle }
            }
            if wanted > 255 { f32::INFINITY } else { f32::from_bits(low) }
        });
        let least = (0..=1f32.to_bits() >> 16).map(|upper| code(f32::from_bits(upper << 16))).collect();
        Self { least, from }
    }

    /// In [0, 1]; the same as `code`.
    fn of(&self, x: f32) -> u8 {
        let mut code = self.least[(x.to_bits() >> 16) as usize];
        while x >= self.from[usize::from(code) + 1] {
            code += 1;
        }
        code
    }
}

fn zone(luminance: f32) -> [u8; 3] {
    let stops = (luminance.max(0.0) / 0.18).log2();
    let above = ZONES.partition_point(|(from, _)| *from <= stops);
    match (above.checked_sub(1).map(|below| ZONES[below]), ZONES.get(above)) {
        (None, _) => [0, 0, 0],
        (Some((_, last)), None) => last,
        (Some((from, a)), Some((to, b))) => {
            let t = (stops - from) / (to - from);
            std::array::from_fn(|c| (f32::from(a[c]) + (f32::from(b[c]) - f32::from(a[c])) * t + 0.5) as u8)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> Image {
        let layers = vec![
            Layer::new("", &["R", "G", "B", "A"], Content::Colour, vec![0.0, 0.5, 1.0, 1.0, f32::NAN, 0.0, 2.0, 0.0]),
            Layer::new("N", &["X", "Y", "Z"], Content::Data, vec![0.0, -0.5, 0.0, 0.8, 0.0, 0.0]),
            Layer::new("Z", &["Z"], Content::Data, vec![4.0, 8.0]),
        ];
        Image { width: 2, height: 1, layers, ..Image::default() }
    }

    fn shown(display: Display) -> Vec<[u8; 4]> {
        pixels(&image(), &display).unwrap()
    }

    #[test]
    fn colours_by_hand() {
        let plain = shown(Display::default());
        assert_eq!(plain, [[0, 188, 255, 255], [255, 0, 255, 255]], "sRGB of a half is 188; NaN is magenta");
        assert_eq!(shown(Display { exposure: 1.0, ..Display::default() })[0], [0, 255, 255, 255]);
        assert_eq!(shown(Display { exposure: -1.0, ..Display::default() })[0][2], 188);
        assert_eq!(shown(Display { channel: Channel::One(1), ..Display::default() })[0], [188, 188, 188, 255]);
        let luminance = shown(Display { channel: Channel::Luminance, ..Display::default() })[0];
        assert!(luminance[0] == luminance[2] && luminance[0] > 150);
        assert!(shown(Display { transform: Transform::Reinhard, ..Display::default() })[0][2] < 255);
        assert!(shown(Display { gamma: 2.0, ..Display::default() })[0][1] > 188);
        assert!(pixels(&image(), &Display { layer: "no".to_owned(), ..Display::default() }).is_none());
    }

    #[test]
    fn views_of_ocio_are_shown_and_data_is_not_touched() {
        let views = views().as_ref().unwrap();
        assert!(views[0] == Wish::aces() && views.len() > 5);
        let aces = |layer: &str, exposure| Display {
            layer: layer.to_owned(),
            exposure,
            transform: Transform::View(Wish::aces()),
            ..Display::default()
        };
        let mut sent = [[0.0, 0.5, 1.0, 1.0]];
        Wish::aces().transform(ColourSpace::Rec709).unwrap().apply(&mut sent, 2.0);
        let codes = [0, 1, 2].map(|c| (sent[0][c] * 255.0 + 0.5) as u8);
        let beauty = shown(aces("", 1.0));
        assert_eq!((&beauty[0][..3], &beauty[1][..3]), (&codes[..], &NOT_FINITE[..]));
        assert_eq!(shown(aces("N", 0.0)), shown(Display { layer: "N".to_owned(), ..Display::default() }));
        // Colours of another space are shown as the same colours.
        let there = image().to_space(ColourSpace::AcesCg);
        let [a, b] = [&image(), &there].map(|image| pixels(image, &aces("", 0.0)).unwrap()[0]);
        let [c, d] = [&image(), &there].map(|image| pixels(image, &Display::default()).unwrap()[0]);
        let near = |a: [u8; 4], b: [u8; 4]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 1);
        assert!(near(a, b) && near(c, d), "{a:?} {b:?} {c:?} {d:?}");
    }

    #[test]
    fn codes_are_those_of_the_power() {
        let all = (0..=1f32.to_bits()).step_by(997).map(f32::from_bits);
        let edges =
            CODES.from[..256].iter().flat_map(|edge| [*edge, edge.next_down().max(0.0), edge.next_up().min(1.0)]);
        for x in all.chain(edges).chain([0.0, 1.0]) {
            assert_eq!(CODES.of(x), code(x), "{x}");
        }
    }

    #[test]
    fn data_is_brought_into_range() {
        let layer = |name: &str| Display { layer: name.to_owned(), ..Display::default() };
        // A half, a quarter and nine tenths, whatever the largest of them is.
        assert_eq!(shown(layer("N")), [[188, 137, 188, 255], [243, 188, 188, 255]]);
        assert_eq!(shown(layer("Z")), [[188, 188, 188, 255], [255, 255, 255, 255]]);
    }

    #[test]
    fn false_colours_run_from_dark_to_bright() {
        assert_eq!((zone(0.0), zone(0.18), zone(1e9)), ([0, 0, 0], [110, 110, 110], [230, 20, 20]));
        assert_eq!(zone(0.18 / 64.0), [60, 0, 90]);
        let between = zone(0.18 / 2.0);
        assert!(between != zone(0.18) && between != zone(0.18 / 4.0));
        assert_eq!(shown(Display { false_colour: true, ..Display::default() })[1], [255, 0, 255, 255]);
    }
}
