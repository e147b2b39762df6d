//! Light over runs of bits: per row, the sum of a running sum's differences over its runs of ones.
//!
//! For each face of a cube a table holds, at position k, the sum of what the face's first k texels would give: three
//! directions x RGB in fixed point (`transport::shadow::tables`). A run from a to b then gives `table[b] - table[a]`.
//! All in wrapping integers, so the sums are exact: the same bits in any order on any device.
//!
//! An element is 12 integers: x R, x G, x B, 0, y R, ..., z B, 0. A table has one element more than a face has texels.

#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::transport::runs::{Runs, Toggles};
use crate::{Error, Result};
use rayon::prelude::*;
#[cfg(feature = "gpu")]
use std::ops::Range;

pub type Element = [i32; 12];

/// Rows that one task sums: their results stay in the nearest cache while the faces go by.
const BLOCK: usize = 512;

uniform! {
    struct Params {
        rows: u32,
        first_toggle: u32,
        last: u32,
        is_narrow: u32,
        is_first: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "run_light",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/run_light.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<u32>("offsets"),
        Binding::read::<u32>("words"),
        Binding::read::<[i32; 4]>("table"),
        Binding::write::<[i32; 4]>("sums"),
    ],
};

/// The rows of a face and its table.
#[derive(Clone, Copy)]
pub struct Face<'a> {
    pub runs: &'a Runs,
    pub table: &'a Array<Element>,
}

/// Sums over all faces for each of `rows` rows.
///
/// # Errors
/// `Compute` when a face has other rows, or a table of another size.
pub fn run_light(device: &Device, faces: &[Face], rows: usize) -> Result<Vec<Element>> {
    for face in faces {
        let texels = face.runs.side() * face.runs.side();
        if face.runs.rows() != rows || face.table.len() != texels + 1 {
            return Err(Error::compute(
                format!(
                    "run_light: {} rows of {texels} texels and a table of {}, for {rows} rows",
                    face.runs.rows(),
                    face.table.len()
                ),
                "give visibility and environment the same samples and face_size",
            ));
        }
    }
    match device {
        Device::Cpu => Ok(cpu(faces, rows)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, faces, rows),
    }
}

fn cpu(faces: &[Face], rows: usize) -> Vec<Element> {
    let mut sums = vec![[0; 12]; rows];
    sums.par_chunks_mut(BLOCK).enumerate().for_each(|(block, sums)| {
        for face in faces {
            #[cfg(target_arch = "x86_64")]
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has what the function is compiled for.
                unsafe { add_face_avx2(face, block * BLOCK, sums) };
                continue;
            }
            add_face(face, block * BLOCK, sums);
        }
    });
    sums
}

/// The same code with twice as wide registers.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn add_face_avx2(face: &Face, first: usize, sums: &mut [Element]) {
    add_face(face, first, sums);
}

#[inline(always)]
fn add_face(face: &Face, first: usize, sums: &mut [Element]) {
    let offsets = &face.runs.offsets()[first..=first + sums.len()];
    match face.runs.toggles() {
        Toggles::Narrow(toggles) => add_rows(offsets, toggles, face.table, sums),
        Toggles::Wide(toggles) => add_rows(offsets, toggles, face.table, sums),
    }
}

#[inline(always)]
fn add_rows<T: Copy + Into<u32>>(offsets: &[u32], toggles: &[T], table: &[Element], sums: &mut [Element]) {
    let last = table.len() - 1;
    for (sum, ends) in sums.iter_mut().zip(offsets.windows(2)) {
        let (pairs, rest) = toggles[ends[0] as usize..ends[1] as usize].as_chunks::<2>();
        let mut total = *sum;
        for [start, end] in pairs {
            let (start, end): (u32, u32) = ((*start).into(), (*end).into());
            add_run(&mut total, &table[start as usize], &table[end as usize]);
        }
        for start in rest {
            let start: u32 = (*start).into();
            add_run(&mut total, &table[start as usize], &table[last]);
        }
        *sum = total;
    }
}

