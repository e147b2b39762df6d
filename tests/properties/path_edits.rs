//! Falloff, indirect shadows, directionality and curves against what a hand computes, in scenes made for that.

use crate::hidden::{room, transfer};
use chiaro::device::Device;
use chiaro::memo::{Key, NoMemo};
use chiaro::progress::Progress;
use chiaro::scene::geometry::{GeometryBuilder, Mesh};
use chiaro::scene::{Camera, Geometry, Material};
use chiaro::transport::blocks::Blocks;
use chiaro::transport::edits::{Block, Change, Colour, SourceBrush, Transit};
use chiaro::transport::glossy::Gloss;
use chiaro::transport::lighting::{Indirect, SceneLight, Stage};
use chiaro::transport::precompute::{Estimator, Placement, Quality, Settings, precompute};
use chiaro::transport::tone_curve::ToneCurve;
use chiaro::transport::{Basis, Edit, Edits, Samples, Selection, Transfer};
use glam::{Mat4, Vec3};
use std::sync::Arc;

/// Irradiance (red) at view samples that are surfaces, from surfaces that send 1 W/m² themselves; no lamps.
fn irradiance(
    geometry: &Geometry,
    transfer: &Transfer,
    senders: Option<&str>,
    changes: &[(Block, Change)],
) -> Vec<f32> {
    let (device, progress) = (&Device::Cpu, Progress::silent());
    let stage = Stage { device, memo: &NoMemo, progress, geometry, transfer, place: Key::of(&[]) };
    let materials = vec![Material::matte([0.5; 3])];
    let light = SceneLight::new(&stage, &materials, Key::of(&[]), &[], 1).unwrap();
    let glow = SourceBrush { selection: senders.map(|name| named(geometry, name)), scale: 1.0, offset: Vec3::ONE };
    let transits = changes.iter().cloned().map(|(block, change)| Edit::Transit(Transit { block, change }));
    let edits = Edits([Edit::Source(glow)].into_iter().chain(transits).collect());
    let light = Indirect::new(&light, &edits).unwrap().irradiance;
    let points = transfer.samples.points.iter();
    points.zip(light.iter()).filter(|(point, _)| point.exists()).map(|(_, light)| light[0]).collect()
}

fn named(geometry: &Geometry, object: &str) -> Arc<Selection> {
    Arc::new(Selection::by_name(geometry, &[object.into()], &[]).unwrap())
}

fn everywhere(change: Change) -> (Block, Change) {
    (Block::default(), change)
}

fn falloff(exponent: f32, distance: f32) -> (Block, Change) {
    everywhere(Change::Falloff { exponent, distance })
}

fn curve(gamma: f32, pivot: f32) -> (Block, Change) {
    let curve = ToneCurve::Gamma { gamma, pivot };
    everywhere(Change::Colour(Colour { brightness: 1.0, saturation: 1.0, hue: 0.0, curve }))
}

