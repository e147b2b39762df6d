//! Opens a scene: a glTF file, or one that ships in the program.

use crate::node::{Facet, FacetRule, Info, Inputs, Job, Key, Node, Port, When};
use crate::scene::file::{self, Model, Motion, Playing};
use crate::scene::{Geometry, Scene as SceneValue, builtin};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Scene {
    /// A .gltf or .glb file, or `builtin:NAME` for a scene that ships in the program (`room`, `hall`, `yard`, an
    /// empty room called `bare`, and `walk`, in which a figure walks for two seconds).
    pub file: String,
    /// Frames a second that animation in the file is played at: frame 24 shows the file after one second at 24.
    #[schemars(range(min = 1.0, max = 1000.0), extend("unit" = "1/s"))]
    pub fps: f32,
    /// Frames that the animation is ahead of the picture; a curve holds, slows or turns time.
    #[schemars(extend("unit" = "frames"))]
    pub offset: f32,
    /// Animations of the file to play, by name; `*` and `?` stand for anything. Empty: all, but of two that move the same
    /// thing only the first.
    pub animations: Vec<String>,
    /// Begin again when the animation is over, instead of holding its end.
    pub repeat: bool,
    /// Lengths in the file are multiplied by this to become metres.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub scale: f32,
}

impl Default for Scene {
    fn default() -> Self {
        Self { file: "builtin:room".into(), fps: 24.0, offset: 0.0, animations: Vec::new(), repeat: false, scale: 1.0 }
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
            FacetRule::From(Facet::Lights, &[("lights", &[Facet::Lights])]),
        ],
        uses_frame: true,
        timing: &["fps", "offset", "repeat"],
        ..Info::NEW
    };

    fn files(&self) -> Vec<String> {
        if self.file.starts_with(BUILTIN) { vec![] } else { vec![self.file.clone()] }
    }

    fn linked_files(&self, base: &Path) -> Vec<PathBuf> {
        if self.file.starts_with(BUILTIN) { vec![] } else { file::dependencies(&base.join(&self.file)) }
    }

    fn uses_frame(&self, _: &Path) -> bool {
        self.file.strip_prefix(BUILTIN).is_none_or(|name| builtin::seconds(name) > 0.0)
    }

    fn moments(&self, when: &When) -> Result<[Key; 4]> {
        let always = Key::of(&[b"always"]);
        if let Some(name) = self.file.strip_prefix(BUILTIN) {
            let time = self.time((0.0, builtin::seconds(name)), when.frame);
            let surfaces = Key::of(&[&time.to_le_bytes()]);
            return Ok(Facet::ALL.map(|facet| if facet == Facet::Geometry { surfaces } else { always }));
        }
        let (path, key) = (when.base.join(&self.file), Key::of(&[b"motion", &when.content.0]));
        let motion = when.memo.remember(
            key,
            |motion: &Option<Motion>| motion.as_ref().map_or(64, Motion::bytes),
            || Motion::open(&path),
        )?;
        let Some(motion) = &*motion else { return Ok([always; 4]) };
        let playing = motion.play(&path, &self.animations)?;
        let time = self.time(playing.span, when.frame);
        let moments = motion.moments(&motion.pose(&playing, time, 1.0));
        Ok(Facet::ALL.map(|facet| match facet {
            Facet::Geometry => moments.surfaces,
            Facet::Materials => always,
            Facet::Lights => moments.lights,
            Facet::Cameras => moments.cameras,
        }))
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let mut scene = match self.file.strip_prefix(BUILTIN) {
            Some(name) => self.built_in(name, job)?,
            None => {
                let (scene, census) = self.posed(job)?;
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
                if census.other_channels > 0 {
                    job.note("animated_otherwise_left_out", census.other_channels);
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

impl Scene {
    /// Of an animation from `first` to `last`, seconds; before and after, it holds.
    fn time(&self, (first, last): (f32, f32), frame: f64) -> f32 {
        let time = ((frame + f64::from(self.offset)) / f64::from(self.fps)) as f32;
        match self.repeat && last > first {
            true => first + (time - first).rem_euclid(last - first),
            false => time.clamp(first, last.max(first)),
        }
    }

    fn built_in(&self, name: &str, job: &Job) -> Result<SceneValue> {
        let still = builtin::scene(name).ok_or_else(|| {
            let known = builtin::names().collect::<Vec<_>>().join(", ");
            Error::compute(format!("no scene called \"{name}\" ships in the program"), format!("there is {known}"))
        })?;
        let seconds = builtin::seconds(name);
        if seconds == 0.0 {
            return Ok(still);
        }
        let bytes = |poses: &Arc<[Geometry]>| poses.iter().map(Geometry::bytes).sum();
        let key = Key::of(&[b"built-in poses", name.as_bytes()]);
        let poses = job.memo(key, bytes, || Ok(builtin::poses(name, file::POSES)))?;
        let time = self.time((0.0, seconds), job.frame);
        job.note("time", time);
        let mut scene = builtin::scene_at(name, time).expect("it moves");
        Arc::make_mut(&mut scene.geometry).poses = (*poses).clone();
        Ok(scene)
    }

    fn posed(&self, job: &Job) -> Result<(SceneValue, file::Census)> {
        let path = job.path(&self.file);
        let model = job.memo(Key::of(&[b"model", &job.content.0]), Model::bytes, || Model::open(&path))?;
        let playing = match model.motion.animations().next() {
            Some(_) => model.motion.play(&path, &self.animations)?,
            None if self.animations.is_empty() => Playing::default(),
            None => {
                let message = format!("the file holds no animation, so none is called \"{}\"", self.animations[0]);
                return Err(Error::file(&path, message, "take animations out of the recipe, or export them too"));
            }
        };
        let names = playing.names.join("\n");
        let key = Key::of(&[b"poses", &job.content.0, &self.scale.to_le_bytes(), names.as_bytes()]);
        let bytes = |poses: &Arc<[Geometry]>| poses.iter().map(Geometry::bytes).sum();
        let poses = job.memo(key, bytes, || model.poses(&path, &playing, self.scale))?;
        if !playing.names.is_empty() {
            job.note("animations", playing.names.clone());
            job.note("time", self.time(playing.span, job.frame));
        }
        if !playing.left_out.is_empty() {
            job.note("animations_left_out", playing.left_out.clone());
        }
        let pose = model.motion.pose(&playing, self.time(playing.span, job.frame), self.scale);
        model.scene(&path, &pose, (*poses).clone())
    }
}
