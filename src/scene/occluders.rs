//! The triangles of some objects, as what hides the sky: a hierarchy made for drawing masks of it.
//!
//! For: `kernels::visibility_masks`, once per group of objects. Not for: finding hits (`Bvh`).

use crate::device::Array;
use crate::scene::Geometry;
use crate::scene::bvh::{Bvh, Node};
use crate::scene::geometry::NONE;
use glam::Vec3;

/// Triangles of one block, children of one node.
pub const WIDTH: usize = 8;

/// Eight child boxes by coordinate; a child is an inner node's number, or a block's with the top bit set.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct Branch {
    /// Low x, y, z, high x, y, z of the eight children; NaN where there is no child.
    pub bounds: [[f32; WIDTH]; 6],
    pub child: [u32; WIDTH],
}

/// Set in `Branch::child` for the number of a block.
pub const BLOCK: u32 = 1 << 31;

impl Branch {
    const EMPTY: Self = Self { bounds: [[f32::NAN; WIDTH]; 6], child: [NONE; WIDTH] };
}

/// At most eight triangles by coordinate. The corners of each are sorted, so that triangles that share an edge meet it
/// in the same order and round it the same way.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// x, y, z of the eight first, second and third corners; NaN where there is no triangle.
    pub corners: [[[f32; WIDTH]; 3]; 3],
}

/// Triangles of a subset of a geometry's objects.
#[derive(Clone, Debug, Default)]
pub struct Occluders {
    /// For rays, and for the GPU.
    pub bvh: Bvh,
    /// The sorted corners of each triangle, in the order of `bvh.facets`.
    pub corners: Array<[[f32; 3]; 3]>,
    /// The root first; empty without triangles.
    pub branches: Vec<Branch>,
    pub blocks: Vec<Block>,
    /// Levels of the tree of branches; a visit leaves at most seven siblings of each waiting.
    pub depth: usize,
    /// `Geometry::lift` of the whole.
    pub lift: f32,
}

impl Occluders {
    /// The triangles of the objects whose number `casts` holds for.
    pub fn new(geometry: &Geometry, casts: impl Fn(u32) -> bool) -> Self {
        let chosen: Vec<u32> = (0..geometry.corners.len() as u32)
            .filter(|i| casts(geometry.object[*i as usize]) && !geometry.is_flat(*i as usize))
            .collect();
        let bvh = match chosen.len() {
            0 => Bvh::default(),
            all if all == geometry.bvh.facets.len() => geometry.bvh.clone(),
            _ => Bvh::build(&geometry.corners, &chosen),
        };
        let corners: Vec<[[f32; 3]; 3]> =
            bvh.facets.iter().map(|facet| sorted(geometry.corners[facet.triangle as usize])).collect();
        let mut occluders = Self { bvh, corners: corners.into(), lift: geometry.lift(), ..Self::default() };
        occluders.widen();
        occluders
    }

    pub fn triangles(&self) -> usize {
        self.bvh.facets.len()
    }

    pub fn bytes(&self) -> u64 {
        self.bvh.bytes()
            + (size_of_val(&self.corners[..]) + size_of_val(&self.branches[..]) + size_of_val(&self.blocks[..])) as u64
    }

    /// Pulls grandchildren up, the largest box first, until a branch has eight children; what holds at most eight
    /// triangles becomes a block.
    fn widen(&mut self) {
        let nodes = &self.bvh.nodes;
        if nodes.is_empty() {
            return;
        }
        let counts = counts(nodes);
        let is_block = |index: u32| counts[index as usize] as usize <= WIDTH || nodes[index as usize].count > 0;
        self.branches.push(Branch::EMPTY);
        let mut todo = vec![(0u32, 0usize, 1)];
        while let Some((from, into, level)) = todo.pop() {
            self.depth = self.depth.max(level);
            let mut children = vec![from];
            while children.len() < WIDTH {
                let inner = |&(_, &index): &(usize, &u32)| !is_block(index);
                let largest = children
                    .iter()
                    .enumerate()
                    .filter(inner)
                    .max_by(|a, b| area(nodes, *a.1).total_cmp(&area(nodes, *b.1)));
                let Some((slot, &index)) = largest else { break };
                let first = nodes[index as usize].first;
                children[slot] = first;
                children.push(first + 1);
            }
            for (slot, &index) in children.iter().enumerate() {
                let node = &nodes[index as usize];
                for axis in 0..3 {
                    self.branches[into].bounds[axis][slot] = node.low[axis];
                    self.branches[into].bounds[axis + 3][slot] = node.high[axis];
                }
                self.branches[into].child[slot] = if is_block(index) {
                    self.blocks.push(block(&self.bvh.nodes, &self.corners, index));
                    BLOCK | (self.blocks.len() as u32 - 1)
                } else {
                    self.branches.push(Branch::EMPTY);
                    todo.push((index, self.branches.len() - 1, level + 1));
                    self.branches.len() as u32 - 1
                };
            }
        }
    }
}

/// Triangles below each node.
fn counts(nodes: &[Node]) -> Vec<u32> {
    let mut order = vec![0u32];
    let mut at = 0;
    while let Some(node) = order.get(at).map(|&index| &nodes[index as usize]) {
        if node.count == 0 {
            order.extend([node.first, node.first + 1]);
        }
        at += 1;
    }
    let mut counts: Vec<u32> = nodes.iter().map(|node| node.count).collect();
    for &index in order.iter().rev() {
        let node = &nodes[index as usize];
        if node.count == 0 {
            counts[index as usize] = counts[node.first as usize] + counts[node.first as usize + 1];
        }
    }
    counts
}

fn area(nodes: &[Node], index: u32) -> f32 {
    let node = &nodes[index as usize];
    let size = Vec3::from(node.high) - Vec3::from(node.low);
    size.x * size.y + size.y * size.z + size.z * size.x
}

fn sorted(mut corners: [[f32; 3]; 3]) -> [[f32; 3]; 3] {
    corners.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    corners
}

fn block(nodes: &[Node], corners: &[[[f32; 3]; 3]], index: u32) -> Block {
    let mut block = Block { corners: [[[f32::NAN; WIDTH]; 3]; 3] };
    let mut todo = vec![index];
    let mut lane = 0;
    while let Some(index) = todo.pop() {
        let node = &nodes[index as usize];
        if node.count == 0 {
            todo.extend([node.first + 1, node.first]);
            continue;
        }
        for triangle in &corners[node.first as usize..(node.first + node.count) as usize] {
            for (corner, point) in triangle.iter().enumerate() {
                (0..3).for_each(|axis| block.corners[corner][axis][lane] = point[axis]);
            }
            lane += 1;
        }
    }
    block
}
