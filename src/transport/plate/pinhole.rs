//! The camera that a picture was taken with, found from where its pixels lie in space.
//!
//! A pinhole with square pixels, looking through the middle of the picture: seven unknowns (place, orientation, field of
//! view), found by damped least squares over the distances in the picture (Levenberg 1944, Marquardt 1963), from
//! several beginnings, so that a single plane is enough. Not for: lens shift, panoramas, parallel projection; the
//! residual tells.

mod pose;

use crate::scene::Camera;
use glam::{DMat3, DVec2, DVec3};
use pose::{Pose, descend};
use rayon::prelude::*;

/// A pixel and what it shows.
#[derive(Clone, Copy, Debug)]
pub struct Sighting {
    /// Pixels from the upper left corner.
    pub at: DVec2,
    /// World.
    pub position: DVec3,
}

pub struct Fit {
    pub camera: Camera,
    /// Median distance in the picture between where points lie and where they are seen, pixels.
    pub residual: f64,
}

/// Points that the beginnings are tried with, and that the end is found with.
const FEW: usize = 256;
const MANY: usize = 8192;
/// Points farther off than this have little say in the end, pixels.
const NEAR: f64 = 0.5;

/// `size`: of the picture, pixels. `None` when there are fewer than 8 points, or they lie in one spot or on one line.
pub fn fit(sightings: &[Sighting], size: DVec2) -> Option<Fit> {
    let count = sightings.len() as f64;
    let centre = sightings.iter().map(|s| s.position).sum::<DVec3>() / count;
    let spread = (sightings.iter().map(|s| s.position.distance_squared(centre)).sum::<f64>() / count).sqrt();
    if sightings.len() < 8 || !spread.is_normal() {
        return None;
    }
    let scaled = |s: &Sighting| Sighting { at: s.at - 0.5 * size, position: (s.position - centre) / spread };
    // By the golden ratio: even steps would fall into columns of the picture.
    let thinned = |most: usize| {
        let place = |i: usize| ((i as f64 * 0.618_033_988_749_894_9).fract() * count) as usize;
        match sightings.len() <= most {
            true => sightings.iter().map(scaled).collect(),
            false => (0..most).map(|i| scaled(&sightings[place(i).min(sightings.len() - 1)])).collect::<Vec<_>>(),
        }
    };
    let (few, many) = (thinned(FEW), thinned(MANY));
    let tried = beginnings(&few, size)?.into_par_iter().map(|pose| descend(pose, &few, size, f64::INFINITY));
    let best = tried.min_by(|a, b| a.1.total_cmp(&b.1))?.0;
    let (best, _) = descend(best, &many, size, NEAR);
    let mut distances: Vec<f64> = many.iter().map(|s| best.miss(s).0.length()).collect();
    let middle = distances.len() / 2;
    let residual = *distances.select_nth_unstable_by(middle, f64::total_cmp).1;
    let fov_y = 2.0 * (0.5 * size.y / best.focal).atan();
    let camera = Camera {
        name: "plate".to_owned(),
        position: (centre + spread * best.eye).as_vec3(),
        world_from_camera: best.axes.as_mat3(),
        fov_y: fov_y as f32,
    };
    Some(Fit { camera, residual })
}

