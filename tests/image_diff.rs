//! `chiaro diff`: what passes, what fails, and the measure against another renderer's plates.

mod support;

use chiaro::cli::diff::{Args, report};
use chiaro::image::exr_write::{self, Depth};
use chiaro::image::{Content, Image, Layer, exr_read, load};
use std::path::Path;

fn args(a: impl std::fmt::Display, b: impl std::fmt::Display) -> Args {
    let (a, b) = (a.to_string(), b.to_string());
    Args { a, b, times: Vec::new(), blocks: None, objects: None, max_rmse: None, out: None }
}

fn write(path: &Path, layers: &[(&str, f32)]) {
    let layer = |&(name, value): &(&str, f32)| {
        let data = (0..8 * 6 * 3).map(|i| value + i as f32 / 64.0).collect();
        Layer::new(name, &["R", "G", "B"], Content::Colour, data)
    };
    let image = Image { width: 8, height: 6, layers: layers.iter().map(layer).collect(), ..Image::default() };
    exr_write::write(path, &image, Depth::Float, &[]).unwrap();
}

#[test]
fn equal_or_within_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b, c] = ["a", "b", "c"].map(|name| folder.path().join(name).with_extension("exr"));
    write(&a, &[("", 1.0), ("indirect", 2.0)]);
    write(&b, &[("", 1.0), ("indirect", 2.0)]);
    let [one, two] = [&a, &b].map(|path| path.to_str().unwrap());
    assert!(report(&args(one, two)).unwrap().1);
    write(&b, &[("", 1.0), ("indirect", 2.0001)]);
    let (text, equal) = report(&args(one, two)).unwrap();
    assert!(!equal && text.contains("beauty: equal") && text.contains("values that differ   144"), "{text}");
    assert!(report(&args(one, format!("{two}:beauty"))).unwrap().1);
    assert!(!report(&args(format!("{one}:indirect"), two)).unwrap().1, "a layer named once is meant on both sides");
    let limited = |limit| report(&Args { max_rmse: Some(limit), ..args(one, two) }).unwrap().1;
    assert!(limited(1e-3) && !limited(1e-6));
    // NaN is never within a limit, and a layer that one side lacks is a difference.
    write(&c, &[("", f32::NAN), ("indirect", 2.0)]);
    assert!(!report(&Args { max_rmse: Some(1e9), ..args(one, c.display()) }).unwrap().1);
    assert!(report(&args(c.display(), c.display())).unwrap().1, "NaN equals NaN");
    write(&c, &[("", 1.0)]);
    let (text, equal) = report(&args(one, c.display())).unwrap();
    assert!(!equal && text.contains("indirect: only in A"), "{text}");
}

#[test]
fn one_side_times_another_layer() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
    write(&a, &[("light", 1.0)]);
    write(&b, &[("V.light", 1.0), ("V.Diffuse Color", 0.5)]);
    let picture = folder.path().join("difference.exr");
    let mut asked = args(format!("{}:light", a.display()), format!("{}:light", b.display()));
    asked.times = vec!["B:Diffuse Color".to_owned()];
    asked.out = Some(picture.clone());
    assert!(!report(&asked).unwrap().1);
    let difference = exr_read::read(&picture).unwrap();
    for (i, value) in difference.layer("").unwrap().data.iter().enumerate() {
        let (light, colour) = (1.0 + i as f32 / 64.0, 0.5 + i as f32 / 64.0);
        assert_eq!(*value, light - light * colour);
    }
    asked.out = Some(folder.path().join("difference.png"));
    report(&asked).unwrap();
    assert_eq!(load::load(asked.out.as_ref().unwrap(), None).unwrap().width, 8);
    asked.out = Some(folder.path().join("difference.txt"));
    assert_eq!(report(&asked).unwrap_err().exit_code(), 2);
    asked.times = vec!["C:Diffuse Color".to_owned()];
    assert_eq!(report(&asked).unwrap_err().exit_code(), 2);
    asked.times = vec!["B:Difuse Color".to_owned()];
    let error = report(&asked).unwrap_err();
    assert_eq!(error.exit_code(), 3);
    assert!(error.help().contains("V.Diffuse Color"), "{}", error.help());
}

#[test]
fn all_differences_go_into_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b, out] = ["a.exr", "b.exr", "difference.exr"].map(|name| folder.path().join(name));
    write(&a, &[("", 1.0), ("direct", 0.5), ("only", 1.0)]);
    write(&b, &[("", 1.0), ("direct", 0.25)]);
    let asked = Args { out: Some(out.clone()), ..args(a.display(), b.display()) };
    let (text, equal) = report(&asked).unwrap();
    assert!(!equal && text.contains("only: only in A"), "{text}");
    let difference = exr_read::read(&out).unwrap();
    let names: Vec<&str> = difference.layers.iter().map(|layer| layer.title()).collect();
    assert_eq!(names, ["beauty", "direct"]);
    assert!(difference.layers[1].data.iter().any(|x| *x != 0.0));
    assert!(report(&Args { out: Some(folder.path().join("d.png")), ..asked }).is_ok(), "the beauty's");
}

#[test]
fn wrong_pictures_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
    write(&a, &[("", 1.0)]);
    let small = Layer::new("", &["R", "G", "B"], Content::Colour, vec![1.0; 12]);
    let small = Image { width: 2, height: 2, layers: vec![small], ..Image::default() };
    exr_write::write(&b, &small, Depth::Half, &[]).unwrap();
    let error = report(&args(a.display(), b.display())).unwrap_err();
    assert!(error.to_string().contains("8 x 6") && error.to_string().contains("2 x 2"), "{error}");
    assert_eq!(report(&args(a.display(), "none.exr:Z")).unwrap_err().exit_code(), 3);
    let objects = Args { blocks: Some(4), objects: Some(a.clone()), ..args(a.display(), a.display()) };
    let error = report(&objects).unwrap_err();
    assert!(error.to_string().contains("Cryptomatte") && error.exit_code() == 3, "{error}");
}

/// Figures of the same measure computed apart, with numpy on what OpenEXR 3.5.3 reads.
#[test]
fn the_measure_on_plates() {
    let paths = support::all_data("the_measure_on_plates", &["plates/stage/bounce1.exr", "plates/stage/full.exr"]);
    let [bounce1, full] = &paths[..] else { return };
    let layer = |path: &Path| format!("{}:Diffuse Indirect", path.display());
    let mut asked = args(layer(bounce1), layer(full));
    asked.blocks = Some(4);
    asked.objects = Some(bounce1.clone());
    asked.max_rmse = Some(0.4);
    let (text, equal) = report(&asked).unwrap();
    assert!(!equal);
    let all = text.lines().find(|line| line.contains("all objects")).unwrap();
    assert_eq!(all.split_whitespace().collect::<Vec<_>>()[2..], ["17133", "50.055", "%", "-44.121", "%"], "{text}");
    assert!(text.contains("relative 0.518511") && text.contains(" back "), "{text}");
    asked.max_rmse = Some(0.51);
    assert!(report(&asked).unwrap().1);
}
