//! Triangles in world space at one frame, with names and a BVH.
//!
//! For: whatever needs to know where surfaces are. Not for: what they are made of (`Material`) or what lights them.

use crate::device::Array;
use crate::scene::bvh::Bvh;
use crate::{Error, Result};
use glam::{Mat3, Mat4, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// "No such thing" among indices.
pub const NONE: u32 = u32::MAX;

/// A point on a surface, as kernels see it (48 bytes; same layout in WGSL).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SurfacePoint {
    /// Metres, world.
    pub position: [f32; 3],
    /// Index into `Geometry::objects`; `NONE` where there is no surface.
    pub object: u32,
    /// Unit shading normal, on the side that the point belongs to.
    pub normal: [f32; 3],
    /// Index into the scene's materials.
    pub material: u32,
    /// Unit normal of the triangle, on the same side.
    pub geometric_normal: [f32; 3],
    pub triangle: u32,
}

impl SurfacePoint {
    /// Where there is no surface.
    pub const NOWHERE: Self = Self {
        position: [0.0; 3],
        object: NONE,
        normal: [0.0; 3],
        material: NONE,
        geometric_normal: [0.0; 3],
        triangle: NONE,
    };

    pub fn exists(&self) -> bool {
        self.object != NONE
    }
}

/// Tells geometries apart by their content.
pub type Fingerprint = [u8; 16];

/// Unindexed triangles: per-triangle arrays of equal length.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Corner positions, metres.
    pub corners: Array<[[f32; 3]; 3]>,
    /// Unit shading normals at the corners, on the front side (counter-clockwise winding).
    pub normals: Array<[[f32; 3]; 3]>,
    /// Texture coordinates at the corners; zero where the file has none.
    pub uvs: Array<[[f32; 2]; 3]>,
    /// Index into `objects`, per triangle.
    pub object: Array<u32>,
    /// Index into `material_names` and the scene's materials, per triangle.
    pub material: Array<u32>,
    pub objects: Vec<String>,
    pub material_names: Vec<String>,
    pub bvh: Bvh,
    /// A hash of all of the above: what was made for one geometry must not be used with another.
    pub fingerprint: Fingerprint,
    /// Where the same triangles are at some times of their animation, the same for every frame; none when they do not
    /// move. What must not change from frame to frame is found in these (`transport::gather`).
    pub poses: Arc<[Geometry]>,
    bounds: (Vec3, Vec3),
}

impl Geometry {
    pub fn bytes(&self) -> u64 {
        (36 + 36 + 24 + 8) * self.corners.len() as u64 + self.bvh.bytes()
    }

    /// What does not change from frame to frame: the poses, or the geometry itself when it does not move.
    pub fn over_time(&self) -> &[Geometry] {
        if self.poses.is_empty() { std::slice::from_ref(self) } else { &self.poses }
    }

    /// Whether an object is ever elsewhere, or of another shape.
    pub fn moves(&self, object: u32) -> bool {
        let mut of_object = (0..self.object.len()).filter(|triangle| self.object[*triangle] == object);
        let is_still = |triangle: usize| self.poses.iter().all(|pose| pose.corners[triangle] == self.corners[triangle]);
        of_object.any(|triangle| !is_still(triangle))
    }

    /// Twice the area vector of a triangle: direction of its front side.
    pub fn area_vector(&self, triangle: usize) -> Vec3 {
        let [a, b, c] = self.corners[triangle].map(Vec3::from);
        (b - a).cross(c - a)
    }

    /// Has no area at this moment: no ray hits it, and it is not in the BVH.
    pub fn is_flat(&self, triangle: usize) -> bool {
        self.area_vector(triangle).length_squared() <= SMALLEST
    }

    /// Square metres.
    pub fn area(&self, triangle: usize) -> f32 {
        0.5 * self.area_vector(triangle).length()
    }

