//! `chiaro render` over frames, with node types of our own: what is written, what is not, and what the report says.

mod trial_nodes;

use chiaro::cli::Cli;
use chiaro::eval::Disk;
use chiaro::eval::disk::Found;
use chiaro::node::Key;
use chiaro::value::{Kind, Value};
use clap::Parser;
use serde_json::{Value as Json, json};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use trial_nodes::NODES;

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    /// A recipe of five frames whose picture is the frame, and fails from a frame on.
    fn new(fails_from: i64) -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        let recipe = json!({ "chiaro": 1, "frames": [1, 5], "nodes": {
            "clock": { "type": "clock" },
            "risky": { "type": "fail", "params": { "from": fails_from }, "inputs": { "image": "clock" } },
            "more": { "type": "gain", "params": { "amount": 2 }, "inputs": { "image": "risky" } },
            "out": { "type": "dump", "inputs": { "image": "more" } },
        }});
        std::fs::write(bench.path("recipe.json"), recipe.to_string()).unwrap();
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The exit code.
    fn render(&self, more: &[&str]) -> u8 {
        let [recipe, cache, report] = ["recipe.json", "cache", "report.json"].map(|name| self.path(name));
        let [recipe, cache, report] = [&recipe, &cache, &report].map(|path| path.to_str().unwrap());
        let fixed =
            ["chiaro", "render", recipe, "--cache", cache, "--report", report, "--progress", "none", "--device", "cpu"];
        let cli = Cli::try_parse_from(fixed.iter().chain(more)).unwrap_or_else(|error| panic!("{error}"));
        cli.run_with(NODES).unwrap_or_else(|error| error.exit_code())
    }

    fn report(&self) -> Json {
        serde_json::from_slice(&std::fs::read(self.path("report.json")).unwrap()).unwrap()
    }

    /// Frames of which there is a file, and what it holds.
    fn written(&self, folder: &str) -> Vec<(i64, String)> {
        let Ok(files) = std::fs::read_dir(self.path(folder)) else { return Vec::new() };
        let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
        let mut written: Vec<(i64, String)> = names
            .filter_map(|name| {
                let frame = name.strip_prefix("dump.")?.strip_suffix(".txt")?.parse().ok()?;
                Some((frame, std::fs::read_to_string(self.path(folder).join(name)).unwrap()))
            })
            .collect();
        written.sort();
        written
    }

    fn frames(&self) -> Vec<i64> {
        self.written("").into_iter().map(|(frame, _)| frame).collect()
    }
}

#[test]
fn frames_of_the_recipe_or_of_the_command_line() {
    let bench = Bench::new(1000);
    assert_eq!(bench.render(&[]), 0);
    let expected: Vec<(i64, String)> = (1..=5).map(|frame| (frame, format!("[{}.0]", 2 * frame))).collect();
    assert_eq!(bench.written(""), expected);
    assert_eq!(bench.report()["frames"], json!([1, 2, 3, 4, 5]));
    let bench = Bench::new(1000);
    assert_eq!(bench.render(&["--frames", "-3--1x2,9", "--set", "more.amount=-1"]), 0);
    assert_eq!(bench.written("")[0], (-3, "[3.0]".into()));
    assert_eq!(bench.frames(), [-3, -1, 9]);
    assert_eq!(bench.render(&["--frames", "20-29", "--chunk", "2/3"]), 0);
    assert_eq!(bench.frames(), [-3, -1, 9, 23, 24, 25]);
    assert_eq!(bench.render(&["--frames", "5-1"]), 2);
}

#[test]
fn a_failing_frame_stops_unless_told_to_go_on() {
    let bench = Bench::new(3);
    assert_eq!(bench.render(&[]), 1);
    assert_eq!(bench.frames(), [1, 2]);
    assert_eq!(bench.render(&["--frames", "4,1,3,2", "--keep-going"]), 5);
    let report = bench.report();
    assert_eq!(report["frames"], json!([1, 2]));
    let failed: Vec<i64> = report["failed"].as_array().unwrap().iter().map(|f| f["frame"].as_i64().unwrap()).collect();
    assert_eq!(failed, [4, 3]);
    assert!(report["failed"][0]["error"].as_str().unwrap().contains("told to fail"));
}

