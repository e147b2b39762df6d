//! Display and view transforms of OpenColorIO: ACES 2.0 that ships with the library, or any display and view of a
//! configuration (`$OCIO`, or a file). The only file that names the library; `ready` keeps what was made.
//!
//! In: colours of a known linear space. Out: what the display is sent, alpha as it was.

mod ready;

pub use ready::Wish;

use super::ColourSpace;
use crate::names::suggest;
use crate::{Error, Result};
use glam::{Mat3, Vec3};
use ocio::processor::CpuProcessor;
use ocio::{Config, TransformDirection};
use rayon::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// The configuration that ships with the library: ACES 2.0 for computer graphics.
const BUILT_IN: &str = "ocio://cg-config-v4.0.0_aces-v2.0_ocio-v2.5";
/// Its view for screens of ordinary range.
const ACES: &str = "ACES 2.0 - SDR 100 nits (Rec.709)";
/// Pixels that one task maps.
const BLOCK: usize = 4096;

/// Where displays and views come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// ACES 2.0.
    BuiltIn,
    /// Another that ships with the library, as `ocio://NAME`.
    Shipped(String),
    File(PathBuf),
}

impl Source {
    /// The file that is named, else that of `$OCIO`, else what ships with the library.
    pub fn find(file: &str, base: &Path) -> Self {
        Self::named(file, base, std::env::var("OCIO").ok())
    }

    fn named(file: &str, base: &Path, environment: Option<String>) -> Self {
        let of = |name: &str, base: &Path| match name.starts_with("ocio://") {
            true => Self::Shipped(name.to_owned()),
            false => Self::File(base.join(name)),
        };
        let here = || std::env::current_dir().unwrap_or_default();
        match (file, environment.filter(|name| !name.is_empty())) {
            ("", Some(name)) => of(&name, &here()),
            ("", None) => Self::BuiltIn,
            (file, _) => of(file, base),
        }
    }

    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::BuiltIn | Self::Shipped(_) => None,
            Self::File(path) => Some(path),
        }
    }

    fn title(&self) -> String {
        match self {
            Self::BuiltIn => "the built-in configuration".to_owned(),
            Self::Shipped(name) => name.clone(),
            Self::File(path) => path.display().to_string(),
        }
    }

    fn fault(&self, message: impl Into<String>, help: impl Into<String>) -> Error {
        match self {
            Self::File(path) => Error::file(path, message, help),
            Self::BuiltIn | Self::Shipped(_) => Error::compute(message, help),
        }
    }
}

/// A configuration that has been read.
pub struct Views {
    source: Source,
    config: Config,
}

/// A display and a view of it, ready for pixels.
pub struct ViewTransform {
    processor: CpuProcessor,
    /// From the pixels' space to the one that the configuration takes.
    matrix: Mat3,
    /// Files that the transform was read from, beside the configuration.
    pub files: Vec<PathBuf>,
}

/// The library is young: what it does not foresee in a file is the file's fault, not a crash of ours.
fn guarded<T>(source: &Source, work: impl FnOnce() -> ocio::Result<T>) -> Result<T> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => {
            let help = "check the OpenColorIO configuration, and the files that it names";
            Err(source.fault(error.to_string(), help))
        }
        Err(_) => {
            Err(source.fault("cannot be understood as an OpenColorIO configuration", "try it in another program"))
        }
    }
}

/// Drops what the library remembers of files.
fn forget() {
    ocio::clear_all_caches();
}

impl Views {
    /// # Errors
    /// `File` for a configuration that cannot be read.
    pub fn open(source: Source) -> Result<Self> {
        let config = match &source {
            Source::BuiltIn => guarded(&source, || Config::create_from_file(BUILT_IN))?,
            Source::Shipped(name) => guarded(&source, || Config::create_from_file(name))?,
            Source::File(path) => {
                std::fs::metadata(path).map_err(|e| Error::file(path, e.to_string(), "check the path, or $OCIO"))?;
                guarded(&source, || Config::create_from_file(&path.to_string_lossy()))?
            }
        };
        Ok(Self { source, config })
    }

    /// Displays, each with its views; the default ones first.
    pub fn list(&self) -> Vec<(String, Vec<String>)> {
        let first = |mut names: Vec<String>, default: String| {
            names.sort_by_key(|name| *name != default);
            names
        };
        let displays = (0..self.config.num_displays()).map(|i| self.config.display(i)).collect();
        let views = |display: String| {
            let views = (0..self.config.num_views(&display)).map(|i| self.config.view(&display, i)).collect();
            let default = self.config.default_view(&display);
            (display, first(views, default))
        };
        first(displays, self.config.default_display()).into_iter().map(views).collect()
    }

