//! The walk through the hierarchy, nearest first: what cannot cover an open texel is skipped, triangles are drawn.
//!
//! On a face, a point is `(x, y, z)` = (along u, along v, out of the face), from the eye. A box is skipped by bounds of
//! its projection that err outwards. A triangle's three edge planes pass through the eye; the plane of an edge is made
//! from its corners in sorted order, so that both triangles that share it cut every row at the same place: no texel
//! falls between them.

use super::lanes::Lanes;
use super::mask::{Edge, Mask, Rect};
use crate::scene::Occluders;
use crate::scene::cube;
use crate::scene::occluders::{BLOCK, Block, Branch, WIDTH};
use glam::Vec3;

/// A part of the hierarchy that is still to be looked at.
#[derive(Clone, Copy)]
pub struct Waiting {
    child: u32,
    /// Depth of its nearest point.
    near: f32,
    columns: u32,
    rows: u32,
}

/// Texels by which bounds err outwards: more than rounding moves a projection, on the largest face.
const SLACK: f32 = 2e-3;
/// Nearer to the eye's plane than this, a projection has no bounds.
const NEAR: f32 = 1e-30;

/// How the world looks from a point through a face.
#[derive(Clone, Copy)]
struct Frame<L: Lanes> {
    /// Of x, y, z.
    axes: [usize; 3],
    eye: [L::F; 3],
    sign: L::F,
    half: L::F,
    middle: L::F,
    size: f32,
}

/// Closes the texels of `mask` that occluders cover as seen from `eye`.
#[inline(always)]
pub fn walk<L: Lanes>(
    lanes: L,
    occluders: &Occluders,
    eye: Vec3,
    face: usize,
    mask: &mut Mask,
    stack: &mut Vec<Waiting>,
) {
    let (axis, sign) = cube::axis(face);
    let axes = [(axis + 1) % 3, (axis + 2) % 3, axis];
    let size = mask.size() as f32;
    let frame = Frame::<L> {
        axes,
        eye: axes.map(|axis| L::splat(eye[axis])),
        sign: L::splat(sign),
        half: L::splat(0.5 * size),
        middle: L::splat(0.5 * size - 0.5),
        size,
    };
    stack.clear();
    if !occluders.branches.is_empty() {
        let all = (mask.size() as u32 - 1) << 16;
        stack.push(Waiting { child: 0, near: 0.0, columns: all, rows: all });
    }
    while let Some(item) = stack.pop() {
        if mask.is_closed() {
            return;
        }
        if !mask.any(lanes, Rect::unpack(item.columns, item.rows)) {
            continue;
        }
        if item.child & BLOCK != 0 {
            draw(lanes, &frame, &occluders.blocks[(item.child & !BLOCK) as usize], mask);
        } else {
            enter(&frame, &occluders.branches[item.child as usize], stack);
        }
    }
}

/// Puts the children that may hold texels of the face on the stack, the nearest on top.
#[inline(always)]
fn enter<L: Lanes>(frame: &Frame<L>, branch: &Branch, stack: &mut Vec<Waiting>) {
    let zero = L::splat(0.0);
    let side = |axis: usize, high: usize| L::sub(L::load(&branch.bounds[frame.axes[axis] + high]), frame.eye[axis]);
    let ends = (L::mul(side(2, 0), frame.sign), L::mul(side(2, 3), frame.sign));
    let (near, far) = (L::min(ends.0, ends.1), L::max(ends.0, ends.1));
    let one = L::splat(1.0);
    let near_scale = L::div(one, L::max(near, L::splat(NEAR)));
    let far_scale = L::div(one, L::max(far, L::splat(NEAR)));
    let bounds = |axis: usize| {
        let (low, high) = (side(axis, 0), side(axis, 3));
        let low = L::min(L::mul(low, near_scale), L::mul(low, far_scale));
        let high = L::max(L::mul(high, near_scale), L::mul(high, far_scale));
        texels(frame, low, high)
    };
    let (left, right) = bounds(0);
    let (low, high) = bounds(1);
    let mut some = L::less(zero, far) & L::at_most(left, right) & L::at_most(low, high);
    if some == 0 {
        return;
    }
    let (columns, rows, near) = (L::pack(left, right), L::pack(low, high), L::store(L::max(near, zero)));
    let base = stack.len();
    while some != 0 {
        let slot = some.trailing_zeros() as usize;
        some &= some - 1;
        let item = Waiting { child: branch.child[slot], near: near[slot], columns: columns[slot], rows: rows[slot] };
        let mut at = stack.len();
        stack.push(item);
        while at > base && stack[at - 1].near < item.near {
            stack[at] = stack[at - 1];
            at -= 1;
        }
        stack[at] = item;
    }
}

/// First and last texel whose middles lie between two coordinates of the face.
#[inline(always)]
fn texels<L: Lanes>(frame: &Frame<L>, low: L::F, high: L::F) -> (L::F, L::F) {
    let place = |at, slack: f32| L::add(L::add(L::mul(at, frame.half), frame.middle), L::splat(slack));
    let first = L::min(L::max(L::ceil(place(low, -SLACK)), L::splat(0.0)), L::splat(frame.size));
    let last = L::max(L::min(L::floor(place(high, SLACK)), L::splat(frame.size - 1.0)), L::splat(-1.0));
    (first, last)
}

