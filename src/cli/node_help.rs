//! `chiaro nodes`: what there is to build recipes from, out of each node type's own description.

use super::print;
use crate::fields::{Field, Shape, fields};
use crate::names::suggest;
use crate::node::Port;
use crate::params::NodeType;
use crate::{Error, Result};
use serde_json::{Value as Json, json};
use std::fmt::Write;

/// List node types, or explain one
#[derive(clap::Args)]
pub struct Args {
    /// A node type
    name: Option<String>,
    /// As JSON, with the schema of the parameters
    #[arg(long, conflicts_with = "markdown")]
    json: bool,
    /// As a table for a README
    #[arg(long)]
    markdown: bool,
}

impl Args {
    pub fn run(self, registry: &'static [NodeType]) -> Result<u8> {
        let shown: Vec<&NodeType> = match &self.name {
            None => registry.iter().collect(),
            Some(name) => vec![registry.iter().find(|node| node.info.name == name).ok_or_else(|| {
                let help = suggest(name, registry.iter().map(|node| node.info.name));
                Error::usage(format!("there is no node type \"{name}\""), help)
            })?],
        };
        let text = match (self.json, self.markdown, &self.name) {
            (true, ..) => {
                let all: Vec<Json> = shown.iter().map(|node| to_json(node)).collect();
                let json = if self.name.is_some() { all[0].clone() } else { all.into() };
                serde_json::to_string_pretty(&json).expect("plain data") + "\n"
            }
            (_, true, _) => table(&shown),
            (_, _, Some(_)) => explain(shown[0]),
            (_, _, None) => list(&shown),
        };
        print(&text);
        Ok(0)
    }
}

/// A parameter as people read it.
struct Described {
    field: Field,
    kind: String,
    range: String,
}

fn describe(node: &NodeType) -> Vec<Described> {
    let schema = (node.schema)().to_value();
    let describe = |field: Field| {
        let property = &schema["properties"][&field.name];
        Described { kind: kind(property, &schema, 8), range: range(&field.shape), field }
    };
    fields(node).into_iter().map(describe).collect()
}

/// `number`, `a|b|c`, `[number; 3]`, ...
fn kind(schema: &Json, root: &Json, depth: usize) -> String {
    if depth == 0 {
        return "...".to_owned();
    }
    let inner = |schema: &Json| kind(schema, root, depth - 1);
    let text = |value: &Json| value.as_str().unwrap_or_default().to_owned();
    if let Some(pointer) = schema["$ref"].as_str().and_then(|reference| reference.strip_prefix('#')) {
        return root.pointer(pointer).map_or_else(String::new, inner);
    }
    if let Some(options) = schema["enum"].as_array() {
        return options.iter().map(text).collect::<Vec<_>>().join("|");
    }
    if let Some(constant) = schema.get("const") {
        return text(constant);
    }
    if let Some(options) = schema["anyOf"].as_array().or(schema["oneOf"].as_array()) {
        return options.iter().map(inner).filter(|name| name != "null").collect::<Vec<_>>().join("|");
    }
    let one = |name: &str| match name {
        "string" => "text".to_owned(),
        "array" => {
            let item = match schema["prefixItems"].as_array() {
                Some(items) => return format!("[{}]", items.iter().map(inner).collect::<Vec<_>>().join(", ")),
                None => inner(&schema["items"]),
            };
            match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
                (Some(least), Some(most)) if least == most => format!("[{item}; {most}]"),
                _ => format!("[{item}]"),
            }
        }
        "object" => match schema["properties"].as_object() {
            Some(fields) => {
                let fields: Vec<String> =
                    fields.iter().map(|(name, field)| format!("{name}: {}", inner(field))).collect();
                format!("{{{}}}", fields.join(", "))
            }
            None => format!("{{name: {}}}", inner(&schema["additionalProperties"])),
        },
        other => other.to_owned(),
    };
    match &schema["type"] {
        Json::String(name) => one(name),
        Json::Array(names) => {
            let names = names.iter().filter_map(Json::as_str).filter(|name| *name != "null");
            names.map(one).collect::<Vec<_>>().join("|")
        }
        _ => "any".to_owned(),
    }
}

