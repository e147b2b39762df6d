//! Selections as fields over surfaces: paint that lies on surfaces and not through them, and what is made of selections.

#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/room.rs"]
mod room;

use chiaro::Error;
use chiaro::device::Device;
use chiaro::kernels::surroundings;
use chiaro::scene::geometry::{GeometryBuilder, Mesh};
use chiaro::scene::{Geometry, SurfacePoint, builtin};
use chiaro::transport::sampling::{self, hash, unit};
use chiaro::transport::selection::{Grounds, Laid, Mode, Stroke, StrokeMode};
use chiaro::transport::{Samples, Selection};
use glam::{Mat4, Vec3};
use serde_json::json;
use std::sync::Arc;

/// A rectangle from a corner along two edges; its front is the side that `u`, `v` go round counter-clockwise.
struct Sheet(&'static str, [f32; 3], [f32; 3], [f32; 3]);

fn scene(sheets: &[Sheet]) -> Arc<Geometry> {
    let mut builder = GeometryBuilder::default();
    for Sheet(name, corner, u, v) in sheets {
        let object = builder.object(name);
        let (corner, u, v) = (Vec3::from(*corner), Vec3::from(*u), Vec3::from(*v));
        let positions = [corner, corner + u, corner + u + v, corner + v].map(|p| p.to_array());
        let mesh = Mesh { positions: &positions, normals: None, uvs: None, indices: &[0, 1, 2, 0, 2, 3], material: 0 };
        builder.add(object, &mesh, Mat4::IDENTITY).unwrap();
    }
    Arc::new(builder.finish(vec!["matte".to_owned()]).unwrap())
}

fn floor() -> Sheet {
    Sheet("floor", [-4.0, 0.0, 4.0], [8.0, 0.0, 0.0], [0.0, 0.0, -8.0])
}

/// A floor, a ceiling and outer walls, with a wall at x = 0 of that thickness, without door.
fn two_rooms(thickness: f32) -> Arc<Geometry> {
    let (t, h) = (0.5 * thickness, 2.5);
    let wall = |name, x: f32, sign: f32| Sheet(name, [x, 0.0, 4.0 * sign], [0.0, 0.0, -8.0 * sign], [0.0, h, 0.0]);
    let mut sheets = vec![
        floor(),
        Sheet("ceiling", [-4.0, h, -4.0], [8.0, 0.0, 0.0], [0.0, 0.0, 8.0]),
        Sheet("back", [-4.0, 0.0, -4.0], [8.0, 0.0, 0.0], [0.0, h, 0.0]),
        Sheet("front", [4.0, 0.0, 4.0], [-8.0, 0.0, 0.0], [0.0, h, 0.0]),
        wall("left", -4.0, 1.0),
        wall("right", 4.0, -1.0),
        wall("right_face", t, 1.0),
    ];
    if thickness > 0.0 {
        sheets.push(wall("left_face", -t, -1.0));
    }
    scene(&sheets)
}

/// Points all over both sides of all surfaces, in no order.
fn everywhere(geometry: &Geometry, count: u32) -> Vec<SurfacePoint> {
    let triangles = geometry.corners.len() as u32;
    let point = |i: u32| {
        let at = sampling::triangle(sampling::shift(7 * i + 1));
        geometry.surface_point((hash(i) % triangles) as usize, at.x, at.y, hash(!i) & 1 == 0)
    };
    (0..count).map(point).collect()
}

/// On the floor, which is the first sheet.
fn on_floor(geometry: &Geometry, x: f32, z: f32) -> SurfacePoint {
    SurfacePoint { position: [x, 0.0, z], ..geometry.surface_point(0, 0.2, 0.2, true) }
}

fn dab(at: [f32; 3], radius: f32) -> Stroke {
    Stroke {
        points: vec![at],
        normals: vec![],
        radius,
        hardness: 0.5,
        value: 1.0,
        mode: StrokeMode::Add,
        adaptive: false,
        attached: None,
    }
}

fn try_paint(geometry: &Arc<Geometry>, strokes: &[Stroke]) -> chiaro::Result<(Selection, Laid)> {
    Selection::painted(&Grounds::still(geometry.clone()), strokes, |_, points| {
        surroundings(&Device::Cpu, geometry, points, 256)
    })
}

fn paint(geometry: &Arc<Geometry>, strokes: &[Stroke]) -> Arc<Selection> {
    let (selection, laid) = try_paint(geometry, strokes).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((laid.off, laid.gaps, laid.warnings), (0, 0, vec![]));
    Arc::new(selection)
}

fn close(found: f32, expected: f32) {
    assert!((found - expected).abs() < 1e-5, "{found}, expected {expected}");
}

#[test]
fn weights_on_a_floor_by_hand() {
    let geometry = scene(&[floor()]);
    let at = |selection: &Selection, x: f32, z: f32| selection.weight(&on_floor(&geometry, x, z));
    let one = paint(&geometry, &[dab([0.0; 3], 1.0)]);
    for (x, weight) in [(0.0, 1.0), (0.5, 1.0), (0.625, 0.84375), (0.75, 0.5), (0.875, 0.15625), (1.0, 0.0), (3.0, 0.0)]
    {
        close(at(&one, x, 0.0), weight);
        close(at(&one, 0.0, -x), weight);
    }
    let hard = paint(&geometry, &[Stroke { hardness: 1.0, ..dab([0.0; 3], 1.0) }]);
    assert_eq!([0.0, 0.999, 1.001].map(|x| at(&hard, x, 0.0)), [1.0, 1.0, 0.0]);
    let soft = paint(&geometry, &[Stroke { hardness: 0.0, ..dab([0.0; 3], 1.0) }]);
    close(at(&soft, 0.5, 0.0), 0.5);

    // Beside a line and past its end; no scallops between points.
    let line = Stroke { points: vec![[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]], ..dab([0.0; 3], 1.0) };
    let lines = paint(&geometry, std::slice::from_ref(&line));
    for i in 0..40 {
        close(at(&lines, -2.0 + 0.1 * i as f32, 0.75), 0.5);
    }
    close(at(&lines, 2.75, 0.0), 0.5);

    let over = |second: Stroke| paint(&geometry, &[Stroke { value: 0.5, ..line.clone() }, second]);
    close(at(&over(Stroke { value: 0.5, ..line.clone() }), 0.0, 0.0), 0.75);
    close(at(&over(Stroke { value: 0.5, ..line.clone() }), 0.0, 0.75), 0.25 + 0.25 * 0.75);
    let erase = Stroke { mode: StrokeMode::Erase, ..line.clone() };
    close(at(&over(Stroke { value: 0.5, ..erase.clone() }), 0.0, 0.0), 0.25);
    close(at(&over(erase.clone()), 0.0, 0.75), 0.25 * 0.5);
    close(at(&paint(&geometry, &[erase.clone(), line.clone()]), 0.0, 0.0), 1.0);
    let all_off = paint(&geometry, &[line.clone(), Stroke { hardness: 1.0, radius: 1.1, ..erase }]);
    let points: Vec<SurfacePoint> =
        (0..4000).map(|i| on_floor(&geometry, unit(hash(i)) * 8.0 - 4.0, unit(hash(!i)))).collect();
    assert!(lines.weights(&points).iter().any(|w| *w > 0.5) && all_off.weights(&points).iter().all(|w| *w == 0.0));
}

/// A step down of 0.1 at x = 0: the sample is 0.5 along and 0.1 off, which counts four times.
#[test]
fn what_is_off_the_plane_counts_more_and_turned_normals_fade() {
    let upper = Sheet("upper", [-4.0, 0.1, 4.0], [4.0, 0.0, 0.0], [0.0, 0.0, -8.0]);
    let geometry = scene(&[floor(), upper]);
    let painted = paint(&geometry, &[dab([-0.2, 0.1, 0.0], 1.0)]);
    let s = 0.64f32.sqrt();
    assert_eq!(s, 0.8);
    let x = (1.0 - s) / 0.5;
    let by_hand = x * x * (3.0 - 2.0 * x);
    // s = sqrt(0.48 + 0.16): along² = 0.48.
    close(painted.weight(&on_floor(&geometry, -0.2 + 0.48f32.sqrt(), 0.0)), by_hand);
    assert_eq!(painted.weight(&on_floor(&geometry, -0.3, 0.0)), 0.0, "under the sheet");

    let flat = paint(&scene(&[floor()]), &[dab([0.0; 3], 1.0)]);
    let turned = |degrees: f32| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let normal = [sin, cos, 0.0];
        flat.weight(&SurfacePoint { normal, geometric_normal: normal, ..on_floor(&geometry, 0.0, 0.0) })
    };
    assert_eq!([0.0, 29.0, 71.0, 90.0, 180.0].map(turned), [1.0, 1.0, 0.0, 0.0, 0.0]);
    close(turned(0.604f32.acos().to_degrees()), 0.5);
}

