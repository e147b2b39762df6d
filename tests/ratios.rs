//! Ratios of shadows, as recipes use them: nodes run as the evaluator runs them, on made-up pictures and on the built-in
//! room. What is promised of all of them, what bad input gives, and where the method ends.

#[allow(dead_code)]
#[path = "support/node.rs"]
mod node;
#[allow(dead_code)]
#[path = "support/room.rs"]
mod room;

use chiaro::image::{Content, Image, Layer};
use chiaro::transport::Samples;
use chiaro::transport::shadow::Ratio;
use chiaro::value::Value;
use chiaro::{Error, Result};
use room::{OBJECTS, bits, close, evaluate, evaluator, image, layer, recipe, relight};
use serde_json::{Map, Value as Json, json};
use std::sync::Arc;

fn run(kind: &str, params: Json, inputs: &[(&str, Value)]) -> Result<(Value, Map<String, Json>)> {
    node::run(kind, params, inputs).map(|mut ran| (ran.values.swap_remove(0), ran.notes))
}

fn as_ratio(value: Value) -> Arc<Ratio> {
    match value {
        Value::Ratio(ratio) => ratio,
        other => panic!("{:?}", other.kind()),
    }
}

fn as_image(value: Value) -> Arc<Image> {
    match value {
        Value::Image(image) => image,
        other => panic!("{:?}", other.kind()),
    }
}

/// A node on a ratio, and perhaps on samples.
fn edit(kind: &str, params: Json, ratio: &Ratio, samples: Option<&Arc<Samples>>) -> Result<Ratio> {
    let mut inputs = vec![("ratio", Value::Ratio(Arc::new(ratio.clone())))];
    inputs.extend(samples.map(|samples| ("samples", Value::Samples(samples.clone()))));
    run(kind, params, &inputs).map(|(value, _)| (*as_ratio(value)).clone())
}

fn notes(kind: &str, params: Json, ratio: &Ratio) -> Map<String, Json> {
    run(kind, params, &[("ratio", Value::Ratio(Arc::new(ratio.clone())))]).unwrap().1
}

fn said(result: Result<impl Sized>) -> String {
    let error = result.err().expect("an error");
    assert!(matches!(error, Error::Compute { .. }) && !error.help().is_empty(), "{error}");
    format!("{error}; {}", error.help())
}

fn picture(width: usize, rgb: Vec<f32>) -> Image {
    let height = rgb.len() / 3 / width;
    let layers = vec![Layer::new("", &["R", "G", "B"], Content::Colour, rgb)];
    Image { width, height, layers, ..Image::default() }
}

fn divide(original: &Image, removed: &Image) -> Result<(Arc<Ratio>, Map<String, Json>)> {
    let [o, r] = [original, removed].map(|image| Value::Image(Arc::new(image.clone())));
    run("visibility_ratio", json!({}), &[("original", o), ("removed", r)])
        .map(|(value, notes)| (as_ratio(value), notes))
}

fn synthesize(image: &Image, ratio: &Ratio, params: Json) -> Result<(Arc<Image>, Map<String, Json>)> {
    let inputs = [("image", Value::Image(Arc::new(image.clone()))), ("ratio", Value::Ratio(Arc::new(ratio.clone())))];
    run("synthesize_shadow", params, &inputs).map(|(value, notes)| (as_image(value), notes))
}

