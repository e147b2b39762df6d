//! Changes seen in a preview, applied to plates; shadows of plates as ratios.

use crate::node::{Ran, image, run};
use crate::room::{bits, close, evaluator, recipe, relight};
use crate::{room, support};
use chiaro::Result;
use chiaro::eval::{Context, Evaluator};
use chiaro::graph::{Document, Plan};
use chiaro::image::cryptomatte::{self, Cryptomatte};
use chiaro::image::{ColourSpace, Content, Image, Layer, compare, exr_read};
use chiaro::nodes;
use chiaro::transport::shadow::Ratio;
use chiaro::value::Value;
use serde_json::{Value as Json, json};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const RGB: [&str; 3] = ["R", "G", "B"];

fn picture(layers: &[(&str, &[f32])]) -> Image {
    let layer = |(name, data): &(&str, &[f32])| Layer::new(name, &RGB, Content::Colour, data.to_vec());
    Image { width: layers[0].1.len() / 3, height: 1, layers: layers.iter().map(layer).collect(), ..Image::default() }
}

fn change(params: Json, plate: &Image, before: &Image, after: &Image) -> Result<Ran> {
    run("ratio_to_plate", params, &[("plate", image(plate)), ("before", image(before)), ("after", image(after))])
}

/// Pictures of the room: as lit, with more light from a wall, and that picture's own after six bounces.
fn rooms() -> [Arc<Image>; 3] {
    let plan = recipe(json!({
        "wall": room::pick(&["left_wall"]),
        "bleed": room::edit(json!({ "brightness": 3.0 }), json!({ "caster": "wall" })),
        "before": relight(None),
        "after": relight(Some("bleed")),
        "long": {
            "type": "transfer", "params": { "gather_samples": 2048, "tolerance": 0.1, "bounces": 6 },
            "inputs": { "scene": "room", "samples": "view" },
        },
        "plate": { "type": "relight", "inputs": { "scene": "room", "transfer": "long" } },
    }));
    let evaluator = evaluator();
    ["before", "after", "plate"].map(|node| room::image(&evaluator, &plan, node))
}

#[test]
fn a_plate_that_is_the_preview_becomes_the_preview_and_no_change_is_none() {
    let [before, after, plate] = rooms();
    let ran = change(json!({}), &plate, &before, &before).unwrap();
    assert_eq!(bits(&ran.image()), bits(&plate));
    assert!(ran.ratio().values.iter().all(|value| value[..3] == [1.0; 3]));
    let ran = change(json!({}), &before, &before, &after).unwrap();
    for layer in ["", "direct", "indirect"] {
        close(&room::layer(&ran.image(), layer), &room::layer(&after, layer), 1e-5, 1e-5);
    }
    assert_eq!(room::layer(&ran.image(), "P"), room::layer(&before, "P"));
}

/// Lights add up to the beauty before and after; a plain multiply by the ratio gives the new beauty.
#[test]
fn lights_add_up_and_the_ratio_reproduces_the_picture() {
    let [before, after, plate] = rooms();
    let ran = change(json!({}), &plate, &before, &after).unwrap();
    assert_eq!(ran.notes["lights"], json!(["direct", "indirect"]));
    assert_eq!(ran.notes["direct changed"], 0);
    let changed = ran.image();
    let sum: Vec<f32> =
        room::layer(&changed, "direct").iter().zip(room::layer(&changed, "indirect")).map(|(a, b)| a + b).collect();
    let beauty =
        |image: &Image| image.layer("").unwrap().data.chunks(4).flat_map(|p| p[..3].to_vec()).collect::<Vec<_>>();
    close(&sum, &beauty(&changed), 1e-5, 1e-5);
    assert!(room::relative_rms(&beauty(&changed), &beauty(&plate)) > 0.05);
    let layers = run(
        "ratio_image",
        json!({ "name": "bleed" }),
        &[("ratio", Value::Ratio(ran.ratio())), ("image", Value::Image(changed.clone()))],
    );
    let ratio = room::layer(&layers.unwrap().image(), "ratio_bleed");
    let product: Vec<f32> = beauty(&plate).iter().zip(ratio).map(|(plate, ratio)| plate * ratio).collect();
    close(&product, &beauty(&changed), 1e-6, 1e-6);
}

