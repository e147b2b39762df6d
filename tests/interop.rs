//! Proof with other people's programs: OpenEXR, OpenImageIO, OpenColorIO and Blender read what chiaro writes, and chiaro
//! reads what they write, value by value.
//!
//! Needs Python with packages from PyPI (see tests/interop/exchange.py), as `python3` or in `$CHIARO_PYTHON`; says which
//! tests it skips without them.

#[allow(dead_code)]
#[path = "support/node.rs"]
mod node;
#[path = "support/python.rs"]
mod python;
mod support;

use chiaro::image::cryptomatte::{Cryptomatte, rank};
use chiaro::image::view_transform::{Source, Wish};
use chiaro::image::{ColourSpace, Content, Image, Layer, exr_read};
use chiaro::scene::LightKind;
use chiaro::value::Value;
use node::{At, image, run_at};
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const RGB: [&str; 3] = ["R", "G", "B"];

/// The script, for those who have all of `modules`.
fn script(test: &str, modules: &[&str]) -> Option<impl Fn(&[&str])> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/interop/exchange.py");
    let run = python::with(test, modules)?;
    Some(move |arguments: &[&str]| drop(python::said(run(&[&[script], arguments].concat()))))
}

/// A channel as another program reads it.
struct Channel {
    kind: String,
    /// Left, top, width, height.
    window: [i64; 4],
    values: Vec<f32>,
}

struct Read {
    display: [i64; 4],
    channels: BTreeMap<(i64, String), Channel>,
    attributes: BTreeMap<String, String>,
}

fn dumped(folder: &Path) -> Read {
    let index: Json = serde_json::from_slice(&std::fs::read(folder.join("index.json")).unwrap()).unwrap();
    let four = |value: &Json| std::array::from_fn(|i| value[i].as_i64().unwrap());
    let channel = |entry: &Json| {
        let bytes = std::fs::read(folder.join(entry["file"].as_str().unwrap())).unwrap();
        let values = bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        let kind = entry["type"].as_str().unwrap().to_owned();
        let name = (entry["part"].as_i64().unwrap(), entry["name"].as_str().unwrap().to_owned());
        (name, Channel { kind, window: four(&entry["window"]), values })
    };
    let attributes = index["attributes"].as_object().unwrap();
    Read {
        display: four(&index["display"]),
        channels: index["channels"].as_array().unwrap().iter().map(channel).collect(),
        attributes: attributes.iter().map(|(name, text)| (name.clone(), text.as_str().unwrap().to_owned())).collect(),
    }
}

