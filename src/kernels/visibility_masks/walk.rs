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
/// A block that reaches fewer than this many texels along both sides is drawn texel by texel.
const FEW: usize = 4;

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
pub fn walk<L: Lanes>(occluders: &Occluders, eye: Vec3, face: usize, mask: &mut Mask, stack: &mut Vec<Waiting>) {
    let (axis, sign) = cube::axis(face);
    let axes = [(axis + 1) % 3, (axis + 2) % 3, axis];
    let size = mask.size() as f32;
    let frame = Frame::<L> {
        axes,
        eye: [L::splat(eye[axes[0]]), L::splat(eye[axes[1]]), L::splat(eye[axes[2]])],
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
        let rect = Rect::unpack(item.columns, item.rows);
        if item.child & BLOCK != 0 && rect.right - rect.left < FEW && rect.high - rect.low < FEW {
            draw_few(&frame, &occluders.blocks[(item.child & !BLOCK) as usize], rect, mask);
            continue;
        }
        if !mask.any::<L>(Rect::unpack(item.columns, item.rows)) {
            continue;
        }
        if item.child & BLOCK != 0 {
            draw(&frame, &occluders.blocks[(item.child & !BLOCK) as usize], mask);
        } else {
            enter(&frame, occluders, &occluders.branches[item.child as usize], stack);
        }
    }
}

/// Puts the children that may hold texels of the face on the stack, the nearest on top.
#[inline(always)]
fn enter<L: Lanes>(frame: &Frame<L>, occluders: &Occluders, branch: &Branch, stack: &mut Vec<Waiting>) {
    let zero = L::splat(0.0);
    let (first, last) = (frame.side(branch, 2, 0), frame.side(branch, 2, 3));
    let (first, last) = (L::mul(first, frame.sign), L::mul(last, frame.sign));
    let (near, far) = (L::min(first, last), L::max(first, last));
    let near_scale = L::div(L::splat(1.0), L::max(near, L::splat(NEAR)));
    let far_scale = L::div(L::splat(1.0), L::max(far, L::splat(NEAR)));
    let (left, right) = frame.bounds(branch, 0, near_scale, far_scale);
    let (low, high) = frame.bounds(branch, 1, near_scale, far_scale);
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
        if item.child & BLOCK != 0 {
            L::prefetch(&occluders.blocks[(item.child & !BLOCK) as usize]);
        } else {
            L::prefetch(&occluders.branches[item.child as usize]);
        }
        let mut at = stack.len();
        stack.push(item);
        while at > base && stack[at - 1].near < item.near {
            stack[at] = stack[at - 1];
            at -= 1;
        }
        stack[at] = item;
    }
}

impl<L: Lanes> Frame<L> {
    /// Low (0) or high (3) sides of children along an axis, from the eye.
    #[inline(always)]
    fn side(&self, branch: &Branch, axis: usize, high: usize) -> L::F {
        L::sub(L::load(&branch.bounds[self.axes[axis] + high]), self.eye[axis])
    }

    /// Texels that the boxes of children reach along an axis.
    #[inline(always)]
    fn bounds(&self, branch: &Branch, axis: usize, near_scale: L::F, far_scale: L::F) -> (L::F, L::F) {
        let (low, high) = (self.side(branch, axis, 0), self.side(branch, axis, 3));
        let low = L::min(L::mul(low, near_scale), L::mul(low, far_scale));
        let high = L::max(L::mul(high, near_scale), L::mul(high, far_scale));
        self.texels(low, high)
    }

    /// Coordinates of the face as texels.
    #[inline(always)]
    fn place(&self, at: L::F) -> L::F {
        L::add(L::mul(at, self.half), self.middle)
    }

    /// First and last texel whose middles lie between two coordinates of the face.
    #[inline(always)]
    fn texels(&self, low: L::F, high: L::F) -> (L::F, L::F) {
        let (low, high) = (L::sub(self.place(low), L::splat(SLACK)), L::add(self.place(high), L::splat(SLACK)));
        let first = L::min(L::max(L::ceil(low), L::splat(0.0)), L::splat(self.size));
        let last = L::max(L::min(L::floor(high), L::splat(self.size - 1.0)), L::splat(-1.0));
        (first, last)
    }

    /// Corner `corner` of eight triangles, from the eye.
    #[inline(always)]
    fn point(&self, block: &Block, corner: usize) -> [L::F; 3] {
        let corners = &block.corners[corner];
        let x = L::sub(L::load(&corners[self.axes[0]]), self.eye[0]);
        let y = L::sub(L::load(&corners[self.axes[1]]), self.eye[1]);
        let z = L::sub(L::load(&corners[self.axes[2]]), self.eye[2]);
        [x, y, L::mul(z, self.sign)]
    }

