//! How open the space above surface points is: the harmonic mean of the distances to the geometry around (Ward et al.
//! 1988; thesis 4.4.5), over which indirect light changes about as much as it can.
//!
//! `1 / R = (1/rays) sum_r 1 / d_r` over cosine-distributed rays: a surface counts by what it may add to the irradiance, as
//! in Ward's estimate of its rate of change and in `transfer_rows`. Without the cosine, directions within 30 degrees of the
//! surface, a quarter of the irradiance, would make up half of the mean. A ray that meets nothing adds 0; where none meets anything, `R` is infinite.
//! All points use one pattern of rays, so that neighbours differ by where they lie and not by chance.

use super::RAY_SHADERS;
use super::transfer_rows::unit_ray;
#[cfg(feature = "gpu")]
use super::{RAYS, fits_the_shader, pages};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::scene::bvh::{Facet, Node};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::sampling;
use glam::Vec2;
use rayon::prelude::*;

uniform! {
    struct Params {
        points: u32,
        /// Rays a point.
        rays: u32,
        lift: f32,
        pad0: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "surroundings",
    shared: RAY_SHADERS,
    source: include_str!("../../shaders/surroundings.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Node>("nodes"),
        Binding::read::<Facet>("facets"),
        Binding::read::<SurfacePoint>("points"),
        Binding::write::<f32>("distances"),
    ],
};

/// Metres, per point; infinite where no ray meets anything, and where there is no surface.
pub fn surroundings(device: &Device, geometry: &Geometry, points: &[SurfacePoint], rays: u32) -> Result<Vec<f32>> {
    let params = Params { points: points.len() as u32, rays, lift: geometry.lift(), pad0: 0 };
    match device {
        Device::Cpu => Ok(points.par_iter().map(|point| cpu(geometry, point, &params)).collect()),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, geometry, points, &params),
    }
}

fn cpu(geometry: &Geometry, point: &SurfacePoint, params: &Params) -> f32 {
    if !point.exists() {
        return f32::INFINITY;
    }
    // About the triangle's own normal: no ray starts below it.
    let flat = SurfacePoint { normal: point.geometric_normal, ..*point };
    let inverse = |i: u32| {
        let ray = unit_ray(&flat, sampling::lattice(i, params.rays, Vec2::ZERO), params.lift);
        1.0 / geometry.bvh.closest(&ray).t
    };
    params.rays as f32 / (0..params.rays).map(inverse).sum::<f32>()
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, geometry: &Geometry, points: &[SurfacePoint], params: &Params) -> Result<Vec<f32>> {
    fits_the_shader(geometry)?;
    let mut found = Vec::with_capacity(points.len());
    for range in pages(points.len(), gpu.page(48).min((RAYS / params.rays.max(1) as usize).max(1))) {
        let params = Params { points: range.len() as u32, ..*params };
        let distances = gpu.storage::<f32>(range.len());
        let buffers = [
            &gpu.whole(&geometry.bvh.nodes),
            &gpu.whole(&geometry.bvh.facets),
            &gpu.upload(&points[range.clone()]),
            &distances,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len())?;
        let [distances] = batch.read([&distances])?;
        // Infinity does not exist in WGSL; 3e38 stands for it.
        found.extend(distances.get::<f32>().iter().map(|&x| if x < 3e38 { x } else { f32::INFINITY }));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::geometry::{GeometryBuilder, Mesh};
    use glam::{Mat4, Vec3};

    /// A floor of 200 m with what is put onto it.
    fn floor(more: &[[Vec3; 4]]) -> Geometry {
        let mut builder = GeometryBuilder::default();
        let v = Vec3::new;
        let ground = [v(-100.0, 0.0, 100.0), v(100.0, 0.0, 100.0), v(100.0, 0.0, -100.0), v(-100.0, 0.0, -100.0)];
        for corners in [ground].iter().chain(more) {
            let positions = corners.map(|corner| corner.to_array());
            let object = builder.object("surface");
            let indices = [0, 1, 2, 0, 2, 3];
            let mesh = Mesh { positions: &positions, normals: None, uvs: None, indices: &indices, material: 0 };
            builder.add(object, &mesh, Mat4::IDENTITY).unwrap();
        }
        builder.finish(vec!["matte".to_owned()]).unwrap()
    }

    fn at(geometry: &Geometry, x: f32) -> f32 {
        let point = SurfacePoint { position: [x, 0.0, 0.0], ..geometry.surface_point(0, 0.3, 0.3, true) };
        surroundings(&Device::Cpu, geometry, &[point], 4096).unwrap()[0]
    }

    #[test]
    fn nothing_around_is_infinitely_far() {
        assert_eq!(at(&floor(&[]), 0.0), f32::INFINITY);
        let nowhere = surroundings(&Device::Cpu, &floor(&[]), &[SurfacePoint::NOWHERE], 16).unwrap();
        assert_eq!(nowhere, [f32::INFINITY]);
    }

    /// Under a wide ceiling at height h a ray at angle a goes h / cos a, and the mean of cos a by cos a / pi is 2/3: 1.5 h.
    #[test]
    fn a_ceiling_by_hand() {
        let (v, h) = (Vec3::new, 2.0);
        let ceiling = [v(-100.0, h, -100.0), v(100.0, h, -100.0), v(100.0, h, 100.0), v(-100.0, h, 100.0)];
        let distance = at(&floor(&[ceiling]), 0.0);
        assert!((distance - 1.5 * h).abs() < 0.01, "{distance}");
    }

    /// Before an endless wall at distance x, 1 / d = sin a cos b / x for half of all azimuths b:
    /// (1/pi) int_0^(pi/2) sin² a cos a da int cos b db / x = (1/pi) (1/3) 2 / x, so R = (3/2) pi x.
    #[test]
    fn a_wall_by_hand() {
        let v = Vec3::new;
        let wall = [v(0.0, 0.0, -900.0), v(0.0, 0.0, 900.0), v(0.0, 900.0, 900.0), v(0.0, 900.0, -900.0)];
        let geometry = floor(&[wall]);
        for x in [0.1, 0.5, 2.0] {
            let distance = at(&geometry, x);
            assert!((distance / (1.5 * std::f32::consts::PI * x) - 1.0).abs() < 0.01, "{distance} at {x}");
        }
    }
}
