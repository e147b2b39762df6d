//! Visibility, tables of light and their products, held against sums over every texel, and against each other.

#[path = "shadows/nodes.rs"]
mod node_types;
#[path = "shadows/plates.rs"]
mod plates;
#[path = "shadows/removal.rs"]
mod removal;
#[path = "support/sky.rs"]
mod sky;
mod support;

use chiaro::device::Device;
use chiaro::kernels::visibility_masks;
use chiaro::progress::Progress;
use chiaro::scene::cube::{self, FACES};
use chiaro::scene::{Environment, Occluders, Scene, builtin};
use chiaro::transport::shadow::visibility::Scratch;
use chiaro::transport::shadow::{Basis, Visibility, horizon};
use glam::{DVec3, Vec3};
use sky::View;

fn scene(name: &str) -> Scene {
    builtin::scene(name).unwrap()
}

/// Objects of the scene, by name.
fn names(scene: &Scene) -> Vec<&str> {
    scene.geometry.objects.iter().map(String::as_str).collect()
}

/// Irradiance by a loop over texels; `open`: bits of what each sample sees of a face.
fn summed(view: &View, mut open: impl FnMut(usize) -> Vec<u32>) -> Vec<[f64; 3]> {
    let environment = &view.transport.environment;
    let texels = environment.size * environment.size;
    let mut light = vec![[0.0; 3]; view.samples.points.len()];
    for face in 0..FACES {
        let masks = open(face);
        for (sample, light) in light.iter_mut().enumerate() {
            let normal = Vec3::from(view.samples.points[sample].normal).as_dvec3();
            let mask = &masks[sample * texels / 32..];
            for i in (0..texels).filter(|i| mask[i / 32] >> (i % 32) & 1 == 1) {
                let texel = face * texels + i;
                let direction: DVec3 = cube::texel_point(texel, environment.size).as_dvec3().normalize();
                let [r, g, b, angle] = environment.radiance[texel].map(f64::from);
                [r, g, b].iter().enumerate().for_each(|(c, e)| light[c] += e * angle * direction.dot(normal));
            }
        }
    }
    light
}

/// The largest difference, over the largest light.
fn difference(light: &[[f32; 4]], reference: &[[f64; 3]]) -> f64 {
    let largest = reference.iter().flatten().copied().fold(0.0, f64::max);
    let pairs = light.iter().zip(reference).flat_map(|(a, b)| (0..3).map(|c| (f64::from(a[c]) - b[c]).abs()));
    pairs.fold(0.0, f64::max) / largest
}

fn doubles(light: &[[f32; 4]]) -> Vec<[f64; 3]> {
    light.iter().map(|[r, g, b, _]| [f64::from(*r), f64::from(*g), f64::from(*b)]).collect()
}

#[test]
fn runs_are_the_sum_over_open_texels() {
    for (name, size, (width, height), per_pixel) in [("hall", 32, (31, 17), 1), ("room", 64, (16, 9), 3)] {
        let view = View::new(&scene(name), (width, height), per_pixel, sky::sky(size));
        let occluders = Occluders::new(&view.geometry, |_| true);
        let expected = summed(&view, |face| {
            visibility_masks(&Device::Cpu, &occluders, &view.samples.points, face, size, None).unwrap()
        });
        assert!(expected.iter().flatten().any(|light| *light > 0.1), "{name} is dark");
        let found = view.light(&view.bake(Basis::Runs, &[]));
        let worst = difference(&found, &expected);
        println!("{name}: runs and the sum over texels differ by {worst:.1e}");
        assert!(worst < 1e-6, "{name}: {worst}");
        // The comparison can fail: without shadows it must.
        let open = summed(&view, |face| {
            let mut masks = vec![0; view.samples.points.len() * size * size / 32];
            for (mask, point) in masks.chunks_exact_mut(size * size / 32).zip(&view.samples.points) {
                horizon::mask(point.normal.into(), face, size, mask);
            }
            masks
        });
        assert!(difference(&found, &open) > 0.01);
    }
}