/// A channel's values over the display window, 0 where it has none.
fn placed(channel: &Channel, display: [i64; 4]) -> Vec<f32> {
    let [left, top, width, _] = channel.window;
    let at = |i: i64| {
        let (x, y) = (display[0] + i % display[2] - left, display[1] + i / display[2] - top);
        let inside = (0..width).contains(&x) && (0..channel.values.len() as i64 / width).contains(&y);
        if inside { channel.values[(y * width + x) as usize] } else { 0.0 }
    };
    (0..display[2] * display[3]).map(at).collect()
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Values of one channel of a layer.
fn values(layer: &Layer, channel: usize) -> Vec<f32> {
    layer.data.iter().skip(channel).step_by(layer.channels.len()).copied().collect()
}

/// A picture with all that is written: colour, data, ids, a ratio, odd numbers, text beyond Latin-1.
fn picture(width: usize, height: usize) -> Image {
    let mut state = 1u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let mut layer = |name: &str, channels: &[&str], content: Content| {
        let mut data: Vec<f32> = (0..width * height * channels.len()).map(|_| 4.0 * random() - 1.0).collect();
        data[..5].copy_from_slice(&[0.0, -0.0, 65504.0, 6.1e-5, 1e-7]);
        Layer::new(name, channels, content, data)
    };
    let mut layers = vec![
        layer("ViewLayer.Combined", &["R", "G", "B", "A"], Content::Colour),
        layer("ViewLayer.Diffuse Direct", &RGB, Content::Colour),
        layer("Z", &["Z"], Content::Data),
        layer("P", &["X", "Y", "Z"], Content::Data),
        layer("ratio_head", &RGB, Content::Data),
    ];
    let names = ["torus", "Kugel ü", "箱"].map(str::to_owned);
    let shown: Vec<u32> = (0..width * height * 4).map(|i| (i as u32 * 7 / 5) % 5).collect();
    let ranked = rank("ViewLayer.CryptoObject", &names, &shown, 4, 4);
    layers.extend(ranked.layers);
    let note = ("note".to_owned(), "Schatten über Türen, 影".to_owned());
    let metadata = ranked.metadata.into_iter().chain([note]).collect();
    Image { width, height, layers, colour_space: ColourSpace::AcesCg, metadata }
}

#[test]
fn what_is_written_is_what_others_read() {
    let Some(python) = script("what_is_written_is_what_others_read", &["OpenEXR", "OpenImageIO", "numpy"]) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let original = picture(37, 29);
    let plain = original.with_plain_names();
    let mut compared = 0;
    for (number, (depth, compression)) in
        [("half", "zip"), ("float", "zip"), ("half", "piz"), ("float", "none"), ("half", "rle"), ("float", "zips")]
            .into_iter()
            .enumerate()
    {
        let name = format!("{number}.exr");
        let params = json!({
            "file": name, "depth": depth, "compression": compression, "layer_depth": { "ratio_*": "half" },
        });
        let at = At { base: folder.path(), out: None, frame: 1.0 };
        run_at("write_image", params, &[("image", image(&original))], at).unwrap();
        let path = folder.path().join(&name);
        for library in ["OpenEXR", "OpenImageIO"] {
            let out = folder.path().join(format!("{number}_{library}"));
            python(&["read", library, path.to_str().unwrap(), out.to_str().unwrap()]);
            let found = dumped(&out);
            assert_eq!((found.display, found.attributes["parts"].as_str()), ([0, 0, 37, 29], "1"), "{library}");
            let mut expected = BTreeMap::new();
            for layer in &plain.layers {
                for (i, channel) in layer.channels.iter().enumerate() {
                    let full = match layer.name.as_str() {
                        "" | "Z" => channel.clone(),
                        name => format!("{name}.{channel}"),
                    };
                    let half = (layer.content == Content::Colour && depth == "half") || layer.name == "ratio_head";
                    let rounded = |value: f32| if half { exr::prelude::f16::from_f32(value).to_f32() } else { value };
                    let data: Vec<f32> = values(layer, i).into_iter().map(rounded).collect();
                    expected.insert((0, full), (if half { "half" } else { "float" }, data));
                }
            }
            assert_eq!(found.channels.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>(), "{library}");
            for (channel, (kind, data)) in &expected {
                let other = &found.channels[channel];
                assert_eq!((other.kind.as_str(), other.window), (*kind, [0, 0, 37, 29]), "{library} {channel:?}");
                assert!(bits(&other.values) == bits(data), "{library} reads other values of {channel:?} in {name}");
                compared += 1;
            }
            for (name, text) in &plain.metadata {
                assert_eq!(found.attributes.get(name), Some(text), "{library}: {name}");
            }
            assert_eq!(found.attributes["chiaro:recipe"], "{ \"chiaro\": 1 }");
            if library == "OpenEXR" {
                assert_eq!(found.attributes["colorInteropID"], "lin_ap1_scene");
                let primaries: Vec<f32> = serde_json::from_str(&found.attributes["chromaticities"]).unwrap();
                assert!((primaries[0] - 0.713).abs() < 1e-6 && (primaries[7] - 0.33767).abs() < 1e-6, "{primaries:?}");
            }
        }
    }
    assert!(compared > 200, "{compared}");
}

/// What of a file another program reads otherwise: the size, or the first channel that has no partner with the same bits.
fn difference(ours: &Image, theirs: &Read) -> Option<String> {
    let size = [ours.width as i64, ours.height as i64];
    if size != theirs.display[2..] {
        return Some(format!("size {size:?}, {:?}", theirs.display));
    }
    let each = |layer: &Layer| -> Vec<(String, Vec<u32>)> {
        let names = layer.channels.iter().enumerate();
        names.map(|(i, name)| (name.to_lowercase(), bits(&values(layer, i)))).collect()
    };
    let mut channels: Vec<(String, Vec<u32>)> = ours.layers.iter().flat_map(each).collect();
    for ((part, name), channel) in &theirs.channels {
        let wanted = bits(&placed(channel, theirs.display));
        // Names are grouped and spelled anew; the first letter of a channel, and its values, stay.
        let first = name.rsplit('.').next().and_then(|own| own.to_lowercase().chars().next()).unwrap();
        let Some(at) = channels.iter().position(|(own, bits)| own.starts_with(first) && *bits == wanted) else {
            return Some(format!("{name} of part {part}"));
        };
        channels.remove(at);
    }
    (!channels.is_empty()).then(|| format!("{} channels more", channels.len()))
}

/// Reads a file with OpenEXR and with chiaro: the same bits. Returns how many channels.
fn same(python: &dyn Fn(&[&str]), path: &Path, folder: &Path) -> usize {
    let out = folder.join(format!("{}_dump", path.file_stem().unwrap().to_str().unwrap()));
    python(&["read", "OpenEXR", path.to_str().unwrap(), out.to_str().unwrap()]);
    let theirs = dumped(&out);
    let ours = exr_read::read(path).unwrap();
    assert_eq!(difference(&ours, &theirs), None, "{}", path.display());
    // The smallest change of one value must show, in any channel.
    for at in 0..ours.layers.len() {
        let mut bad = ours.clone();
        let mut data = bad.layers[at].data.to_vec();
        let middle = data.len() / 2;
        data[middle] = f32::from_bits(data[middle].to_bits() ^ 1);
        bad.layers[at] = bad.layers[at].with_data(data);
        assert!(difference(&bad, &theirs).is_some(), "{}: a change of layer {at} is not seen", path.display());
    }
    theirs.channels.len()
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "exr"));
    files.sort();
    files
}