fn grey(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Ratio {
    let values: Vec<[f32; 4]> = (0..width * height)
        .map(|i| {
            let v = value(i % width, i / width);
            [v, v, v, 1.0]
        })
        .collect();
    Ratio { width, height, values: values.into(), ..Ratio::default() }
}

/// A soft round shadow in the middle.
fn blob(width: usize, height: usize) -> Ratio {
    grey(width, height, |x, y| {
        let (dx, dy) = (x as f32 - 0.5 * width as f32, y as f32 - 0.5 * height as f32);
        1.0 - 0.9 * (-(dx * dx + dy * dy) / (0.02 * (width * height) as f32)).exp()
    })
}

/// The room with a lamp and without; and what it is seen through.
struct Room {
    with: Arc<Image>,
    without: Arc<Image>,
    view: Arc<Samples>,
}

fn room() -> Room {
    let plan = recipe(json!({
        "lamp": {
            "type": "light", "params": { "name": "low", "kind": "directional", "direction": [-0.75, -0.55, -0.6], "intensity": 4.0 },
            "inputs": { "scene": "room" }
        },
        "without": relight(None),
        "with": { "type": "relight", "inputs": { "scene": "lamp", "transfer": "transport" } },
    }));
    let evaluator = evaluator();
    let Value::Samples(view) = evaluate(&evaluator, &plan, "view", 1).0 else { panic!("samples") };
    Room { with: image(&evaluator, &plan, "with"), without: image(&evaluator, &plan, "without"), view }
}

/// Every node that edits a ratio, with parameters that do something.
fn edits() -> Vec<(&'static str, Json)> {
    vec![
        ("ratio_transform", json!({ "translate": [0.1, 0.05], "rotate": 20.0, "scale": [0.5, 1.3] })),
        ("ratio_transform", json!({ "space": "uv", "corners": [[0.2, 0.1], [0.9, 0.0], [1.0, 1.0], [0.0, 0.8]] })),
        (
            "ratio_lattice",
            json!({ "rows": 1, "columns": 1, "points": [[0.1, 0.2], [1.0, 0.0], [1.4, 1.0], [0.0, 0.9]] }),
        ),
        ("ratio_blur", json!({ "radius": 0.1 })),
        (
            "ratio_grade",
            json!({ "strength": 1.5, "hue": 30.0, "saturation": 2.0, "brightness": 0.5, "tint": [0.1, 0.0, 0.9] }),
        ),
        ("ratio_pattern", json!({ "shape": "dots", "scale": 0.2, "angle": 20.0 })),
        ("ratio_pattern", json!({ "shape": "checker", "scale": 0.01 })),
    ]
}

#[test]
fn removing_and_synthesising_gives_the_original_back() {
    let Room { with, without, .. } = room();
    let (ratio, notes) = divide(&without, &with).unwrap();
    assert_eq!(notes["layer"], "direct");
    let (back, _) = synthesize(&with, &ratio, json!({})).unwrap();
    close(&layer(&back, "direct"), &layer(&without, "direct"), 1e-7, 1e-6);
    assert!(ratio.values.iter().filter(|v| v[0] < 0.5).count() > 100, "there is a shadow to speak of");
    // And the other way round, where removal darkens.
    let (ratio, _) = divide(&with, &without).unwrap();
    assert!(ratio.values.iter().any(|v| v[0] > 1.5));
    let (back, _) = synthesize(&without, &ratio, json!({})).unwrap();
    let (found, expected) = (layer(&back, "direct"), layer(&with, "direct"));
    let dark = layer(&without, "direct");
    let off = (0..found.len()).filter(|i| dark[*i] > 1e-4 && (found[*i] - expected[*i]).abs() > 1e-6 * expected[*i]);
    assert_eq!(off.count(), 0);
}

#[test]
fn a_picture_over_itself_is_one_and_changes_nothing() {
    let Room { with, .. } = room();
    let (ratio, _) = divide(&with, &with).unwrap();
    assert!(ratio.values.iter().all(|v| v[..3] == [1.0; 3]));
    assert_eq!(bits(&synthesize(&with, &ratio, json!({})).unwrap().0), bits(&with));
}

#[test]
fn direct_and_indirect_light_still_add_up_and_nothing_else_changes() {
    let Room { with, without, .. } = room();
    let (ratio, _) = divide(&without, &with).unwrap();
    let (shaded, _) = synthesize(&with, &ratio, json!({})).unwrap();
    for name in ["indirect", "albedo", "P", "N", "Z"] {
        assert_eq!(layer(&shaded, name), layer(&with, name), "{name}");
    }
    let [beauty, direct, indirect] = ["", "direct", "indirect"].map(|name| layer(&shaded, name));
    let before = layer(&with, "");
    let mut changed = 0;
    for i in 0..ratio.values.len() {
        assert_eq!(beauty[4 * i + 3], before[4 * i + 3], "alpha");
        for c in 0..3 {
            let sum = direct[3 * i + c] + indirect[3 * i + c];
            assert!((beauty[4 * i + c] - sum).abs() <= 2e-6 * (1.0 + before[4 * i + c]));
            let same = beauty[4 * i + c].to_bits() == before[4 * i + c].to_bits();
            assert!(same || ratio.values[i][c] != 1.0, "a change without a shadow");
            changed += usize::from(!same);
        }
    }
    assert!(changed > 300);
    // A beauty named alone is multiplied as a whole.
    let (whole, _) = synthesize(&with, &ratio, json!({ "layers": ["beauty"] })).unwrap();
    assert_eq!(layer(&whole, "direct"), layer(&with, "direct"));
    assert_eq!(layer(&whole, "")[400], before[400] * ratio.values[100][0]);
}

#[test]
fn ratios_of_parts_multiply_back() {
    let light = |k: usize, i: usize| 0.2 + ((i * 7919 + k * 104729) % 1000) as f32 / 300.0;
    let pictures: Vec<Image> = (0..6).map(|k| picture(20, (0..20 * 15 * 3).map(|i| light(k, i)).collect())).collect();
    let mut back = pictures[5].clone();
    for pair in pictures.windows(2).rev() {
        back = (*synthesize(&back, &divide(&pair[0], &pair[1]).unwrap().0, json!({})).unwrap().0).clone();
    }
    close(&layer(&back, ""), &layer(&pictures[0], ""), 0.0, 1e-5);
}

#[test]
fn where_there_is_no_shadow_none_appears() {
    let none = grey(48, 36, |_, _| 1.0);
    let view = room().view;
    for (kind, params) in edits() {
        for samples in [None, Some(&view)] {
            if samples.is_some() && !["ratio_blur", "ratio_pattern"].contains(&kind) {
                continue;
            }
            let after = edit(kind, params.clone(), &none, samples).unwrap();
            assert!(after.values.iter().all(|v| v[..3] == [1.0; 3]), "{kind} {params}");
        }
    }
}

/// Run although it would be passed by.
#[test]
fn what_changes_nothing_changes_no_bit() {
    let ratio = blob(64, 48);
    let rest = [[0.0, 0.0], [2.0 / 3.0, 0.0], [4.0 / 3.0, 0.0], [0.0, 1.0], [2.0 / 3.0, 1.0], [4.0 / 3.0, 1.0]];
    let size = 4.0 / 3.0;
    for (kind, params) in [
        ("ratio_transform", json!({})),
        ("ratio_transform", json!({ "rotate": 360.0, "pivot": [0.3, 0.9] })),
        ("ratio_transform", json!({ "corners": [[0.0, 0.0], [size, 0.0], [size, 1.0], [0.0, 1.0]] })),
        ("ratio_lattice", json!({ "rows": 1, "columns": 2, "points": rest })),
        ("ratio_blur", json!({ "radius": 0.0 })),
        ("ratio_grade", json!({})),
        ("ratio_pattern", json!({ "strength": 0.0 })),
    ] {
        assert_eq!(edit(kind, params.clone(), &ratio, None).unwrap().values[..], ratio.values[..], "{kind} {params}");
    }
}

#[test]
fn strength_nought_is_no_shadow() {
    let ratio = grey(16, 12, |x, y| [0.0, 0.3, 1.0, 7.0, -0.5][(x + y) % 5]);
    let none = edit("ratio_grade", json!({ "strength": 0.0 }), &ratio, None).unwrap();
    assert!(none.values.iter().all(|v| v[..3] == [1.0; 3]));
}

#[test]
fn there_and_back() {
    let ratio = blob(96, 72);
    let moved = |ratio: &Ratio, x: f64, y: f64| {
        edit("ratio_transform", json!({ "translate": [x / 72.0, y / 72.0] }), ratio, None).unwrap()
    };
    // Whole pixels: to the bit, but for what left the picture.
    let back = moved(&moved(&ratio, 7.0, -4.0), -7.0, 4.0);
    for (i, (found, expected)) in back.values.iter().zip(&ratio.values).enumerate() {
        if i % 96 < 96 - 7 && i / 96 >= 4 {
            assert_eq!(found, expected, "pixel {i}");
        }
    }
    // Parts of pixels: two bilinear look-ups blur by at most a quarter of the second differences of each axis.
    let back = moved(&moved(&ratio, 7.3, -4.6), -7.3, 4.6);
    let off =
        (0..96 * 72).filter(|i| i % 96 < 86 && i / 96 > 6).map(|i| (back.values[i][0] - ratio.values[i][0]).abs());
    let worst = off.fold(0.0, f32::max);
    assert!((1e-5..0.006).contains(&worst), "off by {worst}");
}

/// The mean of a fine pattern, without moire, at any size below a half.
#[test]
fn what_is_made_smaller_is_averaged() {
    let fine = grey(400, 300, |x, y| ((x + y) % 2) as f32);
    for scale in [0.45, 0.31, 0.1, 0.04] {
        let small = edit("ratio_transform", json!({ "scale": [scale, scale] }), &fine, None).unwrap();
        let (w, h) = (400.0 * scale, 300.0 * scale);
        let inside = |i: usize| {
            let (x, y) = ((i % 400) as f32 - 200.0, (i / 400) as f32 - 150.0);
            x.abs() < 0.5 * w - 3.0 && y.abs() < 0.5 * h - 3.0
        };
        let found: Vec<f32> = (0..400 * 300).filter(|i| inside(*i)).map(|i| small.values[i][0]).collect();
        let worst = found.iter().map(|v| (v - 0.5).abs()).fold(0.0, f32::max);
        assert!(!found.is_empty() && worst < 0.13, "{scale}: off by {worst}");
    }
}

/// A shadow on the block alone: blurred on the screen it leaks over the silhouette, along surfaces it does not.
#[test]
fn a_blur_stays_on_its_surface() {
    let view = room().view;
    let block = OBJECTS.iter().position(|name| *name == "block").unwrap() as u32;
    let ratio = grey(48, 36, |x, y| if view.points[y * 48 + x].object == block { 0.2 } else { 1.0 });
    let blur = |samples| edit("ratio_blur", json!({ "radius": 0.08 }), &ratio, samples).unwrap();
    assert!(blur(None).values.iter().zip(&ratio.values).filter(|(a, b)| b[0] == 1.0 && a[0] < 0.99).count() > 50);
    let kept = blur(Some(&view));
    let leaks = |i: &usize| view.points[*i].object != block && kept.values[*i][0] != 1.0;
    assert_eq!((0..48 * 36).filter(leaks).count(), 0);
    let flat = |i: &usize| view.points[*i].object == block && (kept.values[*i][0] - 0.2).abs() > 1e-6;
    assert_eq!((0..48 * 36).filter(flat).count(), 0, "even on the block, as before");
    // It does blur within: left and right half of the floor.
    let halves = grey(48, 36, |x, _| if x < 24 { 0.0 } else { 1.0 });
    let soft = edit("ratio_blur", json!({ "radius": 0.08 }), &halves, Some(&view)).unwrap();
    let floor = (0..48 * 36).filter(|i| view.points[*i].object == 0 && (0.2..0.8).contains(&soft.values[*i][0]));
    assert!(floor.count() > 10);
}

#[test]
fn a_blur_is_linear() {
    let (a, b) = (blob(40, 30), grey(40, 30, |x, y| ((x * 13 + y * 7) % 11) as f32 / 10.0));
    let sum = grey(40, 30, |x, y| 0.3 * a.values[y * 40 + x][0] + 2.0 * b.values[y * 40 + x][0]);
    let blur = |ratio: &Ratio| edit("ratio_blur", json!({ "radius": 0.07 }), ratio, None).unwrap();
    let (a, b, sum) = (blur(&a), blur(&b), blur(&sum));
    for i in 0..1200 {
        assert!((sum.values[i][0] - 0.3 * a.values[i][0] - 2.0 * b.values[i][0]).abs() < 2e-6);
    }
}

/// Stripes of millimetres on the room's surfaces: pixels see their mean and nothing else, and the report says so.
#[test]
fn patterns_fade_to_their_mean_where_pixels_are_large() {
    let view = room().view;
    let shade = grey(48, 36, |_, _| 0.2);
    for shape in ["stripes", "checker", "dots"] {
        let fill = 0.5;
        let cut = |scale: f64| {
            let params = json!({ "shape": shape, "scale": scale, "angle": 25.0, "fill": fill });
            let inputs = [("ratio", Value::Ratio(Arc::new(shade.clone()))), ("samples", Value::Samples(view.clone()))];
            let (value, notes) = run("ratio_pattern", params, &inputs).unwrap();
            (as_ratio(value), notes)
        };
        let (fine, notes) = cut(0.002);
        let mean = 0.2 + 0.8 * 0.5;
        let seen = |i: &usize| view.points[*i].exists();
        assert!((0..48 * 36).filter(seen).all(|i| (fine.values[i][0] - mean).abs() < 2e-3), "{shape}");
        assert!(notes["faded"].as_f64().unwrap() > 0.99);
        let (coarse, notes) = cut(1.0);
        assert!(notes["faded"].as_f64().unwrap() < 0.3);
        let lit = coarse.values.iter().filter(|v| v[0] > 0.9).count();
        assert!((200..1500).contains(&lit), "{shape}: {lit} pixels are lit");
    }
}

#[test]
fn a_folded_lattice_shows_its_last_cell_and_says_so() {
    let ratio = blob(40, 30);
    let points = json!([[0.0, 0.0], [1.0, 0.0], [0.4, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 1.0]]);
    let params = json!({ "rows": 1, "columns": 2, "points": points });
    let notes = notes("ratio_lattice", params.clone(), &ratio);
    assert_eq!(notes["folded_cells"], 1);
    assert_eq!(notes["doubled_pixels"], 18 * 30);
    let bent = edit("ratio_lattice", params, &ratio, None).unwrap();
    assert!(bent.values.iter().all(|v| v[0].is_finite() && (0.0..=1.0).contains(&v[0])));
    assert!(bent.values.iter().skip(31).step_by(40).all(|v| v[0] == 1.0), "what was left bare has no shadow");
}

#[test]
fn wrong_input_is_named() {
    let ratio = blob(40, 30);
    let view = room().view;
    let (small, large) = (picture(2, vec![1.0; 6]), picture(3, vec![1.0; 9]));
    let message = said(divide(&small, &large));
    assert!(message.contains("original has 2 x 1") && message.contains("removed has 3 x 1"), "{message}");
    let message = said(synthesize(&small, &ratio, json!({})));
    assert!(message.contains("40 x 30") && message.contains("2 x 1"), "{message}");
    let depth = Layer::new("Z", &["Z"], Content::Data, vec![1.0; 2]);
    let deep = Image { layers: vec![depth], ..small.clone() };
    let two = grey(2, 1, |_, _| 0.5);
    assert!(said(synthesize(&deep, &two, json!({}))).contains("found Z"));
    assert!(said(synthesize(&deep, &two, json!({ "layers": ["Z"] }))).contains("not R G B"));
    assert!(said(synthesize(&small, &two, json!({ "layers": ["dirct"] }))).contains("dirct"));
    for (kind, params, word) in [
        ("ratio_transform", json!({ "scale": [0.0, 1.0] }), "scale of 0"),
        ("ratio_transform", json!({ "corners": [[0, 0], [1, 1], [1, 0], [0, 1]] }), "crossed over"),
        ("ratio_transform", json!({ "corners": [[0, 0], [1, 0], [2, 0], [0, 1]] }), "in one line"),
        ("ratio_lattice", json!({ "points": [[0, 0]] }), "20 in all"),
        ("ratio_lattice", json!({ "rows": 65, "points": [[0, 0]] }), "65"),
        ("ratio_lattice", json!({ "rows": 1, "columns": 1, "points": [[0, 0], [1, 0], [1, 1e9], [0, 1]] }), "point 2"),
        ("ratio_blur", json!({ "radius": -0.1 }), "radius"),
        ("ratio_grade", json!({ "strength": -1.0 }), "strength is -1"),
        ("ratio_grade", json!({ "tint": [0, 2, 0] }), "tint is 2"),
        ("ratio_grade", json!({ "strength": 0.0, "gradient": { "from": [1, 1], "to": [1, 1] } }), "gradient is 0"),
        ("ratio_pattern", json!({ "scale": 0.0 }), "scale is 0"),
        ("ratio_pattern", json!({ "scale": -1.0 }), "scale is -1"),
        ("ratio_pattern", json!({ "shape": "image" }), "connect a picture"),
        ("ratio_pattern", json!({ "fill": 1.5 }), "fill is 1.5"),
    ] {
        let message = said(edit(kind, params.clone(), &ratio, None));
        assert!(message.contains(word), "{kind} {params}: {message}");
    }
    for kind in ["ratio_blur", "ratio_pattern"] {
        let message = said(edit(
            kind,
            json!({ if kind == "ratio_blur" { "radius" } else { "scale" }: 0.1 }),
            &ratio,
            Some(&view),
        ));
        assert!(message.contains("40 x 30") && message.contains("48 x 36"), "{message}");
    }
    let direction = json!({ "direction": [0, 0, 0] });
    assert!(said(edit("ratio_pattern", direction, &grey(48, 36, |_, _| 0.5), Some(&view))).contains("direction"));
}

#[test]
fn what_is_not_finite_is_counted_and_stays_in_its_pixel() {
    let mut light = vec![1.0; 12];
    light[4] = f32::NAN;
    light[9] = f32::INFINITY;
    let (bad, good) = (picture(4, light), picture(4, vec![2.0; 12]));
    let (ratio, notes) = divide(&bad, &good).unwrap();
    assert_eq!(notes["not_finite"], 2);
    assert_eq!(ratio.values.iter().map(|v| v[0]).collect::<Vec<_>>(), [0.5, 1.0, 0.5, 1.0]);
    let (ratio, _) = divide(&good, &bad).unwrap();
    assert_eq!(ratio.values.iter().map(|v| v[0]).collect::<Vec<_>>(), [2.0, 1.0, 2.0, 1.0]);
    let (shaded, notes) = synthesize(&bad, &ratio, json!({})).unwrap();
    assert_eq!(notes["not_finite"], 2);
    assert_eq!(layer(&shaded, "").iter().filter(|x| !x.is_finite()).count(), 2);
    for (kind, params) in edits() {
        let after = edit(kind, params, &ratio, None).unwrap();
        assert!(after.values.as_flattened().iter().all(|x| x.is_finite()), "{kind}");
    }
}

#[test]
fn in_the_dark_and_in_glaring_light_all_stays_finite() {
    let (dark, lit) = (picture(3, vec![0.0; 9]), picture(3, vec![1.0; 9]));
    for original in [&dark, &lit] {
        let (ratio, notes) = divide(original, &dark).unwrap();
        assert_eq!(notes["undefined"], 3);
        assert_eq!(ratio.values[..], [[1.0, 1.0, 1.0, 0.0]; 3]);
    }
    let (glare, faint) =
        (picture(3, vec![3e38; 9]), picture(3, vec![1e-38, 1.0, 3e38, 1e-20, 1e-3, 0.0, 1.0, 2.0, 3.0]));
    for (a, b) in [(&glare, &faint), (&faint, &glare), (&glare, &dark)] {
        let (ratio, _) = divide(a, b).unwrap();
        for (kind, params) in edits() {
            let after = edit(kind, params.clone(), &ratio, None).unwrap();
            assert!(after.values.as_flattened().iter().all(|x| x.is_finite()), "{kind} {params}: {:?}", after.values);
            let (shaded, _) = synthesize(&glare, &after, json!({})).unwrap();
            assert!(layer(&shaded, "").iter().all(|x| x.is_finite()), "{kind}");
        }
    }
}

#[test]
fn one_pixel_is_enough() {
    let ratio = grey(1, 1, |_, _| 0.25);
    for (kind, params) in edits() {
        let after = edit(kind, params, &ratio, None).unwrap();
        assert!(after.values.len() == 1 && after.values[0].iter().all(|x| x.is_finite()), "{kind}");
    }
    assert_eq!(edit("ratio_blur", json!({ "radius": 1.0 }), &ratio, None).unwrap().values[..], ratio.values[..]);
}

#[test]
fn threads_change_no_bit() {
    let (ratio, view) = (grey(48, 36, |x, y| ((x * 31 + y * 17) % 23) as f32 / 20.0), room().view);
    let all = || -> Vec<Ratio> {
        let plain = edits().into_iter().map(|(kind, params)| edit(kind, params, &ratio, None).unwrap());
        let laid = [("ratio_blur", json!({ "radius": 0.1 })), ("ratio_pattern", json!({}))];
        plain.chain(laid.map(|(kind, params)| edit(kind, params, &ratio, Some(&view)).unwrap())).collect()
    };
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    for (one, many) in pool(1).install(all).iter().zip(&pool(5).install(all)) {
        assert_eq!(one.values[..], many.values[..]);
    }
}

#[test]
fn edges_are_smooth_and_the_rest_is_as_it_was() {
    let plan = recipe(json!({
        "lit": relight(None),
        "fine": { "type": "view_samples", "params": { "width": 48, "height": 36, "samples_per_pixel": 4 }, "inputs": { "scene": "room" } },
        "twice": { "type": "view_samples", "params": { "width": 96, "height": 72 }, "inputs": { "scene": "room" } },
        "other": { "type": "view_samples", "params": { "width": 40, "height": 72 }, "inputs": { "scene": "room" } },
        "a": { "type": "antialias", "inputs": { "image": "lit", "samples": "fine" } },
        "b": { "type": "antialias", "inputs": { "image": "lit", "samples": "twice" } },
        "c": { "type": "antialias", "inputs": { "image": "lit", "samples": "twice", "view": "view" } },
    }));
    let evaluator = evaluator();
    let [lit, a, b, c] = ["lit", "a", "b", "c"].map(|node| image(&evaluator, &plan, node));
    assert_eq!(bits(&a), bits(&b));
    for name in ["P", "N", "Z"] {
        assert_eq!(layer(&a, name), layer(&lit, name), "{name}");
    }
    // Of one colour over each object: what changes lies at a border, and between the colours on either side.
    for smooth in [&a, &c] {
        let (before, after) = (layer(&lit, "albedo"), layer(smooth, "albedo"));
        let changed = (0..48 * 36).filter(|i| before[3 * i..][..3] != after[3 * i..][..3]).count();
        assert!((60..700).contains(&changed), "{changed} pixels");
        assert!(layer(smooth, "").iter().skip(3).step_by(4).all(|alpha| *alpha == 1.0));
    }
    let Value::Samples(other) = evaluate(&evaluator, &plan, "other", 1).0 else { panic!("samples") };
    let inputs = [("image", Value::Image(lit.clone())), ("samples", Value::Samples(other))];
    let message = said(run("antialias", json!({}), &inputs));
    assert!(message.contains("48 x 36") && message.contains("40 x 72") && message.contains("96 x 72"), "{message}");
    let Value::Samples(fine) = evaluate(&evaluator, &plan, "fine", 1).0 else { panic!("samples") };
    let bare = Image { layers: lit.layers[..1].to_vec(), ..(*lit).clone() };
    let inputs = [("image", Value::Image(Arc::new(bare))), ("samples", Value::Samples(fine))];
    assert!(said(run("antialias", json!({}), &inputs)).contains("no layer P"));
}