    /// Empty names: the configuration's own choice. `input`: the configuration's name for the pixels' space, where it
    /// does not say what its linear space is.
    ///
    /// # Errors
    /// `Compute` for a display, view or space that the configuration does not have; `File` for files that it names and
    /// that cannot be read.
    pub fn transform(&self, display: &str, view: &str, input: &str, pixels: ColourSpace) -> Result<ViewTransform> {
        let list = self.list();
        let pick = |name: &str, names: &mut dyn Iterator<Item = &str>, what: &str| -> Result<String> {
            let names: Vec<&str> = names.collect();
            match names.iter().find(|known| name.is_empty() || **known == name) {
                Some(found) => Ok((*found).to_owned()),
                None => {
                    let message = format!("{} has no {what} \"{name}\"", self.source.title());
                    Err(Error::compute(message, suggest(name, names.iter().copied())))
                }
            }
        };
        let display = pick(display, &mut list.iter().map(|(name, _)| name.as_str()), "display")?;
        let views = &list.iter().find(|(name, _)| *name == display).expect("it was picked from the list").1;
        let view = pick(view, &mut views.iter().map(String::as_str), &format!("view of display \"{display}\""))?;
        let (from, matrix) = self.input(input, pixels)?;
        guarded(&self.source, || {
            let processor =
                self.config.get_display_view_processor_dir(&from, &display, &view, TransformDirection::Forward)?;
            let files = processor.processor_metadata().files().iter().map(PathBuf::from).collect();
            Ok(ViewTransform { processor: processor.default_cpu_processor(), matrix, files })
        })
    }

    /// The configuration's space that pixels are brought into, and how.
    fn input(&self, named: &str, pixels: ColourSpace) -> Result<(String, Mat3)> {
        if !named.is_empty() {
            if self.config.get_color_space(named).is_none() {
                let message = format!("{} has no colour space \"{named}\"", self.source.title());
                return Err(Error::compute(message, "name one of its colour spaces, or leave input empty"));
            }
            return Ok((named.to_owned(), Mat3::IDENTITY));
        }
        // What this role is, is fixed; what `scene_linear` is, is up to each configuration.
        if self.config.has_role("aces_interchange") {
            return Ok(("aces_interchange".to_owned(), pixels.to(ColourSpace::Aces)));
        }
        if self.config.has_role("scene_linear") {
            return Ok(("scene_linear".to_owned(), pixels.to(ColourSpace::Rec709)));
        }
        let message = format!("{} names neither aces_interchange nor scene_linear", self.source.title());
        Err(Error::compute(message, "name the colour space of the picture with input"))
    }
}

impl Wish {
    /// ACES 2.0 for an sRGB screen.
    pub fn aces() -> Self {
        let [display, view, input] = ["sRGB - Display", ACES, ""].map(str::to_owned);
        Self { source: Source::BuiltIn, display, view, input }
    }

    /// For reports.
    pub fn title(&self) -> String {
        let named = [&self.display, &self.view].into_iter().filter(|name| !name.is_empty());
        let named: Vec<String> = named.cloned().chain([self.source.title()]).collect();
        named.join(", ")
    }
}

