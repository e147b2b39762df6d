//! The energy that each texel of a cube receives from a latitude-longitude map.
//!
//! Solid angle is `dphi dh`: azimuth, and sine of the elevation. Both pictures are cut into pieces that lie within one
//! texel and one pixel each. Side texels are bounded by meridians, so their columns are walked meridian by meridian. The
//! top face is cut into four quarters, one towards each side face, and each into bands of texels at one distance
//! from the middle; a band is cut at every azimuth where a meridian of the map, one of its circles or a corner of a texel
//! comes in or out. What is left between cuts is smooth, and Gauss's three points integrate it to rounding: all of a
//! pixel's energy arrives, and a constant map stays constant.

use super::LatLong;
use super::cube::FACES;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

type Energy = [f64; 3];

/// The four side faces in the order of azimuth, each with its middle as a direction (x, z).
const SIDES: [(usize, [i8; 2]); 4] = [(0, [1, 0]), (4, [0, 1]), (1, [-1, 0]), (5, [0, -1])];
const TOP: usize = 2;
const BOTTOM: usize = 3;

/// Per texel, W/m²; the map is turned about +Y by `rotation` radians.
pub fn energies(map: &LatLong, size: usize, rotation: f64) -> Vec<Energy> {
    let columns = (0..map.width * map.height).map(|i| map.radiance[i % map.height * map.width + i / map.height]);
    let cutter = Cutter {
        size,
        rotation,
        width: map.width,
        height: map.height,
        columns: columns.collect(),
        edges: (0..=map.height).map(|row| map.edge(row)).collect(),
    };
    // Each part is computed by one thread, and all are added in one order, whatever the number of threads.
    let bands = size / 2;
    let sides: Vec<_> = (0..4 * size).into_par_iter().map(|i| cutter.column(i / size, i % size)).collect();
    let caps: Vec<_> = (0..4 * bands).into_par_iter().map(|i| cutter.band(i / bands, i % bands)).collect();
    let mut energies = vec![[0.0; 3]; FACES * size * size];
    for (texel, energy) in sides.into_iter().chain(caps).flatten() {
        (0..3).for_each(|c| energies[texel][c] += energy[c]);
    }
    energies
}

struct Cutter {
    size: usize,
    rotation: f64,
    /// Of the map.
    width: usize,
    height: usize,
    /// The map, column by column.
    columns: Vec<[f32; 3]>,
    /// Sine of the elevation between rows, from 1 down to -1.
    edges: Vec<f64>,
}

/// Points and weights of an integral from `from` to `to`.
fn gauss(from: f64, to: f64) -> [(f64, f64); 3] {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let off = half * 0.6f64.sqrt();
    [(middle - off, half * 5.0 / 9.0), (middle, half * 8.0 / 9.0), (middle + off, half * 5.0 / 9.0)]
}

impl Cutter {
    /// Where an azimuth, counted from the middle of a side, lies in the map; in columns, not wrapped.
    fn place(&self, side: usize, azimuth: f64) -> f64 {
        (FRAC_PI_2 * side as f64 + azimuth + self.rotation) * self.width as f64 / TAU + 0.5 * self.width as f64
    }

    /// Azimuths between two of them, from the middle of a side, at which columns of the map meet.
    fn meridians(&self, side: usize, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let (zero, scale) = (self.place(side, 0.0), TAU / self.width as f64);
        let first = self.place(side, from).floor() as i64 + 1;
        (first..self.place(side, to).ceil() as i64).map(move |column| (column as f64 - zero) * scale)
    }

    /// Pixels of the column of the map that an azimuth goes through.
    fn pixels(&self, side: usize, azimuth: f64) -> &[[f32; 3]] {
        let column = (self.place(side, azimuth).floor() as i64).rem_euclid(self.width as i64) as usize;
        &self.columns[column * self.height..][..self.height]
    }

    /// Texels of a column of a side face, `index` along azimuth, and what they receive.
    fn column(&self, side: usize, index: usize) -> Vec<(usize, Energy)> {
        let n = self.size;
        let edge = |i: usize| 2.0 * i as f64 / n as f64 - 1.0;
        let (from, to) = (edge(index).atan(), edge(index + 1).atan());
        let mut received = vec![[0.0; 3]; n];
        // Where circles of the map cross the upper and lower edge of the face, as the caps are cut on their side of it.
        let rim = |row: usize| (1.0 / (PI * row as f64 / self.height as f64).tan()).acos();
        let rows = self.height.div_ceil(4)..=(2f64.sqrt().atan() * self.height as f64 / PI) as usize;
        let crossings = rows.map(rim).flat_map(|cut| [cut, -cut]).filter(|cut| *cut > from && *cut < to);
        let mut cuts: Vec<f64> = self.meridians(side, from, to).chain(crossings).chain([from, to]).collect();
        cuts.sort_unstable_by(f64::total_cmp);
        for strip in cuts.windows(2) {
            let pixels = self.pixels(side, 0.5 * (strip[0] + strip[1]));
            for (azimuth, weight) in gauss(strip[0], strip[1]) {
                let cos = azimuth.cos();
                let sine = |y: usize| edge(y) * cos / (1.0 + (edge(y) * cos).powi(2)).sqrt();
                let mut row = self.row_of(sine(n));
                for y in (0..n).rev() {
                    row = self.add(pixels, false, (sine(y + 1), sine(y)), row, weight, &mut received[y]);
                }
            }
        }
        let face = SIDES[side].0;
        // Azimuth grows with z on +X and with x on -Z; against z on -X and x on +Z.
        let along = if side == 0 || side == 3 { index } else { n - 1 - index };
        let place = |y: usize| if face < 2 { (face * n + along) * n + y } else { (face * n + y) * n + along };
        received.into_iter().enumerate().map(|(y, energy)| (place(y), energy)).collect()
    }

