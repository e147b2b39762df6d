//! glTF 2.0 files (.gltf, .glb) into scenes: triangles, base colours, metalness and roughness with their textures,
//! emission, punctual lights, cameras.
//!
//! Read in part: emissive textures (their mean), roughness textures (their mean), alpha (all is solid; counted).
//! Not read: normal and occlusion textures, other material extensions, orthographic cameras, Draco and meshopt compression (refused with a message), animation and skins (bind pose), point and line
//! primitives (counted).

use crate::scene::file_material::{Pictures, uv_set};
use crate::scene::geometry::{GeometryBuilder, Mesh};
use crate::scene::sound::{check_accessors, check_json, json_part, percent_decoded};
use crate::scene::{Camera, Light, LightKind, Material, Scene};
use crate::{Error, Result};
use glam::{Mat3, Mat4, Vec3};
use gltf::khr_lights_punctual::Kind;
use gltf::material::AlphaMode;
use gltf::mesh::Mode;
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
}

/// Reads a scene; lengths are multiplied by `scale`.
///
/// Errors: `Error::File` for a missing, truncated or invalid file, an extension that is required and not read, a
/// vertex or index that makes no sense.
pub fn read(path: &Path, scale: f32) -> Result<(Scene, Census)> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e.to_string(), "check the path in the recipe"))?;
    let export_again = "export it again as glTF 2.0";
    // The importer skips text that it does not know; what cannot be read in full cannot be checked either.
    check_json(path, &json_part(&bytes).map_err(|what| Error::file(path, what, export_again))?)?;
    let broken = |e: gltf::Error| Error::file(path, format!("is not a readable glTF file: {e}"), export_again);
    let gltf = gltf::Gltf::from_slice(&bytes).map_err(broken)?;
    let (document, blob) = (gltf.document, gltf.blob);
    let base = path.parent();
    let buffers = gltf::import_buffers(&document, base, blob).map_err(broken)?;
    check_accessors(path, &document, &buffers)?;

    let mut reader = Reader {
        path,
        materials: document.materials().len(),
        visited: vec![false; document.nodes().len()],
        buffers: &buffers,
        builder: GeometryBuilder::default(),
        lights: vec![],
        cameras: vec![],
        census: Census::default(),
    };
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let roots: Vec<gltf::Node> = match scene {
        Some(scene) => scene.nodes().collect(),
        None => document.nodes().collect(),
    };
    let world = Mat4::from_scale(Vec3::splat(scale));
    for root in roots {
        reader.node(&root, world, 0)?;
    }
    let mut pictures = Pictures::new(base, &buffers);
    let mut materials: Vec<Material> =
        document.materials().map(|m| pictures.material(&m)).collect::<gltf::Result<_>>().map_err(broken)?;
    let averaged = |m: &(gltf::Material, &Material)| m.0.emissive_texture().is_some() && m.1.emits();
    reader.census.averaged_emission = document.materials().zip(&materials).filter(averaged).count();
    reader.census.drawn_solid = document.materials().filter(|m| m.alpha_mode() != AlphaMode::Opaque).count();
    if let Some(material) = materials.iter().find(|material| !material.is_finite()) {
        let found = format!("material \"{}\" has a number that is too large for 32 bits", material.name);
        return Err(Error::file(path, found, "correct the material, and export it again"));
    }
    materials.push(Material { name: "default".into(), ..Material::matte([0.8; 3]) });
    let names = materials.iter().map(|m| m.name.clone()).collect();
    let Reader { builder, lights, cameras, mut census, .. } = reader;
    census.zero_area = builder.rejected.zero_area;
    let geometry = builder.finish(names).map_err(|e| Error::file(path, e.to_string(), e.help()))?;
    census.triangles = geometry.corners.len();
    let scene = Scene {
        geometry: Arc::new(geometry),
        materials: Arc::new(materials),
        lights: Arc::new(lights),
        cameras: Arc::new(cameras),
    };
    Ok((scene, census))
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

/// Nodes are read by recursion.
const DEEPEST: usize = 512;

struct Reader<'a> {
    path: &'a Path,
    /// Materials of the file.
    materials: usize,
    /// Nodes that have been met: each has one parent at most.
    visited: Vec<bool>,
    buffers: &'a [gltf::buffer::Data],
    builder: GeometryBuilder,
    lights: Vec<Light>,
    cameras: Vec<Camera>,
    census: Census,
}