#[test]
fn a_ball_is_painted_on_the_side_that_is_touched() {
    let geometry = builtin::scene("room").unwrap().geometry;
    let centre = Vec3::new(0.9, 0.82, 0.35);
    let painted = paint(&geometry, &[dab((centre + 0.42 * Vec3::Z).to_array(), 0.3)]);
    let ball = geometry.objects.iter().position(|name| name == "ball").unwrap() as u32;
    let outside = |point: &SurfacePoint| {
        (Vec3::from(point.position) - centre).dot(point.geometric_normal.into()) > 0.0 && point.object == ball
    };
    let points: Vec<SurfacePoint> = everywhere(&geometry, 200_000).into_iter().filter(outside).collect();
    let (mut full, mut soft) = (0, 0);
    for (point, weight) in points.iter().zip(painted.weights(&points)) {
        let towards = (Vec3::from(point.position) - centre).normalize().dot(Vec3::Z);
        // The chord of a ball counts fully: 0.15 m are 20.6 degrees, 0.3 m are 41.9.
        match towards.acos().to_degrees() {
            angle if angle < 20.0 => assert_eq!(weight, 1.0, "{angle} degrees"),
            angle if angle > 42.5 => assert_eq!(weight, 0.0, "{angle} degrees"),
            _ => soft += usize::from(weight > 0.0 && weight < 1.0),
        }
        full += usize::from(weight == 1.0);
    }
    assert!(full > 100 && soft > 100, "{full} full, {soft} soft");
    // The largest brush there is reaches round until normals turn away, and no further.
    let all = paint(&geometry, &[dab((centre + 0.42 * Vec3::Z).to_array(), 1e30)]);
    for (point, weight) in points.iter().zip(all.weights(&points)) {
        let cosine = Vec3::from(point.normal).dot(Vec3::Z);
        assert!(if cosine > 0.87 { weight == 1.0 } else { weight < 1.0 || cosine > 0.86 }, "{weight} at {cosine}");
        assert!(cosine > 0.33 || weight == 0.0, "{weight} at {cosine}");
    }
}

