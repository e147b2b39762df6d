//! Light that source brushes touch travels apart from all other light: together they are what one sum would be.

use crate::edits::{Step, listed};
use crate::room::{close, evaluator, image, layer, relative_rms};
use chiaro::eval::Evaluator;
use serde_json::{Value as Json, json};

/// The indirect light.
fn after(evaluator: &Evaluator, steps: &[Step]) -> Vec<f32> {
    layer(&image(evaluator, &listed(steps, json!({})), "lit"), "indirect")
}

fn brush(params: Json, selection: &str) -> Step {
    ("source_brush", params, json!({ "selection": selection }))
}

/// Touches all light, so that it stays in one part.
fn everywhere(params: Json) -> Step {
    ("source_brush", params, json!({}))
}

#[test]
fn a_brush_that_takes_all_is_a_caster_without_light() {
    let evaluator = evaluator();
    let plain = after(&evaluator, &[]);
    for caster in ["red", "block", "walls", "soft_red"] {
        let brushed = after(&evaluator, &[brush(json!({ "scale": 0.0 }), caster)]);
        let removed = ("caster_receiver", json!({ "brightness": 0.0 }), json!({ "caster": caster }));
        close(&brushed, &after(&evaluator, &[removed]), 1e-6, 1e-5);
        assert!(relative_rms(&brushed, &plain) > 0.01, "{caster} sends no light");
    }
}

#[test]
fn an_offset_is_light_of_its_own() {
    let evaluator = evaluator();
    let plain = after(&evaluator, &[]);
    for selection in ["red", "block", "soft_red"] {
        let glow = brush(json!({ "offset": [0.5, 0.25, 0.125] }), selection);
        let alone = after(&evaluator, &[everywhere(json!({ "scale": 0.0 })), glow.clone()]);
        assert!(alone.iter().sum::<f32>() > 1.0, "{selection} does not glow");
        let sum: Vec<f32> = plain.iter().zip(&alone).map(|(a, b)| a + b).collect();
        close(&after(&evaluator, &[glow]), &sum, 1e-6, 1e-5);
    }
}

/// Brushes that cut across the casters of other edits, these with soft receivers, in the way of each other, and curved.
#[test]
fn parts_of_the_light_add_up_through_all_edits() {
    let evaluator = evaluator();
    let both = |caster: &str, receiver: &str| json!({ "caster": caster, "receiver": receiver });
    let curve = json!({ "curve": { "gamma": { "gamma": 1.6, "pivot": 0.3 } } });
    let others: Vec<Step> = vec![
        ("caster_receiver", json!({ "brightness": 3.0, "hue": 40.0 }), both("red", "soft")),
        ("falloff", json!({ "exponent": 1.2, "distance": 1.5 }), json!({ "caster": "teal" })),
        ("caster_receiver", curve, both("red", "floor")),
        ("directionality", json!({ "amount": 0.7, "axis": [-1.0, 0.5, 0.2] }), json!({ "receiver": "softer" })),
        ("indirect_shadow", json!({ "amount": 0.6 }), both("walls", "floor")),
        ("illumination_brush", json!({ "scale": 1.5, "saturation": 0.5 }), json!({ "selection": "ball" })),
    ];
    let brushes = [
        vec![brush(json!({ "scale": 2.5 }), "red")],
        vec![brush(json!({ "scale": 0.2, "offset": [0.3, 0.1, 0.6] }), "walls")],
        vec![brush(json!({ "offset": [0.4, 0.4, 0.1] }), "soft_red"), brush(json!({ "scale": 3.0 }), "block")],
    ];
    for brushes in brushes {
        for count in [0, 1, 3, others.len()] {
            let plain = after(&evaluator, &others[..count]);
            let steps = [&brushes[..], &others[..count]].concat();
            let parted = after(&evaluator, &steps);
            // Times 2 and times 1/2 round nothing.
            let all = [everywhere(json!({ "scale": 2.0 })), everywhere(json!({ "scale": 0.5 }))];
            let whole = after(&evaluator, &[&steps[..], &all[..]].concat());
            assert!(relative_rms(&parted, &plain) > 0.01, "{brushes:?} do nothing before {count} edits");
            close(&parted, &whole, 2e-6, 2e-5);
        }
    }
}

#[test]
fn a_brush_that_touches_nothing_changes_no_bit() {
    let evaluator = evaluator();
    let nothing = brush(json!({ "scale": 5.0, "offset": [1.0, 1.0, 1.0] }), "nothing");
    assert_eq!(after(&evaluator, &[nothing]), after(&evaluator, &[]));
}
