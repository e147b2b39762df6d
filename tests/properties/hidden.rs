//! Hidden rows: what a row sees of a caster and what is hidden from it add up to what it would see without occluders.

use chiaro::device::Device;
use chiaro::eval::Disk;
use chiaro::eval::disk::Found;
use chiaro::kernels::hidden_rows::{Walk, hidden_rows as cast};
use chiaro::kernels::sparse_product;
use chiaro::kernels::transfer_rows::unit_ray;
use chiaro::node::Key;
use chiaro::progress::Progress;
use chiaro::scene::geometry::{GeometryBuilder, Mesh};
use chiaro::scene::{Camera, Geometry, SurfacePoint};
use chiaro::stored::{SectionWriter, Stored};
use chiaro::transport::blocks::Blocks;
use chiaro::transport::gather::Gather;
use chiaro::transport::glossy::Gloss;
use chiaro::transport::hidden::{Hidden, LAYERS, hidden_rows};
use chiaro::transport::precompute::{Estimator, Placement, Quality, Settings, precompute};
use chiaro::transport::{Basis, Samples, SparseRows, Transfer, sampling};
use glam::{Mat4, Vec3};
use std::sync::Arc;

use crate::transfer::cuboid;

pub fn room(with_block: bool) -> Geometry {
    let mut builder = GeometryBuilder::default();
    // The wall is an object of its own: no cell at its edge takes a sample of another.
    for (name, faces) in [("wall", 4..5), ("room", 0..4), ("room", 5..6)] {
        walls(&mut builder, name, faces);
    }
    if with_block {
        let place = Mat4::from_translation(Vec3::new(0.4, -0.5, -1.0)) * Mat4::from_rotation_y(0.4);
        cuboid(&mut builder, "block", place * Mat4::from_scale(Vec3::splat(0.9)), false);
    }
    builder.finish(vec!["white".into()]).unwrap()
}

/// Some faces of a room, seen from within; face 4 is at the least x.
fn walls(builder: &mut GeometryBuilder, name: &str, faces: std::ops::Range<usize>) {
    let corners: Vec<[f32; 3]> = (0..8).map(|i| [0, 1, 2].map(|axis| (i >> axis & 1) as f32 * 2.0 - 1.0)).collect();
    let all = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let indices: Vec<u32> = all[faces].iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).collect();
    let mesh = Mesh { positions: &corners, normals: None, uvs: None, indices: &indices, material: 0 };
    let object = builder.object(name);
    builder.add(object, &mesh, Mat4::from_scale(Vec3::new(3.0, 2.0, 4.0))).unwrap();
}

pub fn transfer(geometry: &Geometry, basis: Basis) -> Transfer {
    let camera = Camera::look_at("eye", Vec3::new(-1.5, 0.8, 3.5), Vec3::new(0.3, -0.5, -1.0), 1.2);
    let samples = Samples::view(&Device::Cpu, geometry, &camera, (24, 18), 1).unwrap();
    let settings = Settings {
        gather_samples: 2048,
        bounces: 1,
        basis,
        coefficients: 2048,
        estimator: Estimator::Rays,
        glossy: Gloss::None,
        quality: Quality::of(0.1, Placement::Every),
    };
    precompute(&Device::Cpu, geometry, &Arc::new(samples), &settings, &Blocks::none(), Progress::silent()).unwrap().0
}

/// The left wall is the first object.
fn left(point: &SurfacePoint) -> bool {
    point.object == 0
}

fn weights(transfer: &Transfer, is: impl Fn(&SurfacePoint) -> bool) -> Vec<f32> {
    transfer.gather.points.iter().map(|point| f32::from(u8::from(is(point)))).collect()
}