#[test]
fn paint_in_one_room_leaves_the_other_alone() {
    for thickness in [0.0, 0.02, 0.1] {
        let geometry = two_rooms(thickness);
        let points = everywhere(&geometry, 30_000);
        let wall = -0.5 * thickness;
        for radius in [0.3, 2.0, 50.0, 1e30] {
            for (what, from, to, normal) in [
                ("floor", [-1.0, 0.0, 1.0], [-0.1, 0.0, -1.0], Vec3::Y),
                ("floor along the wall", [-0.06, 0.0, 1.0], [-0.06, 0.0, -1.0], Vec3::Y),
                ("ceiling", [-1.0, 2.5, 1.0], [-0.1, 2.5, -1.0], Vec3::NEG_Y),
                ("wall", [wall, 0.2, 1.0], [wall, 2.0, -1.0], Vec3::NEG_X),
                ("back", [-2.0, 1.0, -4.0], [-0.1, 1.0, -4.0], Vec3::Z),
            ] {
                let stroke =
                    Stroke { points: vec![from, to], normals: vec![normal.to_array(); 2], ..dab([0.0; 3], radius) };
                let weights = paint(&geometry, &[stroke]).weights(&points);
                let mut painted = 0;
                for (point, weight) in points.iter().zip(weights) {
                    let x = point.position[0] + 1e-3 * point.geometric_normal[0];
                    painted += usize::from(x < 0.0 && weight > 0.0);
                    assert!(
                        x < 0.0 || weight == 0.0,
                        "{what}, radius {radius}, wall {thickness}: {weight} at {point:?}"
                    );
                }
                assert!(painted > 5, "{what}, radius {radius}: nothing is painted, so nothing was shown");
            }
        }
    }
    // Without the wall in the way, the same paint arrives there: the test can fail.
    let open = scene(&[floor()]);
    let stroke = dab([-0.1, 0.0, 0.0], 0.3);
    assert!(paint(&open, std::slice::from_ref(&stroke)).weight(&on_floor(&open, 0.05, 0.0)) > 0.5);
    let walled = two_rooms(0.02);
    assert!(paint(&walled, &[stroke]).weight(&on_floor(&walled, 0.05, 0.0)) == 0.0);
}

