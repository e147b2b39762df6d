//! Edits in another renderer: contrib/mitsuba reads the file of sampled edits, applies it in a final gather of its own, and
//! gets the picture that chiaro renders.
//!
//! Needs Python with `mitsuba`, `numpy` and `scipy` (PyPI), as `python3` or in `$CHIARO_PYTHON`, and the project's test data;
//! says what it skips without them.

#[path = "support/folder.rs"]
mod folder;
#[path = "support/python.rs"]
mod python;
mod support;

use chiaro::image::exr_read;
use serde_json::{Value as Json, json};
use std::path::Path;
use std::process::{Command, Output};

const MODULES: [&str; 3] = ["mitsuba", "numpy", "scipy"];
const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/contrib/mitsuba/render.py");
const WIDTH: usize = 120;
const HEIGHT: usize = 90;
/// Pixels along a side of what is compared: noise of the other renderer is not what this is about.
const BLOCK: usize = 6;

/// Edits of every part of a file: scale rows, offset rows (a weakened shadow), a source, and the eye. Pictures with them and
/// without.
fn recipe(scene: &Path) -> Json {
    let pick = |materials: &[&str], objects: &[&str]| {
        json!({ "type": "pick", "params": { "materials": materials, "objects": objects }, "inputs": { "scene": "stage" } })
    };
    let size = json!({ "width": WIDTH, "height": HEIGHT, "samples_per_pixel": 16, "tolerance": 0.02 });
    json!({ "chiaro": 1, "nodes": {
        "stage": { "type": "scene", "params": { "file": scene } },
        // Not the resolution of the pictures (thesis figure 5.4).
        "view": { "type": "view_samples", "params": { "width": 320, "height": 240 }, "inputs": { "scene": "stage" } },
        "transport": { "type": "transfer", "params": { "gather_samples": 16384 },
                       "inputs": { "scene": "stage", "samples": "view" } },
        "red": pick(&["red"], &[]), "box": pick(&[], &["box"]), "floor": pick(&["floor"], &[]), "blue": pick(&["blue"], &[]),
        "bleed": { "type": "caster_receiver", "params": { "brightness": 3.0, "hue": 40.0 },
                   "inputs": { "caster": "red", "receiver": "box" } },
        "open": { "type": "indirect_shadow", "params": { "amount": 0.7 },
                  "inputs": { "caster": "box", "receiver": "floor", "edits": "bleed" } },
        "glow": { "type": "source_brush", "params": { "scale": 0.3 }, "inputs": { "selection": "blue", "edits": "open" } },
        "dodge": { "type": "illumination_brush", "params": { "scale": 1.6 },
                   "inputs": { "selection": "floor", "edits": "glow" } },
        "sampled": { "type": "scale_offset", "inputs": { "scene": "stage", "transfer": "transport", "edits": "dodge" } },
        "kept": { "type": "write_edits", "params": { "file": "stage.edits" }, "inputs": { "edits": "sampled" } },
        "plain": { "type": "final_gather", "params": size, "inputs": { "scene": "stage" } },
        "edited": { "type": "final_gather", "params": size, "inputs": { "scene": "stage", "edits": "sampled" } },
        "out": { "type": "write_image", "params": { "file": "plain.exr", "depth": "float" }, "inputs": { "image": "plain" } },
        "out_edited": { "type": "write_image", "params": { "file": "edited.exr", "depth": "float" },
                        "inputs": { "image": "edited" } },
    }})
}

fn chiaro(recipe: &Path) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("chiaro"));
    let arguments = ["render", recipe.to_str().unwrap(), "--no-cache", "--device", "cpu"];
    python::said(command.env("CHIARO_LOG", "error").args(arguments).output().unwrap());
}

/// Means of the indirect light over blocks of pixels, RGB.
fn blocks(file: &Path) -> Vec<[f64; 3]> {
    let image = exr_read::read_layers(file, &["indirect"]).unwrap();
    let layer = image.find("indirect").unwrap();
    assert_eq!(layer.data.len(), 3 * WIDTH * HEIGHT, "{}", file.display());
    let mut means = vec![[0.0; 3]; (WIDTH / BLOCK) * (HEIGHT / BLOCK)];
    for (pixel, light) in layer.data.chunks_exact(3).enumerate() {
        let block = pixel / WIDTH / BLOCK * (WIDTH / BLOCK) + pixel % WIDTH / BLOCK;
        for (mean, light) in means[block].iter_mut().zip(light) {
            *mean += f64::from(*light) / (BLOCK * BLOCK) as f64;
        }
    }
    means
}

