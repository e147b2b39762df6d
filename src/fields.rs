//! The parameters of a node type as people see them: name, words, unit, range and shape, read from the one source of all
//! of it, the schema of its parameter struct. What help, README and the editor's inspector are made from.

use crate::params::NodeType;
use serde_json::Value as Json;

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    pub name: String,
    /// What it does, in its struct's own words.
    pub doc: String,
    /// `m`, `degrees`, ...; empty for none.
    pub unit: String,
    pub default: Json,
    /// It may be null: left to be found, or left as it is.
    pub optional: bool,
    pub shape: Shape,
}

/// What values look like.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    Number(Range),
    Switch,
    Text,
    /// One of these.
    Choice(Vec<String>),
    /// So many numbers: a point, a direction, a colour.
    Vector(usize),
    /// Points of so many numbers each; so many, or any number of them.
    Points(usize, Option<usize>),
    /// A list of texts, such as names of objects.
    Texts,
    /// Lists of texts by name.
    Groups,
    /// Anything else, written as JSON.
    Json,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Range {
    pub least: Option<f64>,
    pub most: Option<f64>,
    /// `least` itself is out, `most` itself is out.
    pub open: [bool; 2],
    pub integer: bool,
}

impl Range {
    /// The nearest number that is in it.
    pub fn clamp(&self, value: f64) -> f64 {
        let value = if self.integer { value.round() } else { value };
        // A step inside of an open end, small beside what is typed.
        let step = if self.integer { 1.0 } else { 1e-6 };
        let least = self.least.map_or(f64::NEG_INFINITY, |least| if self.open[0] { least + step } else { least });
        let most = self.most.map_or(f64::INFINITY, |most| if self.open[1] { most - step } else { most });
        value.max(least).min(most)
    }
}

/// In the order of the struct.
pub fn fields(node_type: &NodeType) -> Vec<Field> {
    let schema = (node_type.schema)().to_value();
    let defaults = (node_type.defaults)();
    let properties = schema["properties"].as_object().cloned().unwrap_or_default();
    let field = |(name, property): (String, Json)| {
        let (shape, optional) = shape(&property, &schema, 8);
        Field {
            doc: doc(&property, &schema),
            unit: property["unit"].as_str().unwrap_or_default().to_owned(),
            default: defaults[&name].clone(),
            optional,
            shape,
            name,
        }
    };
    properties.into_iter().map(field).collect()
}

fn resolve<'a>(schema: &'a Json, root: &'a Json) -> &'a Json {
    let pointer = schema["$ref"].as_str().and_then(|reference| reference.strip_prefix('#'));
    pointer.and_then(|pointer| root.pointer(pointer)).unwrap_or(schema)
}

/// The field's own words, or those of its type.
fn doc(property: &Json, root: &Json) -> String {
    let of_type = || resolve(property, root)["description"].as_str();
    property["description"].as_str().or_else(of_type).unwrap_or_default().replace('\n', " ")
}

/// And whether it may be null.
fn shape(schema: &Json, root: &Json, depth: usize) -> (Shape, bool) {
    if depth == 0 {
        return (Shape::Json, false);
    }
    let schema = resolve(schema, root);
    let text = |value: &Json| value.as_str().map(str::to_owned);
    if let Some(options) = schema["enum"].as_array() {
        let choices: Option<Vec<String>> = options.iter().map(text).collect();
        return (choices.map_or(Shape::Json, Shape::Choice), false);
    }
    if let Some(options) = schema["anyOf"].as_array().or(schema["oneOf"].as_array()) {
        let is_null = |option: &&Json| option["type"] == "null";
        let optional = options.iter().any(|option| is_null(&option));
        let others: Vec<&Json> = options.iter().filter(|option| !is_null(option)).collect();
        if let [one] = others[..] {
            return (shape(one, root, depth - 1).0, optional);
        }
        let choices: Option<Vec<String>> = others.iter().map(|option| text(&option["const"])).collect();
        return (choices.map_or(Shape::Json, Shape::Choice), optional);
    }
    let kinds: Vec<&str> = match &schema["type"] {
        Json::String(kind) => vec![kind],
        Json::Array(kinds) => kinds.iter().filter_map(Json::as_str).collect(),
        _ => Vec::new(),
    };
    let optional = kinds.contains(&"null");
    let kinds: Vec<&str> = kinds.into_iter().filter(|kind| *kind != "null").collect();
    let shape = match kinds[..] {
        ["number"] => Shape::Number(range(schema, false)),
        ["integer"] => Shape::Number(range(schema, true)),
        ["boolean"] => Shape::Switch,
        ["string"] => Shape::Text,
        ["array"] => list(schema, root, depth),
        ["object"] if schema["properties"].is_null() => match shape(&schema["additionalProperties"], root, depth - 1) {
            (Shape::Texts, _) => Shape::Groups,
            _ => Shape::Json,
        },
        _ => Shape::Json,
    };
    (shape, optional)
}

