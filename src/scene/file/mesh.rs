//! One primitive of a glTF mesh as the file has it, and as morph targets and joints bend it (glTF 2.0, section 3.7).

use super::material::uv_set;
use crate::{Error, Result};
use glam::{Mat3, Mat4, Vec3};
use gltf::mesh::Mode;
use rayon::prelude::*;
use std::path::Path;

#[derive(Clone, Debug, Default)]
pub(super) struct Primitive {
    positions: Vec<[f32; 3]>,
    normals: Option<Vec<[f32; 3]>>,
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Three a triangle.
    pub indices: Vec<u32>,
    pub material: u32,
    targets: Vec<Target>,
    influences: Vec<Influence>,
}

/// Four joints of each vertex, and their weights.
type Influence = (Vec<[u16; 4]>, Vec<[f32; 4]>);

/// What a morph target adds at its weight of 1.
#[derive(Clone, Debug, Default)]
struct Target {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

/// Positions and normals of a primitive at a moment.
pub(super) type Bent = (Vec<[f32; 3]>, Option<Vec<[f32; 3]>>);

impl Primitive {
    /// `None` for points and lines. `default_material`: the number of the material that stands for none.
    ///
    /// Errors: `Error::File` for joints without weights, or as many of them as there are no vertices.
    pub fn read(
        path: &Path,
        primitive: &gltf::Primitive,
        buffers: &[gltf::buffer::Data],
        default_material: usize,
    ) -> Result<Option<Self>> {
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|data| &data[..]));
        let positions: Vec<[f32; 3]> = reader.read_positions().into_iter().flatten().collect();
        let indices: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..positions.len() as u32).collect(),
        };
        let indices = match primitive.mode() {
            Mode::Triangles => indices,
            Mode::TriangleStrip => strip(&indices),
            Mode::TriangleFan => indices.windows(2).skip(1).flat_map(|pair| [indices[0], pair[0], pair[1]]).collect(),
            _ => return Ok(None),
        };
        let material = primitive.material();
        let all = |values: Option<&mut dyn Iterator<Item = [f32; 3]>>| values.into_iter().flatten().collect::<Vec<_>>();
        let targets = reader.read_morph_targets().map(|(mut positions, mut normals, _)| Target {
            positions: all(positions.as_mut().map(|values| values as _)),
            normals: all(normals.as_mut().map(|values| values as _)),
        });
        let targets = targets.collect();
        let mut influences = Vec::new();
        while let Some(joints) = reader.read_joints(influences.len() as u32) {
            let joints: Vec<[u16; 4]> = joints.into_u16().collect();
            let weights = reader.read_weights(influences.len() as u32);
            let weights: Vec<[f32; 4]> = weights.map_or_else(Vec::new, |weights| weights.into_f32().collect());
            if joints.len() != positions.len() || weights.len() != positions.len() {
                let (joints, weights, count) = (joints.len(), weights.len(), positions.len());
                let found = format!("a mesh of {count} vertices has {joints} sets of joints and {weights} of weights");
                return Err(Error::file(path, found, "the file is damaged; export it again"));
            }
            influences.push((joints, weights));
        }
        Ok(Some(Self {
            normals: reader.read_normals().map(Iterator::collect),
            uvs: reader.read_tex_coords(uv_set(&material)).map(|uvs| uvs.into_f32().collect()),
            // The file's default material has no index; ours stands behind the file's own.
            material: material.index().unwrap_or(default_material) as u32,
            positions,
            indices,
            targets,
            influences,
        }))
    }

    /// Joints say where its vertices are.
    pub fn is_skinned(&self) -> bool {
        !self.influences.is_empty()
    }

    pub fn bytes(&self) -> u64 {
        let targets: usize = self.targets.iter().map(|target| target.positions.len() + target.normals.len()).sum();
        (self.positions.len() * (32 + 24 * self.influences.len()) + 12 * targets + 4 * self.indices.len()) as u64
    }

    /// In the space of the mesh with these morph weights; in the world when there are joints to follow
    /// (`world_from_bind`, one a joint of the skin).
    ///
    /// Errors: a vertex follows a joint that the skin does not have.
    pub fn bent(&self, weights: &[f32], world_from_bind: Option<&[Mat4]>) -> std::result::Result<Bent, String> {
        let (mut positions, mut normals) = (self.positions.clone(), self.normals.clone());
        for (target, &weight) in self.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            add(&mut positions, &target.positions, weight);
            if let Some(normals) = &mut normals {
                add(normals, &target.normals, weight);
            }
        }
        let Some(joints) = world_from_bind.filter(|_| self.is_skinned()) else {
            return Ok((positions, normals));
        };
        let blend = |vertex: usize| {
            let each =
                self.influences.iter().flat_map(|(joints, weights)| joints[vertex].into_iter().zip(weights[vertex]));
            let (mut sum, mut total) = (Mat4::ZERO, 0.0);
            for (joint, weight) in each.filter(|(_, weight)| *weight != 0.0) {
                let count = joints.len();
                let joint = joints
                    .get(joint as usize)
                    .ok_or_else(|| format!("vertex {vertex} follows joint {joint} of {count}"))?;
                sum += *joint * weight;
                total += weight;
            }
            // Weights are rounded in files; a vertex without any follows the first joint.
            Ok(if total > 0.0 { sum * (1.0 / total) } else { joints.first().copied().unwrap_or(Mat4::IDENTITY) })
        };
        let blended: Vec<Mat4> =
            (0..positions.len()).into_par_iter().map(blend).collect::<std::result::Result<_, String>>()?;
        for (position, world) in positions.iter_mut().zip(&blended) {
            *position = world.transform_point3((*position).into()).to_array();
        }
        for (normal, world) in normals.iter_mut().flatten().zip(&blended) {
            let turned = Mat3::from_mat4(*world).inverse().transpose() * Vec3::from(*normal);
            *normal = turned.normalize_or_zero().to_array();
        }
        Ok((positions, normals))
    }
}

fn add(values: &mut [[f32; 3]], more: &[[f32; 3]], weight: f32) {
    for (value, more) in values.iter_mut().zip(more) {
        *value = (Vec3::from(*value) + Vec3::from(*more) * weight).to_array();
    }
}

fn strip(indices: &[u32]) -> Vec<u32> {
    let turned = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
    indices.windows(3).enumerate().flat_map(turned).collect()
}
