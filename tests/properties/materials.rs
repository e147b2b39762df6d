//! Changed materials: what is computed again, and what the picture shows.

use crate::room::{OBJECTS, evaluate, evaluator, image, keyed, layer, pick, recipe};
use chiaro::eval::CacheUse;
use chiaro::graph::Plan;
use chiaro::value::Value;
use serde_json::{Value as Json, json};

/// The room with one lamp moved and then some materials changed, relit.
fn painted(params: Json, lamp: f32) -> Plan {
    recipe(json!({
        "key": { "type": "light", "params": { "name": "key", "intensity": lamp }, "inputs": { "scene": "room" } },
        "paint": { "type": "material", "params": params, "inputs": { "scene": "key" } },
        "view": { "type": "view_samples", "params": { "width": 48, "height": 36 }, "inputs": { "scene": "paint" } },
        "transport": {
            "type": "transfer", "params": { "gather_samples": 2048, "tolerance": 0.1 },
            "inputs": { "scene": "paint", "samples": "view" },
        },
        "red": pick(&["left_wall"]),
        "lit": { "type": "relight", "inputs": { "scene": "paint", "transfer": "transport" } },
    }))
}

#[test]
fn a_new_colour_costs_no_new_transfer_and_shows() {
    let evaluator = evaluator();
    let [before, after] = [json!({}), json!({ "materials": ["red"], "base_colour": [0.05, 0.6, 0.05] })]
        .map(|params| painted(params, 70.0));
    let [old, new] = [&before, &after].map(|plan| image(&evaluator, plan, "lit"));
    let (_, report) = evaluate(&evaluator, &after, "transport", 1);
    assert!(report.iter().all(|node| node.cache == CacheUse::Memory), "{report:?}");
    let Value::Samples(samples) = evaluate(&evaluator, &after, "view", 1).0 else { panic!("samples") };
    let [old_albedo, new_albedo] = [&old, &new].map(|image| layer(image, "albedo"));
    let wall = OBJECTS.iter().position(|name| *name == "left_wall").unwrap() as u32;
    for (pixel, point) in samples.points.iter().enumerate() {
        let at = |albedo: &[f32]| [0, 1, 2].map(|c| albedo[3 * pixel + c]);
        let expected = if point.object == wall { [0.05, 0.6, 0.05] } else { at(&old_albedo) };
        assert_eq!(at(&new_albedo), expected, "pixel {pixel}");
    }
    // The lit wall was the source of most indirect light.
    let sum = |image: &chiaro::image::Image, c: usize| layer(image, "indirect").iter().skip(c).step_by(3).sum::<f32>();
    assert!(sum(&new, 0) < 0.7 * sum(&old, 0) && sum(&new, 1) > 1.5 * sum(&old, 1), "it bleeds");
}

#[test]
fn materials_do_not_depend_on_lights() {
    let red = || json!({ "materials": ["red"], "roughness": 0.2 });
    let facets = |plan: &Plan| keyed(plan, "paint", 1).outputs[0];
    let [a, b] = [70.0, 80.0].map(|lamp| facets(&painted(red(), lamp)));
    assert_eq!((a[0], a[1], a[3]), (b[0], b[1], b[3]), "geometry, materials, cameras");
    assert_ne!(a[2], b[2], "lights");
    let other = facets(&painted(json!({ "materials": ["red"], "roughness": 0.3 }), 70.0));
    assert_eq!((a[0], a[2], a[3]), (other[0], other[2], other[3]), "geometry, lights, cameras");
    assert_ne!(a[1], other[1], "materials");
}

#[test]
fn a_surface_that_is_made_to_shine_lights_the_room() {
    let evaluator = evaluator();
    let dark = json!({ "materials": ["*"], "emission": [0, 0, 0] });
    let lamp = json!({ "materials": ["ochre"], "emission": [0.0, 2.0, 0.0] });
    let [dark, lit] = [dark, lamp].map(|params| image(&evaluator, &painted(params, 0.0), "lit"));
    assert!(layer(&dark, "").iter().skip(3).step_by(4).all(|alpha| *alpha > 0.0));
    assert_eq!(layer(&dark, "direct").iter().sum::<f32>(), 0.0, "no lamp, no panel");
    let green: f32 = layer(&lit, "direct").iter().skip(1).step_by(3).sum();
    let red: f32 = layer(&lit, "direct").iter().step_by(3).sum();
    assert!(green > 2.0 * red && red > 0.0, "green {green}; the panel gives red {red}");
}
