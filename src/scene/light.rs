//! Lights that are not surfaces, rectangles that emit, and the form in which kernels take them. Radiometric units:
//! W/sr for point and spot, W/m² for directional (irradiance on a facing surface), W/(sr m²) for area.

use crate::scene::{Geometry, Material};
use glam::Vec3;

#[derive(Clone, Debug, PartialEq)]
pub enum LightKind {
    Point {
        position: Vec3,
    },
    /// Full strength inside `inner`, none outside `outer` (half angles, radians), KHR_lights_punctual between.
    Spot {
        position: Vec3,
        direction: Vec3,
        inner: f32,
        outer: f32,
    },
    /// Light travels along `direction`.
    Directional {
        direction: Vec3,
    },
    /// A rectangle with corner `corner` and edges `u`, `v`; emits from the side that `u x v` points to. It is not
    /// seen by cameras and casts no shadow.
    Area {
        corner: Vec3,
        u: Vec3,
        v: Vec3,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    pub name: String,
    pub kind: LightKind,
    /// Linear Rec.709 colour times intensity, in the unit of the kind.
    pub intensity: Vec3,
}

/// `LightRecord::kind`; the same numbers in `shaders/direct_light.wgsl`.
pub const POINT: u32 = 0;
pub const SPOT: u32 = 1;
pub const DIRECTIONAL: u32 = 2;
pub const EMITTERS: u32 = 3;

/// One light as `kernels::direct_light` reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct LightRecord {
    pub position: [f32; 3],
    pub kind: u32,
    /// Unit; the way light travels along the axis of a spot or directional light.
    pub direction: [f32; 3],
    pub cos_outer: f32,
    pub intensity: [f32; 3],
    /// 1 / (cos inner - cos outer)
    pub cone_scale: f32,
    pub seed: u32,
    pub pad: [u32; 3],
}

/// One emitting triangle.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Emitter {
    pub corner: [f32; 3],
    /// Share of the power of all emitters up to and with this one; 1 for the last.
    pub cumulative: f32,
    pub edge_u: [f32; 3],
    pub two_sided: u32,
    pub edge_v: [f32; 3],
    pub pad0: u32,
    pub radiance: [f32; 3],
    pub pad1: u32,
}

impl LightRecord {
    const EMPTY: Self = Self {
        position: [0.0; 3],
        kind: EMITTERS,
        direction: [0.0; 3],
        cos_outer: 0.0,
        intensity: [0.0; 3],
        cone_scale: 0.0,
        seed: 0,
        pad: [0; 3],
    };
}

/// A light with what it emits from: nothing for punctual lights, triangles for an area light.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    pub name: String,
    pub record: LightRecord,
    pub emitters: Vec<Emitter>,
}

impl Light {
    pub fn source(&self) -> Source {
        let base = LightRecord { intensity: self.intensity.to_array(), ..LightRecord::EMPTY };
        let mut emitters = Vec::new();
        let record = match self.kind {
            LightKind::Point { position } => LightRecord { kind: POINT, position: position.to_array(), ..base },
            LightKind::Spot { position, direction, inner, outer } => {
                let (cos_inner, cos_outer) = (inner.cos(), outer.cos());
                LightRecord {
                    kind: SPOT,
                    position: position.to_array(),
                    direction: direction.to_array(),
                    cos_outer,
                    // A hard edge when both angles are the same.
                    cone_scale: 1.0 / (cos_inner - cos_outer).max(1e-6),
                    ..base
                }
            }
            LightKind::Directional { direction } => {
                LightRecord { kind: DIRECTIONAL, direction: direction.to_array(), ..base }
            }
            LightKind::Area { corner, u, v } => {
                emitters.push(emitter(corner, u, v, self.intensity, false));
                emitters.push(emitter(corner + u + v, -u, -v, self.intensity, false));
                accumulate(&mut emitters);
                LightRecord { kind: EMITTERS, ..base }
            }
        };
        Source { name: self.name.clone(), record, emitters }
    }
}

/// All emitting surfaces of a scene as one source; `None` when nothing emits.
pub fn surfaces(geometry: &Geometry, materials: &[Material]) -> Option<Source> {
    let glowing = |triangle: &usize| materials[geometry.material[*triangle] as usize].emits();
    let mut emitters: Vec<Emitter> = (0..geometry.corners.len())
        .filter(glowing)
        .map(|triangle| {
            let [a, b, c] = geometry.corners[triangle].map(Vec3::from);
            emitter(a, b - a, c - a, materials[geometry.material[triangle] as usize].emission.into(), true)
        })
        .collect();
    accumulate(&mut emitters);
    let record = LightRecord { seed: 0x5eed, ..LightRecord::EMPTY };
    (!emitters.is_empty()).then(|| Source { name: "surfaces".into(), record, emitters })
}

fn emitter(corner: Vec3, u: Vec3, v: Vec3, radiance: Vec3, two_sided: bool) -> Emitter {
    Emitter {
        corner: corner.to_array(),
        cumulative: 0.0,
        edge_u: u.to_array(),
        two_sided: two_sided.into(),
        edge_v: v.to_array(),
        pad0: 0,
        radiance: radiance.to_array(),
        pad1: 0,
    }
}

/// Fills in `cumulative` by power, summed in f64 so that a million small triangles keep their shares.
fn accumulate(emitters: &mut Vec<Emitter>) {
    let power = |e: &Emitter| {
        let area = Vec3::from(e.edge_u).cross(e.edge_v.into()).length() as f64;
        area * e.radiance.iter().map(|&r| f64::from(r)).sum::<f64>()
    };
    emitters.retain(|e| power(e) > 0.0);
    let total: f64 = emitters.iter().map(power).sum();
    let mut sum = 0.0;
    for emitter in emitters.iter_mut() {
        sum += power(emitter);
        emitter.cumulative = (sum / total) as f32;
    }
    if let Some(last) = emitters.last_mut() {
        last.cumulative = 1.0;
    }
}
