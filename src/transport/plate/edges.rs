//! Antialiased edges of a plate. Where a pixel shows several surfaces, the averages of their positions and normals lie on
//! none of them: such pixels are found, and put on the surface beside them that they show most of.

use super::passes::Passes;
use crate::scene::Camera;
use crate::scene::bvh::Ray;
use crate::transport::shadow::kinship::{Kin, pixel_angle};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// What a pixel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pixel {
    /// It shows no surface.
    Nothing,
    /// It shows one.
    Whole,
    /// It shows several, and is put on one of them.
    Filled,
    /// It shows several, and nothing whole is near: it stays where the averages are.
    Lost,
}

/// Averages of normals shorter than this are of several surfaces: two that meet at 60 degrees, a twelfth of one.
const BENT: f32 = 0.97;
/// A neighbour is on the same surface from this kinship on.
const SAME: f32 = 0.5;
/// How far a surface beside is looked for, pixels.
const REACH: i64 = 3;

/// Positions and unit normals, none of them between surfaces if that can be helped.
pub struct Mended {
    pub positions: Vec<Vec3>,
    /// Zero where there is nothing.
    pub normals: Vec<Vec3>,
    pub pixels: Vec<Pixel>,
}

/// Finds and fills. The camera says how large a pixel is on its surface, and where its middle meets the one beside it.
pub fn mend(passes: &Passes, camera: &Camera) -> Mended {
    let (width, height) = (passes.width as i64, passes.height as i64);
    let angle = pixel_angle(camera, passes.height);
    let kin = |pixel: usize| {
        let (position, normal) = (passes.positions[pixel], passes.normals[pixel].normalize_or_zero());
        let depth = (camera.position - position).dot(camera.world_from_camera.z_axis).abs();
        Kin { position, normal, object: None, footprint: depth * angle }
    };
    let beside = |pixel: usize, dx: i64, dy: i64| {
        let (x, y) = (pixel as i64 % width + dx, pixel as i64 / width + dy);
        ((0..width).contains(&x) && (0..height).contains(&y)).then(|| (y * width + x) as usize)
    };
    // A row of mixed pixels looks like a strip of surface along itself, never across.
    let whole = |pixel: usize| {
        let own = kin(pixel);
        let like =
            |dx, dy| beside(pixel, dx, dy).is_some_and(|other| passes.exists(other) && own.with(&kin(other)) >= SAME);
        passes.normals[pixel].length() >= BENT && (like(-1, 0) || like(1, 0)) && (like(0, -1) || like(0, 1))
    };
    let count = passes.width * passes.height;
    let mut pixels: Vec<Pixel> = (0..count)
        .into_par_iter()
        .with_min_len(4096)
        .map(|pixel| match () {
            () if !passes.exists(pixel) => Pixel::Nothing,
            () if whole(pixel) => Pixel::Whole,
            () => Pixel::Lost,
        })
        .collect();
    let size = Vec2::new(width as f32, height as f32);
    let fill = |pixel: usize| -> Option<(Vec3, Vec3)> {
        let own = passes.positions[pixel];
        let found = (1..=REACH).find_map(|reach| {
            let ring = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
            let others = ring.filter_map(|(dx, dy)| beside(pixel, dx, dy)).filter(|at| pixels[*at] == Pixel::Whole);
            // The average lies nearest to what it is most of.
            others.min_by(|a, b| {
                let away = |at: &usize| passes.positions[*at].distance(own);
                away(a).total_cmp(&away(b))
            })
        })?;
        let middle = Vec2::new((pixel as i64 % width) as f32 + 0.5, (pixel as i64 / width) as f32 + 0.5);
        let Kin { position, normal, footprint, .. } = kin(found);
        Some((extended(&camera.ray(middle, size), position, normal, footprint), normal))
    };
    let filled: Vec<(usize, Option<(Vec3, Vec3)>)> = (0..count)
        .into_par_iter()
        .filter(|pixel| pixels[*pixel] == Pixel::Lost)
        .map(|pixel| (pixel, fill(pixel)))
        .collect();
    let mut positions = passes.positions.clone();
    let mut normals: Vec<Vec3> = passes.normals.iter().map(|normal| normal.normalize_or_zero()).collect();
    for (pixel, fill) in filled {
        if let Some((position, normal)) = fill {
            (positions[pixel], normals[pixel], pixels[pixel]) = (position, normal, Pixel::Filled);
        }
    }
    Mended { positions, normals, pixels }
}

/// Where a ray meets the plane through a point near it; the point itself where that is far away.
fn extended(ray: &Ray, position: Vec3, normal: Vec3, footprint: f32) -> Vec3 {
    let slope = ray.direction.dot(normal);
    let met = ray.origin + ray.direction * ((position - ray.origin).dot(normal) / slope);
    // On a surface that is seen from the side, pixels lie far apart.
    let stretch = (slope.abs() / ray.direction.length()).max(0.05);
    let near = met.is_finite() && met.distance(position) <= 2.0 * REACH as f32 * footprint / stretch;
    if near { met } else { position }
}
