use super::*;

const SIZE: usize = 32;
const TEXELS: usize = FACES * SIZE * SIZE;

/// Grey lamps in the dark: middle, radius in radians, radiance.
fn lamps(lamps: &[(Vec3, f32, f32)]) -> Environment {
    let texels = (0..TEXELS).map(|texel| {
        let at = cube::texel_point(texel, SIZE).normalize();
        let inside = lamps.iter().find(|(middle, radius, _)| at.angle_between(*middle) < *radius);
        let grey = inside.map_or(0.01, |(_, _, radiance)| *radiance);
        [grey, grey, grey, 0.0]
    });
    Environment::new(SIZE, texels.collect()).unwrap()
}

/// Texels that are brighter than the dark, within an angle of a direction.
fn lamp_at(environment: &Environment, middle: Vec3, radius: f32) -> Vec<f32> {
    let near = |texel: usize| cube::texel_point(texel, SIZE).normalize().angle_between(middle) < radius;
    let bright = |texel: usize| near(texel) && environment.radiance[texel][0] > 0.01;
    (0..TEXELS).map(|texel| f32::from(bright(texel))).collect()
}

fn three() -> ([Vec3; 3], Environment) {
    // The first lies across an edge of the cube, the second around a corner of it.
    let middles = [Vec3::new(1.0, 1.0, 0.1), Vec3::new(-1.0, 1.0, 1.0), Vec3::new(0.0, -0.2, -1.0)];
    let middles = middles.map(Vec3::normalize);
    (middles, lamps(&[(middles[0], 0.2, 900.0), (middles[1], 0.15, 80.0), (middles[2], 0.3, 12.0)]))
}

fn light(found: &Found) -> Vec<f32> {
    found.lamp.weights.to_vec()
}

#[test]
fn lamps_are_found_one_after_the_other() {
    let (middles, environment) = three();
    let (blocked, mut except) = (vec![1.0; TEXELS], Lamp { size: SIZE, weights: vec![0.0; TEXELS].into() });
    for (number, middle) in middles.into_iter().enumerate() {
        let expected = lamp_at(&environment, middle, 0.35);
        let which = localize(&environment, &blocked, &Settings { which: number as u32 + 1, ..Default::default() });
        assert!(light(&which.unwrap()) == expected, "lamp {number}");
        let settings = Settings { which: 1, except: Some(&except), ..Default::default() };
        let next = localize(&environment, &blocked, &settings).unwrap();
        assert!(light(&next) == expected, "lamp {number}, without those before it");
        assert_eq!(next.texels as f32, expected.iter().sum::<f32>());
        let weights = except.weights.iter().zip(&expected).map(|(a, b)| a.max(*b)).collect::<Vec<f32>>();
        except = Lamp { size: SIZE, weights: weights.into() };
    }
    let found = localize(&environment, &blocked, &Settings::default()).unwrap();
    assert_eq!(found.lamps.len(), 3, "the dark is no lamp: {:?}", found.lamps);
    assert!(found.lamps.iter().zip(middles).all(|(spot, middle)| spot.direction.dot(middle) > 0.999));
    let many = localize(&environment, &blocked, &Settings { which: 4, ..Default::default() }).unwrap_err();
    assert!(many.to_string().contains("no light number 4: 3 lights"), "{many}");
}

#[test]
fn only_what_is_blocked_is_found() {
    let (middles, environment) = three();
    // In front of the second lamp, and of a half of the third.
    let blocked: Vec<f32> = (0..TEXELS)
        .map(|texel| cube::texel_point(texel, SIZE).normalize())
        .map(|at| f32::from(at.angle_between(middles[1]) < 0.3 || (at.x < 0.0 && at.z < -0.9 * at.length())))
        .collect();
    for (which, threshold) in [(0, None), (1, None), (2, None), (0, Some(0.01)), (2, Some(0.01))] {
        let found = localize(&environment, &blocked, &Settings { which, threshold, ..Default::default() }).unwrap();
        assert!(found.lamp.weights.iter().zip(&blocked).all(|(weight, s)| *weight == 0.0 || *s > 0.0));
        let second = lamp_at(&environment, middles[1], 0.35);
        let all = found.lamp.weights.iter().zip(&second).all(|(weight, inside)| weight >= inside);
        assert_eq!(all, which < 2, "which {which}, threshold {threshold:?}");
    }
    let whole = localize(&environment, &blocked, &Settings { threshold: Some(0.0), ..Default::default() }).unwrap();
    assert_eq!(light(&whole), blocked);
    assert!((whole.missed - whole.share).abs() < 1e-12 && whole.missed < 0.3);
}

#[test]
fn a_lamp_is_found_with_its_rim() {
    // Falls off over its last three texels.
    let middle = Vec3::new(0.2, 1.0, 0.1).normalize();
    let at = |texel: usize| cube::texel_point(texel, SIZE).normalize().angle_between(middle);
    let grey = |texel: usize| 0.1 + 50.0 * ((0.35 - at(texel)) / 0.15).clamp(0.0, 1.0);
    let texels = (0..TEXELS).map(|texel| [grey(texel), grey(texel), grey(texel), 0.0]).collect();
    let environment = Environment::new(SIZE, texels).unwrap();
    // One half is blocked from half of the samples only.
    let blocked: Vec<f32> =
        (0..TEXELS).map(|texel| if cube::texel_point(texel, SIZE).x > 0.2 { 0.2 } else { 1.0 }).collect();
    let found = localize(&environment, &blocked, &Settings { which: 1, ..Default::default() }).unwrap();
    let excess = |texel: usize| f64::from((grey(texel) - 0.1) * environment.radiance[texel][3]);
    let held: f64 = (0..TEXELS).map(|texel| excess(texel) * f64::from(found.lamp.weights[texel])).sum();
    let all: f64 = (0..TEXELS).map(excess).sum();
    assert!(held >= 0.99 * all, "{} of the lamp", held / all);
    assert!((0..TEXELS).all(|texel| found.lamp.weights[texel] == 0.0 || at(texel) < 0.4));
}

