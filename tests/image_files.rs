//! Pictures there and back, windows that do not fit, damaged files, and folders that cannot be written.

use chiaro::Error;
use chiaro::image::exr_write::Depth;
use chiaro::image::{Content, Image, Layer, exr_read, exr_write, load, png};
use e::Compression as C;
use exr::prelude::{self as e, Vec2, WritableImage};
use std::path::Path;

/// Seeded numbers in [0, 1): the SplitMix64 sequence.
fn random(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 40) as f32 / (1u64 << 24) as f32
    }
}

fn sample(width: usize, height: usize) -> Image {
    let mut next = random(width as u64 * 1000 + height as u64);
    let mut layer = |name, channels: &[&str], content| {
        let data = (0..width * height * channels.len()).map(|_| next() * 8.0 - 1.0).collect();
        Layer::new(name, channels, content, data)
    };
    let layers = vec![
        layer("", &["R", "G", "B", "A"], Content::Colour),
        layer("indirect", &["R", "G", "B"], Content::Colour),
        layer("N", &["X", "Y", "Z"], Content::Data),
        layer("Z", &["Z"], Content::Data),
    ];
    Image {
        width,
        height,
        layers,
        metadata: vec![("note".into(), "Schatten über Türen, 影".into())],
        ..Image::default()
    }
}

fn layer<'a>(image: &'a Image, name: &str) -> &'a Layer {
    image.layer(name).unwrap_or_else(|| panic!("layer {name:?} is missing"))
}

#[test]
fn there_and_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for (width, height) in [(1, 1), (1, 40), (17, 33), (64, 16), (131, 47)] {
        let image = sample(width, height);
        for depth in [Depth::Half, Depth::Float] {
            assert_eq!(exr_write::write(&path, &image, depth, &[]).unwrap(), Vec::<String>::new());
            let back = exr_read::read(&path).unwrap();
            assert_eq!((back.width, back.height, &back.metadata), (width, height, &image.metadata));
            assert_eq!(back.layers.len(), image.layers.len());
            for old in &image.layers {
                let new = layer(&back, &old.name);
                assert_eq!((&new.channels, new.content), (&old.channels, old.content));
                for (new, old) in new.data.iter().zip(&*old.data) {
                    // Half has 11 bits: a relative error of 2^-12 when rounded to the nearest.
                    let limit = if depth == Depth::Float || layer(&back, "N").data.is_empty() {
                        0.0
                    } else {
                        old.abs() / 2048.0 + 1e-7
                    };
                    assert!((new - old).abs() <= limit, "{new} is not {old}");
                }
            }
            assert_eq!(layer(&back, "N").data[..], layer(&image, "N").data[..], "data is never half");
        }
    }
}

#[test]
fn equal_pictures_give_equal_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let image = sample(40, 30);
    let mut files = (0..4).map(|i| {
        let path = folder.path().join(format!("{i}.exr"));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(i + 1).build().unwrap();
        let attributes = [("chiaro:key", "0123"), ("chiaro:recipe", "{}"), ("b", "2"), ("a", "1")];
        pool.install(|| exr_write::write(&path, &image, Depth::Half, &attributes)).unwrap();
        std::fs::read(path).unwrap()
    });
    let first = files.next().unwrap();
    assert!(files.all(|file| file == first));
}

#[test]
fn recipe_goes_into_the_header() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let recipe = format!("{{\"nodes\": \"{}\"}}", "x".repeat(100_000));
    exr_write::write(&path, &sample(3, 2), Depth::Half, &[("chiaro:recipe", &recipe), ("chiaro:key", "ab")]).unwrap();
    let metadata = exr_read::read(&path).unwrap().metadata;
    let find = |name: &str| metadata.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str());
    assert_eq!((find("chiaro:recipe"), find("chiaro:key")), (Some(recipe.as_str()), Some("ab")));
}

