//! Batches that survive the night: frames in parts and in shards, by several processes, killed, and on a full disk.

#[path = "support/folder.rs"]
mod folder;
#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/glb.rs"]
mod glb;

use folder::files;
use glb::Glb;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

const LAMP: usize = 3;

/// A folder with a scene whose lamp moves, and a recipe of six frames; its transfer is that of all of them.
struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        let glb = Glb::room().animate("lamp", LAMP, "translation", 3, &[0.0, 0.25], &[-1.0, 3.5, 1.0, 1.0, 3.5, 1.0]);
        std::fs::write(bench.path("room.glb"), glb.bytes()).unwrap();
        let sky = json!({ "type": "environment", "params": { "file": "builtin:lamps", "face_size": 32 } });
        let recipe = json!({ "chiaro": 1, "frames": [1, 6], "nodes": {
            "room": { "type": "scene", "params": { "file": "room.glb" } },
            "view": { "type": "view_samples", "params": { "width": 96, "height": 72 }, "inputs": { "scene": "room" } },
            "xfer": { "type": "transfer", "params": { "gather_samples": 1024, "tolerance": 0.1, "bounces": 2 },
                      "inputs": { "scene": "room", "samples": "view" } },
            "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer" } },
            "out": { "type": "write_image", "params": { "file": "lit.####.exr", "depth": "float" }, "inputs": { "image": "lit" } },
            "sky": sky,
            "seen": { "type": "visibility", "params": { "face_size": 32 },
                      "inputs": { "scene": "room", "samples": "view", "environment": "sky" } },
            "carry": { "type": "transport", "inputs": { "samples": "view", "environment": "sky", "scene": "room" } },
            "outside": { "type": "integrate", "inputs": { "visibility": "seen", "transport": "carry", "samples": "view" } },
            "shade": { "type": "write_image", "params": { "file": "sky.####.exr" }, "inputs": { "image": "outside" } },
        }});
        std::fs::write(bench.path("recipe.json"), recipe.to_string()).unwrap();
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, cache: &str, out: &str, more: &[&str]) -> Command {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("chiaro"));
        command.env("CHIARO_LOG", "error").env("NO_COLOR", "1").arg("render").arg(self.path("recipe.json"));
        command.args(["--device", "cpu", "--progress", "none", "--report"]).arg(self.path("report.json"));
        command.arg("--cache").arg(self.path(cache)).arg("--out").arg(self.path(out)).args(more);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn run(&self, cache: &str, out: &str, more: &[&str]) -> Output {
        self.command(cache, out, more).output().unwrap()
    }

    /// A render that must succeed without a word; what it wrote, by name.
    fn render(&self, cache: &str, out: &str, more: &[&str]) -> BTreeMap<String, Vec<u8>> {
        let output = self.run(cache, out, more);
        assert_eq!((output.status.code(), text(&output.stderr).as_str()), (Some(0), ""), "{more:?}");
        files(&self.path(out))
    }

    /// What a node said of itself at a frame.
    fn notes(&self, node: &str, frame: i64) -> Option<Json> {
        let report: Json = serde_json::from_slice(&std::fs::read(self.path("report.json")).unwrap()).unwrap();
        let nodes = report["nodes"].as_array().unwrap();
        let found = nodes.iter().find(|entry| entry["node"] == node && entry["frame"] == frame)?;
        Some(found.clone())
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn shards_meet_in_the_cache_and_give_the_same_bytes() {
    let bench = Bench::new();
    let plain = bench.render("alone", "plain", &[]);
    assert_eq!(plain.len(), 12);
    let whole = bench.notes("xfer", 1).unwrap();
    assert!(whole["notes"]["rays"].as_u64().unwrap() > 0 && whole["notes"].get("rows_found").is_none());
    // Three processes at once, each its part; nothing is written but to the cache.
    let shards: Vec<_> =
        ["1/3", "2/3", "3/3"].map(|part| bench.command("shared", "none", &["--shard", part]).spawn().unwrap()).into();
    for shard in shards {
        let output = shard.wait_with_output().unwrap();
        assert_eq!((output.status.code(), text(&output.stderr).as_str()), (Some(0), ""));
    }
    assert!(!bench.path("none").exists() && !files(&bench.path("shared")).is_empty());
    assert!(bench.render("shared", "out", &[]) == plain, "other bytes out of shards");
    let found = bench.notes("xfer", 1).unwrap();
    let rows = whole["notes"]["rows"].as_u64().unwrap() + 1024;
    assert_eq!(
        (&found["notes"]["rays"], &found["notes"]["rows_found"]),
        (&json!(0), &json!(rows)),
        "all of it was there"
    );
    // A shard that never ran is made up for.
    bench.run("part", "none", &["--shard", "2/3"]);
    assert!(bench.render("part", "some", &[]) == plain);
    let some = bench.notes("xfer", 1).unwrap()["notes"]["rows_found"].as_u64().unwrap();
    assert!(some > 0 && some < rows / 2, "{some} of {rows}");
    // The second time, a shard has nothing left to do.
    bench.run("part", "none", &["--shard", "2/3"]);
    assert!(bench.notes("xfer", 1).is_none_or(|entry| entry["notes"]["blocks_computed"] == 0));
}

#[test]
fn shards_want_a_cache_and_make_sense() {
    let bench = Bench::new();
    let code = |more: &[&str]| {
        let output = Command::new(assert_cmd::cargo::cargo_bin("chiaro"))
            .arg("render")
            .arg(bench.path("recipe.json"))
            .args(["--device", "cpu", "--progress", "none"])
            .args(more)
            .output()
            .unwrap();
        (output.status.code(), text(&output.stderr))
    };
    let cache = bench.path("cache");
    let cache = cache.to_str().unwrap();
    for part in ["0/3", "4/3", "3", "a/b"] {
        let (code, said) = code(&["--cache", cache, "--shard", part]);
        assert!(code == Some(2) && said.contains("--shard") && said.contains("I/N"), "{part}: {said}");
    }
    let (exit, said) = code(&["--no-cache", "--shard", "1/2"]);
    assert!(exit == Some(2) && said.contains("--no-cache"), "{said}");
    // What is left nowhere was done for nothing.
    let (exit, said) = code(&["--cache", cache, "--cache-size", "1K", "--shard", "1/2"]);
    assert!(
        exit == Some(1) && said.contains("larger than the cache may be") && said.contains("--cache-size"),
        "{said}"
    );
}

#[test]
fn the_transfer_of_a_still_scene_is_made_once() {
    let bench = Bench::new();
    bench.render("cache", "out", &["--frames", "1-3"]);
    let uses = |node: &str| {
        (1..=3).map(|frame| bench.notes(node, frame).map(|entry| entry["cache"].clone())).collect::<Vec<_>>()
    };
    let (new, old) = (Some(json!("computed")), Some(json!("memory")));
    assert_eq!(uses("xfer"), [new.clone(), old.clone(), old.clone()]);
    assert_eq!(uses("lit"), [new.clone(), new.clone(), new.clone()]);
    assert_eq!(uses("outside"), [new, old.clone(), old], "the sky does not care for the lamp");
}

/// Frames shared out by `--chunk` over processes at once, with one cache and one folder.
#[test]
fn chunks_together_are_the_whole() {
    let bench = Bench::new();
    let plain = bench.render("alone", "plain", &[]);
    let chunks: Vec<_> = ["1/4", "2/4", "3/4", "4/4"]
        .map(|part| bench.command("shared", "out", &["--chunk", part]).spawn().unwrap())
        .into();
    for chunk in chunks {
        let output = chunk.wait_with_output().unwrap();
        assert_eq!((output.status.code(), text(&output.stderr).as_str()), (Some(0), ""));
    }
    assert!(files(&bench.path("out")) == plain);
}

/// Killed at any moment, the same command again ends with the bytes of an undisturbed run.
#[test]
fn a_killed_batch_is_taken_up_again() {
    let bench = Bench::new();
    let start = Instant::now();
    let plain = bench.render("alone", "plain", &[]);
    let time = start.elapsed();
    let mut partly = 0;
    for round in 0..10u32 {
        let (cache, out) = (format!("cache{round}"), format!("out{round}"));
        let mut child = bench.command(&cache, &out, &["--skip-existing"]).spawn().unwrap();
        std::thread::sleep(time * round / 9 + Duration::from_millis(3));
        child.kill().unwrap();
        child.wait().unwrap();
        let left = files(&bench.path(&out));
        let whole = left.iter().filter(|(name, _)| name.ends_with(".exr")).collect::<Vec<_>>();
        assert!(whole.iter().all(|(name, bytes)| plain[*name] == **bytes), "round {round}: a file that is not whole");
        partly += usize::from(!whole.is_empty() && whole.len() < plain.len());
        // Shards have left parts, too.
        assert!(bench.render(&cache, &out, &["--skip-existing"]) == plain, "round {round}");
        assert!(bench.render(&cache, &out, &["--skip-existing"]) == plain, "round {round}, with nothing left to do");
    }
    assert!(partly > 0, "no kill came in the middle: nothing was tried");
}

#[cfg(unix)]
#[test]
fn a_signal_drops_the_current_file_and_keeps_the_others() {
    let bench = Bench::new();
    let plain = bench.render("alone", "plain", &[]);
    for signal in ["INT", "TERM"] {
        let out = format!("out{signal}");
        let child = bench.command(&format!("cache{signal}"), &out, &["--frames", "1-6,1-6"]).spawn().unwrap();
        let begin = Instant::now();
        while files(&bench.path(&out)).len() < 2 {
            assert!(begin.elapsed() < Duration::from_secs(60), "it never began");
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(Command::new("kill").args(["-s", signal, &child.id().to_string()]).status().unwrap().success());
        let output = child.wait_with_output().unwrap();
        let left = files(&bench.path(&out));
        assert!(left.iter().all(|(name, bytes)| plain.get(name) == Some(bytes)), "{signal}: {:?}", left.keys());
        // It may have been over before the signal came.
        let is_over = output.status.code() == Some(0) && left.len() == plain.len();
        assert!(is_over || output.status.code() == Some(1), "{signal}: {:?} {}", output.status, text(&output.stderr));
        assert!(bench.render(&format!("cache{signal}"), &out, &["--skip-existing"]) == plain);
    }
}

/// On a disk that fills up: an error that says so, and all that was written before as it was.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_loses_nothing_that_was_written() {
    let bench = Bench::new();
    let plain = bench.render("alone", "plain", &["--node", "out"]);
    let size: usize = plain.values().map(Vec::len).sum::<usize>() / plain.len();
    // A disk of its own, of three and a half pictures, in a name space of its own; what is left is copied out.
    std::fs::create_dir_all(bench.path("disk")).unwrap();
    let (disk, left) = (bench.path("disk"), bench.path("left"));
    let chiaro = assert_cmd::cargo::cargo_bin("chiaro");
    let render = |cache: &Path| {
        let recipe = bench.path("recipe.json");
        let [chiaro, recipe, cache, disk] = [&chiaro, &recipe, cache, &disk].map(|path| path.display().to_string());
        format!("{chiaro} render {recipe} --node out --device cpu --progress none --cache {cache} --out {disk}/out")
    };
    let script = |cache: &Path| {
        let (disk, left) = (disk.display(), left.display());
        let bytes = size * 7 / 2;
        format!(
            "mount -t tmpfs -o size={bytes} tmpfs {disk} || exit 99; {}; code=$?; cp -r {disk}/out {left}; exit $code",
            render(cache)
        )
    };
    let run = |cache: &Path| {
        let _ = std::fs::remove_dir_all(&left);
        Command::new("unshare").args(["-Urm", "sh", "-c", &script(cache)]).env("NO_COLOR", "1").output()
    };
    let output = match run(&bench.path("alone")) {
        Ok(output) if output.status.code() != Some(99) && !text(&output.stderr).contains("unshare") => output,
        _ => {
            use std::io::Write;
            let _ = writeln!(
                std::io::stderr(),
                "\nSKIPPED: a_full_disk_loses_nothing_that_was_written: no disk can be mounted here"
            );
            return;
        }
    };
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("lit.0004.exr") && said.contains("No space left"), "{said}");
    let kept = files(&left);
    assert_eq!(kept.keys().collect::<Vec<_>>(), ["lit.0001.exr", "lit.0002.exr", "lit.0003.exr"]);
    assert!(kept.iter().all(|(name, bytes)| plain[name] == *bytes));
    // A cache without room is no reason to fail: the first frame fits, and is told of.
    let output = run(&disk.join("cache")).unwrap();
    let said = text(&output.stderr);
    assert!(said.contains("is not kept in the disk cache") && said.contains("No space left"), "{said}");
    assert!(files(&left).iter().all(|(name, bytes)| plain[name] == *bytes) && !files(&left).is_empty(), "{said}");
}