/// A partition ends at z = 0; brush and sample lie 0.2 to its sides and 0.1 before its end, so the way round it is 0.4472
/// long instead of 0.4. It is found to within a few percent, never shorter.
#[test]
fn paint_goes_round_the_end_of_a_partition_by_the_length_of_the_way() {
    let partition = |length: f32, end: f32| {
        scene(&[floor(), Sheet("partition", [0.0, 0.0, end], [0.0, 0.0, -length], [0.0, 1.0, 0.0])])
    };
    let behind = |geometry: &Arc<Geometry>, radius: f32| {
        let painted = paint(geometry, &[dab([-0.2, 0.0, -0.1], radius)]);
        painted.weight(&on_floor(geometry, 0.2, -0.1))
    };
    let falloff = |s: f32| ((1.0 - s) / 0.5) * ((1.0 - s) / 0.5) * (3.0 - 2.0 * (1.0 - s) / 0.5);
    let short = partition(3.0, 0.0);
    for radius in [0.5, 0.6, 0.8] {
        let (weight, most, least) = (behind(&short, radius), falloff(0.4472 / radius), falloff(0.4472 * 1.04 / radius));
        assert!(least < weight && weight <= most, "{weight} at radius {radius}, expected {least} to {most}");
    }
    assert_eq!(behind(&short, 0.44), 0.0, "too far round");
    assert!(behind(&partition(0.3, 0.05), 0.44) == 0.0, "a post as wide is in the way, too");
    assert!(behind(&partition(0.04, -0.08), 0.44) > 0.0, "round a post");
    close(behind(&scene(&[floor()]), 0.8), 1.0);
}

/// One point of the room seen at two resolutions weighs the same, alone or among others.
#[test]
fn the_field_is_the_same_at_any_resolution() {
    let room = builtin::scene("room").unwrap();
    let geometry = &room.geometry;
    let strokes = [
        Stroke { points: vec![[-1.5, 0.0, 1.0], [0.0, 0.0, 1.2], [1.2, 0.0, 1.4]], ..dab([0.0; 3], 0.4) },
        Stroke { points: vec![[-1.0, 2.0, -2.0], [0.5, 1.0, -2.0]], adaptive: true, ..dab([0.0; 3], 0.2) },
    ];
    let painted = paint(geometry, &strokes);
    let names = Selection::by_name(geometry, &["floor".to_owned()], &[]).unwrap();
    let both = Selection::combined(Mode::Subtract, &painted, Some(&Arc::new(names))).unwrap();
    let view = |size| Samples::view(&Device::Cpu, geometry, &room.cameras[0], size, 1).unwrap().points;
    let (small, large) = (view((31, 23)), view((93, 69)));
    for selection in [&painted, &both] {
        let [few, many] = [&small, &large].map(|points| selection.weights(points));
        assert!(few.iter().filter(|w| **w > 0.0 && **w < 1.0).count() > 10);
        for (pixel, weight) in few.iter().enumerate() {
            let middle = (3 * (pixel / 31) + 1) * 93 + 3 * (pixel % 31) + 1;
            assert!((weight - many[middle]).abs() < 1e-3, "pixel {pixel}: {weight}, {}", many[middle]);
            assert_eq!(selection.weight(&small[pixel]).to_bits(), weight.to_bits());
        }
        let mut order: Vec<usize> = (0..small.len()).collect();
        order.sort_by_key(|i| hash(*i as u32));
        let shuffled: Vec<SurfacePoint> = order.iter().map(|i| small[*i]).collect();
        let weights = selection.weights(&shuffled);
        assert!(order.iter().zip(weights).all(|(i, weight)| weight.to_bits() == few[*i].to_bits()));
        assert!(few.iter().all(|weight| (0.0..=1.0).contains(weight)));
    }
}

