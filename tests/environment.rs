//! Environment maps on a cube, from real files and hand-made ones, and lamps found in them.

mod support;

use chiaro::Error;
use chiaro::device::Device;
use chiaro::eval::keys::tasks;
use chiaro::eval::{Context, Evaluator, NodeReport, Options, files::FileHashes};
use chiaro::graph::{Document, Plan};
use chiaro::image::exr_write::{self, Depth};
use chiaro::image::{Content, Image, Layer, load};
use chiaro::node::NoMemo;
use chiaro::nodes;
use chiaro::scene::{Environment, LatLong, cube};
use chiaro::transport::shadow::Lamp;
use chiaro::transport::shadow::localize::{Settings, localize};
use chiaro::value::Value;
use serde_json::{Value as Json, json};
use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const MAPS: [&str; 5] = [
    "environments/noon_grass_1k.hdr",
    "environments/noon_grass_1k_f32.exr",
    "environments/rooitou_park_1k.hdr",
    "environments/st_peters_square_night_1k.hdr",
    "environments/studio_small_03_1k.hdr",
];

fn plan(folder: &Path, params: Json) -> Plan {
    let nodes = json!({ "sky": { "type": "environment", "params": params } });
    let text = json!({ "chiaro": 1, "nodes": nodes }).to_string();
    let document = Document::parse(&folder.join("test.json"), &text).unwrap_or_else(|error| panic!("{error}"));
    Plan::new(&document, nodes::ALL).unwrap_or_else(|error| panic!("{error}"))
}

/// What an `environment` node gives at a frame, and what it reports.
fn at_frame(folder: &Path, params: Json, frame: i64) -> Result<(Arc<Environment>, NodeReport), Error> {
    let (plan, never, mut report) = (plan(folder, params), AtomicBool::new(false), Vec::new());
    let context = Context { cancel: &never, ..Context::SILENT };
    let evaluator = Evaluator::new(Options::new(Device::Cpu));
    let mut values = evaluator.evaluate(&plan, &[plan.find("sky").unwrap()], frame, &context, &mut report)?;
    let Value::Environment(environment) = values.swap_remove(0).swap_remove(0) else { panic!("an environment") };
    Ok((environment, report.swap_remove(0)))
}

fn run(folder: &Path, params: Json) -> Result<(Arc<Environment>, NodeReport), Error> {
    at_frame(folder, params, 1)
}

fn map(image: &Image) -> LatLong {
    let layer = image.layer("").unwrap();
    let pixels = layer.data.chunks(layer.channels.len()).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
    LatLong::new(image.width, image.height, pixels.collect()).unwrap()
}

/// Radiance times solid angle of a picture, pixel by pixel.
fn energy_of(image: &Image) -> [f64; 3] {
    let layer = image.layer("").unwrap();
    let (stride, mut sum) = (layer.channels.len(), [0.0; 3]);
    for (i, pixel) in layer.data.chunks(stride).enumerate() {
        let edge = |row: usize| (PI * row as f64 / image.height as f64).cos();
        let row = i / image.width;
        let solid_angle = (edge(row) - edge(row + 1)) * TAU / image.width as f64;
        (0..3).for_each(|c| sum[c] += f64::from(pixel[c]) * solid_angle);
    }
    sum
}

fn whole(environment: &Environment) -> [f64; 3] {
    environment.energy(0..environment.radiance.len())
}

fn close(a: [f64; 3], b: [f64; 3], relative: f64, what: &str) {
    assert!((0..3).all(|c| (a[c] - b[c]).abs() <= relative * b[c]), "{what}: {a:?}, expected {b:?}");
}

