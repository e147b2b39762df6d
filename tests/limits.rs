//! Where shadow design ends (thesis 6.10): what the user gets there, and what the report warns of. Recipes as users write
//! them, on the built-in scenes; lattices, patterns and dark pictures are in `ratios.rs`, the sweep of a threshold in
//! `environment.rs`, edges and corners in `visibility.rs`.

#[allow(dead_code)]
#[path = "support/room.rs"]
mod room;
mod support;

use chiaro::eval::NodeReport;
use chiaro::graph::{Document, Plan};
use chiaro::image::exr_write::{self, Depth};
use chiaro::image::{Content, Image, Layer};
use chiaro::nodes;
use room::{evaluator, layer};
use serde_json::{Value as Json, json};
use std::path::Path;

/// The yard at 64 x 48 with faces of 32, `lit`, and what is given; parameters and nodes of the same name are replaced.
fn recipe(folder: &Path, change: Json) -> Plan {
    let view = json!({ "scene": "yard", "samples": "view", "environment": "sky" });
    let mut all = json!({
        "yard": { "type": "scene", "params": { "file": "builtin:yard" } },
        "view": { "type": "view_samples", "params": { "width": 64, "height": 48 }, "inputs": { "scene": "yard" } },
        "sky": { "type": "environment", "params": { "file": "builtin:sky", "face_size": 32 } },
        "seen": { "type": "visibility", "params": { "face_size": 32 }, "inputs": view },
        "shine": { "type": "transport", "inputs": view },
        "lit": { "type": "integrate", "inputs": { "visibility": "seen", "transport": "shine", "samples": "view" } },
    });
    for (name, node) in change.as_object().unwrap() {
        all[name] = node.clone();
    }
    let text = json!({ "chiaro": 1, "nodes": all }).to_string();
    let document = Document::parse(&folder.join("test.json"), &text).unwrap_or_else(|error| panic!("{error}"));
    Plan::new(&document, nodes::ALL).unwrap_or_else(|error| panic!("{error}"))
}

/// The `direct` layer of `node`, and all reports.
fn direct(plan: &Plan, node: &str) -> (Vec<f32>, Vec<NodeReport>) {
    let (value, reports) = room::evaluate(&evaluator(), plan, node, 1);
    let chiaro::value::Value::Image(image) = value else { panic!("{node} gives no image") };
    (layer(&image, "direct"), reports)
}

fn warnings<'a>(reports: &'a [NodeReport], node: &str) -> Vec<&'a str> {
    let report = reports.iter().find(|report| report.node == node).unwrap_or_else(|| panic!("no report of {node}"));
    report.notes.get("warnings").and_then(Json::as_array).into_iter().flatten().filter_map(Json::as_str).collect()
}

/// A black map with one bright pixel.
fn one_lamp(path: &Path) {
    let (width, height) = (256, 128);
    let mut data = vec![0.0; 3 * width * height];
    data[3 * (33 * width + 161)..][..3].fill(16000.0);
    let layers = vec![Layer::new("", &["R", "G", "B"], Content::Colour, data)];
    exr_write::write(path, &Image { width, height, layers, ..Image::default() }, Depth::Float, &[]).unwrap();
}

fn integrate(visibility: &str) -> Json {
    json!({ "type": "integrate", "inputs": { "visibility": visibility, "transport": "shine", "samples": "view" } })
}

