use super::*;
use crate::image::Content;

const PLAIN: Settings = Settings { dark: 0.01, lift: 0.0, limit: 8.0, gain: Some(1.0) };

fn layer(data: &[f32]) -> Layer {
    Layer::new("", &["R", "G", "B"], Content::Colour, data.to_vec())
}

fn changed(plate: &[f32], before: &[f32], after: &[f32], settings: Settings) -> (Vec<f32>, Met) {
    let [plate, before, after] = [plate, before, after].map(layer);
    let [plate, before, after] = [&plate, &before, &after].map(|layer| Radiance::whole(layer).unwrap());
    let (layer, met) = apply(&plate, &before, &after, settings);
    (layer.data.to_vec(), met)
}

#[test]
fn ratio_where_there_is_light_and_difference_where_it_is_dark() {
    // Mean of before is 1, so e is 0.01.
    let (data, met) = changed(&[4.0, 0.5, 0.125], &[2.0, 1.0, 0.0], &[1.0, 2.0, 0.25], PLAIN);
    let near = |found: f32, expected: f32| assert!((found / expected - 1.0).abs() < 2e-4, "{found} {expected}");
    near(data[0], 2.0);
    near(data[1], 1.0);
    assert_eq!(data[2], 0.375);
    assert_eq!(met, Met { gain: 1.0, changed: 1, by_difference: 1, limited: 0, not_finite: 0 });
}

/// A shadow edge that the plate has half a pixel farther out does not flare, and a texture that the preview does not
/// have stays.
#[test]
fn lifted_shadows_do_not_flare() {
    let lifted = Settings { lift: 0.15, ..PLAIN };
    let new = |plate: f32, before: f32, settings| changed(&[plate; 3], &[before; 3], &[1.0; 3], settings).0[0];
    assert!(new(0.5, 0.1, PLAIN) > 4.5 && new(0.5, 0.1, lifted) < 2.8, "{}", new(0.5, 0.1, lifted));
    assert!(new(0.1, 0.5, lifted) > 0.2);
    assert!((new(0.15, 0.3, lifted) - 0.5).abs() < 0.06, "{}", new(0.15, 0.3, lifted));
    // What darkens is a ratio all the way.
    let dark = |settings| changed(&[0.5; 3], &[1.0; 3], &[0.1; 3], settings).0;
    assert_eq!(dark(lifted), dark(PLAIN));
}

/// From ratio to difference there is no step, wherever the light of plate, before or after is varied.
#[test]
fn nothing_jumps() {
    for other in [0.0f32, 1e-4, 0.003, 0.01, 0.05, 1.0] {
        for which in 0..3 {
            let mut last = None::<f32>;
            for step in 0..2000 {
                let value = 1e-6 * 1.008f32.powi(step);
                let mut light = [other, 0.7 * other, 1.5 * other];
                light[which] = value;
                // A second pixel keeps the mean of before about 1.
                let [p, b, a] = light.map(|x| [x, x, x, 2.0, 2.0, 2.0]);
                let new = changed(&p, &b, &a, Settings { lift: 0.15, ..PLAIN }).0[0];
                assert!(new >= 0.0 && new.is_finite(), "{light:?}: {new}");
                let most = 8.0 * 0.008 * (value + other) + 1e-6;
                assert!(last.is_none_or(|last| (last - new).abs() <= 2.0 * most), "{light:?}: {last:?} {new}");
                last = Some(new);
            }
        }
    }
}

#[test]
fn what_does_not_change_keeps_its_bits_and_light_does_not_fall_below_none() {
    let plate = [0.3, 0.1, -0.01, 1e-9, 0.0, 65504.0];
    let same = [0.1, 0.0, 0.0, 2.0, 7.0, 1e-12];
    assert_eq!(changed(&plate, &same, &same, PLAIN), (plate.to_vec(), Met { gain: 1.0, ..Met::default() }));
    let (data, _) = changed(&plate, &[0.5; 6], &[0.0; 6], PLAIN);
    assert!(data[0] < 1e-3 && data[0] >= 0.0 && data[2] == -0.01, "{data:?}");
    let (data, met) = changed(&[f32::NAN, 1.0, 1.0, 1.0, 1.0, 1.0], &[1.0; 6], &[0.0; 6], PLAIN);
    assert!(data[0].is_nan() && data[1] == 1.0 && data[4] < 1e-3 && met.not_finite == 1);
    assert_eq!(changed(&[1.0; 3], &[0.0; 3], &[0.0; 3], Settings { gain: None, ..PLAIN }).0, [1.0; 3]);
}

#[test]
fn a_change_does_not_grow_beyond_the_limit() {
    let settings = Settings { limit: 2.0, ..PLAIN };
    let (data, met) = changed(&[1.0, 1.0, 1.0, 1.0, 1.0, 1.0], &[0.1, 1.9, 0.1, 1.9, 0.1, 1.9], &[0.2; 6], settings);
    assert!((data[0] - 1.2).abs() < 1e-6 && data[1] < 0.2, "{data:?}");
    assert_eq!(met.limited, 2);
}

#[test]
fn the_gain_is_the_median_of_lit_pixels() {
    let before: Vec<f32> = (0..300).map(|i| if i < 270 { 1.0 + (i / 3) as f32 } else { 1e-6 }).collect();
    let plate: Vec<f32> = before.iter().enumerate().map(|(i, x)| if i < 30 { 90.0 } else { 3.0 * x }).collect();
    let (data, met) = changed(&plate, &before, &before, Settings { gain: None, ..PLAIN });
    assert!((met.gain - 3.0).abs() < 1e-4 && data == plate, "{}", met.gain);
    // With the plate's exposure, a difference is in the plate's units.
    let (data, _) = changed(
        &[3.0, 3.0, 3.0, 0.0, 0.0, 0.0],
        &[1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
        &[1.0; 6],
        Settings { gain: None, ..PLAIN },
    );
    assert_eq!(data, [3.0; 6]);
}

#[test]
fn surface_colour_is_kept_out_of_the_light_and_put_into_the_beauty() {
    let image = Image {
        width: 1,
        height: 1,
        layers: vec![layer(&[2.0, 4.0, 1.0]), layer(&[0.5, 0.25, 0.0])],
        ..Image::default()
    };
    let part = Component { light: crate::image::components::Part::Direct, layer: 0, colour: Some(1) };
    let plate = Radiance::of(&image, part).unwrap();
    let (before, after) = (layer(&[1.0, 1.0, 1.0]), layer(&[0.5, 2.0, 2.0]));
    let (new, _) = apply(
        &plate,
        &Radiance::whole(&before).unwrap(),
        &Radiance::whole(&after).unwrap(),
        Settings { dark: 1e-6, ..PLAIN },
    );
    assert_eq!(new.data[..], [1.0, 8.0, 1.0], "where the surface is black, nothing changes");
    let beauty = carry(&layer(&[3.0, 3.0, 3.0]), &image.layers[0], &new, Some(&image.layers[1])).unwrap();
    assert_eq!(beauty.data[..], [2.5, 4.0, 3.0]);
}
