//! Edits of shadows, held against a loop over every direction of every sample that follows the definition
//! (`transport::shadow::edits`).

#[path = "support/sky.rs"]
mod sky;

use chiaro::device::Device;
use chiaro::progress::Progress;
use chiaro::scene::cube::{self, FACES};
use chiaro::scene::{Scene, builtin};
use chiaro::transport::Selection;
use chiaro::transport::selection::Grounds;
use chiaro::transport::shadow::visibility::Scratch;
use chiaro::transport::shadow::{Basis, Lamp, ShadowChange, ShadowEdit, Visibility, edited};
use glam::{DVec3, Quat, Vec3};
use sky::View;
use std::sync::Arc;

const SIZE: usize = 32;
const TEXELS: usize = FACES * SIZE * SIZE;

fn hall() -> (Scene, View) {
    let scene = builtin::scene("hall").unwrap();
    let view = View::new(&scene, (29, 17), 1, sky::sky(SIZE));
    (scene, view)
}

/// Half of the objects, by name.
fn some_objects(scene: &Scene) -> Vec<&str> {
    scene.geometry.objects.iter().map(String::as_str).step_by(2).collect()
}

fn edit(change: ShadowChange) -> ShadowEdit {
    ShadowEdit { group: None, lamp: None, selection: None, change }
}

fn lamp(weight: impl Fn(Vec3) -> f32) -> Option<Arc<Lamp>> {
    let weights: Vec<f32> = (0..TEXELS).map(|t| weight(cube::texel_point(t, SIZE).normalize())).collect();
    Some(Arc::new(Lamp { size: SIZE, weights: weights.into() }))
}

/// Around the sun of `sky::sky`, in two steps.
fn sun() -> Option<Arc<Lamp>> {
    let towards = Vec3::new(0.5, 1.0, 0.3).normalize();
    lamp(|w| match w.dot(towards) {
        0.97.. => 1.0,
        0.93.. => 0.5,
        _ => 0.0,
    })
}

fn with(visibility: &Visibility, edits: &[ShadowEdit]) -> Visibility {
    edits.iter().fold(visibility.clone(), |all, edit| all.and(edit.clone()).unwrap())
}

fn light(view: &View, visibility: &Visibility) -> Vec<[f32; 4]> {
    edited::irradiance(&view.stage(visibility), Progress::silent()).unwrap()
}

/// The shadow of a sample in one colour by the definition, in 64 bits; moves and turns look up the texel that they meet.
fn defined_shadow(visibility: &Visibility, sample: usize, c: usize, scratch: &mut Scratch) -> Vec<f64> {
    let point = &visibility.samples.points[sample];
    let read = |group: usize, scratch: &mut Scratch| -> Vec<f64> {
        let mut all = vec![0.0; TEXELS];
        for (face, rows) in visibility.groups[group].faces.iter().enumerate() {
            if let Some(rows) = rows {
                let mut values = vec![0.0f32; SIZE * SIZE];
                rows.decode(sample, scratch, &mut values);
                let first = face * SIZE * SIZE;
                all[first..first + values.len()].iter_mut().zip(values).for_each(|(a, v)| *a = f64::from(v));
            }
        }
        all
    };
    let run = |mut shadow: Vec<f64>, group: Option<&str>| {
        for edit in visibility.edits.iter().filter(|edit| edit.group.as_deref() == group) {
            let selected = edit.selection.as_ref().map_or(1.0, |s| s.weight(point));
            shadow = applied(edit, &shadow, f64::from(selected), point.position.into(), c);
        }
        shadow
    };
    let mut seen = vec![1.0; TEXELS];
    for group in 0..visibility.groups.len() {
        let hidden = run(read(group, scratch), Some(&visibility.groups[group].name));
        seen.iter_mut().zip(hidden).for_each(|(seen, hidden)| *seen *= 1.0 - hidden);
    }
    run(seen.into_iter().map(|seen| 1.0 - seen).collect(), None)
}