/// The promise is 1e-4.
#[test]
fn energy_is_that_of_the_map() {
    for path in support::all_data("energy_is_that_of_the_map", &MAPS) {
        let image = load::load(&path, None).unwrap();
        let (map, expected) = (map(&image), energy_of(&image));
        close(map.energy(), expected, 1e-12, "the map");
        for size in [32, 64, 128, 256, 512] {
            for rotation in [0.0f64, 37.0, -123.4] {
                let cube = map.cube(size, rotation.to_radians(), 1.0).unwrap();
                close(whole(&cube), expected, 1e-6, &format!("{}, {size}, {rotation}", path.display()));
            }
        }
        let params = json!({ "file": path, "face_size": 64, "rotation": 10.0, "exposure": 1.5 });
        let (cube, report) = run(Path::new(""), params).unwrap();
        close(whole(&cube).map(|x| x / 1.5f64.exp2()), expected, 1e-6, "by the node");
        assert_eq!(report.notes["map"], json!([1024, 512]));
        assert_eq!(report.notes["energy"][1], json!(whole(&cube)[1]));
        assert_eq!(report.notes["lit_faces"].as_array().unwrap().len(), 6);
    }
}

/// Peaks above 65504 stay what they are where a texel lies within the pixel.
#[test]
fn what_half_does_not_hold_survives() {
    for path in support::all_data("what_half_does_not_hold_survives", &MAPS[2..3]) {
        let image = load::load(&path, None).unwrap();
        let peak = image.layer("").unwrap().data.iter().copied().fold(0.0, f32::max);
        let cube = map(&image).cube(512, 0.0, 1.0).unwrap();
        let found = cube.radiance.iter().flat_map(|texel| texel[..3].to_vec()).fold(0.0, f32::max);
        assert!(peak > 65504.0 && found > 65504.0 && found <= peak * 1.000_001, "{found} of {peak}");
    }
    let folder = tempfile::tempdir().unwrap();
    let bright = Image {
        width: 8,
        height: 4,
        layers: vec![Layer::new("", &["R", "G", "B"], Content::Colour, [70_000.0, 1e9, 1e-9].repeat(32))],
        ..Image::default()
    };
    exr_write::write(&folder.path().join("bright.exr"), &bright, Depth::Float, &[]).unwrap();
    let (cube, _) = run(folder.path(), json!({ "file": "bright.exr", "face_size": 32 })).unwrap();
    for texel in &cube.radiance {
        assert!((0..3).all(|c| (texel[c] / [70_000.0, 1e9, 1e-9][c] - 1.0).abs() < 1e-6), "{texel:?}");
    }
}

#[test]
fn a_constant_map_stays_constant() {
    // Pixels larger and smaller than texels, and of no size in common.
    for (height, size, rotation) in [(1, 32, 0.0), (2, 32, 1.0), (50, 32, 0.0), (50, 128, 0.3), (512, 64, PI / 4.0)] {
        let map = LatLong::new(2 * height, height, vec![[0.25, 1.0, 3.0]; 2 * height * height]).unwrap();
        for texel in &map.cube(size, rotation, 1.0).unwrap().radiance {
            let off = (0..3).map(|c| (texel[c] / [0.25, 1.0, 3.0][c] - 1.0).abs()).fold(0.0, f32::max);
            assert!(off < 1e-5, "{height} rows at {size}, turned by {rotation}: off by {off}");
        }
    }
}

/// One bright pixel in a dark map: the share of its energy on a face, and how bright the texel there is.
fn lit_face(column: usize, row: usize, rotation: f64) -> &'static str {
    let mut pixels = vec![[0.0; 3]; 64 * 32];
    pixels[row * 64 + column] = [1.0, 2.0, 3.0];
    let cube = LatLong::new(64, 32, pixels).unwrap().cube(32, rotation.to_radians(), 1.0).unwrap();
    let lit = cube.lit_faces();
    assert_eq!(lit.iter().filter(|lit| **lit).count(), 1, "column {column}, row {row}: {lit:?}");
    cube::FACE_NAMES[lit.iter().position(|lit| *lit).unwrap()]
}