/// One bright texel: shadows have hard edges, it is warned of where the light is made and where it is found, and what is
/// found, removed and moved is still that light.
#[test]
fn one_bright_texel_lights_with_hard_shadows_and_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    one_lamp(&folder.path().join("lamp.exr"));
    let shadow = json!({ "strokes": [{ "points": [[-1.6, 0.0, 0.6]], "radius": 2.5 }] });
    let inputs = json!({ "visibility": "seen", "environment": "sky", "selection": "dab" });
    let plan = recipe(
        folder.path(),
        json!({
            "sky": { "type": "environment", "params": { "file": "lamp.exr", "face_size": 32 } },
            "dab": { "type": "paint", "params": shadow, "inputs": { "scene": "yard" } },
            "lamp": { "type": "localize_light", "inputs": inputs },
            "off": { "type": "remove_shadow", "inputs": { "visibility": "seen", "light": "lamp" } },
            "removed": integrate("off"),
            "slid": {
                "type": "translate_shadow", "params": { "offset": [0.3, 0.0, 0.0] },
                "inputs": { "visibility": "seen", "light": "lamp" },
            },
            "moved": integrate("slid"),
        }),
    );
    let (lit, reports) = direct(&plan, "lit");
    assert!(warnings(&reports, "sky").iter().any(|text| text.contains("holds") && text.contains("face_size")));
    let black = lit.chunks(3).filter(|pixel| pixel == &[0.0; 3]).count();
    assert!(black > 300, "what the lamp does not reach is black: {black} pixels");

    let (removed, reports) = direct(&plan, "removed");
    assert!(
        warnings(&reports, "lamp").iter().any(|text| text.contains("one texel")),
        "{:?}",
        warnings(&reports, "lamp")
    );
    let brighter = removed.iter().zip(&lit).filter(|(after, before)| after > before).count();
    assert!(brighter > 100 && removed.iter().zip(&lit).all(|(after, before)| after >= before));

    // Moved past all other light, which is none: nothing was baked there, and the report says what to do.
    let (moved, reports) = direct(&plan, "moved");
    assert!(warnings(&reports, "moved").iter().any(|text| text.contains("were not baked")), "{:?}", reports.last());
    assert!(moved.iter().all(|x| x.is_finite()));
    let whole = recipe(
        folder.path(),
        json!({
            "sky": { "type": "environment", "params": { "file": "lamp.exr", "face_size": 32 } },
            "seen": {
                "type": "visibility", "params": { "face_size": 32 }, "inputs": { "scene": "yard", "samples": "view" }
            },
            "slid": {
                "type": "translate_shadow", "params": { "offset": [0.3, 0.0, 0.0] }, "inputs": { "visibility": "seen" },
            },
            "moved": integrate("slid"),
        }),
    );
    let (there, reports) = direct(&whole, "moved");
    assert!(warnings(&reports, "moved").is_empty());
    let shadows = |picture: &[f32]| {
        let pairs = picture.iter().zip(&removed).filter(|(shaded, open)| **shaded < 0.5 * **open);
        pairs.count()
    };
    assert!(shadows(&there) > 3 * shadows(&moved) && shadows(&there) > 100, "{} {}", shadows(&there), shadows(&moved));
}

/// Two shadows of one light, one over the other: without groups both are edited, where they overlap as elsewhere; with
/// groups each by itself, and what both hide stays hidden.
#[test]
fn overlapping_shadows_part_only_by_groups() {
    let folder = tempfile::tempdir().unwrap();
    let groups = json!({ "figure": ["body", "head"], "railing": ["bar*", "handrail"] });
    let inputs = json!({ "scene": "yard", "samples": "view", "environment": "sky" });
    let plan = recipe(
        folder.path(),
        json!({
            "apart": { "type": "visibility", "params": { "face_size": 32, "groups": groups }, "inputs": inputs },
            "all_off": { "type": "remove_shadow", "inputs": { "visibility": "seen" } },
            "none": integrate("all_off"),
            "figure_off": {
                "type": "remove_shadow", "params": { "group": "figure" }, "inputs": { "visibility": "apart" }
            },
            "without_figure": integrate("figure_off"),
            "railing_off": {
                "type": "remove_shadow", "params": { "group": "railing" }, "inputs": { "visibility": "apart" }
            },
            "without_railing": integrate("railing_off"),
            "both_off": {
                "type": "remove_shadow", "params": { "group": "railing" }, "inputs": { "visibility": "figure_off" }
            },
            "without_both": integrate("both_off"),
        }),
    );
    let [lit, none, without_figure, without_railing, without_both] =
        ["lit", "none", "without_figure", "without_railing", "without_both"].map(|node| direct(&plan, node).0);
    // What removal gives back: by each group, and by both. Where both hide one direction, neither alone gives it back.
    let gained = |after: &[f32]| after.iter().zip(&lit).map(|(after, before)| f64::from(after - before)).sum::<f64>();
    let [all, figure, railing, both] = [&none, &without_figure, &without_railing, &without_both].map(|p| gained(p));
    println!("light given back: all {all:.2}, figure {figure:.2}, railing {railing:.2}, both {both:.2}");
    assert!(figure > 0.0 && railing > 0.0 && both > figure + railing && all > both);
}

