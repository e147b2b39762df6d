//! Sampled edits in the built-in room: they do to light what their definition says, and refuse what they are not for.

#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/room.rs"]
mod room;
#[path = "support/sampled.rs"]
mod sampled;

use chiaro::device::{Choice, Device};
use chiaro::kernels::{average_pyramid, haar_decode};
use chiaro::scene::Geometry;
use chiaro::transport::sampled::apply::{Plan, Slots, irradiance};
use chiaro::transport::sampled::{Parts, UNTOUCHED, Vectors};
use chiaro::transport::{Edit, Edits, Sampled, SparseRows, Transfer};
use chiaro::value::Value;
use glam::{Vec3, Vec4};
use sampled::{dense_rows, everything, random, untouched};
use serde_json::{Value as Json, json};
use std::sync::Arc;

fn made(more: Json) -> (Arc<Geometry>, Arc<Transfer>) {
    let (evaluator, plan) = (room::evaluator(), room::recipe(more));
    let (Value::Scene(scene), _) = room::evaluate(&evaluator, &plan, "room", 1) else { panic!("a scene") };
    let (Value::Transfer(transfer), _) = room::evaluate(&evaluator, &plan, "transport", 1) else {
        panic!("a transfer")
    };
    (scene.geometry.clone(), transfer)
}

fn light(count: usize, seed: u32) -> Vec<[f32; 4]> {
    let value = |i: u32| 0.2 + random(seed ^ hash4(i));
    (0..count as u32).map(|i| [value(4 * i), value(4 * i + 1), value(4 * i + 2), 1.0]).collect()
}

fn hash4(i: u32) -> u32 {
    i.wrapping_mul(0x9e37_79b9)
}

fn flat(light: &[[f32; 4]]) -> Vec<f32> {
    light.iter().flat_map(|x| x[..3].to_vec()).collect()
}

fn apply(device: &Device, transfer: &Transfer, sampled: &Sampled, light: &[[f32; 4]], count: usize) -> Vec<[f32; 4]> {
    let plan = Plan::new(&Slots::diffuse(sampled, transfer), transfer).unwrap();
    irradiance(device, transfer, sampled, &plan, light, count).unwrap()
}

/// The field of row `row`, as a pyramid.
fn decoded(rows: &SparseRows, row: usize) -> Vec<[f32; 4]> {
    let mut coefficients = vec![[0.0; 4]; rows.columns()];
    let mut put = |c: usize| rows.row(3 * row + c).for_each(|(index, value)| coefficients[index][c] = value);
    (0..3).for_each(&mut put);
    average_pyramid(&Device::Cpu, &haar_decode(&coefficients).unwrap(), 1).unwrap()
}

/// The definition, in double precision.
fn reference(transfer: &Transfer, sampled: &Sampled, light: &[[f32; 4]]) -> Vec<[f64; 3]> {
    let pyramid = average_pyramid(&Device::Cpu, light, 1).unwrap();
    let scales: Vec<_> = (0..sampled.rows()).map(|row| decoded(&sampled.scales, row)).collect();
    let offsets: Vec<_> =
        sampled.offsets.iter().flat_map(|rows| (0..sampled.rows()).map(|row| decoded(rows, row))).collect();
    let one = |v: usize| {
        let slot = sampled.touched.binary_search(&(v as u32)).ok();
        let mut sum = [0.0f64; 3];
        for j in 0..4 {
            let (row, weight) = (transfer.indices[v][j] as usize, transfer.weights[v][j]);
            let scale = slot.map(|i| (sampled.slots[i][j], sampled.weights[i][j])).filter(|s| s.0 != UNTOUCHED);
            for c in 0..3 {
                for (node, t) in transfer.rows.row(row) {
                    let factor = scale.map_or(0.0, |(scale, weight)| {
                        f64::from(weight) * f64::from(scales[scale as usize][node.max(1)][c])
                    });
                    sum[c] += f64::from(t) * (f64::from(weight) + factor) * f64::from(pyramid[node][c]);
                }
                if let Some((scale, weight)) = scale.filter(|_| !offsets.is_empty()) {
                    let leaves = &offsets[scale as usize][light.len()..];
                    let product = leaves.iter().zip(light).map(|(o, b)| f64::from(o[c]) * f64::from(b[c]));
                    sum[c] += f64::from(weight) * product.sum::<f64>();
                }
            }
        }
        sum
    };
    (0..transfer.indices.len()).map(one).collect()
}

