//! Every recipe that is kept in `graphs/` is one that this program accepts, and has inputs that can be found.

use chiaro::device::Device;
use chiaro::eval::{Evaluator, Options};
use chiaro::graph::{self, Plan};
use chiaro::{Error, nodes};
use std::io::Write;
use std::path::{Path, PathBuf};

fn recipes(folder: &Path) -> Vec<PathBuf> {
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut found: Vec<PathBuf> = paths
        .flat_map(|path| if path.is_dir() { recipes(&path) } else { vec![path] })
        .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
        .collect();
    found.sort();
    found
}

fn all() -> Vec<PathBuf> {
    let found = recipes(&Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs"));
    assert!(found.len() > 20, "only {} recipes in graphs/", found.len());
    found
}

fn plan(path: &Path) -> Plan {
    let document = graph::load(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    Plan::new(&document, nodes::ALL).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn all_are_good_and_write_something() {
    for path in all() {
        let plan = plan(&path);
        assert!(plan.steps.iter().any(|step| step.is_sink()), "{} writes nothing", path.display());
    }
}

/// Node types without a recipe of their own in `graphs/edits`, and why.
const WITHOUT_RECIPE: &[(&str, &str)] =
    &[("read_edits", "reads a file of sampled edits; tests/edits_file.rs makes one and reads it")];

#[test]
fn every_node_type_has_a_small_recipe() {
    let edits = recipes(&Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/edits"));
    let used: Vec<String> = edits
        .iter()
        .flat_map(|path| plan(path).steps.iter().map(|step| step.node_type.info.name.to_owned()).collect::<Vec<_>>())
        .collect();
    for node in nodes::ALL {
        let name = node.info.name;
        match WITHOUT_RECIPE.iter().find(|(without, _)| *without == name) {
            None => assert!(used.iter().any(|used| used == name), "no recipe in graphs/edits has a {name} node"),
            Some((_, why)) => assert!(!used.iter().any(|used| used == name), "{name} has one now, no longer so: {why}"),
        }
    }
    for (name, _) in WITHOUT_RECIPE {
        assert!(nodes::find(name).is_some(), "there is no node type {name}");
    }
}

/// The file of the project's test data that an error says is not there, if that is what it says.
fn missing_data(error: &Error) -> Option<PathBuf> {
    match error {
        Error::AtNode { error, .. } => missing_data(error),
        Error::File { path, .. } => Some(path.clone()).filter(|path| path.to_string_lossy().contains("shared/data")),
        _ => None,
    }
}

/// Keys need the content of every input file, and nothing that takes long.
#[test]
fn all_with_their_inputs_can_be_started() {
    let (evaluator, mut missing) = (Evaluator::new(Options::new(Device::Cpu)), Vec::new());
    let shipped = all();
    for path in &shipped {
        let plan = plan(path);
        let targets = plan.targets(&[]).unwrap();
        for frame in plan.frames {
            match evaluator.tasks(&plan, &targets, frame) {
                Ok(tasks) => assert!(targets.iter().all(|target| tasks.at(*target, frame).is_some())),
                // Large scenes are not part of the repository; what ships with the recipes must be there.
                Err(error) if missing_data(&error).is_some() => missing.extend(missing_data(&error)),
                Err(error) => panic!("{}, frame {frame}: {error}", path.display()),
            }
        }
    }
    if !missing.is_empty() {
        missing.dedup();
        let mut stderr = std::io::stderr();
        let _ = writeln!(stderr, "\nSKIPPED: {} of {} recipes, not there: {missing:?}", missing.len(), shipped.len());
    }
}
