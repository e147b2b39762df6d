//! Properties of transfers: energy, furnaces, and that a tighter tolerance is kept.

use crate::room::{evaluate, evaluator, image, layer, recipe, relative_rms, relight};
use chiaro::device::Device;
use chiaro::memo::{Key, NoMemo};
use chiaro::progress::{Progress, Silent};
use chiaro::scene::geometry::{GeometryBuilder, Mesh};
use chiaro::scene::{Camera, Geometry};
use chiaro::transport::blocks::Blocks;
use chiaro::transport::edits::SourceBrush;
use chiaro::transport::glossy::Gloss;
use chiaro::transport::lighting::{Stage, leaving};
use chiaro::transport::precompute::{Estimator, Placement, Quality, Settings, precompute};
use chiaro::transport::{Basis, Edit, Edits, Samples, Transfer};
use chiaro::value::Value;
use glam::{Mat4, Vec3};
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The six faces of a box from -1 to 1, seen from within or from without.
pub fn cuboid(builder: &mut GeometryBuilder, name: &str, place: Mat4, inward: bool) {
    let corners: Vec<[f32; 3]> = (0..8).map(|i| [0, 1, 2].map(|axis| (i >> axis & 1) as f32 * 2.0 - 1.0)).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let turned = |[a, b, c]: [u32; 3]| if inward { [a, c, b] } else { [a, b, c] };
    let indices: Vec<u32> =
        faces.iter().flat_map(|&[a, b, c, d]| [turned([a, b, c]), turned([a, c, d])]).flatten().collect();
    let object = builder.object(name);
    let mesh = Mesh { positions: &corners, normals: None, uvs: None, indices: &indices, material: 0 };
    builder.add(object, &mesh, place).unwrap();
}

/// A closed room with a box that hangs in it: every ray from a surface meets a surface.
fn furnace() -> Geometry {
    let mut builder = GeometryBuilder::default();
    cuboid(&mut builder, "room", Mat4::from_scale(Vec3::new(3.0, 2.0, 4.0)), true);
    let place = Mat4::from_translation(Vec3::new(0.4, -0.5, -1.0)) * Mat4::from_rotation_y(0.4);
    cuboid(&mut builder, "box", place * Mat4::from_scale(Vec3::splat(0.6)), false);
    builder.finish(vec!["white".into()]).unwrap()
}

fn furnace_transfer(placement: Placement, bounces: u32) -> Transfer {
    let geometry = furnace();
    let camera = Camera::look_at("eye", Vec3::new(-1.5, 0.8, 3.5), Vec3::new(0.3, -0.5, -1.0), 1.2);
    let samples = Samples::view(&Device::Cpu, &geometry, &camera, (40, 30), 1).unwrap();
    assert!(samples.points.iter().all(|point| point.exists()), "the room is closed");
    let settings = Settings {
        gather_samples: 2048,
        bounces,
        basis: Basis::Cut,
        coefficients: 100,
        estimator: Estimator::Rays,
        glossy: Gloss::None,
        quality: Quality::of(0.1, placement),
    };
    precompute(&Device::Cpu, &geometry, &Arc::new(samples), &settings, &Blocks::none(), Progress::silent()).unwrap().0
}

/// Where everything radiates alike, irradiance is the exitance, whatever the shapes: rows lose and invent nothing.
#[test]
fn a_furnace_is_evenly_lit() {
    for placement in [Placement::Adaptive, Placement::Every] {
        let transfer = furnace_transfer(placement, 1);
        let light = [3.0, 0.5, 0.125, 0.0];
        let irradiance = transfer.apply(&Device::Cpu, &vec![light; transfer.gather.count()], 1).unwrap();
        // A row's weights are rounded to 20 bits of its largest: the sum is off by far less than a ray.
        for (sample, e) in irradiance.iter().enumerate() {
            let off = e.iter().zip(light).any(|(e, light)| (e - light).abs() > 1e-4 * light);
            assert!(!off, "{placement:?}, sample {sample}: {e:?}, expected {light:?}");
        }
    }
}