/// Poses around the one in which all pixels see one plane squarely.
fn beginnings(sightings: &[Sighting], size: DVec2) -> Option<Vec<Pose>> {
    // position = middle + across x + down y, by least squares.
    let count = sightings.len() as f64;
    let mean = sightings.iter().map(|s| s.at).sum::<DVec2>() / count;
    let (mut xx, mut xy, mut yy, mut px, mut py) = (0.0, 0.0, 0.0, DVec3::ZERO, DVec3::ZERO);
    for s in sightings {
        let at = s.at - mean;
        (xx, xy, yy) = (xx + at.x * at.x, xy + at.x * at.y, yy + at.y * at.y);
        (px, py) = (px + s.position * at.x, py + s.position * at.y);
    }
    let determinant = xx * yy - xy * xy;
    if determinant <= 1e-9 * xx * yy {
        return None;
    }
    let across = (px * yy - py * xy) / determinant;
    let down = (py * xx - px * xy) / determinant;
    let right = across.try_normalize()?;
    let up = -(down - right * down.dot(right)).try_normalize()?;
    let square = DMat3::from_cols(right, up, right.cross(up));
    let mut poses = Vec::new();
    for degrees in [0.0f64, -25.0, 25.0, -50.0, 50.0, -75.0, 75.0] {
        for (x, y) in [(degrees, 0.0), (0.0, degrees), (degrees, 0.5 * degrees)] {
            let turn = DMat3::from_rotation_x(x.to_radians()) * DMat3::from_rotation_y(y.to_radians());
            for focal in [0.7 * size.y, 1.8 * size.y] {
                let axes = square * turn;
                let back = axes.z_axis;
                let nearest = sightings.iter().map(|s| s.position.dot(back)).fold(f64::NEG_INFINITY, f64::max);
                let distance = (focal * across.length().max(down.length())).max(nearest + 0.2);
                poses.push(Pose { axes, eye: back * distance, focal });
            }
        }
    }
    Some(poses)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sampling::{hash, unit};
    use glam::{Vec2, Vec3};

    const SIZE: Vec2 = Vec2::new(640.0, 480.0);

    fn cameras() -> Vec<Camera> {
        let at = |eye: [f32; 3], target: [f32; 3], fov: f32| Camera::look_at("", eye.into(), target.into(), fov);
        vec![
            at([0.3, 1.2, 4.0], [0.0, 1.0, 0.0], 0.8),
            at([5.0, 9.0, -3.0], [1.0, 0.0, 0.5], 0.25),
            at([-1.0, 0.4, 0.2], [2.0, 0.1, -0.3], 1.5),
            at([0.0, 8.0, 0.1], [0.0, 0.0, -1.5], 0.6),
        ]
    }

    /// What the camera sees of a scene of `planes` (point, normal), with every pixel off by up to `noise` pixels.
    fn sightings(camera: &Camera, planes: &[[Vec3; 2]], noise: f32) -> Vec<Sighting> {
        let mut found = Vec::new();
        for i in 0..3000u32 {
            let at = SIZE * Vec2::new(unit(hash(2 * i)), unit(hash(2 * i + 1)));
            let ray = camera.ray(at, SIZE);
            let hits = planes.iter().map(|[p, n]| (*p - ray.origin).dot(*n) / ray.direction.dot(*n));
            let t = hits.filter(|t| *t > 0.0 && t.is_finite()).fold(f32::INFINITY, f32::min);
            if t < 40.0 {
                let off = noise * (2.0 * Vec2::new(unit(hash(7 * i + 3)), unit(hash(5 * i + 9))) - 1.0);
                let position = (ray.origin + ray.direction * t).as_dvec3();
                found.push(Sighting { at: (at + off).as_dvec2(), position });
            }
        }
        found
    }

    fn check(camera: &Camera, planes: &[[Vec3; 2]], noise: f32, what: &str) {
        let seen = sightings(camera, planes, noise);
        assert!(seen.len() > 200, "{what}: {}", seen.len());
        let fit = fit(&seen, SIZE.as_dvec2()).unwrap();
        assert!(fit.residual <= 1e-3 + f64::from(noise), "{what}: off by {} pixels", fit.residual);
        let worst = (0..9).map(|i| SIZE * Vec2::new((i % 3) as f32, (i / 3) as f32) / 2.0).map(|at| {
            let ray = camera.ray(at, SIZE);
            let (found, _) = fit.camera.project(ray.origin + 5.0 * ray.direction, SIZE).unwrap();
            found.distance(at)
        });
        let worst = worst.fold(0.0, f32::max);
        assert!(worst < 0.05 + noise, "{what}: corners are off by {worst} pixels");
    }

    #[test]
    fn a_room_a_wall_and_a_floor_tell_the_camera() {
        let floor = [Vec3::ZERO, Vec3::Y];
        let walls = [[Vec3::new(0.0, 0.0, -3.0), Vec3::Z], [Vec3::new(-4.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.2)]];
        for (number, camera) in cameras().iter().enumerate() {
            for noise in [0.0, 0.4] {
                check(camera, &[floor, walls[0], walls[1]], noise, &format!("room, camera {number}, noise {noise}"));
            }
            if number < 3 {
                check(camera, &[floor], 0.0, &format!("floor alone, camera {number}"));
            }
        }
    }

    /// Every pixel of a picture whose size any even step through it divides.
    #[test]
    fn whole_pictures_of_any_size_tell_the_camera() {
        let camera = &cameras()[0];
        for size in
            [Vec2::new(1024.0, 768.0), Vec2::new(512.0, 512.0), Vec2::new(2048.0, 1024.0), Vec2::new(640.0, 480.0)]
        {
            let pixel = |i: usize| Vec2::new((i % size.x as usize) as f32 + 0.5, (i / size.x as usize) as f32 + 0.5);
            let seen: Vec<Sighting> = (0..(size.x * size.y) as usize)
                .map(|i| {
                    let ray = camera.ray(pixel(i), size);
                    let t = (-ray.origin.y / ray.direction.y).abs().min((-3.0 - ray.origin.z) / ray.direction.z);
                    Sighting { at: pixel(i).as_dvec2(), position: (ray.origin + ray.direction * t).as_dvec3() }
                })
                .collect();
            let fit = fit(&seen, size.as_dvec2()).unwrap();
            assert!(
                fit.residual < 1e-3 && fit.camera.position.distance(camera.position) < 1e-3,
                "{size}: {}",
                fit.residual
            );
        }
    }

    #[test]
    fn a_few_points_that_lie_wrong_do_not_matter_and_nothing_is_made_of_nothing() {
        let camera = &cameras()[0];
        let planes = [[Vec3::ZERO, Vec3::Y], [Vec3::new(0.0, 0.0, -3.0), Vec3::Z]];
        let mut seen = sightings(camera, &planes, 0.0);
        seen.iter_mut().step_by(10).for_each(|s| s.position *= 0.7);
        assert!(fit(&seen, SIZE.as_dvec2()).unwrap().residual < 0.01);
        assert!(fit(&seen[..7], SIZE.as_dvec2()).is_none());
        let spot: Vec<Sighting> = seen.iter().map(|s| Sighting { position: DVec3::ONE, ..*s }).collect();
        assert!(fit(&spot, SIZE.as_dvec2()).is_none());
        // Parallel projection is no pinhole, and the residual says so.
        let parallel: Vec<Sighting> =
            seen.iter().map(|s| Sighting { position: (s.at * 0.01).extend((s.at.x * 0.05).sin()), ..*s }).collect();
        assert!(fit(&parallel, SIZE.as_dvec2()).is_none_or(|fit| fit.residual > 0.01));
    }
}
