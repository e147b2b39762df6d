//! glTF 2.0 files (.gltf, .glb) into scenes: triangles, base colours, metalness and roughness with their textures,
//! emission, punctual lights, cameras, and how animations, skins and morph targets move them.
//!
//! A file is read once (`Model`), and posed for each time that it is asked for. Read in part: emissive textures (their
//! mean), roughness textures (their mean), alpha (all is solid; counted). Not read: normal and occlusion textures, other
//! material extensions, orthographic cameras, Draco and meshopt compression (refused with a message), animation of
//! anything but nodes and morph weights (counted), point and line primitives (counted).

mod material;
mod mesh;
pub mod motion;
mod place;
mod sound;
mod track;

pub use motion::{Motion, Playing, Pose};

use crate::scene::{Geometry, Material, Scene};
use crate::{Error, Result};
use glam::Mat4;
use gltf::khr_lights_punctual::Kind;
use gltf::material::AlphaMode;
use material::Pictures;
use mesh::Primitive;
use sound::{check_accessors, check_json, json_part, percent_decoded, take_out_other_channels};
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a file held beside what was used; said in the report.
#[derive(Clone, Debug, Default)]
pub struct Census {
    pub triangles: usize,
    pub zero_area: usize,
    pub skipped_primitives: usize,
    /// Materials with alpha (cut out or blended), drawn solid.
    pub drawn_solid: usize,
    /// Materials that glow evenly with the mean of their emissive texture.
    pub averaged_emission: usize,
    /// Animation channels of something else than nodes and morph weights.
    pub other_channels: usize,
}

/// All that a file holds, not yet at any time.
pub struct Model {
    pub motion: Motion,
    /// By node of the file, as are lamps and lenses.
    objects: Vec<Option<Object>>,
    lamps: Vec<Option<Lamp>>,
    lenses: Vec<Option<Lens>>,
    /// Primitives of each mesh.
    meshes: HashMap<usize, Vec<Primitive>>,
    skins: Vec<Skin>,
    materials: Arc<Vec<Material>>,
    census: Census,
}

struct Object {
    name: String,
    mesh: usize,
    skin: Option<usize>,
}

struct Lamp {
    name: String,
    kind: Kind,
    intensity: glam::Vec3,
}

struct Lens {
    name: String,
    /// Radians.
    fov_y: f32,
}

struct Skin {
    /// Nodes.
    joints: Vec<usize>,
    /// From the space of the mesh to that of each joint.
    joint_from_bind: Vec<Mat4>,
}

/// Times at which what moves is looked at, to find what all frames have in common: a lid that opens is seen open.
pub const POSES: usize = 8;

/// A file that is sound so far, with all that its buffers hold.
struct Opened {
    document: gltf::Document,
    buffers: Vec<gltf::buffer::Data>,
    /// Channels that were taken out.
    other_channels: usize,
}

const EXPORT_AGAIN: &str = "export it again as glTF 2.0";

fn broken(path: &Path) -> impl Fn(gltf::Error) -> Error {
    move |error| Error::file(path, format!("is not a readable glTF file: {error}"), EXPORT_AGAIN)
}

impl Opened {
    fn new(path: &Path) -> Result<Self> {
        let bytes =
            std::fs::read(path).map_err(|e| Error::file(path, e.to_string(), "check the path in the recipe"))?;
        // The importer skips text that it does not know; what cannot be read in full cannot be checked either.
        let mut json = json_part(&bytes).map_err(|what| Error::file(path, what, EXPORT_AGAIN))?;
        check_json(path, &json)?;
        let other_channels = take_out_other_channels(&mut json);
        let blob = match bytes.starts_with(b"glTF") {
            true => gltf::binary::Glb::from_slice(&bytes).map_err(broken(path))?.bin.map(Cow::into_owned),
            false => None,
        };
        let root = gltf::json::deserialize::from_value(json).map_err(|error| broken(path)(error.into()))?;
        let document = gltf::Document::from_json(root).map_err(broken(path))?;
        let buffers = gltf::import_buffers(&document, path.parent(), blob).map_err(broken(path))?;
        check_accessors(path, &document, &buffers)?;
        Ok(Self { document, buffers, other_channels })
    }
}

impl Motion {
    /// How a file moves; `None` when it holds no animation (or cannot be read: reading the model says why).
    ///
    /// # Errors
    /// As `Model::open`.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        let json = std::fs::read(path).ok().and_then(|bytes| json_part(&bytes).ok());
        let animations = json.as_ref().and_then(|json| json["animations"].as_array());
        if animations.is_none_or(Vec::is_empty) {
            return Ok(None);
        }
        let opened = Opened::new(path)?;
        Self::read(path, &opened.document, &opened.buffers).map(Some)
    }
}