#[test]
fn blenders_passes_are_without_surface_colour() {
    let colour = [0.5, 0.25, 1.0];
    let plate = picture(&[
        ("V.Combined", &[1.5, 1.25, 3.0]),
        ("V.Diffuse Direct", &[2.0, 4.0, 1.0]),
        ("V.Diffuse Indirect", &[1.0, 1.0, 2.0]),
        ("V.Diffuse Color", &colour),
    ]);
    let before = picture(&[("", &[1.0; 3]), ("direct", &[1.0; 3])]);
    let after = picture(&[("", &[0.5; 3]), ("direct", &[0.5; 3])]);
    let ran = change(json!({ "gain": 1.0 }), &plate, &before, &after).unwrap();
    let changed = ran.image();
    close(&room::layer(&changed, "V.Diffuse Direct"), &[1.0, 2.0, 0.5], 1e-3, 1e-3);
    close(&room::layer(&changed, "V.Combined"), &[1.0, 0.75, 2.5], 1e-3, 1e-3);
    assert_eq!(room::layer(&changed, "V.Diffuse Indirect"), room::layer(&plate, "V.Diffuse Indirect"));
    // Other names, when they are said.
    let plate = picture(&[("", &[1.0; 3]), ("rawLight", &[2.0; 3]), ("filter", &[0.5; 3])]);
    let named = json!({ "gain": 1.0, "components": [{ "light": "direct", "layer": "rawLight", "colour": "filter" }] });
    let changed = change(named, &plate, &before, &after).unwrap().image();
    close(&room::layer(&changed, "rawLight"), &[1.0; 3], 1e-3, 1e-3);
    close(&room::layer(&changed, ""), &[0.5; 3], 1e-3, 1e-3);
    // A light that the plate does not keep apart: the beauty tells.
    let plate = picture(&[("", &[1.0; 3]), ("direct", &[0.5; 3])]);
    let both = |x: f32| picture(&[("", &[2.0 * x; 3]), ("direct", &[x; 3]), ("indirect", &[x; 3])]);
    let ran = change(json!({ "gain": 1.0 }), &plate, &both(1.0), &both(0.5)).unwrap();
    assert_eq!(ran.notes["lights"], json!([]));
    close(&room::layer(&ran.image(), ""), &[0.5; 3], 1e-3, 1e-3);
}

#[test]
fn pictures_that_do_not_go_together_are_refused() {
    let plate = picture(&[("", &[1.0; 6])]);
    let small = picture(&[("", &[1.0; 3])]);
    let depth = Image { layers: vec![Layer::new("Z", &["Z"], Content::Data, vec![1.0; 2])], ..plate.clone() };
    let fault = |params: Json, plate: &Image, before: &Image, after: &Image| {
        let error = change(params, plate, before, after).err().unwrap();
        format!("{error}; {}", error.help())
    };
    assert!(fault(json!({}), &plate, &small, &plate).contains("before has 1 x 1"));
    assert!(fault(json!({}), &plate, &plate, &small).contains("after has 1 x 1"));
    assert!(fault(json!({}), &depth, &plate, &plate).contains("no layer \"beauty\""));
    let named = json!({ "components": [{ "light": "indirect", "layer": "beauty" }] });
    assert!(fault(named, &plate, &plate, &plate).contains("do not both have a layer \"indirect\""));
    let bad = picture(&[("", &[1.0, f32::NAN, 1.0, 1.0, 1.0, 1.0])]);
    let ran = change(json!({}), &bad, &plate, &picture(&[("", &[0.5; 6])])).unwrap();
    assert!(
        ran.image().layers[0].data[1].is_nan() && ran.warnings().contains("1 pixels hold NaN"),
        "{}",
        ran.warnings()
    );
    let black = picture(&[("", &[0.0; 6])]);
    let ran = change(json!({ "gain": 1.0 }), &black, &black, &plate).unwrap();
    assert_eq!(ran.image().layers[0].data[..], [1.0; 6], "light comes to a black plate by difference");
    assert!(ran.warnings().contains("a ratio cannot give it"), "{}", ran.warnings());
}

/// A plate in ACEScg and previews in Rec.709: the change is that of the same light.
#[test]
fn colour_spaces_are_brought_together() {
    let [before, after, plate] = rooms();
    let there = plate.to_space(ColourSpace::AcesCg);
    let expected =
        change(json!({}), &there, &before.to_space(ColourSpace::AcesCg), &after.to_space(ColourSpace::AcesCg));
    let found = change(json!({}), &there, &before, &after).unwrap().image();
    assert_eq!(found.colour_space, ColourSpace::AcesCg);
    let ratio = change(json!({}), &there, &before, &after).unwrap().ratio();
    let into = |picture: &Image| {
        let inputs = [("image", image(picture)), ("ratio", Value::Ratio(ratio.clone()))];
        run("synthesize_shadow", json!({}), &inputs).unwrap().warnings()
    };
    assert!(into(&there).is_empty() && into(&plate).contains("lin_ap1_scene"), "{}", into(&plate));
    close(&room::layer(&found, ""), &room::layer(&expected.unwrap().image(), ""), 1e-6, 1e-6);
}

