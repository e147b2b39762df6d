//! Masks of visibility against rays, horizons and figures worked out by hand.

mod support;

use chiaro::device::Device;
use chiaro::kernels::primary_visibility::primary_visibility;
use chiaro::kernels::visibility_masks;
use chiaro::scene::geometry::{GeometryBuilder, Mesh};
use chiaro::scene::{Geometry, Occluders, Scene, SurfacePoint, builtin, cube, file};
use chiaro::transport::sampling;
use glam::{Mat4, Vec3};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;
use std::time::Duration;

fn masks(occluders: &Occluders, points: &[SurfacePoint], face: usize, size: usize) -> Vec<u32> {
    visibility_masks(&Device::Cpu, occluders, points, face, size, None).unwrap()
}

fn bit(mask: &[u32], texel: usize) -> bool {
    mask[texel / 32] >> (texel % 32) & 1 == 1
}

fn count(mask: &[u32]) -> usize {
    mask.iter().map(|word| word.count_ones() as usize).sum()
}

/// A geometry of one object.
fn geometry(triangles: &[[Vec3; 3]]) -> Geometry {
    let positions: Vec<[f32; 3]> = triangles.iter().flatten().map(|p| p.to_array()).collect();
    let indices: Vec<u32> = (0..positions.len() as u32).collect();
    let mut builder = GeometryBuilder::default();
    let object = builder.object("it");
    let mesh = Mesh { positions: &positions, normals: None, uvs: None, indices: &indices, material: 0 };
    builder.add(object, &mesh, Mat4::IDENTITY).unwrap();
    builder.finish(vec!["grey".to_owned()]).unwrap()
}

fn quad(corners: [Vec3; 4]) -> [[Vec3; 3]; 2] {
    let [a, b, c, d] = corners;
    [[a, b, c], [a, c, d]]
}

/// The square `x`, `z` in [-half, half] at height `y`.
fn ceiling(half: f32, y: f32) -> Vec<[Vec3; 3]> {
    quad([[-half, -half], [half, -half], [half, half], [-half, half]].map(|[x, z]| Vec3::new(x, y, z))).to_vec()
}

fn point(position: Vec3, normal: Vec3) -> SurfacePoint {
    let normal = normal.to_array();
    SurfacePoint {
        position: position.to_array(),
        normal,
        geometric_normal: normal,
        object: 0,
        material: 0,
        triangle: 0,
    }
}

/// obvhs by itself: one ray a texel.
struct Rays {
    tree: CwBvh,
    triangles: Vec<Triangle>,
    lift: f32,
}

impl Rays {
    fn new(geometry: &Geometry) -> Self {
        let triangles: Vec<Triangle> = geometry
            .corners
            .iter()
            .map(|[a, b, c]| Triangle { v0: (*a).into(), v1: (*b).into(), v2: (*c).into() })
            .collect();
        let params = BvhBuildParams { pre_split: false, ..BvhBuildParams::medium_build() };
        let tree = build_cwbvh_from_tris(&triangles, params, &mut Duration::default());
        Self { tree, triangles, lift: geometry.lift() }
    }

    /// A hit where the ray starts is none.
    fn ray(&self, point: &SurfacePoint, direction: Vec3) -> Ray {
        let origin = sampling::lifted(point.position.into(), point.geometric_normal.into(), self.lift);
        Ray::new(origin.into(), direction.into(), f32::MIN_POSITIVE, f32::INFINITY)
    }

    fn open(&self, point: &SurfacePoint, direction: Vec3) -> bool {
        Vec3::from(point.normal).dot(direction) > 0.0
            && self.tree.ray_traverse_miss(self.ray(point, direction), |ray, id| {
                self.triangles[self.tree.primitive_indices[id] as usize].intersect(ray)
            })
    }

    /// By all triangles: close to flat boxes the tree skips some that are hit.
    fn open_by_all(&self, point: &SurfacePoint, direction: Vec3) -> bool {
        let ray = self.ray(point, direction);
        Vec3::from(point.normal).dot(direction) > 0.0
            && self.triangles.iter().all(|triangle| triangle.intersect(&ray) == f32::INFINITY)
    }

