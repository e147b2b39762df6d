//! Nodes that go into wires that are there.

use crate::Result;
use crate::graph::Document;
use std::sync::Arc;

/// Near a place, where no node lies.
pub fn free(document: &Document, at: [f64; 2]) -> [f64; 2] {
    let is_taken = |at: [f64; 2]| {
        document.layout.values().any(|other| (other[0] - at[0]).abs() < 150.0 && (other[1] - at[1]).abs() < 110.0)
    };
    let mut below = (0..64).map(|row| [at[0], at[1] + 60.0 * f64::from(row)]);
    below.find(|at| !is_taken(*at)).unwrap_or(at)
}

/// Adds a node that takes from `from` (as recipes write it), and leads to it all that took from there. Returns its name.
///
/// # Errors
/// `Usage` when there is no node to take from.
pub fn insert_after(document: &mut Document, from: &str, kind: &str, port: &str) -> Result<String> {
    let (source, _) = crate::graph::split(from);
    let beside = document.layout.get(source).copied().unwrap_or_default();
    let place = free(document, [beside[0] + 40.0, beside[1] + 110.0]);
    let name = document.add_node(kind, place);
    for (other, entry) in &mut document.nodes {
        if *other != name && entry.inputs.values().any(|wire| *wire == from) {
            let entry = Arc::make_mut(entry);
            entry.inputs.values_mut().filter(|wire| *wire == from).for_each(|wire| wire.clone_from(&name));
        }
    }
    document.connect(from, &name, port)?;
    Ok(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn all_that_took_from_there_takes_from_the_new_node() {
        let text = r#"{ "chiaro": 1, "nodes": {
            "a": { "type": "scene" }, "b": { "type": "x", "inputs": { "i": "a", "j": "a.other" } },
            "c": { "type": "x", "inputs": { "i": "a" } }
        } }"#;
        let mut document = Document::parse(Path::new("x.json"), text).unwrap();
        let name = insert_after(&mut document, "a", "light", "scene").unwrap();
        assert_eq!(document.nodes[&name].inputs["scene"], "a");
        assert_eq!((&*document.nodes["b"].inputs["i"], &*document.nodes["c"].inputs["i"]), ("light", "light"));
        assert_eq!(document.nodes["b"].inputs["j"], "a.other", "another output is another wire");
        assert!(insert_after(&mut document, "gone", "light", "scene").is_err());
    }
}
