//! A render that is killed at any moment leaves the old picture or the new one, and a cache that the next render can use.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const BEFORE: &[u8] = b"rendered yesterday";
/// Every node that is kept on disk, and a picture that takes a while to write.
const RECIPE: &str = r#"{ "chiaro": 1, "nodes": {
    "room": { "type": "scene" },
    "view": { "type": "view_samples", "params": { "width": 320, "height": 240 }, "inputs": { "scene": "room" } },
    "transport": { "type": "transfer", "params": { "gather_samples": 4096, "tolerance": 0.2, "bounces": 2 },
                   "inputs": { "scene": "room", "samples": "view" } },
    "lit": { "type": "relight", "params": { "light_samples": 1 }, "inputs": { "scene": "room", "transfer": "transport" } },
    "out": { "type": "write_image", "params": { "file": "out.exr", "depth": "float" }, "inputs": { "image": "lit" } }
}}"#;

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        std::fs::write(bench.path("recipe.json"), RECIPE).unwrap();
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn start(&self, cache: &str, out: &str) -> Child {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("chiaro"));
        command.env_remove("CHIARO_LOG").arg("render").arg(self.path("recipe.json"));
        command.args(["--device", "cpu", "--progress", "none"]);
        command.arg("--cache").arg(self.path(cache)).arg("--out").arg(self.path(out));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Renders undisturbed and gives the picture's bytes.
    fn render(&self, cache: &str, out: &str) -> Vec<u8> {
        finish(self.start(cache, out));
        std::fs::read(self.path(out).join("out.exr")).unwrap()
    }
}

/// Waits for a render that must succeed without a word.
fn finish(child: Child) {
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), said.as_str()), (Some(0), ""));
}

fn names(folder: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_killed_render_leaves_nothing_half_done() {
    let bench = Bench::new();
    let start = Instant::now();
    let whole = bench.render("undisturbed", "reference");
    let time = start.elapsed();
    let kept = names(&bench.path("undisturbed"));
    assert!(!kept.is_empty(), "the transfer is kept");
    let out = bench.path("out");
    std::fs::create_dir(&out).unwrap();
    let (mut early, mut late) = (0, 0);
    const ROUNDS: u32 = 24;
    for round in 0..ROUNDS {
        std::fs::write(out.join("out.exr"), BEFORE).unwrap();
        // Half of the rounds begin without a cache, the others with what a killed render left.
        if round % 2 == 0 {
            let _ = std::fs::remove_dir_all(bench.path("cache"));
        }
        let mut child = bench.start("cache", "out");
        // Spread over the whole of a render, and a little beyond.
        std::thread::sleep(time * (round + 1) / (ROUNDS - 4) + Duration::from_millis(1));
        child.kill().unwrap();
        child.wait().unwrap();
        let there = std::fs::read(out.join("out.exr")).unwrap();
        if there == BEFORE {
            early += 1;
        } else {
            assert!(there == whole, "round {round}: {} of {} bytes, or others", there.len(), whole.len());
            late += 1;
        }
        if round % 2 == 1 {
            assert!(
                bench.render("cache", "out") == whole,
                "round {round}: another picture from the cache that was left"
            );
            assert_eq!(names(&out), ["out.exr"], "round {round}: something was left beside the picture");
            assert_eq!(names(&bench.path("cache")), kept, "round {round}: something was left in the cache");
        }
    }
    assert!(early > 0, "{late} renders were over before they were killed: nothing was tried");
}

#[test]
fn renders_that_share_a_cache_do_not_disturb_each_other() {
    let bench = Bench::new();
    let whole = bench.render("alone", "reference");
    let outs = ["a", "b", "c"];
    let children = outs.map(|out| bench.start("shared", out));
    children.into_iter().for_each(finish);
    for out in outs {
        assert!(std::fs::read(bench.path(out).join("out.exr")).unwrap() == whole, "{out} differs");
        assert_eq!(names(&bench.path(out)), ["out.exr"]);
    }
    assert_eq!(names(&bench.path("shared")), names(&bench.path("alone")));
    // The same output, too: one of the two is there in whole.
    [bench.start("shared", "same"), bench.start("shared", "same")].into_iter().for_each(finish);
    assert!(std::fs::read(bench.path("same/out.exr")).unwrap() == whole);
    assert_eq!(names(&bench.path("same")), ["out.exr"]);
}

/// What a damaged entry does to a render: a warning, and the same picture.
#[test]
fn a_damaged_cache_is_computed_again() {
    let bench = Bench::new();
    let whole = bench.render("cache", "out");
    for spoil in [0usize, 1, 2] {
        for name in names(&bench.path("cache")) {
            let path = bench.path("cache").join(name);
            let mut bytes = std::fs::read(&path).unwrap();
            let middle = bytes.len() / 2;
            match spoil {
                0 => bytes[middle] ^= 1,
                1 => bytes.truncate(middle),
                _ => bytes.clear(),
            }
            std::fs::write(&path, bytes).unwrap();
        }
        let output = bench.start("cache", "out").wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert!(said.contains("damaged cache entry, computed again"), "{said}");
        assert!(std::fs::read(bench.path("out/out.exr")).unwrap() == whole);
        assert!(bench.render("cache", "out") == whole, "without a word: it was mended");
    }
}
