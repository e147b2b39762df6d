//! The command line: what goes to stdout, what to stderr, and the exit codes.

use assert_cmd::Command;
use predicates::prelude::*;
use predicates::str::{contains, is_empty};
use std::path::{Path, PathBuf};

fn chiaro() -> Command {
    let mut command = Command::cargo_bin("chiaro").unwrap();
    command.env_remove("CHIARO_LOG").env_remove("CHIARO_CACHE").env("NO_COLOR", "1");
    command
}

fn recipe(folder: &Path, text: &str) -> PathBuf {
    let path = folder.join("recipe.json");
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn help_and_version_go_to_stdout() {
    chiaro().arg("--help").assert().success().stdout(contains("Exit codes")).stderr(is_empty());
    chiaro().arg("--version").assert().success().stdout(contains(env!("CARGO_PKG_VERSION")));
    chiaro().args(["render", "--help"]).assert().success().stdout(contains("NODE.PARAM=JSON"));
}

#[test]
fn bad_usage_is_2() {
    for arguments in [
        &["rendr"][..],
        &["render"],
        &["render", "x.json", "--device", "tpu"],
        &["render", "x.json", "--threads", "0"],
        &["render", "x.json", "--cache-size", "many"],
        &["check"],
        &["nodes", "no_such_node"],
    ] {
        chiaro().args(arguments).assert().code(2).stdout(is_empty()).stderr(contains("error"));
    }
}

#[test]
fn a_missing_recipe_is_3_and_says_which() {
    for command in ["render", "check"] {
        let assert = chiaro().args([command, "no/such.json"]).assert().code(3).stdout(is_empty());
        assert.stderr(contains("no/such.json").and(contains("help:")));
    }
    chiaro().args(["check", "."]).assert().code(3);
}

#[test]
fn a_bad_graph_is_2_with_line_and_column_on_plain_lines() {
    let folder = tempfile::tempdir().unwrap();
    let path =
        recipe(folder.path(), "{ \"chiaro\": 1,\n  \"nodes\": { \"a\": { \"type\": \"no_such\" } },\n  \"fsp\": 1 }");
    for command in ["render", "check"] {
        let assert = chiaro().arg(command).arg(&path).assert().code(2).stdout(is_empty());
        let problems = contains("no node type \"no_such\"").and(contains("\"fsp\"")).and(contains("\"fps\""));
        let places = contains("recipe.json:2:29").and(contains("recipe.json:3:3")).and(contains("2 problems"));
        assert.stderr(problems.and(places).and(predicate::function(|text: &str| text.is_ascii())));
    }
}

#[test]
fn check_reports_every_recipe_and_the_worst_code() {
    let folder = tempfile::tempdir().unwrap();
    let good = recipe(folder.path(), "{ \"chiaro\": 1, \"nodes\": {} }");
    chiaro().arg("check").arg(&good).assert().success().stdout(contains("good, 0 nodes")).stderr(is_empty());
    let assert = chiaro().arg("check").arg("none.json").arg(&good).assert().code(3);
    assert.stdout(contains("good, 0 nodes")).stderr(contains("none.json"));
}

#[test]
fn nothing_to_render_is_bad_usage_and_leaves_no_report() {
    let folder = tempfile::tempdir().unwrap();
    let path = recipe(folder.path(), "{ \"chiaro\": 1, \"nodes\": {} }");
    let report = folder.path().join("report.json");
    let assert = chiaro().arg("render").arg(&path).arg("--report").arg(&report).assert().code(2);
    assert.stderr(contains("no node of this recipe writes a file"));
    assert!(!report.exists());
    chiaro().arg("render").arg(&path).args(["--node", "x"]).assert().code(2).stderr(contains("no node \"x\""));
    chiaro().arg("render").arg(&path).args(["--set", "x.y=1"]).assert().code(2).stderr(contains("--set x.y=1"));
}

#[test]
fn nodes_and_schema_are_json_when_asked() {
    let json = |arguments: &[&str]| -> serde_json::Value {
        let output = chiaro().args(arguments).assert().success().stderr(is_empty()).get_output().stdout.clone();
        serde_json::from_slice(&output).unwrap()
    };
    let all = json(&["nodes", "--json"]);
    assert_eq!(all.as_array().unwrap().len(), chiaro::nodes::ALL.len());
    for node in all.as_array().unwrap() {
        let name = node["name"].as_str().unwrap();
        assert_eq!(&json(&["nodes", name, "--json"]), node);
        chiaro().args(["nodes", name]).assert().success().stdout(contains(name));
    }
    let table = chiaro().args(["nodes", "--markdown"]).assert().success().get_output().stdout.clone();
    assert_eq!(String::from_utf8(table).unwrap().lines().count(), 2 + chiaro::nodes::ALL.len());
    let schema = json(&["schema"]);
    assert!(jsonschema::draft202012::meta::is_valid(&schema));
}

/// Recipes outlive versions: a change of their format shows in a file that is looked at. `CHIARO_BLESS=1` writes it anew.
#[test]
fn the_schema_is_the_one_that_is_kept() {
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/recipe.schema.json");
    let printed = chiaro().arg("schema").assert().success().get_output().stdout.clone();
    if std::env::var_os("CHIARO_BLESS").is_some() {
        std::fs::write(&kept, &printed).unwrap();
    }
    let kept = std::fs::read(&kept).unwrap();
    assert!(kept == printed, "the recipe schema has changed: CHIARO_BLESS=1 cargo test --release --test cli");
}

/// The Vulkan loader talks when it is asked to; on the CPU device nobody may wake it.
#[test]
fn the_cpu_device_never_asks_for_a_gpu() {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut render = chiaro();
    render.env("VK_LOADER_DEBUG", "all").arg("render").arg(root.join("graphs/edits/relight.json"));
    render.args([
        "--device",
        "cpu",
        "--no-cache",
        "--progress",
        "none",
        "--set",
        "view.width=8",
        "--set",
        "view.height=6",
    ]);
    render.arg("--out").arg(folder.path()).assert().success().stderr(is_empty());
    // Where there is a loader (and a build that uses it), listing devices does wake it: the test can fail.
    let listed = chiaro().env("VK_LOADER_DEBUG", "all").arg("devices").assert().success().get_output().clone();
    if String::from_utf8_lossy(&listed.stdout).contains("vulkan") {
        assert!(!listed.stderr.is_empty(), "the loader keeps quiet, so nothing was shown");
    }
}

#[test]
fn the_cpu_is_a_device() {
    // Vulkan's loader may have its own say on stderr.
    chiaro().arg("devices").assert().success().stdout(contains("cpu"));
}

#[test]
fn info_says_what_is_in_a_file() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let plate = root.join("graphs/edits/shadow_pass_plate.exr");
    let info = |arguments: &[&str]| chiaro().arg("info").arg(&plate).args(arguments).assert().success();
    let layers = contains("beauty").and(contains("ratio_shadow")).and(contains("64 x 48")).and(contains("half"));
    info(&[]).stdout(layers.and(contains("lin_rec709_scene")).and(contains("--recipe")));
    info(&["--values"]).stdout(contains("mean"));
    let json = info(&["--json", "--values"]).get_output().stdout.clone();
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!((&json["size"], &json["layers"][1]["name"]), (&serde_json::json!([64, 48]), &"ratio_shadow".into()));
    assert_eq!(json["layers"][1]["values"]["not_finite"], 0);
    // The recipe of a picture is a recipe.
    let folder = tempfile::tempdir().unwrap();
    let text = String::from_utf8(info(&["--recipe"]).get_output().stdout.clone()).unwrap();
    chiaro().arg("check").arg(recipe(folder.path(), &text)).assert().success();
    let picture = root.join("docs/room_plain.png");
    chiaro().arg("info").arg(&picture).assert().success().stdout(contains("PNG"));
    chiaro().arg("info").arg(&picture).arg("--recipe").assert().code(3).stderr(contains("no recipe"));
    chiaro().args(["info", "no/such.exr"]).assert().code(3).stdout(is_empty()).stderr(contains("no/such.exr"));
    chiaro().arg("info").arg(root.join("Cargo.toml")).assert().code(3);
    chiaro().arg("info").arg(root.join("Cargo.toml")).arg("--values").assert().code(2);
}
