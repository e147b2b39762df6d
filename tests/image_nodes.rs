//! The nodes that read, write, merge, grade and compare pictures, run as the evaluator runs them.

#[allow(dead_code)]
#[path = "support/node.rs"]
mod node;

use chiaro::image::{Content, Image, Layer, exr_read};
use chiaro::node::Key;
use chiaro::value::Value;
use chiaro::{Error, Result, nodes};
use node::At;
use serde_json::{Map, Value as Json, json};
use std::path::Path;
use std::sync::Arc;

struct Run {
    image: Option<Arc<Image>>,
    notes: Map<String, Json>,
}

fn run_at(
    kind: &str,
    params: Json,
    inputs: &[(&str, &Image)],
    base: &Path,
    out: Option<&Path>,
    frame: f64,
) -> Result<Run> {
    let inputs: Vec<(&str, Value)> = inputs.iter().map(|(port, image)| (*port, node::image(image))).collect();
    let ran = node::run_at(kind, params, &inputs, At { base, out, frame })?;
    let image = (!ran.values.is_empty()).then(|| ran.image());
    Ok(Run { image, notes: ran.notes })
}

fn run(kind: &str, params: Json, inputs: &[(&str, &Image)]) -> Result<Run> {
    run_at(kind, params, inputs, Path::new("."), None, 0.0)
}

fn picture(layers: &[(&str, &[&str], &[f32])]) -> Image {
    let layer = |&(name, channels, data): &(&str, &[&str], &[f32])| {
        let content = if name == "Z" { Content::Data } else { Content::Colour };
        Layer::new(name, channels, content, data.to_vec())
    };
    let pixels = layers[0].2.len() / layers[0].1.len();
    Image { width: pixels, height: 1, layers: layers.iter().map(layer).collect(), ..Image::default() }
}

fn colour(data: &[f32]) -> Image {
    picture(&[("", &["R", "G", "B"], data)])
}

fn beauty(run: Result<Run>) -> Vec<f32> {
    run.unwrap().image.unwrap().layer("").unwrap().data.to_vec()
}

#[test]
fn merges_by_hand() {
    let a = picture(&[("", &["R", "G", "B", "A"], &[0.5, 2.0, 0.25, 0.5])]);
    let b = picture(&[("", &["R", "G", "B", "A"], &[0.5, 0.5, 0.0, 0.25])]);
    for (operation, expected) in [
        ("over", [0.75, 2.25, 0.25, 0.625]),
        ("add", [1.0, 2.5, 0.25, 0.25]),
        ("multiply", [0.25, 1.0, 0.0, 0.25]),
        ("divide", [1.0, 4.0, 0.0, 0.25]),
        ("screen", [0.75, 2.0, 0.25, 0.25]),
        ("difference", [0.0, 1.5, 0.25, 0.25]),
        ("mix", [0.5, 2.0, 0.25, 0.5]),
    ] {
        let merged = beauty(run("merge", json!({ "operation": operation }), &[("a", &a), ("b", &b)]));
        assert_eq!(merged, expected, "{operation}");
        let half = json!({ "operation": operation, "amount": 0.5 });
        let merged = beauty(run("merge", half, &[("a", &a), ("b", &b)]));
        for i in 0..4 {
            assert_eq!(merged[i], 0.5 * (expected[i] + b.layers[0].data[i]), "{operation} by half");
        }
    }
    let divided = run("merge", json!({ "operation": "divide" }), &[("a", &a), ("b", &b)]).unwrap();
    assert_eq!(divided.notes["divided by zero"], json!(1));
}