    /// The point at barycentrics `u`, `v` (weights of the second and third corner), on the front or back side.
    pub fn surface_point(&self, triangle: usize, u: f32, v: f32, front: bool) -> SurfacePoint {
        let w = 1.0 - u - v;
        let mix = |corner: [[f32; 3]; 3]| {
            let [a, b, c] = corner.map(Vec3::from);
            a * w + b * u + c * v
        };
        let side = if front { 1.0 } else { -1.0 };
        let geometric = self.area_vector(triangle).normalize_or_zero() * side;
        let shading = (mix(self.normals[triangle]) * side).normalize_or(geometric);
        SurfacePoint {
            position: mix(self.corners[triangle]).to_array(),
            object: self.object[triangle],
            normal: shading.to_array(),
            material: self.material[triangle],
            geometric_normal: geometric.to_array(),
            triangle: triangle as u32,
        }
    }

    pub fn uv(&self, triangle: usize, u: f32, v: f32) -> [f32; 2] {
        let [a, b, c] = self.uvs[triangle];
        let w = 1.0 - u - v;
        [a[0] * w + b[0] * u + c[0] * v, a[1] * w + b[1] * u + c[1] * v]
    }

    /// How far, at least, a ray's origin is lifted off its surface (see `sampling::lifted`), metres. The same in all
    /// frames, so that rays from what stands still stay the same.
    pub fn lift(&self) -> f32 {
        let (low, high) = self.bounds_over_time();
        1e-6 * (high - low).length()
    }

    /// Lower and upper corner of all triangles.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.bounds
    }

    /// Of all that `over_time` holds.
    pub fn bounds_over_time(&self) -> (Vec3, Vec3) {
        let all = self.over_time().iter().map(|pose| pose.bounds);
        all.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).expect("one pose at least")
    }
}

/// What was left out of a scene, and why; said in the report.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rejected {
    pub zero_area: usize,
}

/// Collects triangles; `finish` checks them and builds the BVH.
#[derive(Default)]
pub struct GeometryBuilder {
    corners: Vec<[[f32; 3]; 3]>,
    normals: Vec<[[f32; 3]; 3]>,
    uvs: Vec<[[f32; 2]; 3]>,
    object: Vec<u32>,
    material: Vec<u32>,
    objects: Vec<String>,
    /// Of `objects`, by name.
    numbers: HashMap<String, u32>,
    pub rejected: Rejected,
    /// Triangles without area keep their numbers; nothing ever hits them.
    keep_all: bool,
}

/// Coordinates beyond this have no meaning in 32 bits; areas and distances of such triangles overflow. Metres.
const FARTHEST: f32 = 1e9;

/// Of twice a triangle's area, squared (m⁴): below, it has none.
const SMALLEST: f32 = 1e-30;

/// One indexed triangle mesh in its own space.
pub struct Mesh<'a> {
    pub positions: &'a [[f32; 3]],
    pub normals: Option<&'a [[f32; 3]]>,
    pub uvs: Option<&'a [[f32; 2]]>,
    pub indices: &'a [u32],
    pub material: u32,
}

impl GeometryBuilder {
    /// For surfaces that move: what has no area now may have some at another time, and must not change the numbers of
    /// other triangles.
    pub fn of_moving() -> Self {
        Self { keep_all: true, ..Self::default() }
    }

    /// The number of the object of that name, new if need be.
    pub fn object(&mut self, name: &str) -> u32 {
        if let Some(&number) = self.numbers.get(name) {
            return number;
        }
        let number = self.objects.len() as u32;
        self.objects.push(name.to_owned());
        self.numbers.insert(name.to_owned(), number);
        number
    }

    pub fn object_name(&self, object: u32) -> &str {
        &self.objects[object as usize]
    }

