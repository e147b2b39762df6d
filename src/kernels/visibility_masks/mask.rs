//! The texels of one face that are still open, kept so that "is any of this rectangle open?" is a word or two.
//!
//! Blocks of eight rows of 32 texels, one after another along a band of eight rows; beside each band, which of its
//! blocks hold anything.

use super::lanes::{Bits, Lanes};
use crate::scene::cube;
use crate::scene::occluders::WIDTH;
use glam::Vec3;

/// Texels from `left` to `right` and `low` to `high`, both included.
#[derive(Clone, Copy, Debug)]
pub struct Rect {
    pub left: usize,
    pub right: usize,
    pub low: usize,
    pub high: usize,
}

impl Rect {
    /// Both words as `Lanes::pack` makes them.
    #[inline(always)]
    pub fn unpack(columns: u32, rows: u32) -> Self {
        Self {
            left: columns as usize & 0xffff,
            right: columns as usize >> 16,
            low: rows as usize & 0xffff,
            high: rows as usize >> 16,
        }
    }
}

pub struct Mask {
    size: usize,
    /// Blocks along a band.
    across: usize,
    blocks: Vec<Bits>,
    /// Per band, bit i: block i holds an open texel.
    open: Vec<u32>,
    /// Blocks that hold an open texel.
    left: usize,
    /// `u` of the middles of texels, by eights.
    middles: Vec<[f32; WIDTH]>,
}

/// The bits from `low` to `high`, both below 32.
#[inline(always)]
fn span(low: usize, high: usize) -> u32 {
    (u32::MAX << low) & (u32::MAX >> (31 - high))
}

impl Mask {
    /// `size`: a multiple of 32 up to 1024.
    pub fn new(size: usize) -> Self {
        let across = size / 32;
        let middles: Vec<f32> = (0..size).map(|x| cube::middle(x, size)).collect();
        Self {
            size,
            across,
            blocks: vec![[0; WIDTH]; across * size / WIDTH],
            open: vec![0; size / WIDTH],
            left: 0,
            middles: middles.as_chunks().0.to_vec(),
        }
    }

    pub fn size(&self) -> usize {
        self.size
    }

    #[inline(always)]
    pub fn is_closed(&self) -> bool {
        self.left == 0
    }

    /// Opens the wanted texels (row-major bits) whose directions `d` have `normal . d > 0`.
    #[inline(always)]
    pub fn open<L: Lanes>(&mut self, normal: Vec3, face: usize, wanted: Option<&[u32]>) {
        let (axis, sign) = cube::axis(face);
        let (nu, nv) = (L::splat(normal[(axis + 1) % 3]), normal[(axis + 2) % 3]);
        let straight = normal[axis] * sign;
        self.left = 0;
        for band in 0..self.open.len() {
            let mut open = 0;
            for column in 0..self.across {
                let mut block = [0; WIDTH];
                for (row, bits) in block.iter_mut().enumerate() {
                    let y = band * WIDTH + row;
                    let side = nv * cube::middle(y, self.size);
                    for eight in 0..4 {
                        // The terms are added in the order of x, y, z, as a dot product does.
                        let along = L::mul(nu, L::load(&self.middles[4 * column + eight]));
                        let height = match axis {
                            0 => L::add(L::add(L::splat(straight), along), L::splat(side)),
                            1 => L::add(L::splat(side + straight), along),
                            _ => L::add(L::add(along, L::splat(side)), L::splat(straight)),
                        };
                        *bits |= L::less(L::splat(0.0), height) << (8 * eight);
                    }
                    if let Some(wanted) = wanted {
                        *bits &= wanted[y * self.across + column];
                    }
                }
                let any = block.iter().any(|row| *row != 0);
                open |= u32::from(any) << column;
                self.blocks[band * self.across + column] = block;
            }
            self.open[band] = open;
            self.left += open.count_ones() as usize;
        }
    }