/// The light by the definition.
fn defined(view: &View, visibility: &Visibility) -> Vec<[f64; 3]> {
    let environment = &view.transport.environment;
    let mut scratch = Scratch::default();
    let points = &view.samples.points;
    let mut light = vec![[0.0; 3]; points.len()];
    for (sample, light) in light.iter_mut().enumerate() {
        let normal = Vec3::from(points[sample].normal).as_dvec3();
        for c in 0..3 {
            let shadow = defined_shadow(visibility, sample, c, &mut scratch);
            for (texel, shadow) in shadow.iter().enumerate() {
                let direction: DVec3 = cube::texel_point(texel, SIZE).as_dvec3().normalize();
                let radiance = environment.radiance[texel].map(f64::from);
                light[c] += (1.0 - shadow) * radiance[c] * radiance[3] * direction.dot(normal).max(0.0);
            }
        }
    }
    light
}

fn applied(edit: &ShadowEdit, shadow: &[f64], selected: f64, position: Vec3, c: usize) -> Vec<f64> {
    let change = |texel: usize| -> f64 {
        let point = cube::texel_point(texel, SIZE);
        match edit.change {
            ShadowChange::Fade { amount } => (1.0 - f64::from(amount)) * shadow[texel],
            ShadowChange::Tint { amount, colour } => (1.0 - f64::from(amount * colour[c])) * shadow[texel],
            ShadowChange::Gradient { amount, from, to } => {
                let way = (position - from).dot(to - from) / (to - from).length_squared();
                (1.0 - f64::from(amount * way.clamp(0.0, 1.0))) * shadow[texel]
            }
            ShadowChange::Move { offset } => shadow[cube::texel_at(point - offset, SIZE)],
            ShadowChange::Turn { axis, angle } => {
                shadow[cube::texel_at(Quat::from_axis_angle(axis, -angle) * point, SIZE)]
            }
            ShadowChange::Blur { .. } => unreachable!("blurs have tests of their own"),
        }
    };
    let mixed = |texel: usize| {
        let share = selected * edit.lamp.as_ref().map_or(1.0, |lamp| f64::from(lamp.weights[texel]));
        shadow[texel] + share * (change(texel) - shadow[texel])
    };
    (0..TEXELS).map(mixed).collect()
}

fn worst(found: &[[f32; 4]], expected: &[[f64; 3]]) -> f64 {
    let largest = expected.iter().flatten().copied().fold(0.0, f64::max);
    let pairs = found.iter().zip(expected).flat_map(|(a, b)| (0..3).map(|c| (f64::from(a[c]) - b[c]).abs()));
    pairs.fold(0.0, f64::max) / largest
}

/// A soft selection around some of the samples.
fn painted(view: &View) -> Option<Arc<Selection>> {
    let points: Vec<[f32; 3]> =
        view.samples.points.iter().filter(|point| point.exists()).map(|point| point.position).step_by(60).collect();
    let stroke = serde_json::json!({ "points": points, "radius": 0.7, "hardness": 0.4 });
    let stroke = serde_json::from_value(stroke).unwrap();
    let (selection, _) =
        Selection::painted(&Grounds::still(view.geometry.clone()), &[stroke], |_, _| unreachable!("not adaptive"))
            .unwrap();
    Some(Arc::new(selection))
}

