//! Jobs for render farms: sound text, and really run: frames that come out are those of a plain render.

#[path = "support/folder.rs"]
mod folder;
#[allow(dead_code, reason = "each test file uses its own part")]
#[path = "support/glb.rs"]
mod glb;
#[path = "support/python.rs"]
mod python;

use folder::files;
use glb::Glb;
use python::said;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use yaml_rust2::{Yaml, YamlLoader};

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    /// Four frames of a moving lamp, or of a moving wall: then frames have no transfer in common.
    fn new(moves: usize) -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        let from = [[0.0, 2.0, -2.0], [0.0, 1.5, 4.0], [-1.0, 3.5, 1.0]][moves - 1];
        let to = [from[0] + 0.5, from[1], from[2]];
        let glb = Glb::room().animate("slide", moves, "translation", 3, &[0.0, 0.5], &[from, to].concat());
        std::fs::write(bench.path("room.glb"), glb.bytes()).unwrap();
        let recipe = json!({ "chiaro": 1, "frames": [1, 4], "nodes": {
            "room": { "type": "scene", "params": { "file": "room.glb" } },
            "view": { "type": "view_samples", "params": { "width": 48, "height": 36 }, "inputs": { "scene": "room" } },
            "xfer": { "type": "transfer", "params": { "gather_samples": 512, "tolerance": 0.2 },
                      "inputs": { "scene": "room", "samples": "view" } },
            "lit": { "type": "relight", "inputs": { "scene": "room", "transfer": "xfer" } },
            "out": { "type": "write_image", "params": { "file": "lit.####.exr", "depth": "float" }, "inputs": { "image": "lit" } },
        }});
        std::fs::write(bench.path("it's a recipe.json"), recipe.to_string()).unwrap();
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn chiaro(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("chiaro"));
        command.env("CHIARO_LOG", "error").env("NO_COLOR", "1").args(arguments).output().unwrap()
    }

    fn farm(&self, engine: &str, more: &[&str]) -> String {
        let recipe = self.path("it's a recipe.json");
        let output = self.chiaro(&[&["farm", engine, recipe.to_str().unwrap()], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Both steps of a job beside the recipe; what the engine says.
    fn run_job(&self, openjd: impl Fn(&[&str]) -> Output, job: &Path) -> String {
        let parameter = |name: &str, value: &Path| format!("{name}={}", value.display());
        let chiaro = parameter("Chiaro", &assert_cmd::cargo::cargo_bin("chiaro"));
        let [out, cache] = [parameter("Out", &self.path("out")), parameter("Cache", &self.path("cache"))];
        let what = ["run", job.to_str().unwrap(), "--step", "Frames", "--run-dependencies"];
        said(openjd(&[&what[..], &["-p", &chiaro, "-p", &out, "-p", &cache]].concat()))
    }

    fn plain(&self) -> BTreeMap<String, Vec<u8>> {
        let [recipe, out] = ["it's a recipe.json", "plain"].map(|name| self.path(name));
        let fixed =
            ["render", recipe.to_str().unwrap(), "--out", out.to_str().unwrap(), "--no-cache", "--device", "cpu"];
        assert!(self.chiaro(&fixed).status.success());
        files(&out)
    }
}

/// The engine of the standard itself, if it is here.
fn openjd(test: &str) -> Option<impl Fn(&[&str]) -> Output> {
    let run = python::with(test, &["openjd"])?;
    Some(move |arguments: &[&str]| run(&[&["-m", "openjd"], arguments].concat()))
}

const LAMP: usize = 3;
const WALL: usize = 1;

fn strings(list: &Yaml) -> Vec<&str> {
    list.as_vec().unwrap().iter().map(|item| item.as_str().unwrap()).collect()
}

#[test]
fn a_template_says_what_is_shared_and_what_comes_after() {
    let bench = Bench::new(LAMP);
    let text = bench
        .farm("openjd", &["--frames", "1-4", "--chunk-size", "2", "--shards", "3", "--set", "lit.light_samples=4"]);
    let job = &YamlLoader::load_from_str(&text).unwrap()[0];
    assert_eq!(job["specificationVersion"].as_str(), Some("jobtemplate-2023-09"));
    assert_eq!((strings(&job["extensions"]), job["name"].as_str()), (vec!["TASK_CHUNKING"], Some("it's a recipe")));
    let [precompute, frames] = &job["steps"].as_vec().unwrap()[..] else { panic!("two steps in {text}") };
    assert_eq!((precompute["name"].as_str(), frames["name"].as_str()), (Some("Precompute"), Some("Frames")));
    assert_eq!(frames["dependencies"][0]["dependsOn"].as_str(), Some("Precompute"));
    let space = |step: &Yaml| step["parameterSpace"]["taskParameterDefinitions"][0].clone();
    assert_eq!(space(precompute)["range"].as_str(), Some("1-3"));
    assert_eq!(space(frames)["chunks"]["defaultTaskCount"].as_i64(), Some(2));
    let of = |step: &Yaml| strings(&step["script"]["actions"]["onRun"]["args"]).join(" ");
    assert!(
        of(precompute).contains("--frames 1 --shard {{Task.Param.Shard}}/3")
            && of(precompute).contains("--set lit.light_samples=4")
    );
    assert!(of(frames).contains("--frames {{Task.Param.Frame}}") && of(frames).contains("--set lit.light_samples=4"));
    let parameters = job["parameterDefinitions"].as_vec().unwrap().iter();
    let defaults: BTreeMap<&str, Option<&str>> =
        parameters.map(|parameter| (parameter["name"].as_str().unwrap(), parameter["default"].as_str())).collect();
    assert_eq!((defaults["Frames"], defaults["Chiaro"]), (Some("1-4"), Some("chiaro")));
    assert_eq!(defaults["Recipe"], None, "engines refuse absolute paths as defaults");
}

#[test]
fn what_frames_do_not_share_is_not_precomputed() {
    for (bench, more, steps) in [
        (Bench::new(WALL), &["--chunk-size", "1"][..], 1),
        // One chunk alone shares with nobody.
        (Bench::new(LAMP), &["--chunk-size", "4"], 1),
        (Bench::new(LAMP), &["--chunk-size", "3"], 2),
        (Bench::new(LAMP), &["--frames", "2,9"], 1),
        (Bench::new(LAMP), &["--frames", "2,9", "--chunk-size", "1"], 2),
    ] {
        let text = bench.farm("openjd", more);
        let job = &YamlLoader::load_from_str(&text).unwrap()[0];
        assert_eq!(job["steps"].as_vec().unwrap().len(), steps, "{more:?}");
    }
}

/// More tasks than an array may have are several arrays, and none is lost.
#[test]
fn long_batches_are_cut() {
    let bench = Bench::new(LAMP);
    let text = bench.farm("slurm", &["--frames", "1-2500", "--chunk-size", "1", "--skip-existing"]);
    assert_eq!(text.matches("--array=1-1000 ").count(), 2, "{text}");
    assert_eq!(text.matches("--array=1-500 ").count(), 1);
    assert_eq!(text.matches(" --skip-existing --frames").count(), 3);
    let frames: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("chunks=(")).collect();
    let frames: Vec<i64> =
        frames.iter().flat_map(|list| list[..list.len() - 1].split(' ')).map(|n| n.parse().unwrap()).collect();
    assert_eq!(frames, (1..=2500).collect::<Vec<_>>());
    // Every other frame of a thousand is still a short list.
    let text = bench.farm("openjd", &["--frames", "-11-2001x2"]);
    let job = &YamlLoader::load_from_str(&text).unwrap()[0];
    assert_eq!(job["parameterDefinitions"][3]["default"].as_str(), Some("-11-2001:2"));
    assert!(!text.contains("--skip-existing"));
}

#[test]
fn a_job_beside_its_recipe_names_it_by_name() {
    let bench = Bench::new(LAMP);
    let (recipe, job) = (bench.path("it's a recipe.json"), bench.path("job.yaml"));
    let fixed = ["farm", "openjd", recipe.to_str().unwrap(), "-o", job.to_str().unwrap()];
    let output = bench.chiaro(&fixed);
    assert!(output.status.success() && output.stdout.is_empty());
    let text = std::fs::read_to_string(job).unwrap();
    let job = &YamlLoader::load_from_str(&text).unwrap()[0];
    assert_eq!(job["parameterDefinitions"][0]["default"].as_str(), Some("it's a recipe.json"));
}

/// The engine of the standard itself checks the template and runs both steps, two chunks of frames.
#[test]
fn openjd_runs_it_and_the_frames_are_those_of_a_plain_render() {
    let Some(openjd) = openjd("openjd_runs_it_and_the_frames_are_those_of_a_plain_render") else { return };
    let bench = Bench::new(LAMP);
    let (recipe, job) = (bench.path("it's a recipe.json"), bench.path("job.yaml"));
    let fixed =
        ["farm", "openjd", recipe.to_str().unwrap(), "--chunk-size", "2", "--shards", "2", "-o", job.to_str().unwrap()];
    assert!(bench.chiaro(&fixed).status.success());
    let checked = said(openjd(&["check", job.to_str().unwrap()]));
    assert!(checked.contains("passes validation"), "{checked}");
    let ran = bench.run_job(&openjd, &job);
    // Two shards, then two chunks.
    assert!(
        ran.contains("Shard(INT) = 2") && ran.contains("Frame(CHUNK[INT]) = 1,2") && ran.contains("= 3,4"),
        "{ran}"
    );
    let plain = bench.plain();
    assert!(plain.len() == 4 && files(&bench.path("out")) == plain, "other frames, {ran}");
}

/// Names and arguments that the engine would read as expressions, frames below zero, steps.
#[test]
fn openjd_takes_odd_names_arguments_and_frames() {
    let Some(openjd) = openjd("openjd_takes_odd_names_arguments_and_frames") else { return };
    let bench = Bench::new(LAMP);
    let recipe = std::fs::read_to_string(bench.path("it's a recipe.json")).unwrap();
    let odd = bench.path(&format!("{{{{odd}}}} {}.json", "long ".repeat(20)));
    std::fs::write(&odd, recipe.replace("lit.####.exr", "a{{b}}/lit.####.exr")).unwrap();
    let job = bench.path("job.yaml");
    let file = r#"out.file="c{{Param.Out}}/lit.####.exr""#;
    let fixed = ["farm", "openjd", odd.to_str().unwrap(), "--frames", "-3-5x4,7", "--chunk-size", "1", "--shards", "1"];
    let output = bench.chiaro(&[&fixed[..], &["--set", file, "-o", job.to_str().unwrap()]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    bench.run_job(&openjd, &job);
    let names: Vec<String> = files(&bench.path("out/c{{Param.Out}}")).into_keys().collect();
    assert_eq!(names, ["lit.-0003.exr", "lit.0001.exr", "lit.0005.exr", "lit.0007.exr"]);
}

/// Slurm's part is played by a stand-in that runs each task of an array, and refuses to run what depends on nothing it knows.
#[cfg(unix)]
#[test]
fn the_script_for_slurm_submits_both_arrays_and_gives_the_same_frames() {
    use std::os::unix::fs::PermissionsExt;
    let bench = Bench::new(LAMP);
    let recipe = bench.path("it's a recipe.json");
    let script = bench.path("job.sh");
    let fixed = [
        "farm",
        "slurm",
        recipe.to_str().unwrap(),
        "--chunk-size",
        "3",
        "--shards",
        "2",
        "-o",
        script.to_str().unwrap(),
    ];
    assert!(bench.chiaro(&fixed).status.success());
    let stand_in = r#"#!/bin/bash
set -eu
for option; do case "$option" in
    --array=1-*) last="${option#--array=1-}" ;;
    --dependency=afterany:*) grep -qx "${option#--dependency=afterany:}" "$LOG.done" ;;
esac; done
echo "$*" >>"$LOG"
cat >"$LOG.script"
for i in $(seq "$last"); do SLURM_ARRAY_TASK_ID=$i bash "$LOG.script" >&2; done
number=$(wc -l <"$LOG"); echo "$number" >>"$LOG.done"; echo "$number;night"
"#;
    std::fs::create_dir(bench.path("bin")).unwrap();
    let sbatch = bench.path("bin/sbatch");
    std::fs::write(&sbatch, stand_in).unwrap();
    std::fs::set_permissions(&sbatch, std::fs::Permissions::from_mode(0o755)).unwrap();
    // A program that is named from where the script is started.
    std::os::unix::fs::symlink(assert_cmd::cargo::cargo_bin("chiaro"), bench.path("bin/chiaro")).unwrap();
    let path = format!("{}:{}", bench.path("bin").display(), std::env::var("PATH").unwrap());
    let log = bench.path("log");
    let output = Command::new("bash")
        .arg(&script)
        .env("PATH", path)
        .env("LOG", &log)
        .env("CHIARO", "./chiaro")
        .current_dir(bench.path("bin"))
        .env("OUT", bench.path("out"))
        .env("SBATCH_ARGS", "--partition=night --mem=4G")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let submitted = std::fs::read_to_string(log).unwrap();
    let [first, second] = submitted.lines().collect::<Vec<_>>()[..] else { panic!("two arrays: {submitted}") };
    assert!(first.contains("--array=1-2") && second.ends_with("--array=1-2 --dependency=afterany:1"), "{submitted}");
    assert!(second.contains("--partition=night --mem=4G"), "{submitted}");
    assert!(files(&bench.path("out")) == bench.plain());
}

#[test]
fn what_makes_no_sense_is_refused() {
    let bench = Bench::new(LAMP);
    let recipe = bench.path("it's a recipe.json");
    let code = |more: &[&str]| {
        let output = bench.chiaro(&[&["farm", "openjd", recipe.to_str().unwrap()], more].concat());
        assert!(output.stdout.is_empty());
        output.status.code()
    };
    assert_eq!(code(&["--frames", "9-1"]), Some(2));
    assert_eq!(code(&["--chunk-size", "0"]), Some(2));
    assert_eq!(code(&["--set", "lit.lights=1"]), Some(2));
    assert_eq!(code(&["--node", "nobody"]), Some(2));
    let output = bench.chiaro(&["farm", "slurm", "no such.json"]);
    assert_eq!(output.status.code(), Some(3));
}
