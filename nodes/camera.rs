//! A camera: one of the scene's, or a new one.

use crate::node::{Facet, Info, Inputs, Job, Node, Port};
use crate::scene::Camera as CameraValue;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What is not given stays as it is in the scene's camera, or takes the value in parentheses.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Camera {
    /// A camera of the scene to start from. Without it: the scene's first when nothing else is given, else a new one.
    pub name: Option<String>,
    /// (0, 1.6, 5)
    #[schemars(extend("unit" = "m"))]
    pub position: Option<[f32; 3]>,
    /// (0, 1, 0) The point in the middle of the picture.
    #[schemars(extend("unit" = "m"))]
    pub target: Option<[f32; 3]>,
    /// (40) Vertical field of view.
    #[schemars(range(min = 0.1, max = 170.0), extend("unit" = "degrees"))]
    pub fov_y: Option<f32>,
}

impl Node for Camera {
    const INFO: Info = Info {
        name: "camera",
        category: "in and out",
        summary: "A camera: one of the scene's, changed or not, or a new one",
        inputs: &[Port::new("scene", Kind::Scene, "Where a camera is looked for by name")
            .optional()
            .reads(&[Facet::Cameras])],
        outputs: &[Port::new("camera", Kind::Camera, "The camera")],
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, _: &Job) -> Result<Vec<Value>> {
        let cameras = if inputs.get("scene").is_some() { inputs.cameras("scene")?.to_vec() } else { vec![] };
        let camera = self.camera(&cameras)?;
        Ok(vec![Value::Camera(Arc::new(camera))])
    }
}

impl Camera {
    fn camera(&self, cameras: &[CameraValue]) -> Result<CameraValue> {
        let given = self.position.is_some() || self.target.is_some() || self.fov_y.is_some();
        let start = match &self.name {
            Some(name) => Some(find(cameras, name)?),
            None if given => None,
            None => Some(first(cameras)?),
        };
        let fov_y = self.fov_y.map(f32::to_radians).or(start.map(|camera| camera.fov_y)).unwrap_or(40f32.to_radians());
        let position = self.position.map(Vec3::from).or(start.map(|c| c.position)).unwrap_or(Vec3::new(0.0, 1.6, 5.0));
        let name = start.map_or("camera", |camera| &camera.name);
        match (self.target, start) {
            (None, Some(start)) => Ok(CameraValue { position, fov_y, ..start.clone() }),
            (target, _) => {
                let target = target.map_or(Vec3::new(0.0, 1.0, 0.0), Vec3::from);
                if position == target {
                    return Err(Error::compute("position and target are the same point", "move one of them"));
                }
                Ok(CameraValue::look_at(name, position, target, fov_y))
            }
        }
    }
}

fn find<'a>(cameras: &'a [CameraValue], name: &str) -> Result<&'a CameraValue> {
    cameras.iter().find(|camera| camera.name == name).ok_or_else(|| {
        let known = cameras.iter().map(|camera| camera.name.as_str());
        let help = crate::names::suggest(name, known);
        Error::compute(format!("the scene has no camera called \"{name}\""), help)
    })
}

/// The camera that is used when none is named.
pub fn first(cameras: &[CameraValue]) -> Result<&CameraValue> {
    cameras.first().ok_or_else(|| {
        Error::compute("the scene has no camera", "add a camera node with a position and a target, and connect it")
    })
}
