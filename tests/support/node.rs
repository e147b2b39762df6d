//! One node, run as the evaluator runs it.

use chiaro::device::Device;
use chiaro::image::Image;
use chiaro::node::{Inputs, Job, Key, NoMemo};
use chiaro::transport::Samples;
use chiaro::transport::shadow::Ratio;
use chiaro::value::Value;
use chiaro::{Result, nodes};
use serde_json::{Map, Value as Json};
use std::path::Path;
use std::sync::{Arc, Mutex};

pub struct Ran {
    pub values: Vec<Value>,
    pub notes: Map<String, Json>,
}

/// Folders of input and output files, and the frame.
#[derive(Clone, Copy)]
pub struct At<'a> {
    pub base: &'a Path,
    pub out: Option<&'a Path>,
    pub frame: f64,
}

pub fn here() -> At<'static> {
    At { base: Path::new("."), out: None, frame: 0.0 }
}

pub fn run_at(kind: &str, params: Json, inputs: &[(&str, Value)], at: At) -> Result<Ran> {
    let node_type = nodes::find(kind).unwrap();
    let Json::Object(params) = params else { panic!("parameters are an object") };
    let node = (node_type.parse)(params).unwrap_or_else(|error| panic!("{kind}: {error}"));
    let value = |name: &str| {
        let (_, value) = inputs.iter().find(|(port, _)| *port == name)?;
        Some((value.clone(), [Key::of(&[b"input"]); 4]))
    };
    let values: Vec<Option<(Value, [Key; 4])>> = node_type.info.inputs.iter().map(|port| value(port.name)).collect();
    let notes = Mutex::default();
    let job = Job {
        frame: at.frame,
        base: at.base,
        out: at.out,
        recipe: &|| "{ \"chiaro\": 1 }".to_owned(),
        key: Key::of(&[b"key"]),
        ..Job::alone(&Device::Cpu, &NoMemo, &notes)
    };
    let connected = values.iter().map(Option::is_some).collect();
    let values = node.run(&Inputs { info: node_type.info, values, at_frames: Vec::new(), connected }, &job)?;
    Ok(Ran { values, notes: notes.into_inner().unwrap() })
}

pub fn run(kind: &str, params: Json, inputs: &[(&str, Value)]) -> Result<Ran> {
    run_at(kind, params, inputs, here())
}

impl Ran {
    /// The first of its values that is a picture.
    pub fn image(&self) -> Arc<Image> {
        let image =
            self.values.iter().find_map(|value| if let Value::Image(image) = value { Some(image) } else { None });
        image.expect("a picture").clone()
    }

    pub fn ratio(&self) -> Arc<Ratio> {
        let ratio =
            self.values.iter().find_map(|value| if let Value::Ratio(ratio) = value { Some(ratio) } else { None });
        ratio.expect("a ratio").clone()
    }

    pub fn samples(&self) -> Arc<Samples> {
        let found =
            self.values.iter().find_map(|value| if let Value::Samples(found) = value { Some(found) } else { None });
        found.expect("samples").clone()
    }

    /// All warnings in one text.
    pub fn warnings(&self) -> String {
        self.notes.get("warnings").map(Json::to_string).unwrap_or_default()
    }
}

pub fn image(image: &Image) -> Value {
    Value::Image(Arc::new(image.clone()))
}
