//! Direct light where it is easily lost: close to lamps, far from the origin, from lamps that are off.

use crate::room::{evaluator, image, layer, recipe, relight};
use chiaro::device::{Array, Device};
use chiaro::kernels::direct_light::direct_light;
use chiaro::scene::geometry::{GeometryBuilder, Mesh};
use chiaro::scene::light::surfaces;
use chiaro::scene::{Geometry, Material, SurfacePoint};
use glam::{Mat4, Vec3};
use serde_json::json;

/// A floor and a glowing square of half a metre above it, around `centre`.
fn lamp(centre: Vec3, height: f32) -> (Geometry, Vec<Material>) {
    let quad = [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
    let mut builder = GeometryBuilder::default();
    for (name, material, size, y) in [("floor", 0, 2.0, 0.0), ("lamp", 1, 0.25, height)] {
        let object = builder.object(name);
        let mesh = Mesh { positions: &quad, normals: None, uvs: None, indices: &[0, 1, 2, 0, 2, 3], material };
        let place = Mat4::from_translation(centre + Vec3::Y * y) * Mat4::from_scale(Vec3::splat(size));
        builder.add(object, &mesh, place).unwrap();
    }
    let glow = Material { emission: [1.0; 3], ..Material::matte([0.5; 3]) };
    (builder.finish(vec!["floor".into(), "lamp".into()]).unwrap(), vec![Material::matte([0.5; 3]), glow])
}

/// Mean irradiance of points of the floor below the lamp.
fn below(centre: Vec3, height: f32) -> f32 {
    let (geometry, materials) = lamp(centre, height);
    let source = surfaces(&geometry, &materials).unwrap();
    let points: Vec<SurfacePoint> = (0..64)
        .map(|i| geometry.surface_point(0, 0.001 * (i % 8) as f32, 0.49 + 0.001 * (i / 8) as f32, true))
        .collect();
    let (points, emitters) = (Array::from(points), source.emitters.into());
    let lit = direct_light(&Device::Cpu, &geometry, &points, &source.record, &emitters, 64, None).unwrap();
    lit.irradiance.iter().map(|e| e[0]).sum::<f32>() / 64.0
}

#[test]
fn a_lamp_does_not_shade_itself_wherever_it_hangs() {
    for height in [0.5, 0.1] {
        let near = below(Vec3::ZERO, height);
        assert!(near > 0.1, "{near} at {height} m");
        for x in [20.0, 100.0] {
            let far = below(Vec3::X * x, height);
            assert!((far / near - 1.0).abs() < 0.05, "{far} at x = {x}, {near} at the origin");
        }
    }
}

#[test]
fn a_lamp_that_is_off_brings_nothing() {
    let evaluator = evaluator();
    for light in [json!({ "kind": "area", "intensity": 0.0 }), json!({ "kind": "area", "size": [0.0, 0.0] })] {
        let mut lit = relight(None);
        lit["inputs"]["scene"] = "more".into();
        let added = json!({ "type": "light", "params": light, "inputs": { "scene": "room" } });
        let plan = recipe(json!({ "more": added, "plain": relight(None), "lit": lit }));
        let [plain, lit] = ["plain", "lit"].map(|node| image(&evaluator, &plan, node));
        assert_eq!(layer(&plain, ""), layer(&lit, ""));
    }
}

#[test]
fn rows_that_are_shared_give_the_light_of_rows_of_their_own() {
    let evaluator = evaluator();
    for samples in [1, 2, 3, 4, 5, 13] {
        let view = json!({
            "type": "view_samples", "inputs": { "scene": "room" },
            "params": { "width": 48, "height": 36, "samples_per_pixel": samples },
        });
        let [found, reference] = ["adaptive", "every"].map(|rows| {
            let transport = json!({
                "type": "transfer", "inputs": { "scene": "room", "samples": "view" },
                "params": { "gather_samples": 2048, "tolerance": 0.04, "rows": rows },
            });
            let plan = recipe(json!({ "view": view, "transport": transport, "lit": relight(None) }));
            layer(&image(&evaluator, &plan, "lit"), "indirect").to_vec()
        });
        let squares: f32 = found.iter().zip(&reference).map(|(a, b)| (a - b) * (a - b)).sum();
        let total: f32 = reference.iter().sum();
        let relative = (squares / reference.len() as f32).sqrt() / (total / reference.len() as f32);
        println!("{samples} samples a pixel: {relative}");
        assert!(relative < 0.1, "{samples} samples a pixel: {relative}");
    }
}