    /// From one corner of eight triangles to another: exact for corners close together, where differences of points from
    /// the eye are not.
    #[inline(always)]
    fn along(&self, block: &Block, from: usize, to: usize) -> [L::F; 3] {
        let (from, to) = (&block.corners[from], &block.corners[to]);
        let x = L::sub(L::load(&to[self.axes[0]]), L::load(&from[self.axes[0]]));
        let y = L::sub(L::load(&to[self.axes[1]]), L::load(&from[self.axes[1]]));
        let z = L::sub(L::load(&to[self.axes[2]]), L::load(&from[self.axes[2]]));
        [x, y, L::mul(z, self.sign)]
    }
}

#[inline(always)]
fn least<L: Lanes>(points: &[[L::F; 3]; 3], axis: usize) -> L::F {
    L::min(L::min(points[0][axis], points[1][axis]), points[2][axis])
}

#[inline(always)]
fn most<L: Lanes>(points: &[[L::F; 3]; 3], axis: usize) -> L::F {
    L::max(L::max(points[0][axis], points[1][axis]), points[2][axis])
}

/// Texels that the projections of eight triangles reach along an axis. `scales`: one over the depths of the corners;
/// `near`, `far`: the least and the largest depth.
#[inline(always)]
fn reach<L: Lanes>(
    frame: &Frame<L>,
    points: &[[L::F; 3]; 3],
    axis: usize,
    scales: &[L::F; 3],
    (near, far): (L::F, L::F),
    crosses: bool,
) -> (L::F, L::F) {
    let (a, b) = (L::mul(points[0][axis], scales[0]), L::mul(points[1][axis], scales[1]));
    let c = L::mul(points[2][axis], scales[2]);
    let mut low = L::min(L::min(a, b), c);
    let mut high = L::max(L::max(a, b), c);
    if crosses {
        // Part of the triangle is beside or behind the eye: its projection reaches out to infinity.
        let (zero, tiny) = (L::splat(0.0), L::splat(NEAR));
        let scale = L::div(L::splat(1.0), L::max(far, tiny));
        let (least, most) = (least::<L>(points, axis), most::<L>(points, axis));
        let outer_low = L::choose_less(least, zero, L::splat(-1e30), L::mul(least, scale));
        let outer_high = L::choose_less(zero, most, L::splat(1e30), L::mul(most, scale));
        low = L::choose_less(tiny, near, low, outer_low);
        high = L::choose_less(tiny, near, high, outer_high);
    }
    frame.texels(low, high)
}

/// Draws a block that reaches few texels: each open one against all triangles.
#[inline(always)]
fn draw_few<L: Lanes>(frame: &Frame<L>, block: &Block, rect: Rect, mask: &mut Mask) {
    let mut open = [0u32; FEW];
    let mut any = 0;
    for y in rect.low..=rect.high {
        open[y - rect.low] = mask.row(y, rect.left, rect.right);
        any |= open[y - rect.low];
    }
    if any == 0 {
        return;
    }
    let points = [frame.point(block, 0), frame.point(block, 1), frame.point(block, 2)];
    let sides = sides(frame, block, &points);
    for y in rect.low..=rect.high {
        let mut open = open[y - rect.low];
        if open == 0 {
            continue;
        }
        let row = L::splat(y as f32);
        let a = L::add(L::mul(sides.slope[0], row), sides.at[0]);
        let b = L::add(L::mul(sides.slope[1], row), sides.at[1]);
        let c = L::add(L::mul(sides.slope[2], row), sides.at[2]);
        while open != 0 {
            let x = rect.left + open.trailing_zeros() as usize;
            open &= open - 1;
            let at = L::splat(x as f32);
            let inside = L::at_most(L::mul(a, sides.turn[0]), L::mul(at, sides.turn[0]))
                & L::at_most(L::mul(b, sides.turn[1]), L::mul(at, sides.turn[1]))
                & L::at_most(L::mul(c, sides.turn[2]), L::mul(at, sides.turn[2]));
            if inside & sides.seen != 0 {
                mask.close_one(x, y);
            }
        }
    }
}

/// Draws the triangles of a block.
#[inline(always)]
fn draw<L: Lanes>(frame: &Frame<L>, block: &Block, mask: &mut Mask) {
    let points = [frame.point(block, 0), frame.point(block, 1), frame.point(block, 2)];
    let (near, far) = (least::<L>(&points, 2), most::<L>(&points, 2));
    let front = L::less(L::splat(0.0), far);
    if front == 0 {
        return;
    }
    let one = L::splat(1.0);
    let scales = [L::div(one, points[0][2]), L::div(one, points[1][2]), L::div(one, points[2][2])];
    let crosses = L::at_most(near, L::splat(NEAR)) & front != 0;
    let (left, right) = reach(frame, &points, 0, &scales, (near, far), crosses);
    let (low, high) = reach(frame, &points, 1, &scales, (near, far), crosses);
    let mut some = front & L::at_most(left, right) & L::at_most(low, high);
    if some == 0 {
        return;
    }
    let (columns, rows) = (L::pack(left, right), L::pack(low, high));
    // The texels that are open now; drawing may close more.
    let mut todo = 0;
    while some != 0 {
        let lane = some.trailing_zeros() as usize;
        some &= some - 1;
        todo |= u32::from(mask.any::<L>(Rect::unpack(columns[lane], rows[lane]))) << lane;
    }
    if todo == 0 {
        return;
    }
    let sides = sides(frame, block, &points);
    todo &= sides.seen;
    let sides = sides.stored();
    while todo != 0 {
        let lane = todo.trailing_zeros() as usize;
        todo &= todo - 1;
        let rect = Rect::unpack(columns[lane], rows[lane]);
        mask.close::<L>(rect, &[sides.edge(0, lane), sides.edge(1, lane), sides.edge(2, lane)]);
    }
}