#[test]
fn existing_files_are_skipped_when_asked() {
    let bench = Bench::new(1000);
    std::fs::create_dir(bench.path("out")).unwrap();
    std::fs::write(bench.path("out/dump.0002.txt"), "mine").unwrap();
    let out = bench.path("out");
    let out = ["--out", out.to_str().unwrap()];
    assert_eq!(bench.render(&[out[0], out[1], "--skip-existing"]), 0);
    assert_eq!(bench.report()["skipped"], json!([2]));
    assert_eq!(bench.written("out")[1], (2, "mine".into()));
    assert_eq!(bench.written("out").len(), 5);
    assert!(bench.frames().is_empty(), "not beside the recipe");
    assert_eq!(bench.render(&out), 0);
    assert_eq!(bench.written("out")[1], (2, "[4.0]".into()));
}

#[test]
fn a_dry_run_writes_nothing() {
    let bench = Bench::new(1000);
    assert_eq!(bench.render(&["--dry-run"]), 0);
    assert!(bench.frames().is_empty() && !bench.path("report.json").exists());
}

#[test]
fn the_report_tells_what_was_computed_and_what_was_found() {
    let bench = Bench::new(1000);
    assert_eq!(bench.render(&["--frames", "7", "--threads", "1"]), 0);
    let uses = |bench: &Bench| -> Vec<String> {
        let report = bench.report();
        let nodes = report["nodes"].as_array().unwrap().iter();
        nodes.map(|node| format!("{} {}", node["node"].as_str().unwrap(), node["cache"].as_str().unwrap())).collect()
    };
    assert_eq!(uses(&bench), ["clock computed", "risky computed", "more computed", "out computed"]);
    assert_eq!(bench.render(&["--frames", "7", "--set", "more.amount=1"]), 0);
    assert_eq!(uses(&bench), ["clock disk", "risky computed", "more pass", "out computed"]);
    assert_eq!(bench.render(&["--frames", "7", "--no-cache", "--node", "clock"]), 0);
    assert_eq!(uses(&bench), ["clock computed"]);
    let report = bench.report();
    let node = &report["nodes"][0];
    assert_eq!((&node["frame"], &node["bytes"], &node["type"]), (&json!(7), &json!(4), &json!("clock")));
    assert!(node["seconds"].as_f64().unwrap() >= 0.0 && node["key"].as_str().unwrap().len() == 32);
    assert!(report["device"].as_str().unwrap().starts_with("CPU"));
    assert_eq!(bench.render(&["--frames", "7", "--threads", "1"]), 0);
    assert_eq!(bench.report()["threads"], 1);
    if cfg!(target_os = "linux") {
        assert!(report["peak_memory_bytes"].as_u64().unwrap() > 1 << 20);
    }
}

#[test]
fn a_folder_that_cannot_be_written_to_is_1_and_a_bad_cache_folder_too() {
    let bench = Bench::new(1000);
    let taken = bench.path("taken");
    std::fs::write(&taken, "a file").unwrap();
    let taken = taken.to_str().unwrap();
    assert_eq!(bench.render(&["--out", taken]), 1);
    let recipe = bench.path("recipe.json");
    let cli = Cli::try_parse_from(["chiaro", "render", recipe.to_str().unwrap(), "--cache", taken]).unwrap();
    assert_eq!(cli.run_with(NODES).unwrap_err().exit_code(), 1);
}

/// Names the folder of a test that runs this test program once more, to be stopped or killed.
const CHILD: &str = "CHIARO_TEST_CHILD_FOLDER";

