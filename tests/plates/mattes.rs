//! Parts of pictures by Cryptomatte and by channels, and Cryptomatte of our own.

use crate::node::{Ran, image, run};
use crate::room::{self, evaluator, recipe, relight};
use crate::support;
use chiaro::Result;
use chiaro::graph::{Document, Plan};
use chiaro::image::cryptomatte::{self, Cryptomatte};
use chiaro::image::{Content, Image, Layer, exr_read};
use chiaro::nodes;
use serde_json::{Value as Json, json};
use std::path::Path;

const RGBA: [&str; 4] = ["R", "G", "B", "A"];

/// Two pixels: three quarters of a torus before a floor; the floor.
fn named(manifest: Option<&str>) -> Image {
    let (torus, floor) = (f32::from_bits(cryptomatte::id("torus")), f32::from_bits(cryptomatte::id("floor")));
    let data = vec![torus, 0.75, floor, 0.25, floor, 1.0, 0.0, 0.0];
    let mut metadata = vec![("cryptomatte/1234567/name".to_owned(), "CryptoObject".to_owned())];
    metadata.extend(manifest.map(|text| ("cryptomatte/1234567/manifest".to_owned(), text.to_owned())));
    let layers = vec![
        Layer::new("CryptoObject00", &RGBA, Content::Data, data),
        Layer::new("mask", &["R", "G", "B"], Content::Colour, vec![0.5, 0.5, 0.5, 2.0, 2.0, 2.0]),
        Layer::new("", &RGBA, Content::Colour, vec![0.1, 0.2, 0.3, 0.25, 0.0, 0.0, f32::NAN, 1.0]),
    ];
    Image { width: 2, height: 1, layers, metadata, ..Image::default() }
}

const MANIFEST: &str = r#"{"torus":"f19c73fd","floor":"7819c83c"}"#;

fn matte(params: Json, picture: &Image) -> Result<Ran> {
    run("matte", params, &[("image", image(picture))])
}

fn weights(params: Json, picture: &Image) -> Vec<f32> {
    matte(params, picture).unwrap().image().layers[0].data.to_vec()
}

fn fault(params: Json, picture: &Image) -> String {
    let error = matte(params, picture).err().unwrap();
    format!("{error}; {}", error.help())
}

#[test]
fn coverage_is_soft_and_names_are_patterns() {
    let picture = named(Some(MANIFEST));
    assert_eq!(weights(json!({ "objects": ["tor*"] }), &picture), [0.75, 0.0]);
    assert_eq!(weights(json!({ "objects": ["floor"] }), &picture), [0.25, 1.0]);
    assert_eq!(weights(json!({ "objects": ["*"] }), &picture), [1.0, 1.0]);
    assert_eq!(weights(json!({ "objects": ["f19c73fd"] }), &picture), [0.75, 0.0]);
    let text = fault(json!({ "objects": ["tors"] }), &picture);
    assert!(text.contains("tors") && text.contains("torus"), "{text}");
    assert!(fault(json!({ "materials": ["red"] }), &picture).contains("CryptoObject"));
    assert!(fault(json!({}), &picture).contains("layer and channel"));
    assert!(fault(json!({ "objects": ["torus"], "channel": "R" }), &picture).contains("either"));
}

/// Arnold's names, and a file without names.
#[test]
fn names_work_without_a_manifest() {
    let mut picture = named(None);
    picture.layers[0].name = "crypto_object00".to_owned();
    assert_eq!(weights(json!({ "objects": ["torus"] }), &picture), [0.75, 0.0], "by its hash");
    let text = fault(json!({ "objects": ["tor*"] }), &picture);
    assert!(text.contains("no manifest") && text.contains("f19c73fd"), "{text}");
    let text = fault(json!({ "objects": ["ball"] }), &picture);
    assert!(text.contains("\"ball\"") && text.contains("7819c83c"), "{text}");
    for damaged in ["", "{", "[1]", r#"{"torus":7}"#, r#"{"torus":"xyz"}"#] {
        let picture = named(Some(damaged));
        assert_eq!(weights(json!({ "objects": ["torus"] }), &picture), [0.75, 0.0], "{damaged:?}");
    }
}

#[test]
fn channels_are_mattes() {
    let picture = named(None);
    assert_eq!(weights(json!({ "layer": "mask" }), &picture), [0.5, 1.0], "grey, and cut at 1");
    assert!(matte(json!({ "layer": "mask" }), &picture).unwrap().warnings().contains("outside of 0 to 1"));
    assert_eq!(weights(json!({ "layer": "beauty" }), &picture), [0.25, 1.0], "alpha");
    let ran = matte(json!({ "layer": "beauty", "channel": "B" }), &picture).unwrap();
    assert_eq!(ran.image().layers[0].data[..], [0.3, 0.0]);
    assert!(ran.warnings().contains("NaN"), "{}", ran.warnings());
    assert!(fault(json!({ "layer": "mask", "channel": "A" }), &picture).contains("R G B"));
    assert!(fault(json!({ "layer": "maks" }), &picture).contains("did you mean \"mask\"?"));
    assert!(matte(json!({ "layer": "beauty", "channel": "R" }), &named(None)).unwrap().warnings().is_empty());
}