    /// Texels where a mask differs from rays; an error when one of them is not next to an edge: when all rays within a
    /// 500th of a texel's side agree with its own.
    fn compare(&self, mask: &[u32], point: &SurfacePoint, face: usize, size: usize) -> Result<usize, String> {
        let mut differ = 0;
        for texel in 0..size * size {
            let direction = cube::texel_point(face * size * size + texel, size);
            let drawn = bit(mask, texel);
            if drawn == (point.exists() && self.open(point, direction)) || drawn == self.open_by_all(point, direction) {
                continue;
            }
            let step = 0.004 / size as f32;
            let (axis, _) = cube::axis(face);
            let near = (0..9).any(|i| {
                let mut other = direction;
                other[(axis + 1) % 3] += step * (i % 3 - 1) as f32;
                other[(axis + 2) % 3] += step * (i / 3 - 1) as f32;
                self.open_by_all(point, other) == drawn
            });
            if !near {
                return Err(format!("texel {texel} of face {face} at {:?} is far from any edge", point.position));
            }
            differ += 1;
        }
        Ok(differ)
    }
}

/// What the camera of a scene sees.
fn seen(scene: &Scene, width: u32, height: u32) -> Vec<SurfacePoint> {
    let seen = primary_visibility(&Device::Cpu, &scene.geometry, &scene.cameras[0], (width, height), &[[0.5; 2]]);
    seen.unwrap().points
}

/// Compares all faces; at most one texel of ten thousand may differ.
fn compare_with_rays(name: &str, scene: &Scene, points: &[SurfacePoint], size: usize) {
    let rays = Rays::new(&scene.geometry);
    let occluders = Occluders::new(&scene.geometry, |_| true);
    let (mut differ, mut open, mut texels) = (0, 0, 0);
    for face in 0..cube::FACES {
        let masks = masks(&occluders, points, face, size);
        for (mask, point) in masks.chunks(size * size / 32).zip(points) {
            differ += rays.compare(mask, point, face, size).unwrap();
            open += count(mask);
            texels += size * size;
        }
    }
    eprintln!("{name}: {differ} of {texels} texels differ, {open} are open");
    assert!(open > texels / 100 && open < texels / 2, "{name}: {open} of {texels} texels are open");
    assert!(differ * 10_000 < texels, "{name}: {differ} of {texels} texels differ");
}

#[test]
fn masks_are_what_rays_see_in_the_room() {
    let scene = builtin::scene("room").unwrap();
    compare_with_rays("room", &scene, &seen(&scene, 23, 17), 64);
}

#[test]
fn masks_are_what_rays_see_in_the_hall() {
    let scene = builtin::scene("hall").unwrap();
    compare_with_rays("hall", &scene, &seen(&scene, 19, 13), 64);
}

#[test]
fn masks_are_what_rays_see_on_the_plaza() {
    let Some(path) = support::all_data("masks_are_what_rays_see_on_the_plaza", &["scenes/plaza.glb"]).pop() else {
        return;
    };
    let (scene, _) = file::read(&path, 1.0).unwrap();
    compare_with_rays("plaza", &scene, &seen(&scene, 17, 13), 128);
}

/// The negative control of the comparisons above.
#[test]
fn a_wrong_texel_is_found() {
    let scene = builtin::scene("hall").unwrap();
    let points: Vec<SurfacePoint> = seen(&scene, 5, 3).into_iter().filter(SurfacePoint::exists).collect();
    let rays = Rays::new(&scene.geometry);
    let masks = masks(&Occluders::new(&scene.geometry, |_| true), &points, 2, 32);
    let mut found = 0;
    for (mask, point) in masks.chunks(32).zip(&points) {
        for texel in [0, 495, 528, 1023] {
            let mut spoilt = mask.to_vec();
            spoilt[texel / 32] ^= 1 << (texel % 32);
            found += usize::from(rays.compare(&spoilt, point, 2, 32).is_err());
        }
    }
    assert!(found * 10 > 4 * points.len() * 9, "{found} of {} spoilt texels were found", 4 * points.len());
}

#[test]
fn a_quad_overhead_covers_its_projection() {
    // Half side 0.5 at height 1: |u|, |v| < 1/2 of the top face, 16 x 16 of 32 x 32 texels.
    let occluders = Occluders::new(&geometry(&ceiling(0.5, 1.0)), |_| true);
    let up = point(Vec3::ZERO, Vec3::Y);
    let top = masks(&occluders, &[up], 2, 32);
    for texel in 0..1024 {
        let (x, y) = (texel % 32, texel / 32);
        let covered = (8..24).contains(&x) && (8..24).contains(&y);
        assert_eq!(bit(&top, texel), !covered, "texel {x}, {y}");
    }
    // Of the sides, the half above the horizon; of the bottom, nothing.
    for face in [0, 1, 4, 5] {
        assert_eq!(count(&masks(&occluders, &[up], face, 32)), 512, "face {face}");
    }
    assert_eq!(count(&masks(&occluders, &[up], 3, 32)), 0);
    // Looking down at it from above, from below it nothing is seen behind.
    let above = point(Vec3::new(0.0, 2.0, 0.0), Vec3::NEG_Y);
    assert_eq!(count(&masks(&occluders, &[above], 3, 32)), 1024 - 256);
    assert_eq!(count(&masks(&occluders, &[point(Vec3::new(0.0, 2.0, 0.0), Vec3::Y)], 2, 32)), 1024);
}

