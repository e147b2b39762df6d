//! Shadows of a face in a Haar basis, truncated (thesis 6.4, 6.5): `haar2d` by non-standard decomposition, `haar1d` over
//! the face's texels in reading order, for comparison.
//!
//! Coefficients are orthonormal: of a basis function of area A (texels), value ±A^(-1/2). The thesis weighs them "with
//! areas of corresponding basis functions" and drops the smallest. With weight A^(1/2) that is the light that a function
//! would carry away under even light, `sum of ±S over its support`: what an unnormalised coefficient times the area of
//! its function is, too. `AREA_POWER` is that exponent.

use crate::transport::sparse::EntryFormat;
use serde::{Deserialize, Serialize};

/// Coefficients are ranked by `|c| A^AREA_POWER`.
pub const AREA_POWER: f32 = 0.5;

/// What the basis runs over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum HaarBasis {
    /// Squares of a face: non-standard decomposition.
    Square,
    /// Its texels in reading order.
    Line,
}

/// How many coefficients a row keeps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Truncation {
    /// At most.
    pub coefficients: usize,
    /// As few as leave out at most this share of the row's weighted energy; `None`: as many as there may be.
    pub tolerance: Option<f32>,
}

/// The columns of a face's rows, and weights of either sign.
pub fn format(size: usize) -> EntryFormat {
    EntryFormat { index_bits: 2 * size.trailing_zeros(), signed: true }
}

/// Encodes one row after another; holds the memory for it.
pub struct Encoder {
    size: usize,
    basis: HaarBasis,
    truncation: Truncation,
    /// Sums over the squares or pieces of one level, and of the next.
    sums: Vec<f32>,
    /// Rank, place and value.
    found: Vec<(f32, u32, f32)>,
    row: Vec<(u32, f32)>,
}

impl Encoder {
    pub fn new(size: usize, basis: HaarBasis, truncation: Truncation) -> Self {
        Self { size, basis, truncation, sums: Vec::new(), found: Vec::new(), row: Vec::new() }
    }

    /// The row of a mask (`size * size / 32` words): pairs of place and coefficient, by place.
    pub fn mask(&mut self, mask: &[u32]) -> &[(u32, f32)] {
        if mask.iter().all(|word| *word == 0) {
            self.row.clear();
            return &self.row;
        }
        self.sums.clear();
        self.sums.extend(mask.iter().flat_map(|word| (0..32).map(move |bit| (word >> bit & 1) as f32)));
        self.encode()
    }

    /// The row of a face of any values.
    pub fn values(&mut self, values: &[f32]) -> &[(u32, f32)] {
        self.sums.clear();
        self.sums.extend_from_slice(values);
        self.encode()
    }

    fn encode(&mut self) -> &[(u32, f32)] {
        self.found.clear();
        match self.basis {
            HaarBasis::Square => self.squares(),
            HaarBasis::Line => self.pieces(),
        }
        self.truncate();
        &self.row
    }

    fn squares(&mut self) {
        let (mut half, mut area) = (self.size / 2, 4.0f32);
        while half > 0 {
            let (norm, weight) = (area.sqrt().recip(), area.powf(AREA_POWER));
            for y in 0..half {
                for x in 0..half {
                    let at = 4 * y * half + 2 * x;
                    let [a, b] = [self.sums[at], self.sums[at + 1]];
                    let [c, d] = [self.sums[at + 2 * half], self.sums[at + 2 * half + 1]];
                    self.sums[y * half + x] = (a + b) + (c + d);
                    if a == b && a == c && a == d {
                        continue;
                    }
                    let place = (y * self.size + x) as u32;
                    let (right, below) = (half as u32, (half * self.size) as u32);
                    let details = [
                        (place + right, (a - b) + (c - d)),
                        (place + below, (a + b) - (c + d)),
                        (place + below + right, (a - b) - (c - d)),
                    ];
                    for (place, sum) in details {
                        if sum != 0.0 {
                            self.found.push((sum.abs() * norm * weight, place, sum * norm));
                        }
                    }
                }
            }
            (half, area) = (half / 2, area * 4.0);
        }
        self.mean();
    }

    fn pieces(&mut self) {
        let (mut half, mut area) = (self.size * self.size / 2, 2.0f32);
        while half > 0 {
            let (norm, weight) = (area.sqrt().recip(), area.powf(AREA_POWER));
            for i in 0..half {
                let [a, b] = [self.sums[2 * i], self.sums[2 * i + 1]];
                self.sums[i] = a + b;
                if a != b {
                    self.found.push(((a - b).abs() * norm * weight, (half + i) as u32, (a - b) * norm));
                }
            }
            (half, area) = (half / 2, area * 2.0);
        }
        self.mean();
    }

    fn mean(&mut self) {
        let area = (self.size * self.size) as f32;
        let coefficient = self.sums[0] / self.size as f32;
        if coefficient != 0.0 {
            self.found.push((coefficient.abs() * area.powf(AREA_POWER), 0, coefficient));
        }
    }

    fn truncate(&mut self) {
        // Among equals the lower place: one answer, whatever the order of work.
        let order = |a: &(f32, u32, f32), b: &(f32, u32, f32)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        let mut keep = self.truncation.coefficients;
        if let Some(tolerance) = self.truncation.tolerance {
            self.found.sort_unstable_by(order);
            let energy = |found: &(f32, u32, f32)| f64::from(found.0) * f64::from(found.0);
            let allowed = f64::from(tolerance) * self.found.iter().map(energy).sum::<f64>();
            let mut dropped = 0.0;
            let small = self.found.iter().rev().take_while(|found| {
                dropped += energy(found);
                dropped <= allowed
            });
            keep = keep.min(self.found.len() - small.count());
        }
        if keep < self.found.len() {
            if self.truncation.tolerance.is_none() {
                self.found.select_nth_unstable_by(keep, order);
            }
            self.found.truncate(keep);
        }
        self.row.clear();
        self.row.extend(self.found.iter().map(|(_, place, value)| (*place, *value)));
        self.row.sort_unstable_by_key(|(place, _)| *place);
    }
}

