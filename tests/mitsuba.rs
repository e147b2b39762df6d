//! Edits in another renderer: contrib/mitsuba reads the file of sampled edits, applies it in a final gather of its own, and
//! gets the picture that chiaro renders.
//!
//! Needs Python with `mitsuba`, `numpy` and `scipy` (PyPI), as `python3` or in `$CHIARO_PYTHON`, and the project's test data;
//! says what it skips without them.

#[path = "support/folder.rs"]
mod folder;
#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/glb.rs"]
mod glb;
#[path = "support/python.rs"]
mod python;
mod support;

use chiaro::image::exr_read;
use glb::Glb;
use serde_json::{Value as Json, json};
use std::path::Path;
use std::process::{Command, Output};

const MODULES: [&str; 3] = ["mitsuba", "numpy", "scipy"];
const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/contrib/mitsuba/render.py");
/// Pixels along a side of what is compared: noise of the other renderer is not what this is about.
const BLOCK: usize = 6;

/// A scene, edits of it (the last of them is `edits`), and the size of pictures.
struct Case<'a> {
    scene: &'a Path,
    edits: Json,
    size: [usize; 2],
}

impl Case<'_> {
    /// Pictures with the edits and without, and their file. Edits are sampled at another resolution than that of the pictures
    /// (thesis figure 5.4).
    fn recipe(&self) -> Json {
        let [width, height] = self.size;
        let size = json!({ "width": width, "height": height, "samples_per_pixel": 16, "tolerance": 0.02 });
        let mut recipe = json!({ "chiaro": 1, "nodes": {
            "stage": { "type": "scene", "params": { "file": self.scene } },
            "view": { "type": "view_samples", "params": { "width": 320, "height": 240 }, "inputs": { "scene": "stage" } },
            "transport": { "type": "transfer", "params": { "gather_samples": 16384 },
                           "inputs": { "scene": "stage", "samples": "view" } },
            "sampled": { "type": "scale_offset",
                         "inputs": { "scene": "stage", "transfer": "transport", "edits": "edits" } },
            "kept": { "type": "write_edits", "params": { "file": "kept.edits" }, "inputs": { "edits": "sampled" } },
            "plain": { "type": "final_gather", "params": size, "inputs": { "scene": "stage" } },
            "edited": { "type": "final_gather", "params": size, "inputs": { "scene": "stage", "edits": "sampled" } },
            "out": { "type": "write_image", "params": { "file": "plain.exr", "depth": "float" },
                     "inputs": { "image": "plain" } },
            "out_edited": { "type": "write_image", "params": { "file": "edited.exr", "depth": "float" },
                            "inputs": { "image": "edited" } },
        }});
        let nodes = self.edits.as_object().expect("nodes by name").clone();
        recipe["nodes"].as_object_mut().expect("nodes by name").extend(nodes);
        recipe
    }

    /// Means of the indirect light over blocks of pixels, RGB.
    fn blocks(&self, file: &Path) -> Vec<[f64; 3]> {
        let image = exr_read::read_layers(file, &["indirect"]).unwrap();
        let layer = image.find("indirect").unwrap();
        let [width, height] = self.size;
        assert_eq!(layer.data.len(), 3 * width * height, "{}", file.display());
        let mut means = vec![[0.0; 3]; (width / BLOCK) * (height / BLOCK)];
        for (pixel, light) in layer.data.chunks_exact(3).enumerate() {
            let block = pixel / width / BLOCK * (width / BLOCK) + pixel % width / BLOCK;
            for (mean, light) in means[block].iter_mut().zip(light) {
                *mean += f64::from(*light) / (BLOCK * BLOCK) as f64;
            }
        }
        means
    }

    /// Renders pictures by both programs into a folder, and holds them against each other.
    fn check(&self, python: &impl Fn(&[&str]) -> Output, folder: &Path) {
        let path = |name: &str| folder.join(name);
        std::fs::write(path("recipe.json"), self.recipe().to_string()).unwrap();
        chiaro(&path("recipe.json"));
        let size = format!("{}x{}", self.size[0], self.size[1]);
        let (edits, scene) = (path("kept.edits"), self.scene.to_str().unwrap());
        let render = |out: &Path, edits: &[&str]| {
            let fixed = [SCRIPT, scene, out.to_str().unwrap(), "--size", &size, "--samples", "4", "--rays", "64"];
            python::said(python(&[&fixed[..], edits].concat()));
        };
        render(&path("other_plain.exr"), &[]);
        render(&path("other_edited.exr"), &["--edits", edits.to_str().unwrap()]);
        let [plain, edited, other_plain, other_edited] =
            ["plain.exr", "edited.exr", "other_plain.exr", "other_edited.exr"].map(|name| self.blocks(&path(name)));
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
    }
}

