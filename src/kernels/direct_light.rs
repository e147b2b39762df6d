//! Direct light at surface points: irradiance with one shadow ray for a point, spot or directional light, and
//! `samples` stratified ones for emitting triangles.
//!
//! Irradiance from a point light of intensity I: `I cos(theta) / r^2` (thesis 2.3.2); from emitting triangles:
//! `sum L cos(theta) cos(theta') area / r^2` over points drawn by power (thesis eq. 2.19, area formulation).
//! Output: N x RGB irradiance (W/m², fourth component 0), and where materials are given, N x RGB radiance that
//! a GGX highlight (Walter et al. 2007, Schlick's Fresnel) sends to the eye.

use super::RAY_SHADERS;
#[cfg(feature = "gpu")]
use super::{RAYS, fits_the_shader, pages};
use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::scene::bvh::{Facet, Node, Ray};
use crate::scene::light::{DIRECTIONAL, EMITTERS, Emitter, LightRecord, SPOT};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::sampling;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::PI;

uniform! {
    struct Params {
        light: LightRecord,
        eye: [f32; 3],
        /// Ray origins are lifted by at least this.
        lift: f32,
        points: u32,
        emitters: u32,
        /// Shadow rays a point towards emitting triangles.
        samples: u32,
        /// 1: also compute highlights.
        highlights: u32,
        /// Number of a page's first point.
        first: u32,
        /// Materials that have a gloss.
        materials: u32,
        pad0: u32,
        pad1: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "direct_light",
    shared: RAY_SHADERS,
    source: include_str!("../../shaders/direct_light.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Node>("nodes"),
        Binding::read::<Facet>("facets"),
        Binding::read::<SurfacePoint>("points"),
        Binding::read::<Emitter>("emitters"),
        Binding::read::<[f32; 4]>("gloss"),
        Binding::write::<[f32; 4]>("irradiance"),
        Binding::write::<[f32; 4]>("highlights"),
    ],
};

/// What gives a material its highlight: reflectance at normal incidence, and roughness.
pub struct View<'a> {
    pub eye: Vec3,
    /// Per material: f0 RGB, roughness.
    pub gloss: &'a Array<[f32; 4]>,
}

pub struct Lit {
    pub irradiance: Vec<[f32; 4]>,
    /// Empty when no `View` was given.
    pub highlight: Vec<[f32; 4]>,
}

pub fn direct_light(
    device: &Device,
    geometry: &Geometry,
    points: &Array<SurfacePoint>,
    light: &LightRecord,
    emitters: &Array<Emitter>,
    samples: u32,
    view: Option<&View>,
) -> Result<Lit> {
    let params = Params {
        light: *light,
        eye: view.map_or(Vec3::ZERO, |view| view.eye).to_array(),
        lift: geometry.lift(),
        points: points.len() as u32,
        emitters: emitters.len() as u32,
        samples,
        highlights: view.is_some().into(),
        first: 0,
        materials: view.map_or(0, |view| view.gloss.len()) as u32,
        pad0: 0,
        pad1: 0,
    };
    if light.kind == EMITTERS && emitters.is_empty() {
        let dark = vec![[0.0; 4]; points.len()];
        let highlight = if view.is_some() { dark.clone() } else { Vec::new() };
        return Ok(Lit { irradiance: dark, highlight });
    }
    match device {
        Device::Cpu => Ok(cpu(geometry, points, &params, emitters, view.map_or(&[], |view| &view.gloss[..]))),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, geometry, points, &params, emitters, view.map(|view| view.gloss)),
    }
}