#[test]
fn axes_are_those_of_the_field() {
    for (column, row, face) in [
        (32, 16, "right"),
        (31, 15, "right"),
        (48, 16, "front"),
        (16, 16, "back"),
        (0, 16, "left"),
        (63, 15, "left"),
        (10, 0, "top"),
        (40, 7, "top"),
        (10, 31, "bottom"),
        (32, 24, "bottom"),
    ] {
        assert_eq!(lit_face(column, row, 0.0), face, "column {column}, row {row}");
    }
    // A quarter about +Y takes +Z to +X, right-handed.
    for (rotation, face) in [(90.0, "right"), (-90.0, "left"), (180.0, "back"), (360.0, "front"), (-270.0, "right")] {
        assert_eq!(lit_face(48, 16, rotation), face, "turned by {rotation}");
    }
    assert_eq!(lit_face(48, 0, 70.0), "top");
    // Within the faces: the pixel right of the centre and below it lies at +X, a little to +Z and down.
    let mut pixels = vec![[0.0; 3]; 64 * 32];
    pixels[16 * 64 + 32] = [1.0; 3];
    let cube = LatLong::new(64, 32, pixels).unwrap().cube(512, 0.0, 1.0).unwrap();
    for (texel, value) in cube.radiance.iter().enumerate() {
        let at = cube::texel_point(texel, 512).normalize();
        let (azimuth, down) = (at.z.atan2(at.x), -at.y.asin());
        let pixel = std::f32::consts::TAU / 64.0;
        let inside = |angle: f32, margin: f32| angle > margin && angle < pixel - margin;
        if inside(azimuth, 0.005) && inside(down, 0.005) {
            assert!((value[0] - 1.0).abs() < 1e-5, "{at} is {}", value[0]);
        } else if !(inside(azimuth, -0.005) && inside(down, -0.005)) {
            assert_eq!(value[0], 0.0, "{at}");
        }
    }
}

#[test]
fn every_bit_is_the_same_for_any_number_of_threads() {
    let map = chiaro::scene::builtin::skies::map("lamps").unwrap();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let cube = pool.install(|| map.cube(64, 0.7, 1.0).unwrap());
        cube.radiance.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    let one = with(1);
    assert!([2, 3, 8].into_iter().all(|threads| with(threads) == one));
}

fn grey(path: &Path, width: usize, height: usize, values: Vec<f32>) {
    let layers = vec![Layer::new("", &["R", "G", "B"], Content::Colour, values)];
    exr_write::write(path, &Image { width, height, layers, ..Image::default() }, Depth::Float, &[]).unwrap();
}

#[test]
fn bad_maps_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    grey(&path("square.exr"), 8, 8, vec![1.0; 192]);
    let mut values = vec![1.0; 96];
    (values[30], values[31], values[50], values[93]) = (f32::NAN, f32::NAN, f32::INFINITY, -0.5);
    grey(&path("ugly.exr"), 8, 4, values);
    std::fs::write(path("text.hdr"), "no picture").unwrap();
    let depth = Image {
        width: 8,
        height: 4,
        layers: vec![Layer::new("Z", &["Z"], Content::Data, vec![1.0; 32])],
        ..Image::default()
    };
    exr_write::write(&path("depth.exr"), &depth, Depth::Float, &[]).unwrap();
    for (params, code, words) in [
        (json!({ "file": "square.exr" }), 3, &["square.exr", "8 x 8 pixels", "twice as wide"][..]),
        (json!({ "file": "ugly.exr" }), 3, &["1 NaN (first: column 2, row 1)", "1 infinite", "1 negative"]),
        (json!({ "file": "gone.hdr" }), 3, &["gone.hdr", "no such file"]),
        (json!({ "file": "text.hdr" }), 3, &["text.hdr"]),
        (json!({ "file": "depth.exr" }), 3, &["depth.exr", "beauty"]),
        (json!({ "file": "builtin:night" }), 1, &["\"night\""]),
        (json!({ "file": "builtin:sky", "face_size": 48 }), 1, &["48", "power of two"]),
    ] {
        let error = run(folder.path(), params.clone()).unwrap_err();
        assert_eq!(error.exit_code(), code, "{params}: {error}");
        assert!(!error.help().is_empty(), "{error}");
        words.iter().for_each(|word| assert!(error.to_string().contains(word), "\"{word}\" is not in: {error}"));
    }
    let bright = LatLong::new(2, 1, vec![[1e30; 3]; 2]).unwrap();
    assert!(bright.cube(32, 0.0, 1e20).unwrap_err().to_string().contains("more than numbers hold"));
    assert_eq!(whole(&LatLong::new(2, 1, vec![[0.0; 3]; 2]).unwrap().cube(32, 0.0, 1.0).unwrap()), [0.0; 3]);
}

