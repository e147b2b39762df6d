//! Shadows taken away: one object's against a path tracer's picture without it, by its group and by painting on its
//! shadow; and shadows of five rings, as ratios that multiply and divide back.

use super::plates::{environment, radiance};
use super::sky::{self, View};
use super::support;
use chiaro::image::cryptomatte::{self, Cryptomatte};
use chiaro::image::{Content, Layer, compare};
use chiaro::progress::Progress;
use chiaro::scene::{builtin, file};
use chiaro::transport::Selection;
use chiaro::transport::selection::Grounds;
use chiaro::transport::shadow::localize::{Settings, localize};
use chiaro::transport::shadow::ratio::quotient;
use chiaro::transport::shadow::{Basis, Lamp, Ratio, ShadowChange, ShadowEdit, Visibility};
use std::sync::Arc;

/// Where the head's shadow is dark on the ground of the plaza.
const DAB: [[f32; 3]; 3] = [[0.6, 0.0, -2.05], [0.9, 0.0, -1.6], [1.2, 0.0, -1.0]];

fn without(group: Option<&str>, lamp: Option<Arc<Lamp>>) -> ShadowEdit {
    ShadowEdit { group: group.map(str::to_owned), lamp, selection: None, change: ShadowChange::Fade { amount: 1.0 } }
}

fn direct(view: &View, visibility: &Visibility) -> Layer {
    let layers = view.stage(visibility).layers(Progress::silent()).unwrap();
    layers.into_iter().find(|layer| layer.name == "direct").unwrap()
}

/// The ground where the head takes more than a tenth of the light; other pixels belong to no object.
fn inside(shaded: &Layer, open: &Layer, objects: &[u32]) -> Vec<u32> {
    let ground = cryptomatte::id("ground");
    let mut inside = vec![0; objects.len()];
    let corners = (0..480).step_by(4).flat_map(|y| (0..640).step_by(4).map(move |x| y * 640 + x));
    for corner in corners {
        let block = || (0..16).map(move |i| corner + i / 4 * 640 + i % 4);
        let light = |layer: &Layer| block().flat_map(|p| layer.data[3 * p..3 * p + 3].to_vec()).sum::<f32>();
        if block().all(|p| objects[p] == ground) && light(shaded) < 0.9 * light(open) {
            block().for_each(|p| inside[p] = ground);
        }
    }
    inside
}

#[test]
fn the_heads_shadow_goes_by_its_group_and_by_painting_on_it() {
    let test = "the_heads_shadow_goes_by_its_group_and_by_painting_on_it";
    let [direct_plate, no_head_plate] = ["plates/plaza-night/direct.exr", "plates/plaza-night/direct-no-head.exr"];
    let files = ["scenes/plaza.glb", "environments/st_peters_square_night_1k.hdr", direct_plate, no_head_plate];
    let found = support::all_data(test, &files);
    let [scene, map, with_head, no_head] = found.as_slice() else { return };
    let (scene, _) = file::read(scene, 1.0).unwrap();
    let view = View::new(&scene, (640, 480), 1, environment(map, 128));
    let objects = Cryptomatte::read(no_head, "CryptoObject").unwrap().whole(0.99);
    let (shaded, open) = (radiance(with_head, "Diffuse Direct"), radiance(no_head, "Diffuse Direct"));
    let inside = inside(&shaded, &open, &objects);
    assert!(inside.iter().filter(|id| **id != 0).count() > 200 * 16, "the plates show a shadow");
    let error = |visibility: &Visibility, objects: &[u32]| {
        compare::blocks(&direct(&view, visibility), &open, 640, objects, 4).unwrap()[0].relative_rmse
    };
    let baked = view.bake(Basis::Runs, &[("head", &["head"])]);
    assert!(error(&baked, &inside) > 0.3, "the shadow is there");

    let by_group = error(&baked.and(without(Some("head"), None)).unwrap(), &objects);
    println!("group removed: {:.2} % over the picture", 100.0 * by_group);
    assert!(by_group < 0.015, "{by_group}");

    let stroke = serde_json::from_value(serde_json::json!({ "points": DAB, "radius": 0.12 })).unwrap();
    let (painted, _) =
        Selection::painted(&Grounds::still(view.geometry.clone()), &[stroke], |_, _| unreachable!()).unwrap();
    let weights = painted.weights(&view.samples.points);
    let blocked = baked.blocked(&weights).unwrap();
    let (mut edited, mut before) = (baked, f64::INFINITY);
    for which in 1.. {
        let found =
            localize(&view.transport.environment, &blocked, &Settings { which, ..Settings::default() }).unwrap();
        let spot = found.lamps[which as usize - 1];
        // As an artist would: until no lamp is left that the shadow shows.
        if spot.share < 0.02 {
            break;
        }
        edited = edited.and(without(None, Some(Arc::new(found.lamp)))).unwrap();
        let left = error(&edited, &inside);
        println!("light {which}, {:.0} % of what the dab misses: {:.2} % inside", 100.0 * spot.share, 100.0 * left);
        assert!(left < before, "each light makes it better");
        before = left;
    }
    assert!(before < 0.04, "{before}");
}

