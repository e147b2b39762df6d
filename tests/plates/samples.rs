//! Plates as view samples.

use crate::node::{Ran, image, run};
use crate::support;
use chiaro::Result;
use chiaro::device::Device;
use chiaro::image::cryptomatte::Cryptomatte;
use chiaro::image::{Content, Image, Layer, exr_read};
use chiaro::scene::{Camera, Geometry, Scene, builtin, file};
use chiaro::transport::Samples;
use chiaro::value::Value;
use glam::Vec3;
use serde_json::{Value as Json, json};
use std::path::Path;
use std::sync::Arc;

const SIZE: (u32, u32) = (160, 120);

fn camera() -> Camera {
    Camera::look_at("", Vec3::new(0.4, 1.3, 3.6), Vec3::new(-0.1, 0.9, 0.0), 0.7)
}

/// What a renderer would write: averages over 64 samples of a pixel, in its own axes.
fn plate(geometry: &Geometry, z_up: bool) -> Image {
    let fine = Samples::view(&Device::Cpu, geometry, &camera(), SIZE, 64).unwrap();
    let axes = |v: [f32; 3]| if z_up { [v[0], -v[2], v[1]] } else { v };
    let mean = |value: &dyn Fn(usize) -> [f32; 3]| -> Vec<f32> {
        let pixel = |p: usize| {
            let sum = (64 * p..64 * (p + 1)).map(|i| Vec3::from(axes(value(i)))).sum::<Vec3>();
            (sum / 64.0).to_array()
        };
        (0..fine.width * fine.height).flat_map(pixel).collect()
    };
    let layers = vec![
        Layer::new("Position", &["X", "Y", "Z"], Content::Data, mean(&|i| fine.points[i].position)),
        Layer::new("Normal", &["X", "Y", "Z"], Content::Data, mean(&|i| fine.points[i].normal)),
    ];
    Image { width: fine.width, height: fine.height, layers, ..Image::default() }
}

fn samples(params: Json, plate: &Image, scene: Option<&Scene>) -> Result<Ran> {
    let mut inputs = vec![("image", image(plate))];
    inputs.extend(scene.map(|scene| ("scene", Value::Scene(Arc::new(scene.clone())))));
    run("plate_samples", params, &inputs)
}

/// Pixels whose 64 samples are not all of one object.
fn mixed(geometry: &Geometry) -> Vec<bool> {
    let fine = Samples::view(&Device::Cpu, geometry, &camera(), SIZE, 64).unwrap();
    fine.points.chunks(64).map(|pixel| pixel.iter().any(|point| point.object != pixel[0].object)).collect()
}

#[test]
fn a_plate_of_the_room_gives_the_samples_of_its_camera() {
    let scene = builtin::scene("room").unwrap();
    let truth = Samples::view(&Device::Cpu, &scene.geometry, &camera(), SIZE, 1).unwrap();
    let mixed = mixed(&scene.geometry);
    for z_up in [false, true] {
        let axis = if z_up { "z" } else { "y" };
        let ran = samples(json!({ "up_axis": axis }), &plate(&scene.geometry, z_up), Some(&scene)).unwrap();
        let found = ran.samples();
        assert!(found.check(&scene.geometry).is_ok() && (found.width, found.height) == (160, 120));
        assert_eq!((&ran.notes["off_the_scene"], &ran.notes["edge_pixels_lost"]), (&json!(0), &json!(0)));
        assert!(ran.notes["camera_residual"].as_f64().unwrap() < 0.02, "{:?}", ran.notes);
        let wrong = |pixel: &usize| {
            let (a, b) = (&found.points[*pixel], &truth.points[*pixel]);
            let apart = Vec3::from(a.position).distance(b.position.into());
            a.object != b.object || apart > 0.01
        };
        let wrong: Vec<usize> = (0..truth.points.len()).filter(wrong).collect();
        assert!(wrong.iter().all(|pixel| mixed[*pixel]), "only where a pixel shows several things");
        assert!(wrong.len() < 40, "{} pixels are of another surface than their middles", wrong.len());
        let Value::Camera(camera) = &ran.values[1] else { panic!("a camera") };
        assert!(camera.position.distance(self::camera().position) < 0.01, "{camera:?}");
    }
}

/// No sample of a plate lies between surfaces, with a scene or without.
#[test]
fn edges_are_found_filled_and_counted() {
    let scene = builtin::scene("room").unwrap();
    let plate = plate(&scene.geometry, false);
    let mixed = mixed(&scene.geometry);
    let off = |point: Vec3| chiaro::transport::nearest::nearest(&scene.geometry, point, None).distance;
    let average = |pixel: usize| Vec3::from_slice(&plate.layers[0].data[3 * pixel..3 * pixel + 3]);
    // Farther from any surface than the largest pixels here are wide.
    let far = |point: Vec3| off(point) > 0.06;
    let between = (0..mixed.len()).filter(|pixel| far(average(*pixel))).count();
    assert!(between > 50, "averages lie between surfaces in {between} pixels");
    for scene in [None, Some(&scene)] {
        let ran = samples(json!({}), &plate, scene).unwrap();
        let filled = ran.notes["edge_pixels_filled"].as_u64().unwrap() as usize;
        let edges = mixed.iter().filter(|mixed| **mixed).count();
        assert!((between..3 * edges).contains(&filled), "{filled} filled, {edges} show several, {between} between");
        let found = ran.samples();
        let left = (0..mixed.len()).filter(|pixel| far(found.points[*pixel].position.into())).count();
        assert_eq!(left, 0, "with a scene: {}", scene.is_some());
    }
}

