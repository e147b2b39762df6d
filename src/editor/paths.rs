//! Paths in recipes.

use crate::graph::Document;
use crate::params::NodeType;
use serde_json::Value as Json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A path as a recipe has it: from its own folder, where the file lies in it or beside it.
pub fn written(base: &Path, file: &Path) -> String {
    let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let (base, file) = (absolute(base), absolute(file));
    let shared = base.iter().zip(file.iter()).take_while(|(a, b)| a == b).count();
    let up = base.iter().count() - shared;
    if shared <= 1 || up > 3 {
        return file.display().to_string();
    }
    let rest: PathBuf = std::iter::repeat_n("..".as_ref(), up).chain(file.iter().skip(shared)).collect();
    rest.display().to_string().replace('\\', "/")
}

/// Lets the files that nodes read be found from another folder, to which the recipe goes. What nodes write goes with it.
pub fn rebase(document: &mut Document, to: &Path, registry: &[NodeType]) {
    let from = document.base.clone();
    let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    if absolute(&from) == absolute(to) {
        return;
    }
    for entry in document.nodes.values_mut().map(Arc::make_mut) {
        let Some(node_type) = registry.iter().find(|node_type| node_type.info.name == entry.kind) else { continue };
        let Ok(node) = (node_type.parse)(entry.params.clone()) else { continue };
        let files = node.files();
        for value in entry.params.values_mut() {
            let Some(file) = value.as_str().filter(|file| files.iter().any(|other| other == file)) else { continue };
            if Path::new(file).is_relative() && !file.starts_with("builtin:") {
                *value = Json::from(written(to, &from.join(file)));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_written_from_the_recipe_s_folder() {
        for (base, file, path) in [
            ("/a/b", "/a/b/c.glb", "c.glb"),
            ("/a/b", "/a/b/d/c.glb", "d/c.glb"),
            ("/a/b", "/a/e/c.glb", "../e/c.glb"),
            ("/a/b", "/x/c.glb", "/x/c.glb"),
            ("/a/b/c/d/e", "/a/x.glb", "/a/x.glb"),
        ] {
            assert_eq!(written(Path::new(base), Path::new(file)), path);
        }
    }

    #[test]
    fn what_is_read_is_found_from_the_new_folder_and_what_is_written_goes_with_the_recipe() {
        let text = r#"{ "chiaro": 1, "nodes": {
            "a": { "type": "scene", "params": { "file": "scenes/a.glb" } },
            "b": { "type": "scene", "params": { "file": "builtin:room" } },
            "c": { "type": "write_image", "params": { "file": "out.exr" } }
        } }"#;
        let mut document = Document::parse(Path::new("/x/y/recipe.json"), text).unwrap();
        rebase(&mut document, Path::new("/x/z"), crate::nodes::ALL);
        let file = |node: &str| document.nodes[node].params["file"].as_str().unwrap().to_owned();
        assert_eq!([file("a"), file("b"), file("c")], ["../y/scenes/a.glb", "builtin:room", "out.exr"]);
    }
}
