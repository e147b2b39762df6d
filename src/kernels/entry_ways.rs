//! The way of each entry of sparse rows: from the row's point to the mean position of the tree node in its column
//! (`transport::ways` says how it is packed). Basis `cut` only: columns of other bases are no places.

#[cfg(feature = "gpu")]
use super::sparse_product::row_pages;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::transport::sparse::SparseRows;
use crate::transport::ways;
use crate::{Error, Result};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

uniform! {
    struct Params {
        rows: u32,
        first_entry: u32,
        index_bits: u32,
        pad0: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "entry_ways",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/entry_ways.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<u32>("offsets"),
        Binding::read::<u32>("entries"),
        Binding::read::<[f32; 4]>("points"),
        Binding::read::<[f32; 4]>("places"),
        Binding::write::<u32>("ways"),
    ],
};

/// `points`: position of each row; `places`: mean position of each tree node (`rows.columns()` elements). One way an
/// entry.
pub fn entry_ways(device: &Device, rows: &SparseRows, points: &[[f32; 4]], places: &[[f32; 4]]) -> Result<Vec<u32>> {
    if points.len() != rows.rows() || places.len() != rows.columns() {
        let message = format!(
            "entry_ways: {} points and {} places for {} rows and {} columns",
            points.len(),
            places.len(),
            rows.rows(),
            rows.columns()
        );
        return Err(Error::compute(message, "this is a fault of the node that called the kernel; please report it"));
    }
    match device {
        Device::Cpu => Ok(cpu(rows, points, places)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, rows, points, places),
    }
}

fn cpu(rows: &SparseRows, points: &[[f32; 4]], places: &[[f32; 4]]) -> Vec<u32> {
    let position = |p: [f32; 4]| -> Vec3 { Vec4::from_array(p).truncate() };
    let mut out = vec![0; rows.entries().len()];
    let mut rest = &mut out[..];
    let mut tasks = Vec::with_capacity(rows.rows());
    for (row, &point) in rows.offsets().windows(2).zip(points) {
        let entries = &rows.entries()[row[0] as usize..row[1] as usize];
        let (ways, after) = rest.split_at_mut(entries.len());
        tasks.push((entries, ways, position(point)));
        rest = after;
    }
    tasks.into_par_iter().with_min_len(64).for_each(|(entries, ways, point)| {
        for (way, &entry) in ways.iter_mut().zip(entries) {
            let (node, _) = rows.format().unpack(entry);
            *way = ways::pack(position(places[node]) - point);
        }
    });
    out
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, rows: &SparseRows, points: &[[f32; 4]], places: &[[f32; 4]]) -> Result<Vec<u32>> {
    let mut out = Vec::with_capacity(rows.entries().len());
    let places = gpu.upload(places);
    for range in row_pages(gpu, rows, 1) {
        let entries = rows.offsets()[range.start] as usize..rows.offsets()[range.end] as usize;
        if entries.is_empty() {
            continue;
        }
        let params = Params {
            rows: range.len() as u32,
            first_entry: entries.start as u32,
            index_bits: rows.format().index_bits,
            pad0: 0,
        };
        let ways = gpu.storage::<u32>(entries.len());
        let buffers = [
            &gpu.array(rows.offsets(), range.start..range.end + 1),
            &gpu.array(rows.entries(), entries),
            &gpu.upload(&points[range.clone()]),
            &places,
            &ways,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len())?;
        let [page] = batch.read([&ways])?;
        out.extend_from_slice(page.get());
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sparse::EntryFormat;

    #[test]
    fn by_hand() {
        let format = EntryFormat::new(2, false).unwrap();
        let rows = SparseRows::from_rows(format, [&[(1, 1.0), (3, 0.5)][..], &[], &[(2, 1.0)]]).unwrap();
        let places = [[0.0; 4], [0.0, 4.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0]];
        let points = [[0.0; 4], [9.0; 4], [0.5, 0.0, 0.0, 0.0]];
        let found = entry_ways(&Device::Cpu, &rows, &points, &places).unwrap();
        let expected = [Vec3::Y * 4.0, Vec3::Z * 2.0, Vec3::X * 0.5].map(ways::pack);
        assert_eq!(found, expected);
        assert!(entry_ways(&Device::Cpu, &rows, &points[1..], &places).is_err());
    }
}