fn list(schema: &Json, root: &Json, depth: usize) -> Shape {
    let same = |least: Option<u64>, most: Option<u64>| least.filter(|least| Some(*least) == most);
    let count = same(schema["minItems"].as_u64(), schema["maxItems"].as_u64());
    match (shape(&schema["items"], root, depth - 1).0, count) {
        (Shape::Number(_), Some(count)) => Shape::Vector(count as usize),
        (Shape::Vector(size), count) => Shape::Points(size, count.map(|count| count as usize)),
        (Shape::Text, None) => Shape::Texts,
        _ => Shape::Json,
    }
}

fn range(schema: &Json, integer: bool) -> Range {
    let limit = |inclusive: &str, exclusive: &str| match schema[exclusive].as_f64() {
        Some(limit) => (Some(limit), true),
        None => (schema[inclusive].as_f64(), false),
    };
    let ((least, open_least), (most, open_most)) =
        (limit("minimum", "exclusiveMinimum"), limit("maximum", "exclusiveMaximum"));
    Range { least, most, open: [open_least, open_most], integer }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nodes;

    fn field(kind: &str, name: &str) -> Field {
        let node_type = nodes::find(kind).unwrap();
        fields(node_type).into_iter().find(|field| field.name == name).unwrap_or_else(|| panic!("{kind}.{name}"))
    }

    #[test]
    fn shapes_are_those_of_the_structs() {
        let number = |least, most| Range { least, most, ..Range::default() };
        let brightness = field("caster_receiver", "brightness");
        assert_eq!(brightness.shape, Shape::Number(number(Some(0.0), Some(1000.0))));
        assert!(!brightness.optional && brightness.default == 1.0 && !brightness.doc.is_empty());
        let tolerance = field("visibility", "tolerance");
        assert!(tolerance.optional && tolerance.shape == Shape::Number(number(Some(0.0), Some(1.0))));
        let Shape::Number(size) = field("visibility", "face_size").shape else { panic!("a number") };
        assert!(size.integer && size.clamp(40.4) == 40.0 && size.clamp(1e9) == 512.0);
        let basis = field("visibility", "basis").shape;
        assert_eq!(basis, Shape::Choice(["runs", "haar2d", "haar1d"].map(str::to_owned).to_vec()));
        assert_eq!(field("visibility", "groups").shape, Shape::Groups);
        assert_eq!(field("pick", "objects").shape, Shape::Texts);
        assert_eq!(field("ratio_lattice", "points").shape, Shape::Points(2, None));
        assert_eq!(field("ratio_transform", "corners").shape, Shape::Points(2, Some(4)));
        assert_eq!((field("light", "position").shape, field("light", "position").unit), (Shape::Vector(3), "m".into()));
        assert!(field("light", "kind").optional && matches!(field("light", "kind").shape, Shape::Choice(_)));
        assert_eq!(field("paint", "strokes").shape, Shape::Json);
        assert_eq!(field("light", "on").shape, Shape::Switch);
        assert_eq!(field("scene", "file").shape, Shape::Text);
    }

    /// Every parameter of every node has words, and its default is one of the values that it takes.
    #[test]
    fn every_parameter_is_described() {
        for node_type in nodes::ALL {
            for field in fields(node_type) {
                let name = format!("{}.{}", node_type.info.name, field.name);
                assert!(!field.doc.is_empty(), "{name} has no words");
                assert!(!field.default.is_null() || field.optional, "{name} has no default");
                if let (Shape::Number(range), Some(default)) = (&field.shape, field.default.as_f64()) {
                    assert_eq!(range.clamp(default), default, "{name}");
                }
            }
        }
    }

    #[test]
    fn open_ends_are_kept_out_of() {
        let range = Range { least: Some(0.0), open: [true, false], ..Range::default() };
        assert!(range.clamp(-1.0) > 0.0 && range.clamp(3.5) == 3.5);
    }
}
