//! Times the kernels that relighting is made of, on made-up data, beside the rate at which this machine streams memory
//! in the same run.

use super::{head, time};
use crate::device::{Array, Device};
use crate::kernels::{self, colour_edits::ColourEdit};
use crate::transport::sparse::{EntryFormat, SparseRows};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use std::hint::black_box;

pub fn run(device: &Device) {
    head("kernels");
    stream();
    for (rows, entries, index_bits, signed, count) in [
        (307_200, 100, 16, true, 1),
        (307_200, 100, 16, true, 4),
        (30_000, 700, 17, false, 1),
        (30_000, 700, 17, false, 2),
        (30_000, 700, 17, false, 4),
    ] {
        product(device, rows, entries, EntryFormat { index_bits, signed }, count);
    }
    for (pairs, scales, count) in [(45_000, 1, 1), (45_000, 15_000, 1), (45_000, 45_000, 1), (45_000, 15_000, 4)] {
        scaled(device, pairs, scales, count);
    }
    for count in [1, 4] {
        vectors(device, count);
    }
    edits(device);
}

/// Reads an array larger than the caches with every thread.
fn stream() {
    let data: Vec<u64> = (0..64u64 << 20).collect();
    time("streaming read, 512 MiB", 8 * data.len(), || {
        let sum =
            data.par_chunks(1 << 16).map(|chunk| chunk.iter().fold(0, |sum, &x| sum ^ x)).reduce(|| 0, |a, b| a ^ b);
        black_box(sum);
    });
}

fn product(device: &Device, rows: usize, entries: usize, format: EntryFormat, count: usize) {
    let mut random = Random(7);
    let matrix = transfer(&mut random, rows, entries, format);
    let vectors: Vec<[f32; 4]> = (0..count * format.columns()).map(|_| [random.unit(); 4]).collect();
    let name = format!("sparse_product {rows} x {entries}, {count} vectors");
    time(&name, matrix.bytes() as usize, || {
        black_box(kernels::sparse_product(device, &matrix, &vectors, count).expect("fits"));
    });
}

/// A row's columns as transfer has them: coarse nodes, a neighbourhood that it shares with the rows beside it, and a
/// quarter of its entries anywhere; sorted.
fn transfer(random: &mut Random, rows: usize, entries: usize, format: EntryFormat) -> SparseRows {
    let last_weight = format.max_weight() as u32;
    let mut packed = Vec::with_capacity(rows * entries);
    for row in 0..rows {
        let centre = (row * format.columns() / rows) as u32;
        let mut row: Vec<(u32, u32)> = (0..entries as u32)
            .map(|j| {
                let column = match j % 4 {
                    0 => random.below(1024),
                    1 | 2 => (centre + random.below(4096)) % format.columns() as u32,
                    _ => random.below(format.columns() as u32),
                };
                (column, 1 + random.below(last_weight))
            })
            .collect();
        row.sort_unstable();
        packed.extend(row.iter().map(|(column, weight)| column << (32 - format.index_bits) | weight));
    }
    let offsets: Vec<u32> = (0..=rows).map(|row| (row * entries) as u32).collect();
    SparseRows::new(offsets, packed, vec![1e-4; rows], format).expect("made to fit")
}

/// Transfer rows scaled by sampled edits of 100 coefficients, half of them coarse, the others anywhere along the finest
/// edges of what was selected.
fn scaled(device: &Device, pairs: usize, scales: usize, count: usize) {
    let (entries, leaves) = (632, 1u32 << 16);
    let mut random = Random(9);
    let format = EntryFormat::new(17, false).expect("17 bits");
    let matrix = transfer(&mut random, pairs.min(30_000), entries, format);
    let mut coefficients = Vec::new();
    let haar = EntryFormat::new(16, true).expect("16 bits");
    let rows: Vec<Vec<(u32, f32)>> = (0..3 * scales)
        .map(|row| {
            if row % 3 == 0 {
                coefficients = (0..50).chain((50..100).map(|_| random.below(leaves))).collect();
                coefficients.sort_unstable();
            }
            coefficients.iter().map(|&index| (index, random.unit())).collect()
        })
        .collect();
    let rows = SparseRows::from_rows(haar, rows.iter().map(Vec::as_slice)).expect("made to fit");
    let transfer_rows = matrix.rows();
    let pairs: Vec<[u32; 2]> =
        (0..pairs).map(|p| [(p * transfer_rows / pairs) as u32, (p * scales / pairs) as u32]).collect();
    let vectors: Vec<[f32; 4]> = (0..count * format.columns()).map(|_| [random.unit(); 4]).collect();
    let name = format!("scaled_product {} x {entries}, {scales} scales, {count} vectors", pairs.len());
    time(&name, 4 * entries * pairs.len() + rows.bytes() as usize, || {
        black_box(kernels::scaled_product(device, &matrix, &rows, &pairs, &vectors, count).expect("fits"));
    });
}

fn vectors(device: &Device, count: usize) {
    let mut random = Random(3);
    let light: Vec<[f32; 4]> = (0..count << 16).map(|_| [random.unit(); 4]).collect();
    time(&format!("haar_encode 65536, {count} vectors"), 16 * light.len(), || {
        black_box(kernels::haar_encode(device, &light, count).expect("fits"));
    });
    time(&format!("average_pyramid 65536, {count} vectors"), 16 * light.len(), || {
        black_box(kernels::average_pyramid(device, &light, count).expect("fits"));
    });
    let (samples, rows) = (640 * 480, 30_000);
    let light: Vec<[f32; 4]> = (0..count * rows).map(|_| [random.unit(); 4]).collect();
    let near = |n: usize, j: usize| ((n / 10 + j * 37) % rows) as u32;
    let indices: Vec<[u32; 4]> = (0..samples).map(|n| std::array::from_fn(|j| near(n, j))).collect();
    let (indices, weights) = (Array::from(indices), Array::from(vec![[0.4, 0.3, 0.2, 0.1]; samples]));
    time(&format!("interpolate 640 x 480, {count} vectors"), 32 * samples, || {
        black_box(kernels::interpolate(device, &indices, &weights, &light, count).expect("fits"));
    });
}

fn edits(device: &Device) {
    let (samples, count) = (640 * 480, 4);
    let atoms = vec![[0.5, 0.25, 0.125, 0.0]; count * samples];
    let edits: Vec<ColourEdit> = (0..3)
        .map(|i| ColourEdit {
            atoms: ColourEdit::mask([i, i + 1]),
            matrix: Mat3::from_diagonal(Vec3::splat(1.5)),
            curve: vec![],
            receiver: Some(vec![0.5; samples].into()),
            gain: None,
        })
        .collect();
    let parts: Vec<&[[f32; 4]]> = atoms.chunks(samples).collect();
    time("colour_edits 640 x 480, 4 atoms, 3 edits", 16 * atoms.len(), || {
        black_box(kernels::colour_edits(device, &parts, samples, &edits).expect("fits"));
    });
}

/// A small generator (xorshift), so that every run measures the same data.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (((self.0 >> 32) * end as u64) >> 32) as u32
    }

    fn unit(&mut self) -> f32 {
        self.below(1 << 24) as f32 / (1 << 24) as f32
    }
}