/// What rows get from casters of exitance 1, by view sample.
fn product(transfer: &Transfer, rows: &SparseRows, caster: &[f32]) -> Vec<(usize, f32)> {
    let light: Vec<[f32; 4]> = caster.iter().map(|&w| [w; 4]).collect();
    let encoded = transfer.encode(&Device::Cpu, &light, 1).unwrap();
    let products = sparse_product(&Device::Cpu, rows, &encoded, 1).unwrap();
    transfer.row_samples.iter().zip(products).map(|(&sample, light)| (sample as usize, light[0])).collect()
}

fn hidden(geometry: &Geometry, transfer: &Transfer, admitted: &[f32], wanted: &[bool]) -> Hidden {
    hidden_rows(&Device::Cpu, geometry, transfer, admitted, wanted, Progress::silent()).unwrap()
}

#[test]
fn seen_and_hidden_add_up_to_what_is_there_without_the_block() {
    let (with, without) = (room(true), room(false));
    let expected = {
        let transfer = transfer(&without, Basis::Cut);
        let wall = weights(&transfer, left);
        let samples = transfer.samples.clone();
        (samples, product(&transfer, &transfer.rows, &wall).into_iter().collect::<std::collections::HashMap<_, _>>())
    };
    for basis in [Basis::Cut, Basis::Haar] {
        let transfer = transfer(&with, basis);
        let wall = weights(&transfer, left);
        let all = vec![true; transfer.rows.rows()];
        let hidden = hidden(&with, &transfer, &wall, &all);
        assert_eq!(hidden.dropped, 0);
        let visible = product(&transfer, &transfer.rows, &wall);
        let behind = product(&transfer, &hidden.rows, &wall);
        let (mut compared, mut shadowed) = (0, 0);
        for ((sample, seen), (_, behind)) in visible.into_iter().zip(behind) {
            if transfer.samples.points[sample] != expected.0.points[sample] {
                continue;
            }
            compared += 1;
            shadowed += usize::from(behind > 0.02);
            let whole = expected.1[&sample];
            assert!((seen + behind - whole).abs() < 1e-4, "{basis:?} sample {sample}: {seen} + {behind}, {whole}");
        }
        assert!(compared > 200 && shadowed > 40, "{compared} compared, {shadowed} in shadow");
    }
}

#[test]
fn only_what_is_asked_for_is_found() {
    let geometry = room(true);
    let transfer = transfer(&geometry, Basis::Cut);
    let wall = weights(&transfer, left);
    let whole = hidden(&geometry, &transfer, &wall, &vec![true; transfer.rows.rows()]);
    let wanted: Vec<bool> = (0..transfer.rows.rows()).map(|row| row % 7 < 2).collect();
    let some = hidden(&geometry, &transfer, &wall, &wanted);
    assert_eq!(some.rows.rows(), transfer.rows.rows());
    for (row, wanted) in wanted.iter().enumerate() {
        let found: Vec<_> = some.rows.row(row).collect();
        assert_eq!(found, if *wanted { whole.rows.row(row).collect() } else { vec![] }, "row {row}");
    }
    assert!(some.rows.entries().len() > 100);
    let nothing = hidden(&geometry, &transfer, &vec![0.0; wall.len()], &wanted);
    assert!(nothing.rows.entries().is_empty() && nothing.rows.rows() == transfer.rows.rows());
    let short = hidden_rows(&Device::Cpu, &geometry, &transfer, &wall, &wanted[1..], Progress::silent());
    assert!(short.unwrap_err().to_string().contains("rows"));
}

#[test]
fn a_room_without_occluders_hides_nothing() {
    let geometry = room(false);
    let transfer = transfer(&geometry, Basis::Cut);
    let everything = vec![1.0; transfer.gather.count()];
    let hidden = hidden(&geometry, &transfer, &everything, &vec![true; transfer.rows.rows()]);
    assert!(hidden.rows.entries().is_empty(), "{} entries", hidden.rows.entries().len());
    assert_eq!(hidden.dropped, 0);
}

