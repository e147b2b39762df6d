use super::*;
use crate::kernels::{average_pyramid, haar_decode, sparse_product};
use crate::transport::sparse::EntryFormat;

/// The same numbers in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (((self.0 >> 32) * end as u64) >> 32) as usize
    }

    fn unit(&mut self) -> f32 {
        self.below(1 << 24) as f32 / (1 << 24) as f32
    }
}

fn matrix(index_bits: u32, signed: bool, rows: &[Vec<(u32, f32)>]) -> SparseRows {
    SparseRows::from_rows(EntryFormat::new(index_bits, signed).unwrap(), rows.iter().map(Vec::as_slice)).unwrap()
}

/// Transfer rows over the tree of M leaves, three Haar rows for each of `scales` scale rows.
fn made_up(random: &mut Random, leaves: usize, rows: usize, scales: usize, most: usize) -> (SparseRows, SparseRows) {
    let bits = leaves.ilog2();
    let transfer: Vec<Vec<(u32, f32)>> = (0..rows)
        .map(|_| (0..random.below(most)).map(|_| (random.below(2 * leaves) as u32, random.unit())).collect())
        .collect();
    let haar: Vec<Vec<(u32, f32)>> = (0..3 * scales)
        .map(|_| {
            let mut row: Vec<(u32, f32)> = (0..random.below(most.min(leaves)))
                .map(|_| {
                    // As many on every level.
                    let level = random.below(bits as usize + 1) as u32;
                    let index = if level == 0 { 0 } else { (1 << (level - 1)) + random.below(1 << (level - 1)) };
                    (index as u32, 2.0 * random.unit() - 1.0)
                })
                .collect();
            row.sort_by_key(|entry| entry.0);
            row.dedup_by_key(|entry| entry.0);
            row
        })
        .collect();
    (matrix(bits + 1, false, &transfer), matrix(bits, true, &haar))
}

fn dense(scales: &SparseRows, row: usize) -> Vec<[f32; 4]> {
    let mut coefficients = vec![[0.0; 4]; scales.columns()];
    let mut put = |channel: usize| {
        scales.row(3 * row + channel).for_each(|(index, value)| coefficients[index][channel] = value);
    };
    (0..3).for_each(&mut put);
    let field = haar_decode(&coefficients).unwrap();
    let factors: Vec<[f32; 4]> = field.iter().map(|f| [f[0] + 1.0, f[1] + 1.0, f[2] + 1.0, 1.0]).collect();
    average_pyramid(&Device::Cpu, &factors, 1).unwrap()
}

#[test]
fn equals_the_sum_over_unpacked_pairs_and_decoded_rows() {
    let mut random = Random(5);
    for leaves in [2, 8, 512, 1024, 4096, 1 << 16] {
        let (transfer, scales) = made_up(&mut random, leaves, 40, 7, 300);
        let decoded: Vec<Vec<[f32; 4]>> = (0..7).map(|row| dense(&scales, row)).collect();
        let pairs: Vec<Pair> = (0..200).map(|_| [random.below(40) as u32, random.below(7) as u32]).collect();
        for count in 1..=6 {
            let light: Vec<[f32; 4]> =
                (0..count * leaves).map(|_| [random.unit(), random.unit(), 1.0, -random.unit()]).collect();
            let pyramids = average_pyramid(&Device::Cpu, &light, count).unwrap();
            let products = scaled_product(&Device::Cpu, &transfer, &scales, &pairs, &pyramids, count).unwrap();
            for (at, product) in products.iter().enumerate() {
                let ([row, scale], pyramid) = (pairs[at % 200], &pyramids[at / 200 * 2 * leaves..]);
                let mut expected = [0.0f64; 4];
                let mut size = 0.0;
                for (node, weight) in transfer.row(row as usize) {
                    let term =
                        |c: usize| f64::from(weight * decoded[scale as usize][node.max(1)][c] * pyramid[node][c]);
                    (0..4).for_each(|c| expected[c] += term(c));
                    size += term(0).abs().max(term(1).abs()).max(term(2).abs()).max(term(3).abs());
                }
                for c in 0..4 {
                    let off = (f64::from(product[c]) - expected[c]).abs();
                    assert!(off <= 2e-6 * size, "{leaves} leaves, product {at}.{c}: {product:?} {expected:?}");
                }
            }
        }
    }
}