impl ViewTransform {
    /// RGBA pixels, times `gain`, to what the display is sent. NaN stays NaN.
    pub fn apply(&self, pixels: &mut [[f32; 4]], gain: f32) {
        pixels.par_chunks_mut(BLOCK).for_each(|pixels| {
            let before = pixels.to_vec();
            for pixel in pixels.iter_mut() {
                // Beyond this the library's curves overflow; infinite light is as much as they take.
                let bound = |x: f32| if x.is_nan() { 0.0 } else { x.clamp(-1e6, 1e6) };
                let [r, g, b, _] = pixel.map(|x| bound(x * gain));
                let [r, g, b] = (self.matrix * Vec3::new(r, g, b)).to_array().map(bound);
                *pixel = [r, g, b, 1.0];
            }
            self.processor.apply_rgba_slice(pixels.as_flattened_mut());
            for (pixel, before) in pixels.iter_mut().zip(before) {
                pixel[3] = before[3];
                for (value, before) in pixel.iter_mut().zip(before) {
                    if before.is_nan() {
                        *value = before;
                    }
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapped(transform: &ViewTransform, rgb: [f32; 3]) -> [f32; 4] {
        let mut pixel = [[rgb[0], rgb[1], rgb[2], 0.5]];
        transform.apply(&mut pixel, 1.0);
        pixel[0]
    }

    #[test]
    fn aces_brings_light_into_range() {
        let aces = Wish::aces().transform(ColourSpace::Rec709).unwrap();
        assert!(aces.files.is_empty());
        let grey = mapped(&aces, [0.18; 3]);
        assert!(grey[..3].iter().all(|x| (x - 0.349).abs() < 0.002) && grey[3] == 0.5, "{grey:?}");
        let mut last = -1.0;
        for stops in -12..20 {
            let [r, g, b, _] = mapped(&aces, [0.18 * (stops as f32).exp2(); 3]);
            assert!(r > last && r <= 1.0001 && (r - g).abs() < 2e-3 && (r - b).abs() < 2e-3, "{stops}: {r} {g} {b}");
            last = r.min(0.999);
        }
        let odd = mapped(&aces, [f32::NAN, f32::INFINITY, 0.2]);
        assert!(odd[0].is_nan() && odd[1..3].iter().all(|x| x.is_finite()), "{odd:?}");
        let blown = mapped(&aces, [f32::INFINITY, f32::MAX, 1e9]);
        assert!(blown[..3].iter().all(|x| *x > 0.95), "infinite light is white: {blown:?}");
        // The same colour, whatever space it comes in.
        let colour = glam::Vec3::new(0.5, 0.2, 0.1);
        let other = Wish::aces().transform(ColourSpace::AcesCg).unwrap();
        let there = ColourSpace::Rec709.to(ColourSpace::AcesCg) * colour;
        let (a, b) = (mapped(&aces, colour.to_array()), mapped(&other, there.to_array()));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
    }

    #[test]
    fn displays_and_views_are_listed_and_found() {
        let views = Views::open(Source::BuiltIn).unwrap();
        let list = views.list();
        assert!(list[0].0 == "sRGB - Display" && list[0].1[0] == ACES && list.len() > 3, "{list:?}");
        let fault = |display: &str, view: &str, input: &str| {
            let error = views.transform(display, view, input, ColourSpace::Rec709).err().unwrap();
            format!("{error}; {}", error.help())
        };
        assert!(fault("sRGB - Dispaly", "", "").contains("did you mean \"sRGB - Display\"?"));
        assert!(fault("", "ACES 3.0", "").contains("Un-tone-mapped"));
        assert!(fault("", "", "no such space").contains("no such space"));
        let plain = views.transform("sRGB - Display", "Un-tone-mapped", "", ColourSpace::Rec709).unwrap();
        let half = mapped(&plain, [0.5; 3]);
        assert!((half[0] - crate::image::colour::srgb_from_linear(0.5)).abs() < 1e-4, "{half:?}");
    }

    #[test]
    fn a_configuration_is_that_of_the_recipe_or_of_the_environment() {
        let base = Path::new("recipes");
        let named = |file: &str, environment: Option<&str>| Source::named(file, base, environment.map(str::to_owned));
        assert_eq!(named("", None), Source::BuiltIn);
        assert_eq!(named("", Some("")), Source::BuiltIn);
        assert_eq!(named("a.ocio", Some("/b.ocio")), Source::File("recipes/a.ocio".into()));
        assert_eq!(named("", Some("/b.ocio")), Source::File("/b.ocio".into()));
        let Source::File(here) = named("", Some("b.ocio")) else { panic!("a file") };
        assert!(here.is_absolute() && here.ends_with("b.ocio"), "{here:?}");
        let studio = named("", Some("ocio://studio-config-v4.0.0_aces-v2.0_ocio-v2.5"));
        assert!(matches!(studio, Source::Shipped(_)) && Views::open(studio).unwrap().list().len() > 5);
        assert!(Views::open(Source::Shipped("ocio://none".into())).is_err());
    }

    #[test]
    fn configurations_that_are_none_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config.ocio");
        let open = || Views::open(Source::File(path.clone()));
        assert!(open().err().unwrap().to_string().contains("config.ocio"));
        for text in [
            "",
            "{",
            "ocio_profile_version: 99\n",
            "displays: [1, 2",
            "\u{0}\u{1}",
            "ocio_profile_version: 2\nroles: 7\n",
        ] {
            std::fs::write(&path, text).unwrap();
            let found = open().and_then(|views| views.transform("", "", "", ColourSpace::Rec709));
            assert!(found.is_err(), "{text:?}");
        }
    }
}