#[test]
fn a_stroke_follows_surfaces_round_edges() {
    let room = builtin::scene("room").unwrap().geometry;
    // Two points a quarter of the ball apart: the chord runs 12 cm below its surface.
    let centre = Vec3::new(0.9, 0.82, 0.35);
    let on_ball = |direction: Vec3| (centre + 0.42 * direction.normalize()).to_array();
    let ends = [Vec3::new(1.0, 0.3, 1.0), Vec3::new(-1.0, 0.3, 1.0)];
    let painted = paint(&room, &[Stroke { points: ends.map(on_ball).to_vec(), ..dab([0.0; 3], 0.25) }]);
    for i in 0..=20 {
        let direction = ends[0].lerp(ends[1], i as f32 / 20.0).normalize();
        let at = SurfacePoint {
            position: on_ball(direction),
            normal: direction.to_array(),
            geometric_normal: direction.to_array(),
            ..SurfacePoint { object: 0, material: 0, triangle: 0, ..SurfacePoint::NOWHERE }
        };
        assert!(painted.weight(&at) > 0.99, "{} at step {i}", painted.weight(&at));
    }
    // From the floor up the wall, and from one table over a gap to the next.
    let corner = scene(&[floor(), Sheet("wall", [0.0, 0.0, -4.0], [0.0, 0.0, 8.0], [0.0, 3.0, 0.0])]);
    let normals = vec![[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    let up = Stroke { points: vec![[-0.2, 0.0, 0.0], [0.0, 0.2, 0.0]], normals, ..dab([0.0; 3], 0.3) };
    let up = paint(&corner, &[up]);
    let on_wall = SurfacePoint { position: [0.0, 0.1, 0.0], ..corner.surface_point(2, 0.2, 0.2, true) };
    assert_eq!(on_wall.geometric_normal, [-1.0, 0.0, 0.0]);
    assert!(up.weight(&on_wall) > 0.99 && up.weight(&on_floor(&corner, -0.1, 0.0)) > 0.99);
    assert!(up.weight(&on_floor(&corner, 0.1, 0.0)) == 0.0, "behind the wall");

    let table = |name, x: f32| Sheet(name, [x, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -2.0]);
    let tables = scene(&[floor(), table("a", -2.0), table("b", 1.0)]);
    let across = Stroke { points: vec![[-1.5, 1.0, 0.0], [1.5, 1.0, 0.0]], ..dab([0.0; 3], 0.2) };
    let (painted, laid) = try_paint(&tables, &[across]).unwrap();
    assert_eq!((laid.points, laid.off, laid.gaps), (2, 0, 1));
    assert!(laid.warnings[0].contains("strokes[0]"), "{:?}", laid.warnings);
    let on_table = |x: f32| SurfacePoint { position: [x, 1.0, 0.0], ..on_floor(&tables, 0.0, 0.0) };
    assert_eq!([-1.5, -1.05, 1.05, 1.5].map(|x| painted.weight(&on_table(x))), [1.0; 4]);
    assert_eq!([-1.0, 0.0, 1.0].map(|x| painted.weight(&on_floor(&tables, x, 0.0))), [0.0; 3]);
}

/// Thesis 4.4.5: small in a corner, large in the open. In a bare corner the harmonic mean grows with the distance to it.
#[test]
fn an_adaptive_brush_is_small_in_corners() {
    let geometry = two_rooms(0.02);
    let reach = |x: f32| {
        let painted = paint(&geometry, &[Stroke { adaptive: true, ..dab([x, 0.0, 0.0], 0.25) }]);
        // Along the wall, where nothing is in the way.
        (0..4000)
            .map(|i| 1e-3 * i as f32)
            .take_while(|z| painted.weight(&on_floor(&geometry, x, *z)) > 0.0)
            .last()
            .unwrap()
    };
    let reaches = [-0.05, -0.2, -0.6, -2.0].map(reach);
    assert!(reaches.is_sorted() && reaches[3] > 3.0 * reaches[0], "{reaches:?}");
    let expected = 0.25 * surroundings(&Device::Cpu, &geometry, &[on_floor(&geometry, -2.0, 0.0)], 256).unwrap()[0];
    assert!((reaches[3] - expected).abs() < 0.01, "{reaches:?}, {expected}");
    // In the middle of nothing the brush is as large as the scene, and still a number.
    let open = scene(&[floor()]);
    let painted = paint(&open, &[Stroke { adaptive: true, ..dab([0.0; 3], 0.25) }]);
    let edge = 0.25 * (64.0f32 + 64.0).sqrt();
    let weights = [edge - 0.1, edge + 0.1].map(|x| painted.weight(&on_floor(&open, x, 0.0)));
    assert!(weights[0] > 0.0 && weights[1] == 0.0, "{weights:?}");
}

#[test]
fn selections_put_together() {
    let room = builtin::scene("room").unwrap().geometry;
    let a = paint(&room, &[dab([0.0, 0.0, 1.0], 1.0)]);
    let b = paint(&room, &[dab([0.7, 0.0, 1.0], 0.9), Stroke { value: 0.4, ..dab([-1.0, 0.0, 1.0], 0.5) }]);
    let of = |mode, a: &Arc<Selection>, b: &Arc<Selection>| Selection::combined(mode, a, Some(b)).unwrap();
    let not = |a: &Arc<Selection>| Selection::combined(Mode::Invert, a, None).unwrap();
    let mut points = everywhere(&room, 60_000);
    points.extend((0..2000).map(|i| SurfacePoint {
        position: [4.0 * unit(hash(i)) - 2.0, 0.0, 4.0 * unit(hash(!i)) - 2.0],
        ..room.surface_point(0, 0.2, 0.2, true)
    }));
    points.push(SurfacePoint::NOWHERE);
    let bits = |selection: &Selection| selection.weights(&points).iter().map(|w| w.to_bits()).collect::<Vec<_>>();
    let [wa, wb] = [&a, &b].map(|selection| selection.weights(&points));
    assert!(wa.iter().zip(&wb).filter(|(a, b)| **a > 0.0 && **b > 0.0 && a != b).count() > 20);
    for (mode, by_hand) in [
        (Mode::Union, f32::max as fn(f32, f32) -> f32),
        (Mode::Intersect, f32::min),
        (Mode::Subtract, |a, b| a.min(1.0 - b)),
    ] {
        let expected: Vec<f32> = wa.iter().zip(&wb).map(|(a, b)| by_hand(*a, *b)).collect();
        assert!(of(mode, &a, &b).weights(&points) == expected, "{mode:?}");
    }
    assert!(bits(&of(Mode::Union, &a, &a)) == bits(&a) && bits(&of(Mode::Intersect, &a, &a)) == bits(&a));
    assert!(bits(&of(Mode::Union, &a, &b)) != bits(&a), "the comparison can fail");
    let inverse = not(&a);
    let weights = inverse.weights(&points);
    assert!(weights[..weights.len() - 1].iter().zip(&wa).all(|(inverse, w)| *inverse == 1.0 - w));
    assert_eq!(weights.last(), Some(&0.0), "where no surface is, nothing is selected");
    let same = |one: &Selection, other: &Selection| one.digest() == other.digest() && bits(one) == bits(other);
    assert!(same(&not(&inverse), &a));
    let union = of(Mode::Union, &inverse, &b);
    assert!(same(&not(&not(&union)), &union) && !same(&not(&union), &union));
    // De Morgan, to rounding.
    let (one, other) = (not(&of(Mode::Union, &a, &b)), of(Mode::Intersect, &not(&a), &not(&b)));
    assert!(bits(&one) == bits(&other));

    // Order where it does not matter, and where it does.
    assert_eq!(of(Mode::Union, &a, &b).digest(), of(Mode::Union, &b, &a).digest());
    assert_ne!(of(Mode::Subtract, &a, &b).digest(), of(Mode::Subtract, &b, &a).digest());
    let all = [a.clone(), b.clone(), inverse.clone(), of(Mode::Union, &a, &b), of(Mode::Intersect, &a, &b)];
    for (i, one) in all.iter().enumerate() {
        assert!(all[..i].iter().all(|other| other.digest() != one.digest()), "selection {i}");
    }

    // A selection that holds itself twice, a hundred times over, is still evaluated once.
    let mut deep = b.clone();
    for _ in 0..100 {
        deep = of(Mode::Subtract, &deep, &not(&deep));
        deep = of(Mode::Union, &deep, &of(Mode::Intersect, &a, &deep));
    }
    // b less what is not in b is b, but for the rounding of 1 - (1 - w).
    assert!(deep.weights(&points).iter().zip(&wb).all(|(deep, b)| (deep - b).abs() < 1e-6));
}

#[test]
fn what_cannot_be_put_together_is_refused() {
    let room = builtin::scene("room").unwrap().geometry;
    let a = paint(&room, &[dab([0.0, 0.0, 1.0], 1.0)]);
    let elsewhere = scene(&[floor()]);
    let foreign = paint(&elsewhere, &[dab([0.0; 3], 1.0)]);
    let refused = |mode, b: Option<&Arc<Selection>>, words: [&str; 2]| {
        let error = Selection::combined(mode, &a, b).unwrap_err();
        let text = format!("{error}: {}", error.help());
        assert!(matches!(error, Error::Compute { .. }) && words.iter().all(|word| text.contains(word)), "{text}");
    };
    for (mode, name) in [(Mode::Union, "union"), (Mode::Intersect, "intersect"), (Mode::Subtract, "subtract")] {
        refused(mode, None, [name, "connect b"]);
        refused(mode, Some(&foreign), ["different scenes", "connect the same scene"]);
    }
    refused(Mode::Invert, Some(&a), ["invert", "take b off"]);
    let mixed = Selection::combined(Mode::Invert, &a, None).unwrap();
    for selection in [&a, &mixed] {
        assert!(selection.check(&room.fingerprint).is_ok() && selection.check(&elsewhere.fingerprint).is_err());
    }
}

#[test]
fn every_field_of_a_stroke_is_in_the_digest() {
    let geometry = two_rooms(0.02);
    let stroke = Stroke { points: vec![[-1.0, 0.0, 0.0], [-2.0, 0.0, 0.5]], ..dab([0.0; 3], 0.3) };
    let digest = |stroke: &Stroke| paint(&geometry, std::slice::from_ref(stroke)).digest();
    let changed = [
        stroke.clone(),
        Stroke { points: vec![[-1.0, 0.0, 0.0], [-2.0, 0.0, 0.51]], ..stroke.clone() },
        Stroke { points: vec![[-1.0, 0.0, 0.0]], ..stroke.clone() },
        Stroke { normals: vec![[0.0, 1.0, 0.0], [0.1, 1.0, 0.0]], ..stroke.clone() },
        Stroke { radius: 0.31, ..stroke.clone() },
        Stroke { hardness: 0.51, ..stroke.clone() },
        Stroke { value: 0.99, ..stroke.clone() },
        Stroke { mode: StrokeMode::Erase, ..stroke.clone() },
        Stroke { adaptive: true, ..stroke.clone() },
    ];
    for (i, one) in changed.iter().enumerate() {
        assert_eq!(digest(one), digest(one));
        assert!(changed[..i].iter().all(|other| digest(other) != digest(one)), "{one:?}");
    }
    let twice = paint(&geometry, &[stroke.clone(), stroke.clone()]);
    assert_ne!(twice.digest(), digest(&stroke), "a second coat");
    let other = two_rooms(0.1);
    assert_ne!(paint(&other, std::slice::from_ref(&stroke)).digest(), digest(&stroke), "another geometry");
}

#[test]
fn strokes_that_make_no_sense_are_named() {
    let geometry = scene(&[floor()]);
    let good = Stroke { points: vec![[0.0; 3], [1.0, 0.0, 0.0]], ..dab([0.0; 3], 0.3) };
    let nan = f32::NAN;
    for (bad, words) in [
        (Stroke { radius: 0.0, ..good.clone() }, "strokes[1].radius is 0"),
        (Stroke { radius: -1.0, ..good.clone() }, "strokes[1].radius is -1"),
        (Stroke { radius: nan, ..good.clone() }, "strokes[1].radius is NaN"),
        (Stroke { radius: f32::INFINITY, ..good.clone() }, "strokes[1].radius is inf"),
        (Stroke { hardness: 1.5, ..good.clone() }, "strokes[1].hardness is 1.5"),
        (Stroke { hardness: nan, ..good.clone() }, "strokes[1].hardness is NaN"),
        (Stroke { value: -0.1, ..good.clone() }, "strokes[1].value is -0.1"),
        (Stroke { points: vec![], ..good.clone() }, "strokes[1].points is empty"),
        (Stroke { points: vec![[0.0; 3], [0.0, nan, 0.0]], ..good.clone() }, "strokes[1].points[1] is [0.0, NaN, 0.0]"),
        (Stroke { normals: vec![[0.0, 1.0, 0.0]; 3], ..good.clone() }, "strokes[1].normals has 3 for 2 points"),
        (Stroke { normals: vec![[0.0; 3]; 2], ..good.clone() }, "strokes[1].normals[0] is [0.0, 0.0, 0.0]"),
        (Stroke { normals: vec![[nan; 3]; 2], ..good.clone() }, "strokes[1].normals[0]"),
        (
            Stroke { points: vec![[0.0, 7.0, 0.0], [0.0, 2.0, 0.0]], ..good.clone() },
            "strokes[1] touches no surface: its nearest point is 2.000 m away from one, and half the radius is 0.150 m",
        ),
    ] {
        let error = try_paint(&geometry, &[good.clone(), bad]).unwrap_err();
        assert!(error.to_string().contains(words) && !error.help().is_empty(), "{error}");
    }
    let partly = Stroke { points: vec![[0.0, 9.0, 0.0], [1.0, 0.1, 0.0], [2.0, 9.0, 0.0]], ..good.clone() };
    let (painted, laid) = try_paint(&geometry, &[good, partly]).unwrap();
    assert_eq!((laid.points, laid.off, laid.warnings.len()), (5, 2, 1));
    assert!(laid.warnings[0].starts_with("strokes[1]: 2 of 3 points"), "{:?}", laid.warnings);
    assert_eq!([1.2, 1.8].map(|x| painted.weight(&on_floor(&geometry, x, 0.0)) > 0.0), [true, false]);
    let (none, _) = try_paint(&geometry, &[]).unwrap();
    assert!(none.weights(&everywhere(&geometry, 1000)).iter().all(|weight| *weight == 0.0));
}

/// A stroke that grows pays for its new points alone, and an edit of anything else for none.
#[test]
fn surroundings_are_computed_once_for_each_point() {
    let evaluator = room::evaluator();
    let computed = |points: serde_json::Value, hardness: f32, scene: &str| {
        let stroke = json!({ "points": points, "radius": 0.2, "hardness": hardness, "adaptive": true });
        let plan = room::recipe(json!({
            "paint": { "type": "paint", "params": { "strokes": [stroke] }, "inputs": { "scene": scene } },
            "lamp": { "type": "light", "inputs": { "scene": "room" } },
        }));
        let (_, report) = room::evaluate(&evaluator, &plan, "paint", 1);
        report.iter().find(|node| node.node == "paint").unwrap().notes["surroundings_computed"].as_u64().unwrap()
    };
    let two = json!([[0.0, 0.0, 1.0], [0.2, 0.0, 1.0]]);
    let three = json!([[0.0, 0.0, 1.0], [0.2, 0.0, 1.0], [0.4, 0.0, 1.0]]);
    assert_eq!(computed(two.clone(), 0.5, "room"), 2);
    assert_eq!(computed(three.clone(), 0.5, "room"), 1);
    assert_eq!(computed(two, 0.6, "room"), 0);
    assert_eq!(computed(three, 0.7, "lamp"), 0, "a lamp moves no surface");
}
