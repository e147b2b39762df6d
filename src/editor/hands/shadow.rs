//! Dragging a shadow over a surface: how far the light has to turn for it (thesis 6.7.3 turns the light, not the shadow).

use crate::scene::bvh::Ray;
use crate::scene::{Environment, Geometry, cube};
use crate::transport::shadow::Lamp;
use glam::Vec3;

/// Where light comes from, on the whole: unit. Of the environment, or of the part that belongs to a light. `None` when
/// it is dark.
pub fn direction(environment: &Environment, lamp: Option<&Lamp>) -> Option<Vec3> {
    let size = environment.size;
    let solid = cube::solid_angles(size);
    let weight = |texel: usize| {
        let [r, g, b, _] = environment.radiance[texel];
        let share = lamp.filter(|lamp| lamp.size == size).map_or(1.0, |lamp| lamp.weights[texel]);
        (r + g + b) * share * solid[texel % (size * size)]
    };
    let sum = |power: i32| -> Vec3 {
        (0..environment.radiance.len())
            .map(|texel| cube::texel_point(texel, size).normalize() * weight(texel).powi(power))
            .sum()
    };
    // A whole sky shines from all around; its shadows come from where it is brightest.
    sum(if lamp.is_some() { 1 } else { 2 }).try_normalize()
}

/// The offset of `translate_shadow` (on the cube of half side 1) that takes the shadow at `from` to `to`, both on
/// surfaces; what casts it is what lies from there towards the light. `None` when nothing does.
pub fn offset(geometry: &Geometry, light: Vec3, from: Vec3, normal: Vec3, to: Vec3) -> Option<Vec3> {
    let origin = from + normal * (4.0 * geometry.lift());
    let hit = geometry.bvh.closest(&Ray { origin, direction: light, t_max: f32::INFINITY });
    // What casts the shadow is seen from `from` at `light`; from `to` it must be seen there instead of where it is.
    let on_cube = 1.0 / light.abs().max_element();
    hit.t.is_finite().then(|| (to - from) * (on_cube / hit.t))
}

/// The angle of `rotate_shadow` (degrees, about a unit `axis`) that swings the shadow at `from` to `to`; it swings about
/// what casts it. `None` when nothing does, or it is too near to be swung about.
pub fn angle(geometry: &Geometry, light: Vec3, axis: Vec3, from: Vec3, normal: Vec3, to: Vec3) -> Option<f32> {
    let origin = from + normal * (4.0 * geometry.lift());
    let hit = geometry.bvh.closest(&Ray { origin, direction: light, t_max: f32::INFINITY });
    let caster = origin + light * hit.t;
    let flat = |at: Vec3| (at - caster).reject_from_normalized(axis).try_normalize();
    let (a, b) = (flat(from).filter(|_| hit.t.is_finite())?, flat(to)?);
    // The shadow goes the other way than what is seen.
    Some(-axis.dot(a.cross(b)).atan2(a.dot(b)).to_degrees())
}
