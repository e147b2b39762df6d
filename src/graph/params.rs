//! Parameters of nodes that were found right: constants and curves, and the node that they make at a frame.

use super::check::ParamChecker;
use super::curve::{self, Complaint, Curve};
use super::document::NodeEntry;
use crate::memo::Key;
use crate::params::{AnyNode, NodeType};
use indexmap::IndexMap;
use serde_json::{Map, Value as Json};
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

pub enum Param {
    Constant(Json),
    Curve { curve: Curve, integer: bool },
}

/// Those that a recipe gives a node.
pub struct Params {
    given: IndexMap<String, Param>,
    /// At every frame, when nothing changes over time.
    constant: OnceLock<Ready>,
}

/// A node with its parameters at a frame.
#[derive(Clone)]
pub struct Ready {
    pub node: Arc<dyn AnyNode>,
    /// Names all parameters but those of `Info::timing`, with the defaults of those that are not given.
    pub digest: Key,
}

impl Param {
    pub fn at(&self, frame: f64) -> Json {
        match self {
            Self::Constant(value) => value.clone(),
            Self::Curve { curve, integer: false } => curve.at(frame),
            Self::Curve { curve, integer: true } => rounded(curve.at(frame)),
        }
    }
}

fn rounded(value: Json) -> Json {
    match value {
        Json::Number(number) if number.is_f64() => Json::from(number.as_f64().expect("is_f64").round() as i64),
        Json::Array(list) => list.into_iter().map(rounded).collect(),
        other => other,
    }
}

impl Params {
    pub fn new(given: IndexMap<String, Param>) -> Self {
        Self { given, constant: OnceLock::new() }
    }

    pub fn get(&self, name: &str) -> Option<&Param> {
        self.given.get(name)
    }

    /// Errors: what is wrong with parameters that do not go together at a frame.
    pub fn node(&self, node_type: &NodeType, frame: f64) -> Result<Ready, String> {
        if let Some(ready) = self.constant.get() {
            return Ok(ready.clone());
        }
        let given: Map<String, Json> = self.given.iter().map(|(name, param)| (name.clone(), param.at(frame))).collect();
        let node = (node_type.parse)(given)?;
        let mut params = node.params();
        if let Json::Object(params) = &mut params {
            params.retain(|name, _| !node_type.info.timing.contains(&&**name));
        }
        let digest = Key::of(&[params.to_string().as_bytes()]);
        let ready = Ready { node: node.into(), digest };
        if self.given.values().all(|param| matches!(param, Param::Constant(_))) {
            return Ok(self.constant.get_or_init(|| ready).clone());
        }
        Ok(ready)
    }
}

/// Parameters that were found right before, by node.
#[derive(Default)]
pub struct Checks(HashMap<String, Checked>);

struct Checked {
    entry: Arc<NodeEntry>,
    /// Frame that curves were tried at.
    frame: i64,
    params: Arc<Params>,
}

impl Checks {
    /// Of a node that is still the same.
    pub fn of(&self, node: &str, entry: &Arc<NodeEntry>, frame: i64) -> Option<Arc<Params>> {
        let known = self.0.get(node).filter(|known| Arc::ptr_eq(&known.entry, entry) && known.frame == frame)?;
        Some(known.params.clone())
    }

    pub fn note(&mut self, node: &str, entry: &Arc<NodeEntry>, frame: i64, params: &Arc<Params>) {
        self.0.insert(node.to_owned(), Checked { entry: entry.clone(), frame, params: params.clone() });
    }

    /// Forgets nodes that are gone.
    pub fn keep(&mut self, is_there: impl Fn(&str) -> bool) {
        self.0.retain(|node, _| is_there(node));
    }
}

/// A curve when it is written as one, unless the parameter takes just such an object as its value.
pub fn read_param(param: &ParamChecker, value: &Json) -> std::result::Result<Param, Vec<Complaint>> {
    let Some(object) = value.as_object().filter(|_| curve::is_curve(value) && !param.accepts(value)) else {
        let complaints = param.complaints(value);
        return if complaints.is_empty() { Ok(Param::Constant(value.clone())) } else { Err(complaints) };
    };
    let curve = Curve::parse(object)?;
    let complaints: Vec<Complaint> = curve
        .keys()
        .iter()
        .enumerate()
        .flat_map(|(index, (_, value))| {
            let inside = move |(at, message, help)| (format!("/keys/{index}/1{at}"), message, help);
            param.complaints(value).into_iter().map(inside)
        })
        .collect();
    if complaints.is_empty() { Ok(Param::Curve { curve, integer: param.integer }) } else { Err(complaints) }
}
