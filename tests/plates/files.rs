//! What is read of other programs' files, and what is written for them.

use crate::node::{At, Ran, image, run, run_at};
use chiaro::Result;
use chiaro::image::cryptomatte::Cryptomatte;
use chiaro::image::{ColourSpace, Content, Image, Layer, exr_read};
use serde_json::{Value as Json, json};
use std::path::Path;

const RGB: [&str; 3] = ["R", "G", "B"];

fn at(folder: &Path) -> At<'_> {
    At { base: folder, out: None, frame: 1.0 }
}

fn write(folder: &Path, params: Json, picture: &Image) -> Result<Ran> {
    run_at("write_image", params, &[("image", image(picture))], at(folder))
}

fn read(folder: &Path, params: Json) -> Result<Ran> {
    run_at("read_image", params, &[], at(folder))
}

fn colour(name: &str, value: f32) -> Layer {
    Layer::new(name, &RGB, Content::Colour, vec![value; 12])
}

fn picture(layers: Vec<Layer>) -> Image {
    Image { width: 2, height: 2, layers, ..Image::default() }
}

/// How each layer of a file is stored.
fn stored(path: &Path) -> Vec<(String, String)> {
    let file = exr_read::ExrFile::open(path).unwrap();
    file.layer_names().iter().map(|name| (*name).to_owned()).zip(file.stored()).collect()
}

#[test]
fn layers_have_the_depth_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let data = Layer::new("N", &["X", "Y", "Z"], Content::Data, vec![0.25; 12]);
    let ids = Layer::new("CryptoObject00", &["R", "G", "B", "A"], Content::Data, vec![1e-30; 16]);
    let layers = vec![colour("", 0.5), colour("direct", 0.25), colour("ratio_a", 2.0), colour("sun", 1e6), data, ids];
    let all = picture(layers);
    let params = json!({ "file": "a.exr", "layer_depth": { "di*": "float", "N": "half", "sun": "half" } });
    let ran = write(folder.path(), params, &all).unwrap();
    assert!(ran.warnings().contains("above 65504"), "half never becomes infinity: {}", ran.warnings());
    let expected = [
        ("", "half"),
        ("CryptoObject00", "float"),
        ("N", "half"),
        ("direct", "float"),
        ("ratio_a", "half"),
        ("sun", "float"),
    ];
    let mut found = stored(&folder.path().join("a.exr"));
    found.sort();
    assert_eq!(found, expected.map(|(name, kind)| (name.to_owned(), kind.to_owned())));
    for (params, word) in [
        (json!({ "file": "b.exr", "layer_depth": { "Crypto*": "half" } }), "ids"),
        (json!({ "file": "b.exr", "layer_depth": { "dierct": "float" } }), "dierct"),
    ] {
        let error = write(folder.path(), params, &all).err().unwrap();
        assert!(error.to_string().contains(word), "{error}");
    }
    assert!(!folder.path().join("b.exr").exists());
}

#[test]
fn every_compression_keeps_every_bit() {
    let folder = tempfile::tempdir().unwrap();
    let value = |i: usize| ((i * 2_654_435_761) % 1000) as f32 * 0.001 + 0.1;
    let data: Vec<f32> = (0..3 * 70 * 50).map(value).collect();
    let noisy =
        Image { width: 70, height: 50, layers: vec![Layer::new("", &RGB, Content::Colour, data)], ..Image::default() };
    for compression in ["none", "rle", "zips", "zip", "piz"] {
        let params = json!({ "file": "a.exr", "depth": "float", "compression": compression });
        write(folder.path(), params, &noisy).unwrap();
        let back = exr_read::read(&folder.path().join("a.exr")).unwrap();
        assert_eq!(back.layers[0].data[..], noisy.layers[0].data[..], "{compression}");
    }
}

#[test]
fn names_are_plain_unless_they_are_to_stay() {
    let folder = tempfile::tempdir().unwrap();
    let plate = picture(vec![colour("ViewLayer.Combined", 1.0), colour("ViewLayer.Diffuse Direct", 0.5)]);
    let names = |params: Json| -> Vec<String> {
        write(folder.path(), params, &plate).unwrap();
        stored(&folder.path().join("a.exr")).into_iter().map(|(name, _)| name).collect()
    };
    assert_eq!(names(json!({ "file": "a.exr" })), ["", "Diffuse_Direct"]);
    let kept = names(json!({ "file": "a.exr", "names": "as_read" }));
    assert_eq!(kept, ["ViewLayer.Combined", "ViewLayer.Diffuse Direct"]);
    // By the names that the picture has, too.
    let one = names(json!({ "file": "a.exr", "layers": ["Diffuse Direct"] }));
    assert_eq!(one, ["Diffuse_Direct"]);
}

