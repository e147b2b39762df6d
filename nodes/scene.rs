//! Opens a scene: a glTF file, or one that ships in the program.

use crate::node::{Facet, FacetRule, Info, Inputs, Job, Node, Port};
use crate::scene::{Scene as SceneValue, builtin, file};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Scene {
    /// A .gltf or .glb file, or `builtin:NAME` for a scene that ships in the program (`builtin:room`, `builtin:hall`).
    pub file: String,
    /// Frames a second that animation in the file is played at.
    #[schemars(range(min = 1.0, max = 1000.0), extend("unit" = "1/s"))]
    pub fps: f32,
    /// Lengths in the file are multiplied by this to become metres.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub scale: f32,
}

impl Default for Scene {
    fn default() -> Self {
        Self { file: "builtin:room".into(), fps: 24.0, scale: 1.0 }
    }
}

const BUILTIN: &str = "builtin:";

impl Node for Scene {
    const INFO: Info = Info {
        name: "scene",
        category: "in and out",
        summary: "Geometry, materials, lights and cameras from a glTF file or from the program",
        inputs: &[Port::new("lights", Kind::Scene, "Lights to add to those of the file")
            .optional()
            .reads(&[Facet::Lights])],
        outputs: &[Port::new("scene", Kind::Scene, "The scene")],
        facets: &[
            FacetRule::From(Facet::Geometry, &[]),
            FacetRule::From(Facet::Materials, &[]),
            FacetRule::From(Facet::Cameras, &[]),
        ],
        ..Info::NEW
    };

    fn files(&self) -> Vec<String> {
        if self.file.starts_with(BUILTIN) { vec![] } else { vec![self.file.clone()] }
    }

    fn linked_files(&self, base: &Path) -> Vec<PathBuf> {
        if self.file.starts_with(BUILTIN) { vec![] } else { file::dependencies(&base.join(&self.file)) }
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let mut scene = match self.file.strip_prefix(BUILTIN) {
            Some(name) => built_in(name)?,
            None => {
                let (scene, census) = file::read(&job.path(&self.file), self.scale)?;
                job.note("triangles", census.triangles);
                if census.zero_area > 0 {
                    job.note("triangles_without_area", census.zero_area);
                }
                if census.skipped_primitives > 0 {
                    job.note("skipped_points_and_lines", census.skipped_primitives);
                }
                if census.drawn_solid > 0 {
                    job.note("materials_with_alpha_drawn_solid", census.drawn_solid);
                }
                if census.averaged_emission > 0 {
                    job.note("emissive_textures_averaged", census.averaged_emission);
                }
                scene
            }
        };
        if inputs.get("lights").is_some() {
            let more = inputs.lights("lights")?;
            scene.lights = Arc::new(scene.lights.iter().chain(more.iter()).cloned().collect());
        }
        job.note("lights", scene.lights.len());
        job.note("cameras", scene.cameras.len());
        Ok(vec![Value::Scene(Arc::new(scene))])
    }
}

fn built_in(name: &str) -> Result<SceneValue> {
    builtin::scene(name).ok_or_else(|| {
        let known = builtin::names().collect::<Vec<_>>().join(", ");
        Error::compute(format!("no scene called \"{name}\" ships in the program"), format!("there is {known}"))
    })
}