fn ratio(params: Json, original: &Image, removed: Option<&Image>) -> Result<Ran> {
    let mut inputs = vec![("original", image(original))];
    inputs.extend(removed.map(|removed| ("removed", image(removed))));
    run("visibility_ratio", params, &inputs)
}

#[test]
fn shadows_come_from_two_plates_or_from_a_pass() {
    let with =
        picture(&[("V.Combined", &[3.0; 3]), ("V.Diffuse Direct", &[0.5, 1.0, 2.0]), ("V.Diffuse Color", &[0.5; 3])]);
    let without =
        picture(&[("V.Combined", &[4.0; 3]), ("V.Diffuse Direct", &[1.0, 4.0, 2.0]), ("V.Diffuse Color", &[0.5; 3])]);
    let ran = ratio(json!({}), &with, Some(&without)).unwrap();
    assert_eq!(ran.notes["layer"], "V.Diffuse Direct");
    assert_eq!(ran.ratio().values[0], [0.5, 0.25, 1.0, 1.0]);
    // The new shadow goes into the direct light, and into the beauty by as much.
    let synthesised = |picture: &Image, ratio: &Arc<Ratio>, original: Option<&Arc<Ratio>>| {
        let mut inputs = vec![("image", image(picture)), ("ratio", Value::Ratio(ratio.clone()))];
        inputs.extend(original.map(|original| ("original", Value::Ratio(original.clone()))));
        run("synthesize_shadow", json!({}), &inputs).unwrap().image()
    };
    let shaded = synthesised(&without, &ran.ratio(), None);
    assert_eq!(room::layer(&shaded, "V.Diffuse Direct"), [0.5, 1.0, 2.0]);
    assert_eq!(room::layer(&shaded, "V.Combined"), [3.75, 2.5, 4.0]);
    let none = Arc::new(ran.ratio().with(vec![[1.0; 4]]));
    let lit = synthesised(&with, &none, Some(&ran.ratio()));
    close(&room::layer(&lit, "V.Diffuse Direct"), &[1.0, 4.0, 2.0], 1e-3, 1e-3);
    assert_eq!(bits(&synthesised(&with, &ran.ratio(), Some(&ran.ratio()))), bits(&with), "out and in again");

    let pass = Image { layers: vec![Layer::new("shadow", &["Y"], Content::Data, vec![0.25])], ..with.clone() };
    assert_eq!(ratio(json!({ "layer": "shadow" }), &pass, None).unwrap().ratio().values[0], [0.25, 0.25, 0.25, 1.0]);
    let inverted = ratio(json!({ "layer": "shadow", "inverted": true }), &pass, None).unwrap();
    assert_eq!(inverted.ratio().values[0], [0.75, 0.75, 0.75, 1.0]);
    let fault = |params: Json, removed: Option<&Image>| ratio(params, &pass, removed).err().unwrap().help().to_owned();
    assert!(fault(json!({}), None).contains("name the shadow pass"));
    assert!(fault(json!({ "inverted": true }), Some(&pass)).contains("inverted"));
    let depth = Image { layers: vec![Layer::new("shadow", &["Y"], Content::Data, vec![-3.0])], ..with };
    assert!(ratio(json!({ "layer": "shadow" }), &depth, None).unwrap().warnings().contains("is it a shadow pass"));
}

fn rendered(evaluator: &Evaluator, recipe: &Json, base: &Path) -> Vec<Value> {
    let document = Document::parse(&base.join("test.json"), &recipe.to_string()).unwrap();
    let plan = Plan::new(&document, nodes::ALL).unwrap_or_else(|error| panic!("{error}"));
    let never = AtomicBool::new(false);
    let context = Context { cancel: &never, ..Context::SILENT };
    let target = plan.find("relit").unwrap();
    evaluator.evaluate(&plan, &[target], 1, &context, &mut Vec::new()).unwrap().swap_remove(0)
}