    /// Whether any texel of the rectangle is open.
    #[inline(always)]
    pub fn any<L: Lanes>(&self, rect: Rect) -> bool {
        let (first, last) = (rect.left / 32, rect.right / 32);
        let (low, high) = (rect.low / WIDTH, rect.high / WIDTH);
        let across = span(first, last);
        for band in low..=high {
            let mut open = self.open[band] & across;
            while open != 0 {
                let column = open.trailing_zeros() as usize;
                open &= open - 1;
                let from = if column == first { rect.left % 32 } else { 0 };
                let to = if column == last { rect.right % 32 } else { 31 };
                let from_row = if band == low { rect.low % WIDTH } else { 0 };
                let to_row = if band == high { rect.high % WIDTH } else { WIDTH - 1 };
                if L::any(&self.blocks[band * self.across + column], from_row, to_row, span(from, to)) {
                    return true;
                }
            }
        }
        false
    }

    /// The open texels of row `y` from `left` to `right`, less than 32 apart; bit 0 is `left`.
    #[inline(always)]
    pub fn row(&self, y: usize, left: usize, right: usize) -> u32 {
        let (first, last) = (left / 32, right / 32);
        let band = &self.blocks[y / WIDTH * self.across..][..self.across];
        let word = |column: usize| u64::from(band[column][y % WIDTH]);
        let two = word(first) | word(last) << 32;
        (two >> (left % 32)) as u32 & span(0, right - left)
    }

    /// Closes one open texel.
    #[inline(always)]
    pub fn close_one(&mut self, x: usize, y: usize) {
        let (band, column) = (y / WIDTH, x / 32);
        let block = &mut self.blocks[band * self.across + column];
        block[y % WIDTH] &= !(1 << (x % 32));
        if block[y % WIDTH] == 0 && block.iter().all(|row| *row == 0) {
            self.open[band] &= !(1 << column);
            self.left -= 1;
        }
    }

    /// Closes, in each row `y` of the rectangle's bands, the texels from the largest `m y + k` of the edges that bound
    /// from the left to the smallest of the others, within the rectangle's columns.
    #[inline(always)]
    pub fn close<L: Lanes>(&mut self, rect: Rect, edges: &[Edge; 3]) {
        let across = span(rect.left / 32, rect.right / 32);
        let (left, right) = (L::splat(rect.left as f32), L::splat(rect.right as f32));
        let (before, past) = (L::splat(rect.left as f32 - 1.0), L::splat(rect.right as f32 + 1.0));
        let eight = L::load(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        for band in rect.low / WIDTH..=rect.high / WIDTH {
            let mut open = self.open[band] & across;
            if open == 0 {
                continue;
            }
            let y = L::add(L::splat((band * WIDTH) as f32), eight);
            let (mut low, mut high) = (left, right);
            for edge in edges {
                let x = L::add(L::mul(L::splat(edge.slope), y), L::splat(edge.at));
                if edge.left {
                    low = L::max(x, low);
                } else {
                    high = L::min(x, high);
                }
            }
            let low = L::min(L::ceil(low), past);
            let high = L::max(L::floor(high), before);
            while open != 0 {
                let column = open.trailing_zeros() as usize;
                open &= open - 1;
                let gone = L::columns(low, high, 32 * column as i32);
                if L::clear(&mut self.blocks[band * self.across + column], &gone) {
                    self.open[band] &= !(1 << column);
                    self.left -= 1;
                }
            }
        }
    }

    /// Writes the open texels, row-major, 32 to a word.
    pub fn write(&self, out: &mut [u32]) {
        for (band, out) in out.chunks_exact_mut(WIDTH * self.across).enumerate() {
            let blocks = &self.blocks[band * self.across..][..self.across];
            for (row, out) in out.chunks_exact_mut(self.across).enumerate() {
                out.iter_mut().zip(blocks).for_each(|(word, block)| *word = block[row]);
            }
        }
    }
}

/// A side of a triangle on the face: it crosses row `y` at `slope y + at` texels, and bounds from the left or the right.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    pub slope: f32,
    pub at: f32,
    pub left: bool,
}