/// Draws the triangles of a block.
#[inline(always)]
fn draw<L: Lanes>(lanes: L, frame: &Frame<L>, block: &Block, mask: &mut Mask) {
    let point = |corner: usize| -> [L::F; 3] {
        let at = |axis: usize| L::sub(L::load(&block.corners[corner][frame.axes[axis]]), frame.eye[axis]);
        [at(0), at(1), L::mul(at(2), frame.sign)]
    };
    let points = [point(0), point(1), point(2)];
    let least = |axis: usize| L::min(L::min(points[0][axis], points[1][axis]), points[2][axis]);
    let most = |axis: usize| L::max(L::max(points[0][axis], points[1][axis]), points[2][axis]);
    let (zero, tiny) = (L::splat(0.0), L::splat(NEAR));
    let (near, far) = (least(2), most(2));
    let front = L::less(zero, far);
    if front == 0 {
        return;
    }
    let scales = points.map(|point| L::div(L::splat(1.0), point[2]));
    let crosses = L::at_most(near, tiny) & front != 0;
    let bounds = |axis: usize| {
        let places = [0, 1, 2].map(|corner| L::mul(points[corner][axis], scales[corner]));
        let mut low = L::min(L::min(places[0], places[1]), places[2]);
        let mut high = L::max(L::max(places[0], places[1]), places[2]);
        if crosses {
            // Part of the triangle is beside or behind the eye: its projection reaches out to infinity.
            let scale = L::div(L::splat(1.0), L::max(far, tiny));
            let (least, most) = (least(axis), most(axis));
            let outer_low = L::choose_less(least, zero, L::splat(-1e30), L::mul(least, scale));
            let outer_high = L::choose_less(zero, most, L::splat(1e30), L::mul(most, scale));
            low = L::choose_less(tiny, near, low, outer_low);
            high = L::choose_less(tiny, near, high, outer_high);
        }
        texels(frame, low, high)
    };
    let (left, right) = bounds(0);
    let (low, high) = bounds(1);
    let mut some = front & L::at_most(left, right) & L::at_most(low, high);
    if some == 0 {
        return;
    }
    let (columns, rows) = (L::pack(left, right), L::pack(low, high));
    let mut edges = None;
    while some != 0 {
        let lane = some.trailing_zeros() as usize;
        some &= some - 1;
        let rect = Rect::unpack(columns[lane], rows[lane]);
        if !mask.any(lanes, rect) {
            continue;
        }
        let sides = edges.get_or_insert_with(|| sides(frame, block, &points));
        if sides.seen >> lane & 1 == 0 {
            continue;
        }
        let edge = |i: usize| Edge {
            slope: sides.slope[i][lane],
            at: sides.at[i][lane],
            left: sides.left[i] >> lane & 1 != 0,
        };
        mask.close(lanes, rect, &[edge(0), edge(1), edge(2)]);
    }
}

/// `Edge`s of eight triangles.
struct Sides {
    slope: [[f32; WIDTH]; 3],
    at: [[f32; WIDTH]; 3],
    left: [u32; 3],
    /// Triangles that are not seen exactly from the side.
    seen: u32,
}

#[inline(always)]
fn cross<L: Lanes>(a: &[L::F; 3], b: &[L::F; 3]) -> [L::F; 3] {
    let part = |i: usize, j: usize| L::sub(L::mul(a[i], b[j]), L::mul(a[j], b[i]));
    [part(1, 2), part(2, 0), part(0, 1)]
}

#[inline(always)]
fn sides<L: Lanes>(frame: &Frame<L>, block: &Block, points: &[[L::F; 3]; 3]) -> Sides {
    let zero = L::splat(0.0);
    // Exact for corners close together, where differences of `points` are not.
    let along = |from: usize, to: usize| -> [L::F; 3] {
        let axis = |axis: usize| {
            let corner = |corner: usize| L::load(&block.corners[corner][frame.axes[axis]]);
            L::sub(corner(to), corner(from))
        };
        [axis(0), axis(1), L::mul(axis(2), frame.sign)]
    };
    let (first, second, third) = (along(0, 1), along(1, 2), along(0, 2));
    let normal = cross::<L>(&first, &third);
    let products = [0, 1, 2].map(|axis| L::mul(normal[axis], points[0][axis]));
    // The volume spanned by eye and triangle: its sign says on which side of its plane the eye is.
    let volume = L::add(L::add(products[0], products[1]), products[2]);
    let facing = L::less(zero, volume);
    let mut sides =
        Sides { slope: [[0.0; WIDTH]; 3], at: [[0.0; WIDTH]; 3], left: [0; 3], seen: facing | L::less(volume, zero) };
    // Directions d in the triangle have plane . d of the volume's sign, for the third edge of the other.
    for (i, (start, edge, turn)) in [(0, first, 0), (1, second, 0), (0, third, 0xff)].into_iter().enumerate() {
        let plane = cross::<L>(&points[start], &edge);
        let bound = L::mul(L::max(L::abs(plane[1]), L::abs(plane[2])), L::splat(1e-12));
        let across = L::signed(L::max(L::abs(plane[0]), L::max(bound, L::splat(1e-37))), plane[0]);
        let slope = L::div(L::sub(zero, plane[1]), across);
        let middle = L::div(L::sub(zero, plane[2]), across);
        // u = slope v + middle, from coordinates of the face to texels.
        let corner = L::splat(1.0 / frame.size - 1.0);
        let at = L::add(L::mul(L::add(L::mul(slope, corner), middle), frame.half), frame.middle);
        sides.slope[i] = L::store(slope);
        sides.at[i] = L::store(at);
        sides.left[i] = L::less(zero, across) ^ !facing ^ turn;
    }
    sides
}
