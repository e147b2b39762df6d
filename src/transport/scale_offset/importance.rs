//! How much of what a row of the transfer receives comes from each node of the gather tree: where an error of the scale
//! shows, and where it does not.

#[derive(Default)]
pub struct Importance {
    /// Weights that the row gives to each node itself.
    own: Vec<f32>,
    /// Those of the node and of all below it.
    below: Vec<f32>,
    /// The node's part of what its ancestors have; known for children of nodes that were entered.
    inherited: Vec<f32>,
    /// Bit n: `below` of node n is set.
    has_below: Vec<u64>,
    /// Nodes of which `inherited` is set.
    entered: Vec<u32>,
    total: f32,
}

impl Importance {
    /// Takes the weights of another row over the tree of `count` gather samples.
    pub fn load(&mut self, count: usize, row: impl Iterator<Item = (usize, f32)>) {
        for word in 0..self.has_below.len() {
            while self.has_below[word] != 0 {
                let node = 64 * word + self.has_below[word].trailing_zeros() as usize;
                (self.own[node], self.below[node]) = (0.0, 0.0);
                self.has_below[word] &= self.has_below[word] - 1;
            }
        }
        self.entered.iter().for_each(|&node| self.inherited[node as usize] = 0.0);
        self.entered.clear();
        self.total = 0.0;
        self.has_below.resize((2 * count).div_ceil(64), 0);
        for list in [&mut self.own, &mut self.below, &mut self.inherited] {
            list.resize(2 * count, 0.0);
        }
        for (node, weight) in row.filter(|(node, _)| *node > 0) {
            self.own[node] += weight;
            self.total += weight;
            self.below[node] += weight;
            self.has_below[node / 64] |= 1 << (node % 64);
        }
        // Children come before their parents, from the last node to the first: each hands up what it has once.
        for word in (0..self.has_below.len()).rev() {
            let mut todo = self.has_below[word];
            while todo != 0 {
                let bit = 63 - todo.leading_zeros();
                let node = 64 * word + bit as usize;
                let parent = node / 2;
                if parent > 0 {
                    self.below[parent] += self.below[node];
                    self.has_below[parent / 64] |= 1 << (parent % 64);
                }
                // What is left of this word, with parents that have just come in.
                todo = self.has_below[word] & ((1 << bit) - 1);
            }
        }
    }

    /// Share of the row's light, when all senders are alike, that comes from a node whose parent was entered.
    pub fn share(&self, node: usize) -> f32 {
        if self.total > 0.0 { (self.below[node] + self.inherited[node]) / self.total } else { 0.0 }
    }

    /// Asks for the children of a node next.
    pub fn enter(&mut self, node: usize) {
        let half = 0.5 * (self.inherited[node] + self.own[node]);
        for child in [2 * node, 2 * node + 1] {
            self.inherited[child] = half;
            self.entered.push(child as u32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_each_level_add_up() {
        let mut importance = Importance::default();
        for row in [vec![(1, 2.0), (5, 1.0), (8, 1.0)], vec![(3, 0.5)]] {
            importance.load(8, row.iter().copied());
            let total: f32 = row.iter().map(|(_, weight)| weight).sum();
            (1..8).for_each(|node| importance.enter(node));
            for level in 0..4 {
                let sum: f32 = (1 << level..2 << level).map(|node| importance.share(node)).sum();
                assert!((sum - 1.0).abs() < 1e-6, "level {level}: {sum}");
            }
            if total == 4.0 {
                // A quarter of node 1, an eighth of it in turn, and its own.
                assert_eq!(importance.share(5), (0.25 * 2.0 + 1.0) / 4.0);
                assert_eq!(importance.share(8), (0.125 * 2.0 + 1.0) / 4.0);
            }
        }
    }
}