fn pick(objects: &[&str], materials: &[&str]) -> Json {
    json!({ "type": "pick", "params": { "materials": materials, "objects": objects }, "inputs": { "scene": "stage" } })
}

fn chiaro(recipe: &Path) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("chiaro"));
    let arguments = ["render", recipe.to_str().unwrap(), "--no-cache", "--device", "cpu"];
    python::said(command.env("CHIARO_LOG", "error").args(arguments).output().unwrap());
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

/// Edits of every part of a file: scale rows, offset rows (a weakened shadow), a source, and the eye.
#[test]
fn another_renderer_applies_the_edits_and_gets_the_same_picture() {
    let test = "another_renderer_applies_the_edits_and_gets_the_same_picture";
    let Some(scene) = support::all_data(test, &["scenes/stage.glb"]).pop() else { return };
    let Some(python) = python::with(test, &MODULES) else { return };
    let edits = json!({
        "red": pick(&[], &["red"]), "blue": pick(&[], &["blue"]), "box": pick(&["box"], &[]), "floor": pick(&["floor"], &[]),
        "bleed": { "type": "caster_receiver", "params": { "brightness": 3.0, "hue": 40.0 },
                   "inputs": { "caster": "red", "receiver": "box" } },
        "open": { "type": "indirect_shadow", "params": { "amount": 0.7 },
                  "inputs": { "caster": "box", "receiver": "floor", "edits": "bleed" } },
        "glow": { "type": "source_brush", "params": { "scale": 0.3 }, "inputs": { "selection": "blue", "edits": "open" } },
        "edits": { "type": "illumination_brush", "params": { "scale": 1.6 },
                   "inputs": { "selection": "floor", "edits": "glow" } },
    });
    let folder = tempfile::tempdir().unwrap();
    Case { scene: &scene, edits, size: [120, 90] }.check(&python, folder.path());
}

/// A floor before a wall, with a hard-edged lamp and no texture.
fn small_room() -> Glb {
    Glb::room()
        .set("/extensions/KHR_lights_punctual/lights/0/spot", json!({ "innerConeAngle": 1.0, "outerConeAngle": 1.0 }))
        .without("/materials/0/pbrMetallicRoughness/baseColorTexture")
}

/// The same without data of others; and what is refused: edits of another scene, damaged ones, what is no scene at all.
#[test]
fn a_room_of_our_own_agrees_and_what_does_not_fit_is_refused() {
    let Some(python) = python::with("a_room_of_our_own_agrees_and_what_does_not_fit_is_refused", &MODULES) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let scene = path("room.glb");
    std::fs::write(&scene, small_room().bytes()).unwrap();
    let edits = json!({
        "wall": pick(&["wall"], &[]), "floor": pick(&["floor"], &[]),
        "near": { "type": "falloff", "params": { "exponent": 1.5 }, "inputs": { "caster": "wall", "receiver": "floor" } },
        "edits": { "type": "caster_receiver", "params": { "brightness": 2.0 },
                   "inputs": { "caster": "floor", "receiver": "wall", "edits": "near" } },
    });
    Case { scene: &scene, edits, size: [60, 48] }.check(&python, folder.path());

    let refuse = |scene: &str, edits: &str, expected: &str| {
        let [scene, edits, out] = [scene, edits, "refused.exr"].map(path);
        let [scene, edits, file] = [&scene, &edits, &out].map(|path| path.to_str().unwrap());
        let output = python(&[SCRIPT, scene, file, "--edits", edits]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains(expected) && !said.contains("Traceback"), "{said}");
        assert!(!out.exists());
    };
    let change = |name: &str, glb: Glb| std::fs::write(path(name), glb.bytes()).unwrap();
    change("moved.glb", small_room().set("/nodes/1/translation", json!([0, 2.1, -2])));
    refuse("moved.glb", "kept.edits", "beside its triangles");
    change("less.glb", small_room().without("/nodes/1/mesh"));
    refuse("less.glb", "kept.edits", "edits for a scene of 4 triangles, this one has 2");
    change("textured.glb", Glb::room());
    refuse("textured.glb", "kept.edits", "material grey has a texture");
    let mut bytes = std::fs::read(path("kept.edits")).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(path("damaged.edits"), &bytes).unwrap();
    refuse("room.glb", "damaged.edits", "damaged");
    refuse("room.glb", "missing.edits", "missing.edits");
    refuse("kept.edits", "kept.edits", "not a binary glTF");
    // Nothing is left of what was begun.
    assert!(folder::files(folder.path()).keys().all(|name| !name.contains(".part")));
}
