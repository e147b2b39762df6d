//! Where nodes lie: as the recipe says, or in columns by how far they are from the sources.

use crate::editor::window::state::State;
use crate::graph::{Document, split};
use std::collections::HashMap;

pub type Places = HashMap<String, [f64; 2]>;

/// Between columns and rows.
const STEP: [f64; 2] = [230.0, 170.0];

/// Of every node: its own, or one where nodes without a place are put.
pub fn places(document: &Document) -> Places {
    let mut places: Places = document.layout.iter().map(|(name, at)| (name.clone(), *at)).collect();
    let without: Vec<&String> = document.nodes.keys().filter(|name| !places.contains_key(*name)).collect();
    if without.is_empty() {
        return places;
    }
    let below = document.layout.values().map(|at| at[1] + STEP[1]).fold(0.0, f64::max);
    for (name, at) in arrange(document) {
        if !document.layout.contains_key(&name) {
            places.insert(name, [at[0], at[1] + below]);
        }
    }
    places
}

/// Columns by the longest way from a source; within a column, near what is taken from.
pub fn arrange(document: &Document) -> Places {
    let mut depth: HashMap<&str, usize> = HashMap::new();
    // Each round settles at least one more; a loop, which a recipe can have by hand, ends with the count.
    for _ in 0..document.nodes.len() {
        let mut changed = false;
        for (name, entry) in &document.nodes {
            let before = entry.inputs.values().filter_map(|from| document.nodes.get_key_value(split(from).0));
            let wanted =
                before.map(|(from, _)| depth.get(from.as_str()).map_or(1, |depth| depth + 1)).max().unwrap_or(0);
            changed |= depth.insert(name, wanted) != Some(wanted);
        }
        if !changed {
            break;
        }
    }
    let mut rows: HashMap<usize, Vec<(f64, &str)>> = HashMap::new();
    let mut places = Places::new();
    let columns = depth.values().max().copied().unwrap_or(0);
    for column in 0..=columns {
        let mut names: Vec<(f64, &str)> = document
            .nodes
            .iter()
            .filter(|(name, _)| depth.get(name.as_str()) == Some(&column))
            .map(|(name, entry)| {
                let before: Vec<f64> =
                    entry.inputs.values().filter_map(|from| places.get(split(from).0)).map(|at| at[1]).collect();
                (before.iter().sum::<f64>() / before.len().max(1) as f64, name.as_str())
            })
            .collect();
        names.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut next = f64::NEG_INFINITY;
        for (wanted, name) in &names {
            let y = wanted.max(next);
            places.insert((*name).to_owned(), [column as f64 * STEP[0], y]);
            next = y + STEP[1];
        }
        rows.insert(column, names);
    }
    places
}

/// Where a new node lies in nobody's way: right of what is chosen, or of all.
pub fn free_place(state: &State) -> [f64; 2] {
    let places = places(state.document());
    let mut at = match state.chosen().and_then(|name| places.get(name)) {
        Some(at) => [at[0] + STEP[0], at[1]],
        None => [places.values().map(|at| at[0] + STEP[0]).fold(0.0, f64::max), 0.0],
    };
    let is_taken = |at: [f64; 2]| places.values().any(|other| (0..2).all(|i| (other[i] - at[i]).abs() < 0.6 * STEP[i]));
    while is_taken(at) {
        at[1] += STEP[1];
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn nodes_stand_right_of_what_they_take_from_and_apart() {
        let text = r#"{ "chiaro": 1, "nodes": {
            "a": { "type": "x" }, "b": { "type": "x", "inputs": { "i": "a" } }, "c": { "type": "x", "inputs": { "i": "a" } },
            "d": { "type": "x", "inputs": { "i": "b.o", "j": "c", "k": "gone" } },
            "l": { "type": "x", "inputs": { "i": "m" } }, "m": { "type": "x", "inputs": { "i": "l" } }
        }, "layout": { "a": [5, 7] } }"#;
        let document = Document::parse(Path::new("x.json"), text).unwrap();
        let at = arrange(&document);
        assert_eq!((at["a"][0], at["b"][0], at["c"][0], at["d"][0]), (0.0, STEP[0], STEP[0], 2.0 * STEP[0]));
        assert!((at["b"][1] - at["c"][1]).abs() >= STEP[1]);
        let places = places(&document);
        assert_eq!(places["a"], [5.0, 7.0]);
        assert_eq!(places.len(), 6);
    }
}