#[test]
fn half_never_overflows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let mut image = sample(4, 4);
    for (peak, warnings) in [(65504.0, 0), (65505.0, 1), (-70000.0, 1), (f32::INFINITY, 1)] {
        let mut data = layer(&image, "indirect").data.to_vec();
        data[5] = peak;
        image.layers[1] = image.layers[1].with_data(data);
        let told = exr_write::write(&path, &image, Depth::Half, &[]).unwrap();
        assert_eq!(told.len(), warnings, "{told:?}");
        assert!(told.iter().all(|warning| warning.contains("indirect")));
        assert_eq!(layer(&exr_read::read(&path).unwrap(), "indirect").data[5], peak);
    }
}

#[test]
fn only_layers_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let image = sample(9, 7);
    exr_write::write(&path, &image, Depth::Float, &[]).unwrap();
    let back = exr_read::read_layers(&path, &["Z", "indirect"]).unwrap();
    assert_eq!(back.layers.iter().map(|l| l.name.as_str()).collect::<Vec<_>>(), ["Z", "indirect"]);
    assert_eq!(back.layers[1].data[..], layer(&image, "indirect").data[..]);
    let error = exr_read::read_layers(&path, &["indirct"]).unwrap_err();
    let (message, help) = (error.to_string(), error.help().to_owned());
    assert!(message.contains("a.exr") && message.contains("\"beauty\"") && message.contains("\"Z\""), "{message}");
    assert!(help.contains("\"indirect\""), "{help}");
    assert_eq!(error.exit_code(), 3);
}

/// A part of another program: planar float, half and uint channels, its own window.
fn part(
    name: &str,
    position: (i32, i32),
    size: (usize, usize),
    channels: &[(&str, &str)],
) -> e::Layer<e::AnyChannels<e::FlatSamples>> {
    let (width, height) = size;
    // Each sample says where it is: 100 y + x of the display window.
    let place = |i: usize| (100 * (i / width) as i32 + (i % width) as i32 + 100 * position.1 + position.0) as f32;
    let samples = |kind: &str| match kind {
        "half" => e::FlatSamples::F16((0..width * height).map(|i| e::f16::from_f32(place(i))).collect()),
        "uint" => e::FlatSamples::U32((0..width * height).map(|i| place(i).max(0.0) as u32).collect()),
        _ => e::FlatSamples::F32((0..width * height).map(place).collect()),
    };
    let list = channels.iter().map(|(name, kind)| e::AnyChannel::new(*name, samples(kind))).collect();
    let attributes =
        e::LayerAttributes { layer_position: Vec2(position.0, position.1), ..e::LayerAttributes::named(name) };
    e::Layer::new((width, height), attributes, e::Encoding::SMALL_FAST_LOSSLESS, e::AnyChannels::sort(list))
}

fn write_parts(path: &Path, display: e::IntegerBounds, parts: Vec<e::Layer<e::AnyChannels<e::FlatSamples>>>) {
    let attributes = e::ImageAttributes::new(display);
    e::Image::from_layers(attributes, parts).write().to_file(path).unwrap();
}

#[test]
fn data_windows_need_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    // Display window 6 x 5 at (10, 20); windows inside it, around it, beside it, and across a corner.
    let display = e::IntegerBounds::new((10, 20), (6, 5));
    for (position, size) in
        [((12, 21), (2, 3)), ((5, 15), (40, 30)), ((100, 100), (3, 3)), ((13, 23), (9, 9)), ((7, 18), (5, 4))]
    {
        write_parts(&path, display, vec![part("", position, size, &[("R", "half"), ("G", "float"), ("B", "uint")])]);
        let image = exr_read::read(&path).unwrap();
        assert_eq!((image.width, image.height), (6, 5));
        for (i, pixel) in layer(&image, "").data.chunks(3).enumerate() {
            let (x, y) = (10 + i as i32 % 6, 20 + i as i32 / 6);
            let inside = (position.0..position.0 + size.0 as i32).contains(&x)
                && (position.1..position.1 + size.1 as i32).contains(&y);
            let expected = if inside { (100 * y + x) as f32 } else { 0.0 };
            assert_eq!(pixel[1], expected, "float at {x}, {y}");
            assert_eq!(pixel[2], expected, "uint at {x}, {y}");
            assert_eq!(pixel[0], e::f16::from_f32(expected).to_f32(), "half at {x}, {y}");
        }
    }
}