#[test]
fn without_occluders_there_is_only_the_horizon() {
    let scene = builtin::scene("hall").unwrap();
    let nothing = Occluders::new(&scene.geometry, |_| false);
    assert_eq!(nothing.triangles(), 0);
    let size = 64;
    for normal in [Vec3::Y, Vec3::NEG_X, Vec3::new(1.0, 2.1, -3.7).normalize(), Vec3::new(0.7, -0.13, 0.11).normalize()]
    {
        let mut texels = 0;
        for face in 0..cube::FACES {
            let mask = masks(&nothing, &[point(Vec3::ONE, normal)], face, size);
            for texel in 0..size * size {
                let direction = cube::texel_point(face * size * size + texel, size);
                assert_eq!(bit(&mask, texel), normal.dot(direction) > 0.0, "face {face}, texel {texel}, {normal}");
            }
            texels += count(&mask);
        }
        // Directions exactly along the horizon are on neither side.
        assert!((3 * size * size - 8..=3 * size * size).contains(&texels), "{normal}: {texels}");
    }
}

#[test]
fn only_wanted_texels_of_points_that_exist_are_set() {
    let scene = builtin::scene("hall").unwrap();
    let occluders = Occluders::new(&scene.geometry, |_| true);
    let mut points = seen(&scene, 9, 7);
    points[5] = SurfacePoint::NOWHERE;
    let size = 64;
    let wanted: Vec<u32> = (0..size * size / 32).map(|word| sampling::hash(word as u32)).collect();
    for face in 0..cube::FACES {
        let all = masks(&occluders, &points, face, size);
        let some = visibility_masks(&Device::Cpu, &occluders, &points, face, size, Some(&wanted)).unwrap();
        assert_eq!(count(&all[5 * wanted.len()..][..wanted.len()]), 0);
        for (i, (all, some)) in all.iter().zip(&some).enumerate() {
            assert_eq!(all & wanted[i % wanted.len()], *some, "word {i}");
        }
    }
    assert!(visibility_masks(&Device::Cpu, &occluders, &points, 0, 48, None).is_err());
    assert!(visibility_masks(&Device::Cpu, &occluders, &points, 6, 64, None).is_err());
    assert!(visibility_masks(&Device::Cpu, &occluders, &points, 0, 64, Some(&wanted[1..])).is_err());
    assert!(masks(&occluders, &[], 0, 64).is_empty());
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let scene = builtin::scene("hall").unwrap();
    let occluders = Occluders::new(&scene.geometry, |_| true);
    let points = seen(&scene, 31, 23);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (0..6).map(|face| masks(&occluders, &points, face, 64)).collect::<Vec<_>>())
    };
    assert!(run(1) == run(2));
}

/// The visibility of two groups together is that of all.
#[test]
fn groups_multiply() {
    let scene = builtin::scene("hall").unwrap();
    let points = seen(&scene, 11, 9);
    let of = |casts: fn(u32) -> bool| Occluders::new(&scene.geometry, casts);
    let (all, even, odd) = (of(|_| true), of(|i| i % 2 == 0), of(|i| i % 2 == 1));
    assert_eq!(all.triangles(), even.triangles() + odd.triangles());
    assert!(even.triangles() > 0 && odd.triangles() > 0);
    for face in 0..6 {
        let [all, even, odd] = [&all, &even, &odd].map(|occluders| masks(occluders, &points, face, 64));
        assert!(all != even && all != odd || count(&all) == 0);
        assert!(all.iter().zip(even.iter().zip(&odd)).all(|(all, (even, odd))| *all == even & odd));
    }
}