/// `Edge`s of eight triangles.
struct Sides<L: Lanes> {
    slope: [L::F; 3],
    at: [L::F; 3],
    /// 1 where the triangle lies to the right of the edge, -1 where it lies to the left.
    turn: [L::F; 3],
    /// Triangles that are not seen exactly from the side.
    seen: u32,
}

/// The same, triangle by triangle.
struct Stored {
    slope: [[f32; WIDTH]; 3],
    at: [[f32; WIDTH]; 3],
    left: [u32; 3],
}

impl<L: Lanes> Sides<L> {
    #[inline(always)]
    fn stored(&self) -> Stored {
        let zero = L::splat(0.0);
        Stored {
            slope: [L::store(self.slope[0]), L::store(self.slope[1]), L::store(self.slope[2])],
            at: [L::store(self.at[0]), L::store(self.at[1]), L::store(self.at[2])],
            left: [L::less(zero, self.turn[0]), L::less(zero, self.turn[1]), L::less(zero, self.turn[2])],
        }
    }
}

impl Stored {
    #[inline(always)]
    fn edge(&self, side: usize, lane: usize) -> Edge {
        Edge { slope: self.slope[side][lane], at: self.at[side][lane], left: self.left[side] >> lane & 1 != 0 }
    }
}

#[inline(always)]
fn minor<L: Lanes>(a: &[L::F; 3], b: &[L::F; 3], i: usize, j: usize) -> L::F {
    L::sub(L::mul(a[i], b[j]), L::mul(a[j], b[i]))
}

#[inline(always)]
fn cross<L: Lanes>(a: &[L::F; 3], b: &[L::F; 3]) -> [L::F; 3] {
    [minor::<L>(a, b, 1, 2), minor::<L>(a, b, 2, 0), minor::<L>(a, b, 0, 1)]
}

#[inline(always)]
fn sides<L: Lanes>(frame: &Frame<L>, block: &Block, points: &[[L::F; 3]; 3]) -> Sides<L> {
    let zero = L::splat(0.0);
    let (first, second, third) = (frame.along(block, 0, 1), frame.along(block, 1, 2), frame.along(block, 0, 2));
    let normal = cross::<L>(&first, &third);
    // The volume spanned by eye and triangle: its sign says on which side of its plane the eye is.
    let volume = L::add(L::mul(normal[0], points[0][0]), L::mul(normal[1], points[0][1]));
    let volume = L::add(volume, L::mul(normal[2], points[0][2]));
    let facing = L::signed(L::splat(1.0), volume);
    // Directions d in the triangle have plane . d of the volume's sign, for the third edge of the other.
    let a = line(frame, &points[0], &first);
    let b = line(frame, &points[1], &second);
    let c = line(frame, &points[0], &third);
    Sides {
        slope: [a.0, b.0, c.0],
        at: [a.1, b.1, c.1],
        turn: [L::mul(a.2, facing), L::mul(b.2, facing), L::mul(L::sub(zero, c.2), facing)],
        seen: L::less(zero, volume) | L::less(volume, zero),
    }
}

/// Where the plane through the eye, `start` and `start + edge` cuts row y of the face: at texel `slope y + at`. Third:
/// 1 where directions d to the right have plane . d > 0, else -1.
#[inline(always)]
fn line<L: Lanes>(frame: &Frame<L>, start: &[L::F; 3], edge: &[L::F; 3]) -> (L::F, L::F, L::F) {
    let plane = cross::<L>(start, edge);
    // A plane along the rows is tilted by far less than rounding does.
    let least = L::mul(L::max(L::abs(plane[1]), L::abs(plane[2])), L::splat(1e-12));
    let across = L::signed(L::max(L::abs(plane[0]), L::max(least, L::splat(1e-37))), plane[0]);
    let scale = L::div(L::splat(-1.0), across);
    let (slope, middle) = (L::mul(plane[1], scale), L::mul(plane[2], scale));
    // u = slope v + middle, from coordinates of the face to texels.
    let corner = L::splat(1.0 / frame.size - 1.0);
    let at = frame.place(L::add(L::mul(slope, corner), middle));
    (slope, at, L::signed(L::splat(1.0), across))
}
