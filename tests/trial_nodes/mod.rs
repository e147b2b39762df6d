//! Small node types to try plans and evaluators on: they compute what can be checked by hand.

#![allow(dead_code)]

use chiaro::image::{Content, Image, Layer};
use chiaro::node::{Facet, FacetRule, Info, Inputs, Job, Key, Node, Port, frame_path};
use chiaro::params::NodeType;
use chiaro::scene::Scene;
use chiaro::value::{Kind, Value};
use chiaro::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

pub const NODES: &[NodeType] = &[
    NodeType::of::<Flat>(),
    NodeType::of::<Gain>(),
    NodeType::of::<Add>(),
    NodeType::of::<Clock>(),
    NodeType::of::<ReadNumber>(),
    NodeType::of::<Split>(),
    NodeType::of::<Fail>(),
    NodeType::of::<Stage>(),
    NodeType::of::<Lamp>(),
    NodeType::of::<Outline>(),
    NodeType::of::<Shade>(),
    NodeType::of::<Dump>(),
    NodeType::of::<Slow>(),
    NodeType::of::<Keeper>(),
    NodeType::of::<Echo>(),
];

const IMAGE: Port = Port::new("image", Kind::Image, "a picture");
const SCENE: Port = Port::new("scene", Kind::Scene, "a scene");

macro_rules! params {
    ($(#[$about:meta])* $name:ident { $($(#[$meta:meta])* $field:ident: $type:ty = $default:expr),* $(,)? }) => {
        $(#[$about])*
        #[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name { $($(#[$meta])* pub $field: $type),* }
        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default),* }
            }
        }
    };
}

fn picture(values: Vec<f32>) -> Value {
    let layer =
        Layer { name: String::new(), channels: vec!["Z".into()], content: Content::Data, data: values.clone().into() };
    Value::Image(Arc::new(Image { width: values.len(), height: 1, layers: vec![layer], ..Image::default() }))
}

/// The values of a picture of one channel.
pub fn values(value: &Value) -> Vec<f32> {
    match value {
        Value::Image(image) => image.layers[0].data.to_vec(),
        other => panic!("a {:?} is no picture", other.kind()),
    }
}

fn map(inputs: &Inputs, port: &str, change: impl Fn(f32) -> f32) -> Result<Value> {
    Ok(picture(inputs.need_image(port)?.layers[0].data.iter().map(|value| change(*value)).collect()))
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    Plain,
    /// Every other pixel is black.
    Striped,
}

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Dot {
    #[schemars(range(min = 0.0))]
    pub radius: f32,
}

params! {
    Flat {
        /// Number of pixels.
        #[schemars(range(min = 1, max = 100000000))]
        width: u32 = 4,
        /// Of every pixel.
        #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "m"))]
        value: f32 = 1.0,
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        scale: f32 = 1.0,
        tint: [f32; 3] = [1.0; 3],
        mode: Mode = Mode::Plain,
        label: String = String::new(),
        dots: Vec<Dot> = Vec::new(),
        limit: Option<f32> = None,
        groups: std::collections::BTreeMap<String, Vec<String>> = Default::default(),
    }
}

impl Node for Flat {
    const INFO: Info = Info {
        name: "flat",
        category: "Make",
        summary: "A picture of one value",
        outputs: &[IMAGE],
        stored: true,
        ..Info::NEW
    };

    fn run(&self, _: &Inputs, job: &Job) -> Result<Vec<Value>> {
        job.note("pixels", self.width);
        let value = self.value * self.scale * self.tint[0];
        let striped = matches!(self.mode, Mode::Striped);
        let pixel = |x: u32| if striped && x % 2 == 1 { 0.0 } else { value.min(self.limit.unwrap_or(f32::MAX)) };
        Ok(vec![picture((0..self.width).map(pixel).collect())])
    }
}

params! { Gain { amount: f32 = 1.0 } }

