//! `chiaro chart`: what its files say, held against renders by hand; charts as files; what is refused.

use assert_cmd::Command;
use chiaro::image::{Image, compare, load};
use predicates::str::contains;
use serde_json::json;
use std::path::{Path, PathBuf};

fn chiaro() -> Command {
    let mut command = Command::cargo_bin("chiaro").unwrap();
    command.env_remove("CHIARO_LOG").env_remove("CHIARO_CACHE").env("NO_COLOR", "1");
    command
}

fn recipe(folder: &Path) -> PathBuf {
    let recipe = json!({
        "chiaro": 1,
        "nodes": {
            "room": { "type": "scene", "params": { "file": "builtin:room" } },
            "view": {
                "type": "view_samples", "params": { "width": 24, "height": 16 }, "inputs": { "scene": "room" },
            },
            "transport": {
                "type": "transfer", "params": { "gather_samples": 1024 }, "inputs": { "scene": "room", "samples": "view" },
            },
            "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "transport" } },
            "out": {
                "type": "write_image", "params": { "file": "out.exr", "depth": "float" }, "inputs": { "image": "lit" },
            },
        },
    });
    let path = folder.join("room.json");
    std::fs::write(&path, recipe.to_string()).unwrap();
    path
}

/// Lines of a table, by the names of its columns.
struct Table {
    names: Vec<String>,
    lines: Vec<Vec<String>>,
}

impl Table {
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect());
        Self { names: lines.next().unwrap(), lines: lines.collect() }
    }

    fn column(&self, name: &str) -> Vec<&str> {
        let at = self.names.iter().position(|other| other == name).unwrap_or_else(|| panic!("no column {name}"));
        self.lines.iter().map(|line| line[at].as_str()).collect()
    }

    fn numbers(&self, name: &str) -> Vec<f64> {
        self.column(name).iter().map(|text| text.parse().unwrap()).collect()
    }
}

/// What a recipe renders to with some settings.
fn rendered(recipe: &Path, folder: &Path, settings: &[&str]) -> Image {
    let mut command = chiaro();
    command.arg("render").arg(recipe).args(["--no-cache", "--device", "cpu", "--out"]).arg(folder);
    command.args(settings.iter().flat_map(|setting| ["--set", setting])).assert().success();
    load::load(&folder.join("out.exr"), None).unwrap()
}

