//! What does not change from frame to frame is not computed again.

use super::*;
use chiaro::eval::CacheUse;
use std::collections::BTreeMap;

fn recipe(stage: &Stage) -> Plan {
    stage.plan(json!({
        "room": { "type": "scene", "params": { "file": "room.glb" } },
        "view": { "type": "view_samples", "params": { "width": 16, "height": 12 }, "inputs": { "scene": "room" } },
        "xfer": { "type": "transfer", "params": { "gather_samples": 64, "tolerance": 0.5 },
                  "inputs": { "scene": "room", "samples": "view" } },
        "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer" } },
    }))
}

/// What each node did at a second frame, after a first; nothing: nobody asked it.
fn second(glb: &Glb, frames: [i64; 2]) -> BTreeMap<String, CacheUse> {
    let stage = Stage::new(glb);
    let plan = recipe(&stage);
    let (_, report) = stage.run(&plan, "lit", frames[0]).unwrap();
    assert!(report.iter().all(|node| node.cache == CacheUse::Computed));
    let (_, report) = stage.run(&plan, "lit", frames[1]).unwrap();
    report.into_iter().map(|node| (node.node, node.cache)).collect()
}

#[test]
fn only_what_a_frame_changes_is_computed() {
    use CacheUse::{Computed, Memory};
    let slide = |node: usize| {
        let from = [[0.0, 0.0, 0.0], [0.0, 2.0, -2.0], [0.0, 1.5, 4.0], [0.0, 3.5, 1.0]][node];
        let to = [from[0] + 0.25, from[1], from[2]];
        Glb::room().animate("slide", node, "translation", 3, &[0.0, 1.0], &[from, to].concat())
    };
    let all = |uses: [Option<CacheUse>; 4]| -> BTreeMap<String, CacheUse> {
        let named = ["room", "view", "xfer", "lit"].into_iter().zip(uses);
        named.filter_map(|(name, what)| Some((name.to_owned(), what?))).collect()
    };
    let (new, old) = (Some(Computed), Some(Memory));
    let (wall, camera, lamp) = (slide(1), slide(2), slide(3));
    assert_eq!(second(&lamp, [1, 2]), all([new, None, old, new]), "a lamp moves");
    assert_eq!(second(&camera, [1, 2]), all([new, new, new, new]), "the camera moves");
    assert_eq!(second(&wall, [1, 2]), all([new, new, new, new]), "an object moves");
    // It is over: the last key holds.
    for glb in [&wall, &camera, &lamp] {
        assert_eq!(second(glb, [24, 30]), all([None, None, None, old]));
    }
    assert_eq!(second(&Glb::room(), [1, 2]), all([None, None, None, old]), "nothing moves");
}