/// A sun of half a degree is a fraction of a texel of 128: its shadow is as soft as a texel is wide, which is said.
#[test]
fn a_small_sun_is_as_large_as_a_texel_and_warned_of() {
    let found =
        support::all_data("a_small_sun_is_as_large_as_a_texel_and_warned_of", &["environments/noon_grass_1k.hdr"]);
    let [map] = found.as_slice() else { return };
    for size in [128, 512] {
        let plan = recipe(
            Path::new("."),
            json!({
                "sky": { "type": "environment", "params": { "file": map, "face_size": size } },
                "seen": {
                    "type": "visibility", "params": { "face_size": size, "faces": ["top"] },
                    "inputs": { "scene": "yard", "samples": "view", "environment": "sky" },
                },
            }),
        );
        let (lit, reports) = direct(&plan, "lit");
        let told = warnings(&reports, "sky");
        assert_eq!(!told.is_empty(), size == 128, "faces of {size}: {told:?}");
        assert!(lit.iter().all(|x| x.is_finite()));
        // Only the top face was asked for.
        assert!(warnings(&reports, "lit").iter().any(|text| text.contains("casts no shadows")));
    }
}

/// Samples inside of an object see nothing, are black, counted and warned of.
#[test]
fn samples_inside_of_objects_are_black_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    // From inside the plinth: all that is seen is its inner side.
    let inside = json!({ "position": [1.9, 0.2, -0.5], "target": [2.5, 0.2, -0.5] });
    let plan = recipe(
        folder.path(),
        json!({
            "inside": { "type": "camera", "params": inside, "inputs": { "scene": "yard" } },
            "view": {
                "type": "view_samples", "params": { "width": 64, "height": 48 },
                "inputs": { "scene": "yard", "camera": "inside" },
            },
        }),
    );
    let (lit, reports) = direct(&plan, "lit");
    let notes = &reports.iter().find(|report| report.node == "seen").unwrap().notes;
    assert_eq!(notes["blind_samples"], 64 * 48, "{notes:?}");
    assert!(warnings(&reports, "seen").iter().any(|text| text.contains("see nothing")));
    assert!(lit.iter().all(|x| *x == 0.0));
    let (_, reports) = direct(&recipe(folder.path(), json!({})), "lit");
    assert!(warnings(&reports, "seen").is_empty(), "from outside there is nothing to warn of");
}

/// No light in `removed` anywhere: the ratio is 1, a shadow changes nothing, and it is said.
#[test]
fn a_ratio_over_darkness_is_one_and_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let dark = json!({ "layers": ["direct"], "multiply": [0.0, 0.0, 0.0] });
    let plan = recipe(
        folder.path(),
        json!({
            "dark": { "type": "grade", "params": dark, "inputs": { "image": "lit" } },
            "shade": { "type": "visibility_ratio", "inputs": { "original": "lit", "removed": "dark" } },
            "back": { "type": "synthesize_shadow", "inputs": { "image": "lit", "ratio": "shade" } },
        }),
    );
    let (back, reports) = direct(&plan, "back");
    let notes = &reports.iter().find(|report| report.node == "shade").unwrap().notes;
    assert_eq!(notes["undefined"], 64 * 48);
    assert!(warnings(&reports, "shade").iter().any(|text| text.contains("dark")));
    assert_eq!(back, direct(&plan, "lit").0);
}

/// Metals have no diffuse light: under an environment they are dark, and the report says so.
#[test]
fn polished_surfaces_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let metal = json!({ "materials": ["iron"], "metallic": 1.0 });
    let plan = recipe(
        folder.path(),
        json!({
            "polished": { "type": "material", "params": metal, "inputs": { "scene": "yard" } },
            "shine": {
                "type": "transport", "inputs": { "scene": "polished", "samples": "view", "environment": "sky" }
            },
        }),
    );
    let (_, reports) = direct(&plan, "lit");
    assert!(warnings(&reports, "shine").iter().any(|text| text.contains("polished")));
}
