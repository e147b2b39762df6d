//! How a node type's parameters are described, read and checked; the type-erased form of `Node`.
//!
//! A parameter struct derives `Serialize, Deserialize, JsonSchema, Clone, Debug`, carries `#[serde(default,
//! deny_unknown_fields)]`, and implements `Default`. Ranges: `#[schemars(range(min = 0.0, max = 1.0))]`; units:
//! `#[schemars(extend("unit" = "m"))]`; docs: the doc comment of the field.

use crate::Result;
use crate::node::{Info, Inputs, Job, Key, Node, When};
use crate::value::Value;
use serde_json::{Map, Value as Json};
use std::path::{Path, PathBuf};

/// `Node` behind a pointer.
pub trait AnyNode: Send + Sync {
    fn info(&self) -> &'static Info;
    fn files(&self) -> Vec<String>;
    fn linked_files(&self, base: &Path) -> Vec<PathBuf>;
    fn uses_frame(&self, base: &Path) -> bool;
    fn moments(&self, when: &When) -> Result<[Key; 4]>;
    fn frames(&self, port: &str, frame: i64) -> Vec<i64>;
    fn output_files(&self, frame: f64) -> Vec<String>;
    fn pass_through(&self) -> Option<&'static str>;
    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>>;
    /// All parameters with defaults filled in, in the struct's order: what enters the key.
    fn params(&self) -> Json;
}

struct Erased<N>(N);

impl<N: Node + serde::Serialize> AnyNode for Erased<N> {
    fn info(&self) -> &'static Info {
        const { &N::INFO }
    }
    fn files(&self) -> Vec<String> {
        self.0.files()
    }
    fn linked_files(&self, base: &Path) -> Vec<PathBuf> {
        self.0.linked_files(base)
    }
    fn uses_frame(&self, base: &Path) -> bool {
        N::INFO.uses_frame && self.0.uses_frame(base)
    }
    fn moments(&self, when: &When) -> Result<[Key; 4]> {
        self.0.moments(when)
    }
    fn frames(&self, port: &str, frame: i64) -> Vec<i64> {
        self.0.frames(port, frame)
    }
    fn output_files(&self, frame: f64) -> Vec<String> {
        self.0.output_files(frame)
    }
    fn pass_through(&self) -> Option<&'static str> {
        self.0.pass_through()
    }
    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        self.0.run(inputs, job)
    }
    fn params(&self) -> Json {
        serde_json::to_value(&self.0).expect("parameter structs are plain data")
    }
}

/// A node, or what its parameters lack.
pub type Parsed = std::result::Result<Box<dyn AnyNode>, String>;

/// One entry of the list in `nodes/mod.rs`.
#[derive(Clone, Copy)]
pub struct NodeType {
    pub info: &'static Info,
    /// JSON schema of the parameter struct (an object schema with `properties`).
    pub schema: fn() -> schemars::Schema,
    /// The default parameters.
    pub defaults: fn() -> Json,
    /// Reads plain parameters (curves already evaluated). The error is serde's, with its path in front.
    pub parse: fn(Map<String, Json>) -> Parsed,
}

impl NodeType {
    pub const fn of<N>() -> Self
    where
        N: Node + Default + serde::Serialize + serde::de::DeserializeOwned + schemars::JsonSchema,
    {
        Self {
            info: const { &N::INFO },
            schema: || schemars::schema_for!(N),
            defaults: || serde_json::to_value(N::default()).expect("parameter structs are plain data"),
            parse: |params| match serde_path_to_error::deserialize::<_, N>(Json::Object(params)) {
                Ok(node) => Ok(Box::new(Erased(node))),
                Err(error) => Err(error.to_string()),
            },
        }
    }
}