#[test]
fn merges_only_what_both_have_or_what_is_named() {
    let (rgb, z): (&[&str], &[&str]) = (&["R", "G", "B"], &["Z"]);
    let a = picture(&[("", rgb, &[1.0; 3]), ("spec", rgb, &[1.0; 3]), ("Z", z, &[1.0])]);
    let b = picture(&[("", rgb, &[2.0; 3]), ("diff", rgb, &[2.0; 3]), ("Z", z, &[2.0])]);
    let values = |params: Json| -> Vec<(String, f32)> {
        let image = run("merge", params, &[("a", &a), ("b", &b)]).unwrap().image.unwrap();
        image.layers.iter().map(|layer| (layer.name.clone(), layer.data[0])).collect()
    };
    let expect = |list: [(&str, f32); 3]| list.map(|(name, value)| (name.to_owned(), value)).to_vec();
    assert_eq!(values(json!({ "operation": "add" })), expect([("", 3.0), ("diff", 2.0), ("Z", 2.0)]));
    let named = json!({ "operation": "add", "layers": ["Z"] });
    assert_eq!(values(named), expect([("", 2.0), ("diff", 2.0), ("Z", 3.0)]));
    let error = run("merge", json!({ "layers": ["spec"] }), &[("a", &a), ("b", &b)]).err().unwrap();
    assert!(error.to_string().contains("input \"b\"") && error.to_string().contains("diff"), "{error}");
}

#[test]
fn a_mask_limits_a_merge() {
    let (a, b) = (colour(&[1.0; 9]), colour(&[3.0; 9]));
    let mask = picture(&[("", &["Y"], &[0.0, 0.5, 1.0])]);
    let inputs = [("a", &a), ("b", &b), ("mask", &mask)];
    let merged = beauty(run("merge", json!({ "operation": "mix" }), &inputs));
    assert_eq!(merged, [3.0, 3.0, 3.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0]);
    // Without any of the mask nothing changes, whatever lies there.
    let mask = picture(&[("", &["Y"], &[0.0; 3])]);
    let zero = colour(&[0.0; 9]);
    let run = run("merge", json!({ "operation": "divide" }), &[("a", &a), ("b", &zero), ("mask", &mask)]).unwrap();
    assert!(run.notes.is_empty());
}

#[test]
fn sizes_must_fit() {
    let (a, b) = (colour(&[1.0; 9]), colour(&[1.0; 6]));
    for kind in ["merge", "compare"] {
        let error = run(kind, json!({}), &[("a", &a), ("b", &b)]).err().unwrap();
        assert!(error.to_string().contains("3 x 1") && error.to_string().contains("2 x 1"), "{error}");
        assert_eq!(error.exit_code(), 1);
    }
}

#[test]
fn grades_chosen_layers() {
    let rgb: &[&str] = &["R", "G", "B"];
    let image = picture(&[("", rgb, &[0.5; 3]), ("indirect", rgb, &[0.25; 3]), ("Z", &["Z"], &[1.0])]);
    let graded = |layers: Json| run("grade", json!({ "exposure": 2.0, "layers": layers }), &[("image", &image)]);
    let firsts = |run: Run| -> Vec<f32> { run.image.unwrap().layers.iter().map(|layer| layer.data[0]).collect() };
    assert_eq!(firsts(graded(json!([])).unwrap()), [2.0, 0.25, 1.0]);
    assert_eq!(firsts(graded(json!(["indirect"])).unwrap()), [0.5, 1.0, 1.0]);
    assert!(graded(json!(["Z"])).is_err());
    assert!(graded(json!(["direct"])).err().unwrap().to_string().contains("indirect"));
    assert!(run("grade", json!({ "gamma": 0.0 }), &[("image", &image)]).is_err());
}

#[test]
fn compares_and_says_how_much() {
    let (a, b) = (colour(&[1.0, 2.0, 3.0]), colour(&[1.0, 1.0, 1.0]));
    let run = run("compare", json!({}), &[("a", &a), ("b", &b)]).unwrap();
    assert_eq!(run.image.unwrap().layer("").unwrap().data[..], [0.0, 1.0, 2.0]);
    assert_eq!(run.notes["beauty"]["differing"], json!(2));
    assert_eq!(run.notes["beauty"]["max"], json!(2.0));
    let rmse = (5.0f64 / 3.0).sqrt();
    assert!((run.notes["beauty"]["relative_rmse"].as_f64().unwrap() - rmse).abs() < 1e-12);
}