#[test]
fn keys_change_with_what_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let key = |params: Json, frame: i64| {
        let plan = plan(folder.path(), params);
        let target = plan.find("sky").unwrap();
        tasks(&plan, &[target], frame, &FileHashes::default(), &NoMemo).unwrap().at(target, frame).unwrap().key
    };
    for frame in [1, 2] {
        grey(&folder.path().join(format!("sky.000{frame}.exr")), 8, 4, vec![frame as f32; 96]);
    }
    let still = json!({ "file": "sky.0001.exr" });
    let first = key(still.clone(), 1);
    assert_eq!(first, key(still.clone(), 2), "a still map does not depend on the frame");
    for (name, value) in [("rotation", json!(10.0)), ("exposure", json!(1.0)), ("face_size", json!(64))] {
        let mut params = still.clone();
        params[name] = value;
        assert_ne!(key(params, 1), first, "{name}");
    }
    let moving = json!({ "file": "sky.####.exr", "face_size": 32 });
    assert_ne!(key(moving.clone(), 1), key(moving.clone(), 2));
    for frame in [1, 2] {
        let (cube, _) = at_frame(folder.path(), moving.clone(), frame).unwrap();
        assert!((cube.radiance[7][0] - frame as f32).abs() < 1e-5);
    }
    grey(&folder.path().join("sky.0001.exr"), 8, 4, vec![5.0; 96]);
    assert_ne!(key(still, 1), first, "the file's content counts");
}

/// What a hand of 35 degrees before the brightest texel hides, softly.
fn hidden(cube: &Environment) -> Vec<f32> {
    let green = |texel: &usize| cube.radiance[*texel][1];
    let texels = 0..cube.radiance.len();
    let brightest = texels.clone().max_by(|a, b| green(a).total_cmp(&green(b))).unwrap();
    let at = |texel: usize| cube::texel_point(texel, cube.size).normalize();
    texels.map(|texel| ((35.0 - at(texel).angle_between(at(brightest)).to_degrees()) / 10.0).clamp(0.0, 1.0)).collect()
}

/// No jumps: area goes with energy at the radiance of the level that is cut, so a step takes no more than its share of the
/// blocked energy over the radiance of the dimmest texel that stays.
fn shrinks_without_jumps(cube: &Environment, name: &str) {
    let hidden = hidden(cube);
    let luminance = |texel: usize| {
        let [r, g, b, _] = cube.radiance[texel];
        f64::from(chiaro::image::colour::luminance(glam::Vec3::new(r, g, b)))
    };
    let blocked = |texel: usize| f64::from(hidden[texel]) * luminance(texel);
    let solid = |texel: usize| f64::from(cube.radiance[texel][3]);
    let texels = 0..cube.radiance.len();
    let total: f64 = texels.clone().map(|texel| blocked(texel) * solid(texel)).sum();
    let area = |lamp: &Lamp| texels.clone().map(|texel| f64::from(lamp.weights[texel]) * solid(texel)).sum::<f64>();
    let (steps, mut before, mut least) = (200, f64::MAX, 0.0);
    for step in 0..=steps {
        let settings = Settings { threshold: Some(step as f32 / steps as f32), ..Default::default() };
        let found = localize(cube, &hidden, &settings).unwrap();
        let now = area(&found.lamp);
        assert!((now - found.steradians).abs() <= 1e-4 * now);
        let dimmest = |weight: f32| {
            let kept = texels.clone().filter(|texel| found.lamp.weights[*texel] >= weight).map(blocked);
            kept.fold(f64::MAX, f64::min)
        };
        if step > 0 {
            let (cut, energy) = (before - now, total / f64::from(steps));
            assert!(cut * least <= 1.001 * energy, "{name}, step {step}: {cut} sr at once");
            assert!(cut * dimmest(1.0) >= 0.999 * energy, "{name}, step {step}: brighter ones went first");
        }
        (before, least) = (now, dimmest(f32::MIN_POSITIVE));
    }
    assert_eq!(before, 0.0);
}

