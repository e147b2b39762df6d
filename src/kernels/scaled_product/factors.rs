//! What a row of Haar coefficients says at any node of the gather tree, on the CPU: 1 plus the mean of the row's field
//! over the node's leaves.
//!
//! The mean over a node needs only the coefficients of its ancestors: `mean(child) = mean(node) +- coefficient(node) /
//! sqrt(leaves of node)`, plus in the left child, and `mean(root) = coefficient(0) / sqrt M`. The first levels of the tree
//! are a table of all their nodes, which fits the first-level cache; the few wavelets below them are kept in lists. So a
//! row is ready in about a microsecond, and a look-up is a shift, a load, and now and then a short list.

use crate::transport::sparse::{EntryFormat, SparseRows};

/// A factor of each channel of light, and 1 for the element that is carried along.
pub type Factor = [f32; 4];

/// Levels of the table below the root.
const TOP: u32 = 10;
/// Nodes of its last level.
const LAST: usize = 1 << TOP;

/// A coefficient of each channel at or below the last level of the table, over the square root of its node's leaves.
struct Wavelet {
    detail: Factor,
    node: u32,
    level: u32,
    /// Number of the next, finer one under the same node of the table's last level, from 1; 0 for none.
    next: u32,
}

/// The factors of one row; meant to be filled again and again.
pub struct Factors {
    top: Box<[Factor; 2 * LAST]>,
    /// As `Wavelet::detail`, of the nodes of `top` but the last level; all 0 between fillings.
    details: Box<[Factor; LAST]>,
    /// By node of the last level of `top`: number of the first and the last wavelet there, from 1; 0 for none.
    first: Box<[u32; LAST]>,
    last: Box<[u32; LAST]>,
    wavelets: Vec<Wavelet>,
    /// `1 / sqrt(leaves of a node)` by level.
    per_root_leaves: Vec<f32>,
}

impl Factors {
    /// For a tree of `1 << levels` leaves.
    pub fn new(levels: u32) -> Self {
        Self {
            top: Box::new([[1.0; 4]; 2 * LAST]),
            details: Box::new([[0.0; 4]; LAST]),
            first: Box::new([0; LAST]),
            last: Box::new([0; LAST]),
            wavelets: Vec::new(),
            per_root_leaves: per_root_leaves(levels),
        }
    }

    /// Takes rows `3 row ..3 row + 3` (red, green, blue) in; `None`: all factors are 1.
    pub fn fill(&mut self, rows: &SparseRows, row: Option<usize>) {
        for wavelet in self.wavelets.drain(..) {
            self.first[under(wavelet.node as usize, wavelet.level - TOP)] = 0;
        }
        let mut root = [1.0; 4];
        if let Some(row) = row {
            self.scatter(rows, row, &mut root);
        }
        (self.top[0], self.top[1]) = (root, root);
        for level in 0..self.per_root_leaves.len().min(TOP as usize) {
            let (means, children) = self.top[1 << level..4 << level].split_at_mut(1 << level);
            let details = &mut self.details[1 << level..2 << level];
            for ((mean, children), detail) in means.iter().zip(children.as_chunks_mut().0).zip(details) {
                *children = halves(mean, detail);
                *detail = [0.0; 4];
            }
        }
    }

    /// Puts the coefficients of three rows where they belong. Mostly the three have the same wavelets, each of which is
    /// then looked for once.
    fn scatter(&mut self, rows: &SparseRows, row: usize, root: &mut Factor) {
        let format = rows.format();
        let channel = |channel: usize| {
            let row = 3 * row + channel;
            (&rows.entries()[rows.offsets()[row] as usize..rows.offsets()[row + 1] as usize], rows.scale()[row])
        };
        let [(red, r), (green, g), (blue, b)] = [0, 1, 2].map(channel);
        let same = |(a, b): (&u32, &u32)| format.unpack(*a).0 == format.unpack(*b).0;
        let alike = red.len() == green.len() && red.len() == blue.len();
        if alike && red.iter().zip(green).all(same) && red.iter().zip(blue).all(same) {
            for ((red, green), blue) in red.iter().zip(green).zip(blue) {
                self.put(format, *red, root, [0, 1, 2], [(*red, r), (*green, g), (*blue, b)]);
            }
        } else {
            for (channel, (entries, scale)) in [(red, r), (green, g), (blue, b)].into_iter().enumerate() {
                entries.iter().for_each(|&entry| self.put(format, entry, root, [channel], [(entry, scale)]));
            }
        }
    }

