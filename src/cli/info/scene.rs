//! What is in a scene.

use super::list;
use crate::Result;
use crate::scene::file::{Model, Playing};
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;

#[derive(Serialize)]
pub struct SceneInfo {
    file: String,
    triangles: usize,
    /// Lower and upper corner, metres.
    bounds: [[f32; 3]; 2],
    objects: Vec<String>,
    materials: Vec<String>,
    lights: Vec<String>,
    cameras: Vec<String>,
    animations: Vec<AnimationInfo>,
}

#[derive(Serialize)]
struct AnimationInfo {
    name: String,
    /// First and last key, seconds; none when it makes no sense.
    span: Option<[f32; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fault: Option<String>,
}

impl AnimationInfo {
    fn text(&self) -> String {
        match (&self.span, &self.fault) {
            (Some([first, last]), _) => format!("{} ({first:.2} to {last:.2} s)", self.name),
            (None, fault) => format!("{} (faulty: {})", self.name, fault.as_deref().unwrap_or("")),
        }
    }
}

/// # Errors
/// `File` for what cannot be read.
pub fn describe(path: &Path) -> Result<SceneInfo> {
    let model = Model::open(path)?;
    let rest = model.motion.pose(&Playing::default(), 0.0, 1.0);
    let (scene, _) = model.scene(path, &rest, Arc::new([]))?;
    let animations = model.motion.animations().map(|name| {
        let playing = model.motion.play(path, &[globset::escape(name)]);
        let fault = playing.as_ref().err().map(ToString::to_string);
        AnimationInfo { name: name.to_owned(), span: playing.ok().map(|playing| playing.span.into()), fault }
    });
    let animations = animations.collect();
    let (low, high) = scene.geometry.bounds();
    Ok(SceneInfo {
        file: path.display().to_string(),
        triangles: scene.geometry.corners.len(),
        bounds: [low.to_array(), high.to_array()],
        objects: scene.geometry.objects.clone(),
        materials: scene.geometry.material_names.clone(),
        lights: scene.lights.iter().map(|light| light.name.clone()).collect(),
        cameras: scene.cameras.iter().map(|camera| camera.name.clone()).collect(),
        animations,
    })
}

impl SceneInfo {
    pub fn text(&self) -> String {
        let [low, high] = self.bounds.map(|[x, y, z]| format!("{x:.2} {y:.2} {z:.2}"));
        let mut text = format!("{}: glTF, {} triangles, from {low} to {high} m\n", self.file, self.triangles);
        let animations: Vec<String> = self.animations.iter().map(AnimationInfo::text).collect();
        let lists = [
            ("object", &self.objects),
            ("material", &self.materials),
            ("light", &self.lights),
            ("camera", &self.cameras),
            ("animation", &animations),
        ];
        for (what, names) in lists {
            let (count, plural) = (names.len(), if names.len() == 1 { "" } else { "s" });
            let colon = if names.is_empty() { "" } else { ": " };
            text += &format!("  {count} {what}{plural}{colon}{}\n", list(names));
        }
        text
    }
}