#[test]
fn edits_do_what_they_are_defined_to_do() {
    let (scene, view) = hall();
    let objects = some_objects(&scene);
    let baked = view.bake(Basis::Runs, &[("some", &objects)]);
    let some = Some("some".to_owned());
    let fade = ShadowChange::Fade { amount: 0.6 };
    let tint = ShadowChange::Tint { amount: 0.8, colour: Vec3::new(0.9, 0.4, 0.0) };
    let gradient =
        ShadowChange::Gradient { amount: 0.9, from: Vec3::new(-1.0, 0.0, 0.0), to: Vec3::new(1.0, 0.5, 1.0) };
    let whole_texels = ShadowChange::Move { offset: Vec3::new(0.0, 0.0, 6.0 / SIZE as f32) };
    let half_turn = ShadowChange::Turn { axis: Vec3::Y, angle: std::f32::consts::PI };
    // Every texel with a weight of its own: too many regions for sums.
    let rough = lamp(|w| (0.5 + 0.4 * (w.x * 31.0 + w.z * 17.0).sin()).clamp(0.0, 1.0));
    let selection = painted(&view);
    let lists: Vec<(&str, Vec<ShadowEdit>)> = vec![
        ("a fade", vec![edit(fade)]),
        ("a tint", vec![edit(tint)]),
        ("a gradient of a lamp", vec![ShadowEdit { lamp: sun(), ..edit(gradient) }]),
        ("a group", vec![ShadowEdit { group: some.clone(), ..edit(fade) }]),
        (
            "group and all, lamps, selection",
            vec![
                ShadowEdit { group: some.clone(), lamp: sun(), selection: selection.clone(), ..edit(tint) },
                ShadowEdit { lamp: lamp(|w| f32::from(u8::from(w.y > 0.5))), ..edit(fade) },
                ShadowEdit { group: Some("rest".to_owned()), ..edit(gradient) },
            ],
        ),
        ("a rough lamp", vec![ShadowEdit { lamp: rough.clone(), ..edit(fade) }, edit(tint)]),
        ("a turn", vec![edit(half_turn)]),
        (
            "a turn of a lamp between fades",
            vec![
                ShadowEdit { group: some.clone(), ..edit(fade) },
                ShadowEdit { lamp: sun(), selection: selection.clone(), ..edit(half_turn) },
                edit(tint),
            ],
        ),
        ("a turn of a group", vec![ShadowEdit { group: some, lamp: sun(), ..edit(half_turn) }, edit(gradient)]),
    ];
    let unedited = light(&view, &baked);
    for (name, list) in lists {
        let visibility = with(&baked, &list);
        let (found, expected) = (light(&view, &visibility), defined(&view, &visibility));
        let error = worst(&found, &expected);
        println!("{name}: {error:.1e}");
        assert!(error < 2e-5, "{name}: {error}");
        assert!(worst(&unedited, &expected) > 1e-3, "{name} does nothing");
    }
    // Texels of a face move by whole steps where they stay on it: the lamp keeps away from the face's border.
    let inner = lamp(|w| f32::from(u8::from(w.y > 0.9)));
    let visibility = with(&baked, &[ShadowEdit { lamp: inner, ..edit(whole_texels) }]);
    let error = worst(&light(&view, &visibility), &defined(&view, &visibility));
    assert!(error < 1e-4, "a move: {error}");
}

#[test]
fn what_selected_samples_see_is_the_mean_of_what_each_sees() {
    let (scene, view) = hall();
    let baked = view.bake(Basis::Runs, &[("some", &some_objects(&scene))]);
    let some = Some("some".to_owned());
    let tint = ShadowChange::Tint { amount: 0.8, colour: Vec3::new(0.9, 0.4, 0.0) };
    let half_turn = ShadowChange::Turn { axis: Vec3::Y, angle: std::f32::consts::PI };
    let edits = [
        ShadowEdit { group: some, lamp: sun(), ..edit(tint) },
        ShadowEdit { selection: painted(&view), ..edit(half_turn) },
    ];
    let points = &view.samples.points;
    let weights: Vec<f32> = (0..points.len()).map(|i| if i % 37 == 5 { (i % 3) as f32 / 2.0 } else { 0.0 }).collect();
    let mean = |visibility: &Visibility| {
        let (mut scratch, mut mean, mut total) = (Scratch::default(), vec![[0.0; 3]; TEXELS], 0.0);
        for sample in (0..points.len()).filter(|&i| weights[i] > 0.0 && points[i].exists()) {
            total += f64::from(weights[sample]);
            let mut above = vec![0; SIZE * SIZE / 32 * FACES];
            let faces = above.chunks_exact_mut(SIZE * SIZE / 32).enumerate();
            faces.for_each(|(face, mask)| visibility.horizon(sample, face, mask));
            (0..3).for_each(|c| {
                let shadow = defined_shadow(visibility, sample, c, &mut scratch);
                for texel in (0..TEXELS).filter(|texel| above[texel / 32] >> (texel % 32) & 1 == 1) {
                    mean[texel][c] += f64::from(weights[sample]) * (1.0 - shadow[texel]);
                }
            });
        }
        mean.iter_mut().flatten().for_each(|mean| *mean /= total);
        mean
    };
    let (edited_by_all, plain, environment) = (with(&baked, &edits), &baked, &view.transport.environment);
    for visibility in [plain, &edited_by_all] {
        let found = edited::seen(&Device::Cpu, Progress::silent(), visibility, environment, &weights).unwrap();
        let expected = mean(visibility);
        let pairs = found.iter().flatten().zip(expected.iter().flatten());
        let worst = pairs.map(|(found, mean)| (f64::from(*found) - mean).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-4, "{worst}");
    }
    assert!(mean(plain) != mean(&edited_by_all));
}

