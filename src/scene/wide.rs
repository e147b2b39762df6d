//! Traversal of the eight-wide hierarchy on the CPU, with AVX2 where the processor has it and plain code where not.
//!
//! Box tests only decide what is skipped, and they err on the side of visiting; hits come from one scalar triangle
//! test (Möller and Trumbore 1997). So the result does not depend on the instructions used.

use crate::scene::bvh::{Facet, Hit, Ray};
use glam::Vec3;

/// Eight child boxes by coordinate, and what they hold: an inner node's number, or a leaf (top bit, count, first).
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct WideNode {
    /// low x, y, z, high x, y, z of the eight children.
    bounds: [[f32; 8]; 6],
    child: [u32; 8],
}

const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 26;

impl WideNode {
    /// Boxes that nothing enters.
    pub const EMPTY: Self = Self {
        bounds: [
            [f32::INFINITY; 8],
            [f32::INFINITY; 8],
            [f32::INFINITY; 8],
            [f32::NEG_INFINITY; 8],
            [f32::NEG_INFINITY; 8],
            [f32::NEG_INFINITY; 8],
        ],
        child: [0; 8],
    };

    /// A leaf of at most 31 triangles from `first` (below 2^26).
    pub fn leaf(first: u32, count: u32) -> u32 {
        assert!(first < 1 << COUNT_SHIFT && count < 32, "leaf of {count} triangles at {first}");
        LEAF | (count << COUNT_SHIFT) | first
    }

    pub fn set(&mut self, slot: usize, low: Vec3, high: Vec3, child: u32) {
        for axis in 0..3 {
            self.bounds[axis][slot] = low[axis];
            self.bounds[axis + 3][slot] = high[axis];
        }
        self.child[slot] = child;
    }
}

#[derive(Clone, Debug, Default)]
pub struct WideBvh {
    pub nodes: Vec<WideNode>,
    /// Levels of the tree; a visit leaves at most seven siblings of each waiting.
    pub depth: usize,
}

/// Ray in the form that box tests want.
struct Slabs {
    origin: [f32; 3],
    inverse: [f32; 3],
    /// Index of the near plane of each axis in `WideNode::bounds`.
    near: [usize; 3],
    far: [usize; 3],
}

/// Of each component. A zero component would make 0 x infinity in a slab test; what stands for it is as good as parallel.
pub fn inverse(direction: Vec3) -> [f32; 3] {
    direction.to_array().map(|d| 1.0 / if d.abs() < 1e-20 { 1e-20f32.copysign(d) } else { d })
}

impl Slabs {
    fn new(ray: &Ray) -> Self {
        let inverse = inverse(ray.direction);
        let near = [0, 1, 2].map(|i| if inverse[i] < 0.0 { i + 3 } else { i });
        Self { origin: ray.origin.to_array(), inverse, near, far: [0, 1, 2].map(|i| (near[i] + 3) % 6) }
    }
}

/// Widens far distances by more than the rounding of a slab test, so that no box that is touched is skipped (Ize 2013).
pub const SLACK: f32 = 1.000_000_5;

type BoxTest = fn(&WideNode, &Slabs, f32, &mut [f32; 8]) -> u32;