#[test]
fn energy_above_a_threshold_is_what_it_says() {
    let (_, environment) = three();
    let blocked: Vec<f32> = (0..TEXELS).map(|texel| (texel * 37 % 101) as f32 / 100.0).collect();
    let energy =
        |texel: usize| f64::from(blocked[texel] * environment.radiance[texel][0] * environment.radiance[texel][3]);
    let total: f64 = (0..TEXELS).map(energy).sum();
    let mut before = vec![1.0; TEXELS];
    for threshold in (0..=200).map(|i| i as f32 / 200.0) {
        let settings = Settings { threshold: Some(threshold), ..Default::default() };
        let found = localize(&environment, &blocked, &settings).unwrap();
        let kept: f64 = (0..TEXELS).map(|texel| energy(texel) * f64::from(found.lamp.weights[texel])).sum();
        assert!((kept / total - (1.0 - f64::from(threshold))).abs() < 1e-5, "{threshold}: {}", kept / total);
        assert!(found.lamp.weights.iter().zip(&before).all(|(now, before)| now <= before), "it only shrinks");
        assert_eq!(found.warnings.iter().any(|warning| warning.contains("empty")), threshold == 1.0);
        before = light(&found);
    }
}

#[test]
fn a_residual_is_all_else_exactly() {
    let (_, environment) = three();
    for (threshold, which) in [(None, 0), (None, 2), (Some(0.37), 0)] {
        let one = Settings { threshold, which, ..Default::default() };
        let found = localize(&environment, &vec![0.7; TEXELS], &one).unwrap();
        let rest = localize(&environment, &vec![0.7; TEXELS], &Settings { residual: true, ..one }).unwrap();
        assert!(found.lamp.weights.iter().zip(&rest.lamp.weights).all(|(a, b)| *b == 1.0 - *a));
        assert_eq!((rest.texels, rest.steradians), (found.texels, found.steradians));
    }
}

#[test]
fn one_bright_texel_is_warned_of() {
    let mut texels = vec![[0.01, 0.01, 0.01, 0.0]; TEXELS];
    let texel = (4 * SIZE + 9) * SIZE + 3;
    texels[texel] = [1e5, 1e5, 1e5, 0.0];
    let environment = Environment::new(SIZE, texels).unwrap();
    let found = localize(&environment, &vec![1.0; TEXELS], &Settings { which: 1, ..Default::default() }).unwrap();
    assert_eq!((found.texels, found.lamp.weights[texel]), (1, 1.0));
    let warning = found.warnings.join("\n");
    for words in ["face front, column 3, row 9", "100 %", "raise face_size"] {
        assert!(warning.contains(words), "{warning}");
    }
    let (_, soft) = three();
    let soft = localize(&soft, &vec![1.0; TEXELS], &Settings::default()).unwrap();
    assert!(soft.warnings.is_empty(), "{:?}", soft.warnings);
}

#[test]
fn a_faint_shadow_is_warned_of() {
    let (_, environment) = three();
    let mut blocked = vec![0.0; TEXELS];
    blocked[100..130].fill(1.0);
    let found = localize(&environment, &blocked, &Settings::default()).unwrap();
    assert!(found.warnings.iter().any(|warning| warning.contains("miss only 0.0")), "{:?}", found.warnings);
}

#[test]
fn what_cannot_be_found_is_said() {
    let (_, environment) = three();
    let refused = |environment: &Environment, blocked: &[f32], settings: Settings, words: &str| {
        let error = localize(environment, blocked, &settings).unwrap_err();
        assert!(error.to_string().contains(words) && !error.help().is_empty(), "{error}");
    };
    let all = vec![1.0; TEXELS];
    refused(
        &environment,
        &vec![0.0; TEXELS],
        Settings { samples: 37, ..Default::default() },
        "37 painted samples are in no shadow",
    );
    let black = Environment::new(SIZE, vec![[0.0; 4]; TEXELS]).unwrap();
    refused(&black, &all, Settings::default(), "black");
    refused(&environment, &all[1..], Settings::default(), "and a visibility of");
    refused(&environment, &vec![f32::NAN; TEXELS], Settings::default(), "NaN");
    let every = Lamp { size: SIZE, weights: all.clone().into() };
    refused(&environment, &all, Settings { except: Some(&every), ..Default::default() }, "beside that of `except`");
    let other = Lamp { size: 64, weights: vec![0.0; 4 * TEXELS].into() };
    refused(&environment, &all, Settings { except: Some(&other), ..Default::default() }, "64 x 64");
    refused(
        &environment,
        &all,
        Settings { which: 9, threshold: Some(0.05), ..Default::default() },
        "no light number 9",
    );
}