#[test]
fn files_of_openexr_are_read_bit_by_bit() {
    let Some(python) = script("files_of_openexr_are_read_bit_by_bit", &["OpenEXR", "numpy"]) else { return };
    let folder = tempfile::tempdir().unwrap();
    python(&["write", folder.path().to_str().unwrap()]);
    let files = files(folder.path());
    let channels: usize = files.iter().map(|path| same(&python, path, folder.path())).sum();
    println!("{} files, {channels} channels", files.len());
    assert!(files.len() >= 20 && channels > 100);
    let crop = exr_read::read(&folder.path().join("crop.exr")).unwrap();
    assert!(crop.metadata.contains(&("comments".into(), "cut out".into())), "{:?}", crop.metadata);
    for name in ["karma.exr", "nuke.exr", "arnold.exr"] {
        assert!(exr_read::read(&folder.path().join(name)).unwrap().find("beauty").is_ok(), "{name}");
    }
    let layers = |name: &str| -> Vec<String> {
        let image = exr_read::read(&folder.path().join(name)).unwrap();
        image.layers.into_iter().map(|layer| format!("{}:{}", layer.name, layer.channels.join(""))).collect()
    };
    assert_eq!(layers("nuke.exr"), [":RGBA", "depth:Z", "indirect:RGB"]);
    assert_eq!(layers("karma.exr"), ["C:RGB", "C_key:RGB"]);
    assert_eq!(layers("parts.exr"), [":RGBA", "depth:Z", "indirect:RGB"]);
}

#[test]
fn files_of_blender_are_read_bit_by_bit() {
    let Some(python) = script("files_of_blender_are_read_bit_by_bit", &["OpenEXR", "bpy", "numpy"]) else { return };
    let folder = tempfile::tempdir().unwrap();
    python(&["render", folder.path().to_str().unwrap()]);
    let mut all = files(folder.path());
    assert_eq!(all.len(), 3);
    // The plates of the project's data, too, where they are.
    let data = std::env::var_os("CHIARO_DATA").map(PathBuf::from);
    let data = data.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"));
    for plate in ["stage/full.exr", "plaza-night/full.exr"] {
        all.extend(Some(data.join("plates").join(plate)).filter(|path| path.exists()));
    }
    for path in all {
        let channels = same(&python, &path, folder.path());
        println!("{}: {channels} channels", path.display());
        assert!(channels > 3);
    }
    let image = exr_read::read(&folder.path().join("half.exr")).unwrap();
    let matte = Cryptomatte::of(&image, "CryptoObject").unwrap();
    let cube = matte.covered(&["cu*".to_owned()]).unwrap();
    assert!(cube.contains(&1.0) && cube.iter().any(|covered| (0.01..0.99).contains(covered)));
}