/// A selection by matte does what a selection by name does, where the camera sees it; without samples there is none, and
/// the recipe is told so before anything is computed.
#[test]
fn a_matte_selects_like_a_pick() {
    let mut nodes = json!({
        "lit": relight(None),
        "names": { "type": "cryptomatte", "inputs": { "scene": "room", "samples": "view", "image": "lit" } },
        "by_matte": { "type": "matte", "params": { "objects": ["block"] }, "inputs": { "image": "names", "samples": "view" } },
        "by_name": room::pick(&["block"]),
    });
    for how in ["by_matte", "by_name"] {
        nodes[format!("{how}_glow")] =
            json!({ "type": "illumination_brush", "params": { "scale": 2.0 }, "inputs": { "selection": how } });
        nodes[format!("{how}_cast")] = json!({
            "type": "caster_receiver", "params": { "brightness": 3.0 },
            "inputs": { "caster": how, "edits": format!("{how}_glow") },
        });
        nodes[format!("{how}_lit")] = relight(Some(&format!("{how}_cast")));
    }
    let (plan, evaluator) = (recipe(nodes), evaluator());
    let [a, b] =
        ["by_matte_lit", "by_name_lit"].map(|node| room::layer(&room::image(&evaluator, &plan, node), "indirect"));
    let plain = room::layer(&room::image(&evaluator, &plan, "lit"), "indirect");
    assert!(room::relative_rms(&b, &plain) > 0.05);
    assert!(room::relative_rms(&a, &b) < 1e-6, "{}", room::relative_rms(&a, &b));

    let text = json!({ "chiaro": 1, "nodes": {
        "plate": { "type": "read_image", "params": { "file": "plate.exr" } },
        "part": { "type": "matte", "params": { "layer": "mask" }, "inputs": { "image": "plate" } },
        "glow": { "type": "illumination_brush", "inputs": { "selection": "part" } },
        "dark": { "type": "merge", "inputs": { "a": "plate", "b": "plate", "mask": "part.matte" } },
    }});
    let document = Document::parse(Path::new("test.json"), &text.to_string()).unwrap();
    let error = Plan::new(&document, nodes::ALL).err().expect("there is no selection").to_string();
    assert!(error.contains("gives no selection without its input \"samples\""), "{error}");
    assert!(!error.contains("dark"), "the picture is there: {error}");
}

/// Headers of a matte whose layers are gone, under whatever key, do not outlive a new matte of that name.
#[test]
fn a_new_matte_has_only_its_own_header() {
    let plan = recipe(json!({ "lit": relight(None) }));
    let evaluator = evaluator();
    let [(scene, _), (samples, _)] = ["room", "view"].map(|node| room::evaluate(&evaluator, &plan, node, 1));
    let mut old = (*room::image(&evaluator, &plan, "lit")).clone();
    for (field, value) in [("name", "CryptoObject"), ("manifest", r#"{"gone":"00000001"}"#)] {
        old.metadata.push((format!("cryptomatte/1234567/{field}"), value.to_owned()));
    }
    old.metadata.push(("note".to_owned(), "stays".to_owned()));
    let named =
        run("cryptomatte", json!({}), &[("scene", scene), ("samples", samples), ("image", image(&old))]).unwrap();
    let named = named.image();
    let matte = Cryptomatte::of(&named, "CryptoObject").unwrap();
    assert!(matte.manifest.values().any(|name| name == "block") && !matte.manifest.values().any(|name| name == "gone"));
    assert!(named.metadata.iter().all(|(name, _)| !name.starts_with("cryptomatte/1234567")), "{:?}", named.metadata);
    assert!(named.metadata.iter().any(|(name, _)| name == "note"));
}

/// Blender's matte of the stage against our own of the same view: coverage of each object.
#[test]
fn our_coverage_is_blenders() {
    let test = "our_coverage_is_blenders";
    let found = support::all_data(test, &["scenes/stage.glb", "plates/stage/direct.exr"]);
    let [scene, plate] = found.as_slice() else { return };
    let plan = json!({ "chiaro": 1, "nodes": {
        "stage": { "type": "scene", "params": { "file": scene } },
        "view": { "type": "view_samples", "params": { "width": 640, "height": 480, "samples_per_pixel": 16 },
            "inputs": { "scene": "stage" } },
        "names": { "type": "cryptomatte", "inputs": { "scene": "stage", "samples": "view" } },
    }});
    let document = Document::parse(Path::new("test.json"), &plan.to_string()).unwrap();
    let plan = Plan::new(&document, nodes::ALL).unwrap_or_else(|error| panic!("{error}"));
    let ours = room::image(&evaluator(), &plan, "names");
    let theirs = exr_read::read(plate).unwrap();
    for kind in ["CryptoObject", "CryptoMaterial"] {
        let [ours, theirs] = [&ours, &theirs].map(|image| Cryptomatte::of(image, kind).unwrap());
        for (id, name) in &ours.manifest {
            let (a, b) = (ours.coverage(*id), theirs.coverage(*id));
            let squares: f64 = a.iter().zip(&b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
            let rms = (squares / a.len() as f64).sqrt();
            let most = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            println!("{kind} {name}: {rms:.4}, at most {most:.2}");
            assert!(rms < 0.01 && most < 0.4, "{kind} {name}: {rms} {most}");
        }
        let all: Vec<f32> = ours.covered(&["*".to_owned()]).unwrap();
        assert!(all.iter().all(|covered| (0.0..=1.0).contains(covered)));
    }
}