#[test]
fn the_table_says_what_renders_by_hand_say() {
    let folder = tempfile::tempdir().unwrap();
    let (recipe, out) = (recipe(folder.path()), folder.path().join("charts"));
    let mut command = chiaro();
    command.arg("chart").arg(&recipe).args(["--sweep", "transport.rows=every,adaptive"]);
    command.args(["--sweep", "transport.tolerance=0.3,0.1,0.05", "--reference", "transport.tolerance=0.05"]);
    command.args(["--layer", "indirect", "--runs", "1", "-o"]).arg(&out);
    command.assert().success().stdout(contains("| transport.rows |"));
    let table = Table::read(&out.join("room.csv"));
    assert_eq!(table.column("transport.rows"), ["every", "every", "every", "adaptive", "adaptive", "adaptive"]);
    assert_eq!(table.numbers("transport.tolerance"), [0.3, 0.1, 0.05, 0.3, 0.1, 0.05]);

    let errors = table.numbers("relative_rmse");
    assert_eq!(errors[5], 0.0, "the reference has this point's settings");
    assert_eq!((table.column("ssim")[5], table.column("relative_p99")[5]), ("1", "0"));
    let reference = rendered(&recipe, folder.path(), &["transport.tolerance=0.05"]);
    let picture = rendered(&recipe, folder.path(), &["transport.rows=\"every\"", "transport.tolerance=0.1"]);
    let [a, b] = [&picture, &reference].map(|image| image.find("indirect").unwrap());
    let figures = compare::compare(a, b, 24).unwrap();
    assert!(figures.relative() > 0.01, "a chart of nothing");
    let told = ["relative_rmse", "relative_p99", "relative_bias", "ssim"].map(|name| table.numbers(name)[1]);
    let ssim = compare::ssim(a, b, 24).unwrap();
    assert_eq!(told, [figures.relative(), figures.relative_p99(), figures.bias(), ssim]);

    // Bytes are of all stages, seconds at least those of all stages; what is precomputed is not computed when warm.
    let stages = ["room", "view", "transport", "lit"];
    for line in 0..6 {
        let sum = |what: &str| stages.map(|node| table.numbers(&format!("{what} {node}"))[line]).iter().sum::<f64>();
        assert_eq!(sum("bytes"), table.numbers("bytes")[line]);
        for caches in ["seconds_cold", "seconds_warm"] {
            let (parts, whole) = (sum(caches), table.numbers(caches)[line]);
            assert!(parts > 0.0 && parts <= whole, "{caches}: {parts} of {whole} s");
        }
    }
    // The front, by its meaning: in the order of seconds, each has less error than all before it.
    for caches in ["cold", "warm"] {
        let seconds = table.numbers(&format!("seconds_{caches}"));
        let mut order: Vec<usize> = (0..6).collect();
        order.sort_by(|a, b| (seconds[*a], errors[*a]).partial_cmp(&(seconds[*b], errors[*b])).unwrap());
        let (mut least, mut front) = (f64::INFINITY, ["0"; 6]);
        for at in order {
            if errors[at] < least {
                (least, front[at]) = (errors[at], "1");
            }
        }
        assert_eq!(table.column(&format!("front_{caches}")), front);
    }

    let svg = std::fs::read_to_string(out.join("room.svg")).unwrap();
    for text in
        ["cold: nothing is cached", "warm:", "seconds", "error, %", "every, by tolerance", "transport.tolerance = 0.05"]
    {
        assert!(svg.contains(text), "{text} is not in the picture");
    }
    let png = load::load(&out.join("room.png"), None).unwrap();
    assert_eq!((png.width, png.height), (2560, 1280));
    let inked = png.layers[0].data.chunks(png.layers[0].channels.len()).filter(|pixel| pixel[0] < 0.9).count();
    assert!((5_000..500_000).contains(&inked), "{inked} pixels are not paper");
    let table = std::fs::read_to_string(out.join("room.md")).unwrap();
    assert_eq!(table.lines().filter(|line| line.starts_with("| ")).count(), 7);
}

#[test]
fn a_file_says_what_the_options_say_and_more() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = recipe(folder.path());
    // Another renderer's plate: light without colour, and the colour.
    let reference = rendered(&recipe, folder.path(), &["transport.tolerance=0.05"]);
    let plate = folder.path().join("plate.exr");
    std::fs::rename(folder.path().join("out.exr"), &plate).unwrap();
    std::fs::write(folder.path().join("others.csv"), "seconds,error\n3,0.2\n9,0.05\n").unwrap();
    let chart = json!({
        "chart": 1, "title": "Rows & rays", "graph": "room.json", "layer": "indirect",
        "sweep": [
            { "transport.basis": ["haar"], "transport.coefficients": [8, 512] },
            { "transport.basis": ["cut"] },
            { "device": ["cpu"] },
        ],
        "set": { "transport.tolerance": 0.05 },
        "against": { "file": "plate.exr", "layer": "indirect", "times": ["albedo", "albedo"] },
        "default": { "transport.basis": "cut" }, "why": "No ringing.",
        "beside": { "another renderer": "others.csv" },
    });
    std::fs::create_dir(folder.path().join("charts")).unwrap();
    let path = folder.path().join("charts/bases.json");
    let mut moved = chart.clone();
    for pointer in ["/graph", "/against/file", "/beside/another renderer"] {
        let value = moved.pointer_mut(pointer).unwrap();
        *value = format!("../{}", value.as_str().unwrap()).into();
    }
    std::fs::write(&path, moved.to_string()).unwrap();
    chiaro().arg("chart").arg(&path).arg("-o").arg(folder.path()).assert().success();
    let table = Table::read(&folder.path().join("bases.csv"));
    assert_eq!(table.column("transport.basis"), ["haar", "haar", "cut", ""]);
    assert_eq!(table.column("default"), ["0", "0", "1", "0"]);
    let errors = table.numbers("relative_rmse");
    assert!(errors[0] != errors[1] && errors[2] == errors[3], "{errors:?}");
    // Without the factors, the plate is what the default renders.
    let [light, albedo] = ["indirect", "albedo"].map(|name| reference.find(name).unwrap());
    let times = |light: &chiaro::image::Layer| {
        light.with_data(light.data.iter().zip(albedo.data.iter()).map(|(light, albedo)| light * albedo).collect())
    };
    let expected = compare::compare(light, &times(&times(light)), 24).unwrap().relative();
    assert!((errors[2] / expected - 1.0).abs() < 1e-6, "{} and {expected}", errors[2]);
    let svg = std::fs::read_to_string(folder.path().join("bases.svg")).unwrap();
    for text in ["Rows &amp; rays", "another renderer", "haar, by coefficients", "default: No ringing."] {
        assert!(svg.contains(text), "{text} is not in the picture");
    }
}