/// With irradiance E from lights on every surface of albedo r, what leaves after n reflections is E r + E r² + ...; a
/// brush scales the reflectance and adds light of its own once.
#[test]
fn bounces_in_a_furnace_are_a_geometric_series() {
    let (e, albedo) = (2.0f32, 0.7f32);
    for bounces in [1, 2, 5] {
        let transfer = furnace_transfer(Placement::Adaptive, bounces);
        let count = transfer.gather.count();
        let lit = vec![[e, e, e, 0.0]; count];
        let never = AtomicBool::new(false);
        let stage = Stage {
            device: &Device::Cpu,
            memo: &NoMemo,
            progress: Progress { node: "", sink: &Silent, cancel: &never },
            geometry: &Geometry::default(),
            transfer: &transfer,
            place: Key::of(&[]),
        };
        let reflectance = vec![[albedo, albedo, albedo, 1.0]; count];
        let brush = SourceBrush { selection: None, scale: 0.5, offset: Vec3::splat(0.25) };
        for (scale, offset, brushes) in [(1.0, 0.0, &[][..]), (0.5, 0.25, std::slice::from_ref(&brush))] {
            let edits = Edits(brushes.iter().cloned().map(Edit::Source).collect());
            let leaving = leaving(&stage, || Ok(lit.clone()), &reflectance, &edits, Key::of(&[])).unwrap();
            let first = e * albedo * scale + offset;
            let expected: f32 = (0..bounces as i32).map(|n| first * (albedo * scale).powi(n)).sum();
            for (sample, leaving) in leaving.exitance.iter().enumerate() {
                let off = leaving[..3].iter().map(|b| (b - expected).abs()).fold(0.0, f32::max);
                assert!(off <= 1e-3 * expected, "{bounces} bounces, sample {sample}: {leaving:?}, not {expected}");
            }
        }
    }
}

/// No surface receives more than it would if all that it sees were as bright as the brightest.
#[test]
fn energy_is_not_created() {
    for rows in ["adaptive", "every"] {
        let plan = recipe(json!({ "transport": {
            "type": "transfer", "params": { "gather_samples": 2048, "tolerance": 0.1, "bounces": 2, "rows": rows },
            "inputs": { "scene": "room", "samples": "view" },
        }}));
        let (Value::Transfer(transfer), _) = evaluate(&evaluator(), &plan, "transport", 1) else { panic!("transfer") };
        let ones = vec![[1.0; 4]; transfer.gather.count()];
        for (what, irradiance) in [
            ("view", transfer.apply(&Device::Cpu, &ones, 1).unwrap()),
            ("gather", transfer.bounce(&Device::Cpu, &ones).unwrap()),
        ] {
            let (low, high) = irradiance.iter().fold((f32::MAX, 0.0f32), |(l, h), e| (l.min(e[0]), h.max(e[0])));
            assert!(low >= 0.0 && high <= 1.0 + 1e-3, "{what} samples, rows {rows}: {low} to {high}");
            assert!(high > 0.9, "{what} samples in the room see surfaces");
        }
    }
}

#[test]
fn a_tighter_tolerance_is_a_smaller_error() {
    let evaluator = evaluator();
    let indirect = |tolerance: f32, rows: &str| {
        let plan = recipe(json!({
            "transport": {
                "type": "transfer", "params": { "gather_samples": 16384, "tolerance": tolerance, "rows": rows },
                "inputs": { "scene": "room", "samples": "view" },
            },
            "lit": relight(None),
        }));
        layer(&image(&evaluator, &plan, "lit"), "indirect")
    };
    let reference = indirect(0.005, "every");
    let errors = [0.16, 0.04, 0.01].map(|tolerance| relative_rms(&indirect(tolerance, "adaptive"), &reference));
    eprintln!("errors {errors:?}");
    assert!(errors[1] < 0.7 * errors[0] && errors[2] < 0.7 * errors[1], "{errors:?}");
}
