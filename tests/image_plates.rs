//! Pictures of another renderer: Blender's multipart EXR with Cryptomatte, and environment maps above half's range.

mod support;

use chiaro::image::cryptomatte::{self, Cryptomatte};
use chiaro::image::exr_write::{self, Depth};
use chiaro::image::{Content, compare, exr_read};

const PLATES: [&str; 8] = [
    "plates/stage/direct.exr",
    "plates/stage/bounce1.exr",
    "plates/stage/full.exr",
    "plates/stage/bounce1-from-red.exr",
    "plates/plaza-night/direct.exr",
    "plates/plaza-night/full.exr",
    "plates/plaza-night/direct-no-head.exr",
    "plates/plaza-noon/direct.exr",
];

#[test]
fn every_plate_is_read_in_full() {
    for path in support::all_data("every_plate_is_read_in_full", &PLATES) {
        let image = exr_read::read(&path).unwrap();
        assert_eq!((image.width, image.height), (640, 480));
        let combined = image.find("Combined").unwrap();
        assert_eq!((combined.channels.join(""), combined.content), ("RGBA".into(), Content::Colour));
        let position = image.find("Position").unwrap();
        assert_eq!((position.channels.join(""), position.content), ("XYZ".into(), Content::Data));
        let matte = image.find("CryptoObject00").unwrap();
        assert_eq!((matte.channels.join(""), matte.content), ("RGBA".into(), Content::Data));
        for layer in &image.layers {
            assert_eq!(layer.data.len(), 640 * 480 * layer.channels.len());
            assert!(layer.data.iter().all(|v| v.is_finite()), "{}: {}", path.display(), layer.name);
        }
        // A layer read alone is the layer read with all others.
        let alone = exr_read::read_layers(&path, &["Diffuse Color", "CryptoObject00"]).unwrap();
        assert_eq!(alone.layers[0].data[..], image.find("Diffuse Color").unwrap().data[..]);
        let bits = |layer: &chiaro::image::Layer| layer.data.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&alone.layers[1]), bits(matte), "ids survive bit by bit");
    }
}

#[test]
fn cryptomatte_names_what_is_seen() {
    for path in support::all_data("cryptomatte_names_what_is_seen", &PLATES[..4]) {
        let matte = Cryptomatte::read(&path, "CryptoObject").unwrap();
        assert_eq!(matte.name, "ViewLayer.CryptoObject");
        for (&id, name) in &matte.manifest {
            assert_eq!(cryptomatte::id(name), id, "{name}");
        }
        let whole = matte.whole(0.99);
        let back = cryptomatte::id("back");
        let seen = whole.iter().filter(|&&id| id == back).count();
        assert!(seen > 10_000, "the back wall is whole in {seen} pixels");
        assert!(whole.iter().filter(|&&id| id != 0).all(|id| matte.manifest.contains_key(id)));
        let covered: f64 = matte.coverage(back).iter().map(|&part| f64::from(part)).sum();
        assert!(covered >= seen as f64 * 0.99 && covered < 640.0 * 480.0);
        assert!(Cryptomatte::read(&path, "CryptoAsset").is_err());
    }
}

#[test]
fn block_measure_knows_a_plate_from_another() {
    let paths = support::all_data("block_measure_knows_a_plate_from_another", &PLATES[1..3]);
    let [bounce1, full] = &paths[..] else { return };
    let matte = Cryptomatte::read(bounce1, "CryptoObject").unwrap();
    let read = |path| exr_read::read_layers(path, &["Diffuse Indirect"]).unwrap().layers.remove(0);
    let (one, eight) = (read(bounce1), read(full));
    let measure = |a, b| compare::blocks(a, b, 640, &matte.whole(0.99), 4).unwrap();
    assert!(measure(&one, &one).iter().all(|figures| figures.relative_rmse == 0.0 && figures.bias == 0.0));
    let figures = measure(&one, &eight);
    assert!(figures[0].blocks > 10_000 && figures.len() > 8);
    assert!(figures[0].bias < -0.1, "one bounce is darker than eight: {}", figures[0].bias);
    // One block of one object made brighter shows in that object and in no other.
    let back = cryptomatte::id("back");
    let whole = matte.whole(0.99);
    let inside = |p: usize| (0..16).all(|k| whole[p + k / 4 * 640 + k % 4] == back);
    let block = (0..480 / 4 * 160).map(|k| k / 160 * 4 * 640 + k % 160 * 4).find(|&p| inside(p)).unwrap();
    let mut data = one.data.to_vec();
    data[3 * block] += 1.0;
    for figures in measure(&one.with_data(data), &one) {
        assert_eq!(figures.relative_rmse > 0.0, [0, back].contains(&figures.object));
    }
}

#[test]
fn environment_above_half_is_read() {
    let paths = support::all_data("environment_above_half_is_read", &["environments/noon_grass_1k_f32.exr"]);
    for path in paths {
        let image = exr_read::read(&path).unwrap();
        assert_eq!((image.width, image.height), (1024, 512));
        let peak = image.layer("").unwrap().data.iter().fold(0.0f32, |peak, &v| peak.max(v));
        assert!((64_000.0..66_000.0).contains(&peak), "peak {peak}");
    }
}

#[test]
fn a_matte_travels_with_its_layers() {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("copy.exr");
    for path in support::all_data("a_matte_travels_with_its_layers", &PLATES[..1]) {
        let wanted = ["Combined", "CryptoObject00", "CryptoObject01", "CryptoObject02"];
        let image = exr_read::read_layers(&path, &wanted).unwrap();
        exr_write::write(&copy, &image, Depth::Half, &[]).unwrap();
        let [old, new] = [&path, &copy].map(|path| Cryptomatte::read(path, "CryptoObject").unwrap());
        assert_eq!((new.whole(0.99), &new.manifest), (old.whole(0.99), &old.manifest));
        let metadata = exr_read::read(&copy).unwrap().metadata;
        let mattes = metadata.iter().filter(|(name, _)| name.starts_with("cryptomatte/") && name.ends_with("/name"));
        assert_eq!(mattes.map(|(_, name)| name.as_str()).collect::<Vec<_>>(), ["ViewLayer.CryptoObject"]);
    }
}