#[test]
fn what_cannot_be_charted_is_refused_before_anything_runs() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = recipe(folder.path());
    let out = folder.path().join("charts");
    let refused = |arguments: &[&str], code: i32, message: &str| {
        let mut command = chiaro();
        command.arg("chart").arg(&recipe).args(arguments).arg("-o").arg(&out);
        command.assert().code(code).stderr(contains(message)).stdout(predicates::str::is_empty());
        assert!(!out.join("room.csv").exists());
    };
    let (sweep, reference) = ("transport.tolerance=0.3,0.1", "transport.tolerance=0.05");
    refused(&["--reference", reference], 2, "nothing is swept");
    refused(&["--sweep", sweep], 2, "nothing to hold points against");
    refused(&["--sweep", "transfer.tolerance=1", "--reference", reference], 2, "no node \"transfer\"");
    refused(&["--sweep", "transport.tolerence=1", "--reference", reference], 2, "tolerance");
    refused(&["--sweep", "transport.tolerance=0.3,40", "--reference", reference], 2, "tolerance");
    refused(&["--sweep", "transport.tolerance", "--reference", reference], 2, "not NODE.PARAM=V,V");
    refused(&["--sweep", sweep, "--reference", "view.width=20"], 2, "24 x 16");
    refused(&["--sweep", sweep, "--reference", reference, "--node", "view"], 2, "gives no image");
    refused(&["--sweep", sweep, "--reference", reference, "--layer", "indirekt"], 2, "did you mean \"indirect\"");
    refused(&["--sweep", "device=tpu", "--reference", reference], 2, "no such device");
    refused(&["--sweep", sweep, "--against", "none.exr"], 3, "none.exr");
    refused(&["--sweep", sweep, "--reference", reference, "--beside", "x=none.csv"], 3, "none.csv");

    let chart = |text: &str, code: i32, message: &str| {
        let path = folder.path().join("chart.json");
        std::fs::write(&path, text).unwrap();
        let mut command = chiaro();
        command.arg("chart").arg(path).arg("-o").arg(&out).assert().code(code).stderr(contains(message));
    };
    chart("{\"chart\": 2, \"graph\": \"room.json\"}", 3, "reads version 1");
    chart("{\"chart\": 1, \"grapf\": \"room.json\"}", 3, "grapf");
    let with = |more: &str| {
        format!(
            "{{\"chart\": 1, \"graph\": \"room.json\", \"sweep\": {{\"transport.tolerance\": [0.1]}}, \
             \"reference\": {{\"transport.tolerance\": 0.05}}{more}}}"
        )
    };
    chart(&with(", \"default\": {\"transport.tolerance\": 0.2}"), 2, "the default is not among what is swept");
    chart(&with(", \"against\": {\"file\": \"x.exr\"}"), 2, "two references");
    chart(&with(", \"runs\": 0"), 2, "from 1 up");
    assert!(!out.join("chart.csv").exists());
}
