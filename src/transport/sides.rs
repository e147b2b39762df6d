//! Which sides of which surfaces can take part in light transport at all.
//!
//! A wall has two sides, a solid has an inside that nothing ever sees. Gather samples there would be wasted, and one
//! sample for both sides would leak light through the wall. So surfaces are cut into connected parts, rays from both
//! sides of each part find which other sides it sees, and the live sides are those that light can reach from the
//! samples that are looked at. Deterministic; it depends on the view only through which space the view is in.

use crate::kernels::transfer_rows::unit_ray;
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::gather::Live;
use crate::transport::sampling;
use rayon::prelude::*;
use std::collections::HashMap;

const RAYS: u32 = 32;
/// A share of rays below this is a crack between triangles, not a view.
const CRACK: f32 = 0.002;

/// `seen`: surface points that are looked at.
pub fn live_sides(geometry: &Geometry, seen: &[SurfacePoint]) -> Live {
    let part = connected_parts(geometry);
    let parts = part.iter().max().map_or(0, |&last| last as usize + 1);
    let node = |triangle: u32, front: bool| 2 * part[triangle as usize] as usize + usize::from(!front);
    let edges = views(geometry, &part, parts, node);

    let mut live = vec![false; 2 * parts];
    let mut todo: Vec<usize> = Vec::new();
    let mut last = usize::MAX;
    for point in seen.iter().filter(|point| point.exists()) {
        let facing = geometry.area_vector(point.triangle as usize).dot(point.geometric_normal.into()) >= 0.0;
        let start = node(point.triangle, facing);
        if start != last && !live[start] {
            live[start] = true;
            todo.push(start);
        }
        last = start;
    }
    while let Some(from) = todo.pop() {
        for &to in &edges[from] {
            if !live[to] {
                live[to] = true;
                todo.push(to);
            }
        }
    }
    part.iter().map(|&p| u8::from(live[2 * p as usize]) | u8::from(live[2 * p as usize + 1]) << 1).collect()
}

/// Triangles that share a corner position belong to one part.
fn connected_parts(geometry: &Geometry) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..geometry.corners.len() as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    let mut owner: HashMap<[u32; 3], u32> = HashMap::new();
    for (triangle, corners) in geometry.corners.iter().enumerate() {
        for corner in corners {
            // + 0.0 makes -0 and 0 the same.
            let first = *owner.entry(corner.map(|x| (x + 0.0).to_bits())).or_insert(triangle as u32);
            let (a, b) = (root(&mut parent, first), root(&mut parent, triangle as u32));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut number = HashMap::new();
    (0..parent.len() as u32)
        .map(|i| {
            let root = root(&mut parent, i);
            let next = number.len() as u32;
            *number.entry(root).or_insert(next)
        })
        .collect()
}

/// For every side, the sides that it sees, or that see it, by more than a crack.
fn views(geometry: &Geometry, part: &[u32], parts: usize, node: impl Fn(u32, bool) -> usize + Sync) -> Vec<Vec<usize>> {
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); parts];
    for (triangle, &p) in part.iter().enumerate() {
        members[p as usize].push(triangle as u32);
    }
    let counted: Vec<(usize, HashMap<usize, u32>, u32)> = members
        .par_iter()
        .enumerate()
        .flat_map_iter(|(p, triangles)| [true, false].map(|front| (p, triangles, front)))
        .map(|(p, triangles, front)| {
            let mut hits = HashMap::new();
            let step = triangles.len().div_ceil(64).max(1);
            let chosen: Vec<u32> = triangles.iter().copied().step_by(step).collect();
            // Few triangles are looked from at several places each.
            let repeats = (64 / chosen.len().max(1)).clamp(1, 32) as u32;
            let mut rays = 0;
            for (i, &triangle) in chosen.iter().enumerate() {
                for repeat in 0..repeats {
                    let seed = sampling::hash((p as u32) << 12 ^ (i as u32 * 37 + repeat));
                    let at = sampling::triangle(sampling::lattice(repeat, repeats, sampling::shift(seed)));
                    let point = geometry.surface_point(triangle as usize, at.x, at.y, front);
                    for ray in 0..RAYS {
                        let ray =
                            unit_ray(&point, sampling::lattice(ray, RAYS, sampling::shift(!seed)), geometry.lift());
                        let hit = geometry.bvh.closest(&ray);
                        rays += 1;
                        if hit.triangle != SurfacePoint::NOWHERE.triangle {
                            *hits.entry(node(hit.triangle, hit.front)).or_insert(0) += 1;
                        }
                    }
                }
            }
            (2 * p + usize::from(!front), hits, rays)
        })
        .collect();
    let mut edges = vec![Vec::new(); 2 * parts];
    for (from, hits, rays) in counted {
        for (to, count) in hits {
            if count as f32 >= CRACK * rays as f32 {
                edges[from].push(to);
                edges[to].push(from);
            }
        }
    }
    edges
}
