//! What a row of Haar coefficients says at any node of the gather tree, as the GPU goes down to it: see `factors`.

use super::factors::per_root_leaves;
use crate::transport::sparse::SparseRows;

/// Bits of the factors of red, green and blue, and where the records of the node's two children begin, counted from the
/// tree's first record; 0 where the factor is the same in all that lies below.
pub type Record = [u32; 4];

/// Makes the tree of one row after another.
pub struct Trees {
    per_root_leaves: Vec<f32>,
    factors: Vec<[f32; 3]>,
    details: Vec<[f32; 3]>,
    links: Vec<u32>,
    /// The record whose children each pair of records is.
    parents: Vec<u32>,
}

impl Trees {
    /// For rows over `1 << levels` leaves.
    pub fn new(levels: u32) -> Self {
        let per_root_leaves = per_root_leaves(levels);
        Self { per_root_leaves, factors: vec![], details: vec![], links: vec![], parents: vec![] }
    }

    /// Appends the records of rows `3 row ..3 row + 3`; the first is the root's.
    pub fn append(&mut self, rows: &SparseRows, row: usize, records: &mut Vec<Record>) {
        self.details.clear();
        self.links.clear();
        self.parents.clear();
        self.details.push([0.0; 3]);
        self.links.push(0);
        let mut root = [1.0; 3];
        for (channel, row) in (3 * row..3 * row + 3).enumerate() {
            for (index, coefficient) in rows.row(row) {
                if index == 0 {
                    root[channel] += coefficient * self.per_root_leaves[0];
                    continue;
                }
                let level = index.ilog2();
                let mut record = 0;
                for below in (0..level).rev() {
                    record = self.children(record) + (index >> below & 1);
                }
                self.children(record);
                self.details[record][channel] += coefficient * self.per_root_leaves[level as usize];
            }
        }
        self.factors.clear();
        self.factors.push(root);
        for &parent in &self.parents {
            let (mean, detail) = (self.factors[parent as usize], self.details[parent as usize]);
            self.factors.push(std::array::from_fn(|c| mean[c] + detail[c]));
            self.factors.push(std::array::from_fn(|c| mean[c] - detail[c]));
        }
        records.extend(self.factors.iter().zip(&self.links).map(|(factor, link)| {
            let [r, g, b] = factor.map(f32::to_bits);
            [r, g, b, *link]
        }));
    }

    /// Where the records of a record's children begin; makes them where there are none.
    fn children(&mut self, record: usize) -> usize {
        if self.links[record] == 0 {
            self.links[record] = self.links.len() as u32;
            self.links.extend([0; 2]);
            self.details.extend([[0.0; 3]; 2]);
            self.parents.push(record as u32);
        }
        self.links[record] as usize
    }
}