/// Bit i is set when child i is entered before `t_max`; `entry[i]` is where.
#[inline(always)]
fn test_boxes_plain(node: &WideNode, slabs: &Slabs, t_max: f32, entry: &mut [f32; 8]) -> u32 {
    let mut mask = 0;
    for (i, entry) in entry.iter_mut().enumerate() {
        let plane =
            |axis: usize, side: &[usize; 3]| (node.bounds[side[axis]][i] - slabs.origin[axis]) * slabs.inverse[axis];
        let near = plane(0, &slabs.near).max(plane(1, &slabs.near)).max(plane(2, &slabs.near)).max(0.0);
        let far = plane(0, &slabs.far).min(plane(1, &slabs.far)).min(plane(2, &slabs.far)).min(t_max);
        *entry = near;
        mask |= u32::from(near <= far * SLACK) << i;
    }
    mask
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
#[inline]
fn test_boxes_avx2(node: &WideNode, slabs: &Slabs, t_max: f32, entry: &mut [f32; 8]) -> u32 {
    use std::arch::x86_64::*;
    // SAFETY: the loads and the store are of eight f32 inside arrays of eight.
    unsafe {
        let plane = |axis: usize, side: &[usize; 3]| {
            let bound = _mm256_loadu_ps(node.bounds[side[axis]].as_ptr());
            _mm256_mul_ps(_mm256_sub_ps(bound, _mm256_set1_ps(slabs.origin[axis])), _mm256_set1_ps(slabs.inverse[axis]))
        };
        let near = _mm256_max_ps(
            _mm256_max_ps(plane(0, &slabs.near), plane(1, &slabs.near)),
            _mm256_max_ps(plane(2, &slabs.near), _mm256_setzero_ps()),
        );
        let far = _mm256_min_ps(
            _mm256_min_ps(plane(0, &slabs.far), plane(1, &slabs.far)),
            _mm256_min_ps(plane(2, &slabs.far), _mm256_set1_ps(t_max)),
        );
        _mm256_storeu_ps(entry.as_mut_ptr(), near);
        let inside = _mm256_cmp_ps::<_CMP_LE_OQ>(near, _mm256_mul_ps(far, _mm256_set1_ps(SLACK)));
        _mm256_movemask_ps(inside) as u32
    }
}

/// Möller–Trumbore, both sides. `None` when missed or not after `t_min` and before `t_max`.
#[inline(always)]
pub fn intersect(facet: &Facet, ray: &Ray, t_min: f32, t_max: f32) -> Option<(f32, f32, f32, bool)> {
    let (edge_u, edge_v) = (Vec3::from(facet.edge_u), Vec3::from(facet.edge_v));
    let p = ray.direction.cross(edge_v);
    let determinant = edge_u.dot(p);
    let inverse = 1.0 / determinant;
    let s = ray.origin - Vec3::from(facet.corner);
    let u = s.dot(p) * inverse;
    let q = s.cross(edge_u);
    let v = ray.direction.dot(q) * inverse;
    let t = edge_v.dot(q) * inverse;
    // Written so that NaN (a ray in the triangle's plane) misses.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > t_min && t <= t_max).then_some((t, u, v, determinant > 0.0))
}

/// Enough for the trees of some ten thousand triangles; to clear more of it for each ray takes time.
const SHALLOW: usize = 64;

/// Enough for any tree but those over heaps of coincident triangles, which pay for a longer one.
const DEEP: usize = 256;

#[inline(always)]
fn traverse<const ANY: bool, const STACK: usize>(
    bvh: &WideBvh,
    facets: &[Facet],
    ray: &Ray,
    t_min: f32,
    boxes: impl Fn(&WideNode, &Slabs, f32, &mut [f32; 8]) -> u32,
) -> Hit {
    let slabs = Slabs::new(ray);
    let mut best = Hit { t: ray.t_max, ..Hit::MISS };
    let mut here = [(0u32, 0f32); STACK];
    let mut longer;
    let stack: &mut [(u32, f32)] = if bvh.longest_stack() <= STACK {
        &mut here
    } else {
        longer = vec![(0, 0.0); bvh.longest_stack()];
        &mut longer
    };
    let mut depth = 1; // stack[0] is the root
    let mut entry = [0f32; 8];
    while depth > 0 {
        depth -= 1;
        let (target, near) = stack[depth];
        // The slack again: a hit may come out a little before its box.
        if near > best.t * SLACK {
            continue;
        }
        if target & LEAF != 0 {
            let first = (target & ((1 << COUNT_SHIFT) - 1)) as usize;
            let count = ((target & !LEAF) >> COUNT_SHIFT) as usize;
            for facet in &facets[first..first + count] {
                if let Some((t, u, v, front)) = intersect(facet, ray, t_min, best.t) {
                    if ANY {
                        return Hit { t, triangle: facet.triangle, u, v, front };
                    }
                    if t < best.t || facet.triangle < best.triangle {
                        best = Hit { t, triangle: facet.triangle, u, v, front };
                    }
                }
            }
            continue;
        }
        let node = &bvh.nodes[target as usize];
        let mut mask = boxes(node, &slabs, best.t, &mut entry);
        let base = depth;
        while mask != 0 {
            let slot = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            // Insertion keeps the nearest child on top.
            let item = (node.child[slot], entry[slot]);
            let mut at = depth;
            while !ANY && at > base && stack[at - 1].1 < item.1 {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = item;
            depth += 1;
        }
    }
    if best.triangle == Hit::MISS.triangle { Hit::MISS } else { best }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn traverse_avx2<const ANY: bool, const STACK: usize>(bvh: &WideBvh, facets: &[Facet], ray: &Ray, t_min: f32) -> Hit {
    traverse::<ANY, STACK>(bvh, facets, ray, t_min, |node, slabs, t_max, entry| {
        test_boxes_avx2(node, slabs, t_max, entry)
    })
}

fn dispatch<const ANY: bool>(bvh: &WideBvh, facets: &[Facet], ray: &Ray, t_min: f32) -> Hit {
    if bvh.nodes.is_empty() || !ray.direction.is_finite() || !ray.origin.is_finite() {
        return Hit::MISS;
    }
    match bvh.longest_stack() {
        0..=SHALLOW => dispatch_stack::<ANY, SHALLOW>(bvh, facets, ray, t_min),
        _ => dispatch_stack::<ANY, DEEP>(bvh, facets, ray, t_min),
    }
}

fn dispatch_stack<const ANY: bool, const STACK: usize>(bvh: &WideBvh, facets: &[Facet], ray: &Ray, t_min: f32) -> Hit {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the feature was just found.
        return unsafe { traverse_avx2::<ANY, STACK>(bvh, facets, ray, t_min) };
    }
    traverse::<ANY, STACK>(bvh, facets, ray, t_min, test_boxes_plain as BoxTest)
}

impl WideBvh {
    fn longest_stack(&self) -> usize {
        7 * self.depth + 8
    }

    pub fn closest(&self, facets: &[Facet], ray: &Ray, t_min: f32) -> Hit {
        dispatch::<false>(self, facets, ray, t_min)
    }

    pub fn any(&self, facets: &[Facet], ray: &Ray) -> bool {
        dispatch::<true>(self, facets, ray, 0.0).triangle != Hit::MISS.triangle
    }
}