impl Reader<'_> {
    fn node(&mut self, node: &gltf::Node, parent: Mat4, depth: usize) -> Result<()> {
        if depth > DEEPEST {
            let found = format!("nodes are nested more than {DEEPEST} deep");
            return Err(Error::file(self.path, found, "flatten the scene, and export it again"));
        }
        if std::mem::replace(&mut self.visited[node.index()], true) {
            let found = format!("node {} is reached twice: nodes must form trees", node.index());
            return Err(Error::file(self.path, found, "export it again as glTF 2.0"));
        }
        let world = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        let name = |fallback: Option<&str>| {
            node.name().or(fallback).map_or_else(|| format!("node_{}", node.index()), str::to_owned)
        };
        if let Some(mesh) = node.mesh() {
            let object = self.builder.object(&name(mesh.name()));
            for primitive in mesh.primitives() {
                self.primitive(object, &primitive, world)?;
            }
        }
        let basis = Mat3::from_mat4(world);
        let position = world.w_axis.truncate();
        let axis = |v: Vec3, instead: Vec3| (basis * v).normalize_or(instead);
        if let Some(camera) = node.camera()
            && let gltf::camera::Projection::Perspective(lens) = camera.projection()
        {
            let columns = Mat3::from_cols(axis(Vec3::X, Vec3::X), axis(Vec3::Y, Vec3::Y), axis(Vec3::Z, Vec3::Z));
            let (name, fov_y) = (name(camera.name()), lens.yfov());
            if !(0.0..std::f32::consts::PI).contains(&fov_y) || fov_y == 0.0 || !position.is_finite() {
                let found = format!("camera \"{name}\" cannot see: field of view {fov_y} rad, at {position}");
                return Err(Error::file(self.path, found, "correct the camera, and export it again"));
            }
            self.cameras.push(Camera { name, position, world_from_camera: columns, fov_y });
        }
        if let Some(light) = node.light() {
            let direction = axis(Vec3::NEG_Z, Vec3::NEG_Y);
            let kind = match light.kind() {
                Kind::Point => LightKind::Point { position },
                Kind::Directional => LightKind::Directional { direction },
                Kind::Spot { inner_cone_angle: inner, outer_cone_angle: outer } => {
                    LightKind::Spot { position, direction, inner, outer }
                }
            };
            let (name, intensity) = (name(light.name()), Vec3::from(light.color()) * light.intensity());
            if !intensity.is_finite() || intensity.min_element() < 0.0 || !position.is_finite() {
                let found = format!("light \"{name}\" cannot shine: intensity {intensity}, at {position}");
                return Err(Error::file(self.path, found, "correct the light, and export it again"));
            }
            self.lights.push(Light { name, kind, intensity });
        }
        node.children().try_for_each(|child| self.node(&child, world, depth + 1))
    }

    fn primitive(&mut self, object: u32, primitive: &gltf::Primitive, world: Mat4) -> Result<()> {
        let reader = primitive.reader(|buffer| self.buffers.get(buffer.index()).map(|data| &data[..]));
        let positions: Vec<[f32; 3]> = reader.read_positions().into_iter().flatten().collect();
        let indices: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..positions.len() as u32).collect(),
        };
        let indices = match primitive.mode() {
            Mode::Triangles => indices,
            Mode::TriangleStrip => strip(&indices),
            Mode::TriangleFan => indices.windows(2).skip(1).flat_map(|pair| [indices[0], pair[0], pair[1]]).collect(),
            _ => {
                self.census.skipped_primitives += 1;
                return Ok(());
            }
        };
        let normals: Option<Vec<[f32; 3]>> = reader.read_normals().map(Iterator::collect);
        let material = primitive.material();
        let uvs: Option<Vec<[f32; 2]>> = reader.read_tex_coords(uv_set(&material)).map(|uvs| uvs.into_f32().collect());
        // The file's default material has no index; ours stands behind the file's own.
        let material = material.index().unwrap_or(self.materials) as u32;
        let mesh = Mesh {
            positions: &positions,
            normals: normals.as_deref(),
            uvs: uvs.as_deref(),
            indices: &indices,
            material,
        };
        self.builder.add(object, &mesh, world).map_err(|what| {
            let found = format!("mesh of object \"{}\": {what}", self.builder.object_name(object));
            Error::file(self.path, found, "repair the mesh in the program it came from, and export it again")
        })
    }
}

fn strip(indices: &[u32]) -> Vec<u32> {
    let turned = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
    indices.windows(3).enumerate().flat_map(turned).collect()
}