#[test]
fn writes_and_reads_frames() {
    let folder = tempfile::tempdir().unwrap();
    let (base, out) = (folder.path(), folder.path().join("made/here"));
    let image = picture(&[("", &["R", "G", "B"], &[0.5; 6]), ("Z", &["Z"], &[1.0, 2.0])]);
    let write = |params: Json, out: Option<&Path>| run_at("write_image", params, &[("image", &image)], base, out, 7.0);
    assert!(write(json!({ "file": "a.####.exr" }), None).unwrap().image.is_none());
    write(json!({ "file": "a.$F2.exr", "layers": ["Z"] }), Some(&out)).unwrap();
    write(json!({ "file": "a.%d.png" }), None).unwrap();
    let header = exr_read::read(&base.join("a.0007.exr")).unwrap().metadata;
    let find = |name: &str| header.iter().find(|(n, _)| n == name).unwrap().1.as_str();
    assert_eq!(find("chiaro:recipe"), "{ \"chiaro\": 1 }");
    assert_eq!(find("chiaro:key"), Key::of(&[b"key"]).to_string());
    assert_eq!(exr_read::read(&out.join("a.07.exr")).unwrap().layers.len(), 1);
    let read = |file: &str, layer: &str| {
        run_at("read_image", json!({ "file": file, "layer": layer }), &[], base, None, 7.0)
            .map(|run| run.image.unwrap())
    };
    assert_eq!(read("a.%04d.exr", "").unwrap().layers.len(), 2);
    let depth = read("a.%04d.exr", "Z").unwrap();
    assert_eq!((depth.layers[0].name.as_str(), &depth.layers[0].data[..]), ("", &[1.0f32, 2.0][..]));
    assert!((read("a.7.png", "").unwrap().layers[0].data[0] - 0.5).abs() < 0.003);
    assert_eq!(read("a.8.png", "").unwrap_err().exit_code(), 3);
    assert_eq!(read("a.####.exr", "X").unwrap_err().exit_code(), 3);
}

#[test]
fn what_cannot_be_written_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let rgb: &[&str] = &["R", "G", "B"];
    let image = picture(&[("", rgb, &[0.5; 3]), ("indirect", rgb, &[0.5; 3])]);
    std::fs::write(folder.path().join("file"), "before").unwrap();
    let write = |params: Json| -> Error {
        run_at("write_image", params, &[("image", &image)], folder.path(), None, 1.0).err().unwrap()
    };
    assert!(matches!(write(json!({ "file": "file/a.exr" })), Error::Output { .. }));
    assert!(write(json!({ "file": "a.tiff" })).to_string().contains("\".tiff\""));
    assert!(write(json!({ "file": "" })).to_string().contains("not known"));
    assert!(write(json!({ "file": "a.png", "layers": ["beauty", "indirect"] })).to_string().contains("one layer"));
    assert!(write(json!({ "file": "a.exr", "layers": ["direct"] })).help().contains("indirect"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    assert_eq!(std::fs::read_to_string(folder.path().join("file")).unwrap(), "before");
}

#[test]
fn parameters_are_checked() {
    for (kind, params) in [
        ("merge", json!({ "operation": "ovr" })),
        ("grade", json!({ "exposre": 1.0 })),
        ("write_image", json!({ "file": "a.exr", "format": "tiff" })),
        ("read_image", json!({ "file": 1 })),
        ("compare", json!({ "layers": "beauty" })),
    ] {
        let Json::Object(params) = params else { unreachable!() };
        assert!((nodes::find(kind).unwrap().parse)(params).is_err(), "{kind}");
    }
}
