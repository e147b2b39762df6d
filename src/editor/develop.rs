//! From what was computed to pixels of the window: the display transform, and a selection laid over it. Off the window's
//! thread, because a large picture takes longer than a frame.

use super::display::{self, Display};
use super::latest::Latest;
use super::shown::Shown;
use crate::image::Image;
use rayon::prelude::*;

/// RGBA, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pixels {
    pub width: usize,
    pub height: usize,
    pub data: Vec<[u8; 4]>,
    /// Pixels of the picture to one of these, across and down.
    pub step: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Developed {
    pub picture: Pixels,
    pub other: Option<Pixels>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub display: Display,
    pub show_mask: bool,
    /// Pixels along a side that the window takes.
    pub most: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { display: Display::default(), show_mask: true, most: 8192 }
    }
}

/// What a selection is tinted with, and how strongly.
const MASK: [f32; 3] = [255.0, 70.0, 40.0];
const OPACITY: f32 = 0.55;

/// A layer that the picture does not have is shown as its beauty, or as its first.
pub fn develop(shown: &Shown, settings: &Settings) -> Developed {
    let mut picture = pixels(&shown.picture, settings);
    if let Some(mask) = shown.mask.as_ref().filter(|_| settings.show_mask) {
        let (step, width, full) = (picture.step, picture.width.max(1), shown.picture.width);
        picture.data.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let weight = OPACITY * mask.get(y * step * full + x * step).copied().unwrap_or(0.0);
                for (value, tint) in pixel.iter_mut().zip(MASK) {
                    *value = (f32::from(*value) * (1.0 - weight) + tint * weight + 0.5) as u8;
                }
            }
        });
    }
    Developed { picture, other: shown.other.as_ref().map(|other| pixels(other, settings)) }
}

fn pixels(image: &Image, settings: &Settings) -> Pixels {
    let shown = match &settings.display.layer {
        name if image.layer(name).is_some() => image.layer(name),
        _ => image.find("").ok().or(image.layers.first()),
    };
    let layer = shown.map(|layer| layer.name.clone()).unwrap_or_default();
    let display = Display { layer, ..settings.display.clone() };
    let step = image.width.max(image.height).div_ceil(settings.most.max(1)).max(1);
    let data = display::pixels(image, &display).unwrap_or_default();
    if step == 1 {
        return Pixels { width: image.width, height: image.height, data, step };
    }
    let (width, height) = (image.width.div_ceil(step), image.height.div_ceil(step));
    let at = |i: usize| data[(i / width) * step * image.width + (i % width) * step];
    Pixels { width, height, data: (0..width * height).into_par_iter().map(at).collect(), step }
}

/// Develops on a thread of its own; the newest wins.
pub struct Developer {
    thread: Latest<(u64, Shown, Settings), (u64, Developed)>,
    /// Numbers of what was asked for last, and of what came back last.
    asked: u64,
    done: u64,
}

impl Developer {
    /// `wake` is called when there is something developed.
    pub fn new(wake: impl Fn() + Send + 'static) -> Self {
        let work = |(number, shown, settings)| Some((number, develop(&shown, &settings)));
        Self { thread: Latest::new("developing", work, wake), asked: 0, done: 0 }
    }

    pub fn develop(&mut self, shown: &Shown, settings: &Settings) {
        self.asked += 1;
        self.thread.ask((self.asked, shown.clone(), settings.clone()));
    }

    /// The newest that is developed since it was last asked.
    pub fn developed(&mut self) -> Option<Developed> {
        let (number, developed) = self.thread.answer()?;
        self.done = number;
        Some(developed)
    }

    /// All has come back that was asked for.
    pub fn is_idle(&self) -> bool {
        self.done == self.asked
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Content, Layer};
    use std::sync::Arc;

    fn shown(mask: Option<Vec<f32>>) -> Shown {
        let layers = vec![Layer::new("only", &["Y"], Content::Colour, vec![0.0, 1.0, 0.0, 1.0, 0.0, 0.0])];
        let picture = Arc::new(Image { width: 3, height: 2, layers, ..Image::default() });
        Shown { picture, other: None, samples: None, scene: None, mask: mask.map(Arc::new), light: None }
    }

    #[test]
    fn a_selection_tints_what_it_holds() {
        let masked = shown(Some(vec![0.0, 0.0, 1.0, 1.0, 0.0, 0.0]));
        let data = develop(&masked, &Settings::default()).picture.data;
        assert_eq!((data[0], data[1]), ([0, 0, 0, 255], [255; 4]), "where it is not, nothing changes");
        assert_eq!(data[2], [140, 39, 22, 255]);
        assert!(data[3][0] == 255 && data[3][2] < 200);
        let off = Settings { show_mask: false, ..Settings::default() };
        assert_eq!(develop(&masked, &off).picture.data, develop(&shown(None), &off).picture.data);
    }

    #[test]
    fn what_is_too_large_is_thinned() {
        let thin = develop(&shown(Some(vec![0.0; 6])), &Settings { most: 2, ..Settings::default() }).picture;
        assert_eq!((thin.width, thin.height, thin.step), (2, 1, 2));
        assert_eq!(thin.data, [[0, 0, 0, 255]; 2]);
    }

    #[test]
    fn the_newest_is_developed_in_the_end() {
        let mut developer = Developer::new(|| {});
        for stops in 0..50 {
            let display = Display { exposure: -(stops as f32), ..Display::default() };
            developer.develop(&shown(None), &Settings { display, ..Settings::default() });
        }
        let (mut last, start) = (None, std::time::Instant::now());
        while last.as_ref().is_none_or(|last: &Developed| last.picture.data[1] != [0, 0, 0, 255]) {
            assert!(start.elapsed().as_secs() < 60, "the newest is never developed");
            last = developer.developed().or(last);
            std::thread::yield_now();
        }
        assert!(developer.is_idle());
    }
}