#[test]
fn nothing_hides_light_in_a_scene_without_occluders() {
    // A single triangle, seen from in front, hides nothing from itself.
    let view = View::new(&sky::plane(), (21, 13), 1, sky::sky(32));
    assert!(view.samples.points.iter().any(|point| point.exists()));
    let expected = summed(&view, |face| {
        let mut masks = vec![0; view.samples.points.len() * 32];
        for (mask, point) in masks.chunks_exact_mut(32).zip(&view.samples.points) {
            horizon::mask(point.normal.into(), face, 32, mask);
        }
        masks
    });
    for basis in [Basis::Runs, Basis::Haar2d, Basis::Haar1d] {
        let visibility = view.bake(basis, &[]);
        for (sample, face) in (0..view.samples.points.len()).flat_map(|s| (0..FACES).map(move |f| (s, f))) {
            let (mut open, mut above) = (vec![7; 32], vec![9; 32]);
            visibility.open(sample, face, &mut Scratch::default(), &mut open);
            visibility.horizon(sample, face, &mut above);
            assert_eq!(open, above);
            assert!(visibility.face(face).iter().all(|rows| rows.count(sample) == 0));
        }
        assert!(difference(&view.light(&visibility), &expected) < 1e-6);
        assert!(visibility.blocked(&vec![1.0; view.samples.points.len()]).unwrap().iter().all(|share| *share == 0.0));
    }
    // An unlit world is exactly black.
    let dark = View::new(&sky::plane(), (21, 13), 1, sky::environment(32, |_| [0.0; 3]));
    assert!(dark.light(&dark.bake(Basis::Runs, &[])).iter().all(|light| *light == [0.0; 4]));
}

/// Groups of the hall, one object each but for the rest.
fn apart(view: &View) -> Vec<(String, String)> {
    view.geometry.objects.iter().skip(1).enumerate().map(|(i, name)| (format!("g{i}"), name.clone())).collect()
}

fn bake_apart(view: &View, basis: Basis) -> Visibility {
    let names = apart(view);
    let lists: Vec<[&str; 1]> = names.iter().map(|(_, object)| [object.as_str()]).collect();
    let groups: Vec<(&str, &[&str])> =
        names.iter().zip(&lists).map(|((name, _), list)| (&name[..], &list[..])).collect();
    view.bake(basis, &groups)
}

#[test]
fn groups_together_are_all_objects() {
    let view = View::new(&scene("hall"), (31, 17), 1, sky::sky(64));
    let (one, many) = (view.bake(Basis::Runs, &[]), bake_apart(&view, Basis::Runs));
    assert!(many.groups.len() > 2 && many.groups.last().unwrap().name == "rest");
    for face in 0..FACES {
        let together = many.together(face).unwrap();
        assert_eq!(together.is_some(), one.face(face).len() == 1, "face {face}");
    }
    assert_eq!(view.light(&one), view.light(&many), "to the bit");
    let weights: Vec<f32> = (0..view.samples.points.len()).map(|i| (i % 5) as f32 / 4.0).collect();
    assert_eq!(one.blocked(&weights).unwrap(), many.blocked(&weights).unwrap());
}

#[test]
fn haar_rows_with_all_coefficients_are_runs() {
    let mut view = View::new(&scene("hall"), (31, 17), 1, sky::sky(32));
    let expected = doubles(&view.light(&view.bake(Basis::Runs, &[])));
    view.truncation.coefficients = 32 * 32;
    for basis in [Basis::Haar2d, Basis::Haar1d] {
        let whole = view.bake(basis, &[]);
        let worst = difference(&view.light(&whole), &expected);
        println!("{basis:?} with all coefficients: {worst:.1e}");
        assert!(worst < 1e-5, "{basis:?}: {worst}");
        let worst = difference(&view.light(&bake_apart(&view, basis)), &expected);
        assert!(worst < 2e-5, "{basis:?} in groups: {worst}");
        let weights = vec![1.0; view.samples.points.len()];
        let (a, b) = (whole.blocked(&weights).unwrap(), view.bake(Basis::Runs, &[]).blocked(&weights).unwrap());
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-4), "{basis:?}: blocked");
    }
    view.truncation.coefficients = 20;
    let few = difference(&view.light(&view.bake(Basis::Haar2d, &[])), &expected);
    assert!(few > 1e-4, "truncation must show: {few}");
}

#[test]
fn parts_of_the_light_sum_to_the_whole() {
    let view = View::new(&scene("hall"), (31, 17), 1, sky::sky(64));
    let lamp = |i: usize| if cube::texel_point(i, 64).dot(Vec3::new(0.5, 1.0, 0.3)) > 0.9 { 0.75 } else { 0.1 };
    let lamp: Vec<f32> = (0..FACES * 64 * 64).map(lamp).collect();
    let rest: Vec<f32> = lamp.iter().map(|weight| 1.0 - weight).collect();
    let (lamp, rest) = (lamp.into(), rest.into());
    for basis in [Basis::Runs, Basis::Haar2d] {
        let visibility = view.bake(basis, &[]);
        let stage = view.stage(&visibility);
        let shadows = stage.shadows().unwrap();
        let [whole, one, other] =
            [None, Some(&lamp), Some(&rest)].map(|weights| doubles(&stage.irradiance(&shadows, weights).unwrap()));
        let sum: Vec<[f32; 4]> = one
            .iter()
            .zip(&other)
            .map(|(a, b)| [(a[0] + b[0]) as f32, (a[1] + b[1]) as f32, (a[2] + b[2]) as f32, 0.0])
            .collect();
        assert!(difference(&sum, &whole) < 2e-6, "{basis:?}: {}", difference(&sum, &whole));
        assert!(difference(&sum, &one) > 0.01);
        // What shadows take is the light without them, less what is left.
        let (hidden, lit) = (stage.hidden(&shadows, None).unwrap(), stage.irradiance(&shadows, None).unwrap());
        let open = stage.irradiance(&[const { None }; FACES], None).unwrap();
        let back: Vec<[f32; 4]> = hidden.iter().zip(&lit).map(|(a, b)| std::array::from_fn(|c| a[c] + b[c])).collect();
        assert!(difference(&back, &doubles(&open)) < 2e-6, "{basis:?}");
    }
    assert!(
        view.stage(&view.bake(Basis::Runs, &[]))
            .irradiance(&[const { None }; FACES], Some(&vec![1.0; 5].into()))
            .is_err()
    );
}

