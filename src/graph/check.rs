//! Whether a parameter's value is what its node type takes: type, range, choice. The schema of the parameter struct is
//! the one source for all of it.

use super::curve::Complaint;
use crate::names::suggest;
use crate::params::NodeType;
use jsonschema::error::{TypeKind, ValidationError, ValidationErrorKind};
use serde_json::{Map, Value as Json};
use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

/// The parameters of one node type, ready to check values.
pub struct Checker {
    params: Vec<ParamChecker>,
}

/// One parameter of a node type.
pub struct ParamChecker {
    node_type: &'static NodeType,
    name: String,
    validator: jsonschema::Validator,
    /// Its numbers are integers: a curve's values are rounded.
    pub integer: bool,
}

/// Schemas take milliseconds to be made ready, and the editor checks a recipe with every movement of a hand.
static KNOWN: LazyLock<Mutex<Known>> = LazyLock::new(Mutex::default);

/// By name and schema: types of one name in two registries have two schemas.
type Known = HashMap<(&'static str, usize), Arc<Checker>>;

impl Checker {
    /// Made once for each type.
    pub fn of(node_type: &'static NodeType) -> Arc<Self> {
        let key = (node_type.info.name, node_type.schema as *const () as usize);
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        known.entry(key).or_insert_with(|| Arc::new(Self::new(node_type))).clone()
    }

    fn new(node_type: &'static NodeType) -> Self {
        let schema = (node_type.schema)().to_value();
        let properties = schema["properties"].as_object().cloned().unwrap_or_default();
        let param = |(name, mut own): (String, Json)| {
            let integer = is_integer(&own, &schema, 8);
            if let (Json::Object(own), Some(shared)) = (&mut own, schema.get("$defs")) {
                own.insert("$defs".into(), shared.clone());
            }
            let validator = jsonschema::draft202012::new(&own).expect("schemars writes valid schemas");
            ParamChecker { node_type, name, validator, integer }
        };
        Self { params: properties.into_iter().map(param).collect() }
    }

    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.params.iter().map(|param| param.name.as_str())
    }

    /// `None` when the node type has no such parameter.
    pub fn param(&self, name: &str) -> Option<&ParamChecker> {
        self.params.iter().find(|param| param.name == name)
    }
}

impl ParamChecker {
    /// As it stands, without asking why not.
    pub fn accepts(&self, value: &Json) -> bool {
        self.validator.is_valid(value)
    }

    /// All that is wrong with a plain value.
    pub fn complaints(&self, value: &Json) -> Vec<Complaint> {
        let found: Vec<Complaint> = self.validator.iter_errors(value).map(|error| explain(&error)).collect();
        if !found.is_empty() {
            return found;
        }
        // What the schema cannot say, serde does.
        let alone = Map::from_iter([(self.name.clone(), value.clone())]);
        match (self.node_type.parse)(alone) {
            Err(message) => {
                let message = message.strip_prefix(&format!("{}: ", self.name)).unwrap_or(&message).to_owned();
                vec![(String::new(), message, String::new())]
            }
            Ok(node) => match lost_number(value, &node.params()[&self.name], String::new()) {
                Some((pointer, number)) => {
                    let message = format!("{number} is too large for a 32-bit number");
                    vec![(pointer, message, "numbers go up to 3.4e38".into())]
                }
                None => Vec::new(),
            },
        }
    }
}

/// A number that became infinite when it was read: infinity is written back as null.
fn lost_number(given: &Json, kept: &Json, pointer: String) -> Option<(String, Json)> {
    match (given, kept) {
        (Json::Number(_), Json::Null) => Some((pointer, given.clone())),
        (Json::Array(given), Json::Array(kept)) => given
            .iter()
            .zip(kept)
            .enumerate()
            .find_map(|(index, (given, kept))| lost_number(given, kept, format!("{pointer}/{index}"))),
        (Json::Object(given), Json::Object(kept)) => given
            .iter()
            .find_map(|(name, given)| lost_number(given, kept.get(name)?, super::source::child(&pointer, name))),
        _ => None,
    }
}

fn is_integer(schema: &Json, root: &Json, depth: usize) -> bool {
    if depth == 0 {
        return false;
    }
    if let Some(pointer) = schema["$ref"].as_str().and_then(|reference| reference.strip_prefix('#')) {
        return root.pointer(pointer).is_some_and(|schema| is_integer(schema, root, depth - 1));
    }
    let inner =
        |list: &Json| list.as_array().is_some_and(|list| list.iter().any(|schema| is_integer(schema, root, depth - 1)));
    match &schema["type"] {
        Json::String(kind) if kind == "integer" => true,
        Json::Array(kinds) if kinds.iter().any(|kind| kind == "integer") => true,
        _ => is_integer(&schema["items"], root, depth - 1) || inner(&schema["anyOf"]) || inner(&schema["prefixItems"]),
    }
}

