//! What a file holds, put where a pose has it.

use super::{Census, Model, Pose};
use crate::scene::geometry::{GeometryBuilder, Mesh};
use crate::scene::{Camera, Geometry, Light, LightKind};
use crate::{Error, Result};
use glam::{Mat3, Mat4, Vec3};
use gltf::khr_lights_punctual::Kind;
use std::path::Path;

impl Model {
    /// `moves`: at some other time they are elsewhere.
    ///
    /// # Errors
    /// `File` for a vertex or an index that makes no sense, or when no triangle has an area.
    pub fn geometry(&self, path: &Path, pose: &Pose, moves: bool, census: &mut Census) -> Result<Geometry> {
        let (builder, names) = self.collected(path, pose, moves)?;
        census.zero_area = builder.rejected.zero_area;
        let geometry = builder.finish(names).map_err(|e| Error::file(path, e.to_string(), e.help()))?;
        census.triangles = geometry.corners.len();
        Ok(geometry)
    }

    /// As `geometry`; `None` when no triangle has an area.
    ///
    /// # Errors
    /// `File` for a vertex or an index that makes no sense.
    pub(super) fn geometry_if_any(&self, path: &Path, pose: &Pose) -> Result<Option<Geometry>> {
        let (builder, names) = self.collected(path, pose, true)?;
        Ok(builder.finish(names).ok())
    }

    /// All triangles, and the names of materials.
    fn collected(&self, path: &Path, pose: &Pose, moves: bool) -> Result<(GeometryBuilder, Vec<String>)> {
        let mut builder = if moves { GeometryBuilder::of_moving() } else { GeometryBuilder::default() };
        for node in self.motion.nodes() {
            let Some(object) = &self.objects[node] else { continue };
            let number = builder.object(&object.name);
            let joints: Option<Vec<Mat4>> = object.skin.map(|skin| {
                let skin = &self.skins[skin];
                let pairs = skin.joints.iter().zip(&skin.joint_from_bind);
                pairs.map(|(joint, joint_from_bind)| pose.world_from_node[*joint] * *joint_from_bind).collect()
            });
            for primitive in &self.meshes[&object.mesh] {
                let damaged = |what: String| {
                    let found = format!("mesh of object \"{}\": {what}", object.name);
                    Error::file(path, found, "repair the mesh in the program it came from, and export it again")
                };
                let (positions, normals) = primitive.bent(&pose.weights[node], joints.as_deref()).map_err(damaged)?;
                let mesh = Mesh {
                    positions: &positions,
                    normals: normals.as_deref(),
                    uvs: primitive.uvs.as_deref(),
                    indices: &primitive.indices,
                    material: primitive.material,
                };
                // Joints carry vertices to the world without the node's help.
                let world = if primitive.is_skinned() && joints.is_some() {
                    Mat4::IDENTITY
                } else {
                    pose.world_from_node[node]
                };
                builder.add(number, &mesh, world).map_err(damaged)?;
            }
        }
        Ok((builder, self.materials.iter().map(|m| m.name.clone()).collect()))
    }

    pub(super) fn lights_and_cameras(&self, path: &Path, pose: &Pose) -> Result<(Vec<Light>, Vec<Camera>)> {
        let (mut lights, mut cameras) = (Vec::new(), Vec::new());
        for node in self.motion.nodes() {
            let world = pose.world_from_node[node];
            let basis = Mat3::from_mat4(world);
            let position = world.w_axis.truncate();
            let axis = |v: Vec3, instead: Vec3| (basis * v).normalize_or(instead);
            if let Some(lens) = &self.lenses[node] {
                let columns = Mat3::from_cols(axis(Vec3::X, Vec3::X), axis(Vec3::Y, Vec3::Y), axis(Vec3::Z, Vec3::Z));
                let (name, fov_y) = (lens.name.clone(), lens.fov_y);
                if !(0.0..std::f32::consts::PI).contains(&fov_y) || fov_y == 0.0 || !position.is_finite() {
                    let found = format!("camera \"{name}\" cannot see: field of view {fov_y} rad, at {position}");
                    return Err(Error::file(path, found, "correct the camera, and export it again"));
                }
                cameras.push(Camera { name, position, world_from_camera: columns, fov_y });
            }
            if let Some(lamp) = &self.lamps[node] {
                let direction = axis(Vec3::NEG_Z, Vec3::NEG_Y);
                let kind = match lamp.kind {
                    Kind::Point => LightKind::Point { position },
                    Kind::Directional => LightKind::Directional { direction },
                    Kind::Spot { inner_cone_angle: inner, outer_cone_angle: outer } => {
                        LightKind::Spot { position, direction, inner, outer }
                    }
                };
                let (name, intensity) = (lamp.name.clone(), lamp.intensity);
                if !intensity.is_finite() || intensity.min_element() < 0.0 || !position.is_finite() {
                    let found = format!("light \"{name}\" cannot shine: intensity {intensity}, at {position}");
                    return Err(Error::file(path, found, "correct the light, and export it again"));
                }
                lights.push(Light { name, kind, intensity });
            }
        }
        Ok((lights, cameras))
    }
}