#[test]
fn what_is_not_finite_is_passed_stopped_or_zero_by_choice() {
    let folder = tempfile::tempdir().unwrap();
    let mut data = vec![1.0; 12];
    (data[4], data[9]) = (f32::NAN, f32::INFINITY);
    let bad = picture(vec![Layer::new("", &RGB, Content::Colour, data)]);
    let ran = write(folder.path(), json!({ "file": "bad.exr" }), &bad).unwrap();
    assert!(ran.warnings().contains("2 values are NaN or infinite"), "{}", ran.warnings());
    let ran = read(folder.path(), json!({ "file": "bad.exr" })).unwrap();
    assert!(ran.image().layers[0].data[4].is_nan());
    assert_eq!(ran.notes["not finite in beauty"], 2);
    assert!(ran.warnings().contains("the first at 1,0 in G"), "{}", ran.warnings());
    let ran = read(folder.path(), json!({ "file": "bad.exr", "not_finite": "zero" })).unwrap();
    assert_eq!([4, 9, 0].map(|i| ran.image().layers[0].data[i]), [0.0, 0.0, 1.0]);
    let error = read(folder.path(), json!({ "file": "bad.exr", "not_finite": "stop" })).err().unwrap();
    assert!(error.exit_code() == 3 && error.to_string().contains("bad.exr") && error.help().contains("not_finite"));
    let error = write(folder.path(), json!({ "file": "b.exr", "not_finite": "stop" }), &bad).err().unwrap();
    assert!(error.exit_code() == 1 && !folder.path().join("b.exr").exists(), "{error}");
    write(folder.path(), json!({ "file": "b.exr", "not_finite": "zero" }), &bad).unwrap();
    assert!(exr_read::read(&folder.path().join("b.exr")).unwrap().layers[0].data.iter().all(|x| x.is_finite()));
}

#[test]
fn colour_spaces_travel_in_the_header() {
    let folder = tempfile::tempdir().unwrap();
    let matte = Layer::new("P", &["X", "Y", "Z"], Content::Data, vec![0.5; 12]);
    let aces = Image { colour_space: ColourSpace::AcesCg, ..picture(vec![colour("", 0.5), matte]) };
    write(folder.path(), json!({ "file": "aces.exr", "depth": "float" }), &aces).unwrap();
    let back = read(folder.path(), json!({ "file": "aces.exr" })).unwrap();
    assert_eq!(back.notes["colour_space"], "lin_ap1_scene");
    assert_eq!((back.image().colour_space, back.image().layers[0].data[0]), (ColourSpace::AcesCg, 0.5));
    // Said anew, and converted.
    let said = read(folder.path(), json!({ "file": "aces.exr", "colour_space": "lin_rec2020_scene" })).unwrap().image();
    assert_eq!((said.colour_space, said.layers[0].data[0]), (ColourSpace::Rec2020, 0.5));
    let red = Image { layers: vec![Layer::new("", &RGB, Content::Colour, [1.0, 0.0, 0.0].repeat(4))], ..aces };
    let params = json!({ "file": "red.exr", "depth": "float", "colour_space": "lin_rec709_scene" });
    write(folder.path(), params, &red).unwrap();
    let back = exr_read::read(&folder.path().join("red.exr")).unwrap();
    let expected = [1.70505, -0.13026, -0.024];
    let near = |(a, b): (&f32, &f32)| (a - b).abs() < 2e-4;
    assert!(back.colour_space == ColourSpace::Rec709 && back.layers[0].data.iter().zip(&expected).all(near));
}

/// Nodes that put pictures together, or bring them to a display, bring their colours together first.
#[test]
fn colour_spaces_meet_in_nodes() {
    let here =
        picture(vec![Layer::new("", &RGB, Content::Colour, [0.5, 0.25, 0.125].repeat(4)), colour("direct", 0.5)]);
    let there = here.to_space(ColourSpace::AcesCg);
    let near = |a: &Image, b: &Image, what: &str| {
        assert_eq!(a.colour_space, b.colour_space, "{what}");
        for (a, b) in a.layers.iter().zip(&b.layers) {
            assert!(a.data.iter().zip(&b.data[..]).all(|(a, b)| (a - b).abs() < 1e-5), "{what}: {}", a.title());
        }
    };
    let two = |kind: &str, params: Json, a: &Image, b: &Image| {
        run(kind, params, &[("a", image(a)), ("b", image(b))]).unwrap()
    };
    let sum = |a: &Image| two("merge", json!({ "operation": "add" }), a, &there).image();
    near(&sum(&here), &sum(&there), "merge");
    assert_eq!(sum(&here).colour_space, ColourSpace::AcesCg);
    let difference = two("compare", json!({}), &here, &there);
    assert!(difference.notes["beauty"]["rmse"].as_f64().unwrap() < 1e-6, "{:?}", difference.notes);
    for operator in ["none", "reinhard", "neutral", "aces"] {
        let map =
            |of: &Image| run("tone_map", json!({ "operator": operator, "exposure": 1.0 }), &[("image", image(of))]);
        near(&map(&there).unwrap().image(), &map(&here).unwrap().image(), operator);
    }
}

#[test]
fn a_matte_comes_back_from_the_file_that_it_was_written_into() {
    let folder = tempfile::tempdir().unwrap();
    let ranked =
        chiaro::image::cryptomatte::rank("View.CryptoObject", &["ä torus".into(), "b".into()], &[0, 1, 1, 1], 1, 2);
    let named = Image { metadata: ranked.metadata, ..picture([vec![colour("", 1.0)], ranked.layers].concat()) };
    write(folder.path(), json!({ "file": "a.exr" }), &named).unwrap();
    let matte = Cryptomatte::read(&folder.path().join("a.exr"), "CryptoObject").unwrap();
    assert_eq!(matte.name, "CryptoObject");
    assert_eq!(matte.covered(&["ä*".to_owned()]).unwrap(), [1.0, 0.0, 0.0, 0.0]);
}
