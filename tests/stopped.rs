//! A final picture that is stopped by a signal: the best that there was is written, under a name that says so.
#![cfg(unix)]

#[path = "support/folder.rs"]
mod folder;

use chiaro::image::exr_read;
use folder::files;
use serde_json::{Value as Json, json};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

fn chiaro(folder: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("chiaro"));
    command.env("CHIARO_LOG", "warn").env("NO_COLOR", "1").arg("render").arg(folder.join("recipe.json"));
    command.args(["--device", "cpu", "--progress", "json", "--report"]).arg(folder.join("report.json"));
    command.arg("--out").arg(folder.join("out")).arg("--cache").arg(folder.join("cache")).args(more);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn report(folder: &Path) -> Json {
    serde_json::from_slice(&std::fs::read(folder.join("report.json")).unwrap()).unwrap()
}

/// What the renderer said of its picture, by the report.
fn notes(folder: &Path) -> Json {
    let report = report(folder);
    let nodes = report["nodes"].as_array().unwrap();
    nodes.iter().find(|node| node["node"] == "final").expect("it is in the report")["notes"].clone()
}

#[test]
fn a_final_picture_that_is_stopped_is_kept_and_called_unfinished() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let recipe = json!({ "chiaro": 1, "nodes": {
        "room": { "type": "scene", "params": { "file": "builtin:room" } },
        "final": { "type": "final_gather", "inputs": { "scene": "room" },
                   "params": { "width": 160, "height": 120, "samples_per_pixel": 2, "tolerance": 0.001, "rays": 1048576 } },
        "out": { "type": "write_image", "params": { "file": "out.exr" }, "inputs": { "image": "final" } },
    }});
    std::fs::write(folder.join("recipe.json"), recipe.to_string()).unwrap();

    let mut child = chiaro(folder, &[]).spawn().unwrap();
    let mut said = Vec::new();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    // The error is known when interpolation was made finer, and something else is done.
    for stage in ["finer interpolation", "more rays"] {
        while !said.last().is_some_and(|line: &String| line.contains(stage)) {
            said.push(lines.next().expect("it is not over before it can be stopped"));
        }
    }
    assert!(Command::new("kill").args(["-s", "INT", &child.id().to_string()]).status().unwrap().success());
    said.extend(lines);
    assert_eq!(child.wait().unwrap().code(), Some(1), "{said:?}");

    let has_time = |line: &String| {
        let line: Json = serde_json::from_str(line).unwrap_or_default();
        line["stage"] == "final gathering" && line["seconds_left"].as_f64().is_some_and(|seconds| seconds >= 0.0)
    };
    assert!(said.iter().any(has_time), "{said:?}");
    let end = said.iter().find(|line| line.contains("stopped at an error of")).expect("it says how good it is");
    assert!(end.contains("(0.1 % asked)") && end.contains("of 2 samples a pixel"), "{end}");

    let left = files(&folder.join("out"));
    assert_eq!(left.keys().collect::<Vec<_>>(), ["out.unfinished.exr"]);
    let error = notes(folder)["error"].as_f64().unwrap();
    assert!(error > 0.001, "{error}");
    assert_eq!(notes(folder)["unfinished"], json!(true));
    let image = exr_read::read_layers(&folder.join("out/out.unfinished.exr"), &["indirect"]).unwrap();
    let light = &image.find("indirect").unwrap().data;
    assert_eq!((image.width, image.height), (160, 120));
    assert!(light.iter().all(|x| x.is_finite()) && light.iter().any(|x| *x > 0.0));

    // Nothing of it is taken for what was asked: the same again begins again.
    let mut again = chiaro(folder, &["--skip-existing"]).spawn().unwrap();
    let begins =
        BufReader::new(again.stderr.take().unwrap()).lines().map(Result::unwrap).any(|l| l.contains("more rays"));
    again.kill().unwrap();
    again.wait().unwrap();
    assert!(begins, "what was unfinished came from the cache");
    let output = chiaro(folder, &["--skip-existing", "--set", "final.tolerance=0.2"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(files(&folder.join("out")).contains_key("out.exr"));
    assert!(notes(folder).get("unfinished").is_none());
}
