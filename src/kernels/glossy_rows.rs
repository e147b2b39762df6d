//! Rays of glossy rows: from each place, directions drawn from the lobe that reflects light to the eye, each credited to a
//! node of the gather tree by the rule of `transfer_rows` (thesis 5.3: the last bounce may be glossy).
//!
//! The lobe is a microfacet BRDF `F D G / (4 cos cos)` (Cook and Torrance 1982) about the shading normal, of width
//! `alpha` = roughness². With Schlick's Fresnel (1994) `F = F0 (1 - p) + p`, `p = (1 - eye.half)^5`, the radiance towards
//! the eye is `F0 sum weight B + sum fresnel B` for exitance B, whatever the colour of F0: a ray's two weights carry
//! `1 - p` and `p`, and the 1/pi from exitance to radiance.
//! GGX (Walter et al. 2007) with height-correlated Smith masking (Heitz 2014), the lobe of `direct_light`; half vectors
//! are drawn from those that the eye sees (Heitz 2018, by the spherical caps of Dupuy and Benyoub 2023), which leaves
//! the weight G2 / G1. Blinn-Phong (Blinn 1977) with exponent `2 / alpha² - 2`, normalised, with the masking of V-shaped
//! grooves (Torrance and Sparrow 1967); half vectors are drawn by D cos, which leaves a weight below 2.
//! Output: rows x rays shares, and distances as in `transfer_rows`.

use super::CREDIT_SHADERS;
use super::shared::credit;
#[cfg(feature = "gpu")]
use super::{RAYS, fits_the_shader, pages};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::scene::bvh::{Facet, Hit, Node, Ray};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::gather::Gather;
use crate::transport::sampling;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, PI, TAU};

uniform! {
    struct Params {
        eye: [f32; 3],
        lift: f32,
        rows: u32,
        /// Rays a row.
        rays: u32,
        /// Gather samples.
        gather: u32,
        /// Largest node radius squared over that of a ray's patch.
        credit: f32,
        /// Distance between gather samples, metres.
        spacing: f32,
        alpha: f32,
        /// 0: GGX, 1: Blinn-Phong.
        model: u32,
        pad0: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "glossy_rows",
    shared: CREDIT_SHADERS,
    source: include_str!("../../shaders/glossy_rows.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Node>("nodes"),
        Binding::read::<Facet>("facets"),
        Binding::read::<SurfacePoint>("points"),
        Binding::read::<u32>("seeds"),
        Binding::read::<SurfacePoint>("samples"),
        Binding::read::<[u32; 4]>("sides"),
        Binding::read::<u32>("cells"),
        Binding::read::<f32>("radius2"),
        Binding::write::<Share>("shares"),
        Binding::write::<[f32; 2]>("distances"),
    ],
};

/// What one ray credits.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Share {
    /// 0 for none.
    pub node: u32,
    /// Radiance to the eye per exitance of the node: the part that F0 multiplies.
    pub weight: f32,
    /// And the part that has no colour.
    pub fresnel: f32,
}

/// The lobe of all places of a call.
#[derive(Clone, Copy, Debug)]
pub struct Lobe {
    pub eye: Vec3,
    /// Roughness squared, (0, 1].
    pub alpha: f32,
    /// Blinn-Phong instead of GGX.
    pub blinn: bool,
    /// Rays a place, and the credit rule of `transfer_rows`.
    pub rays: u32,
    pub credit: f32,
}

pub struct GlossyRays {
    /// Rows x rays.
    pub shares: Vec<Share>,
    /// Per row: harmonic mean distance and least distance, metres (infinite when nothing is hit).
    pub distances: Vec<[f32; 2]>,
}

/// `seeds`: one per point, so that a row is the same whatever else is computed with it.
pub fn glossy_rows(
    device: &Device,
    geometry: &Geometry,
    gather: &Gather,
    points: &Array<SurfacePoint>,
    seeds: &Array<u32>,
    lobe: &Lobe,
) -> Result<GlossyRays> {
    let params = Params {
        eye: lobe.eye.to_array(),
        lift: geometry.lift(),
        rows: points.len() as u32,
        rays: lobe.rays,
        gather: gather.count() as u32,
        credit: lobe.credit,
        spacing: gather.spacing(),
        alpha: lobe.alpha,
        model: lobe.blinn.into(),
        pad0: 0,
    };
    match device {
        Device::Cpu => Ok(cpu(geometry, gather, points, seeds, &params)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, geometry, gather, points, seeds, &params),
    }
}

