//! From what one point sees of the gather samples to one sparse row, in either basis.

/// Turns node numbers (0 for none) into sorted (node, weight) pairs; each number weighs 1 / rays.
pub fn count_nodes(nodes: &mut [u32], rays: u32, row: &mut Vec<(u32, f32)>) {
    row.clear();
    let weight = 1.0 / rays as f32;
    nodes.sort_unstable();
    for run in nodes.chunk_by(|a, b| a == b) {
        if run[0] != 0 {
            row.push((run[0], run.len() as f32 * weight));
        }
    }
}

/// All weights that are not zero, as leaves of the tree.
pub fn leaves(weights: &[f32], row: &mut Vec<(u32, f32)>) {
    row.clear();
    let seen = weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
    row.extend(seen.map(|(leaf, &weight)| ((weights.len() + leaf) as u32, weight)));
}

/// Merges sibling leaves and nodes of nearly equal weight, bottom up, as long as what is moved stays below `slack` of
/// the row's total. What is hidden is never merged with what is seen. `leaves` are the weights of all M gather samples.
pub fn merge_siblings(leaves: &[f32], slack: f32, row: &mut Vec<(u32, f32)>) {
    row.clear();
    let total: f32 = leaves.iter().sum();
    let mut allowance = slack * total;
    // One pair may take a share of it that leaves something for the others.
    let most = allowance / 64.0;
    // `None`: the node is already in the row, by its parts.
    let mut level: Vec<Option<f32>> = leaves.iter().map(|&weight| Some(weight)).collect();
    let mut first = leaves.len() as u32;
    let mut put = |node: u32, weight: Option<f32>| {
        if let Some(weight) = weight.filter(|weight| *weight > 0.0) {
            row.push((node, weight));
        }
    };
    while level.len() > 1 {
        let mut above = Vec::with_capacity(level.len() / 2);
        for (pair, node) in level.as_chunks::<2>().0.iter().zip((first..).step_by(2)) {
            let merged = match *pair {
                [Some(a), Some(b)] => {
                    let moved = 0.5 * (a - b).abs();
                    let fits = moved <= most.min(allowance) && (a == 0.0) == (b == 0.0);
                    fits.then(|| {
                        allowance -= moved;
                        a + b
                    })
                }
                _ => None,
            };
            if merged.is_none() {
                put(node, pair[0]);
                put(node + 1, pair[1]);
            }
            above.push(merged);
        }
        level = above;
        first /= 2;
    }
    put(1, level[0]);
    row.sort_unstable_by_key(|entry| entry.0);
}

/// Scratch for `haar_row`: the dense coefficients of one row, and which are set.
#[derive(Clone)]
pub struct HaarScratch {
    dense: Vec<f32>,
    touched: Vec<u32>,
}

impl HaarScratch {
    /// For `count` gather samples.
    pub fn new(count: usize) -> Self {
        Self { dense: vec![0.0; count], touched: Vec::new() }
    }

    /// The `coefficients` largest Haar coefficients of a row of (node, weight) pairs, in order of their number.
    ///
    /// A weight spread evenly over a node's leaves reaches only the wavelets of the node's ancestors, with the sign of
    /// the half it lies in: `+-w / sqrt(leaves of the ancestor)`; the mean gets `w / sqrt(M)`. Wavelet `i` belongs to
    /// tree node `i`, and 0 is the mean: the order of figure 4.5.
    pub fn haar_row(&mut self, row: &mut Vec<(u32, f32)>, coefficients: usize) {
        let count = self.dense.len();
        let mut add = |index: u32, value: f32| {
            let cell = &mut self.dense[index as usize];
            if *cell == 0.0 {
                self.touched.push(index);
            }
            *cell += value;
        };
        for &(node, weight) in row.iter() {
            add(0, weight / (count as f32).sqrt());
            let mut node = node;
            while node > 1 {
                let parent = node / 2;
                let leaves = count >> parent.ilog2();
                let sign = if node % 2 == 0 { 1.0 } else { -1.0 };
                add(parent, sign * weight / (leaves as f32).sqrt());
                node = parent;
            }
        }
        // A cell that fell back to zero is listed twice.
        self.touched.sort_unstable();
        self.touched.dedup();
        row.clear();
        row.extend(self.touched.iter().map(|&index| (index, self.dense[index as usize])));
        self.touched.iter().for_each(|&index| self.dense[index as usize] = 0.0);
        self.touched.clear();
        if row.len() > coefficients {
            row.select_nth_unstable_by(coefficients, |a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
            row.truncate(coefficients);
            row.sort_unstable_by_key(|entry| entry.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Device;
    use crate::kernels::haar_encode;

    #[test]
    fn haar_rows_are_the_transform_of_the_spread_weights() {
        let nodes = [(9, 0.5), (3, 0.25), (20, 0.125), (1, 2.0)];
        let mut row = nodes.to_vec();
        HaarScratch::new(16).haar_row(&mut row, 16);
        let mut leaves = [[0.0; 4]; 16];
        for (node, weight) in nodes {
            let level = u32::ilog2(node);
            let span = 16 >> level;
            let first = (node as usize - (1 << level)) * span;
            leaves[first..first + span].iter_mut().for_each(|leaf| leaf[0] += weight / span as f32);
        }
        let expected = haar_encode(&Device::Cpu, &leaves, 1).unwrap();
        for (index, expected) in expected.iter().enumerate() {
            let found = row.iter().find(|e| e.0 == index as u32).map_or(0.0, |e| e.1);
            assert!((found - expected[0]).abs() < 1e-6, "coefficient {index}: {found} {expected:?}");
        }
    }

    #[test]
    fn truncation_keeps_the_largest() {
        let mut row = vec![(16, 1.0)];
        HaarScratch::new(16).haar_row(&mut row, 2);
        // Wavelet 8 is the narrowest above leaf 16, then 4.
        assert_eq!(row.iter().map(|e| e.0).collect::<Vec<_>>(), [4, 8]);
    }

    #[test]
    fn counting_merging() {
        let mut row = Vec::new();
        count_nodes(&mut [5, 0, 3, 5], 4, &mut row);
        assert_eq!(row, [(3, 0.25), (5, 0.5)]);
        merge_siblings(&[1.0, 1.0, 0.0, 3.0], 0.0, &mut row);
        assert_eq!(row, [(2, 2.0), (7, 3.0)]);
        merge_siblings(&[1.0; 8], 0.0, &mut row);
        assert_eq!(row, [(1, 8.0)]);
    }
}