#[test]
fn light_becomes_what_the_definition_says() {
    let (geometry, transfer) = made(json!({}));
    let parts = everything(&geometry, &transfer);
    for offsets in [true, false] {
        let parts = Parts { offsets: parts.offsets.clone().filter(|_| offsets), ..parts.clone() };
        let sampled = Sampled::new(parts).unwrap();
        sampled.check(&geometry, &transfer).unwrap();
        let lights: Vec<_> = [1, 2, 3].map(|seed| light(2048, seed)).concat();
        let arrives = apply(&Device::Cpu, &transfer, &sampled, &lights, 3);
        let plain = transfer.apply(&Device::Cpu, &lights, 3).unwrap();
        let view = transfer.indices.len();
        for (k, light) in lights.chunks(2048).enumerate() {
            let expected = reference(&transfer, &sampled, light);
            let mut changed = 0;
            for (v, expected) in expected.iter().enumerate() {
                let (found, plain) = (arrives[k * view + v], plain[k * view + v]);
                for c in 0..3 {
                    let off = (f64::from(found[c]) - expected[c]).abs();
                    assert!(off <= 1e-5 * (1.0 + expected[c].abs()), "sample {v}.{c}: {found:?} {expected:?}");
                }
                if sampled.touched.binary_search(&(v as u32)).is_err() {
                    assert_eq!(found, plain, "sample {v} is not touched");
                } else {
                    changed += usize::from(found != plain);
                }
            }
            assert!(changed > view / 3, "{changed} of {view} changed");
        }
    }
}

/// Light of one caster doubled: in a matrix of scales, and at its source.
#[test]
fn a_caster_in_the_matrix_is_that_caster_at_its_source() {
    let (geometry, transfer) = made(json!({}));
    let red = geometry.objects.iter().position(|name| name == "left_wall").unwrap() as u32;
    let inside = |sample: usize| transfer.gather.points[sample].object == red;
    let factor = Vec3::new(1.0, -0.5, 3.0);
    let view = transfer.indices.len();
    let sampled = Sampled::new(Parts {
        touched: (0..view as u32).collect::<Vec<_>>().into(),
        slots: vec![[0; 4]; view].into(),
        weights: transfer.weights.clone(),
        scales: dense_rows(2048, 1, |_, sample| if inside(sample) { factor } else { Vec3::ZERO }),
        ..untouched(&geometry, &transfer)
    })
    .unwrap();
    let light = light(2048, 7);
    let scaled: Vec<[f32; 4]> = light
        .iter()
        .enumerate()
        .map(|(i, b)| if inside(i) { (Vec4::from_array(*b) * (factor.extend(0.0) + 1.0)).to_array() } else { *b })
        .collect();
    let expected = transfer.apply(&Device::Cpu, &scaled, 1).unwrap();
    let found = apply(&Device::Cpu, &transfer, &sampled, &light, 1);
    assert!(room::relative_rms(&flat(&found), &flat(&expected)) < 1e-4);
    let before = transfer.apply(&Device::Cpu, &light, 1).unwrap();
    assert!(room::relative_rms(&flat(&before), &flat(&expected)) > 0.05, "the caster hardly matters here");
}

#[test]
fn vectors_scale_and_offset_each_light() {
    let vectors = Vectors {
        scale: Some(vec![[2.0, 3.0, 4.0, 1.0], [0.0, 1.0, -1.0, 1.0]].into()),
        offset: Some(vec![[0.5, 0.0, 0.0, 0.0], [0.0, 0.25, 0.0, 0.0]].into()),
    };
    let mut light = vec![[1.0, 1.0, 1.0, 7.0], [8.0, 8.0, 8.0, 7.0], [0.0; 4], [1.0; 4]];
    vectors.apply(&mut light, 2);
    assert_eq!(light, [[2.5, 3.0, 4.0, 7.0], [0.0, 8.25, -8.0, 7.0], [0.5, 0.0, 0.0, 0.0], [0.0, 1.25, -1.0, 1.0]]);
    let before = light.clone();
    Vectors::default().apply(&mut light, 2);
    assert_eq!(light, before);
}

#[test]
fn the_gpu_agrees() {
    let Ok(device) = Device::open(Choice::Gpu) else {
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), "\nSKIPPED: sampled edits on a GPU: no adapter");
        return;
    };
    let (geometry, transfer) = made(json!({}));
    let sampled = Sampled::new(everything(&geometry, &transfer)).unwrap();
    let light = light(2 * 2048, 9);
    let [gpu, cpu] = [&device, &Device::Cpu].map(|device| flat(&apply(device, &transfer, &sampled, &light, 2)));
    room::close(&gpu, &cpu, 1e-6, 1e-5);
}

