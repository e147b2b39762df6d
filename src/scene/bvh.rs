//! The bounding volume hierarchy: built by obvhs, kept in two layouts.
//!
//! `nodes` is binary, 32 bytes a node, for the GPU; `wide` holds the same tree eight children a node, for the CPU, where
//! eight boxes are tested at once. Both visit the same triangles with the same test, so they find the same hit.

use crate::device::Array;
use crate::scene::geometry::NONE;
use crate::scene::wide::{self, WideBvh, WideNode};
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::triangle::Triangle;
use std::time::Duration;

/// Binary node: a leaf holds `count` > 0 triangles from `first` in leaf order; an inner node's children are `first` and
/// `first + 1`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Node {
    pub low: [f32; 3],
    pub first: u32,
    pub high: [f32; 3],
    pub count: u32,
}

/// A triangle ready to be intersected: corner, edges to the two others, and its number in `Geometry`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Facet {
    pub corner: [f32; 3],
    pub triangle: u32,
    pub edge_u: [f32; 3],
    pub pad0: u32,
    pub edge_v: [f32; 3],
    pub pad1: u32,
}

/// `direction` need not be unit; `t` counts in its lengths.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: Vec3,
    pub direction: Vec3,
    pub t_max: f32,
}

/// `u`, `v`: barycentric weights of the second and third corner. `triangle` is `NONE` for a miss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub t: f32,
    pub triangle: u32,
    pub u: f32,
    pub v: f32,
    /// The ray came from the side that the winding calls the front.
    pub front: bool,
}

impl Hit {
    pub const MISS: Hit = Hit { t: f32::INFINITY, triangle: NONE, u: 0.0, v: 0.0, front: true };
}

#[derive(Clone, Debug, Default)]
pub struct Bvh {
    pub nodes: Array<Node>,
    /// In leaf order.
    pub facets: Array<Facet>,
    pub wide: WideBvh,
    /// Levels of the binary tree.
    pub depth: usize,
}

impl Bvh {
    /// Over the triangles that are named by number.
    pub fn build(corners: &[[[f32; 3]; 3]], named: &[u32]) -> Self {
        let triangle = |[a, b, c]: [[f32; 3]; 3]| Triangle { v0: a.into(), v1: b.into(), v2: c.into() };
        let triangles: Vec<Triangle> = named.iter().map(|&i| triangle(corners[i as usize])).collect();
        let params = BvhBuildParams { pre_split: false, max_prims_per_leaf: 4, ..BvhBuildParams::medium_build() };
        let bvh = build_bvh2_from_tris(&triangles, params, &mut Duration::default());
        let facets: Vec<Facet> = bvh
            .primitive_indices
            .iter()
            .map(|&i| facet(named[i as usize], &corners[named[i as usize] as usize]))
            .collect();
        let wide = widen(&bvh);
        let nodes = bvh.nodes.iter().map(node).collect::<Vec<_>>();
        let depth = depth(&nodes);
        Self { nodes: nodes.into(), facets: facets.into(), wide, depth }
    }

    pub fn bytes(&self) -> u64 {
        32 * self.nodes.len() as u64 + 48 * self.facets.len() as u64 + size_of_val(&self.wide.nodes[..]) as u64
    }

    /// The nearest hit before `ray.t_max`; among equals the lowest triangle number.
    pub fn closest(&self, ray: &Ray) -> Hit {
        self.wide.closest(&self.facets, ray, 0.0)
    }

    /// As `closest`, of the hits farther along than `t_min`.
    pub fn closest_beyond(&self, ray: &Ray, t_min: f32) -> Hit {
        self.wide.closest(&self.facets, ray, t_min)
    }

    /// Whether anything lies before `ray.t_max`.
    pub fn any(&self, ray: &Ray) -> bool {
        self.wide.any(&self.facets, ray)
    }
}

/// Where a ray meets one triangle: bit by bit what the whole finds when nothing is nearer.
pub fn intersect(triangle: u32, corners: &[[f32; 3]; 3], ray: &Ray) -> Option<Hit> {
    let found = wide::intersect(&facet(triangle, corners), ray, 0.0, ray.t_max);
    found.map(|(t, u, v, front)| Hit { t, triangle, u, v, front })
}

fn facet(triangle: u32, [a, b, c]: &[[f32; 3]; 3]) -> Facet {
    let (a, b, c) = (Vec3::from(*a), Vec3::from(*b), Vec3::from(*c));
    Facet { corner: a.to_array(), triangle, edge_u: (b - a).to_array(), pad0: 0, edge_v: (c - a).to_array(), pad1: 0 }
}

fn node(from: &obvhs::bvh2::node::Bvh2Node) -> Node {
    Node {
        low: from.aabb.min.to_array(),
        first: from.first_index,
        high: from.aabb.max.to_array(),
        count: from.prim_count,
    }
}

fn depth(nodes: &[Node]) -> usize {
    let (mut deepest, mut todo) = (0, vec![(0u32, 1)]);
    while let Some((index, level)) = todo.pop() {
        deepest = deepest.max(level);
        match nodes.get(index as usize) {
            Some(node) if node.count == 0 => todo.extend([(node.first, level + 1), (node.first + 1, level + 1)]),
            _ => {}
        }
    }
    deepest
}

/// Pulls grandchildren up, the largest box first, until a node has eight children.
fn widen(bvh: &Bvh2) -> WideBvh {
    let mut wide = vec![WideNode::EMPTY];
    let mut depth = 0;
    let mut todo = vec![(0u32, 0u32, 1)];
    let half_area = |index: u32| {
        let size: Vec3A = bvh.nodes[index as usize].aabb.max - bvh.nodes[index as usize].aabb.min;
        size.x * size.y + size.y * size.z + size.z * size.x
    };
    while let Some((from, into, level)) = todo.pop() {
        depth = depth.max(level);
        let root = &bvh.nodes[from as usize];
        let mut children = if root.is_leaf() { vec![from] } else { vec![root.first_index, root.first_index + 1] };
        while children.len() < 8 {
            let inner = |&(_, &index): &(usize, &u32)| !bvh.nodes[index as usize].is_leaf();
            let largest =
                children.iter().enumerate().filter(inner).max_by(|a, b| half_area(*a.1).total_cmp(&half_area(*b.1)));
            let Some((slot, &index)) = largest else { break };
            let first = bvh.nodes[index as usize].first_index;
            children[slot] = first;
            children.push(first + 1);
        }
        for (slot, &index) in children.iter().enumerate() {
            let child = &bvh.nodes[index as usize];
            let target = if child.is_leaf() {
                WideNode::leaf(child.first_index, child.prim_count)
            } else {
                wide.push(WideNode::EMPTY);
                todo.push((index, wide.len() as u32 - 1, level + 1));
                wide.len() as u32 - 1
            };
            wide[into as usize].set(slot, child.aabb.min.into(), child.aabb.max.into(), target);
        }
    }
    WideBvh { nodes: wide, depth }
}