/// The face (n n values) of coefficients (n n) in their places; `scratch` is overwritten.
pub fn decode(basis: HaarBasis, size: usize, coefficients: &[f32], scratch: &mut Vec<f32>, face: &mut [f32]) {
    scratch.clear();
    scratch.resize(size * size, 0.0);
    face[0] = coefficients[0];
    let mut half = 1;
    if basis == HaarBasis::Square {
        while half < size {
            for y in 0..half {
                for x in 0..half {
                    let place = y * size + x;
                    let mean = face[y * half + x];
                    let (h, v) = (coefficients[place + half], coefficients[place + half * size]);
                    let d = coefficients[place + half * size + half];
                    let at = 4 * y * half + 2 * x;
                    scratch[at] = 0.5 * ((mean + h) + (v + d));
                    scratch[at + 1] = 0.5 * ((mean - h) + (v - d));
                    scratch[at + 2 * half] = 0.5 * ((mean + h) - (v + d));
                    scratch[at + 2 * half + 1] = 0.5 * ((mean - h) - (v - d));
                }
            }
            face[..4 * half * half].copy_from_slice(&scratch[..4 * half * half]);
            half *= 2;
        }
        return;
    }
    while half < size * size {
        for i in 0..half {
            let (mean, detail) = (face[i], coefficients[half + i]);
            scratch[2 * i] = (mean + detail) * std::f32::consts::FRAC_1_SQRT_2;
            scratch[2 * i + 1] = (mean - detail) * std::f32::consts::FRAC_1_SQRT_2;
        }
        face[..2 * half].copy_from_slice(&scratch[..2 * half]);
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Device;
    use crate::kernels::{haar_encode, haar2d_encode};

    const ALL: Truncation = Truncation { coefficients: usize::MAX, tolerance: None };

    fn disc(size: usize) -> Vec<u32> {
        let mut mask = vec![0; size * size / 32];
        for i in 0..size * size {
            let (x, y) = ((i % size) as f32 - 0.4 * size as f32, (i / size) as f32 - 0.6 * size as f32);
            mask[i / 32] |= u32::from(x * x + 2.0 * y * y < 0.07 * (size * size) as f32) << (i % 32);
        }
        mask
    }

    fn spread(size: usize, row: &[(u32, f32)]) -> Vec<f32> {
        let mut coefficients = vec![0.0; size * size];
        row.iter().for_each(|(place, value)| coefficients[*place as usize] = *value);
        coefficients
    }

    #[test]
    fn masks_are_encoded_as_the_kernels_encode_light_and_come_back() {
        for (size, basis) in
            [(32, HaarBasis::Square), (64, HaarBasis::Square), (32, HaarBasis::Line), (128, HaarBasis::Line)]
        {
            let mask = disc(size);
            let values: Vec<f32> = (0..size * size).map(|i| (mask[i / 32] >> (i % 32) & 1) as f32).collect();
            let light: Vec<[f32; 4]> = values.iter().map(|value| [*value, 0.0, 0.0, 0.0]).collect();
            let expected = match basis {
                HaarBasis::Square => haar2d_encode(&Device::Cpu, &light, size, 1).unwrap(),
                HaarBasis::Line => haar_encode(&Device::Cpu, &light, 1).unwrap(),
            };
            let mut encoder = Encoder::new(size, basis, ALL);
            let coefficients = spread(size, encoder.mask(&mask));
            for (found, expected) in coefficients.iter().zip(&expected) {
                assert!((found - expected[0]).abs() < 1e-4, "{basis:?} {size}: {found} {}", expected[0]);
            }
            let mut face = vec![0.0; size * size];
            decode(basis, size, &coefficients, &mut Vec::new(), &mut face);
            assert!(face.iter().zip(&values).all(|(a, b)| (a - b).abs() < 1e-4), "{basis:?} {size}");
            let again = spread(size, encoder.values(&values));
            assert_eq!(again, coefficients);
        }
    }

    #[test]
    fn truncation_keeps_the_heaviest_and_as_many_as_the_tolerance_asks() {
        let mask = disc(64);
        let of = |coefficients, tolerance| {
            let truncation = Truncation { coefficients, tolerance };
            Encoder::new(64, HaarBasis::Square, truncation).mask(&mask).to_vec()
        };
        let all = of(usize::MAX, None);
        assert_eq!(of(10, None).len(), 10);
        assert!(of(10, None).iter().all(|pair| all.contains(pair)));
        assert!(of(10, None).iter().any(|pair| pair.0 == 0), "the mean of a disc weighs most");
        assert_eq!(of(usize::MAX, Some(0.0)).len(), all.len());
        let counts = [0.1, 0.01, 0.001].map(|tolerance| of(usize::MAX, Some(tolerance)).len());
        assert!(counts[0] < counts[1] && counts[1] < counts[2] && counts[2] < all.len(), "{counts:?}");
        assert_eq!(of(5, Some(0.001)).len(), 5);
        assert!(of(100, None).windows(2).all(|pair| pair[0].0 < pair[1].0));
    }
}
