//! Times masks of visibility, face by face, beside rays for some of the same texels through obvhs.

use super::print;
use crate::Result;
use crate::device::Device;
use crate::kernels::visibility_masks;
use crate::scene::{Geometry, Occluders, SurfacePoint, cube};
use crate::transport::sampling;
use glam::Vec3;
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::Ray;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Points of one call of the kernel, as callers take them.
const TILE: usize = 4096;
/// Texels of a face that are traced, at least.
const TRACED: usize = 1 << 23;

/// Prints, for each of the faces, how long the masks of all points take and how many texels a second that is; how many
/// rays a second obvhs traces for every so manieth of the points; and how many of their texels differ. Points that do
/// not exist count for nothing.
pub fn run(device: &Device, geometry: &Geometry, points: &[SurfacePoint], size: usize, faces: &[usize]) -> Result<()> {
    let start = Instant::now();
    let occluders = Occluders::new(geometry, |_| true);
    let built = start.elapsed().as_secs_f64();
    let points: Vec<SurfacePoint> = points.iter().filter(|point| point.exists()).copied().collect();
    let texels = size * size;
    let stride = (points.len() * texels).div_ceil(TRACED).max(1);
    let tracer = Tracer::new(geometry);
    print(&format!(
        "{} triangles, {} samples, faces of {size} x {size}; hierarchy {:.0} ms\n{:<16} {:>10} {:>12} {:>14} {:>8} {:>16}\n",
        occluders.triangles(),
        points.len(),
        built * 1e3,
        "visibility",
        "seconds",
        "M texels/s",
        "obvhs M rays/s",
        "ratio",
        "differ, of M"
    ));
    let mut sum = 0.0;
    for &face in faces {
        let (mut drawing, mut tracing) = (Duration::ZERO, Duration::ZERO);
        let (mut rays, mut differ) = (0, 0);
        // By turns, because the machine's speed drifts.
        for (number, tile) in points.chunks(TILE).enumerate() {
            let start = Instant::now();
            let masks = visibility_masks(device, &occluders, tile, face, size, None)?;
            drawing += start.elapsed();
            let first = (stride - number * TILE % stride) % stride;
            let (some, drawn): (Vec<SurfacePoint>, Vec<&[u32]>) =
                tile.iter().copied().zip(masks.chunks(texels / 32)).skip(first).step_by(stride).unzip();
            let start = Instant::now();
            let traced = tracer.masks(&some, face, size);
            tracing += start.elapsed();
            rays += some.len() * texels;
            differ += traced.iter().zip(drawn.into_iter().flatten()).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
        }
        let seconds = drawing.as_secs_f64();
        sum += seconds;
        let rate = (points.len() * texels) as f64 / seconds * 1e-6;
        let traced = rays as f64 / tracing.as_secs_f64() * 1e-6;
        print(&format!(
            "{:<16} {seconds:>10.2} {rate:>12.1} {traced:>14.1} {:>8.1} {:>16}\n",
            cube::FACE_NAMES[face],
            rate / traced,
            format!("{differ}, {:.1}", rays as f64 * 1e-6)
        ));
    }
    print(&format!("{:<16} {sum:>10.2}\n", "together"));
    Ok(())
}

/// obvhs by itself: its eight-wide compressed tree, one ray a texel until something is hit.
struct Tracer {
    tree: CwBvh,
    /// In the order of the tree.
    triangles: Vec<RtTriangle>,
    lift: f32,
}

impl Tracer {
    fn new(geometry: &Geometry) -> Self {
        let all: Vec<Triangle> = geometry
            .corners
            .iter()
            .map(|[a, b, c]| Triangle { v0: (*a).into(), v1: (*b).into(), v2: (*c).into() })
            .collect();
        let params = BvhBuildParams { pre_split: false, ..BvhBuildParams::slow_build() };
        let tree = build_cwbvh_from_tris(&all, params, &mut Duration::default());
        let triangles = tree.primitive_indices.iter().map(|&i| RtTriangle::from(&all[i as usize])).collect();
        Self { tree, triangles, lift: geometry.lift() }
    }

    fn masks(&self, points: &[SurfacePoint], face: usize, size: usize) -> Vec<u32> {
        let directions: Vec<Vec3> =
            (0..size * size).map(|texel| cube::texel_point(face * size * size + texel, size)).collect();
        let words = directions.len() / 32;
        let mut out = vec![0; points.len() * words];
        out.par_chunks_mut(words).zip(points).for_each(|(out, point)| {
            let origin = sampling::lifted(point.position.into(), point.geometric_normal.into(), self.lift);
            let normal = Vec3::from(point.normal);
            for (word, directions) in out.iter_mut().zip(directions.chunks(32)) {
                for (bit, &direction) in directions.iter().enumerate() {
                    let open = normal.dot(direction) > 0.0 && self.misses(origin, direction);
                    *word |= u32::from(open) << bit;
                }
            }
        });
        out
    }

    fn misses(&self, origin: Vec3, direction: Vec3) -> bool {
        let ray = Ray::new_inf(origin.into(), direction.into());
        self.tree.ray_traverse_miss(ray, |ray, id| self.triangles[id].intersect(ray))
    }
}