/// Two squares of 0.6 m that face each other across `apart` metres; the lower one is looked at.
fn squares(apart: f32) -> (Geometry, Transfer) {
    let quad = [[-0.3, 0.0, 0.3], [0.3, 0.0, 0.3], [0.3, 0.0, -0.3], [-0.3, 0.0, -0.3]];
    let mut builder = GeometryBuilder::default();
    for (name, indices, y) in [("receiver", [0, 1, 2, 0, 2, 3], 0.0), ("sender", [0, 2, 1, 0, 3, 2], apart)] {
        let object = builder.object(name);
        let mesh = Mesh { positions: &quad, normals: None, uvs: None, indices: &indices, material: 0 };
        builder.add(object, &mesh, Mat4::from_translation(Vec3::Y * y)).unwrap();
    }
    let geometry = builder.finish(vec!["white".into()]).unwrap();
    let camera = Camera::look_at("eye", Vec3::new(1.0, 1.0, 0.0), Vec3::ZERO, 0.1);
    let samples = Samples::view(&Device::Cpu, &geometry, &camera, (4, 4), 1).unwrap();
    assert!(samples.points.iter().all(|point| point.object == 0));
    let settings = Settings {
        gather_samples: 256,
        bounces: 1,
        basis: Basis::Cut,
        coefficients: 100,
        estimator: Estimator::Points,
        glossy: Gloss::None,
        quality: Quality::of(0.01, Placement::Every),
    };
    let (transfer, _) =
        precompute(&Device::Cpu, &geometry, &Arc::new(samples), &settings, &Blocks::none(), Progress::silent())
            .unwrap();
    (geometry, transfer)
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

#[track_caller]
fn near(found: f32, expected: f32, relative: f32) {
    assert!((found / expected - 1.0).abs() <= relative, "{found}, expected {expected}");
}

fn between(scene: &(Geometry, Transfer), changes: &[(Block, Change)]) -> f32 {
    mean(&irradiance(&scene.0, &scene.1, Some("sender"), changes))
}

#[test]
fn light_falls_off_with_the_chosen_power_of_distance() {
    let [near_by, far] = [3.0, 6.0].map(squares);
    let plain = [&near_by, &far].map(|scene| between(scene, &[]));
    near(plain[1] / plain[0], 0.25, 0.03);
    for exponent in [-1.0, 0.0, 1.0, 1.5, 3.0, 6.0] {
        let lit = [&near_by, &far].map(|scene| between(scene, &[falloff(exponent, 1.0)]));
        near(lit[0] / plain[0], 3f32.powf(2.0 - exponent), 0.01 * (2.0 - exponent).abs());
        near(lit[1] / lit[0], 2f32.powf(-exponent), 0.04);
        near(between(&far, &[falloff(exponent, 6.0)]), plain[1], 0.01 * (2.0 - exponent).abs());
    }
    assert_eq!(between(&far, &[falloff(2.0, 1.0)]), plain[1]);
    near(between(&far, &[falloff(1.0, 2.0), falloff(3.0, 2.0)]), plain[1], 1e-4);
    near(between(&far, &[falloff(1.0, 2.0), falloff(0.0, 2.0)]), between(&far, &[falloff(-1.0, 2.0)]), 1e-3);
}

#[test]
fn a_curve_acts_on_what_the_edits_before_it_left() {
    let scene = squares(3.0);
    let (plain, fallen) = (between(&scene, &[]), between(&scene, &[falloff(1.0, 0.25)]));
    near(fallen, 12.0 * plain, 0.01);
    let (pivot, root) = (0.01, |x: f32| 0.01 * (x / 0.01).sqrt());
    near(between(&scene, &[curve(2.0, pivot)]), root(plain), 1e-3);
    near(between(&scene, &[falloff(1.0, 0.25), curve(2.0, pivot)]), root(fallen), 1e-3);
    near(between(&scene, &[curve(2.0, pivot), falloff(1.0, 0.25)]), root(plain) * fallen / plain, 1e-3);
    let both = [curve(2.0, pivot), falloff(1.0, 0.25), curve(2.0, pivot)];
    near(between(&scene, &both), root(root(plain) * fallen / plain), 1e-3);
}

#[test]
fn without_shadow_light_is_as_without_the_block() {
    let scenes = [true, false].map(|with_block| {
        let geometry = room(with_block);
        let transfer = transfer(&geometry, Basis::Cut);
        (geometry, transfer)
    });
    let [(with, through), (without, open)] = &scenes;
    let block = |receiver: Option<&str>| Block {
        caster: Some(named(with, "wall")),
        receiver: receiver.map(|name| named(with, name)),
    };
    let lit = |changes: &[(Block, Change)]| irradiance(with, through, Some("wall"), changes);
    let shadow = |amount: f32| (block(None), Change::Shadow { amount });
    let (plain, clear) = (lit(&[]), lit(&[shadow(1.0)]));
    let expected = irradiance(without, open, Some("wall"), &[]);
    let half = lit(&[shadow(0.5)]);
    let (thrice, twice) = (lit(&[shadow(0.75)]), lit(&[shadow(0.5), shadow(0.5)]));
    let floor = lit(&[(block(Some("room")), Change::Shadow { amount: 1.0 })]);
    let mut shadowed = 0;
    for (sample, point) in through.samples.points.iter().enumerate() {
        let same = *point == open.samples.points[sample];
        assert!(!same || (clear[sample] - expected[sample]).abs() < 1e-4, "{} {}", clear[sample], expected[sample]);
        shadowed += usize::from(same && clear[sample] - plain[sample] > 0.02);
        assert!((half[sample] - 0.5 * (plain[sample] + clear[sample])).abs() < 1e-6);
        assert!((thrice[sample] - twice[sample]).abs() < 1e-6);
        let inside = with.objects[point.object as usize] == "room";
        assert_eq!(floor[sample], if inside { clear[sample] } else { plain[sample] }, "sample {sample}");
    }
    assert!(shadowed > 20, "{shadowed} samples in shadow");
}

/// In a closed room where all surfaces send 1 W/m², irradiance is 1, and an edit of directions gives the mean of its
/// factor over the cosine-weighted hemisphere.
#[test]
fn light_comes_from_the_chosen_side() {
    let geometry = room(false);
    let transfer = transfer(&geometry, Basis::Cut);
    let towards = |axis: Vec3, amount: f32, focus: f32| {
        irradiance(&geometry, &transfer, None, &[everywhere(Change::Directionality { axis, amount, focus })])
    };
    let plain = towards(Vec3::X, 0.0, 1.0);
    assert!(plain.iter().all(|e| (e - 1.0).abs() < 1e-4));
    for (axis, amount) in [(Vec3::X, 1.0), (Vec3::new(0.6, 0.0, 0.8), 0.7), (Vec3::NEG_Y, 0.3)] {
        let (there, back) = (towards(axis, amount, 1.0), towards(-axis, amount, 1.0));
        for (a, b) in there.iter().zip(&back) {
            assert!((0.5 * (a + b) - 1.0).abs() < 2e-3, "opposite sides: {a}, {b}");
        }
    }
    // The integral of 2 c (f + 1) ((1 + c) / 2)^f over the cosine c from 0 to 1, and of 2 c (f + 1) ((1 - c) / 2)^f.
    for (focus, facing, away) in [(1.0, 5.0 / 3.0, 1.0 / 3.0), (3.0, 2.45, 0.05)] {
        let amount = 0.8;
        let lit = towards(Vec3::X, amount, focus);
        let (mut faces, mut turned) = (0, 0);
        // Near corners, gather samples are too far apart to say where light comes from.
        let open = |p: &[f32; 3]| p[1].abs() < 1.2 && p[2].abs() < 3.2;
        for (point, light) in transfer.samples.points.iter().zip(lit).filter(|(point, _)| open(&point.position)) {
            let expected = match point.normal[0] {
                x if x > 0.999 => facing,
                x if x < -0.999 => away,
                _ => continue,
            };
            faces += usize::from(expected == facing);
            turned += usize::from(expected == away);
            assert!((light - (1.0 + amount * (expected - 1.0))).abs() < 0.06, "focus {focus}: {light}, {expected}");
        }
        assert!(faces + turned > 20, "{faces} face the side, {turned} turn away");
    }
}