#[test]
fn a_pair_without_a_scale_row_is_the_plain_product_bit_by_bit() {
    let mut random = Random(6);
    for signed in [false, true] {
        let (transfer, scales) = made_up(&mut random, 1 << 12, 300, 2, 500);
        let rows: Vec<Vec<(u32, f32)>> =
            (0..300).map(|row| transfer.row(row).map(|(column, weight)| (column as u32, weight)).collect()).collect();
        let transfer = matrix(13, signed, &rows);
        let light: Vec<[f32; 4]> = (0..3 << 13).map(|_| [random.unit(); 4]).collect();
        let pairs: Vec<Pair> = (0..300).map(|row| [row, UNSCALED]).collect();
        let scaled = scaled_product(&Device::Cpu, &transfer, &scales, &pairs, &light, 3).unwrap();
        assert_eq!(scaled, sparse_product(&Device::Cpu, &transfer, &light, 3).unwrap());
        // Between scaled ones, too.
        let mixed: Vec<Pair> = (0..300).flat_map(|row| [[row, row % 2], [row, UNSCALED]]).collect();
        let mixed = scaled_product(&Device::Cpu, &transfer, &scales, &mixed, &light, 3).unwrap();
        assert!(mixed.iter().skip(1).step_by(2).eq(&scaled));
    }
}

#[test]
fn two_leaves_by_hand() {
    // S = 1 + (0.5 + 1) on the left, 1 + (0.5 - 1) on the right, in red; blue is twice as much all over.
    let root2 = 2f32.sqrt();
    let scales = matrix(1, true, &[vec![(0, 0.5 * root2), (1, root2)], vec![], vec![(0, root2)]]);
    let transfer = matrix(2, false, &[vec![(1, 1.0), (2, 0.5), (3, 0.25), (0, 1.0)]]);
    let vector = [[0.0; 4], [4.0, 4.0, 4.0, 1.0], [2.0, 2.0, 2.0, 0.0], [8.0, 8.0, 8.0, 0.0]];
    let product = scaled_product(&Device::Cpu, &transfer, &scales, &[[0, 0]], &vector, 1).unwrap()[0];
    for (found, expected) in product.iter().zip([1.5 * 4.0 + 2.5 + 0.5 * 2.0, 7.0, 14.0, 1.0]) {
        assert!((found - expected).abs() < 1e-4, "{product:?}");
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let scales = matrix(3, true, &[vec![], vec![], vec![]]);
    let transfer = matrix(4, false, &[vec![]]);
    let run = |scales: &SparseRows, pair: Pair, length: usize| {
        scaled_product(&Device::Cpu, &transfer, scales, &[pair], &vec![[0.0; 4]; length], 1).map_err(|e| e.to_string())
    };
    assert!(run(&scales, [0, 0], 16).is_ok() && run(&scales, [0, UNSCALED], 16).is_ok());
    assert!(run(&scales, [0, 1], 16).unwrap_err().contains("pair 0 is of transfer row 0 and scale row 1"));
    assert!(run(&scales, [1, 0], 16).is_err() && run(&scales, [0, 0], 8).is_err());
    assert!(run(&matrix(4, true, &[vec![], vec![], vec![]]), [0, 0], 16).is_err());
}

/// A row of many fine wavelets that many pairs share is looked up in another table.
#[test]
fn long_runs_give_what_short_ones_give() {
    let mut random = Random(7);
    let leaves = 1 << 13;
    let (transfer, _) = made_up(&mut random, leaves, 700, 0, 100);
    let fine = |random: &mut Random| -> Vec<(u32, f32)> {
        let mut row: Vec<(u32, f32)> = (0..500).map(|_| (random.below(leaves) as u32, random.unit() - 0.5)).collect();
        row.sort_by_key(|entry| entry.0);
        row.dedup_by_key(|entry| entry.0);
        row
    };
    let scales = matrix(13, true, &(0..9).map(|_| fine(&mut random)).collect::<Vec<_>>());
    let light: Vec<[f32; 4]> = (0..2 * 2 * leaves).map(|_| [random.unit(); 4]).collect();
    let sorted: Vec<Pair> = (0..2100).map(|p| [p % 700, [0, 1, UNSCALED, 2][(p / 540) as usize]]).collect();
    let order: Vec<usize> = (0..2100).map(|i| i * 601 % 2100).collect();
    let mixed: Vec<Pair> = order.iter().map(|&i| sorted[i]).collect();
    assert!(parts(&sorted).len() == 4 && parts(&mixed).len() == 1);
    let run = |pairs: &[Pair]| scaled_product(&Device::Cpu, &transfer, &scales, pairs, &light, 2).unwrap();
    let (long, short) = (run(&sorted), run(&mixed));
    for (k, (at, &i)) in (0..2).flat_map(|k| order.iter().enumerate().map(move |pair| (k, pair))) {
        let (a, b) = (long[k * 2100 + i], short[k * 2100 + at]);
        for c in 0..4 {
            assert!((a[c] - b[c]).abs() <= 1e-5 * (1.0 + b[c].abs()), "pair {i}: {a:?} {b:?}");
        }
    }
}
