//! Where a brush reaches: a ring on the surfaces that are seen, of the radius that paint will have (thesis 4.4.4).

use crate::device::Device;
use crate::editor::shown::Shown;
use crate::kernels::surroundings;
use crate::scene::SurfacePoint;
use glam::{Vec2, Vec3};

/// Directions in which the ring is looked for.
const STEPS: usize = 72;

/// Points of the ring in pixels of the picture: from the pixel at the middle, each ends where surfaces are farther off than
/// the radius, or turn away. Empty where there is no surface.
pub fn ring(shown: &Shown, middle: Vec2, radius: f32) -> Vec<Vec2> {
    let Some(samples) = &shown.samples else { return Vec::new() };
    let pixel = |at: Vec2| {
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < samples.width as f32 && at.y < samples.height as f32;
        if inside { shown.point(at.x as usize, at.y as usize) } else { None }
    };
    let Some(centre) = pixel(middle) else { return Vec::new() };
    let (position, normal) = (Vec3::from(centre.position), Vec3::from(centre.normal));
    let size = Vec2::new(samples.width as f32, samples.height as f32);
    let (eye, camera) = (samples.camera.position, &samples.camera);
    // No point on a surface in reach appears farther off than this.
    let depth = eye.distance(position).max(1e-6);
    let most = match camera.project(position + camera.world_from_camera.x_axis * radius, size) {
        Some((edge, _)) => (edge - middle).length() * 4.0 * (1.0 + radius / depth),
        None => size.length(),
    };
    let is_covered = |at: Vec2| {
        pixel(at).is_some_and(|point| {
            let (other, facing) = (Vec3::from(point.position), Vec3::from(point.normal));
            other.distance(position) <= radius && facing.dot(normal) > 0.0
        })
    };
    let reach = |way: Vec2| {
        let step = (most / 256.0).max(1.0);
        let mut last = 0.0;
        let mut next = step;
        while next <= most.min(size.length()) && is_covered(middle + way * next) {
            last = next;
            next += step;
        }
        // Between the two, to a part of a pixel.
        let (mut inside, mut outside) = (last, next);
        for _ in 0..5 {
            let half = 0.5 * (inside + outside);
            if is_covered(middle + way * half) { inside = half } else { outside = half }
        }
        middle + way * inside
    };
    (0..STEPS).map(|i| reach(Vec2::from_angle(i as f32 / STEPS as f32 * std::f32::consts::TAU))).collect()
}

/// Rays that look for what is around a point under the pointer: enough for a ring, too few for paint.
const RAYS: u32 = 64;

/// The radius of an adaptive brush at a point that is seen, metres: a factor of the harmonic mean distance to what is
/// around (thesis 4.4.5). `None` where there is nothing around.
pub fn adaptive_radius(shown: &Shown, point: &SurfacePoint, factor: f32) -> Option<f32> {
    let geometry = &shown.scene.as_ref()?.geometry;
    let distances = surroundings(&Device::Cpu, geometry, std::slice::from_ref(point), RAYS).ok()?;
    distances.first().map(|distance| distance * factor).filter(|radius| radius.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::editor::shown::{LastMask, Parts};
    use crate::scene::{Camera, builtin};
    use crate::transport::Samples;
    use crate::value::Value;
    use std::sync::Arc;

    fn shown() -> Shown {
        let scene = Arc::new(builtin::scene("room").unwrap());
        let camera = Camera::look_at("", Vec3::new(0.0, 1.0, 0.9), Vec3::new(0.0, 0.0, 0.0), 1.0);
        let samples = Arc::new(Samples::view(&Device::Cpu, &scene.geometry, &camera, (160, 120), 1).unwrap());
        let value = || Some(Value::Samples(samples.clone()));
        let scene = Some(Value::Scene(scene.clone()));
        Shown::new(Parts { picture: value(), samples: value(), scene, ..Parts::default() }, &mut LastMask::default())
            .unwrap()
    }

    #[test]
    fn the_ring_lies_on_the_surface_at_its_radius() {
        let shown = shown();
        let middle = Vec2::new(80.0, 70.0);
        let centre = *shown.point(80, 70).unwrap();
        let ring = ring(&shown, middle, 0.1);
        assert_eq!(ring.len(), STEPS);
        for at in &ring {
            let point = shown.point(at.x as usize, at.y as usize).unwrap();
            let distance = Vec3::from(point.position).distance(centre.position.into());
            // To a pixel, which is about a centimetre there.
            assert!((0.08..=0.1001).contains(&distance), "{distance} at {at}");
        }
        assert!(super::ring(&shown, Vec2::new(-5.0, 3.0), 0.1).is_empty());
        let adaptive = adaptive_radius(&shown, &centre, 0.5).unwrap();
        assert!((0.05..1.0).contains(&adaptive), "{adaptive}");
    }
}