#[test]
fn what_they_were_not_sampled_for_is_refused_and_named() {
    let (geometry, transfer) = made(json!({}));
    let sampled = Sampled::new(everything(&geometry, &transfer)).unwrap();
    let view =
        |params: Json| json!({ "view": { "type": "view_samples", "params": params, "inputs": { "scene": "room" } } });
    let transport = |params: Json| json!({ "transport": { "type": "transfer", "params": params, "inputs": { "scene": "room", "samples": "view" } } });
    let camera = json!({
        "eye": { "type": "camera", "params": { "position": [0.5, 1.2, 3.0], "fov_y": 35.0 }, "inputs": { "scene": "room" } },
        "view": { "type": "view_samples", "params": { "width": 48, "height": 36 }, "inputs": { "scene": "room", "camera": "eye" } },
    });
    for (more, words) in [
        (view(json!({ "width": 40, "height": 36 })), &["resolution 48 x 36, here 40 x 36"][..]),
        (view(json!({ "width": 48, "height": 36, "samples_per_pixel": 2 })), &["samples a pixel 1 x 1, here 2 x 1"]),
        (camera, &["camera at", "field of view", "here 35.000°"]),
        (transport(json!({ "gather_samples": 1024, "tolerance": 0.1 })), &["gather samples 2048, here 1024"]),
        (transport(json!({ "gather_samples": 2048, "tolerance": 0.02 })), &["rows are placed elsewhere"]),
        (transport(json!({ "gather_samples": 2048, "tolerance": 0.1, "basis": "haar" })), &["placed elsewhere"]),
    ] {
        let (geometry, transfer) = made(more);
        let error = sampled.check(&geometry, &transfer).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        let message = error.to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{words:?} not in: {message}");
        assert!(error.help().contains("scale_offset"));
    }
    // Another scene, by what is known of it.
    let mut other = sampled.origin.clone();
    other.geometry = "00".repeat(16);
    assert_eq!(other.differences(&sampled.origin), ["surfaces have moved, or are called or made differently"]);
    other.triangles += 5;
    other.objects[0] = "lawn".to_owned();
    other.bounds[1].y += 1.0;
    let differences = other.differences(&sampled.origin).join("; ");
    let count = sampled.origin.triangles;
    for word in
        [&format!("triangles {}, here {count}", count + 5), "objects missing: lawn;", "objects new: floor;", "bounds"]
    {
        assert!(differences.contains(word), "{word} not in: {differences}");
    }
    assert!(sampled.check(&geometry, &transfer).is_ok());
}

#[test]
fn a_transfer_of_basis_haar_cannot_be_edited_so() {
    let haar = json!({ "gather_samples": 256, "tolerance": 0.2, "basis": "haar" });
    let (geometry, transfer) = made(json!({
        "transport": { "type": "transfer", "params": haar, "inputs": { "scene": "room", "samples": "view" } }
    }));
    let sampled = Sampled::new(untouched(&geometry, &transfer)).unwrap();
    assert!(
        Plan::new(&Slots::diffuse(&sampled, &transfer), &transfer).is_err_and(|error| error.help().contains("cut"))
    );
}

#[test]
fn damaged_parts_are_refused_and_named() {
    let (geometry, transfer) = made(json!({}));
    let good = everything(&geometry, &transfer);
    type Damage = fn(&mut Parts);
    let damages: [(&str, Damage); 9] = [
        ("view.position: 1727 elements, expected 1728", |p| p.view.position = p.view.position[1..].to_vec().into()),
        ("gather.normal: element 3 is [NaN", |p| {
            let mut normal = p.gather.normal.to_vec();
            normal[3][0] = f32::NAN;
            p.gather.normal = normal.into();
        }),
        ("source.scale: 7 elements", |p| p.source.scale = Some(vec![[1.0; 4]; 7].into())),
        ("eye.offset: element 0 is [inf", |p| p.eye.offset = Some(vec![[f32::INFINITY; 4]; 1728].into())),
        ("slots of view sample", |p| p.slots = vec![[12; 4]; p.touched.len()].into()),
        ("follows", |p| p.touched = vec![9; p.touched.len()].into()),
        ("1728 of 1728", |p| {
            (p.touched, p.slots, p.weights) = (vec![1728].into(), vec![[0; 4]].into(), vec![[0.0; 4]].into());
        }),
        ("gather samples; expected a power of two", |p| p.origin.gather_samples = 2047),
        ("scale rows", |p| p.scales = dense_rows(1024, 12, |_, _| Vec3::ONE)),
    ];
    for (words, damage) in damages {
        let mut parts = good.clone();
        damage(&mut parts);
        let error = Sampled::new(parts).unwrap_err().to_string();
        assert!(error.contains(words), "{words} not in: {error}");
    }
}

#[test]
fn they_are_an_edit_among_others() {
    let (geometry, transfer) = made(json!({}));
    let [none, all] = [untouched, everything].map(|make| Arc::new(Sampled::new(make(&geometry, &transfer)).unwrap()));
    assert!(none.changes_nothing() && !all.changes_nothing() && none != all);
    assert_eq!(all, Arc::new(Sampled::new(everything(&geometry, &transfer)).unwrap()));
    let edits = Edits::default().and(Edit::Sampled(none)).and(Edit::Sampled(all.clone()));
    assert_eq!(edits.0.len(), 1);
    assert!(edits.sampled().eq([&all]) && edits.0[0].selections().next().is_none());
    assert!(edits.bytes() > all.bytes() && all.bytes() > 100_000, "{:?}", all.bytes_by_part());
}