/// Blender's Cryptomatte node keys out of our file what we say is covered.
#[test]
fn blender_keys_objects_out_of_our_files() {
    let Some(python) = script("blender_keys_objects_out_of_our_files", &["OpenEXR", "bpy", "numpy"]) else { return };
    let folder = tempfile::tempdir().unwrap();
    let recipe = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/edits/cryptomatte.json");
    let output = folder.path().to_str().unwrap();
    let mut render = assert_cmd::Command::cargo_bin("chiaro").unwrap();
    render.arg("render").arg(recipe).args(["--out", output, "--no-cache", "--device", "cpu"]).assert().success();
    let path = folder.path().join("cryptomatte.exr");
    let matte = Cryptomatte::read(&path, "CryptoObject").unwrap();
    for name in ["block", "ball", "floor"] {
        let key = folder.path().join(format!("{name}.exr"));
        python(&["key", path.to_str().unwrap(), name, "64", "48", key.to_str().unwrap()]);
        let keyed = exr_read::read(&key).unwrap();
        let expected = matte.covered(&[name.to_owned()]).unwrap();
        let found = values(&keyed.layers[0], 0);
        let most = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let soft = expected.iter().filter(|covered| (0.01..0.99).contains(*covered)).count();
        println!("{name}: {soft} soft pixels, at most {most:e} apart");
        assert!(soft > 20 && most < 1e-6, "{name}: {most}");
    }
}

/// Skinned, turned and moved things are where Blender has them, at every frame asked.
#[test]
fn blender_poses_files_as_we_do() {
    let test = "blender_poses_files_as_we_do";
    let Some(python) = script(test, &["bpy"]) else { return };
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        ("scenes/fox.glb", "Run", [0, 5, 13, 40]),
        ("scenes/fox.glb", "Survey", [1, 20, 50, 77]),
        ("scenes/stage-anim.glb", "", [1, 8, 17, 24]),
    ];
    let mut moved = 0.0f32;
    for (file, clip, frames) in cases {
        let [path] = &support::all_data(test, &[file])[..] else { return };
        let out = folder.path().join("poses.json");
        let frames_text = frames.map(|frame| frame.to_string());
        let arguments = [
            &["pose", path.to_str().unwrap(), clip, out.to_str().unwrap()][..],
            &frames_text.each_ref().map(String::as_str),
        ]
        .concat();
        python(&arguments);
        let blender: Json = serde_json::from_slice(&std::fs::read(&out).unwrap()).unwrap();
        let mut first: Option<Vec<[f32; 3]>> = None;
        for frame in frames {
            let params = json!({ "file": path, "animations": if clip.is_empty() { json!([]) } else { json!([clip]) } });
            let at = At { base: folder.path(), out: None, frame: frame as f64 };
            let Value::Scene(scene) = run_at("scene", params, &[], at).unwrap().values.swap_remove(0) else {
                panic!("a scene")
            };
            let mut places: BTreeMap<&str, Vec<[f32; 3]>> = BTreeMap::new();
            for (corners, object) in scene.geometry.corners.iter().zip(&scene.geometry.object[..]) {
                places.entry(&scene.geometry.objects[*object as usize]).or_default().extend(corners);
            }
            for light in &scene.lights[..] {
                let (LightKind::Spot { position, .. } | LightKind::Point { position }) = light.kind else { continue };
                places.insert(&light.name, vec![position.to_array()]);
            }
            places.extend(scene.cameras.iter().map(|camera| (camera.name.as_str(), vec![camera.position.to_array()])));
            let size = scene.geometry.bounds().1.distance(scene.geometry.bounds().0);
            let theirs = blender[frame.to_string()].as_object().unwrap();
            let mut most = 0.0f32;
            for (name, ours) in &places {
                let points = theirs[*name].as_array().unwrap().iter();
                let points: Vec<[f32; 3]> = points.map(|p| [0, 1, 2].map(|i| p[i].as_f64().unwrap() as f32)).collect();
                // Vertices that triangles share come in another order: then boxes have to do.
                let bounds = |points: &[[f32; 3]]| {
                    let points = || points.iter().map(|p| glam::Vec3::from(*p));
                    vec![
                        points().reduce(glam::Vec3::min).unwrap().to_array(),
                        points().reduce(glam::Vec3::max).unwrap().to_array(),
                    ]
                };
                let (ours, theirs) =
                    if ours.len() == points.len() { (ours.clone(), points) } else { (bounds(ours), bounds(&points)) };
                most =
                    ours.iter().flatten().zip(theirs.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(most, f32::max);
            }
            println!(
                "{file} {clip}, frame {frame}: {} things, at most {:.1e} of the scene's size apart",
                places.len(),
                most / size
            );
            assert!(places.len() == 1 || places.len() == 13, "{places:?}");
            assert!(most < 2e-5 * size, "{file}, frame {frame}: {most}");
            let all: Vec<[f32; 3]> = places.into_values().flatten().collect();
            let then = first.get_or_insert_with(|| all.clone());
            moved = all
                .iter()
                .flatten()
                .zip(then.iter().flatten())
                .map(|(a, b)| (a - b).abs() / size)
                .fold(moved, f32::max);
        }
    }
    assert!(moved > 0.05, "nothing moves: nothing was tried");
}

