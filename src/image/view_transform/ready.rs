//! Transforms that were made before, for as long as the files that they were made from stay the same.

use super::{Source, ViewTransform, Views};
use crate::Result;
use crate::image::ColourSpace;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

/// What is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wish {
    pub source: Source,
    /// Empty: the configuration's own choice.
    pub display: String,
    pub view: String,
    /// The configuration's name for the pixels' space; empty: found.
    pub input: String,
}

struct Known {
    wish: Wish,
    pixels: ColourSpace,
    stamps: Vec<Stamp>,
    transform: Arc<ViewTransform>,
}

type Stamp = (PathBuf, Option<(u64, SystemTime)>);

/// More than a window of viewers asks for.
const MOST: usize = 16;

static KNOWN: Mutex<Vec<Known>> = Mutex::new(Vec::new());

fn stamp(path: &Path) -> Stamp {
    let about = std::fs::metadata(path).ok();
    (path.to_owned(), about.and_then(|about| Some((about.len(), about.modified().ok()?))))
}

impl Wish {
    /// # Errors
    /// As `Views::open` and `Views::transform`.
    pub fn transform(&self, pixels: ColourSpace) -> Result<Arc<ViewTransform>> {
        let mut known = KNOWN.lock().expect("no panic while it is held");
        if let Some(at) = known.iter().position(|known| known.wish == *self && known.pixels == pixels) {
            if known[at].stamps.iter().all(|before| stamp(&before.0) == *before) {
                return Ok(known[at].transform.clone());
            }
            known.remove(at);
        }
        drop(known);
        // The library keeps what it read of files, and what failed of them.
        super::forget();
        let before = self.source.file().map(stamp);
        let transform =
            Arc::new(Views::open(self.source.clone())?.transform(&self.display, &self.view, &self.input, pixels)?);
        let stamps = before.into_iter().chain(transform.files.iter().map(|file| stamp(file))).collect();
        let mut known = KNOWN.lock().expect("no panic while it is held");
        if known.len() >= MOST {
            known.remove(0);
        }
        known.push(Known { wish: self.clone(), pixels, stamps, transform: transform.clone() });
        Ok(transform)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transform_is_made_again_when_its_files_change() {
        let folder = tempfile::tempdir().unwrap();
        let config = |gain: f32| {
            format!(
                "ocio_profile_version: 2\nsearch_path: \"\"\nroles:\n  scene_linear: lin\n  default: lin\n\
                 displays:\n  screen:\n    - !<View> {{name: plain, colorspace: out}}\n\
                 colorspaces:\n  - !<ColorSpace> {{name: lin}}\n  - !<ColorSpace>\n    name: out\n    \
                 from_scene_reference: !<GroupTransform>\n      children:\n        \
                 - !<FileTransform> {{src: look.cube}}\n        - !<MatrixTransform> {{matrix: [{gain}, 0, 0, 0, 0, {gain}, 0, 0, 0, 0, {gain}, 0, 0, 0, 0, 1]}}\n"
            )
        };
        let cube = |half: f32| format!("LUT_1D_SIZE 3\n0 0 0\n{half} {half} {half}\n1 1 1\n");
        let path = folder.path().join("config.ocio");
        let write = |gain: f32, half: f32| {
            std::fs::write(&path, config(gain)).unwrap();
            std::fs::write(folder.path().join("look.cube"), cube(half)).unwrap();
        };
        let wish = Wish {
            source: Source::File(path.clone()),
            display: String::new(),
            view: String::new(),
            input: String::new(),
        };
        let shown = || {
            let transform = wish.transform(ColourSpace::Rec709).unwrap();
            let mut pixel = [[0.5, 0.5, 0.5, 1.0]];
            transform.apply(&mut pixel, 1.0);
            (pixel[0][0], transform)
        };
        write(1.0, 0.25);
        let (value, first) = shown();
        assert!((value - 0.25).abs() < 1e-5, "{value}");
        assert_eq!(first.files, [folder.path().join("look.cube")]);
        assert!(Arc::ptr_eq(&first, &shown().1), "it is kept");
        write(1.0, 0.625);
        assert!((shown().0 - 0.625).abs() < 1e-5, "the table has changed: {}", shown().0);
        write(0.125, 0.625);
        assert!((shown().0 - 0.625 / 8.0).abs() < 1e-5, "the configuration has changed: {}", shown().0);
        // A table that was damaged and is repaired.
        std::fs::write(folder.path().join("look.cube"), "LUT_1D_SIZE x").unwrap();
        assert!(wish.transform(ColourSpace::Rec709).is_err());
        write(1.0, 0.75);
        assert!((shown().0 - 0.75).abs() < 1e-5, "{}", shown().0);
        std::fs::remove_file(folder.path().join("look.cube")).unwrap();
        assert!(wish.transform(ColourSpace::Rec709).err().unwrap().to_string().contains("config.ocio"));
    }
}
