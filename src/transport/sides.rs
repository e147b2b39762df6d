//! Which sides of which surfaces can take part in light transport at all.
//!
//! A wall has two sides, a solid has an inside that nothing ever sees. Gather samples there would be wasted, and one
//! sample for both sides would leak light through the wall. So surfaces are cut into connected parts, rays from both
//! sides of each part find which other sides it sees, and the live sides are those that light can reach from the
//! samples that are looked at. Deterministic; it depends on the view only through which space the view is in. What moves
//! is looked at in several poses (`Geometry::over_time`), so that the sides are the same in all frames.

use crate::Result;
use crate::kernels::transfer_rows::unit_ray;
use crate::memo::{Key, Memo};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::gather::Live;
use crate::transport::sampling;
use rayon::prelude::*;
use std::collections::HashMap;

/// About as many rays are cast in all, however many parts there are. Up to 1024 parts, each side gets its fill.
const RAYS_IN_ALL: usize = 1 << 22;
/// Places on a side that are looked from, and rays from each, at most.
const PLACES: usize = 64;
const RAYS: usize = 32;
/// Rays from each place, at least.
const FEWEST: usize = 8;
/// A share of rays below this is a crack between triangles, not a view.
const CRACK: f32 = 0.002;

/// `seen`: surface points that are looked at. `memo`: other frames see the same surfaces from elsewhere.
///
/// # Errors
/// None of its own; as `memo`.
pub fn live_sides(geometry: &Geometry, seen: &[SurfacePoint], memo: &dyn Memo) -> Result<Live> {
    let mut parts: Vec<&[u8]> = vec![b"sides that see each other"];
    parts.extend(geometry.over_time().iter().map(|pose| &pose.fingerprint[..]));
    let sights = memo.remember(Key::of(&parts), Sights::bytes, || Ok(Sights::of(geometry)))?;
    Ok(sights.live(geometry, seen))
}

/// Which sides of connected parts see each other at any time.
struct Sights {
    /// Of each triangle.
    part: Vec<u32>,
    /// By side: front and back of part 0, of part 1, ...
    edges: Vec<Vec<usize>>,
}

impl Sights {
    fn of(geometry: &Geometry) -> Self {
        let poses = geometry.over_time();
        let part = connected_parts(&poses[0]);
        let parts = part.iter().max().map_or(0, |&last| last as usize + 1);
        let mut edges = vec![Vec::new(); 2 * parts];
        for pose in poses {
            for (edges, more) in edges.iter_mut().zip(views(pose, &part, parts)) {
                edges.extend(more);
            }
        }
        Self { part, edges }
    }

    fn bytes(&self) -> u64 {
        4 * self.part.len() as u64 + self.edges.iter().map(|to| 24 + 8 * to.len() as u64).sum::<u64>()
    }

