//! What the README says is so: its table of nodes, its recipe, its commands, its links.

use chiaro::graph::{Document, Plan};
use chiaro::nodes;
use std::path::{Path, PathBuf};

const BEGIN: &str = "<!-- nodes: written by `chiaro nodes --markdown` -->\n";
const END: &str = "<!-- end of nodes -->";

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn readme() -> String {
    std::fs::read_to_string(path("README.md")).unwrap()
}

/// What stands between two marks, each of which is there.
fn between<'a>(text: &'a str, begin: &str, end: &str) -> &'a str {
    let from = text.find(begin).unwrap_or_else(|| panic!("no {begin}")) + begin.len();
    let length = text[from..].find(end).unwrap_or_else(|| panic!("no {end}"));
    &text[from..from + length]
}

fn stdout(arguments: &[&str]) -> String {
    let output =
        assert_cmd::Command::cargo_bin("chiaro").unwrap().args(arguments).assert().success().get_output().clone();
    String::from_utf8(output.stdout).unwrap()
}

/// `CHIARO_BLESS=1` writes the table anew.
#[test]
fn the_table_of_nodes_is_what_the_program_prints() {
    let table = stdout(&["nodes", "--markdown"]);
    let text = readme();
    if std::env::var_os("CHIARO_BLESS").is_some() {
        let old = format!("{BEGIN}{}{END}", between(&text, BEGIN, END));
        std::fs::write(path("README.md"), text.replace(&old, &format!("{BEGIN}{table}{END}"))).unwrap();
    }
    assert_eq!(between(&readme(), BEGIN, END), table, "run CHIARO_BLESS=1 cargo test --release --test readme");
}

#[test]
fn the_recipe_is_good() {
    let text = readme();
    let document = Document::parse(Path::new("README.md"), between(&text, "```json\n", "```")).unwrap();
    let plan = Plan::new(&document, nodes::ALL).unwrap_or_else(|error| panic!("{error}"));
    assert!(plan.targets(&[]).is_ok());
}

#[test]
fn commands_and_exit_codes_are_those_of_the_program() {
    let (text, help) = (readme(), stdout(&["--help"]));
    let section = between(&help, "Commands:\n", "\n\n");
    for command in section.lines().filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help") {
        assert!(text.contains(&format!("| `chiaro {command}")), "{command} is not in the README");
    }
    let options = stdout(&["render", "--help"]);
    for option in between(&text, "Useful with `render`:", "`chiaro render --help`").split("--").skip(1) {
        let name = option.split(|c: char| !c.is_alphanumeric() && c != '-').next().unwrap();
        assert!(options.contains(&format!("--{name}")), "render has no --{name}");
    }
    for code in 0..=5 {
        assert!(text.contains(&format!("\n| {code} | ")) && help.contains(&format!("{code} ")), "exit code {code}");
    }
}

#[test]
fn what_it_points_to_is_there_and_ci_runs_its_test_command() {
    let text = readme();
    for link in text.split("](").skip(1).map(|rest| rest.split(')').next().unwrap()) {
        assert!(link.starts_with("http") || path(link).exists(), "{link} is not there");
    }
    for name in
        text.split('`').skip(1).step_by(2).filter(|name| name.starts_with("tests/") || name.starts_with("graphs/"))
    {
        let made = ["graphs/room_bleed.exr", "graphs/room_bleed.png", "graphs/edits/NAME.json"];
        assert!(path(name).exists() || made.contains(&name), "{name} is not there");
    }
    let tests = between(&text, "```\ncargo run --release -- render graphs/room_bleed.json\n", "\n```");
    let ci = std::fs::read_to_string(path(".ci/run")).unwrap();
    assert!(ci.lines().any(|line| line.trim_end().ends_with(&format!("run {tests}"))), "{tests} is not in .ci/run");
}
