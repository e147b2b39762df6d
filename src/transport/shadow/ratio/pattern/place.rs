//! Where on a pattern the pixels of a picture lie, and how much of it each covers: on the screen, or on surfaces.

use super::super::Ratio;
use super::super::frame::Units;
use super::turned;
use crate::transport::Samples;
use crate::transport::shadow::kinship::pixel_angle;
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use std::sync::Arc;

/// In periods.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    pub at: Vec2,
    /// What a pixel covers along the two axes.
    pub size: Vec2,
}

/// A pattern laid out.
#[derive(Clone, Debug)]
pub struct Laid {
    /// Periods a unit: a height of the picture, or a metre.
    frequency: f32,
    angle: f32,
    offset: Vec2,
    ground: Ground,
}

#[derive(Clone, Debug)]
enum Ground {
    Screen(Units),
    /// On surfaces, projected along a direction (its two axes), or along the axis that the normal is nearest to.
    World {
        samples: Arc<Samples>,
        axes: Option<[Vec3; 2]>,
        pixel_angle: f32,
    },
}

impl Laid {
    /// `period`: in heights of the picture, or in metres where there are samples. `angle` in radians, `offset` in
    /// periods. `direction`: of the projection onto surfaces; `None`: each is seen along the axis x, y or z that its
    /// normal is nearest to.
    ///
    /// # Errors
    /// `Compute` for a period that is not above 0, numbers that are not finite, samples of another size.
    pub fn new(
        ratio: &Ratio,
        samples: Option<&Arc<Samples>>,
        period: f32,
        angle: f32,
        offset: Vec2,
        direction: Option<Vec3>,
    ) -> Result<Self> {
        let frequency = 1.0 / period;
        if !(period > 0.0 && frequency.is_finite() && period.is_finite()) {
            return Err(Error::compute(format!("scale is {period}"), "give the length of a period, above 0"));
        }
        if !(angle.is_finite() && offset.is_finite()) {
            return Err(Error::compute(format!("angle {angle}, offset {offset}"), "give finite numbers"));
        }
        let axes = direction.map(axes).transpose()?;
        let ground = match samples {
            Some(samples) => {
                ratio.check("samples have", samples.width, samples.height)?;
                let pixel_angle = pixel_angle(&samples.camera, samples.height);
                Ground::World { samples: samples.clone(), axes, pixel_angle }
            }
            None => Ground::Screen(Units::heights(ratio)),
        };
        Ok(Self { frequency, angle, offset, ground })
    }

    /// Mean of a mask over the samples of a pixel, and of how far it has faded.
    pub fn mean_over_pixel(&self, x: usize, y: usize, mask: impl Fn(Spot) -> (Vec3, f32)) -> (Vec3, f32) {
        match &self.ground {
            Ground::Screen(units) => {
                let at = units.of_pixel(x, y).as_vec2();
                let pixel = 1.0 / units.0.y as f32;
                // y points down on the screen, up in the pattern.
                let up = Vec2::new(1.0, -1.0);
                mask(self.spot(at * up, Vec2::X * pixel, Vec2::Y * pixel))
            }
            Ground::World { samples, axes, pixel_angle } => {
                let count = samples.per_pixel();
                let first = (y * samples.width + x) * count;
                let (mut sum, mut faded) = (Vec3::ZERO, 0.0);
                for point in &samples.points[first..first + count] {
                    if !point.exists() {
                        // There is no surface to lie on: the shadow stays.
                        sum += Vec3::ONE;
                        continue;
                    }
                    let (position, normal) = (Vec3::from(point.position), Vec3::from(point.normal));
                    let [u, v] = axes.unwrap_or_else(|| nearest_axes(normal));
                    let plane = |p: Vec3| Vec2::new(p.dot(u), p.dot(v));
                    let [right, down] = across_pixel(samples, position, point.geometric_normal.into(), *pixel_angle);
                    let one = mask(self.spot(plane(position), plane(right), plane(down)));
                    sum += one.0;
                    faded += one.1;
                }
                (sum / count as f32, faded / count as f32)
            }
        }
    }

    /// `right`, `down`: how the plane moves from a pixel to the next.
    fn spot(&self, at: Vec2, right: Vec2, down: Vec2) -> Spot {
        let [at, right, down] = [at, right, down].map(|v| turned(v, self.angle) * self.frequency);
        Spot { at: at - self.offset, size: Vec2::new(right.x.hypot(down.x), right.y.hypot(down.y)) }
    }
}

/// How a surface point moves as its pixel moves right and down: rays through the neighbours meet its tangent plane.
/// Infinite where the plane is seen on edge.
fn across_pixel(samples: &Samples, position: Vec3, normal: Vec3, pixel_angle: f32) -> [Vec3; 2] {
    let axes = samples.camera.world_from_camera;
    let to = position - samples.camera.position;
    let depth = to.dot(-axes.z_axis).abs();
    let along = to.dot(normal);
    [axes.x_axis, -axes.y_axis].map(|step| {
        let step = step * (pixel_angle * depth);
        step - to * (step.dot(normal) / along)
    })
}

/// Right and up of a plane seen along one axis of the world.
fn nearest_axes(normal: Vec3) -> [Vec3; 2] {
    let n = normal.abs();
    if n.y >= n.x && n.y >= n.z {
        [Vec3::X, Vec3::NEG_Z]
    } else if n.x >= n.z {
        [Vec3::NEG_Z * normal.x.signum(), Vec3::Y]
    } else {
        [Vec3::X * normal.z.signum(), Vec3::Y]
    }
}

/// Right and up of a plane seen along a direction.
fn axes(direction: Vec3) -> Result<[Vec3; 2]> {
    let Some(direction) = direction.try_normalize() else {
        return Err(Error::compute(format!("direction {direction}"), "give a direction that is not 0"));
    };
    let up = if direction.y.abs() > 0.999 { Vec3::NEG_Z } else { Vec3::Y };
    let right = direction.cross(up).normalize();
    Ok([right, right.cross(direction)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_square_and_face_the_viewer() {
        for direction in [Vec3::NEG_Y, Vec3::Y, Vec3::NEG_Z, Vec3::new(1.0, -2.0, 0.5)] {
            let [u, v] = axes(direction).unwrap();
            assert!(u.dot(v).abs() < 1e-6 && u.dot(direction).abs() < 1e-6 && v.dot(direction).abs() < 1e-6);
            assert!(u.cross(v).dot(direction) < 0.0, "right, up and towards the viewer, right-handed");
        }
        for normal in [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z, Vec3::Y] {
            let [u, v] = nearest_axes(normal);
            assert_eq!(u.cross(v), normal);
        }
        assert!(axes(Vec3::ZERO).is_err() && axes(Vec3::splat(f32::NAN)).is_err());
    }
}