#[test]
fn removing_all_shadows_is_light_without_occluders_and_groups_are_their_objects() {
    let (scene, view) = hall();
    let objects = some_objects(&scene);
    let baked = view.bake(Basis::Runs, &[("some", &objects)]);
    let removed = light(&view, &with(&baked, &[edit(ShadowChange::Fade { amount: 1.0 })]));
    let none = Visibility { groups: Vec::new(), ..baked.clone() };
    let open = view.light(&none);
    let exact: Vec<[f64; 3]> = open.iter().map(|l| [0, 1, 2].map(|c| f64::from(l[c]))).collect();
    assert!(worst(&removed, &exact) < 1e-6);

    let without =
        with(&baked, &[ShadowEdit { group: Some("some".into()), ..edit(ShadowChange::Fade { amount: 1.0 }) }]);
    let rest = Visibility { groups: vec![baked.groups[1].clone()], ..baked.clone() };
    let exact: Vec<[f64; 3]> = view.light(&rest).iter().map(|l| [0, 1, 2].map(|c| f64::from(l[c]))).collect();
    assert!(worst(&light(&view, &without), &exact) < 1e-6);

    // Half way is half way.
    let half = light(&view, &with(&baked, &[edit(ShadowChange::Fade { amount: 0.5 })]));
    let before = light(&view, &baked);
    let between = |i: usize| [0, 1, 2].map(|c| 0.5 * f64::from(before[i][c]) + 0.5 * f64::from(removed[i][c]));
    assert!(worst(&half, &(0..half.len()).map(between).collect::<Vec<_>>()) < 1e-6);
}

#[test]
fn what_is_not_selected_and_what_has_no_shadow_keeps_every_bit() {
    let (_, view) = hall();
    let baked = view.bake(Basis::Runs, &[]);
    let before = light(&view, &baked);
    let selection = painted(&view).unwrap();
    let changes = [
        ShadowChange::Fade { amount: 1.0 },
        ShadowChange::Tint { amount: 1.0, colour: Vec3::X },
        ShadowChange::Move { offset: Vec3::new(0.3, 0.1, 0.0) },
        ShadowChange::Turn { axis: Vec3::Y, angle: 1.0 },
        ShadowChange::Blur { angle: 0.2 },
    ];
    for change in changes {
        let one = ShadowEdit { selection: Some(selection.clone()), lamp: sun(), ..edit(change) };
        let after = light(&view, &with(&baked, &[one]));
        let mut changed = 0;
        for (sample, (a, b)) in after.iter().zip(&before).enumerate() {
            let weight = selection.weight(&view.samples.points[sample]);
            assert!(weight > 0.0 || a == b, "{change:?} changes sample {sample}, which is not selected");
            changed += usize::from(a != b);
        }
        assert!(changed > 0, "{change:?} changes nothing");
    }
    // A floor alone: no shadow to edit, whatever is done.
    let view = View::new(&sky::plane(), (9, 7), 1, sky::sky(SIZE));
    let baked = view.bake(Basis::Runs, &[]);
    let before = light(&view, &baked);
    for change in changes {
        assert_eq!(light(&view, &with(&baked, &[edit(change)])), before, "{change:?}");
    }
}