#[test]
fn blocked_is_the_mean_of_what_is_hidden() {
    let view = View::new(&scene("hall"), (31, 17), 1, sky::environment(32, |_| [1.0; 3]));
    let visibility = view.bake(Basis::Runs, &[]);
    let weights: Vec<f32> = (0..view.samples.points.len()).map(|i| (i % 3) as f32 / 2.0).collect();
    let found = visibility.blocked(&weights).unwrap();
    let mut expected = vec![0.0; FACES * 32 * 32];
    let mut total = 0.0;
    for (sample, weight) in weights.iter().enumerate().filter(|(i, _)| view.samples.points[*i].exists()) {
        total += f64::from(*weight);
        for face in 0..FACES {
            let (mut open, mut above) = (vec![0; 32], vec![0; 32]);
            visibility.open(sample, face, &mut Scratch::default(), &mut open);
            visibility.horizon(sample, face, &mut above);
            for i in 0..1024 {
                let hidden = (above[i / 32] & !open[i / 32]) >> (i % 32) & 1;
                expected[face * 1024 + i] += f64::from(*weight) * f64::from(hidden);
            }
        }
    }
    assert!(found.iter().zip(&expected).all(|(a, b)| (f64::from(*a) - b / total).abs() < 1e-6));
    assert!(found.iter().any(|share| *share > 0.1));
    assert!(visibility.blocked(&weights[1..]).is_err());
    assert!(visibility.blocked(&vec![0.0; weights.len()]).is_err());
    assert!(visibility.blocked(&vec![f32::NAN; weights.len()]).is_err());
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let view = View::new(&scene("hall"), (40, 30), 1, sky::sky(64));
            let all = [Basis::Runs, Basis::Haar2d].map(|basis| {
                let visibility = bake_apart(&view, basis);
                let blocked = visibility.blocked(&vec![0.5; view.samples.points.len()]).unwrap();
                (view.light(&visibility), blocked)
            });
            all.map(|(light, blocked)| (light.concat(), blocked))
        })
    };
    let bits =
        |all: [(Vec<f32>, Vec<f32>); 2]| all.map(|(a, b)| a.into_iter().chain(b).map(f32::to_bits).collect::<Vec<_>>());
    assert_eq!(bits(run(1)), bits(run(5)));
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let (small, large) = (sky::sky(32), sky::sky(64));
    let hall = scene("hall");
    let (a, b) = (View::new(&hall, (8, 6), 1, small), View::new(&hall, (8, 6), 1, large));
    let visibility = a.bake(Basis::Runs, &[]);
    let says = |view: &View, text: &str| {
        let error = view.stage(&visibility).layers(Progress::silent()).unwrap_err();
        assert!(error.to_string().contains(text) && !error.help().is_empty(), "{error}");
    };
    says(&b, "faces of 32 x 32 texels, the environment of 64 x 64");
    says(&View::new(&hall, (8, 7), 1, sky::sky(32)), "8 x 6 pixels");
    says(&View::new(&scene("room"), (8, 6), 1, sky::sky(32)), "different scenes");
    assert!(a.stage(&visibility).layers(Progress::silent()).is_ok());
    let objects = names(&hall);
    for (groups, text) in [
        (vec![("a b", &objects[..1])], "cannot be called"),
        (vec![("rest", &objects[..1])], "cannot be called"),
        (vec![("a", &[][..])], "lists no objects"),
        (vec![("a", &["nonsense_zzz"][..])], "nonsense_zzz"),
        (vec![("a", &objects[..2]), ("b", &objects[1..3])], "\"a\" and \"b\""),
    ] {
        let error = a.try_bake(Basis::Runs, &groups).unwrap_err();
        assert!(error.to_string().contains(text), "{error}");
    }
    let environment: &Environment = &a.transport.environment;
    assert_eq!(environment.lit_faces(), [true, false, true, true, true, true]);
    assert!(visibility.face(1).is_empty(), "a dark face is not baked");
}
