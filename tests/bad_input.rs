//! Bad input ends with one message that says what is wrong, the right exit code, and the old output as it was.

#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/glb.rs"]
mod glb;
mod support;

use chiaro::image::{Content, Image, Layer, exr_write, png};
use glb::Glb;
use serde_json::{Value as Json, json};
use std::path::{Path, PathBuf};

/// A folder with a recipe that renders `room.glb` into `out.exr`, which is there already.
struct Bench {
    folder: tempfile::TempDir,
    recipe: Json,
}

const BEFORE: &[u8] = b"rendered yesterday";

impl Bench {
    fn new(glb: &Glb) -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap(), recipe: recipe() };
        std::fs::write(bench.path("room.glb"), glb.bytes()).unwrap();
        std::fs::write(bench.path("out.exr"), BEFORE).unwrap();
        bench
    }

    fn room() -> Self {
        Self::new(&Glb::room())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Sets the value at a JSON pointer of the recipe; missing objects on the way are made.
    fn set(mut self, pointer: &str, value: Json) -> Self {
        let mut place = &mut self.recipe;
        for name in pointer.split('/').skip(1) {
            place = &mut place[name];
        }
        *place = value;
        self
    }

    fn run(&self, text: &str, more: &[&str]) -> std::process::Output {
        std::fs::write(self.path("recipe.json"), text).unwrap();
        let mut command = assert_cmd::Command::cargo_bin("chiaro").unwrap();
        command.env("RUST_BACKTRACE", "1").env("NO_COLOR", "1").env_remove("CHIARO_LOG");
        command.arg("render").arg(self.path("recipe.json"));
        command.args(["--device", "cpu", "--no-cache", "--progress", "none"]).args(more);
        command.output().unwrap()
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Rendering fails with that code; the message holds all `words`. Gives the message.
    fn refused_with(&self, text: &str, more: &[&str], code: i32, words: &[&str]) -> String {
        std::fs::write(self.path("recipe.json"), text).unwrap();
        let before = self.names();
        let output = self.run(text, more);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(output.stdout.is_empty());
        assert_eq!(message.lines().filter(|line| line.starts_with("error: ")).count(), 1, "one message: {message}");
        for word in words {
            assert!(message.contains(word), "\"{word}\" is not in: {message}");
        }
        for sign in ["panicked", "backtrace", ".rs:", "unwrap", "Some("] {
            assert!(!message.contains(sign), "\"{sign}\" is of no use to anyone: {message}");
        }
        assert_eq!(std::fs::read(self.path("out.exr")).unwrap(), BEFORE, "the old picture was touched");
        assert_eq!(self.names(), before, "files came or went");
        message
    }

    fn refused(&self, code: i32, words: &[&str]) {
        let message = self.refused_with(&self.recipe.to_string(), &[], code, words);
        assert!(code == 2 || message.contains("help: "), "it says what to do: {message}");
    }
}

fn recipe() -> Json {
    json!({ "chiaro": 1, "nodes": {
        "room": { "type": "scene", "params": { "file": "room.glb" } },
        "view": { "type": "view_samples", "params": { "width": 8, "height": 6 }, "inputs": { "scene": "room" } },
        "transport": { "type": "transfer", "params": { "gather_samples": 64, "tolerance": 0.5 },
                       "inputs": { "scene": "room", "samples": "view" } },
        "pick": { "type": "pick", "params": { "objects": ["wall"] }, "inputs": { "scene": "room" } },
        "bleed": { "type": "caster_receiver", "params": { "brightness": 2.0 }, "inputs": { "caster": "pick" } },
        "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "transport", "edits": "bleed" } },
        "out": { "type": "write_image", "params": { "file": "out.exr" }, "inputs": { "image": "lit" } }
    }})
}

/// A recipe that copies a picture.
fn copy(from: &str, to: &str) -> Json {
    json!({ "chiaro": 1, "nodes": {
        "in": { "type": "read_image", "params": { "file": from } },
        "out": { "type": "write_image", "params": { "file": to }, "inputs": { "image": "in" } }
    }})
}

#[test]
fn the_recipe_that_is_spoiled_below_is_good() {
    let bench = Bench::room();
    let output = bench.run(&bench.recipe.to_string(), &[]);
    assert_eq!((output.status.code(), String::from_utf8(output.stderr).unwrap()), (Some(0), String::new()));
    assert_ne!(std::fs::read(bench.path("out.exr")).unwrap(), BEFORE);
}

#[test]
fn a_missing_or_truncated_scene_is_3() {
    let bench = Bench::room().set("/nodes/room/params/file", json!("rom.glb"));
    bench.refused(3, &["node \"room\" (scene)", "rom.glb", "there is no such file"]);
    let bench = Bench::room();
    let whole = Glb::room().bytes();
    for length in [0, 3, 11, 12, 19, 30, whole.len() / 2, whole.len() - 40, whole.len() - 1] {
        std::fs::write(bench.path("room.glb"), &whole[..length]).unwrap();
        bench.refused(3, &["node \"room\" (scene)", "room.glb"]);
    }
    for name in ["a folder", "room.gltf"] {
        let bench = Bench::room().set("/nodes/room/params/file", json!(name));
        std::fs::create_dir(bench.path("a folder")).unwrap();
        std::fs::write(bench.path("room.gltf"), "{ \"asset\": ").unwrap();
        bench.refused(3, &[name]);
    }
}

#[test]
fn a_truncated_real_scene_is_3() {
    let Some(stage) = support::all_data("a_truncated_real_scene_is_3", &["scenes/stage.glb"]).pop() else { return };
    let bench = Bench::room();
    let whole = std::fs::read(stage).unwrap();
    for part in [1, 10, 50, 90, 99] {
        std::fs::write(bench.path("room.glb"), &whole[..whole.len() * part / 100]).unwrap();
        bench.refused(3, &["node \"room\" (scene)", "room.glb"]);
    }
}

/// What is wrong with a scene, and what the message must name.
#[test]
fn a_scene_that_makes_no_sense_is_3() {
    let room = Glb::room;
    let light = "/extensions/KHR_lights_punctual/lights/0";
    for (glb, words) in [
        (room().float(4, f32::NAN), &["floor", "vertex 1", "not finite"][..]),
        (room().float(4, f32::INFINITY), &["floor", "vertex 1", "not finite"]),
        (room().float(4, 1e20), &["floor", "vertex 1", "farther out"]),
        (room().set("/nodes/1/translation/0", json!(1e39)), &["wall", "farther out"]),
        (
            room().set("/nodes/1/scale", json!([0, 0, 0])).set("/nodes/0/scale", json!([1, 1, 0])),
            &["no triangle", "4 without"],
        ),
        (room().index(5, 4), &["floor", "index 4", "4 vertices"]),
        (room().set("/accessors/0/count", json!(5)), &["accessor 0", "60 bytes", "48"]),
        (room().set("/accessors/0/count", json!(0)), &["accessor"]),
        (room().set("/accessors/1/componentType", json!(5122)), &["indices are not"]),
        (room().set("/accessors/0/type", json!("VEC2")), &["positions are not"]),
        (room().set("/accessors/2/componentType", json!(5125)), &["texture coordinates are not"]),
        (room().set("/bufferViews/0/byteStride", json!(8)), &["accessor 0", "every 8 bytes"]),
        (room().set("/bufferViews/1/byteLength", json!(120000)), &["buffer view 1"]),
        (room().set("/buffers/0/byteLength", json!(100000)), &["room.glb"]),
        (room().set("/buffers/0/uri", json!("gone.bin")), &["room.glb"]),
        (room().set("/buffers/0/uri", json!("gone%ff.bin")), &["is no path"]),
        (room().without("/images/0/mimeType"), &["image 0"]),
        (room().set("/images/0/mimeType", json!("image/jpeg")), &["room.glb"]),
        (room().set("/textures/0/source", json!(7)), &["room.glb"]),
        (room().set("/nodes/0/children", json!([0])), &["node 0", "twice"]),
        (room().set("/nodes/0/children", json!([1])), &["node 1", "twice"]),
        (room().without("/cameras/0/perspective"), &["camera 0"]),
        (room().set("/cameras/0/perspective/yfov", json!(0)), &["camera \"eye\"", "field of view 0"]),
        (room().set("/cameras/0/perspective/yfov", json!(7)), &["camera \"eye\"", "field of view 7"]),
        (room().set(&format!("{light}/intensity"), json!(-1)), &["light \"lamp\"", "-1"]),
        (room().set(&format!("{light}/intensity"), json!(1e39)), &["light \"lamp\"", "inf"]),
        (room().without(&format!("{light}/spot")), &["light 0"]),
        (room().set("/nodes/3/extensions/KHR_lights_punctual/light", json!(4)), &["node 3", "light 4"]),
        (room().set("/materials/0/emissiveFactor", json!([1, 1e39, 1])), &["material \"grey\"", "too large"]),
        (room().set("/extensionsRequired", json!(["EXT_meshopt_compression"])), &["meshopt", "gltf-transform"]),
        (room().set("/extensionsRequired", json!(["KHR_draco_mesh_compression"])), &["Draco", "gltf-transform"]),
        (room().set("/extensionsRequired", json!(["EXT_of_the_future"])), &["room.glb"]),
        (room().set("/asset/version", json!("3.0")), &["room.glb"]),
    ] {
        let words: Vec<&str> = ["node \"room\" (scene)", "room.glb"].iter().chain(words).copied().collect();
        Bench::new(&glb).refused(3, &words);
    }
}

#[test]
fn triangles_without_area_are_left_out_and_counted() {
    let bench = Bench::new(&Glb::room().index(2, 1));
    let report = bench.path("report.json");
    let output = bench.run(&bench.recipe.to_string(), &["--report", report.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Json = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    let room = report["nodes"].as_array().unwrap().iter().find(|node| node["node"] == "room").unwrap();
    assert_eq!((&room["notes"]["triangles"], &room["notes"]["triangles_without_area"]), (&json!(2), &json!(2)));
}

#[test]
fn without_lights_or_camera_it_says_what_to_add() {
    let dark = Glb::room().without("/nodes/3/extensions");
    Bench::new(&dark).refused(1, &["node \"lit\" (relight)", "no light", "add a light node"]);
    let blind = Glb::room().without("/nodes/2/camera");
    Bench::new(&blind).refused(1, &["node \"view\" (view_samples)", "no camera", "add a camera node"]);
    let away = Bench::room().set("/nodes/eye", json!({ "type": "camera", "params": { "target": [0, 50, 50] } }));
    away.set("/nodes/view/inputs/camera", json!("eye")).refused(1, &["node \"transport\"", "no surface is in view"]);
}

#[test]
fn pictures_that_cannot_be_read_are_3() {
    let layer = Layer::new("", &["R", "G", "B"], Content::Colour, vec![0.5; 3 * 64 * 48]);
    let bench = Bench::room();
    png::write(&bench.path("good.png"), &layer, 64).unwrap();
    let image = Image { width: 64, height: 48, layers: vec![layer], ..Image::default() };
    exr_write::write(&bench.path("good.exr"), &image, exr_write::Depth::Half, &[]).unwrap();
    image::Rgb32FImage::from_pixel(64, 48, image::Rgb([0.5, 2.0, 0.25])).save(bench.path("good.hdr")).unwrap();
    image::RgbImage::from_pixel(64, 48, image::Rgb([1, 2, 3])).save(bench.path("good.jpg")).unwrap();
    for suffix in ["png", "exr", "hdr", "jpg"] {
        let whole = std::fs::read(bench.path(&format!("good.{suffix}"))).unwrap();
        let name = format!("cut.{suffix}");
        let text = copy(&name, "out.exr").to_string();
        for length in [0, 4, 20, whole.len() / 2] {
            std::fs::write(bench.path(&name), &whole[..length]).unwrap();
            let message = bench.refused_with(&text, &[], 3, &["node \"in\" (read_image)", &name]);
            assert!(message.contains("help: "), "{message}");
        }
    }
    for (name, word) in [("none.exr", "no such file"), ("room.glb", "room.glb")] {
        bench.refused_with(&copy(name, "out.exr").to_string(), &[], 3, &["node \"in\" (read_image)", word]);
    }
    let layer =
        copy("good.exr", "out.exr").to_string().replace("\"good.exr\"", "\"good.exr\", \"layer\": \"indirekt\"");
    bench.refused_with(&layer, &[], 3, &["node \"in\" (read_image)", "indirekt"]);
}

#[test]
fn a_recipe_that_cannot_be_read_is_2_and_a_missing_one_3() {
    let bench = Bench::room();
    let whole = serde_json::to_string_pretty(&bench.recipe).unwrap();
    for length in [0, 1, 10, whole.len() / 2, whole.len() - 1] {
        bench.refused_with(&whole[..length], &[], 2, &["recipe.json"]);
    }
    bench.refused_with("{\"chiaro\": 1, \"nodes\": {}, \"fps\": NaN}", &[], 2, &["recipe.json:1:"]);
    let mut command = assert_cmd::Command::cargo_bin("chiaro").unwrap();
    let assert = command.arg("render").arg(bench.path("recipes.json")).assert().code(3);
    assert.stderr(predicates::str::contains("recipes.json").and(predicates::str::contains("help: ")));
}

#[test]
fn what_does_not_fit_together_is_2_and_names_the_nearest() {
    for (pointer, value, words) in [
        ("/nodes/lit/type", json!("relihgt"), &["\"relihgt\"", "\"relight\""][..]),
        ("/nodes/lit/inputs/edit", json!("bleed"), &["\"edit\"", "\"edits\""]),
        ("/nodes/lit/inputs/edits", json!("bled"), &["\"bled\"", "\"bleed\""]),
        ("/nodes/lit/inputs/edits", json!("bleed.edit"), &["\"edit\"", "\"edits\""]),
        ("/nodes/bleed/params/brigthness", json!(2), &["\"brigthness\"", "\"brightness\""]),
        ("/nodes/transport/params/estimator", json!("ray"), &["\"ray\"", "\"rays\""]),
        ("/nodes/lit/inputs/edits", json!("pick"), &["takes edits", "gives selection", "\"bleed\""]),
        ("/nodes/out/inputs/image", json!("out"), &["\"out\""]),
        ("/nodes/bleed/inputs/edits", json!("bleed"), &["bleed -> bleed"]),
        ("/nodes/lit/inputs/scene", Json::Null, &["scene"]),
        ("/nodes/view/params/width", json!(0), &["\"width\"", "0 is too small", "1 or more"]),
        ("/nodes/view/params/width", json!(100000), &["\"width\"", "too large"]),
        ("/nodes/view/params/width", json!("wide"), &["\"width\"", "an integer"]),
        ("/nodes/bleed/params/brightness", json!(1e39), &["\"brightness\"", "too large"]),
        ("/nodes/bleed/params/brightness", json!({ "keys": [[1, null]] }), &["\"brightness\""]),
        ("/nodes/bleed/params/brightness", json!({ "keys": [[1, 0], [1, 1]] }), &["\"brightness\"", "sort the keys"]),
        ("/nodes/bleed/params/brightness", json!({ "keys": [] }), &["\"brightness\"", "at least one key"]),
        ("/nodes/bleed/params/curve", json!({ "points": [[0, null]] }), &["\"curve\""]),
        ("/nodes/bleed/params/curve", json!({ "points": [[0, 1e39], [1, 1]] }), &["\"curve\"", "too large"]),
        ("/nodes/bleed/params/curve", json!({ "points": [[0.5, 1]] }), &["\"curve\"", "too short"]),
        ("/nodes/bleed/params/curve", json!({ "points": [] }), &["\"curve\"", "too short"]),
        ("/nodes/bleed/params/brightness", json!(1e30), &["\"brightness\"", "too large"]),
        ("/nodes/bleed/params/brightness", json!(-1), &["\"brightness\"", "-1 is too small"]),
        ("/nodes/bleed/params/saturation", json!(-0.5), &["\"saturation\"", "too small"]),
    ] {
        let mut words = words.to_vec();
        words.push("recipe.json:");
        Bench::room().set(pointer, value).refused(2, &words);
    }
    let text = Bench::room().recipe.to_string();
    Bench::room().refused_with(&text.replace("2.0", "NaN"), &[], 2, &["recipe.json:1:"]);
    let overrides =
        [("bleed.brightness=NaN", "not JSON"), ("bled.brightness=1", "\"bleed\""), ("bleed.hue=999", "360")];
    for (set, word) in overrides {
        Bench::room().refused_with(&text, &["--set", set], 2, &[set, word]);
    }
}

#[test]
fn a_loop_is_2_and_named() {
    let bench = Bench::room().set("/nodes/more", json!({ "type": "caster_receiver", "inputs": { "edits": "bleed" } }));
    bench
        .set("/nodes/bleed/inputs/edits", json!("more"))
        .refused(2, &["feed themselves", "more -> bleed -> more", "take one of these wires out"]);
}

#[test]
fn what_a_node_cannot_do_is_1_and_says_what_can_be_done() {
    for (pointer, value, words) in [
        (
            "/nodes/transport/params/gather_samples",
            json!(100),
            &["\"transport\"", "100", "power of two", "use 128"][..],
        ),
        ("/nodes/pick/params/objects", json!(["walls"]), &["\"pick\"", "\"walls\"", "\"wall\""]),
        ("/nodes/pick/params/objects", json!(["*door*"]), &["\"pick\"", "*door*", "\"floor\", \"wall\""]),
        ("/nodes/pick/params/materials", json!(["[g-"]), &["\"pick\"", "[g-"]),
        ("/nodes/bleed/params/curve", json!({ "points": [[1, 1], [1, 2]] }), &["\"bleed\"", "curve"]),
        (
            "/nodes/view/params",
            json!({ "width": 65536, "height": 65536 }),
            &["\"view\"", "65536 x 65536", "lower width"],
        ),
        ("/nodes/out/params/layers", json!(["indirekt"]), &["\"out\"", "indirekt", "indirect"]),
        ("/nodes/room/params/file", json!("builtin:rom"), &["\"room\"", "rom", "room"]),
    ] {
        Bench::room().set(pointer, value).refused(1, words);
    }
}

/// The room's floor and wall are painted instead of picked.
fn painted(strokes: Json) -> Bench {
    let paint = json!({ "type": "paint", "params": { "strokes": strokes }, "inputs": { "scene": "room" } });
    Bench::room().set("/nodes/pick", paint)
}

#[test]
fn strokes_and_selections_that_make_no_sense_are_named() {
    let stroke = |field: &str, value: Json| {
        let mut stroke = json!({ "points": [[0.2, 0, 0.2], [0.4, 0, 0.2]], "radius": 0.3 });
        stroke[field] = value;
        painted(json!([{ "points": [[0.1, 0, 0.1]], "radius": 0.2 }, stroke]))
    };
    let normal = json!([0, 1, 0]);
    for (bench, code, words) in [
        (stroke("radius", json!(0)), 2, &["\"strokes\"", "at [1].radius: 0 is too small", "more than 0"][..]),
        (stroke("radius", json!(-2)), 2, &["\"strokes\"", "-2 is too small"]),
        (stroke("radius", json!(1e39)), 2, &["\"strokes\"", "too large"]),
        (stroke("radius", json!(null)), 2, &["\"strokes\"", "expected a number"]),
        (stroke("hardness", json!(1.5)), 2, &["\"strokes\"", "at [1].hardness: 1.5 is too large"]),
        (stroke("value", json!(-1)), 2, &["\"strokes\"", "at [1].value: -1 is too small"]),
        (stroke("points", json!([])), 2, &["\"strokes\"", "too short"]),
        (stroke("points", json!([[0, 0]])), 2, &["\"strokes\"", "too short"]),
        (stroke("mode", json!("rub")), 2, &["\"strokes\"", "\"rub\""]),
        (stroke("hardnes", json!(0.5)), 2, &["\"strokes\"", "hardnes"]),
        (stroke("normals", json!([normal, normal, normal])), 1, &["\"pick\"", "strokes[1].normals has 3 for 2 points"]),
        (stroke("normals", json!([normal, [0, 0, 0]])), 1, &["\"pick\"", "strokes[1].normals[1]", "no direction"]),
        (
            stroke("points", json!([[0, 900, 0], [0, 700, 0]])),
            1,
            &["\"pick\"", "strokes[1] touches no surface", "m away", "raise the radius"],
        ),
    ] {
        bench.refused(code, words);
    }
    let select = |mode: &str, inputs: Json| {
        Bench::room()
            .set("/nodes/both", json!({ "type": "select", "params": { "mode": mode }, "inputs": inputs }))
            .set("/nodes/bleed/inputs/caster", json!("both"))
    };
    select("union", json!({ "a": "pick" })).refused(1, &["\"both\" (select)", "union", "connect b"]);
    select("invert", json!({ "a": "pick", "b": "pick" })).refused(1, &["\"both\" (select)", "invert", "take b off"]);
    select("intersct", json!({ "a": "pick" })).refused(2, &["intersct", "\"intersect\""]);
    let foreign = select("union", json!({ "a": "pick", "b": "other" }))
        .set("/nodes/stage", json!({ "type": "scene", "params": { "file": "builtin:room" } }))
        .set("/nodes/other", json!({ "type": "pick", "inputs": { "scene": "stage" } }));
    foreign.refused(1, &["\"both\" (select)", "different scenes", "connect the same scene"]);
}

#[test]
fn strokes_that_partly_miss_are_painted_counted_and_warned_of() {
    let strokes = json!([{ "points": [[0.2, 0, 0.2], [0, 900, 0]], "radius": 0.3 }]);
    for (strokes, points, off, warned) in [(strokes, 2, 1, "strokes[0]: 1 of 2 points"), (json!([]), 0, 0, "")] {
        let bench = painted(strokes);
        let report = bench.path("report.json");
        let output = bench.run(&bench.recipe.to_string(), &["--report", report.to_str().unwrap()]);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert!(said.contains(warned) && said.contains("strokes[") != warned.is_empty(), "{said}");
        let report: Json = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
        let paint = report["nodes"].as_array().unwrap().iter().find(|node| node["node"] == "pick").unwrap();
        assert_eq!((&paint["notes"]["points"], &paint["notes"]["points_off_surfaces"]), (&json!(points), &json!(off)));
    }
}

/// The recipe with one more edit after the first.
fn edited(kind: &str, params: Json, inputs: Json) -> Bench {
    let mut inputs = inputs;
    inputs["edits"] = "bleed".into();
    Bench::room()
        .set("/nodes/more", json!({ "type": kind, "params": params, "inputs": inputs }))
        .set("/nodes/lit/inputs/edits", json!("more"))
}

#[test]
fn edits_out_of_range_are_2() {
    for (kind, params, words) in [
        ("source_brush", json!({ "scale": 1e30 }), &["\"scale\"", "too large"][..]),
        ("source_brush", json!({ "scale": -1 }), &["\"scale\"", "-1 is too small"]),
        ("source_brush", json!({ "offset": [0, -1, 0] }), &["\"offset\"", "-1 is too small"]),
        ("source_brush", json!({ "offset": [0, 1] }), &["\"offset\"", "too short"]),
        ("illumination_brush", json!({ "scale": 1e30 }), &["\"scale\"", "too large"]),
        ("illumination_brush", json!({ "saturation": -1 }), &["\"saturation\"", "too small"]),
        ("illumination_brush", json!({ "hue": 400 }), &["\"hue\"", "360"]),
        ("falloff", json!({ "exponent": 90 }), &["\"exponent\"", "90 is too large"]),
        ("falloff", json!({ "exponent": -90 }), &["\"exponent\"", "-90 is too small"]),
        ("falloff", json!({ "distance": 0 }), &["\"distance\"", "too small"]),
        ("indirect_shadow", json!({ "amount": -0.5 }), &["\"amount\"", "too small"]),
        ("indirect_shadow", json!({ "amount": 1.5 }), &["\"amount\"", "too large"]),
        ("directionality", json!({ "amount": 2 }), &["\"amount\"", "too large"]),
        ("directionality", json!({ "focus": 1e30 }), &["\"focus\"", "too large"]),
        ("directionality", json!({ "axis": [1, 0] }), &["\"axis\"", "too short"]),
    ] {
        let bench = edited(kind, params, json!({}));
        bench.refused(2, words);
        let mut check = assert_cmd::Command::cargo_bin("chiaro").unwrap();
        check.arg("check").arg(bench.path("recipe.json")).assert().code(2);
    }
}

#[test]
fn edits_that_make_no_sense_are_1_and_say_what_to_do() {
    let line = |points: Json| edited("caster_receiver", json!({ "curve": { "points": points } }), json!({}));
    line(json!([[0, 0], [1, 1], [0.5, 2]])).refused(1, &["\"more\"", "[0.5, 2.0]", "right of [1.0, 1.0]"]);
    line(json!([[0, -1], [1, 1]])).refused(1, &["\"more\"", "curve", "-1"]);
    line(json!([[0, 0], [1e-44, 1]])).refused(1, &["\"more\"", "curve", "too close together"]);
    let side = |axis: Json| edited("directionality", json!({ "axis": axis, "amount": 0.5 }), json!({}));
    side(json!([0, 0, 0])).refused(1, &["\"more\"", "axis", "no direction", "such as"]);
    for axis in [json!([1e30, 0, 1e30]), json!([0, 1e-30, 0])] {
        let bench = side(axis);
        assert_eq!(bench.run(&bench.recipe.to_string(), &[]).status.code(), Some(0));
    }
    // Each in range; all together beyond what a float holds.
    let mut bench = Bench::room();
    for number in 0..14 {
        let before = if number == 0 { "bleed".to_owned() } else { format!("more_{}", number - 1) };
        let node =
            json!({ "type": "caster_receiver", "params": { "brightness": 1000 }, "inputs": { "edits": before } });
        bench = bench.set(&format!("/nodes/more_{number}"), node);
    }
    bench.set("/nodes/lit/inputs/edits", json!("more_13")).refused(1, &["\"lit\"", "too large", "lower the factors"]);
    let steep = edited("falloff", json!({ "exponent": -4, "distance": 1e-6 }), json!({}));
    let steeper =
        json!({ "type": "falloff", "params": { "exponent": -4, "distance": 1e-6 }, "inputs": { "edits": "more" } });
    steep
        .set("/nodes/steeper", steeper)
        .set("/nodes/lit/inputs/edits", json!("steeper"))
        .refused(1, &["\"lit\"", "too large", "falloff"]);
    let stage = json!({ "type": "scene", "params": { "file": "builtin:room" } });
    let other = json!({ "type": "pick", "inputs": { "scene": "stage" } });
    for (kind, params, port) in [
        ("falloff", json!({ "exponent": 1 }), "caster"),
        ("indirect_shadow", json!({}), "receiver"),
        ("directionality", json!({ "amount": 0.5 }), "receiver"),
        ("source_brush", json!({ "scale": 2 }), "selection"),
        ("illumination_brush", json!({ "scale": 2 }), "selection"),
        ("caster_receiver", json!({ "hue": 20 }), "caster"),
    ] {
        let bench = edited(kind, params, json!({ port: "other" }));
        let bench = bench.set("/nodes/stage", stage.clone()).set("/nodes/other", other.clone());
        bench.refused(1, &["\"lit\"", "another scene", "connect the same scene"]);
    }
}

/// Where nothing is selected, or nothing of it is in view, the picture stays and the report names the edit.
#[test]
fn edits_without_effect_are_named_and_the_picture_stays() {
    let plain = Bench::room();
    assert_eq!(plain.run(&plain.recipe.to_string(), &[]).status.code(), Some(0));
    let expected = std::fs::read(plain.path("out.exr")).unwrap();
    for (kind, params, port, why) in [
        ("caster_receiver", json!({ "brightness": 3 }), "caster", "no gather sample"),
        ("caster_receiver", json!({ "curve": { "gamma": { "gamma": 2 } } }), "receiver", "in view"),
        ("falloff", json!({ "exponent": 1 }), "caster", "no gather sample"),
        ("falloff", json!({ "exponent": 1 }), "receiver", "in view"),
        ("indirect_shadow", json!({}), "caster", "no gather sample"),
        ("indirect_shadow", json!({}), "receiver", "in view"),
        ("directionality", json!({ "amount": 0.5 }), "receiver", "in view"),
        ("source_brush", json!({ "offset": [1, 1, 1] }), "selection", "no gather sample"),
        ("illumination_brush", json!({ "hue": 90 }), "selection", "in view"),
    ] {
        let bench = edited(kind, params, json!({ port: "nothing" }));
        let bench = bench.set("/nodes/nothing", json!({ "type": "paint", "inputs": { "scene": "room" } }));
        let report = bench.path("report.json");
        // The recipe is written into the picture: its pixels are compared.
        let output = bench.run(&bench.recipe.to_string(), &["--report", report.to_str().unwrap()]);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{said}");
        let line = format!("edit 2 of 2 ({kind}) changes nothing here");
        assert!(said.contains(&line) && said.contains(why), "{said}");
        let report: Json = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
        let lit = report["nodes"].as_array().unwrap().iter().find(|node| node["node"] == "lit").unwrap();
        let named = lit["notes"]["edits_without_effect"].as_array().unwrap();
        assert!(named.len() == 1 && named[0].as_str().unwrap().starts_with(&line), "{named:?}");
        assert_eq!(pixels(&std::fs::read(bench.path("out.exr")).unwrap()), pixels(&expected), "{kind}.{port}");
    }
}

/// Of an EXR that was just written.
fn pixels(bytes: &[u8]) -> Vec<(String, Vec<u32>)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.exr");
    std::fs::write(&path, bytes).unwrap();
    let image = chiaro::image::exr_read::read(&path).unwrap();
    let bits = |layer: &Layer| layer.data.iter().map(|x| x.to_bits()).collect();
    image.layers.iter().map(|layer| (layer.name.clone(), bits(layer))).collect()
}

/// A surface that is made to send light is a lamp: no other is needed.
#[test]
fn a_scene_without_lamps_is_lit_by_a_source_brush() {
    let dark = Glb::room().without("/nodes/3/extensions");
    let glow = json!({ "type": "source_brush", "params": { "offset": [2, 1, 0] }, "inputs": { "selection": "pick" } });
    let bench = Bench::new(&dark).set("/nodes/bleed", glow);
    let output = bench.run(&bench.recipe.to_string(), &[]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let layers = pixels(&std::fs::read(bench.path("out.exr")).unwrap());
    let (_, indirect) = layers.iter().find(|(name, _)| name == "indirect").unwrap();
    assert!(indirect.iter().any(|bits| f32::from_bits(*bits) > 0.01));
}

#[cfg(target_os = "linux")]
#[test]
fn more_pixels_than_memory_are_refused_before_any_is_taken() {
    let size = json!({ "width": 46000, "height": 46000 });
    let start = std::time::Instant::now();
    Bench::room()
        .set("/nodes/view/params", size)
        .refused(1, &["\"view\"", "46000 x 46000", "GiB of memory", "are free"]);
    assert!(start.elapsed().as_secs() < 20);
}

#[test]
fn an_output_that_cannot_be_written_is_1() {
    let bench = Bench::room().set("/nodes/out/params/file", json!("out.exr/picture.exr"));
    bench.refused(1, &["node \"out\" (write_image)", "cannot write", "picture.exr"]);
    let bench = Bench::room().set("/nodes/out/params/file", json!("folder.exr"));
    std::fs::create_dir(bench.path("folder.exr")).unwrap();
    bench.refused(1, &["node \"out\" (write_image)", "cannot write", "folder.exr"]);
    Bench::room().set("/nodes/out/params/file", json!("out.tga")).refused(1, &["\"out\"", ".tga", ".exr"]);
    Bench::room().set("/nodes/out/params/file", json!("")).refused(1, &["\"out\""]);
    let bench = Bench::room();
    let below = bench.path("room.glb");
    let more = ["--out", below.to_str().unwrap()];
    bench.refused_with(&bench.recipe.to_string(), &more, 1, &["cannot write", "room.glb"]);
    let report = bench.path("room.glb/report.json");
    let fresh = bench.path("other");
    let more = ["--out", fresh.to_str().unwrap(), "--report", report.to_str().unwrap()];
    let output = bench.run(&bench.recipe.to_string(), &more);
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn an_output_never_replaces_an_input_or_another_output() {
    let bench = Bench::room();
    let layer = Layer::new("", &["R", "G", "B"], Content::Colour, vec![0.5; 3]);
    let image = Image { width: 1, height: 1, layers: vec![layer], ..Image::default() };
    exr_write::write(&bench.path("plate.exr"), &image, exr_write::Depth::Half, &[]).unwrap();
    std::fs::create_dir(bench.path("sub")).unwrap();
    let plate = std::fs::read(bench.path("plate.exr")).unwrap();
    for to in ["plate.exr", "sub/../plate.exr", bench.path("plate.exr").to_str().unwrap()] {
        bench.refused_with(
            &copy("plate.exr", to).to_string(),
            &[],
            2,
            &["\"out\"", "plate.exr", "read by node \"in\""],
        );
        assert_eq!(std::fs::read(bench.path("plate.exr")).unwrap(), plate);
    }
    let twice = Bench::room().set(
        "/nodes/again",
        json!({ "type": "write_image", "params": { "file": "sub/../out.exr" }, "inputs": { "image": "lit" } }),
    );
    std::fs::create_dir(twice.path("sub")).unwrap();
    twice.refused(2, &["out.exr", "written by node"]);
    let itself = Bench::room().set("/nodes/out/params", json!({ "file": "recipe.json", "format": "exr" }));
    itself.refused(2, &["recipe.json", "the recipe"]);
}

#[test]
fn a_device_that_is_not_there_is_4() {
    let bench = Bench::room();
    std::fs::write(bench.path("recipe.json"), bench.recipe.to_string()).unwrap();
    let mut command = assert_cmd::Command::cargo_bin("chiaro").unwrap();
    command.env("WGPU_BACKEND", "none").env("VK_DRIVER_FILES", "/nowhere").env("VK_ICD_FILENAMES", "/nowhere");
    let recipe: &Path = &bench.path("recipe.json");
    let assert = command.arg("render").arg(recipe).args(["--device", "gpu", "--no-cache"]).assert().code(4);
    assert.stderr(predicates::str::contains("--device cpu"));
    assert_eq!(std::fs::read(bench.path("out.exr")).unwrap(), BEFORE);
}

use predicates::prelude::PredicateBooleanExt;