fn cpu(geometry: &Geometry, points: &[SurfacePoint], params: &Params, emitters: &[Emitter], gloss: &[[f32; 4]]) -> Lit {
    let mut irradiance = vec![[0.0; 4]; points.len()];
    let mut highlight = vec![[0.0; 4]; if params.highlights == 1 { points.len() } else { 0 }];
    const TILE: usize = 1024;
    let shade = |index: usize, point: &SurfacePoint| {
        let gloss = gloss.get(point.material as usize);
        shade(geometry, params, emitters, gloss, point, index as u32)
    };
    if highlight.is_empty() {
        irradiance.par_chunks_mut(TILE).enumerate().for_each(|(tile, out)| {
            for (i, out) in out.iter_mut().enumerate() {
                let index = tile * TILE + i;
                *out = shade(index, &points[index]).0.extend(0.0).to_array();
            }
        });
    } else {
        let tiles = irradiance.par_chunks_mut(TILE).zip(highlight.par_chunks_mut(TILE)).enumerate();
        tiles.for_each(|(tile, (irradiance, highlight))| {
            for i in 0..irradiance.len() {
                let index = tile * TILE + i;
                let (diffuse, gloss) = shade(index, &points[index]);
                irradiance[i] = diffuse.extend(0.0).to_array();
                highlight[i] = gloss.extend(0.0).to_array();
            }
        });
    }
    Lit { irradiance, highlight }
}

#[cfg(feature = "gpu")]
fn gpu(
    gpu: &Gpu,
    geometry: &Geometry,
    points: &Array<SurfacePoint>,
    params: &Params,
    emitters: &Array<Emitter>,
    gloss: Option<&Array<[f32; 4]>>,
) -> Result<Lit> {
    fits_the_shader(geometry)?;
    let mut lit = Lit { irradiance: Vec::with_capacity(points.len()), highlight: Vec::new() };
    let rays = if params.light.kind == EMITTERS { params.samples.max(1) as usize } else { 1 };
    let gloss = gloss.map_or_else(|| gpu.upload::<[f32; 4]>(&[]), |gloss| gpu.whole(gloss));
    for range in pages(points.len(), gpu.page(size_of::<SurfacePoint>()).min((RAYS / rays).max(1))) {
        let params = Params { points: range.len() as u32, first: range.start as u32, ..*params };
        let irradiance = gpu.storage::<[f32; 4]>(range.len());
        let highlights = gpu.storage::<[f32; 4]>(if params.highlights == 1 { range.len() } else { 1 });
        let buffers = [
            &gpu.whole(&geometry.bvh.nodes),
            &gpu.whole(&geometry.bvh.facets),
            &gpu.array(points, range.clone()),
            &gpu.whole(emitters),
            &gloss,
            &irradiance,
            &highlights,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(64))?;
        if params.highlights == 1 {
            let [irradiance, highlights] = batch.read([&irradiance, &highlights])?;
            lit.irradiance.extend_from_slice(irradiance.get());
            lit.highlight.extend_from_slice(highlights.get());
        } else {
            let [page] = batch.read([&irradiance])?;
            lit.irradiance.extend_from_slice(page.get());
        }
    }
    Ok(lit)
}