/// Neighbours share edges without a gap: a closed box hides everything from inside, however it is cut.
#[test]
fn nothing_is_seen_from_inside_a_box() {
    let mut triangles = Vec::new();
    for face in 0..cube::FACES {
        // 7 x 7 quads a face, cut by turns along one and the other diagonal.
        for (i, j) in (0..49).map(|k| (k / 7, k % 7)) {
            let at = |i: i32, j: i32| {
                cube::point(face, i as f32 / 3.5 - 1.0, j as f32 / 3.5 - 1.0) * Vec3::new(1.0, 1.7, 0.6)
            };
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let turned = [corners[1], corners[2], corners[3], corners[0]];
            triangles.extend(quad(if (i + j) % 2 == 0 { corners } else { turned }));
        }
    }
    let occluders = Occluders::new(&geometry(&triangles), |_| true);
    let mut points: Vec<SurfacePoint> = (0..300u32)
        .map(|i| {
            let unit = |k: u32| sampling::unit(sampling::hash(3 * i + k)) * 1.9 - 0.95;
            let position = Vec3::new(unit(0), 1.7 * unit(1), 0.6 * unit(2));
            point(position, Vec3::new(unit(2), unit(0), unit(1)).normalize())
        })
        .collect();
    // Where edges and texel middles line up.
    points.push(point(Vec3::ZERO, Vec3::Y));
    for face in 0..6 {
        assert_eq!(count(&masks(&occluders, &points, face, 128)), 0, "face {face}");
    }
}

/// Points where projection has no good answer: what rays say is what is drawn, but next to edges.
#[test]
fn awkward_points_see_what_rays_see() {
    let wall = |z: f32| quad([[-2.0, -1.0], [3.0, -1.0], [3.0, 2.0], [-2.0, 2.0]].map(|[x, y]| Vec3::new(x, y, z)));
    let mut triangles = ceiling(1.0, 1.0);
    triangles.extend(wall(-1.5));
    triangles.extend(wall(2.5));
    triangles.push([Vec3::new(-1.0, 0.5, -1.0), Vec3::new(2.0, 0.25, 1.5), Vec3::new(0.25, 3.0, 0.75)]);
    let geometry = geometry(&triangles);
    let (rays, occluders) = (Rays::new(&geometry), Occluders::new(&geometry, |_| true));
    let normal = Vec3::new(0.3, 0.9, 0.2).normalize();
    let mut different = 0;
    for position in [
        // On an edge, on a corner, on a diagonal, in the plane beside it, in two planes, behind all.
        Vec3::new(0.3, 1.0, 1.0),
        Vec3::new(1.0, 1.0, 1.0),
        Vec3::new(0.0, 1.0, 0.0),
        Vec3::new(4.0, 1.0, 0.3),
        Vec3::new(0.0, 1.0, -1.5),
        Vec3::new(0.0, 0.3, 9.0),
        Vec3::new(-7.0, -3.0, -1.5),
    ] {
        for normal in [normal, -normal, Vec3::Y, Vec3::NEG_Z] {
            let point = point(position, normal);
            for face in 0..6 {
                different += rays.compare(&masks(&occluders, &[point], face, 64), &point, face, 64).unwrap();
            }
        }
    }
    // Of 7 x 4 x 6 x 4096 texels; several walls are seen exactly from the side.
    assert!(different < 69, "{different} texels differ");
}

/// The same shapes at other sizes look the same: powers of two change no rounding.
#[test]
fn size_does_not_matter() {
    let shapes: Vec<[Vec3; 3]> = (0..40u32)
        .map(|i| {
            let at = |k: u32| sampling::unit(sampling::hash(9 * i + k)) * 4.0 - 2.0;
            let centre = Vec3::new(at(0), at(1), at(2));
            [centre, centre + 0.5 * Vec3::new(at(3), at(4), at(5)), centre + 0.5 * Vec3::new(at(6), at(7), at(8))]
        })
        .collect();
    let draw = |scale: f32| {
        let scaled: Vec<[Vec3; 3]> = shapes.iter().map(|t| t.map(|p| p * scale)).collect();
        let occluders = Occluders::new(&geometry(&scaled), |_| true);
        assert_eq!(occluders.triangles(), 40);
        let point = point(Vec3::new(0.1, 0.2, -0.3) * scale, Vec3::new(0.5, 0.7, 0.2).normalize());
        (0..6).map(|face| masks(&occluders, &[point], face, 64)).collect::<Vec<_>>()
    };
    let one = draw(1.0);
    assert!(one.iter().map(|mask| count(mask)).sum::<usize>() > 2000);
    for scale in [f32::powi(2.0, -14), f32::powi(2.0, 28)] {
        assert!(draw(scale) == one, "at scale {scale}");
    }
}
