//! Blurs a picture along rows and columns with exponentials, forth and back (as the recursive filter of Gastal and
//! Oliveira 2011, "Domain transform for edge-aware image and video processing").
//!
//! ```text
//! y_i = x_i + a l_i (y_{i-1} - x_i)          forth;  l_i: link of pixel i - 1 and pixel i, [0, 1]
//! z_i = y_i + a l_{i+1} (z_{i+1} - y_i)      back
//! ```
//! The cost does not depend on the width, and the picture goes on beyond its edges, and surfaces beyond theirs, as they
//! end there. Variance of one sweep: `2 a / (1 - a)^2`; a few of them make a Gaussian. Equal values stay to the bit.

#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::{Error, Result};
use glam::Vec4;
use rayon::prelude::*;

uniform! {
    struct Params {
        lines: u32,
        length: u32,
        line_stride: u32,
        stride: u32,
        share: f32,
        linked: u32,
        pad0: u32,
        pad1: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "ratio_blur",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/ratio_blur.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[Binding::read::<u32>("links"), Binding::write::<[f32; 4]>("values")],
};

/// Smaller values are 0: what fades out comes to an end, and before denormal numbers, which are slow.
const LEAST: f32 = 1e-15;

/// The order of sweeps: along rows (0) and columns (1), as often, each next to itself where that can be.
pub const SWEEPS: [usize; 8] = [0, 1, 1, 0, 0, 1, 1, 0];

/// Four sweeps along rows and four along columns of a picture of rows of `width` pixels. `share` is a, in [0, 1).
/// `links`: of each pixel to the next one in its row, row by row; and to the next one in its column, column by column; a
/// byte each, 255 for 1, in words of four of which the last may be part empty. Without links all are 1.
///
/// # Errors
/// `Compute` when values are not whole rows, links are not one a pixel, or `share` is out of range. Pictures larger than
/// a page of the GPU are blurred on the CPU.
pub fn ratio_blur(
    device: &Device,
    values: &[[f32; 4]],
    width: usize,
    share: f32,
    links: Option<[&Array<u32>; 2]>,
) -> Result<Vec<[f32; 4]>> {
    let fault = |what: String| {
        let help = "this is a fault of the node that called the kernel; please report it";
        Err(Error::compute(format!("ratio_blur: {what}"), help))
    };
    if values.len() >= 1 << 31 || !values.len().is_multiple_of(width.max(1)) {
        return fault(format!("{} values are not rows of {width}", values.len()));
    }
    if !(0.0..1.0).contains(&share) {
        return fault(format!("a share of {share}"));
    }
    if let Some(links) = links.iter().flatten().find(|links| links.len() != values.len().div_ceil(4)) {
        return fault(format!("{} words of links for {} pixels", links.len(), values.len()));
    }
    if share == 0.0 || values.is_empty() {
        return Ok(values.to_vec());
    }
    match device {
        Device::Cpu => Ok(cpu(values, width, share, links)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) if values.len() <= gpu.page(16) => self::gpu(gpu, values, width, share, links),
        #[cfg(feature = "gpu")]
        Device::Gpu(_) => Ok(cpu(values, width, share, links)),
    }
}

fn cpu(values: &[[f32; 4]], width: usize, share: f32, links: Option<[&Array<u32>; 2]>) -> Vec<[f32; 4]> {
    let (mut picture, height) = (values.to_vec(), values.len() / width);
    let mut turned = vec![[0.0; 4]; values.len()];
    let lengths = [width, height];
    let mut lies = 0;
    for axis in SWEEPS {
        if axis != lies {
            transpose(&picture, lengths[lies], &mut turned);
            std::mem::swap(&mut picture, &mut turned);
            lies = axis;
        }
        let links: Option<&[u8]> = links.map(|links| bytemuck::cast_slice(&links[axis][..]));
        let length = lengths[axis];
        picture.par_chunks_mut(length * LINES).enumerate().for_each(|(n, lines)| {
            let first = n * length * LINES;
            let one = |i: usize| links.map_or(share, |links| share * (f32::from(links[first + i]) / 255.0));
            match lines.len() == length * LINES {
                true => sweep::<LINES>(lines, one),
                false => (0..lines.len()).step_by(length).for_each(|at| {
                    sweep::<1>(&mut lines[at..at + length], |i| one(at + i));
                }),
            }
        });
    }
    picture
}

/// Lines that are swept together: each step waits for the one before it, but not for other lines.
const LINES: usize = 4;

/// Forth and back along each of N lines, one behind the other; `share(i)`: between value i and the next one.
fn sweep<const N: usize>(lines: &mut [[f32; 4]], share: impl Fn(usize) -> f32) {
    let length = lines.len() / N;
    let step = |last: Vec4, value: [f32; 4], share: f32| {
        let value = Vec4::from_array(value);
        let next = value + (last - value) * share;
        Vec4::select(next.abs().cmplt(Vec4::splat(LEAST)), Vec4::ZERO, next)
    };
    let mut last: [Vec4; N] = std::array::from_fn(|k| Vec4::from_array(lines[k * length]));
    for i in 1..length {
        for (k, last) in last.iter_mut().enumerate() {
            let at = k * length + i;
            *last = step(*last, lines[at], share(at - 1));
            lines[at] = last.to_array();
        }
    }
    for i in (0..length - 1).rev() {
        for (k, last) in last.iter_mut().enumerate() {
            let at = k * length + i;
            *last = step(*last, lines[at], share(at));
            lines[at] = last.to_array();
        }
    }
}

/// Rows of `width` to columns.
fn transpose(picture: &[[f32; 4]], width: usize, turned: &mut [[f32; 4]]) {
    /// Columns that one task turns: a cache line of a row holds as many.
    const BLOCK: usize = 4;
    let height = picture.len() / width;
    turned.par_chunks_mut(height * BLOCK).enumerate().for_each(|(block, columns)| {
        for y in 0..height {
            for (k, column) in columns.chunks_mut(height).enumerate() {
                column[y] = picture[y * width + block * BLOCK + k];
            }
        }
    });
}

#[cfg(feature = "gpu")]
fn gpu(
    gpu: &Gpu,
    values: &[[f32; 4]],
    width: usize,
    share: f32,
    links: Option<[&Array<u32>; 2]>,
) -> Result<Vec<[f32; 4]>> {
    let (picture, height) = (gpu.upload(values), values.len() / width);
    let linked = u32::from(links.is_some());
    let links = match links {
        Some(links) => links.map(|links| gpu.whole(links)),
        None => [gpu.storage::<u32>(1), gpu.storage::<u32>(1)],
    };
    let mut batch = gpu.batch();
    for axis in SWEEPS {
        let [length, lines] = if axis == 0 { [width, height] } else { [height, width] };
        let [line_stride, stride] = if axis == 0 { [width, 1] } else { [1, width] };
        let params = Params {
            lines: lines as u32,
            length: length as u32,
            line_stride: line_stride as u32,
            stride: stride as u32,
            share,
            linked,
            pad0: 0,
            pad1: 0,
        };
        batch.dispatch(&KERNEL, &params, &[&links[axis], &picture], lines.div_ceil(64))?;
    }
    let [blurred] = batch.read([&picture])?;
    Ok(blurred.get().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blur(values: &[f32], width: usize, share: f32, links: Option<[Vec<u32>; 2]>) -> Vec<f32> {
        let values: Vec<[f32; 4]> = values.iter().map(|v| [*v; 4]).collect();
        let links = links.map(|links| links.map(Array::from));
        let links = links.as_ref().map(|links| links.each_ref());
        ratio_blur(&Device::Cpu, &values, width, share, links).unwrap().iter().map(|v| v[0]).collect()
    }

    #[test]
    fn a_sweep_by_hand() {
        let mut line = [[0.0; 4], [8.0; 4], [0.0; 4]];
        sweep::<1>(&mut line, |_| 0.5);
        // Forth 0, 4, 2; back 1.5, 3, 2.
        assert_eq!(line.map(|v| v[0]), [1.5, 3.0, 2.0]);
        sweep::<1>(&mut line[..1], |_| panic!("there is no other"));
        // Four at once are each by itself.
        let mut lines: Vec<[f32; 4]> = (0..12).map(|i| [(i * i % 7) as f32; 4]).collect();
        let mut each = lines.clone();
        sweep::<4>(&mut lines, |i| 0.1 * i as f32 / 2.0);
        each.chunks_mut(3).enumerate().for_each(|(k, line)| sweep::<1>(line, |i| 0.1 * (3 * k + i) as f32 / 2.0));
        assert_eq!(lines, each);
    }

    #[test]
    fn rows_and_columns_are_alike_and_equal_values_stay() {
        let row: Vec<f32> = (0..7).map(|i| (i * i % 5) as f32).collect();
        assert_eq!(blur(&row, 7, 0.3, None), blur(&row, 1, 0.3, None));
        assert_eq!(blur(&[0.3; 20], 5, 0.9, None), [0.3; 20]);
        let both = blur(&[0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 0.0], 3, 0.4, None);
        assert!((0..9).all(|i| (both[i] - both[i % 3 * 3 + i / 3]).abs() < 1e-6), "{both:?}");
        assert!((both.iter().sum::<f32>() - 9.0).abs() < 3.0);
    }

    #[test]
    fn nothing_passes_where_there_is_no_link() {
        // 255 within pairs, 0 between them; one row, so that columns have no links to speak of.
        let links = Some([vec![0x00ff_00ff], vec![0]]);
        assert_eq!(blur(&[1.0, 1.0, 5.0, 5.0], 4, 0.7, links), [1.0, 1.0, 5.0, 5.0]);
        assert_ne!(blur(&[1.0, 1.0, 5.0, 5.0], 4, 0.7, None), [1.0, 1.0, 5.0, 5.0]);
    }

    #[test]
    fn bad_calls_are_refused() {
        let values = [[1.0; 4]; 6];
        let (one, two) = (Array::from(vec![0]), Array::from(vec![0, 0]));
        let run = |width, share, links| ratio_blur(&Device::Cpu, &values, width, share, links);
        assert!(run(4, 0.5, None).is_err());
        assert!(run(6, 1.0, None).is_err() && run(6, f32::NAN, None).is_err() && run(6, -0.1, None).is_err());
        assert!(run(6, 0.5, Some([&two, &one])).is_err() && run(6, 0.5, Some([&two, &two])).is_ok());
        assert!(ratio_blur(&Device::Cpu, &[], 0, 0.5, None).unwrap().is_empty());
    }
}
