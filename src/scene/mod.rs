//! Scenes at one frame: geometry with its BVH, materials, lights, cameras; where they come from.

pub mod builtin;
pub mod bvh;
pub mod camera;
pub mod change;
pub mod cube;
pub mod environment;
pub mod file;
pub mod geometry;
pub mod lat_long;
mod lat_long_cube;
pub mod light;
pub mod material;
pub mod occluders;
pub mod texture;
pub mod wide;

pub use camera::Camera;
pub use change::Change;
pub use environment::Environment;
pub use geometry::{Fingerprint, Geometry, SurfacePoint};
pub use lat_long::LatLong;
pub use light::{Light, LightKind};
pub use material::Material;
pub use occluders::Occluders;

use std::sync::Arc;

/// Parts are shared separately, because they change for different reasons (`node::Facet`).
#[derive(Clone, Debug, Default)]
pub struct Scene {
    pub geometry: Arc<Geometry>,
    pub materials: Arc<Vec<Material>>,
    pub lights: Arc<Vec<Light>>,
    pub cameras: Arc<Vec<Camera>>,
}

impl Scene {
    pub fn bytes(&self) -> u64 {
        self.geometry.bytes() + self.materials.iter().map(Material::bytes).sum::<u64>()
    }
}