#[test]
fn hidden_rows_survive_the_disk() {
    let geometry = room(true);
    let transfer = transfer(&geometry, Basis::Cut);
    let hidden = Hidden {
        dropped: 7,
        ..hidden(&geometry, &transfer, &weights(&transfer, left), &vec![true; transfer.rows.rows()])
    };
    let folder = tempfile::tempdir().unwrap();
    let disk = Disk::open(folder.path(), 1 << 30).unwrap();
    let mut sections = SectionWriter::default();
    hidden.write(&mut sections);
    disk.put(Key([1; 16]), &sections).unwrap();
    let Found::Value(again) = disk.get(Key([1; 16]), Hidden::read) else { panic!("not found") };
    assert_eq!(again.dropped, 7);
    let entries = |hidden: &Hidden| (hidden.rows.entries().to_vec(), hidden.rows.offsets().to_vec());
    assert_eq!(entries(&again), entries(&hidden));
}

/// Seven plates above each other: a ray from the lowest meets those above it in order, until it leaves at their sides.
#[test]
fn layers_are_found_in_order_and_counted() {
    const WIDE: f32 = 16.0;
    let mut builder = GeometryBuilder::default();
    for height in 0..7 {
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
        let corners = corners.map(|[x, z]| [WIDE * x, height as f32, WIDE * z]);
        let mesh = Mesh { positions: &corners, normals: None, uvs: None, indices: &[0, 1, 2, 0, 2, 3], material: 0 };
        let object = builder.object(&format!("plate{height}"));
        builder.add(object, &mesh, Mat4::IDENTITY).unwrap();
    }
    let geometry = builder.finish(vec!["white".into()]).unwrap();
    let point = geometry.surface_point(0, 0.1, 0.4, true);
    assert_eq!(point.normal, [0.0, 1.0, 0.0]);
    let (rays, seed) = (64, 5);
    let layers = LAYERS as usize;
    // Plates that count, and whether those that do not are dead; what each ray finds, what is dropped.
    let check = |admitted: &[u32], dead: bool| {
        let side = |triangle: usize| if dead && !admitted.contains(&geometry.object[triangle]) { 0 } else { 3 };
        let live = (0..geometry.corners.len()).map(side).collect();
        let gather = Gather::place(&geometry, &live, 1 << 15).unwrap();
        let mut nodes = vec![u32::from(dead); gather.count()];
        nodes.extend(gather.points.iter().map(|point| u32::from(dead || admitted.contains(&point.object))));
        let walk = Walk { rays, credit: 0.0, layers: LAYERS };
        let (points, seeds) = (vec![point].into(), vec![seed].into());
        let found = cast(&Device::Cpu, &geometry, &gather, &points, &seeds, &nodes.into(), walk).unwrap();
        let (mut full, mut dropped) = (0, 0);
        for (i, nodes) in found.nodes.chunks(layers).enumerate() {
            let ray = unit_ray(&point, sampling::lattice(i as u32, rays, sampling::shift(seed)), 0.0);
            let reaches = |plate: u32| {
                let at = ray.origin + ray.direction * (plate as f32 / ray.direction.y);
                at.x.abs() < WIDE && at.z.abs() < WIDE
            };
            // The first plate hides the others.
            let expected: Vec<u32> = (2..7).filter(|plate| admitted.contains(plate) && reaches(*plate)).collect();
            let plates: Vec<u32> = nodes
                .iter()
                .filter(|node| **node != 0)
                .map(|&n| gather.points[n as usize - gather.count()].object)
                .collect();
            assert_eq!(plates, expected[..expected.len().min(layers)], "ray {i}, {admitted:?}");
            full += usize::from(expected.len() == admitted.len());
            dropped += expected.len().saturating_sub(layers) as u32;
        }
        assert!(full > 20, "{full} rays meet all");
        assert_eq!(found.dropped, [dropped]);
        dropped
    };
    assert!(check(&[2, 3, 4, 5, 6], false) > 20);
    assert_eq!(check(&[2, 4, 6], false), 0);
    assert_eq!(check(&[6], false), 0);
    // Light passes through sides that nothing lives on.
    assert_eq!(check(&[3, 5], true), 0);
}
