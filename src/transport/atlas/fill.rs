//! Texels of an atlas as points on surfaces.

use super::Atlas;
use super::unwrap::unwrap;
use crate::progress::Progress;
use crate::scene::geometry::NONE;
use crate::scene::{Camera, Geometry, SurfacePoint};
use crate::transport::Samples;
use crate::{Result, memory};
use rayon::prelude::*;
use std::sync::Arc;

/// A sample in the middle of every texel that a surface covers, on the front of its triangle; `NOWHERE` in all others.
///
/// # Errors
/// No layout of that size; too little memory; `Cancelled`.
pub fn texel_samples(geometry: &Geometry, size: usize, progress: Progress) -> Result<Samples> {
    let what = format!("{size} x {size} texels");
    memory::require(64 * (size * size) as u64, &what, "lower the size of texel_samples")?;
    let atlas = unwrap(geometry, size, progress)?;
    let (owners, _) = owners(&atlas);
    let texel = |(texel, &triangle): (usize, &u32)| {
        if triangle == NONE {
            return (SurfacePoint::NOWHERE, [0.0; 2]);
        }
        let [u, v] = barycentrics(&atlas, triangle as usize, texel);
        (geometry.surface_point(triangle as usize, u, v, true), [u, v])
    };
    let (points, barycentrics): (Vec<_>, Vec<_>) = owners.par_iter().enumerate().with_min_len(4096).map(texel).unzip();
    Ok(Samples {
        width: size,
        height: size,
        across: 1,
        down: 1,
        camera: Camera::default(),
        atlas: Some(Arc::new(atlas)),
        geometry: geometry.fingerprint,
        points: points.into(),
        barycentrics: barycentrics.into(),
    })
}

/// The triangle whose inside holds the middle of each texel, `NONE` for none; where several do, the first. And how many
/// texels more than one claims.
pub fn owners(atlas: &Atlas) -> (Vec<u32>, usize) {
    let size = atlas.size;
    let mut owners = vec![NONE; size * size];
    let mut twice = 0;
    for (triangle, corners) in (0u32..).zip(&atlas.uvs) {
        let corners = corners.map(|uv| uv.map(|x| f64::from(x) * size as f64));
        let range = |axis: usize| {
            let (low, high) = corners.iter().fold((f64::MAX, f64::MIN), |(l, h), c| (l.min(c[axis]), h.max(c[axis])));
            (low - 0.5).ceil().max(0.0) as usize..((high - 0.5).floor() + 1.0).clamp(0.0, size as f64) as usize
        };
        for y in range(1) {
            for x in range(0) {
                // Neighbours that share an edge may both hold a middle on it.
                let inside = inside(&corners, x, y);
                if inside < 0.0 {
                    continue;
                }
                let owner = &mut owners[y * size + x];
                match *owner {
                    NONE => *owner = triangle,
                    _ => twice += usize::from(inside > 1e-6),
                }
            }
        }
    }
    (owners, twice)
}

/// The least barycentric coordinate of a texel's middle: below 0 outside.
fn inside(corners: &[[f64; 2]; 3], x: usize, y: usize) -> f64 {
    let [u, v] = solve(corners, x as f64 + 0.5, y as f64 + 0.5);
    u.min(v).min(1.0 - u - v)
}

/// Barycentrics of a place in the plane of a triangle.
fn solve([a, b, c]: &[[f64; 2]; 3], x: f64, y: f64) -> [f64; 2] {
    let (e, f) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
    let p = [x - a[0], y - a[1]];
    let area = e[0] * f[1] - f[0] * e[1];
    [(p[0] * f[1] - f[0] * p[1]) / area, (e[0] * p[1] - p[0] * e[1]) / area]
}

fn barycentrics(atlas: &Atlas, triangle: usize, texel: usize) -> [f32; 2] {
    let corners = atlas.uvs[triangle].map(|uv| uv.map(|x| f64::from(x) * atlas.size as f64));
    let (x, y) = (texel % atlas.size, texel / atlas.size);
    solve(&corners, x as f64 + 0.5, y as f64 + 0.5).map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Scene, builtin};
    use glam::Vec3;

    #[test]
    fn every_texel_has_one_place_and_every_surface_its_share() {
        let scene: Scene = builtin::scene("room").unwrap();
        let geometry = &scene.geometry;
        let samples = texel_samples(geometry, 256, Progress::silent()).unwrap();
        let covered = samples.points.iter().filter(|point| point.exists()).count();
        assert!(covered > 256 * 256 / 4, "{covered}");
        // As many texels a square metre everywhere, within the unwrapper's distortion.
        let total: f32 = (0..geometry.corners.len()).map(|t| geometry.area(t)).sum();
        for object in 0..geometry.objects.len() as u32 {
            let own = |t: &usize| geometry.object[*t] == object;
            let area: f32 = (0..geometry.corners.len()).filter(own).map(|t| geometry.area(t)).sum();
            let texels = samples.points.iter().filter(|point| point.object == object).count();
            let (expected, found) = (area / total, texels as f32 / covered as f32);
            assert!((found / expected - 1.0).abs() < 0.25, "object {object}: {found} of texels, {expected} of area");
        }
        // Neighbours in a chart are neighbours in space.
        let mut near = 0;
        let mut far = 0;
        for i in 0..covered.min(256 * 255) {
            let (a, b) = (samples.points[i], samples.points[i + 1]);
            if a.exists() && b.exists() && a.triangle == b.triangle {
                let step = Vec3::from(a.position).distance(Vec3::from(b.position));
                if step < 0.2 { near += 1 } else { far += 1 }
            }
        }
        assert!(near > 1000 && far == 0, "{near} {far}");
    }

    #[test]
    fn overlaps_are_counted() {
        let triangle = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let other = [[1.0, 1.0], [0.0, 1.0], [1.0, 0.0]];
        let atlas = |uvs: Vec<[[f32; 2]; 3]>| Atlas { size: 64, uvs: uvs.into(), from_file: true };
        let (owned, twice) = owners(&atlas(vec![triangle, other]));
        assert_eq!((owned.iter().filter(|t| **t == NONE).count(), twice), (0, 0));
        let (_, twice) = owners(&atlas(vec![triangle, triangle]));
        assert!(twice > 1900, "{twice}");
    }
}
