//! JSON as people write it: keys in their own order, whatever fits on a line on one line.

use serde_json::Value as Json;

const WIDTH: usize = 120;

pub fn to_text(value: &Json) -> String {
    let mut text = String::new();
    write_json(value, 0, &mut text);
    text.push('\n');
    text
}

fn write_json(value: &Json, depth: usize, out: &mut String) {
    let compact = one_line(value);
    // The recipe itself and its list of nodes are broken in any case: one node a line is what diffs read best.
    let room = WIDTH.saturating_sub(2 * depth + 24);
    let open = match value {
        Json::Object(map) if compact.len() > room || depth < 2 && map.values().any(Json::is_object) => ('{', '}'),
        Json::Array(list) if !list.is_empty() && compact.len() > room => ('[', ']'),
        _ => return out.push_str(&compact),
    };
    let indent = "  ".repeat(depth + 1);
    out.push(open.0);
    let mut first = true;
    let mut item = |key: Option<&String>, value: &Json, out: &mut String| {
        out.push_str(if first { "\n" } else { ",\n" });
        first = false;
        out.push_str(&indent);
        if let Some(key) = key {
            out.push_str(&format!("{}: ", Json::from(key.as_str())));
        }
        write_json(value, depth + 1, out);
    };
    match value {
        Json::Object(map) => map.iter().for_each(|(key, value)| item(Some(key), value, out)),
        Json::Array(list) => list.iter().for_each(|value| item(None, value, out)),
        _ => {}
    }
    out.push('\n');
    out.push_str(&indent[2..]);
    out.push(open.1);
}

fn one_line(value: &Json) -> String {
    match value {
        Json::Object(map) if !map.is_empty() => {
            let items: Vec<String> =
                map.iter().map(|(key, value)| format!("{}: {}", Json::from(key.as_str()), one_line(value))).collect();
            format!("{{ {} }}", items.join(", "))
        }
        Json::Array(list) => format!("[{}]", list.iter().map(one_line).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}
