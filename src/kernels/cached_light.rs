//! Light at places by an irradiance cache: of N surface points, the irradiance in W/m² that `Columns::look_up` gives there,
//! and in the fourth element the sum of weights of the records that it is of; 0: nothing is known there, or there is no
//! surface.

use crate::Result;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::scene::SurfacePoint;
use crate::transport::light_cache::index::Cell;
use crate::transport::light_cache::{Columns, Gradients, Shape, Spot};
use rayon::prelude::*;
#[cfg(feature = "gpu")]
use {super::pages, crate::transport::light_cache::Parting};

uniform! {
    struct Params {
        /// Of the index: its corner, and one over the width of its widest cell.
        low: [f32; 3],
        inverse_width: f32,
        /// Of the cache.
        error: f32,
        /// Bit l: grid l holds something.
        levels: u32,
        /// Cells of the index, less one.
        cells: u32,
        /// Weights a place.
        count: u32,
        /// Another material parts ways.
        by_material: u32,
        /// Of this page.
        points: u32,
        pad0: u32,
        pad1: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "cached_light",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/cached_light.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Cell>("cells"),
        Binding::read::<[f32; 4]>("spheres"),
        Binding::read::<u32>("records"),
        Binding::read::<Shape>("shapes"),
        Binding::read::<Gradients>("light"),
        Binding::read::<f32>("receivers"),
        Binding::read::<[f32; 4]>("changes"),
        Binding::read::<SurfacePoint>("points"),
        Binding::read::<f32>("weights"),
        Binding::write::<[f32; 4]>("found"),
    ],
};

/// `weights`: of receivers, as many a point as the cache has a record.
pub fn cached_light(
    device: &Device,
    columns: &Columns,
    points: &[SurfacePoint],
    weights: &[f32],
) -> Result<Vec<[f32; 4]>> {
    assert_eq!(points.len() * columns.parting.count, weights.len(), "weights of points");
    match device {
        Device::Cpu => Ok(cpu(columns, points, weights)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, columns, points, weights),
    }
}

fn cpu(columns: &Columns, points: &[SurfacePoint], weights: &[f32]) -> Vec<[f32; 4]> {
    let count = columns.parting.count;
    let one = |i: usize| {
        if !points[i].exists() {
            return [0.0; 4];
        }
        let found = columns.look_up(&Spot { point: &points[i], receivers: &weights[i * count..][..count] });
        found.light.with_w(found.weight).to_array()
    };
    (0..points.len()).into_par_iter().with_min_len(256).map(one).collect()
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, columns: &Columns, points: &[SurfacePoint], weights: &[f32]) -> Result<Vec<[f32; 4]>> {
    if columns.shapes.is_empty() {
        return Ok(vec![[0.0; 4]; points.len()]);
    }
    let Parting { count, by_material } = columns.parting;
    let index = &columns.index;
    let (cells, spheres, records) = (gpu.upload(&index.cells), gpu.upload(&index.spheres), gpu.upload(&index.records));
    let (shapes, light) = (gpu.upload(&columns.shapes), gpu.upload(&columns.light));
    let (receivers, changes) = (gpu.upload(&columns.receivers), gpu.upload(&columns.changes));
    let mut all = Vec::with_capacity(points.len());
    for range in pages(points.len(), gpu.page(size_of::<SurfacePoint>().max(size_of::<f32>() * count))) {
        let params = Params {
            low: index.low.to_array(),
            inverse_width: 1.0 / index.width,
            error: columns.error,
            levels: index.level_bits(),
            cells: index.cells.len() as u32 - 1,
            count: count as u32,
            by_material: u32::from(by_material),
            points: range.len() as u32,
            pad0: 0,
            pad1: 0,
        };
        let found = gpu.storage::<[f32; 4]>(range.len());
        let buffers = [
            &cells,
            &spheres,
            &records,
            &shapes,
            &light,
            &receivers,
            &changes,
            &gpu.upload(&points[range.clone()]),
            &gpu.upload(&weights[range.start * count..range.end * count]),
            &found,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(64))?;
        let [page] = batch.read([&found])?;
        all.extend_from_slice(page.get::<[f32; 4]>());
    }
    Ok(all)
}