impl Node for Gain {
    const INFO: Info = Info { name: "gain", category: "Change", inputs: &[IMAGE], outputs: &[IMAGE], ..Info::NEW };

    fn pass_through(&self) -> Option<&'static str> {
        (self.amount == 1.0).then_some("image")
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        Ok(vec![map(inputs, "image", |value| value * self.amount)?])
    }
}

params! { Add {} }

impl Node for Add {
    const INFO: Info = Info {
        name: "add",
        category: "Change",
        inputs: &[Port::new("a", Kind::Image, "first"), Port::new("b", Kind::Image, "second").optional()],
        outputs: &[IMAGE],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let more = inputs.image("b").map_or(0.0, |image| image.layers[0].data[0]);
        Ok(vec![map(inputs, "a", |value| value + more)?])
    }
}

params! {
    Clock {
        /// Stands still.
        stopped: bool = false,
    }
}

impl Node for Clock {
    const INFO: Info =
        Info { name: "clock", category: "Make", outputs: &[IMAGE], uses_frame: true, stored: true, ..Info::NEW };

    fn uses_frame(&self, _: &std::path::Path) -> bool {
        !self.stopped
    }

    fn run(&self, _: &Inputs, job: &Job) -> Result<Vec<Value>> {
        Ok(vec![picture(vec![job.frame as f32])])
    }
}

params! { ReadNumber { file: String = "builtin:seven".into() } }

impl Node for ReadNumber {
    const INFO: Info = Info { name: "read_number", category: "Make", outputs: &[IMAGE], ..Info::NEW };

    fn files(&self) -> Vec<String> {
        vec![self.file.clone()]
    }

    fn run(&self, _: &Inputs, job: &Job) -> Result<Vec<Value>> {
        if self.file == "builtin:seven" {
            return Ok(vec![picture(vec![7.0])]);
        }
        let path = job.path(&self.file);
        let fail = |message: String| Error::file(&path, message, "write a number into it");
        let text = std::fs::read_to_string(&path).map_err(|error| fail(error.to_string()))?;
        Ok(vec![picture(vec![text.trim().parse().map_err(|_| fail("no number".into()))?])])
    }
}

params! { Split { at: f32 = 0.5 } }

impl Node for Split {
    const INFO: Info = Info {
        name: "split",
        category: "Change",
        inputs: &[IMAGE],
        outputs: &[Port::new("low", Kind::Image, "up to `at`"), Port::new("high", Kind::Image, "the rest")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        Ok(vec![
            map(inputs, "image", |value| value.min(self.at))?,
            map(inputs, "image", |value| (value - self.at).max(0.0))?,
        ])
    }
}

params! { Fail { from: f64 = 0.0 } }

impl Node for Fail {
    const INFO: Info =
        Info { name: "fail", category: "Change", inputs: &[IMAGE], outputs: &[IMAGE], uses_frame: true, ..Info::NEW };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        if job.frame >= self.from {
            return Err(Error::compute("told to fail", "do not tell it"));
        }
        Ok(vec![map(inputs, "image", |value| value)?])
    }
}

params! { Stage { file: String = String::new() } }

impl Node for Stage {
    const INFO: Info = Info { name: "stage", category: "Scene", outputs: &[SCENE], ..Info::NEW };

    fn run(&self, _: &Inputs, _: &Job) -> Result<Vec<Value>> {
        Ok(vec![Value::Scene(Arc::new(Scene::default()))])
    }
}

params! { Lamp { power: f32 = 1.0 } }