fn cpu(geometry: &Geometry, gather: &Gather, points: &[SurfacePoint], seeds: &[u32], params: &Params) -> GlossyRays {
    let rays = params.rays as usize;
    let mut shares = vec![Share::default(); points.len() * rays];
    let mut distances = vec![[f32::INFINITY; 2]; points.len()];
    let rows = shares.par_chunks_mut(rays).zip(&mut distances).zip(points.par_iter().zip(seeds));
    rows.for_each(|((shares, distances), (point, &seed))| {
        if !point.exists() {
            return;
        }
        let view = View::new(point, params.eye.into(), params.lift);
        let (mut inverse_sum, mut least) = (0.0, f32::INFINITY);
        for (i, share) in shares.iter_mut().enumerate() {
            let (found, distance) = follow(geometry, gather, point, &view, i as u32, seed, params);
            *share = found;
            inverse_sum += 1.0 / distance;
            least = least.min(distance);
        }
        *distances = [params.rays as f32 / inverse_sum, least];
    });
    GlossyRays { shares, distances }
}

#[cfg(feature = "gpu")]
fn gpu(
    gpu: &Gpu,
    geometry: &Geometry,
    gather: &Gather,
    points: &Array<SurfacePoint>,
    seeds: &Array<u32>,
    params: &Params,
) -> Result<GlossyRays> {
    fits_the_shader(geometry)?;
    let rays = params.rays as usize;
    let mut found =
        GlossyRays { shares: Vec::with_capacity(points.len() * rays), distances: Vec::with_capacity(points.len()) };
    let page = gpu.page(size_of::<Share>() * rays.max(4)).min((RAYS / rays.max(1)).max(1));
    for range in pages(points.len(), page) {
        let params = Params { rows: range.len() as u32, ..*params };
        let shares = gpu.storage::<Share>(range.len() * rays);
        let distances = gpu.storage::<[f32; 2]>(range.len());
        let buffers = [
            &gpu.whole(&geometry.bvh.nodes),
            &gpu.whole(&geometry.bvh.facets),
            &gpu.upload(&points[range.clone()]),
            &gpu.upload(&seeds[range.clone()]),
            &gpu.whole(&gather.points),
            &gpu.whole(&gather.sides),
            &gpu.whole(&gather.cells),
            &gpu.whole(&gather.radius2),
            &shares,
            &distances,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len())?;
        // Infinity does not exist in WGSL; 3e38 stands for it.
        let finite = |x: f32| if x < 3e38 { x } else { f32::INFINITY };
        let [shares, distances] = batch.read([&shares, &distances])?;
        found.shares.extend_from_slice(shares.get());
        found.distances.extend(distances.get::<[f32; 2]>().iter().map(|pair| pair.map(finite)));
    }
    Ok(found)
}

/// A place as its lobe sees it.
pub(crate) struct View {
    origin: Vec3,
    /// A frame about the normal, and the eye in it.
    x: Vec3,
    y: Vec3,
    normal: Vec3,
    eye: Vec3,
}

impl View {
    /// `lift`: as `Geometry::lift`.
    pub fn new(point: &SurfacePoint, eye: Vec3, lift: f32) -> Self {
        let origin = sampling::lifted(point.position.into(), point.geometric_normal.into(), lift);
        let eye = (eye - origin).normalize_or(point.normal.into());
        let mut normal = Vec3::from(point.normal);
        // Interpolated normals may turn away from an eye that sees the surface: bent until they just face it.
        let facing = normal.dot(eye);
        if facing < 0.01 {
            normal = (normal + eye * (0.01 - facing)).normalize_or(eye);
        }
        let (x, y) = sampling::frame(normal);
        Self { origin, x, y, normal, eye: Vec3::new(x.dot(eye), y.dot(eye), normal.dot(eye)) }
    }
}

impl View {
    /// A ray drawn from a lobe of GGX, and what it counts: the part that F0 multiplies and the part that has no colour, of
    /// the BRDF times cosine over density.
    pub fn reflected(&self, point: &SurfacePoint, alpha: f32, at: Vec2) -> Option<(Ray, [f32; 2])> {
        let drawn = ggx(self.eye, alpha, at);
        let ray = self.ray(point, &drawn)?;
        Some((ray, [drawn.weight * (1.0 - drawn.grazing), drawn.weight * drawn.grazing]))
    }

    fn ray(&self, point: &SurfacePoint, drawn: &Drawn) -> Option<Ray> {
        // Written so that NaN is nothing, too.
        if !(drawn.light.z > 0.0 && drawn.weight > 0.0) {
            return None;
        }
        let mut direction = self.x * drawn.light.x + self.y * drawn.light.y + self.normal * drawn.light.z;
        // Interpolated normals tilt some rays below the triangle itself: mirrored up, they keep the lobe's energy.
        let geometric = Vec3::from(point.geometric_normal);
        direction -= geometric * (2.0 * direction.dot(geometric).min(0.0));
        Some(Ray { origin: self.origin, direction, t_max: f32::INFINITY })
    }
}

/// A direction drawn from a lobe.
struct Drawn {
    /// In the frame of the lobe.
    light: Vec3,
    /// BRDF cos over density, but for the Fresnel term; 0 below the horizon.
    weight: f32,
    /// Fresnel's `p`.
    grazing: f32,
    /// Per solid angle.
    density: f32,
}