#[test]
fn a_lamp_shrinks_without_jumps() {
    let sky = chiaro::scene::builtin::skies::map("lamps").unwrap().cube(64, 0.0, 1.0).unwrap();
    shrinks_without_jumps(&sky, "lamps");
    for path in support::all_data("a_lamp_shrinks_without_jumps", &MAPS[1..]) {
        let cube = map(&load::load(&path, None).unwrap()).cube(64, 0.0, 1.0).unwrap();
        shrinks_without_jumps(&cube, &path.display().to_string());
    }
}

/// In each, the strongest lamp is small, holds most of what is hidden, and is one place; at any size the same.
#[test]
fn lamps_of_real_maps_are_found() {
    let expected = [(0.006, 0.80), (0.008, 0.80), (0.008, 0.15), (0.02, 0.60)];
    let paths = support::all_data("lamps_of_real_maps_are_found", &MAPS[1..]);
    for path in paths {
        let number = MAPS[1..].iter().position(|map| path.ends_with(map)).unwrap();
        let (largest, share) = expected[number];
        let map = map(&load::load(&path, None).unwrap());
        let mut before = None;
        for size in [64, 128, 256] {
            let cube = map.cube(size, 0.0, 1.0).unwrap();
            let found = localize(&cube, &hidden(&cube), &Settings { which: 1, ..Default::default() }).unwrap();
            let lamp = found.lamps[0];
            let coarse = 12.0 * 4.0 * std::f64::consts::PI / found.lamp.weights.len() as f64;
            assert!(found.steradians < largest + coarse, "{}, {size}: {found:?}", path.display());
            assert!(lamp.share > share, "{}, {size}: {:?}", path.display(), found.lamps);
            let near = before.is_none_or(|before: glam::Vec3| before.dot(lamp.direction) > 0.998);
            assert!(near, "{}, {size}: {:?}, before {before:?}", path.display(), lamp.direction);
            before = Some(lamp.direction);
        }
    }
}

/// By `which`, and by leaving out what was found before.
#[test]
fn lamps_are_found_one_after_the_other() {
    for size in [32, 128] {
        let cube = chiaro::scene::builtin::skies::map("lamps").unwrap().cube(size, 0.0, 1.0).unwrap();
        let blocked = vec![1.0; cube.radiance.len()];
        let mut except = Lamp { size, weights: vec![0.0; blocked.len()].into() };
        let mut places = vec![[0.55, 0.57, 0.61], [0.02, 0.85, 0.53], [-0.60, 0.37, 0.71]];
        for which in 1..=3 {
            let settings = Settings { which, ..Default::default() };
            let found = localize(&cube, &blocked, &settings).unwrap();
            let next = Settings { which: 1, except: Some(&except), ..Default::default() };
            let next = localize(&cube, &blocked, &next).unwrap();
            assert!(next.lamp.weights[..] == found.lamp.weights[..], "{size}, lamp {which}");
            let towards = next.lamps[0].direction;
            let left = places.len();
            places.retain(|place| towards.dot(glam::Vec3::from(*place).normalize()) < 0.995);
            assert_eq!(places.len(), left - 1, "{size}, lamp {which} is at {towards}");
            let both = except.weights.iter().zip(&next.lamp.weights).map(|(a, b)| a.max(*b)).collect::<Vec<f32>>();
            except = Lamp { size, weights: both.into() };
        }
    }
}