fn child(test: &str, folder: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", test, "--nocapture"])
        .env(CHILD, folder)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// In the child: renders the recipe in its folder.
fn render_in(folder: &Path, more: &[&str]) -> chiaro::Result<u8> {
    let [recipe, cache] = ["recipe.json", "cache"].map(|name| folder.join(name));
    let fixed = ["chiaro", "render", recipe.to_str().unwrap(), "--device", "cpu", "--cache", cache.to_str().unwrap()];
    Cli::try_parse_from(fixed.iter().chain(more)).unwrap().run_with(NODES)
}

fn wait_for(path: &Path) {
    let start = Instant::now();
    while !path.exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "{} never came", path.display());
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The process that `a_termination_signal_stops_cleanly` stops.
#[test]
fn child_that_renders_slowly() {
    let Some(folder) = std::env::var_os(CHILD) else { return };
    let error = render_in(Path::new(&folder), &["--progress", "json"]).unwrap_err();
    assert!(matches!(error, chiaro::Error::Cancelled));
}

#[cfg(unix)]
#[test]
fn a_termination_signal_stops_cleanly() {
    if std::env::var_os(CHILD).is_some() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let recipe = json!({ "chiaro": 1, "frames": [1, 3], "nodes": {
        "clock": { "type": "clock" },
        "first": { "type": "dump", "params": { "file": "first.txt" }, "inputs": { "image": "clock" } },
        "slow": { "type": "slow", "params": { "steps": 6000 }, "inputs": { "image": "clock" } },
        "out": { "type": "dump", "params": { "file": "out.txt" }, "inputs": { "image": "slow" } },
    }});
    std::fs::write(folder.path().join("recipe.json"), recipe.to_string()).unwrap();
    std::fs::write(folder.path().join("out.txt"), "before").unwrap();
    let child = child("child_that_renders_slowly", folder.path());
    wait_for(&folder.path().join("first.txt"));
    std::thread::sleep(Duration::from_millis(300));
    assert!(Command::new("kill").arg(child.id().to_string()).status().unwrap().success());
    let start = Instant::now();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "the child's own check failed");
    assert!(start.elapsed() < Duration::from_secs(20), "it did not wait for the end");
    assert_eq!(std::fs::read_to_string(folder.path().join("out.txt")).unwrap(), "before");
    let text = String::from_utf8(output.stderr).unwrap();
    let lines = text.lines().filter_map(|line| serde_json::from_str::<Json>(line).ok());
    let waiting: Vec<Json> = lines.filter(|line| line["stage"] == "waiting").collect();
    let last = waiting.last().unwrap_or_else(|| panic!("no progress in {text}"));
    assert_eq!((&last["node"], &last["total"]), (&json!("slow"), &json!(6000)));
    assert!(last["done"].as_u64().unwrap() > 0 && last["seconds_left"].as_f64().unwrap() > 1.0, "{last}");
}

/// The process that `killed_at_any_moment_nothing_is_half_written` kills. Nearly all that it does is to write files.
#[test]
fn child_that_renders_for_ever() {
    let Some(folder) = std::env::var_os(CHILD) else { return };
    loop {
        // Each round has a cache entry of its own and replaces the same output.
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap();
        let set = format!("large.label=\"{}\"", now.as_nanos());
        let more = ["--set", &set, "--progress", "none", "--cache-size", "100M", "--node", "large", "--node", "out"];
        render_in(Path::new(&folder), &more).unwrap();
    }
}

#[test]
fn killed_at_any_moment_nothing_is_half_written() {
    if std::env::var_os(CHILD).is_some() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let recipe = json!({ "chiaro": 1, "nodes": {
        "large": { "type": "flat", "params": { "width": 5_000_000 } },
        "small": { "type": "flat", "params": { "width": 1000 } },
        "out": { "type": "dump", "params": { "file": "out.txt" }, "inputs": { "image": "small" } },
    }});
    std::fs::write(folder.path().join("recipe.json"), recipe.to_string()).unwrap();
    let [cache, out] = ["cache", "out.txt"].map(|name| folder.path().join(name));
    let (mut struck, mut round) = (0, 0);
    // Long enough that some writers were struck while they wrote: otherwise nothing was tried.
    while round < 15 || struck == 0 && round < 300 {
        let mut child = child("child_that_renders_for_ever", folder.path());
        wait_for(&out);
        std::thread::sleep(Duration::from_millis(10 + 7 * round % 90));
        child.kill().unwrap();
        child.wait().unwrap();
        round += 1;
        let text = std::fs::read_to_string(&out).unwrap();
        assert_eq!(text.len(), 5 * 1000, "the whole of it, or what was there before");
        let disk = Disk::open(&cache, 1 << 30).unwrap();
        let files: Vec<PathBuf> = std::fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().path()).collect();
        for file in &files {
            let name = file.file_name().unwrap().to_str().unwrap();
            let Some(key) = name.strip_suffix(".value") else {
                assert!(name.starts_with(chiaro::atomic::TEMPORARY), "{name}");
                struck += 1;
                std::fs::remove_file(file).unwrap();
                continue;
            };
            let byte = |at: usize| u8::from_str_radix(&key[2 * at..2 * at + 2], 16).unwrap();
            let found = disk.get(Key(std::array::from_fn(byte)), |sections| {
                sections.value::<Json>()?;
                Value::read(Kind::Image, sections)
            });
            assert!(matches!(found, Found::Value(_)), "{name} is poisoned");
        }
        assert!(!files.is_empty(), "nothing was cached");
    }
    assert!(struck > 0, "no writer was struck in {round} rounds");
}