fn explain(error: &ValidationError) -> Complaint {
    use ValidationErrorKind as E;
    let value = &*error.instance;
    let say = |message: String, help: String| (error.instance_path.to_string(), message, help);
    match &error.kind {
        E::Minimum { limit } => say(format!("{value} is too small"), format!("{limit} or more")),
        E::Maximum { limit } => say(format!("{value} is too large"), format!("{limit} or less")),
        E::ExclusiveMinimum { limit } => say(format!("{value} is too small"), format!("more than {limit}")),
        E::ExclusiveMaximum { limit } => say(format!("{value} is too large"), format!("less than {limit}")),
        E::MinItems { limit } => say(format!("{value} is too short"), format!("a list of {limit} or more")),
        E::MaxItems { limit } => say(format!("{value} is too long"), format!("a list of {limit} or less")),
        E::Type { kind } => say(format!("expected {}, found {value}", kinds(kind)), String::new()),
        E::AdditionalProperties { unexpected } => {
            say(format!("unknown field \"{}\"", unexpected.join("\", \"")), String::new())
        }
        E::Required { property } => say(format!("field {property} is missing"), String::new()),
        E::Enum { .. } | E::Constant { .. } => explain_choice(error, &choices(error)),
        E::AnyOf { context } | E::OneOfNotValid { context } => {
            let offered: Vec<String> = context.iter().flatten().flat_map(choices).collect();
            let typed = |errors: &Vec<ValidationError>| {
                errors
                    .iter()
                    .any(|inner| matches!(inner.kind, E::Type { .. }) && inner.instance_path == error.instance_path)
            };
            // An alternative that misses a field of its own is hardly the one that was meant.
            let meant = |errors: &Vec<ValidationError>| {
                let misses = |inner: &ValidationError| {
                    matches!(inner.kind, E::Required { .. }) && inner.instance_path == error.instance_path
                };
                !errors.iter().any(misses)
            };
            let fits =
                |errors: &&Vec<ValidationError>| !typed(errors) && errors.iter().all(|inner| choices(inner).is_empty());
            let mut fitting = context.iter().filter(fits);
            match fitting.clone().find(|errors| meant(errors)).or_else(|| fitting.next()) {
                _ if !offered.is_empty() && value.is_string() => explain_choice(error, &offered),
                Some(errors) if !errors.is_empty() => explain(&errors[0]),
                _ => match context.iter().flatten().next() {
                    Some(first) => explain(first),
                    None => say(error.to_string(), String::new()),
                },
            }
        }
        _ => say(error.to_string(), String::new()),
    }
}

/// The texts that an error would have accepted.
fn choices(error: &ValidationError) -> Vec<String> {
    match &error.kind {
        ValidationErrorKind::Enum { options } => {
            options.as_array().into_iter().flatten().filter_map(|option| option.as_str().map(str::to_owned)).collect()
        }
        ValidationErrorKind::Constant { expected_value } => {
            expected_value.as_str().map(str::to_owned).into_iter().collect()
        }
        _ => Vec::new(),
    }
}

fn explain_choice(error: &ValidationError, offered: &[String]) -> Complaint {
    let known = || offered.iter().map(String::as_str);
    let help = match error.instance.as_str() {
        Some(given) => suggest(given, known()),
        None => format!("known: {}", known().collect::<Vec<_>>().join(", ")),
    };
    (error.instance_path.to_string(), format!("{} is not one of the choices", error.instance), help)
}

fn kinds(kind: &TypeKind) -> String {
    let name = |kind: &str| {
        match kind {
            "number" => "a number",
            "integer" => "an integer",
            "string" => "a text",
            "boolean" => "true or false",
            "array" => "a list",
            "object" => "an object",
            other => other,
        }
        .to_owned()
    };
    match kind {
        TypeKind::Single(kind) => name(&kind.to_string()),
        TypeKind::Multiple(set) => {
            let kinds = set.iter().map(|kind| kind.to_string()).filter(|kind| kind != "null");
            let kinds: Vec<String> = kinds.map(|kind| name(&kind)).collect();
            kinds.join(" or ")
        }
    }
}