impl Node for Lamp {
    const INFO: Info = Info {
        name: "lamp",
        category: "Scene",
        inputs: &[SCENE.reads(&[Facet::Lights])],
        outputs: &[SCENE],
        facets: &[
            FacetRule::Keeps(Facet::Geometry, "scene"),
            FacetRule::Keeps(Facet::Materials, "scene"),
            FacetRule::From(Facet::Lights, &[("scene", &[Facet::Lights])]),
            FacetRule::Keeps(Facet::Cameras, "scene"),
        ],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let scene = inputs.need_whole_scene("scene")?;
        let mut lights = scene.lights.to_vec();
        lights.push(chiaro::scene::Light {
            name: "lamp".into(),
            kind: chiaro::scene::LightKind::Directional { direction: glam::Vec3::NEG_Y },
            intensity: glam::Vec3::splat(self.power),
        });
        Ok(vec![Value::Scene(Arc::new(Scene { lights: Arc::new(lights), ..Scene::clone(scene) }))])
    }
}

params! { Outline {} }

impl Node for Outline {
    const INFO: Info = Info {
        name: "outline",
        category: "Render",
        inputs: &[SCENE.reads(&[Facet::Geometry])],
        outputs: &[IMAGE],
        stored: true,
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        Ok(vec![picture(vec![inputs.geometry("scene")?.bytes() as f32])])
    }
}

params! { Shade {} }

impl Node for Shade {
    const INFO: Info = Info {
        name: "shade",
        category: "Render",
        inputs: &[SCENE.reads(&[Facet::Lights])],
        outputs: &[IMAGE],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        Ok(vec![picture(vec![inputs.lights("scene")?.iter().map(|light| light.intensity.x).sum()])])
    }
}

params! { Dump { file: String = "dump.####.txt".into() } }

impl Node for Dump {
    const INFO: Info = Info { name: "dump", category: "Write", inputs: &[IMAGE], uses_frame: true, ..Info::NEW };

    fn output_files(&self, frame: f64) -> Vec<String> {
        vec![frame_path(&self.file, frame)]
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let text = format!("{:?}", values(&Value::Image(inputs.need_image("image")?.clone())));
        chiaro::atomic::write(&job.output(&frame_path(&self.file, job.frame)), text.as_bytes())?;
        Ok(Vec::new())
    }
}

params! { Slow { steps: u64 = 100 } }

impl Node for Slow {
    const INFO: Info = Info { name: "slow", category: "Change", inputs: &[IMAGE], outputs: &[IMAGE], ..Info::NEW };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let stage = job.progress.stage("waiting", self.steps);
        for _ in 0..self.steps {
            std::thread::sleep(std::time::Duration::from_millis(10));
            stage.advance(1)?;
        }
        Ok(vec![map(inputs, "image", |value| value)?])
    }
}

params! {
    /// Keeps a picture of one value between runs; what it is called is no part of that.
    Keeper {
        value: f32 = 1.0,
        label: String = String::new(),
        /// The result is not what it was the last time.
        forgetful: bool = false,
    }
}

impl Node for Keeper {
    const INFO: Info = Info { name: "keeper", category: "Make", outputs: &[IMAGE], ..Info::NEW };

    fn run(&self, _: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let kept = job.keep(Key::of(&[b"keeper", &self.value.to_le_bytes()]), Image::bytes, || {
            job.note("computed", true);
            let value = if self.forgetful { self.value + 1.0 } else { self.value };
            match picture(vec![value; 256]) {
                Value::Image(image) => Ok(Arc::unwrap_or_clone(image)),
                other => panic!("a {:?}", other.kind()),
            }
        })?;
        Ok(vec![Value::Image(kept)])
    }
}

params! {
    /// A picture now, beside the same picture at other frames.
    Echo { frames: Vec<i64> = vec![] }
}

impl Node for Echo {
    const INFO: Info = Info { name: "echo", category: "Change", inputs: &[IMAGE], outputs: &[IMAGE], ..Info::NEW };

    fn frames(&self, _: &str, frame: i64) -> Vec<i64> {
        [frame].into_iter().chain(self.frames.iter().copied()).collect()
    }

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let mut all = values(inputs.get("image").unwrap());
        for frame in &self.frames {
            all.extend(values(inputs.at(*frame).get("image").unwrap()));
        }
        Ok(vec![picture(all)])
    }
}