    fn live(&self, geometry: &Geometry, seen: &[SurfacePoint]) -> Live {
        let Self { part, edges } = self;
        let mut live = vec![false; edges.len()];
        let mut todo: Vec<usize> = Vec::new();
        let mut last = usize::MAX;
        for point in seen.iter().filter(|point| point.exists()) {
            let facing = geometry.area_vector(point.triangle as usize).dot(point.geometric_normal.into()) >= 0.0;
            let start = side(part, point.triangle, facing);
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
        // What sees nothing sends light to nothing; whether it is in the picture must not matter.
        if (0..live.len()).any(|side| live[side] && !edges[side].is_empty()) {
            live.iter_mut().zip(edges).for_each(|(live, edges)| *live &= !edges.is_empty());
        }
        part.iter().map(|&p| u8::from(live[2 * p as usize]) | u8::from(live[2 * p as usize + 1]) << 1).collect()
    }
}

/// Of a part, that a side of a triangle belongs to.
fn side(part: &[u32], triangle: u32, front: bool) -> usize {
    2 * part[triangle as usize] as usize + usize::from(!front)
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

/// Places on each side, and rays from each place. Many places see more than many rays from one.
fn pilot(parts: usize) -> (usize, u32) {
    let share = (RAYS_IN_ALL / (2 * parts).max(1)).clamp(FEWEST, PLACES * RAYS);
    let rays = (share / PLACES).max(FEWEST);
    (share / rays, rays as u32)
}

/// For every side, the sides that it sees, or that see it, by more than a crack.
fn views(geometry: &Geometry, part: &[u32], parts: usize) -> Vec<Vec<usize>> {
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); parts];
    for (triangle, &p) in part.iter().enumerate().filter(|(triangle, _)| !geometry.is_flat(*triangle)) {
        members[p as usize].push(triangle as u32);
    }
    let ((places, rays_each), lift) = (pilot(parts), geometry.lift());
    let counted: Vec<(usize, HashMap<usize, u32>, u32)> = members
        .par_iter()
        .enumerate()
        .flat_map_iter(|(p, triangles)| [true, false].map(|front| (p, triangles, front)))
        .map(|(p, triangles, front)| {
            let mut hits = HashMap::new();
            let step = triangles.len().div_ceil(places).max(1);
            let chosen: Vec<u32> = triangles.iter().copied().step_by(step).collect();
            // Few triangles are looked from at several places each.
            let repeats = (places / chosen.len().max(1)).clamp(1, 32) as u32;
            let mut rays = 0;
            for (i, &triangle) in chosen.iter().enumerate() {
                for repeat in 0..repeats {
                    let seed = sampling::hash((p as u32) << 12 ^ (i as u32 * 37 + repeat));
                    let at = sampling::triangle(sampling::lattice(repeat, repeats, sampling::shift(seed)));
                    let point = geometry.surface_point(triangle as usize, at.x, at.y, front);
                    for ray in 0..rays_each {
                        let at = sampling::lattice(ray, rays_each, sampling::shift(!seed));
                        let ray = unit_ray(&point, at, lift);
                        let hit = geometry.bvh.closest(&ray);
                        rays += 1;
                        if hit.triangle != SurfacePoint::NOWHERE.triangle {
                            *hits.entry(side(part, hit.triangle, hit.front)).or_insert(0) += 1;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memo::NoMemo;
    use crate::scene::geometry::{GeometryBuilder, Mesh};
    use glam::{Mat4, Vec3};

    #[test]
    fn few_parts_are_looked_from_in_full_and_many_share_the_rays() {
        for few in [0, 1, 2, 300, 1024] {
            assert_eq!(pilot(few), (64, 32), "{few} parts");
        }
        for many in [1025, 3000, 20_000, 262_144] {
            let (places, rays) = pilot(many);
            assert!(places >= 1 && rays >= 8 && 2 * many * places * rays as usize <= RAYS_IN_ALL, "{many} parts");
        }
        assert_eq!(pilot(10_000_000), (1, 8));
    }

    /// Closed boxes over a floor: nearly all insides stay dead when each part has few rays.
    #[test]
    fn insides_stay_dead_among_many_parts() {
        let mut builder = GeometryBuilder::default();
        let mut cube = |centre: Vec3, size: Vec3| {
            let corner = |i: usize| Vec3::from([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 0.5 } else { -0.5 }));
            let positions: Vec<[f32; 3]> = (0..8).map(|i| corner(i).to_array()).collect();
            // Counter-clockwise from outside.
            let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
            let indices: Vec<u32> = faces.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).collect();
            let mesh = Mesh { positions: &positions, normals: None, uvs: None, indices: &indices, material: 0 };
            let place = Mat4::from_translation(centre) * Mat4::from_scale(size);
            let object = builder.object("cubes");
            builder.add(object, &mesh, place).expect("a sound mesh");
        };
        cube(Vec3::new(40.0, -1.0, 40.0), Vec3::new(100.0, 1.0, 100.0));
        for i in 0..3000 {
            cube(Vec3::new((i % 55) as f32 * 1.5, 0.3, (i / 55) as f32 * 1.5), Vec3::ONE);
        }
        let geometry = builder.finish(vec!["stone".into()]).expect("triangles");
        let live = live_sides(&geometry, &[geometry.surface_point(12, 0.3, 0.3, true)], &NoMemo).expect("sides");
        assert!(live.iter().all(|&sides| sides & 1 == 1), "all fronts are live");
        // Rays that start within the lift of an edge may slip out of a box.
        let backs = live.iter().filter(|&&sides| sides & 2 != 0).count();
        assert!(backs * 20 < live.len(), "{backs} of {} backs are live", live.len());
    }
}