fn ggx(eye: Vec3, alpha: f32, at: Vec2) -> Drawn {
    // The caps: a sphere cut at the height of the stretched eye.
    let stretched = Vec3::new(alpha * eye.x, alpha * eye.y, eye.z).normalize();
    let z = (1.0 - at.x) * (1.0 + stretched.z) - stretched.z;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * at.y).sin_cos();
    let cap = Vec3::new(radius * cos, radius * sin, z) + stretched;
    let half = Vec3::new(alpha * cap.x, alpha * cap.y, cap.z.max(0.0)).normalize_or(Vec3::Z);
    let towards = eye.dot(half);
    let light = half * (2.0 * towards) - eye;
    let a2 = alpha * alpha;
    let smith = |cosine: f32| (a2 + (1.0 - a2) * cosine * cosine).sqrt();
    let (view_term, light_term) = (smith(eye.z), smith(light.z));
    let weight = light.z * (eye.z + view_term) / (eye.z * light_term + light.z * view_term);
    let d = half.z * half.z * (a2 - 1.0) + 1.0;
    let distribution = a2 * FRAC_1_PI / (d * d);
    Drawn { light, weight, grazing: fifth(1.0 - towards), density: distribution / (2.0 * (eye.z + view_term)) }
}

fn blinn(eye: Vec3, alpha: f32, at: Vec2) -> Drawn {
    let a2 = alpha * alpha;
    // cos² = u^alpha²; its complement without the rounding of 1 - cos².
    let exponent = a2 * at.x.max(1e-12).ln();
    let sin2 =
        if exponent > -0.01 { -exponent * (1.0 + exponent * (0.5 + exponent / 6.0)) } else { 1.0 - exponent.exp() };
    let (sin, cos) = (TAU * at.y).sin_cos();
    let half = Vec3::new(sin2.sqrt() * cos, sin2.sqrt() * sin, (1.0 - sin2).max(1e-12).sqrt());
    let towards = eye.dot(half);
    let light = half * (2.0 * towards) - eye;
    // D = cos^(2/alpha² - 2) / (pi alpha²), by the same power.
    let distribution = at.x.max(1e-12) / ((1.0 - sin2).max(1e-12) * PI * a2);
    let masking = (2.0 * half.z * eye.z.min(light.z) / towards).min(1.0);
    let weight = if towards > 0.0 { masking * towards / (eye.z * half.z) } else { 0.0 };
    let density = distribution * half.z / (4.0 * towards.max(1e-6));
    Drawn { light, weight, grazing: fifth(1.0 - towards), density }
}

fn fifth(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    let squared = x * x;
    squared * squared * x
}

/// The share of one ray, and the distance to its hit (infinite for none).
fn follow(
    geometry: &Geometry,
    gather: &Gather,
    point: &SurfacePoint,
    view: &View,
    i: u32,
    seed: u32,
    params: &Params,
) -> (Share, f32) {
    const NOTHING: (Share, f32) = (Share { node: 0, weight: 0.0, fresnel: 0.0 }, f32::INFINITY);
    let at = sampling::lattice(i, params.rays, sampling::shift(seed));
    let draw = if params.model == 1 { blinn } else { ggx };
    let drawn = draw(view.eye, params.alpha, at);
    let Some(ray) = view.ray(point, &drawn) else { return NOTHING };
    let (direction, hit) = (ray.direction, geometry.bvh.closest(&ray));
    if hit.triangle == Hit::MISS.triangle {
        return NOTHING;
    }
    // The samples are no mirror image: looked up about one sample around, they make a smooth one.
    let by = jitter(&geometry.area_vector(hit.triangle as usize), i, seed) * params.spacing;
    let (u, v) = credit::nudged(geometry, &hit, by);
    let Some(leaf) = credit::leaf(geometry, gather, point, &Hit { u, v, ..hit }, params.spacing) else {
        return (Share::default(), hit.t);
    };
    let share = params.rays as f32 * (PI * drawn.density).max(0.05);
    let limit = params.credit * credit::patch(geometry, &hit, direction, share);
    let scale = drawn.weight * FRAC_1_PI / params.rays as f32;
    let node = credit::climb(gather, leaf, limit);
    (Share { node, weight: scale * (1.0 - drawn.grazing), fresnel: scale * drawn.grazing }, hit.t)
}

/// A vector in a plane, even over the unit disc: for ray `i` the next point of a lattice (Roberts 2018).
fn jitter(area_vector: &Vec3, i: u32, seed: u32) -> Vec3 {
    let shift = sampling::shift(seed ^ 0x68bc_21eb);
    let p = Vec2::new(sampling::unit(i.wrapping_mul(3_242_174_889)), sampling::unit(i.wrapping_mul(2_447_445_414)));
    let p = p + shift;
    let (x, y) = sampling::frame(area_vector.normalize_or(Vec3::Z));
    let (sin, cos) = (TAU * (p.y - p.y.floor())).sin_cos();
    (x * cos + y * sin) * (p.x - p.x.floor()).sqrt()
}