#[test]
fn more_samples_a_pixel_draw_its_edges() {
    let scene = builtin::scene("room").unwrap();
    let plate = plate(&scene.geometry, false);
    let truth = Samples::view(&Device::Cpu, &scene.geometry, &camera(), SIZE, 4).unwrap();
    let found = samples(json!({ "samples_per_pixel": 4 }), &plate, Some(&scene)).unwrap().samples();
    assert_eq!((found.across, found.down, found.points.len()), (2, 2, truth.points.len()));
    let same = found.points.iter().zip(&truth.points[..]).filter(|(a, b)| a.object == b.object).count();
    assert!(same as f64 > 0.998 * truth.points.len() as f64, "{same} of {}", truth.points.len());
    let error = samples(json!({ "samples_per_pixel": 4 }), &plate, None).err().unwrap();
    assert!(error.help().contains("connect the scene"), "{error}");
}

#[test]
fn wrong_axes_scales_and_scenes_are_named() {
    let scene = builtin::scene("room").unwrap();
    let fault = |params: Json, plate: &Image, scene: &Scene| {
        let error = samples(params, plate, Some(scene)).err().unwrap();
        format!("{error}; {}", error.help())
    };
    let plate = plate(&scene.geometry, true);
    let text = fault(json!({}), &plate, &scene);
    assert!(text.contains("lie on no surface") && text.contains("up_axis \"z\""), "{text}");
    let text = fault(json!({ "up_axis": "z", "scale": 100.0 }), &plate, &scene);
    assert!(text.contains("set scale"), "{text}");
    let text = fault(json!({ "position_layer": "Positon" }), &plate, &scene);
    assert!(text.contains("position_layer") && text.contains("Position"), "{text}");
    let none = Layer::new("N", &["X", "Y", "Z"], Content::Data, vec![0.0; 3 * 160 * 120]);
    let empty = Image { layers: vec![plate.layers[0].clone(), none], ..plate.clone() };
    assert!(fault(json!({}), &empty, &scene).contains("shows no surface"));
    let mut bad = plate.layers[0].data.to_vec();
    bad[300..900].fill(f32::NAN);
    let bad = Image { layers: vec![plate.layers[0].with_data(bad), plate.layers[1].clone()], ..plate };
    let ran = samples(json!({ "up_axis": "z" }), &bad, Some(&scene)).unwrap();
    assert_eq!(ran.notes["not_finite"], 200);
    assert!(ran.warnings().contains("200 pixels"), "{}", ran.warnings());
    assert!((100..300).all(|pixel| !ran.samples().points[pixel].exists()));
}

fn real(path: &Path, scene: &Scene, per_pixel: u32) -> (Image, Ran) {
    let plate = exr_read::read(path).unwrap();
    let params = json!({ "up_axis": "z", "samples_per_pixel": per_pixel });
    let ran = samples(params, &plate, Some(scene)).unwrap();
    (plate, ran)
}

/// Blender's plates: the camera is that of the file, and each pixel lies on the object that Cryptomatte says.
#[test]
fn plates_of_blender_lie_on_their_scenes() {
    let test = "plates_of_blender_lie_on_their_scenes";
    for [scene, plate] in
        [["scenes/stage.glb", "plates/stage/full.exr"], ["scenes/plaza.glb", "plates/plaza-night/full.exr"]]
    {
        let found = support::all_data(test, &[scene, plate]);
        let [scene, plate] = found.as_slice() else { return };
        let (scene, _) = file::read(scene, 1.0).unwrap();
        let (image, ran) = real(plate, &scene, 1);
        let matte = Cryptomatte::of(&image, "CryptoObject").unwrap();
        let whole = matte.whole(0.999);
        let samples = ran.samples();
        let name = |pixel: usize| &scene.geometry.objects[samples.points[pixel].object as usize];
        let sure: Vec<usize> = (0..whole.len()).filter(|p| whole[*p] != 0 && samples.points[*p].exists()).collect();
        let wrong = sure.iter().filter(|pixel| *name(**pixel) != matte.title(whole[**pixel])).count();
        println!("{}: {:?}, {wrong} of {} on another object", plate.display(), ran.notes, sure.len());
        assert!(sure.len() > 200_000 && wrong == 0, "{wrong}");
        assert_eq!((&ran.notes["off_the_scene"], &ran.notes["edge_pixels_lost"]), (&json!(0), &json!(0)));
        let filled = ran.notes["edge_pixels_filled"].as_u64().unwrap();
        assert!((1_000..12_000).contains(&filled), "{filled}");
        let Value::Camera(camera) = &ran.values[1] else { panic!("a camera") };
        let own = &scene.cameras[0];
        assert!(camera.position.distance(own.position) < 1e-3, "{camera:?} {own:?}");
        assert!((camera.fov_y - own.fov_y).abs() < 1e-4, "{camera:?} {own:?}");
        assert!(ran.notes["camera_residual"].as_f64().unwrap() < 1e-3);
        // Without a scene, objects are told apart as the plate's Cryptomatte does.
        let alone = self::samples(json!({ "up_axis": "z" }), &image, None).unwrap().samples();
        let pairs = sure.windows(2).filter(|pair| {
            (whole[pair[0]] == whole[pair[1]]) != (alone.points[pair[0]].object == alone.points[pair[1]].object)
        });
        assert_eq!(pairs.count(), 0);
    }
}