/// Relative RMSE of `a` to `b` over the chosen blocks.
fn apart(a: &[[f64; 3]], b: &[[f64; 3]], chosen: &[bool]) -> f64 {
    let (mut difference, mut all) = (0.0, 0.0);
    for ((a, b), _) in a.iter().zip(b).zip(chosen).filter(|(_, chosen)| **chosen) {
        for (a, b) in a.iter().zip(b) {
            difference += (a - b).powi(2);
            all += b * b;
        }
    }
    (difference / all).sqrt()
}

#[test]
fn another_renderer_applies_the_edits_and_gets_the_same_picture() {
    let test = "another_renderer_applies_the_edits_and_gets_the_same_picture";
    let Some(scene) = support::all_data(test, &["scenes/stage.glb"]).pop() else { return };
    let Some(python) = python::with(test, &MODULES) else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("recipe.json"), recipe(&scene).to_string()).unwrap();
    chiaro(&path("recipe.json"));
    let render = |out: &str, edits: Option<&str>| -> Output {
        let (out, size) = (path(out), format!("{WIDTH}x{HEIGHT}"));
        let fixed = [SCRIPT, scene.to_str().unwrap(), out.to_str().unwrap()];
        let edits = edits.map(path);
        let edits = edits.iter().flat_map(|edits| ["--edits", edits.to_str().unwrap()]).collect::<Vec<_>>();
        python(&[&fixed[..], &edits, &["--size", &size, "--samples", "4", "--rays", "64"]].concat())
    };
    python::said(render("other_plain.exr", None));
    python::said(render("other_edited.exr", Some("stage.edits")));
    let [plain, edited, other_plain, other_edited] =
        ["plain.exr", "edited.exr", "other_plain.exr", "other_edited.exr"].map(|name| blocks(&path(name)));
    let differs = |(a, b): (&[f64; 3], &[f64; 3])| {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>() > 0.1 * b.iter().sum::<f64>()
    };
    let region: Vec<bool> = edited.iter().zip(&plain).map(differs).collect();
    let share = region.iter().filter(|there| **there).count() as f64 / region.len() as f64;
    let all = vec![true; region.len()];
    for (name, a, b) in [("unedited", &other_plain, &plain), ("edited", &other_edited, &edited)] {
        let [everywhere, there] = [&all, &region].map(|chosen| apart(a, b, chosen));
        println!("{name}: {:.2} %, in the edited region {:.2} %", 100.0 * everywhere, 100.0 * there);
        assert!(everywhere <= 0.05 && there <= 0.05, "{name}: {everywhere}, in the edited region {there}");
    }
    // The measure can fail: the edits are seen, by both.
    let seen = [apart(&plain, &edited, &region), apart(&other_plain, &edited, &region)];
    println!("the edited region is {:.0} % of the picture; without edits it is {seen:.2?} off", 100.0 * share);
    assert!((0.05..0.9).contains(&share) && seen.iter().all(|seen| *seen > 0.2), "{share}, {seen:?}");

    // Edits of another scene, damaged ones, and what is no scene at all.
    let mut moved = std::fs::read(&scene).unwrap();
    let place = b"\"translation\":[-0.8";
    let at = moved.windows(place.len()).position(|bytes| bytes == place).expect("the box, to the left");
    moved[at + place.len() - 1] = b'7';
    std::fs::write(path("moved.glb"), moved).unwrap();
    let refuse = |scene: &Path, edits: &str, expected: &str| {
        let out = path("refused.exr");
        let edits = path(edits);
        let arguments =
            [SCRIPT, scene.to_str().unwrap(), out.to_str().unwrap(), "--edits", edits.to_str().unwrap()];
        let output = python(&arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains(expected) && !said.contains("Traceback"), "{said}");
        assert!(!out.exists());
    };
    refuse(&path("moved.glb"), "stage.edits", "edits for another scene");
    let mut bytes = std::fs::read(path("stage.edits")).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(path("damaged.edits"), &bytes).unwrap();
    refuse(&scene, "damaged.edits", "damaged");
    refuse(&scene, "missing.edits", "missing.edits");
    refuse(&path("stage.edits"), "stage.edits", "not a binary glTF");
    // Nothing is left of what was begun.
    assert!(folder::files(folder.path()).keys().all(|name| !name.contains(".part")));
}