fn range(shape: &Shape) -> String {
    let Shape::Number(range) = shape else { return String::new() };
    let bound = |limit: Option<f64>, sign: &str, open: bool| {
        limit.map(|limit| format!("{sign}{} {limit}", if open { "" } else { "=" }))
    };
    let bounds = [bound(range.least, ">", range.open[0]), bound(range.most, "<", range.open[1])];
    bounds.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

fn to_json(node: &NodeType) -> Json {
    let info = node.info;
    let ports = |ports: &[Port]| -> Vec<Json> {
        ports
            .iter()
            .map(|port| json!({ "name": port.name, "type": port.kind, "optional": port.optional, "doc": port.doc }))
            .collect()
    };
    json!({
        "name": info.name,
        "category": info.category,
        "version": info.version,
        "summary": info.summary,
        "inputs": ports(info.inputs),
        "outputs": ports(info.outputs),
        "stored": info.stored,
        "params": (node.schema)().to_value(),
        "defaults": (node.defaults)(),
    })
}

/// In the order of the list, under the heading of each category.
fn by_category<'a>(shown: &[&'a NodeType]) -> Vec<(&'static str, Vec<&'a NodeType>)> {
    let mut categories: Vec<(&'static str, Vec<&NodeType>)> = Vec::new();
    for node in shown {
        match categories.iter_mut().find(|(category, _)| *category == node.info.category) {
            Some((_, members)) => members.push(node),
            None => categories.push((node.info.category, vec![node])),
        }
    }
    categories
}

fn list(shown: &[&NodeType]) -> String {
    let width = shown.iter().map(|node| node.info.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for (category, members) in by_category(shown) {
        text += &format!("{category}\n");
        for node in members {
            text += &format!("  {:width$}  {}\n", node.info.name, node.info.summary);
        }
    }
    text
}

fn explain(node: &NodeType) -> String {
    let info = node.info;
    let mut text = format!("{}: {}\n", info.name, info.summary);
    let mut ports = |heading: &str, ports: &[Port]| {
        if !ports.is_empty() {
            text += &format!("\n{heading}\n");
        }
        for port in ports {
            let optional = if port.optional { ", optional" } else { "" };
            text += &format!("  {} ({}{optional})\n      {}\n", port.name, port.kind.name(), port.doc);
        }
    };
    ports("Inputs", info.inputs);
    ports("Outputs", info.outputs);
    let params = describe(node);
    if !params.is_empty() {
        text += "\nParameters\n";
    }
    for Described { field, kind, range } in params {
        let about: Vec<&str> =
            [&kind, &range, &field.unit].into_iter().map(String::as_str).filter(|part| !part.is_empty()).collect();
        let about = about.join(", ");
        writeln!(text, "  {} ({about}) = {}\n      {}", field.name, field.default, field.doc).expect("to a string");
    }
    text
}

fn table(shown: &[&NodeType]) -> String {
    let mut text = "| node | inputs | outputs | parameters | what it does |\n|---|---|---|---|---|\n".to_owned();
    for (_, members) in by_category(shown) {
        for node in members {
            let ports = |ports: &[Port]| {
                let port = |port: &Port| {
                    let name = if port.optional { format!("*{}*", port.name) } else { port.name.to_owned() };
                    if port.name == port.kind.name() { name } else { format!("{name} ({})", port.kind.name()) }
                };
                ports.iter().map(port).collect::<Vec<_>>().join(", ")
            };
            let info = node.info;
            let params: Vec<String> =
                describe(node).into_iter().map(|param| format!("`{}`", param.field.name)).collect();
            let (inputs, outputs, params) = (ports(info.inputs), ports(info.outputs), params.join(", "));
            text += &format!("| `{}` | {inputs} | {outputs} | {params} | {} |\n", info.name, info.summary);
        }
    }
    text
}