impl Model {
    /// # Errors
    /// `File` for a missing, truncated or invalid file, an extension that is required and not read, numbers that make no
    /// sense.
    pub fn open(path: &Path) -> Result<Self> {
        let Opened { document, buffers, other_channels } = Opened::new(path)?;
        let motion = Motion::read(path, &document, &buffers)?;
        let mut census = Census { other_channels, ..Census::default() };
        let mut pictures = Pictures::new(path.parent(), &buffers);
        let mut materials: Vec<Material> =
            document.materials().map(|m| pictures.material(&m)).collect::<gltf::Result<_>>().map_err(broken(path))?;
        let averaged = |m: &(gltf::Material, &Material)| m.0.emissive_texture().is_some() && m.1.emits();
        census.averaged_emission = document.materials().zip(&materials).filter(averaged).count();
        census.drawn_solid = document.materials().filter(|m| m.alpha_mode() != AlphaMode::Opaque).count();
        if let Some(material) = materials.iter().find(|material| !material.is_finite()) {
            let found = format!("material \"{}\" has a number that is too large for 32 bits", material.name);
            return Err(Error::file(path, found, "correct the material, and export it again"));
        }
        materials.push(Material { name: "default".into(), ..Material::matte([0.8; 3]) });

        let mut meshes = HashMap::new();
        let nodes: Vec<gltf::Node> = document.nodes().collect();
        for mesh in motion.nodes().filter_map(|node| nodes[node].mesh()) {
            let mut primitives = Vec::new();
            for primitive in mesh.primitives() {
                match Primitive::read(path, &primitive, &buffers, materials.len() - 1)? {
                    Some(primitive) => primitives.push(primitive),
                    None => census.skipped_primitives += 1,
                }
            }
            meshes.insert(mesh.index(), primitives);
        }
        let name = |node: &gltf::Node, fallback: Option<&str>| {
            node.name().or(fallback).map_or_else(|| format!("node_{}", node.index()), str::to_owned)
        };
        let objects = nodes.iter().map(|node| {
            let mesh = node.mesh()?;
            let (name, skin) = (name(node, mesh.name()), node.skin().map(|skin| skin.index()));
            Some(Object { name, mesh: mesh.index(), skin })
        });
        let lamps = nodes.iter().map(|node| {
            let light = node.light()?;
            let intensity = glam::Vec3::from(light.color()) * light.intensity();
            Some(Lamp { name: name(node, light.name()), kind: light.kind(), intensity })
        });
        let lenses = nodes.iter().map(|node| {
            let camera = node.camera()?;
            let gltf::camera::Projection::Perspective(lens) = camera.projection() else { return None };
            Some(Lens { name: name(node, camera.name()), fov_y: lens.yfov() })
        });
        let (objects, lamps, lenses) = (objects.collect(), lamps.collect(), lenses.collect());
        let skins = document.skins().map(|skin| {
            let joints: Vec<usize> = skin.joints().map(|joint| joint.index()).collect();
            let reader = skin.reader(|buffer| buffers.get(buffer.index()).map(|data| &data[..]));
            let given = reader.read_inverse_bind_matrices().into_iter().flatten();
            let mut joint_from_bind: Vec<Mat4> = given.map(|matrix| Mat4::from_cols_array_2d(&matrix)).collect();
            joint_from_bind.resize(joints.len(), Mat4::IDENTITY);
            Skin { joints, joint_from_bind }
        });
        let skins = skins.collect();
        let materials = Arc::new(materials);
        Ok(Self { motion, objects, lamps, lenses, meshes, skins, materials, census })
    }

    pub fn bytes(&self) -> u64 {
        let meshes: u64 = self.meshes.values().flatten().map(Primitive::bytes).sum();
        meshes + self.motion.bytes() + self.materials.iter().map(Material::bytes).sum::<u64>()
    }

    /// Where surfaces are at times spread evenly over what is played; none when they never move. Times at which nothing is
    /// there are left out.
    ///
    /// # Errors
    /// As `scene`; and when that is so at all of them.
    pub fn poses(&self, path: &Path, playing: &Playing, scale: f32) -> Result<Arc<[Geometry]>> {
        if !self.motion.moves_surfaces(playing) {
            return Ok(Arc::new([]));
        }
        let (first, last) = playing.span;
        let pose = |i: usize| {
            let time = first + (last - first) * i as f32 / (POSES - 1) as f32;
            let pose = self.motion.pose(playing, time, scale);
            self.geometry_if_any(path, &pose)
        };
        let there: Vec<Geometry> = (0..POSES).filter_map(|i| pose(i).transpose()).collect::<Result<_>>()?;
        if there.is_empty() {
            let found = "no triangle has an area at any time that was looked at";
            return Err(Error::file(path, found, "export the meshes too, or choose another animation"));
        }
        Ok(there.into())
    }

    /// The scene in a pose. `poses`: of the same surfaces at other times, if they move (`Geometry::poses`). `path` is
    /// what errors speak of.
    ///
    /// # Errors
    /// `File` for surfaces, lights or cameras at places that make no sense.
    pub fn scene(&self, path: &Path, pose: &Pose, poses: Arc<[Geometry]>) -> Result<(Scene, Census)> {
        let mut census = self.census.clone();
        let mut geometry = self.geometry(path, pose, !poses.is_empty(), &mut census)?;
        geometry.poses = poses;
        let (lights, cameras) = self.lights_and_cameras(path, pose)?;
        let (geometry, materials) = (Arc::new(geometry), self.materials.clone());
        Ok((Scene { geometry, materials, lights: Arc::new(lights), cameras: Arc::new(cameras) }, census))
    }
}

/// A file as it is without its animations; lengths are multiplied by `scale`.
///
/// # Errors
/// As `Model::open` and `Model::scene`.
pub fn read(path: &Path, scale: f32) -> Result<(Scene, Census)> {
    let model = Model::open(path)?;
    let pose = model.motion.pose(&Playing::default(), 0.0, scale);
    model.scene(path, &pose, Arc::new([]))
}

/// Files that a .gltf file points to, relative to it; their content belongs to the scene's.
pub fn dependencies(path: &Path) -> Vec<PathBuf> {
    let Some(json) = std::fs::read(path).ok().and_then(|bytes| json_part(&bytes).ok()) else { return vec![] };
    let folder = path.parent().unwrap_or(Path::new(""));
    let lists = ["buffers", "images"].into_iter().filter_map(|list| json.get(list)?.as_array());
    lists
        .flatten()
        .filter_map(|entry| entry.get("uri")?.as_str())
        .filter(|uri| !uri.starts_with("data:"))
        .map(|uri| folder.join(&*String::from_utf8_lossy(&percent_decoded(uri))))
        .collect()
}