/// The recipe of the README on the plate of direct light, whose picture without the shadow is there: the head's shadow
/// goes, as a path tracer has it. Blocks of 4 x 4 pixels where the head takes more than a tenth of the light.
#[test]
fn the_heads_shadow_goes_from_a_plate() {
    let test = "the_heads_shadow_goes_from_a_plate";
    let files = [
        "plates/plaza-night/direct.exr",
        "plates/plaza-night/direct-no-head.exr",
        "scenes/plaza.glb",
        "environments/st_peters_square_night_1k.hdr",
    ];
    let found = support::all_data(test, &files);
    let [with, without, scene, map] = found.as_slice() else { return };
    let recipe = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/plaza_plate.json");
    let mut recipe: Json = serde_json::from_str(&std::fs::read_to_string(recipe).unwrap()).unwrap();
    for (node, file) in [("plate", with), ("plaza", scene), ("night", map)] {
        recipe["nodes"][node]["params"]["file"] = json!(file);
    }
    let values = rendered(&evaluator(), &recipe, Path::new("."));
    let Value::Image(relit) = &values[0] else { panic!("an image") };
    let read = |path: &Path| exr_read::read(path).unwrap();
    let (shaded, open) = (read(with), read(without));
    let objects = Cryptomatte::of(&open, "CryptoObject").unwrap().whole(0.99);
    let light = |image: &Image| image.find("Diffuse Direct").unwrap().clone();
    let region = |object: Option<&str>| -> Vec<u32> {
        let mut inside = vec![0; objects.len()];
        let (dark, bright) = (light(&shaded), light(&open));
        for corner in (0..480).step_by(4).flat_map(|y| (0..640).step_by(4).map(move |x| y * 640 + x)) {
            let block = || (0..16).map(move |i| corner + i / 4 * 640 + i % 4);
            let sum = |layer: &Layer| block().flat_map(|p| layer.data[3 * p..3 * p + 3].to_vec()).sum::<f32>();
            let is = |p: usize| object.is_none_or(|name| objects[p] == cryptomatte::id(name));
            if block().all(|p| objects[p] == objects[corner] && is(p)) && sum(&dark) < 0.9 * sum(&bright) {
                block().for_each(|p| inside[p] = objects[corner]);
            }
        }
        inside
    };
    let error = |image: &Image, pass: &str, object: Option<&str>| {
        let (a, b) = (image.find(pass).unwrap(), open.find(pass).unwrap());
        compare::blocks(a, b, 640, &region(object), 4).unwrap()[0].relative_rmse
    };
    for (object, most) in [(Some("ground"), 0.02), (Some("head"), 0.15), (None, 0.07)] {
        let [before, after] = [&shaded, &**relit].map(|image| error(image, "Combined", object));
        let direct = error(relit, "Diffuse Direct", object);
        println!(
            "{object:?}: {:.2} % -> {:.2} %, Diffuse Direct {:.2} %",
            100.0 * before,
            100.0 * after,
            100.0 * direct
        );
        assert!(before > 0.25 && after < most && direct < most, "{object:?}: {before} {after} {direct}");
    }
}

/// Two plates and no scene: the shadow that one has goes into the other, edited or not.
#[test]
fn a_shadow_of_two_plates_goes_from_one_into_the_other() {
    let test = "a_shadow_of_two_plates_goes_from_one_into_the_other";
    let files = ["plates/plaza-night/direct.exr", "plates/plaza-night/direct-no-head.exr"];
    let found = support::all_data(test, &files);
    let [with, without] = found.as_slice() else { return };
    let [with, without] = [with, without].map(|path| exr_read::read(path).unwrap());
    let ratio = ratio(json!({}), &with, Some(&without)).unwrap();
    assert_eq!(ratio.notes["layer"], "ViewLayer.Diffuse Direct");
    let put = |ratio: Arc<Ratio>| {
        let inputs = [("image", image(&without)), ("ratio", Value::Ratio(ratio))];
        run("synthesize_shadow", json!({}), &inputs).unwrap().image()
    };
    let error = |a: &Image, pass: &str| {
        let (a, b) = (a.find(pass).unwrap(), with.find(pass).unwrap());
        compare::compare(a, b, 640).unwrap().relative()
    };
    let back = put(ratio.ratio());
    println!("Diffuse Direct {:.2e}, Combined {:.2e}", error(&back, "Diffuse Direct"), error(&back, "Combined"));
    assert!(error(&without, "Combined") > 0.05, "the plates differ");
    assert!(error(&back, "Diffuse Direct") < 1e-6 && error(&back, "Combined") < 2e-3);
    let graded = run("ratio_grade", json!({ "strength": 0.0 }), &[("ratio", Value::Ratio(ratio.ratio()))]).unwrap();
    assert_eq!(bits(&put(graded.ratio())), bits(&without), "a shadow of no strength is none");
    let moved = json!({ "translate": [0.2, 0.0] });
    let moved = run("ratio_transform", moved, &[("ratio", Value::Ratio(ratio.ratio()))]).unwrap();
    let moved = put(moved.ratio());
    assert!(
        error(&moved, "Combined") > 0.05
            && compare::compare(moved.find("").unwrap(), without.find("").unwrap(), 640).unwrap().relative() > 0.05
    );
}