    /// Adds a mesh. Triangles without area are counted and left out.
    ///
    /// Errors: an index past the vertices, a vertex that is not finite or too far out (both say which).
    pub fn add(&mut self, object: u32, mesh: &Mesh, world_from_mesh: Mat4) -> std::result::Result<(), String> {
        if let Some(index) = mesh.positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(format!("vertex {index} has a position that is not finite: {:?}", mesh.positions[index]));
        }
        let normal_matrix = Mat3::from_mat4(world_from_mesh).inverse().transpose();
        let mirrored = Mat3::from_mat4(world_from_mesh).determinant() < 0.0;
        for triangle in mesh.indices.chunks_exact(3) {
            if let Some(index) = triangle.iter().find(|&&i| i as usize >= mesh.positions.len()) {
                return Err(format!("index {index} is past the last of {} vertices", mesh.positions.len()));
            }
            // A mirroring transform turns the winding round; glTF wants the front to stay the front.
            let [i, j, k] = if mirrored {
                [triangle[0], triangle[2], triangle[1]]
            } else {
                [triangle[0], triangle[1], triangle[2]]
            };
            let index = [i as usize, j as usize, k as usize];
            let corners = index.map(|i| world_from_mesh.transform_point3(Vec3::from(mesh.positions[i])));
            if let Some(far) = (0..3).find(|&i| corners[i].is_nan() || corners[i].abs().max_element() > FARTHEST) {
                let (index, place) = (index[far], corners[far]);
                return Err(format!("vertex {index} lies at {place}, farther out than {FARTHEST:e} m"));
            }
            let area_vector = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let squared = area_vector.length_squared();
            if squared.is_nan() || squared <= SMALLEST {
                self.rejected.zero_area += 1;
                if !self.keep_all {
                    continue;
                }
            }
            let geometric = area_vector.normalize_or_zero();
            let normals = index.map(|i| {
                let normal = mesh.normals.and_then(|n| n.get(i)).map_or(Vec3::ZERO, |n| Vec3::from(*n));
                let world = (normal_matrix * normal).normalize_or(geometric);
                // Authored normals that point through the surface would light it from behind.
                if world.is_finite() && world.dot(geometric) > 0.0 { world } else { geometric }
            });
            self.corners.push(corners.map(|p| p.to_array()));
            self.normals.push(normals.map(|n| n.to_array()));
            self.uvs.push(index.map(|i| mesh.uvs.and_then(|uv| uv.get(i)).copied().unwrap_or_default()));
            self.object.push(object);
            self.material.push(mesh.material);
        }
        Ok(())
    }

    /// Errors: no triangle with an area.
    pub fn finish(self, material_names: Vec<String>) -> Result<Geometry> {
        let area2 = |[a, b, c]: &[[f32; 3]; 3]| {
            let a = Vec3::from(*a);
            (Vec3::from(*b) - a).cross(Vec3::from(*c) - a).length_squared()
        };
        let solid: Vec<u32> =
            (0..self.corners.len() as u32).filter(|i| area2(&self.corners[*i as usize]) > SMALLEST).collect();
        if solid.is_empty() {
            return Err(Error::compute(
                format!("the scene has no triangle with an area ({} without)", self.rejected.zero_area),
                "export the meshes too, or choose another file",
            ));
        }
        let bvh = Bvh::build(&self.corners, &solid);
        let mut hasher = blake3::Hasher::new();
        hasher.update_rayon(bytemuck::cast_slice(&self.corners));
        hasher.update_rayon(bytemuck::cast_slice(&self.normals));
        hasher.update(bytemuck::cast_slice(&self.object));
        hasher.update(bytemuck::cast_slice(&self.material));
        for name in self.objects.iter().chain(&material_names) {
            hasher.update(name.as_bytes()).update(&[0]);
        }
        let fingerprint = hasher.finalize().as_bytes()[..16].try_into().expect("16 of 32 bytes");
        let nothing = (Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY));
        let corners = self.corners.iter().flatten().map(|p| Vec3::from(*p));
        let bounds = corners.fold(nothing, |(low, high), p| (low.min(p), high.max(p)));
        Ok(Geometry {
            corners: self.corners.into(),
            normals: self.normals.into(),
            uvs: self.uvs.into(),
            object: self.object.into(),
            material: self.material.into(),
            objects: self.objects,
            fingerprint,
            material_names,
            bvh,
            poses: Arc::new([]),
            bounds,
        })
    }
}
