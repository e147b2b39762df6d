//! The kernels: each file holds the declaration, the CPU body and the dispatch of the WGSL body of one kernel; its twin
//! is the file of the same stem in `shaders/`. Same names, same order of operations, equal results within tolerance
//! (arithmetic 1e-6 absolute / 1e-5 relative, transcendental 1e-5 / 1e-4); `tests/twins.rs` holds them to it.
//!
//! Light is `[f32; 4]`: linear RGB and one element that is carried along. Several vectors of one length travel as one
//! slice, one vector after another. The CPU bodies are bit-identical for any number of threads.

pub mod average_pyramid;
pub mod blocked_rays;
pub mod cached_light;
pub mod colour_edits;
pub mod direct_light;
pub mod entry_ways;
pub mod glossy_rows;
pub mod haar2d_encode;
pub mod haar_encode;
pub mod hidden_rows;
pub mod interpolate;
pub mod path_product;
pub mod primary_visibility;
pub mod ratio_blur;
pub mod ratio_warp;
pub mod run_light;
pub mod scaled_product;
pub mod shadow_filter;
pub mod shadow_light;
mod shared {
    pub mod credit;
}
pub mod sparse_product;
pub mod surroundings;
pub mod tone_map;
pub mod trace_rays;
pub mod transfer_points;
pub mod transfer_rows;
pub mod visibility_masks;

pub use average_pyramid::average_pyramid;
pub use blocked_rays::blocked_rays;
pub use cached_light::cached_light;
pub use colour_edits::colour_edits;
pub use entry_ways::entry_ways;
pub use haar_encode::{haar_decode, haar_encode};
pub use haar2d_encode::haar2d_encode;
pub use interpolate::interpolate;
pub use path_product::path_product;
pub use ratio_blur::ratio_blur;
pub use ratio_warp::ratio_warp;
pub use run_light::run_light;
pub use scaled_product::scaled_product;
pub use sparse_product::sparse_product;
pub use surroundings::surroundings;
pub use tone_map::tone_map;
pub use trace_rays::trace_rays;
pub use visibility_masks::visibility_masks;

use crate::device::Kernel;
use crate::{Error, Result};
#[cfg(feature = "gpu")]
use std::ops::Range;

/// The shared WGSL of kernels that shoot rays.
const RAY_SHADERS: &[&str] = &[
    include_str!("../../shaders/shared/grid.wgsl"),
    include_str!("../../shaders/shared/bvh.wgsl"),
    include_str!("../../shaders/shared/sampling.wgsl"),
];

/// The shared WGSL of kernels that find points of surfaces.
const SURFACE_SHADERS: &[&str] = &[RAY_SHADERS[0], RAY_SHADERS[1], include_str!("../../shaders/shared/surface.wgsl")];

/// The shared WGSL of kernels that credit rays to gather samples.
const CREDIT_SHADERS: &[&str] =
    &[RAY_SHADERS[0], RAY_SHADERS[1], RAY_SHADERS[2], include_str!("../../shaders/shared/credit.wgsl")];

/// Every kernel, in the order of the alphabet.
pub const ALL: &[&Kernel] = &[
    &average_pyramid::KERNEL,
    &blocked_rays::KERNEL,
    &cached_light::KERNEL,
    &colour_edits::KERNEL,
    &direct_light::KERNEL,
    &entry_ways::KERNEL,
    &glossy_rows::KERNEL,
    &haar2d_encode::KERNEL,
    &haar_encode::KERNEL,
    &hidden_rows::KERNEL,
    &interpolate::KERNEL,
    &path_product::KERNEL,
    &primary_visibility::KERNEL,
    &ratio_blur::KERNEL,
    &ratio_warp::KERNEL,
    &run_light::KERNEL,
    &scaled_product::KERNEL,
    &shadow_filter::KERNEL,
    &shadow_light::KERNEL,
    &sparse_product::KERNEL,
    &surroundings::KERNEL,
    &tone_map::KERNEL,
    &trace_rays::KERNEL,
    &transfer_points::KERNEL,
    &transfer_rows::KERNEL,
    &visibility_masks::KERNEL,
];

/// The length of each of `count` vectors in a slice of `total` elements; `Error::Compute` when it does not divide.
fn vector_length(kernel: &str, total: usize, count: usize) -> Result<usize> {
    if count == 0 || !total.is_multiple_of(count) {
        return Err(Error::compute(
            format!("{kernel}: {total} elements are not {count} vectors of equal length"),
            "this is a fault of the node that called the kernel; please report it",
        ));
    }
    Ok(total / count)
}

/// `Error::Compute` unless `length` is a power of two.
fn power_of_two(kernel: &str, length: usize) -> Result<()> {
    if length.is_power_of_two() {
        return Ok(());
    }
    Err(Error::compute(
        format!("{kernel}: a vector of {length} elements; expected a power of two"),
        "use a power of two of gather samples",
    ))
}

/// Cuts K vectors, one after another in `data`, into blocks of `block` elements: each item holds the same range of all K.
fn split_columns<const K: usize, T>(data: &mut [T], block: usize) -> Vec<[&mut [T]; K]> {
    let length = data.len() / K;
    let mut columns = data.chunks_exact_mut(length.max(1)).map(|column| column.chunks_mut(block)).collect::<Vec<_>>();
    (0..length.div_ceil(block))
        .map(|_| std::array::from_fn(|k| columns[k].next().expect("every column has as many blocks")))
        .collect()
}

/// Rays of one dispatch at most: a quarter of a second on a software driver, milliseconds on hardware.
#[cfg(feature = "gpu")]
const RAYS: usize = 1 << 20;

/// `Error::Device` when the hierarchy is deeper than the stack of shaders/shared/bvh.wgsl.
#[cfg(feature = "gpu")]
fn fits_the_shader(geometry: &crate::scene::Geometry) -> Result<()> {
    hierarchy_fits(&geometry.bvh)
}

#[cfg(feature = "gpu")]
fn hierarchy_fits(bvh: &crate::scene::bvh::Bvh) -> Result<()> {
    const LEVELS: usize = 96;
    if bvh.depth <= LEVELS {
        return Ok(());
    }
    Err(Error::device(
        format!("the scene's hierarchy has {} levels, the GPU's kernels go down {LEVELS}", bvh.depth),
        "use --device cpu; heaps of coincident triangles make such trees",
    ))
}

/// Consecutive ranges of at most `page` that cover `0..total`.
#[cfg(feature = "gpu")]
fn pages(total: usize, page: usize) -> impl Iterator<Item = Range<usize>> {
    (0..total).step_by(page).map(move |start| start..total.min(start + page))
}

/// Puts a page of vectors, one after another, at `range` of each of the vectors of `length` elements in `out`.
#[cfg(feature = "gpu")]
fn put_columns<T: Copy>(out: &mut [T], length: usize, range: Range<usize>, page: &[T]) {
    for (out, page) in out.chunks_exact_mut(length).zip(page.chunks_exact(range.len())) {
        out[range.clone()].copy_from_slice(page);
    }
}