    #[inline(always)]
    fn put<const C: usize>(
        &mut self,
        format: EntryFormat,
        entry: u32,
        root: &mut Factor,
        channels: [usize; C],
        values: [(u32, f32); C],
    ) {
        let index = format.unpack(entry).0;
        let level = (index | 1).ilog2();
        let per_root_leaves = self.per_root_leaves[level as usize];
        let detail = match (index, index < LAST) {
            (0, _) => root,
            (_, true) => &mut self.details[index],
            (_, false) => self.deep_detail(index, level),
        };
        for (channel, (entry, scale)) in channels.into_iter().zip(values) {
            detail[channel] += format.unpack(entry).1 as f32 * scale * per_root_leaves;
        }
    }

    /// The place of a wavelet at or below the last level of the table.
    fn deep_detail(&mut self, node: usize, level: u32) -> &mut Factor {
        let top = under(node, level - TOP);
        let number = self.wavelets.len() as u32 + 1;
        if self.first[top] == 0 {
            self.first[top] = number;
        } else {
            self.wavelets[self.last[top] as usize - 1].next = number;
        }
        self.last[top] = number;
        self.wavelets.push(Wavelet { detail: [0.0; 4], node: node as u32, level, next: 0 });
        &mut self.wavelets[number as usize - 1].detail
    }

    /// The factor at a node of the tree; at node 0, which stands for no light, that of the root.
    #[inline(always)]
    pub fn at(&self, node: usize) -> Factor {
        if node < 2 * LAST {
            return self.top[node];
        }
        let level = node.ilog2();
        let top = under(node, level - TOP);
        let first = self.first[top];
        if first == 0 { self.top[LAST + top] } else { self.deep(node, level, top, first) }
    }

    #[inline(never)]
    fn deep(&self, node: usize, level: u32, top: usize, first: u32) -> Factor {
        let (mut factor, mut number) = (self.top[LAST + top], first);
        while number != 0 {
            let Wavelet { detail, node: ancestor, level: above, next } = &self.wavelets[number as usize - 1];
            // A finer wavelet's shift is out of range or finds another node.
            let levels = level.wrapping_sub(*above);
            if levels.wrapping_sub(1) < 32 && node >> levels == *ancestor as usize {
                let sign = if node >> (levels - 1) & 1 == 0 { 1.0 } else { -1.0 };
                factor = std::array::from_fn(|c| factor[c] + sign * detail[c]);
            }
            number = *next;
        }
        factor
    }
}

/// The place, among the last level of the table, of the ancestor `levels` above a node.
#[inline(always)]
fn under(node: usize, levels: u32) -> usize {
    (node >> levels) & (LAST - 1)
}

/// `1 / sqrt(leaves of a node)` by level, for a tree of `1 << levels` leaves; one for each level that has wavelets, and
/// the root's in any case.
pub fn per_root_leaves(levels: u32) -> Vec<f32> {
    (0..levels.max(1)).map(|level| 0.5f32.powi((levels - level.min(levels)) as i32).sqrt()).collect()
}

/// The factors of the left and the right child.
#[inline(always)]
fn halves(mean: &Factor, detail: &Factor) -> [Factor; 2] {
    [std::array::from_fn(|c| mean[c] + detail[c]), std::array::from_fn(|c| mean[c] - detail[c])]
}
