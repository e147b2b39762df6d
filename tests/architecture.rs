//! Which folder may name which: the direction of dependency of `lib.rs`, by the paths that the sources use.

use std::path::{Path, PathBuf};

/// What each part may use of the crate, besides itself, `Error`, `Result` and what everyone may (`EVERYONE`). A row names
/// only rows below it.
const MAY_USE: &[(&str, &[&str])] = &[
    (
        "cli",
        &[
            "editor",
            "eval",
            "fields",
            "graph",
            "node",
            "nodes",
            "params",
            "value",
            "image",
            "scene",
            "transport",
            MATRIX,
            "kernels",
            "device",
        ],
    ),
    (
        "editor",
        &[
            "eval",
            "fields",
            "graph",
            "node",
            "nodes",
            "params",
            "value",
            "image",
            "scene",
            "transport",
            MATRIX,
            "kernels",
            "device",
        ],
    ),
    ("eval", &["graph", "node", "params", "value", "device"]),
    ("nodes", &["node", "params", "value", "transport", "scene", "image", "kernels", "device"]),
    // An error carries the problems of a graph; the one knot, because everyone may name errors.
    ("error", &["graph"]),
    ("graph", &["node", "params", "value"]),
    ("fields", &["params"]),
    ("params", &["node", "value"]),
    ("node", &["value", "device", "transport", "scene", "image"]),
    ("value", &["transport", "scene", "image"]),
    ("transport", &["kernels", MATRIX, "scene", "image", "device"]),
    ("kernels", &[MATRIX, "scene", "device"]),
    (MATRIX, &["scene", "device"]),
    ("scene", &["device"]),
    ("image", &["device"]),
    ("device", &[]),
    ("memo", &["stored"]),
    ("stored", &[]),
    ("progress", &[]),
    ("atomic", &[]),
    ("memory", &[]),
    ("names", &[]),
];

/// The files of `transport/` that only say what a transfer is made of: gather samples, rows, low-discrepancy points; and
/// records of a light cache. Kernels read them; all other files of that folder call kernels.
const MATRIX: &str = "transport matrix";
const MATRIX_FILES: &[&str] =
    &["cluster", "feature", "gather", "light_cache", "runs", "sample_cells", "sampling", "sparse", "ways"];

const EVERYONE: &[&str] = &["Error", "Result", "error", "progress", "stored", "atomic", "memo", "memory", "names"];

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
        let inside = path.strip_prefix(root.join("src")).unwrap().with_extension("");
        let names: Vec<&str> = inside.iter().map(|name| name.to_str().unwrap()).collect();
        if !["lib", "main"].contains(&names[0]) {
            sources.push((part(&names), path));
        }
    }
    sources
}

/// The part that the module of that path belongs to.
fn part(path: &[&str]) -> String {
    match path {
        ["transport", file, ..] if MATRIX_FILES.contains(file) => MATRIX.to_owned(),
        _ => path[0].to_owned(),
    }
}

/// The parts of the crate that a text names: `crate::a::...`, `crate::{a::..., b}`, `crate::a::{b, c::...}`.
fn names(text: &str) -> Vec<String> {
    text.match_indices("crate::").flat_map(|(at, path)| expand(&text[at + path.len()..], &[])).collect()
}

/// The parts that the path or the list of paths at the beginning of a text names.
fn expand(text: &str, before: &[&str]) -> Vec<String> {
    if let Some(list) = text.strip_prefix('{') {
        return items(list).iter().flat_map(|item| expand(item, before)).collect();
    }
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    let path: Vec<&str> = before.iter().copied().chain([&text[..end]]).filter(|name| !name.is_empty()).collect();
    match text[end..].strip_prefix("::") {
        Some(rest) if path.len() < 2 => expand(rest, &path),
        _ if path.is_empty() => Vec::new(),
        _ => vec![part(&path)],
    }
}

/// The items of a list that ends with the brace that closes it.
fn items(list: &str) -> Vec<String> {
    let mut items = vec![String::new()];
    let mut depth = 0;
    for c in list.chars() {
        match c {
            '}' if depth == 0 => break,
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                items.push(String::new());
                continue;
            }
            _ => {}
        }
        items.last_mut().unwrap().push(c);
    }
    items.iter().map(|item| item.trim().to_owned()).filter(|item| !item.is_empty()).collect()
}

/// Without comments, and without the tests at the end of a file.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n")
}

fn offences(part: &str, text: &str) -> Vec<String> {
    let (_, allowed) =
        MAY_USE.iter().find(|(name, _)| *name == part).unwrap_or_else(|| panic!("a new part: {part}; give it a place"));
    let mut found = names(&code(text));
    found.sort();
    found.dedup();
    found.retain(|name| name != part && !allowed.contains(&name.as_str()) && !EVERYONE.contains(&name.as_str()));
    found
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
fn the_order_has_no_loop() {
    for (row, (part, uses)) in MAY_USE.iter().enumerate() {
        for used in *uses {
            let below = MAY_USE[row + 1..].iter().any(|(name, _)| name == used);
            assert!(below, "{part} may use {used}, which does not stand below it");
        }
    }
}

#[test]
fn the_guard_sees_offences() {
    assert_eq!(offences("graph", "use crate::eval::Evaluator;"), ["eval"]);
    assert_eq!(offences("image", "use crate::{Error, eval::{a, b}, cli};"), ["cli", "eval"]);
    assert_eq!(offences("graph", "fn f() -> crate::cli::Cli;"), ["cli"]);
    assert_eq!(offences("kernels", "use crate::transport::{gather::Gather, precompute};"), ["transport"]);
    assert_eq!(offences("kernels", "use crate::transport::Samples;"), ["transport"]);
    assert_eq!(offences(MATRIX, "use crate::transport::sides::Live; use crate::kernels;"), ["kernels", "transport"]);
    assert!(offences("kernels", "use crate::{transport::gather::{DEAD, Gather}, scene::bvh::Ray};").is_empty());
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