/// Pictures with the shadows of fewer and fewer rings: the last without any.
fn fewer_rings(view: &View) -> Vec<Layer> {
    let rings: Vec<String> = (0..5).map(|ring| format!("ring{ring}")).collect();
    let lists: Vec<[&str; 1]> = rings.iter().map(|ring| [ring.as_str()]).collect();
    let groups: Vec<(&str, &[&str])> = rings.iter().zip(&lists).map(|(ring, list)| (&ring[..], &list[..])).collect();
    let mut visibility = view.bake(Basis::Runs, &groups);
    let mut pictures = vec![direct(view, &visibility)];
    for ring in &rings {
        visibility = visibility.and(without(Some(ring), None)).unwrap();
        pictures.push(direct(view, &visibility));
    }
    pictures
}

/// Shadow by shadow, out of the picture without any; and out again, in another order.
fn back(pictures: &[Layer], size: (usize, usize)) {
    let rgb = [0, 1, 2];
    let ratio = |original: &Layer, removed: &Layer| {
        let (values, met) = quotient::divide((original, rgb), (removed, rgb));
        assert_eq!((met.not_finite, met.limited), (0, 0));
        Ratio { width: size.0, height: size.1, values: values.into(), ..Ratio::default() }
    };
    let ratios: Vec<Ratio> = pictures.windows(2).map(|pair| ratio(&pair[0], &pair[1])).collect();
    for (ring, ratio) in ratios.iter().enumerate() {
        let dark = ratio.values.iter().filter(|v| v[0] < 0.9).count();
        assert!(dark > 3, "ring {ring} casts a shadow: {dark} pixels");
    }
    let times = |picture: &Layer, ratio: &Ratio| {
        Layer::new("", &["R", "G", "B"], Content::Colour, quotient::multiply(picture, rgb, ratio, None).0)
    };
    let worst = |a: &Layer, b: &Layer| {
        let mean = b.data.iter().map(|x| f64::from(*x)).sum::<f64>() / b.data.len() as f64;
        let pairs = a.data.iter().zip(&b.data[..]).map(|(a, b)| f64::from((a - b).abs()));
        pairs.fold(0.0, f64::max) / mean
    };
    let [first, .., last] = pictures else { unreachable!("six pictures") };
    let all = [3, 0, 4, 1, 2].iter().fold(last.clone(), |picture, &ring| times(&picture, &ratios[ring]));
    println!("five rings multiplied back: {:.1e} of the mean at worst", worst(&all, first));
    assert!(worst(&all, first) < 1e-4);
    assert!(worst(last, first) > 0.1, "the rings' shadows are there");
    let inverse = |ring: usize| ratio(&pictures[ring + 1], &pictures[ring]);
    let none = [1, 4, 2, 0, 3].iter().fold(first.clone(), |picture, &ring| times(&picture, &inverse(ring)));
    println!("... and divided away: {:.1e}", worst(&none, last));
    assert!(worst(&none, last) < 1e-4);
}

#[test]
fn ratios_of_five_rings_multiply_and_divide_back() {
    let view = View::new(&builtin::scene("yard").unwrap(), (96, 72), 1, sky::sky(32));
    back(&fewer_rings(&view), (96, 72));
}

#[test]
fn ratios_of_the_plazas_rings_multiply_and_divide_back() {
    let files = ["scenes/plaza.glb", "environments/st_peters_square_night_1k.hdr"];
    let found = support::all_data("ratios_of_the_plazas_rings_multiply_and_divide_back", &files);
    let [scene, map] = found.as_slice() else { return };
    let (scene, _) = file::read(scene, 1.0).unwrap();
    let view = View::new(&scene, (160, 120), 1, environment(map, 128));
    back(&fewer_rings(&view), (160, 120));
}