#[test]
fn names_of_other_programs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let display = e::IntegerBounds::new((0, 0), (3, 2));
    let size = (3, 2);
    let rgb = |prefix: &str, names: [&str; 3]| names.map(|n| format!("{prefix}{n}"));
    let channels =
        |names: &[String]| -> Vec<(String, &'static str)> { names.iter().map(|n| (n.clone(), "half")).collect() };
    let make = |part_name: &str, names: Vec<String>| {
        let list = channels(&names);
        let list: Vec<(&str, &str)> = list.iter().map(|(n, k)| (n.as_str(), *k)).collect();
        part(part_name, (0, 0), size, &list)
    };
    let single = [
        rgb("", ["red", "green", "blue"]).to_vec(),
        rgb("RGBA_key.", ["R", "G", "B"]).to_vec(),
        rgb("a.b c.", ["r", "g", "b"]).to_vec(),
        vec!["Z".into(), "P.X".into(), "P.Y".into(), "P.Z".into(), "mask.foo".into()],
    ]
    .concat();
    write_parts(&path, display, vec![make("", single)]);
    let found = |path: &Path| -> Vec<String> {
        let image = exr_read::read(path).unwrap();
        let mut found: Vec<String> =
            image.layers.iter().map(|l| format!("{}:{}:{:?}", l.name, l.channels.join(""), l.content)).collect();
        found.sort();
        found
    };
    let expected =
        [":RGB:Colour", "P:XYZ:Data", "RGBA_key:RGB:Colour", "Z:Z:Data", "a.b c:RGB:Colour", "mask:foo:Data"];
    assert_eq!(found(&path), expected);
    // One part per pass: dotted as Blender writes them, or bare under the part's name, and a second eye.
    write_parts(
        &path,
        display,
        vec![
            make("rgba", rgb("", ["R", "G", "B"]).to_vec()),
            make("View.Combined", rgb("View.Combined.", ["R", "G", "B"]).to_vec()),
            make("diffuse", rgb("", ["R", "G", "B"]).to_vec()),
            make("depth", vec!["Z".into()]),
            make("right", rgb("View.Combined.", ["R", "G", "B"]).to_vec()),
        ],
    );
    let expected = [
        ":RGB:Colour",
        "View.Combined:RGB:Colour",
        "depth:Z:Data",
        "diffuse:RGB:Colour",
        "right.View.Combined:RGB:Colour",
    ];
    assert_eq!(found(&path), expected);
}

/// Changed copies of each file; more of them when looking for trouble.
const ROUNDS: usize = 100;

