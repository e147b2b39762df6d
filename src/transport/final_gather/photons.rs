//! Places that lamps light first, drawn as light falls on them: a second way to find indirect light, beside the rays of a
//! hemisphere.
//!
//! Much light leaves little area: a bright spot above a lamp, sun on a floor. A ray of a hemisphere seldom meets it, but a
//! photon from the lamp does nearly always. Both ways find light that leaves x towards p; each counts by the balance
//! heuristic (Veach and Guibas 1995), which is exact here because photons fall as densely as light does: at x
//! with irradiance E from lamps of power F in all, `E / F` of them a square metre.
//!
//! For: point, spot and directional lights. Light from surfaces and rectangles is spread over what it lights: rays find it.

use super::incident::Incident;
use crate::Result;
use crate::image::colour;
use crate::kernels::trace_rays::{FAR, RayRecord, trace_rays};
use crate::scene::light::{DIRECTIONAL, LightRecord, POINT, SPOT, Source};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::sampling;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// A lit place.
#[derive(Clone, Copy, Debug)]
pub struct Photon {
    pub point: SurfacePoint,
    pub barycentrics: [f32; 2],
    /// Radiant exitance there over how densely photons lie: what it sends, W.
    pub power: Vec4,
    /// Photons a square metre, of all.
    pub density: f32,
}

#[derive(Clone, Debug, Default)]
pub struct Photons {
    /// In the order of a sequence any run of which is spread evenly; those that met nothing are dark.
    pub list: Vec<Photon>,
    /// Of all lamps, W, by luminance.
    power: f32,
}

impl Photons {
    /// About `count` of them; none when there is no lamp.
    pub fn new(incident: &Incident, count: usize) -> Result<Self> {
        let geometry = incident.geometry;
        let lamps: Vec<(&LightRecord, f32)> =
            incident.sources().iter().filter_map(|source| Some((&source.record, power(source, geometry)?))).collect();
        let all: f32 = lamps.iter().map(|lamp| lamp.1).sum();
        if !(all > 0.0 && all.is_finite()) {
            return Ok(Self::default());
        }
        let emit = |i: usize| {
            let [a, u, v] = spread(i);
            let mut rest = a * all;
            let chosen = lamps.iter().find(|lamp| {
                rest -= lamp.1;
                rest < 0.0
            });
            emitted(chosen.unwrap_or(&lamps[lamps.len() - 1]).0, u, v, geometry)
        };
        let rays: Vec<RayRecord> = (0..count).into_par_iter().with_min_len(1024).map(emit).collect();
        let traced = trace_rays(incident.device, geometry, &rays)?;
        let lit = incident.light(traced.points.clone(), &traced.barycentrics, 0)?;
        let photon = |i: usize| {
            let point = traced.points[i];
            let (light, luminance) = (lit.from_lamps[i], lit.from_lamps[i].w);
            // Light falls by the shading normal, photons by the triangle's.
            let way = -Vec3::from(rays[i].direction);
            let [bent, flat] = [point.normal, point.geometric_normal].map(|normal| way.dot(normal.into()).max(0.0));
            let bend = if flat > 0.0 { (bent / flat).min(4.0) } else { 0.0 };
            let (density, mut power) = match luminance > 0.0 {
                true => (luminance / all, light * (bend * all / luminance)),
                false => (0.0, Vec4::ZERO),
            };
            power.w = 0.0;
            Photon { point, barycentrics: traced.barycentrics[i], power, density }
        };
        Ok(Self { list: (0..count).into_par_iter().map(photon).collect(), power: all })
    }

    /// How densely photons lie where lamps give an irradiance of that luminance, a square metre.
    pub fn density(&self, luminance: f32) -> f32 {
        if self.power > 0.0 { luminance / self.power } else { 0.0 }
    }

    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }
}

pub fn luminance(light: Vec4) -> f32 {
    colour::luminance(light.truncate())
}

/// Point `i` of a sequence in three dimensions (Roberts 2018).
fn spread(i: usize) -> [f32; 3] {
    let steps = [0.819_172_513_396_164_4_f64, 0.671_043_606_703_789_3, 0.549_700_477_901_970_3];
    steps.map(|step| (0.5 + step * i as f64).fract() as f32)
}

/// Of a lamp, by luminance, W; `None` for light that is not drawn so.
fn power(source: &Source, geometry: &Geometry) -> Option<f32> {
    let record = &source.record;
    let intensity = luminance(Vec3::from(record.intensity).extend(0.0));
    match record.kind {
        POINT => Some(2.0 * TAU * intensity),
        SPOT => Some(TAU * cone(record)[0] * intensity),
        DIRECTIONAL => Some(PI * ball(geometry).1.powi(2) * intensity),
        _ => None,
    }
}

/// Solid angle of a spot over 2 pi, weighted by its falloff; and the part of it in which there is none.
fn cone(record: &LightRecord) -> [f32; 2] {
    let soft = 1.0 / record.cone_scale;
    let full = (1.0 - record.cos_outer - soft).max(0.0);
    [full + soft / 3.0, full]
}

/// Centre and radius of a ball around the scene.
fn ball(geometry: &Geometry) -> (Vec3, f32) {
    let (low, high) = geometry.bounds();
    (0.5 * (low + high), 0.5 * (high - low).length())
}

/// The ray of a photon, drawn as the lamp sends light.
fn emitted(lamp: &LightRecord, u: f32, v: f32, geometry: &Geometry) -> RayRecord {
    let about = |axis: Vec3, cosine: f32| {
        let (x, y) = sampling::frame(axis);
        let (sin, cos) = (TAU * v).sin_cos();
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        x * (sine * cos) + y * (sine * sin) + axis * cosine
    };
    let (origin, direction) = match lamp.kind {
        SPOT => {
            let [all, full] = cone(lamp);
            let at = u * all;
            let cosine = match at <= full {
                true => 1.0 - at,
                false => lamp.cos_outer + (1.0 - (at - full) * 3.0 * lamp.cone_scale).max(0.0).cbrt() / lamp.cone_scale,
            };
            (lamp.position.into(), about(lamp.direction.into(), cosine))
        }
        DIRECTIONAL => {
            let (centre, radius) = ball(geometry);
            let direction = Vec3::from(lamp.direction);
            let (x, y) = sampling::frame(direction);
            let (sin, cos) = (TAU * v).sin_cos();
            (centre - direction * (1.001 * radius) + (x * cos + y * sin) * (radius * u.sqrt()), direction)
        }
        _ => (lamp.position.into(), about(Vec3::Z, 1.0 - 2.0 * u)),
    };
    RayRecord { origin: Vec3::to_array(&origin), t_max: FAR, direction: direction.to_array(), t_min: 0.0 }
}
