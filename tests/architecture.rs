//! Which folder may name which: the direction of dependency of `lib.rs`, by the paths that the sources use.

use std::path::{Path, PathBuf};

/// What each part may use of the crate, besides itself, `Error`, `Result` and what everyone may (`EVERYONE`).
const MAY_USE: &[(&str, &[&str])] = &[
    ("cli", &["eval", "graph", "node", "nodes", "params", "value", "image", "scene", "transport", "kernels", "device"]),
    ("eval", &["graph", "node", "params", "value", "device"]),
    ("graph", &["node", "params", "value"]),
    ("nodes", &["node", "params", "value", "transport", "scene", "image", "kernels", "device"]),
    ("params", &["node", "value"]),
    ("node", &["value", "device", "transport", "scene", "image"]),
    ("value", &["transport", "scene", "image"]),
    ("transport", &["scene", "image", "kernels", "device"]),
    ("scene", &["image", "kernels", "device"]),
    ("image", &["kernels", "device"]),
    ("kernels", &["device", "scene", "transport"]),
    ("device", &[]),
    ("stored", &[]),
    ("progress", &[]),
    ("atomic", &[]),
    ("names", &[]),
    // An error carries the problems of a graph.
    ("error", &["graph"]),
];

const EVERYONE: &[&str] = &["Error", "Result", "error", "progress", "stored", "atomic", "names"];

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            files.extend(rust_files(&entry));
        } else if entry.extension().is_some_and(|suffix| suffix == "rs") {
            files.push(entry);
        }
    }
    files
}

/// All files with the part of the crate that they belong to.
fn sources() -> Vec<(String, PathBuf)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut sources: Vec<(String, PathBuf)> =
        rust_files(&root.join("nodes")).into_iter().map(|path| ("nodes".to_owned(), path)).collect();
    for path in rust_files(&root.join("src")) {
        let first = path.strip_prefix(root.join("src")).unwrap().components().next().unwrap();
        let part = first.as_os_str().to_str().unwrap().trim_end_matches(".rs").to_owned();
        if !["lib", "main"].contains(&part.as_str()) {
            sources.push((part, path));
        }
    }
    sources
}

/// The parts of the crate that a text names: `crate::a::...`, `crate::{a::..., b}`.
fn names(text: &str) -> Vec<String> {
    let word = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut found = Vec::new();
    for (at, path) in text.match_indices("crate::") {
        let rest = &text[at + path.len()..];
        let Some(list) = rest.strip_prefix('{') else {
            found.push(word(rest));
            continue;
        };
        let mut depth = 1;
        let mut item = String::new();
        for c in list.chars() {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ => {}
            }
            if depth == 0 || depth == 1 && c == ',' {
                found.push(word(item.trim()));
                item.clear();
            } else {
                item.push(c);
            }
            if depth == 0 {
                break;
            }
        }
    }
    found.retain(|name| !name.is_empty());
    found
}

/// Without comments, and without the tests at the end of a file.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n")
}

fn offences(part: &str, text: &str) -> Vec<String> {
    let (_, allowed) =
        MAY_USE.iter().find(|(name, _)| *name == part).unwrap_or_else(|| panic!("a new part: {part}; give it a place"));
    names(&code(text))
        .into_iter()
        .filter(|name| name != part && !allowed.contains(&name.as_str()) && !EVERYONE.contains(&name.as_str()))
        .collect()
}

#[test]
fn dependencies_point_one_way() {
    let mut wrong = Vec::new();
    for (part, path) in sources() {
        let offences = offences(&part, &std::fs::read_to_string(&path).unwrap());
        if !offences.is_empty() {
            wrong.push(format!("{} uses {}", path.display(), offences.join(", ")));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_guard_sees_offences() {
    assert_eq!(offences("graph", "use crate::eval::Evaluator;"), ["eval"]);
    assert_eq!(offences("image", "use crate::{Error, eval::{a, b}, cli};"), ["eval", "cli"]);
    assert_eq!(offences("graph", "fn f() -> crate::cli::Cli;"), ["cli"]);
    assert!(
        offences("graph", "// crate::eval\nuse crate::node::Key;\n#[cfg(test)]\nmod tests { use crate::eval; }")
            .is_empty()
    );
}

#[test]
fn only_the_device_folder_names_wgpu() {
    for (part, path) in sources() {
        let text = code(&std::fs::read_to_string(&path).unwrap());
        assert!(part == "device" || !text.contains("wgpu::"), "{} names wgpu", path.display());
    }
}

#[test]
fn no_file_is_too_long() {
    for (_, path) in sources() {
        let lines = std::fs::read_to_string(&path).unwrap().lines().count();
        assert!(lines <= 600, "{} has {lines} lines", path.display());
    }
}

#[test]
fn what_is_stored_is_storable_and_descriptions_fit_the_ports() {
    let mut undescribed = Vec::new();
    for node in chiaro::nodes::ALL {
        let info = node.info;
        assert!(!info.stored || info.outputs.iter().all(|port| port.kind.is_storable()), "{}", info.name);
        for rule in info.facets {
            let ports: Vec<&str> = match rule {
                chiaro::node::FacetRule::Keeps(_, port) => vec![port],
                chiaro::node::FacetRule::From(_, ports) => ports.iter().map(|(port, _)| *port).collect(),
            };
            for port in ports {
                assert!(info.inputs.iter().any(|known| known.name == port), "{} has no input {port}", info.name);
            }
        }
        let schema = (node.schema)().to_value();
        for (name, property) in schema["properties"].as_object().into_iter().flatten() {
            if !property["description"].is_string() {
                undescribed.push(format!("{}.{name}", info.name));
            }
        }
    }
    assert!(undescribed.is_empty(), "parameters without a doc comment: {}", undescribed.join(", "));
}