#[inline(always)]
fn add_run(total: &mut Element, start: &Element, end: &Element) {
    for i in 0..12 {
        total[i] = total[i].wrapping_add(end[i].wrapping_sub(start[i]));
    }
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, faces: &[Face], rows: usize) -> Result<Vec<Element>> {
    let mut sums = vec![[0; 12]; rows];
    if faces.is_empty() {
        return Ok(sums);
    }
    for range in pages(gpu, faces, rows) {
        let part = gpu.storage::<Element>(range.len());
        let mut batch = gpu.batch();
        for (i, Face { runs, table }) in faces.iter().enumerate() {
            let toggles = runs.offsets()[range.start] as usize..runs.offsets()[range.end] as usize;
            let words = if runs.is_narrow() { toggles.start / 2..toggles.end.div_ceil(2) } else { toggles.clone() };
            let params = Params {
                rows: range.len() as u32,
                first_toggle: if runs.is_narrow() { 2 * words.start as u32 } else { words.start as u32 },
                last: table.len() as u32 - 1,
                is_narrow: runs.is_narrow().into(),
                is_first: (i == 0).into(),
                pad0: 0,
                pad1: 0,
                pad2: 0,
            };
            let offsets = gpu.array(runs.offsets(), range.start..range.end + 1);
            let buffers = [&offsets, &gpu.array(runs.words(), words), &gpu.whole(table), &part];
            batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(16))?;
        }
        let [page] = batch.read([&part])?;
        sums[range].copy_from_slice(page.get());
    }
    Ok(sums)
}

/// Ranges of rows whose toggles, of each face, and sums each fit in a page; a longer row is a page of its own.
#[cfg(feature = "gpu")]
fn pages(gpu: &Gpu, faces: &[Face], rows: usize) -> Vec<Range<usize>> {
    let (most_rows, most_words) = (gpu.page(48), gpu.page(4));
    let mut pages = Vec::new();
    let mut start = 0;
    while start < rows {
        let fits = |face: &Face| {
            let offsets = face.runs.offsets();
            let most = if face.runs.is_narrow() { 2 * most_words - 2 } else { most_words };
            offsets[start + 1..].partition_point(|&end| (end - offsets[start]) as usize <= most)
        };
        let fitting = faces.iter().map(fits).min().unwrap_or(rows);
        let end = start + fitting.clamp(1, most_rows).min(rows - start);
        pages.push(start..end);
        start = end;
    }
    pages
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_faces_by_hand() {
        // Texel k of the first face gives k + 1 in channel 0 and -1 in channel 5; running sums wrap on the way.
        let table = |start: i32| -> Array<Element> {
            (0..=1024i32)
                .map(|k| {
                    let mut element = [0; 12];
                    element[0] = start.wrapping_add(k * (k + 1) / 2);
                    element[5] = -k;
                    element
                })
                .collect::<Vec<_>>()
                .into()
        };
        let (a, b) = (table(i32::MAX - 20), table(0));
        // Rows: nothing; texels 1, 2 and 5; from 1020 to the end.
        let runs = Runs::new(32, vec![0, 0, 4, 5], vec![1 | 3 << 16, 5 | 6 << 16, 1020]).unwrap();
        let one = run_light(&Device::Cpu, &[Face { runs: &runs, table: &a }], 3).unwrap();
        assert_eq!(one.iter().map(|sum| (sum[0], sum[5])).collect::<Vec<_>>(), [(0, 0), (2 + 3 + 6, -3), (4090, -4)]);
        let faces = [Face { runs: &runs, table: &a }, Face { runs: &runs, table: &b }];
        let two = run_light(&Device::Cpu, &faces, 3).unwrap();
        assert!(two.iter().zip(&one).all(|(two, one)| two[0] == 2 * one[0] && two[5] == 2 * one[5]));
        assert!(run_light(&Device::Cpu, &faces, 2).is_err());
        assert_eq!(run_light(&Device::Cpu, &[], 2).unwrap(), [[0; 12]; 2]);
    }
}
