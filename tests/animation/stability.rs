//! How steady a keyframed edit is over time, in a scene of the real data: everything in it moves, and so does the camera.

use super::*;
use crate::support::all_data;
use std::path::Path;

/// 24 frames of the stage: the red wall sends three times its light to head and box at the last frame, as it is at the first.
fn recipe(file: &Path, size: [u32; 2]) -> Json {
    json!({
        "stage": { "type": "scene", "params": { "file": file } },
        "view": { "type": "view_samples", "params": { "width": size[0], "height": size[1] }, "inputs": { "scene": "stage" } },
        "xfer": { "type": "transfer", "params": { "gather_samples": 16384, "tolerance": 0.05 },
                  "inputs": { "scene": "stage", "samples": "view" } },
        "red": { "type": "pick", "params": { "materials": ["red"] }, "inputs": { "scene": "stage" } },
        "who": { "type": "pick", "params": { "objects": ["head", "box"] }, "inputs": { "scene": "stage" } },
        "bleed": { "type": "caster_receiver", "params": { "brightness": { "keys": [[1, 1.0], [24, 3.0]] } },
                   "inputs": { "caster": "red", "receiver": "who" } },
        "key": { "type": "scale_offset", "inputs": { "scene": "stage", "transfer": "xfer", "edits": "bleed" } },
        "keyed": { "type": "keyframe_edits", "params": { "frames": [1, 24] },
                   "inputs": { "scene": "stage", "transfer": "xfer", "a": "key", "b": "key" } },
        "lit": { "type": "relight", "inputs": { "scene": "stage", "transfer": "xfer", "edits": "keyed" } },
        "direct": { "type": "relight", "inputs": { "scene": "stage", "transfer": "xfer", "edits": "bleed" } },
        "plain": { "type": "relight", "inputs": { "scene": "stage", "transfer": "xfer" } },
    })
}

fn indirect(stage: &Stage, plan: &Plan, node: &str, frame: i64) -> Vec<f32> {
    let Value::Image(image) = stage.value(plan, node, frame) else { panic!("a picture") };
    image.layer("indirect").unwrap().data.to_vec()
}

/// Mean absolute second difference in time.
fn unrest(frames: &[Vec<f32>]) -> f64 {
    let differences = frames.windows(3).flat_map(|three| {
        let [a, b, c] = three else { unreachable!("windows of three") };
        a.iter().zip(b).zip(c).map(|((a, b), c)| f64::from(a - 2.0 * b + c).abs())
    });
    let (sum, count) = differences.fold((0.0, 0usize), |(sum, count), difference| (sum + difference, count + 1));
    sum / count as f64
}

#[test]
fn unrest_by_hand() {
    let frames = |values: [f32; 4]| values.map(|value| vec![value, 2.0 * value]);
    assert_eq!(unrest(&frames([1.0, 2.0, 3.0, 4.0])), 0.0, "what grows evenly is at rest");
    assert_eq!(unrest(&frames([0.0, 1.0, 0.0, 1.0])), 3.0);
}

#[test]
fn a_keyframed_edit_is_as_steady_as_the_light_that_it_edits() {
    let [file] = &all_data("a_keyframed_edit_is_as_steady", &["scenes/stage-anim.glb"])[..] else { return };
    let stage = Stage::new(&Glb::room());
    let plan = stage.plan(recipe(file, [160, 120]));
    let frames = |node: &str| (1..=24).map(|frame| indirect(&stage, &plan, node, frame)).collect::<Vec<_>>();
    let (plain, edited) = (frames("plain"), frames("lit"));
    let mean = |frames: &[Vec<f32>]| {
        frames.iter().flatten().map(|x| f64::from(*x)).sum::<f64>() / (24.0 * frames[0].len() as f64)
    };
    let ratio = unrest(&edited) / unrest(&plain);
    println!(
        "mean absolute second difference: {:.3e} edited, {:.3e} unedited, ratio {ratio:.3}; mean light {:.4} and {:.4}",
        unrest(&edited),
        unrest(&plain),
        mean(&edited),
        mean(&plain)
    );
    let anew = unrest(&frames("direct")) / unrest(&plain);
    println!("the same edit, evaluated anew at each frame: {anew:.3}");
    assert!(ratio < 1.005 * anew, "carrying adds {ratio} to {anew}");
    assert!(mean(&edited) > 1.01 * mean(&plain), "the edit is to be seen");
    assert!(ratio <= 1.1, "{ratio}");
    // An edit that flickers is found out: every second frame of it without.
    let mut flickering = edited.clone();
    (0..24).step_by(2).for_each(|frame| flickering[frame] = plain[frame].clone());
    let caught = unrest(&flickering) / unrest(&plain);
    println!("with every second frame unedited: {caught:.3}");
    assert!(caught > 1.1, "{caught}");
}