#[test]
fn damaged_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    exr_write::write(&path, &sample(33, 40), Depth::Half, &[("chiaro:recipe", "{}")]).unwrap();
    let mut files = vec![std::fs::read(&path).unwrap()];
    for compression in
        [C::Uncompressed, C::RLE, C::ZIP1, C::PIZ, C::PXR24, C::B44, C::B44A, C::DWAA(None), C::DWAB(None)]
    {
        for blocks in [e::Blocks::ScanLines, e::Blocks::Tiles(Vec2(16, 16))] {
            let mut parts = vec![part("a", (-3, 2), (20, 30), &[("R", "half"), ("G", "half"), ("B", "half")])];
            parts.push(part("b", (0, 0), (20, 20), &[("Z", "float"), ("id", "uint")]));
            for part in &mut parts {
                part.encoding = e::Encoding { compression, blocks, line_order: e::LineOrder::Increasing };
            }
            write_parts(&path, e::IntegerBounds::new((0, 0), (20, 20)), parts);
            files.push(std::fs::read(&path).unwrap());
        }
    }
    let picture = folder.path().join("a.png");
    png::write(&picture, layer(&sample(33, 40), "indirect"), 33).unwrap();

    let hurt = folder.path().join("hurt.exr");
    let attempt = |bytes: &[u8]| -> Option<Error> {
        std::fs::write(&hurt, bytes).unwrap();
        load::load(&hurt, None).err()
    };
    let mut next = random(7);
    for whole in files {
        assert!(attempt(&whole).is_none());
        for _ in 0..40 {
            let length = (next() * whole.len() as f32) as usize;
            let error = attempt(&whole[..length]).unwrap_or_else(|| panic!("{length} bytes of {}", whole.len()));
            assert!(matches!(error, Error::File { .. }) && error.to_string().contains("hurt.exr"), "{error}");
        }
        // A changed byte may go unseen (a pixel, a name); it must not panic, and an error must be about the file.
        for round in 0..ROUNDS {
            let mut bytes = whole.clone();
            for _ in 0..1 + round % 3 {
                let header = if round % 2 == 0 { 600.min(bytes.len()) } else { bytes.len() };
                bytes[(next() * header as f32) as usize] = (next() * 256.0) as u8;
            }
            if let Some(error) = attempt(&bytes) {
                assert_eq!(error.exit_code(), 3, "{error}");
            }
        }
    }
    let hurt = folder.path().join("hurt.png");
    let whole = std::fs::read(&picture).unwrap();
    for length in (0..whole.len()).step_by(97) {
        std::fs::write(&hurt, &whole[..length]).unwrap();
        assert_eq!(load::load(&hurt, None).unwrap_err().exit_code(), 3, "{length} bytes");
    }
    assert_eq!(load::load(&folder.path().join("none.exr"), None).unwrap_err().exit_code(), 3);
    assert_eq!(load::load(folder.path(), None).unwrap_err().exit_code(), 3);
}

#[test]
fn fuzzed_files_are_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/fuzzed");
    let pictures = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let pictures: Vec<_> = pictures.filter(|path| load::extension(path) == "exr").collect();
    assert!(!pictures.is_empty());
    for path in pictures {
        assert_eq!(load::load(&path, None).unwrap_err().exit_code(), 3, "{}", path.display());
    }
}

#[test]
fn pictures_of_eight_bits_become_linear() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let image = sample(5, 4);
    let indirect = layer(&image, "indirect");
    png::write(&path, indirect, 5).unwrap();
    let back = load::load(&path, Some(&["beauty"])).unwrap();
    assert_eq!((back.width, back.height), (5, 4));
    for (new, old) in layer(&back, "").data.iter().zip(&*indirect.data) {
        assert!((new - old.clamp(0.0, 1.0)).abs() < 0.005, "{new} is not {old}");
    }
    assert!(load::load(&path, Some(&["indirect"])).unwrap_err().help().contains("EXR"));
    let two = Layer::new("uv", &["X", "Y"], Content::Data, vec![0.0; 2]);
    assert_eq!(png::write(&path, &two, 1).unwrap_err().exit_code(), 1);
}

#[test]
fn what_cannot_be_written_leaves_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let image = sample(4, 4);
    let file = folder.path().join("file.exr");
    std::fs::write(&file, "before").unwrap();
    let mut bad = image.clone();
    bad.layers.push(bad.layers[0].clone());
    let refused = |path: &Path, image: &Image| {
        let error = exr_write::write(path, image, Depth::Half, &[]).unwrap_err();
        assert!(matches!(error, Error::Output { .. }) && error.exit_code() == 1, "{error}");
    };
    refused(&file, &bad);
    refused(&file, &Image::default());
    bad.layers = vec![image.layers[0].with_data(vec![0.0; 3])];
    refused(&file, &bad);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "before");
    refused(&file.join("under_a_file.exr"), &image);
    refused(Path::new("/proc/chiaro/a.exr"), &image);
    refused(folder.path(), &image);
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["file.exr"], "nothing temporary stays behind");
}
