//! The JSON schema of recipes, put together from the parameter structs of all node types.

use super::migrate::VERSION;
use crate::params::NodeType;
use serde_json::{Map, Value as Json, json};

/// The schema of a whole recipe (JSON Schema 2020-12). A parameter is a value or a curve of values.
pub fn recipe_schema(registry: &[NodeType]) -> Json {
    let mut defs = Map::new();
    let mut cases = Vec::new();
    for node_type in registry {
        let info = node_type.info;
        let params = params_schema(node_type, &mut defs);
        let input = |port: &crate::node::Port| {
            let schema =
                json!({ "$ref": "#/$defs/wire", "description": format!("{}: {}", port.kind.name(), port.doc) });
            (port.name.to_owned(), schema)
        };
        let inputs: Map<String, Json> = info.inputs.iter().map(input).collect();
        let required: Vec<&str> = info.inputs.iter().filter(|port| !port.optional).map(|port| port.name).collect();
        let mut then = json!({ "properties": {
            "params": params,
            "inputs": { "properties": inputs, "required": required, "additionalProperties": false },
        }});
        if !required.is_empty() {
            then["required"] = json!(["inputs"]);
        }
        let case = json!({ "properties": { "type": { "const": info.name } }, "required": ["type"] });
        cases.push(json!({ "if": case, "then": then }));
    }
    let types: Vec<Json> = registry
        .iter()
        .map(|node_type| json!({ "const": node_type.info.name, "description": node_type.info.summary }))
        .collect();
    defs.insert("curve".into(), curve_schema());
    defs.insert("wire".into(), json!({ "type": "string", "pattern": "^[A-Za-z0-9_]+(\\.[A-Za-z0-9_]+)?$" }));
    // A choice of nothing is no schema.
    let kind = if types.is_empty() { json!(false) } else { json!({ "oneOf": types }) };
    let mut node = json!({
        "type": "object",
        "properties": { "type": kind, "params": { "type": "object" }, "inputs": { "type": "object" },
            "muted": { "type": "boolean", "description": "Left out: its input is passed on instead." } },
        "required": ["type"],
        "additionalProperties": false,
    });
    if !cases.is_empty() {
        node["allOf"] = cases.into();
    }
    let pair = |kind: &str| json!({ "type": "array", "items": { "type": kind }, "minItems": 2, "maxItems": 2 });
    let comment = json!({
        "type": "object",
        "properties": { "text": { "type": "string" }, "at": pair("number"), "size": pair("number") },
        "required": ["text", "at", "size"],
        "additionalProperties": false,
    });
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "chiaro recipe",
        "type": "object",
        "properties": {
            "chiaro": { "const": VERSION, "description": "Version of the format." },
            "frames": pair("integer"),
            "fps": { "type": "number", "exclusiveMinimum": 0 },
            "nodes": {
                "type": "object",
                "propertyNames": { "pattern": "^[A-Za-z0-9_]+$" },
                "additionalProperties": node,
            },
            "layout": { "type": "object", "additionalProperties": pair("number") },
            "comments": { "type": "array", "items": comment },
        },
        "required": ["chiaro", "nodes"],
        "additionalProperties": false,
        "$defs": defs,
    })
}

/// The schema of one node's `params`; what it shares goes to `defs` under names of its own.
fn params_schema(node_type: &NodeType, defs: &mut Map<String, Json>) -> Json {
    let mut schema = (node_type.schema)().to_value();
    let prefix = format!("{}.", node_type.info.name);
    rename_refs(&mut schema, &prefix);
    let object = schema.as_object_mut().expect("parameters are an object");
    object.remove("$schema");
    object.remove("title");
    if let Some(Json::Object(shared)) = object.remove("$defs") {
        defs.extend(shared.into_iter().map(|(name, schema)| (format!("{prefix}{name}"), schema)));
    }
    for property in object.get_mut("properties").and_then(Json::as_object_mut).into_iter().flat_map(Map::values_mut) {
        let plain = property.take();
        let mut either = Map::new();
        for about in ["description", "default"] {
            if let Some(text) = plain.get(about) {
                either.insert(about.into(), text.clone());
            }
        }
        either.insert("anyOf".into(), json!([plain, { "$ref": "#/$defs/curve" }]));
        *property = either.into();
    }
    schema
}

fn rename_refs(schema: &mut Json, prefix: &str) {
    match schema {
        Json::Object(object) => {
            if let Some(Json::String(reference)) = object.get_mut("$ref")
                && let Some(name) = reference.strip_prefix("#/$defs/")
            {
                *reference = format!("#/$defs/{prefix}{name}");
            }
            object.values_mut().for_each(|inner| rename_refs(inner, prefix));
        }
        Json::Array(list) => list.iter_mut().for_each(|inner| rename_refs(inner, prefix)),
        _ => {}
    }
}

fn curve_schema() -> Json {
    json!({
        "type": "object",
        "description": "A value that changes over frames.",
        "properties": {
            "keys": {
                "type": "array",
                "minItems": 1,
                "items": { "type": "array", "prefixItems": [{ "type": "number" }, true], "minItems": 2, "maxItems": 2 },
            },
            "interpolation": { "enum": ["linear", "smooth", "hold"], "default": "linear" },
        },
        "required": ["keys"],
        "additionalProperties": false,
    })
}
