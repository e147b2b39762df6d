//! Hashes all sources that results depend on, so that values cached by another version of the code are not used.

use std::hash::{DefaultHasher, Hasher};
use std::path::{Path, PathBuf};

const SOURCES: [&str; 8] = [
    "nodes",
    "shaders",
    "src/kernels",
    "src/transport",
    "src/scene",
    "src/image",
    "src/graph/curve.rs",
    // Libraries compute, too.
    "Cargo.lock",
];

fn main() {
    let mut hasher = DefaultHasher::new();
    for source in SOURCES {
        println!("cargo:rerun-if-changed={source}");
        for file in files(Path::new(source)) {
            let name = file.to_string_lossy().replace('\\', "/");
            let content = std::fs::read(&file).unwrap_or_else(|error| panic!("cannot read {name}: {error}"));
            for part in [name.as_bytes(), &content] {
                hasher.write_usize(part.len());
                hasher.write(part);
            }
        }
    }
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-env=CHIARO_SOURCES={:016x}", hasher.finish());
}

/// The files in a folder and below, sorted; none when there is nothing of that name.
fn files(path: &Path) -> Vec<PathBuf> {
    if path.is_file() {
        return vec![path.to_owned()];
    }
    let Ok(entries) = std::fs::read_dir(path) else { return Vec::new() };
    let mut inside: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    inside.sort();
    inside.iter().flat_map(|path| files(path)).collect()
}