#[test]
fn rows_in_a_haar_basis_are_edited_alike() {
    let (scene, mut view) = hall();
    view.truncation.coefficients = SIZE * SIZE;
    let objects = some_objects(&scene);
    let list = [
        ShadowEdit { group: Some("some".to_owned()), ..edit(ShadowChange::Fade { amount: 0.7 }) },
        ShadowEdit { lamp: sun(), ..edit(ShadowChange::Blur { angle: 0.15 }) },
        edit(ShadowChange::Tint { amount: 0.5, colour: Vec3::new(1.0, 0.5, 0.0) }),
    ];
    let of = |basis: Basis| light(&view, &with(&view.bake(basis, &[("some", &objects)]), &list));
    let exact: Vec<[f64; 3]> = of(Basis::Runs).iter().map(|l| [0, 1, 2].map(|c| f64::from(l[c]))).collect();
    let error = worst(&of(Basis::Haar2d), &exact);
    assert!(error < 1e-3, "{error}");
    // And so are rows that were made from others.
    let runs = view.bake(Basis::Runs, &[]);
    let list = &list[1..];
    let exact: Vec<[f64; 3]> =
        light(&view, &with(&runs, list)).iter().map(|l| [0, 1, 2].map(|c| f64::from(l[c]))).collect();
    let error = worst(&light(&view, &with(&view.encode(&runs, Basis::Haar2d), list)), &exact);
    assert!(error < 1e-3, "{error}");
}

#[test]
fn blurs_soften_and_lose_no_light() {
    let (_, view) = hall();
    let baked = view.bake(Basis::Runs, &[]);
    let blur = |angle: f32| light(&view, &with(&baked, &[edit(ShadowChange::Blur { angle })]));
    let sum = |light: &[[f32; 4]]| light.iter().flat_map(|l| &l[..3]).map(|x| f64::from(*x)).sum::<f64>();
    let before = light(&view, &baked);
    // From a breath to half the sky: light spreads, and what spreads below horizons is little.
    let mut last = 0.0;
    for angle in [0.01, 0.05, 0.1, 0.2, 0.4] {
        let after = blur(angle);
        let moved = after.iter().zip(&before).map(|(a, b)| f64::from((a[1] - b[1]).abs())).sum::<f64>();
        assert!(moved > last, "{angle}: {moved} after {last}");
        assert!((sum(&after) / sum(&before) - 1.0).abs() < 0.25, "{angle}: {}", sum(&after) / sum(&before));
        last = moved;
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let (scene, view) = hall();
    let baked = view.bake(Basis::Runs, &[("some", &some_objects(&scene))]);
    let list = [
        ShadowEdit { group: Some("some".to_owned()), ..edit(ShadowChange::Fade { amount: 0.7 }) },
        ShadowEdit { lamp: sun(), ..edit(ShadowChange::Move { offset: Vec3::new(0.1, 0.0, 0.07) }) },
    ];
    let visibility = with(&baked, &list);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        // A view of its own: nothing remembered.
        let (_, view) = hall();
        pool.install(|| light(&view, &visibility))
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let (_, view) = hall();
    let baked = view.bake(Basis::Runs, &[]);
    let refused = |edit: ShadowEdit| baked.and(edit).unwrap_err().to_string();
    let fade = ShadowChange::Fade { amount: 1.0 };
    let error = refused(ShadowEdit { group: Some("heads".to_owned()), ..edit(fade) });
    assert!(error.contains("heads") && error.contains("all"), "{error}");
    let small = Some(Arc::new(Lamp { size: 64, weights: vec![1.0; FACES * 64 * 64].into() }));
    assert!(refused(ShadowEdit { lamp: small, ..edit(fade) }).contains("64"));
    let other = builtin::scene("room").unwrap();
    let selection = Some(Arc::new(Selection::by_name(&other.geometry, &[], &[]).unwrap()));
    assert!(refused(ShadowEdit { selection, ..edit(fade) }).contains("another scene"));
}