#[test]
fn a_plain_multiply_in_another_program_gives_our_picture() {
    let test = "a_plain_multiply_in_another_program_gives_our_picture";
    let Some(python) = script(test, &["OpenImageIO", "numpy"]) else { return };
    let folder = tempfile::tempdir().unwrap();
    let recipe = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/edits/ratio_to_plate.json");
    let text = std::fs::read_to_string(recipe).unwrap();
    let mut recipe: Json = serde_json::from_str(&text).unwrap();
    // The plate as it was, with the ratio beside it; and the plate as it becomes.
    recipe["nodes"]["layers"]["inputs"]["image"] = json!("plate");
    recipe["nodes"]["new"] = json!({
        "type": "write_image", "params": { "file": "new.exr", "depth": "float" }, "inputs": { "image": "changed" },
    });
    let path = folder.path().join("recipe.json");
    std::fs::write(&path, recipe.to_string()).unwrap();
    let mut render = assert_cmd::Command::cargo_bin("chiaro").unwrap();
    render.arg("render").arg(&path).args(["--no-cache", "--device", "cpu"]).assert().success();
    let (plate, out) = (folder.path().join("ratio_to_plate.exr"), folder.path().join("product"));
    python(&["multiply", plate.to_str().unwrap(), "", "ratio_bleed", out.to_str().unwrap()]);
    let product = dumped(&out);
    let new = exr_read::read(&folder.path().join("new.exr")).unwrap();
    let beauty = new.layer("").unwrap();
    let old = exr_read::read(&plate).unwrap();
    assert!(bits(&old.layer("").unwrap().data) != bits(&beauty.data), "the picture changes");
    for (i, channel) in RGB.iter().enumerate() {
        let found = &product.channels[&(0, (*channel).to_owned())].values;
        let off =
            found.iter().zip(values(beauty, i)).map(|(a, b)| (a - b).abs() / b.abs().max(1e-3)).fold(0.0, f32::max);
        assert!(off < 1e-6, "{channel}: {off:e}");
    }
}

/// The library that views go through against the one that it is a port of.
#[test]
fn views_are_those_of_opencolorio() {
    let Some(python) = script("views_are_those_of_opencolorio", &["PyOpenColorIO", "numpy"]) else { return };
    let folder = tempfile::tempdir().unwrap();
    let aces = ColourSpace::Rec709.to(ColourSpace::Aces);
    let colours: Vec<[f32; 4]> = (0..4096u32)
        .map(|i| {
            let stops = [i % 16, i / 16 % 16, i / 256].map(|k| 0.18 * (k as f32 - 9.0).exp2());
            [stops[0], stops[1], stops[2], 1.0]
        })
        .collect();
    let raw: Vec<u8> = colours
        .iter()
        .flat_map(|c| (aces * glam::Vec3::new(c[0], c[1], c[2])).to_array())
        .flat_map(f32::to_le_bytes)
        .collect();
    let [input, output] = ["in.f32", "out.f32"].map(|name| folder.path().join(name));
    std::fs::write(&input, raw).unwrap();
    for (display, view) in [
        ("sRGB - Display", "ACES 2.0 - SDR 100 nits (Rec.709)"),
        ("Display P3 - Display", "ACES 2.0 - SDR 100 nits (P3 D65)"),
        ("Rec.2100-PQ - Display", "ACES 2.0 - HDR 1000 nits (P3 D65)"),
        ("sRGB - Display", "Un-tone-mapped"),
    ] {
        python(&["view", input.to_str().unwrap(), display, view, output.to_str().unwrap()]);
        let bytes = std::fs::read(&output).unwrap();
        let theirs: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        let wish =
            Wish { source: Source::BuiltIn, display: display.to_owned(), view: view.to_owned(), input: String::new() };
        let mut ours = colours.clone();
        wish.transform(ColourSpace::Rec709).unwrap().apply(&mut ours, 1.0);
        let pairs = ours.iter().flat_map(|pixel| pixel[..3].to_vec()).zip(theirs);
        let most = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        println!("{display}, {view}: at most {most:e} apart");
        assert!(most < 2e-4, "{display}, {view}: {most}");
    }
}