    /// Texels of the top and the bottom face, and what they receive from the quarter towards a side, as far as it lies
    /// between `band` and `band + 1` texels from the middle. Lengths are in texels.
    fn band(&self, side: usize, band: usize) -> Vec<(usize, Energy)> {
        let half = 0.5 * self.size as f64;
        let sine = |radius: f64| half / half.hypot(radius);
        let (near, far) = (band as f64, (band + 1) as f64);
        // To the right of the side's middle, to its left; each on top and at the bottom.
        let mut received = vec![[[[0.0; 3]; 2]; 2]; band + 1];
        for strip in self.cuts(side, band).windows(2) {
            let middle = 0.5 * (strip[0] + strip[1]);
            if strip[1] - strip[0] < 1e-14 {
                continue;
            }
            let pixels = self.pixels(side, middle);
            let slope = middle.tan().abs();
            let (first, last) = ((near * slope) as usize, ((far * slope) as usize).min(band));
            for (azimuth, weight) in gauss(strip[0], strip[1]) {
                let (enter, leave) = (sine(near / azimuth.cos()), sine(far / azimuth.cos()));
                let between = if last > first { sine(last as f64 / azimuth.sin().abs()) } else { leave };
                let left = usize::from(azimuth < 0.0);
                for (cell, from, to) in [(first, enter, between), (last, between, leave)] {
                    for (bottom, energy) in received[cell][left].iter_mut().enumerate() {
                        self.add(pixels, bottom == 1, (from, to), self.row_of(from), weight, energy);
                    }
                }
            }
        }
        let mut texels = Vec::with_capacity(4 * received.len());
        for (cell, sides) in received.into_iter().enumerate() {
            for (left, faces) in sides.into_iter().enumerate() {
                let texel = self.cap_texel(side, band, cell, left == 1);
                texels.push((TOP * self.size * self.size + texel, faces[0]));
                texels.push((BOTTOM * self.size * self.size + texel, faces[1]));
            }
        }
        texels
    }

    /// Number, within its face, of a texel on top: `ahead` from the middle towards a side, `cell` to its right or left.
    fn cap_texel(&self, side: usize, ahead: usize, cell: usize, left: bool) -> usize {
        let n = self.size;
        let place = |cell: usize, positive: bool| if positive { n / 2 + cell } else { n / 2 - 1 - cell };
        let [forward_x, forward_z] = SIDES[side].1;
        // To the right of +X is +Z, of +Z is -X, of -X is -Z, of -Z is +X.
        let (x, z) = match forward_x != 0 {
            true => (place(ahead, forward_x > 0), place(cell, (forward_x > 0) != left)),
            false => (place(cell, (forward_z < 0) != left), place(ahead, forward_z > 0)),
        };
        // Faces +Y and -Y have u along z and v along x.
        x * n + z
    }

    /// Azimuths at which a band is cut, sorted.
    fn cuts(&self, side: usize, band: usize) -> Vec<f64> {
        let half = 0.5 * self.size as f64;
        let (near, far) = (band as f64, (band + 1) as f64);
        // Some for a coarse map, so that no strip is wide for three points.
        let mut cuts: Vec<f64> = (0..=8).map(|i| FRAC_PI_4 * f64::from(i) / 8.0).collect();
        for cell in 1..=band {
            cuts.extend([(cell as f64 / near).atan(), (cell as f64 / far).atan()]);
        }
        let angle = |radius: f64| (radius / half).atan() * self.height as f64 / PI;
        for row in angle(near).ceil() as usize..=angle(far * std::f64::consts::SQRT_2).floor() as usize {
            let radius = half * (PI * row as f64 / self.height as f64).tan();
            cuts.extend([near, far].into_iter().filter(|ahead| *ahead <= radius).map(|ahead| (ahead / radius).acos()));
            let aside = |ahead: f64| (radius * radius - ahead * ahead).max(0.0).sqrt();
            let cells = aside(far).ceil() as usize..=aside(near).floor() as usize;
            cuts.extend(
                cells.filter(|cell| *cell as f64 <= radius && radius > 0.0).map(|c| (c as f64 / radius).asin()),
            );
        }
        cuts.retain(|cut| *cut <= FRAC_PI_4);
        let mirrored: Vec<f64> = cuts.iter().map(|cut| -cut).collect();
        cuts.extend(mirrored);
        cuts.extend(self.meridians(side, -FRAC_PI_4, FRAC_PI_4));
        cuts.sort_unstable_by(f64::total_cmp);
        cuts
    }

    /// A row that the sine of an elevation lies in, or the one above where rounding may have it so.
    fn row_of(&self, sine: f64) -> usize {
        let row = (sine.clamp(-1.0, 1.0).acos() * self.height as f64 / PI) as usize;
        let row = row.min(self.height - 1);
        row - usize::from(row > 0 && self.edges[row] < sine)
    }

    /// Adds the light of a column of the map from one sine of the elevation down to another; gives the last row that was
    /// touched. `bottom` takes the map upside down.
    fn add(
        &self,
        pixels: &[[f32; 3]],
        bottom: bool,
        (from, to): (f64, f64),
        mut row: usize,
        weight: f64,
        energy: &mut Energy,
    ) -> usize {
        loop {
            let (high, low) = (self.edges[row].min(from), self.edges[row + 1].max(to));
            let share = weight * (high - low).max(0.0);
            let pixel = pixels[if bottom { self.height - 1 - row } else { row }];
            (0..3).for_each(|c| energy[c] += f64::from(pixel[c]) * share);
            if self.edges[row + 1] <= to || row + 1 == self.height {
                return row;
            }
            row += 1;
        }
    }
}
