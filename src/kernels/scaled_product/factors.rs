//! What a row of Haar coefficients says at any node of the gather tree, on the CPU: 1 plus the mean of the row's field
//! over the node's leaves.
//!
//! The mean over a node needs only the coefficients of its ancestors: `mean(child) = mean(node) +- coefficient(node) /
//! sqrt(leaves of node)`, plus in the left child, and `mean(root) = coefficient(0) / sqrt M`. The first levels of the tree
//! are a table of all their nodes, which fits the first-level cache; the few wavelets below them are kept in lists. So a
//! row is ready in about a microsecond, and a look-up is a shift, a load, and now and then a short list. A row of many fine
//! wavelets that many pairs share gets a table of all nodes instead.

use crate::transport::sparse::{EntryFormat, SparseRows};

/// A factor of each channel of light, and 1 for the element that is carried along.
pub type Factor = [f32; 4];

/// Levels of the table below the root, as a rule.
pub const TOP: u32 = 10;

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
    /// Levels of the table below the root.
    levels: u32,
    top: Vec<Factor>,
    /// As `Wavelet::detail`, of the nodes of `top` but the last level; all 0 between fillings.
    details: Vec<Factor>,
    /// By node of the last level of `top`: number of the first and the last wavelet there, from 1; 0 for none.
    first: Vec<u32>,
    last: Vec<u32>,
    wavelets: Vec<Wavelet>,
    /// `1 / sqrt(leaves of a node)` by level.
    per_root_leaves: Vec<f32>,
}

impl Factors {
    /// For a tree of `1 << levels` leaves, with a table of at most `top` levels below the root.
    pub fn new(levels: u32, top: u32) -> Self {
        let top = top.min(levels);
        Self {
            levels: top,
            top: vec![[1.0; 4]; 2 << top],
            details: vec![[0.0; 4]; 1 << top],
            first: vec![0; 1 << top],
            last: vec![0; 1 << top],
            wavelets: Vec::new(),
            per_root_leaves: per_root_leaves(levels),
        }
    }

    /// Takes rows `3 row ..3 row + 3` (red, green, blue) in; `None`: all factors are 1.
    pub fn fill(&mut self, rows: &SparseRows, row: Option<usize>) {
        for wavelet in self.wavelets.drain(..) {
            self.first[(wavelet.node >> (wavelet.level - self.levels)) as usize & (self.last.len() - 1)] = 0;
        }
        let mut root = [1.0; 4];
        if let Some(row) = row {
            self.scatter(rows, row, &mut root);
        }
        (self.top[0], self.top[1]) = (root, root);
        for level in 0..self.levels {
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
        let detail = match (index, level < self.levels) {
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
        let top = self.under(node, level);
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
        if let Some(factor) = self.top.get(node) {
            return *factor;
        }
        let level = node.ilog2();
        let top = self.under(node, level);
        let first = self.first[top];
        if first == 0 { self.top[self.first.len() + top] } else { self.deep(node, level, top, first) }
    }

    /// The place, among the last level of the table, of the ancestor of a node of a level below.
    #[inline(always)]
    fn under(&self, node: usize, level: u32) -> usize {
        (node >> (level - self.levels)) & (self.first.len() - 1)
    }

    /// Wavelets below the table.
    pub fn deeper(&self) -> usize {
        self.wavelets.len()
    }

    #[inline(never)]
    fn deep(&self, node: usize, level: u32, top: usize, first: u32) -> Factor {
        let (mut factor, mut number) = (self.top[self.first.len() + top], first);
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
