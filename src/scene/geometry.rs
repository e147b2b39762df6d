//! Triangles in world space, with names and a BVH.

use crate::device::Array;

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

#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Three corners a triangle, unindexed.
    pub triangles: Array<[[f32; 3]; 3]>,
    pub objects: Vec<String>,
    pub material_names: Vec<String>,
}

impl Geometry {
    pub fn bytes(&self) -> u64 {
        36 * self.triangles.len() as u64
    }
}
