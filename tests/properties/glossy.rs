//! Glossy rows: energy against integrals by brute force, mirrors that show what is there, what rows depend on.

use crate::transfer::cuboid;
use chiaro::device::Device;
use chiaro::eval::Disk;
use chiaro::eval::disk::Found;
use chiaro::node::Key;
use chiaro::progress::Progress;
use chiaro::scene::bvh::Ray;
use chiaro::scene::geometry::{GeometryBuilder, Mesh};
use chiaro::scene::{Camera, Geometry, SurfacePoint};
use chiaro::stored::{SectionWriter, Stored};
use chiaro::transport::blocks::Blocks;
use chiaro::transport::glossy::{Gloss, GlossyTransfer, gloss_key, glossy_transfer};
use chiaro::transport::precompute::{Estimator, Placement, Quality, Settings, precompute};
use chiaro::transport::{Basis, Samples, Transfer};
use glam::{Mat4, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// A closed room with a floor of its own material (1) and a box in it; the walls are objects `wall0` to `wall4`.
fn room() -> Geometry {
    let mut builder = GeometryBuilder::default();
    let corners: Vec<[f32; 3]> = (0..8).map(|i| [0, 1, 2].map(|axis| (i >> axis & 1) as f32 * 2.0 - 1.0)).collect();
    let floor = [0, 4, 5, 1];
    let walls = [[0, 1, 3, 2], [4, 6, 7, 5], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    for (number, [a, b, c, d]) in walls.into_iter().chain([floor]).enumerate() {
        let material = u32::from(number == 5);
        let indices = [a, b, c, a, c, d];
        let mesh = Mesh { positions: &corners, normals: None, uvs: None, indices: &indices, material };
        let object = builder.object(&format!("wall{number}"));
        builder.add(object, &mesh, Mat4::from_scale(Vec3::new(3.0, 2.0, 4.0))).unwrap();
    }
    let place = Mat4::from_translation(Vec3::new(0.8, -1.2, -1.0)) * Mat4::from_rotation_y(0.4);
    cuboid(&mut builder, "box", place * Mat4::from_scale(Vec3::splat(0.8)), false);
    builder.finish(vec!["white".into(), "floor".into()]).unwrap()
}

fn transfer(geometry: &Geometry, size: (u32, u32), placement: Placement, basis: Basis) -> Transfer {
    let camera = Camera::look_at("eye", Vec3::new(-0.5, 0.3, 3.5), Vec3::new(0.3, -1.2, -1.0), 1.2);
    let samples = Samples::view(&Device::Cpu, geometry, &camera, size, 1).unwrap();
    let settings = Settings {
        gather_samples: 4096,
        bounces: 1,
        basis,
        coefficients: 4096,
        estimator: Estimator::Rays,
        glossy: Gloss::Ggx,
        quality: Quality { rays: 64, ..Quality::of(0.1, placement) },
    };
    let (mut transfer, _) =
        precompute(&Device::Cpu, geometry, &Arc::new(samples), &settings, &Blocks::none(), Progress::silent()).unwrap();
    // Diffuse rows are not looked at here: few rays do. Glossy ones take what is usual.
    transfer.settings.quality.rays = 1024;
    transfer
}

fn glossy(geometry: &Geometry, transfer: &Transfer, gloss: &[[f32; 4]], model: Gloss) -> GlossyTransfer {
    glossy_transfer(&Device::Cpu, geometry, transfer, gloss, model, Progress::silent())
        .unwrap()
        .expect("glossy samples")
}

/// Radiance to the eye by view sample, for a colour of each object (exitance over pi).
fn radiance(
    transfer: &Transfer,
    glossy: &GlossyTransfer,
    f0: f32,
    colour: impl Fn(&SurfacePoint) -> Vec3,
) -> Vec<(usize, Vec3)> {
    let light: Vec<[f32; 4]> = transfer.gather.points.iter().map(|p| (colour(p) * PI).extend(0.0).to_array()).collect();
    let parts = glossy.apply(&Device::Cpu, transfer, &light, 1).unwrap();
    let (a, s) = parts.split_at(glossy.samples.len());
    let rgb = |v: [f32; 4]| Vec3::new(v[0], v[1], v[2]);
    let sum = a.iter().zip(s).map(|(a, s)| rgb(*a) * f0 + rgb(*s));
    glossy.samples.iter().map(|&sample| sample as usize).zip(sum).collect()
}

/// The share of even light that a microfacet surface reflects to the eye: its BRDF times cosine, integrated over half
/// vectors in small steps.
fn albedo(model: Gloss, alpha: f64, f0: f64, nv: f64) -> f64 {
    let (a2, sin_v) = (alpha * alpha, (1.0 - nv * nv).max(0.0).sqrt());
    let distribution = |cos: f64| match model {
        Gloss::Blinn => cos.powf(2.0 / a2 - 2.0) / (std::f64::consts::PI * a2),
        _ => a2 / (std::f64::consts::PI * (cos * cos * (a2 - 1.0) + 1.0).powi(2)),
    };
    let lambda = |cos: f64| 0.5 * ((1.0 + a2 * (1.0 / (cos * cos) - 1.0)).sqrt() - 1.0);
    let (steps, turns) = (1000, 96);
    let mut sum = 0.0;
    for i in 0..steps {
        // Fine steps where the lobe is.
        let t = (i as f64 + 0.5) / steps as f64;
        let (theta, d_theta) =
            (0.5 * std::f64::consts::PI * t.powi(3), 1.5 * std::f64::consts::PI * t * t / steps as f64);
        let (sin, nh) = theta.sin_cos();
        for j in 0..turns {
            let phi = std::f64::consts::PI * (j as f64 + 0.5) / turns as f64;
            let vh = nv * nh + sin_v * sin * phi.cos();
            let nl = 2.0 * vh * nh - nv;
            if vh <= 0.0 || nl <= 0.0 {
                continue;
            }
            let masking = match model {
                Gloss::Blinn => (2.0 * nh * nv / vh).min(2.0 * nh * nl / vh).min(1.0),
                _ => 1.0 / (1.0 + lambda(nv) + lambda(nl)),
            };
            let fresnel = f0 + (1.0 - f0) * (1.0 - vh).powi(5);
            let brdf = fresnel * distribution(nh) * masking / (4.0 * nv * nl);
            // Solid angle of light directions: 4 (v.h) that of half vectors.
            let solid = 2.0 * sin * d_theta * std::f64::consts::PI / turns as f64;
            sum += brdf * nl * 4.0 * vh * solid;
        }
    }
    sum
}

#[test]
fn a_furnace_shows_the_albedo_of_the_lobe() {
    let geometry = room();
    let transfer = transfer(&geometry, (16, 12), Placement::Every, Basis::Cut);
    for model in [Gloss::Ggx, Gloss::Blinn] {
        for (roughness, f0) in [(0.1f32, 0.5f32), (0.25, 0.1), (0.5, 0.9), (0.8, 0.5), (1.0, 0.5)] {
            let glossy = glossy(&geometry, &transfer, &[[f0, f0, f0, roughness]; 2], model);
            assert_eq!(glossy.samples.len(), 16 * 12);
            let (mut worst, mut mean) = (0.0f64, 0.0);
            for (sample, light) in radiance(&transfer, &glossy, f0, |_| Vec3::ONE) {
                let point = &transfer.samples.points[sample];
                let eye = (transfer.samples.camera.position - Vec3::from(point.position)).normalize();
                let nv = f64::from(eye.dot(point.normal.into()));
                let expected = albedo(model, f64::from(roughness * roughness), f64::from(f0), nv);
                let error = f64::from(light.x) / expected - 1.0;
                worst = worst.max(error.abs());
                mean += error / glossy.samples.len() as f64;
            }
            println!("{model:?} roughness {roughness}: worst {worst:.4}, mean {mean:.5}");
            // One ray of a few that goes below the horizon counts.
            let most = 0.01 + glossy.places() as f64 / glossy.rays as f64;
            assert!(worst < most && mean.abs() < 0.002, "{model:?}, roughness {roughness}: {worst}, {mean}");
        }
    }
}

/// Each wall has a colour of its own.
fn painted(point: &SurfacePoint) -> Vec3 {
    const COLOURS: [Vec3; 7] = [
        Vec3::new(0.2, 0.2, 0.9),
        Vec3::new(0.5, 0.5, 0.5),
        Vec3::new(0.9, 0.9, 0.3),
        Vec3::new(0.9, 0.1, 0.1),
        Vec3::new(0.1, 0.6, 0.6),
        Vec3::new(0.3, 0.3, 0.3),
        Vec3::new(0.8, 0.4, 0.8),
    ];
    COLOURS[point.object as usize]
}

const POLISHED: [[f32; 4]; 2] = [[0.0; 4], [1.0, 1.0, 1.0, 0.12]];

/// What a flat mirror at a view sample shows, if that is one surface all around.
fn mirrored(geometry: &Geometry, transfer: &Transfer, sample: usize) -> Option<Vec3> {
    let point = &transfer.samples.points[sample];
    let (position, normal) = (Vec3::from(point.position), Vec3::from(point.normal));
    let towards = (position - transfer.samples.camera.position).normalize().reflect(normal);
    let (x, y) = towards.any_orthonormal_pair();
    let hit = |direction: Vec3| {
        let ray = Ray { origin: position + normal * 1e-4, direction, t_max: f32::INFINITY };
        geometry.object[geometry.bvh.closest(&ray).triangle as usize]
    };
    let first = hit(towards);
    let around = (0..16).all(|i| {
        let (sin, cos) = (i as f32 * PI / 8.0).sin_cos();
        [0.1, 0.3].iter().all(|wide| hit((towards + (x * cos + y * sin) * *wide).normalize()) == first)
    });
    let shown = SurfacePoint { object: first, ..SurfacePoint::NOWHERE };
    around.then(|| painted(&shown))
}

#[test]
fn a_mirror_shows_the_colour_that_is_there() {
    let geometry = room();
    for basis in [Basis::Cut, Basis::Haar] {
        let transfer = transfer(&geometry, (48, 36), Placement::Adaptive, basis);
        let mut seen = std::collections::BTreeSet::new();
        for model in [Gloss::Ggx, Gloss::Blinn] {
            let glossy = glossy(&geometry, &transfer, &POLISHED, model);
            let mut compared = 0;
            for (sample, light) in radiance(&transfer, &glossy, 1.0, painted) {
                assert_eq!(transfer.samples.points[sample].material, 1, "only the floor shines");
                let Some(expected) = mirrored(&geometry, &transfer, sample) else { continue };
                seen.insert(format!("{expected:?}"));
                compared += 1;
                // The tails of the lobe reach other walls.
                assert!((light - expected).abs().max_element() < 0.04, "{model:?} {sample}: {light}, {expected}");
            }
            assert!(compared > 150, "{compared} compared");
        }
        assert!(seen.len() >= 3, "{seen:?}");
    }
}

fn relative_rms(a: &[(usize, Vec3)], b: &[(usize, Vec3)]) -> f32 {
    let squares = |v: Vec<Vec3>| v.iter().map(|v| v.length_squared()).sum::<f32>();
    let difference = a.iter().zip(b).map(|((i, a), (j, b))| if i == j { *a - *b } else { Vec3::INFINITY }).collect();
    (squares(difference) / squares(b.iter().map(|b| b.1).collect())).sqrt()
}

#[test]
fn models_agree_on_polished_surfaces_and_interpolation_with_a_row_for_each_sample() {
    let geometry = room();
    let [adaptive, every] =
        [Placement::Adaptive, Placement::Every].map(|placement| transfer(&geometry, (48, 36), placement, Basis::Cut));
    let shown = |transfer: &Transfer, roughness: f32, model| {
        let glossy = glossy(&geometry, transfer, &[[0.0; 4], [0.9, 0.9, 0.9, roughness]], model);
        (glossy.places(), radiance(transfer, &glossy, 0.9, painted))
    };
    let polished = [Gloss::Ggx, Gloss::Blinn].map(|model| shown(&every, 0.1, model).1);
    let difference = relative_rms(&polished[0], &polished[1]);
    assert!(difference < 0.03, "models differ by {difference}");
    let rough = [Gloss::Ggx, Gloss::Blinn].map(|model| shown(&every, 0.7, model).1);
    assert!(relative_rms(&rough[0], &rough[1]) > 0.03, "the model does nothing");
    let mut sparser = Vec::new();
    for roughness in [0.1, 0.5, 0.9] {
        let (few, interpolated) = shown(&adaptive, roughness, Gloss::Ggx);
        let (all, exact) = shown(&every, roughness, Gloss::Ggx);
        let error = relative_rms(&interpolated, &exact);
        println!("roughness {roughness}: {few} of {all} places, {error}");
        assert!(error < 0.02, "roughness {roughness}: {error}");
        sparser.push(few as f32 / all as f32);
    }
    assert!(sparser[0] > 0.95 && sparser[2] < 0.6 && sparser.is_sorted_by(|a, b| a >= b), "{sparser:?}");
}

#[test]
fn rows_depend_on_roughness_and_not_on_colour() {
    let geometry = room();
    let transfer = transfer(&geometry, (24, 18), Placement::Adaptive, Basis::Cut);
    let rows = |gloss: &[[f32; 4]]| {
        let glossy = glossy(&geometry, &transfer, gloss, Gloss::Ggx);
        (glossy.rows.entries().to_vec(), glossy.samples.to_vec(), glossy.place_samples.to_vec())
    };
    let gold = [[0.0; 4], [1.0, 0.7, 0.3, 0.4]];
    let [steel, rough] = [[0.5, 0.5, 0.6, 0.4], [1.0, 0.7, 0.3, 0.5]].map(|floor| [[0.0; 4], floor]);
    let key = |gloss: &[[f32; 4]]| gloss_key(gloss, Gloss::Ggx);
    assert!(rows(&gold) == rows(&steel) && key(&gold) == key(&steel), "recoloured");
    assert!(rows(&gold).0 != rows(&rough).0 && key(&gold) != key(&rough), "another roughness");
    assert_ne!(key(&gold), gloss_key(&gold, Gloss::Blinn));
    let both = [[0.04, 0.04, 0.04, 0.4], gold[1]];
    assert!(rows(&both).1.len() > rows(&gold).1.len() && key(&both) != key(&gold), "walls that shine");
    let matte = |gloss: &[[f32; 4]], model| {
        glossy_transfer(&Device::Cpu, &geometry, &transfer, gloss, model, Progress::silent()).unwrap().is_none()
    };
    assert!(matte(&[[0.0, 0.0, 0.0, 0.3]; 2], Gloss::Ggx) && matte(&gold, Gloss::None) && !matte(&gold, Gloss::Ggx));
    let short = glossy_transfer(&Device::Cpu, &geometry, &transfer, &gold[..1], Gloss::Ggx, Progress::silent());
    assert!(short.unwrap_err().to_string().contains("1 materials"));
}

#[test]
fn glossy_rows_survive_the_disk() {
    let geometry = room();
    let transfer = transfer(&geometry, (24, 18), Placement::Adaptive, Basis::Cut);
    let glossy = glossy(&geometry, &transfer, &POLISHED, Gloss::Ggx);
    let folder = tempfile::tempdir().unwrap();
    let disk = Disk::open(folder.path(), 1 << 30).unwrap();
    let store = |name: u8, glossy: Option<GlossyTransfer>| {
        let mut sections = SectionWriter::default();
        glossy.write(&mut sections);
        disk.put(Key([name; 16]), &sections).unwrap();
        match disk.get(Key([name; 16]), <Option<GlossyTransfer>>::read) {
            Found::Value(found) => found,
            other => panic!("{other:?}"),
        }
    };
    assert!(store(1, None).is_none());
    let again = store(2, Some(glossy.clone())).unwrap();
    assert_eq!(radiance(&transfer, &again, 0.5, painted), radiance(&transfer, &glossy, 0.5, painted));
    assert_eq!((again.rays, again.bytes(), again.places()), (glossy.rays, glossy.bytes(), glossy.places()));
}
