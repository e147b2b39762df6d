//! Binary visibility of one cube face from surface points, as bit masks (thesis 6.4, Algorithm 13).
//!
//! Bit `i % 32` of word `i / 32` of a point's n n / 32 words is set when the middle of texel `i` (row-major, see
//! `scene::cube`) lies above the point's horizon (`normal . direction > 0`) and no occluder is in the way. That is what
//! one ray for each texel gives, started where shadow rays are; but a mask is a picture, and is drawn: the CPU walks the
//! hierarchy nearest first against the texels that are still open (`walk`), eight boxes or triangles at a time (`lanes`),
//! and closes spans of rows (`mask`). Rays and drawn masks differ next to edges of triangles, by rounding.

mod lanes;
mod mask;
mod walk;

use super::RAY_SHADERS;
#[cfg(feature = "gpu")]
use super::{hierarchy_fits, pages};
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::scene::bvh::{Facet, Node};
use crate::scene::{Occluders, SurfacePoint, cube};
use crate::transport::sampling;
use crate::{Error, Result};
use lanes::{Lanes, Plain};
use mask::Mask;
use rayon::prelude::*;
use walk::Waiting;

uniform! {
    struct Params {
        /// Ray origins are lifted by at least this.
        lift: f32,
        points: u32,
        face: u32,
        size: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "visibility_masks",
    shared: RAY_SHADERS,
    source: include_str!("../../shaders/visibility_masks.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Node>("nodes"),
        Binding::read::<Facet>("facets"),
        Binding::read::<f32>("corners"),
        Binding::read::<SurfacePoint>("points"),
        Binding::read::<u32>("wanted"),
        Binding::write::<u32>("masks"),
    ],
};

/// Rows of one dispatch at most: a fraction of a second on a software driver, milliseconds on hardware.
#[cfg(feature = "gpu")]
const ROWS: usize = 1 << 15;

/// Points that a thread takes at a time.
const RUN: usize = 32;

/// Masks of face `face` of `size` x `size` texels, one point after another; all zero for points that do not exist.
/// `wanted`, a mask too, names the texels that matter; all others stay 0.
///
/// # Errors
/// `Compute` for a face, size or length of `wanted` that no cube has; `Device` from the GPU.
pub fn visibility_masks(
    device: &Device,
    occluders: &Occluders,
    points: &[SurfacePoint],
    face: usize,
    size: usize,
    wanted: Option<&[u32]>,
) -> Result<Vec<u32>> {
    cube::check_size(size)?;
    let words = size * size / 32;
    if face >= cube::FACES || wanted.is_some_and(|wanted| wanted.len() != words) {
        let given = wanted.map_or(words, <[u32]>::len);
        return Err(Error::compute(
            format!("visibility_masks: face {face} of 6, {given} words of wanted texels; expected {words}"),
            "this is a fault of the node that called the kernel; please report it",
        ));
    }
    match device {
        Device::Cpu => Ok(cpu(occluders, points, face, size, wanted, true)),
        #[cfg(feature = "gpu")]
        Device::Gpu(_) if occluders.triangles() == 0 => Ok(cpu(occluders, points, face, size, wanted, true)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, occluders, points, face, size, wanted),
    }
}

/// `wide`: use the processor's wide instructions where it has them.
fn cpu(
    occluders: &Occluders,
    points: &[SurfacePoint],
    face: usize,
    size: usize,
    wanted: Option<&[u32]>,
    wide: bool,
) -> Vec<u32> {
    let words = size * size / 32;
    let mut out = vec![0; points.len() * words];
    let scratch = || Scratch { mask: Mask::new(size), stack: Vec::with_capacity(7 * occluders.depth + 8) };
    #[cfg(target_arch = "x86_64")]
    let wide = wide && is_x86_feature_detected!("avx2");
    out.par_chunks_mut(RUN * words).zip(points.par_chunks(RUN)).for_each_init(scratch, |scratch, (out, points)| {
        for (out, point) in out.chunks_exact_mut(words).zip(points).filter(|(_, point)| point.exists()) {
            #[cfg(target_arch = "x86_64")]
            if wide {
                // SAFETY: the feature was just found.
                unsafe { draw_avx2(occluders, point, face, wanted, scratch) };
                scratch.mask.write(out);
                continue;
            }
            draw::<Plain>(occluders, point, face, wanted, scratch);
            scratch.mask.write(out);
        }
    });
    out
}

/// What a thread keeps from one point to the next.
struct Scratch {
    mask: Mask,
    stack: Vec<Waiting>,
}

#[inline(always)]
fn draw<L: Lanes>(
    occluders: &Occluders,
    point: &SurfacePoint,
    face: usize,
    wanted: Option<&[u32]>,
    scratch: &mut Scratch,
) {
    let eye = sampling::lifted(point.position.into(), point.geometric_normal.into(), occluders.lift);
    scratch.mask.open::<L>(point.normal.into(), face, wanted);
    walk::walk::<L>(occluders, eye, face, &mut scratch.mask, &mut scratch.stack);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn draw_avx2(occluders: &Occluders, point: &SurfacePoint, face: usize, wanted: Option<&[u32]>, scratch: &mut Scratch) {
    draw::<lanes::Avx2>(occluders, point, face, wanted, scratch);
}

#[cfg(feature = "gpu")]
fn gpu(
    gpu: &Gpu,
    occluders: &Occluders,
    points: &[SurfacePoint],
    face: usize,
    size: usize,
    wanted: Option<&[u32]>,
) -> Result<Vec<u32>> {
    hierarchy_fits(&occluders.bvh)?;
    let words = size * size / 32;
    let mut out = Vec::with_capacity(points.len() * words);
    let wanted = wanted.map_or_else(|| gpu.upload(&vec![u32::MAX; words]), |wanted| gpu.upload(wanted));
    for range in pages(points.len(), gpu.page(4 * words).min((ROWS / size).max(1))) {
        let params = Params { lift: occluders.lift, points: range.len() as u32, face: face as u32, size: size as u32 };
        let masks = gpu.storage::<u32>(range.len() * words);
        let buffers = [
            &gpu.whole(&occluders.bvh.nodes),
            &gpu.whole(&occluders.bvh.facets),
            &gpu.whole(&occluders.corners),
            &gpu.upload(&points[range.clone()]),
            &wanted,
            &masks,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, (range.len() * size).div_ceil(64))?;
        let [page] = batch.read([&masks])?;
        out.extend_from_slice(&page.get()[..range.len() * words]);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::primary_visibility::primary_visibility;
    use crate::scene::builtin;

    /// Not a bit depends on the instructions used.
    #[test]
    fn wide_and_plain_lanes_draw_the_same() {
        let scene = builtin::scene("hall").unwrap();
        let geometry = &scene.geometry;
        let seen = primary_visibility(&Device::Cpu, geometry, &scene.cameras[0], (13, 11), &[[0.5; 2]]).unwrap();
        let occluders = Occluders::new(geometry, |_| true);
        for (face, size) in [(0, 32), (1, 64), (2, 128), (3, 32), (4, 256), (5, 32)] {
            let masks = |wide| cpu(&occluders, &seen.points, face, size, None, wide);
            assert!(masks(true) == masks(false), "face {face}");
        }
    }
}