/// Irradiance and highlight radiance of one point.
fn shade(
    geometry: &Geometry,
    params: &Params,
    emitters: &[Emitter],
    gloss: Option<&[f32; 4]>,
    point: &SurfacePoint,
    index: u32,
) -> (Vec3, Vec3) {
    if !point.exists() {
        return (Vec3::ZERO, Vec3::ZERO);
    }
    let light = &params.light;
    // All is measured from where shadow rays start: from below, a lifted ray to a lamp close by would end behind it.
    let origin = sampling::lifted(point.position.into(), point.geometric_normal.into(), params.lift);
    let intensity = Vec3::from(light.intensity);
    let mut sum = (Vec3::ZERO, Vec3::ZERO);
    // `radiance x solid angle` of light arriving along the unit vector `towards`, from `distance` away.
    let mut add = |towards: Vec3, distance: f32, power: Vec3| {
        let cosine = Vec3::from(point.normal).dot(towards);
        if cosine <= 0.0 || Vec3::from(point.geometric_normal).dot(towards) <= 0.0 || power == Vec3::ZERO {
            return;
        }
        if geometry.bvh.any(&Ray { origin, direction: towards, t_max: distance }) {
            return;
        }
        sum.0 += power * cosine;
        if let (1, Some(gloss)) = (params.highlights, gloss) {
            let eye = (Vec3::from(params.eye) - origin).normalize_or_zero();
            sum.1 += power * cosine * highlight(point.normal.into(), eye, towards, gloss);
        }
    };
    match light.kind {
        DIRECTIONAL => add(-Vec3::from(light.direction), f32::INFINITY, intensity),
        EMITTERS => {
            let shift = sampling::shift(index ^ light.seed);
            for i in 0..params.samples {
                let pick = (i as f32 + shift.x) / params.samples as f32;
                let chosen = emitters.partition_point(|emitter| emitter.cumulative <= pick).min(emitters.len() - 1);
                let emitter = &emitters[chosen];
                let before = if chosen > 0 { emitters[chosen - 1].cumulative } else { 0.0 };
                let share = emitter.cumulative - before;
                // The remainder of the pick is uniform again, and keeps the strata.
                let at = Vec2::new(
                    ((pick - before) / share).clamp(0.0, 1.0),
                    sampling::unit(i.wrapping_mul(2_654_435_769)) + shift.y,
                );
                let at = sampling::triangle(Vec2::new(at.x, at.y - at.y.floor()));
                let (edge_u, edge_v) = (Vec3::from(emitter.edge_u), Vec3::from(emitter.edge_v));
                let towards = Vec3::from(emitter.corner) + edge_u * at.x + edge_v * at.y - origin;
                let distance = towards.length();
                let area_vector = edge_u.cross(edge_v) * 0.5;
                let facing = -area_vector.dot(towards) / distance;
                let facing = if emitter.two_sided == 1 { facing.abs() } else { facing.max(0.0) };
                // `facing` carries the area; dividing by the chance of this triangle makes the mean right.
                // No sample may bring more than a sky full of its light: close to a lamp rare ones would sparkle.
                let weight = (facing / (distance * distance * share)).min(PI) / params.samples as f32;
                if weight.is_finite() {
                    add(towards / distance, distance * 0.9999, Vec3::from(emitter.radiance) * weight);
                }
            }
        }
        _ => {
            let to_light = Vec3::from(light.position) - origin;
            let distance = to_light.length();
            let towards = to_light / distance;
            let cone = if light.kind == SPOT {
                let t = ((-towards.dot(light.direction.into()) - light.cos_outer) * light.cone_scale).clamp(0.0, 1.0);
                t * t
            } else {
                1.0
            };
            if distance > 0.0 {
                add(towards, distance, intensity * (cone / (distance * distance)));
            }
        }
    }
    sum
}

/// GGX reflection with height-correlated Smith masking; BRDF per channel.
fn highlight(normal: Vec3, eye: Vec3, light: Vec3, gloss: &[f32; 4]) -> Vec3 {
    let half = (eye + light).normalize_or_zero();
    let (nv, nl, nh, vh) = (normal.dot(eye), normal.dot(light), normal.dot(half), eye.dot(half));
    let f0 = Vec3::new(gloss[0], gloss[1], gloss[2]);
    if nv <= 0.0 || nl <= 0.0 || f0 == Vec3::ZERO {
        return Vec3::ZERO;
    }
    let alpha = (gloss[3] * gloss[3]).max(1e-3);
    let a2 = alpha * alpha;
    let d = nh * nh * (a2 - 1.0) + 1.0;
    let distribution = a2 / (PI * d * d);
    let masking = 0.5 / (nl * (nv * nv * (1.0 - a2) + a2).sqrt() + nv * (nl * nl * (1.0 - a2) + a2).sqrt());
    let fresnel = f0 + (Vec3::ONE - f0) * (1.0 - vh).clamp(0.0, 1.0).powi(5);
    fresnel * (distribution * masking)
}
