//! Looks a picture of ratios up at other places, over the area that a pixel there covers:
//! `w(x) = filter(v(map(x)))` (thesis 6.7.5).
//!
//! A look-up is the mean of `across x down` bilinear ones, spread evenly over a parallelogram about its place. One
//! alone, at the middle of a pixel, is that pixel to the bit. Outside of the picture there is no shadow: 1.

#[cfg(feature = "gpu")]
use super::pages;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::{Error, Result};
use glam::{Vec2, Vec4};
use rayon::prelude::*;

/// Pixels that one task looks up.
const BLOCK: usize = 1024;

uniform! {
    struct Params {
        width: u32,
        height: u32,
        targets: u32,
        pad0: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "ratio_warp",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/ratio_warp.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<[f32; 4]>("values"),
        Binding::read::<Place>("places"),
        Binding::write::<[f32; 4]>("warped"),
    ],
};

/// Where a pixel of the result looks, in pixels of the source: (0, 0) is the middle of the first one.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Place {
    pub at: [f32; 2],
    /// Look-ups along the first and the second side of the parallelogram; 0: no look-up, the ratio is 1.
    pub counts: [u32; 2],
    /// The two sides.
    pub sides: [[f32; 2]; 2],
}

impl Place {
    /// No shadow.
    pub const NOWHERE: Self = Self { at: [0.0; 2], counts: [0; 2], sides: [[0.0; 2]; 2] };
    /// Look-ups along a side at most: a picture of 4096 pixels made 64 times smaller is still filtered in full.
    pub const MOST: u32 = 64;
    /// Places and sides are below this, so that pixels can be numbered.
    pub const FURTHEST: f32 = (1 << 28) as f32;

    fn is_sound(&self) -> bool {
        let near = |x: &f32| x.abs() < Self::FURTHEST;
        self.counts.iter().all(|count| *count <= Self::MOST)
            && self.at.iter().chain(self.sides.as_flattened()).all(near)
    }
}

/// One look-up for each place, into `warped`, in a picture of rows of `width` pixels.
///
/// # Errors
/// `Compute` when values are not whole rows, places are not one for each result, or a place has more look-ups or lies
/// further off than it may. Pictures larger than a GPU binding are looked up on the CPU.
pub fn ratio_warp(
    device: &Device,
    values: &[[f32; 4]],
    width: usize,
    places: &[Place],
    warped: &mut [[f32; 4]],
) -> Result<()> {
    let fault = |what: String| {
        let help = "this is a fault of the node that called the kernel; please report it";
        Err(Error::compute(format!("ratio_warp: {what}"), help))
    };
    if values.len() >= 1 << 31 || !values.len().is_multiple_of(width.max(1)) {
        return fault(format!("{} values are not rows of {width}", values.len()));
    }
    if places.len() != warped.len() {
        return fault(format!("{} places for {} results", places.len(), warped.len()));
    }
    if let Some(place) = places.par_iter().with_min_len(BLOCK).find_any(|place| !place.is_sound()) {
        return fault(format!("a look-up of {:?} at {:?} over {:?}", place.counts, place.at, place.sides));
    }
    let height = (values.len() / width.max(1)) as u32;
    let params = Params { width: width as u32, height, targets: places.len() as u32, pad0: 0 };
    match device {
        Device::Cpu => cpu(&params, values, places, warped),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) if values.len() <= gpu.page(16) => return self::gpu(gpu, &params, values, places, warped),
        #[cfg(feature = "gpu")]
        Device::Gpu(_) => cpu(&params, values, places, warped),
    }
    Ok(())
}

fn cpu(params: &Params, values: &[[f32; 4]], places: &[Place], warped: &mut [[f32; 4]]) {
    warped.par_chunks_mut(BLOCK).zip(places.par_chunks(BLOCK)).for_each(|(warped, places)| {
        for (out, place) in warped.iter_mut().zip(places) {
            *out = look_up(params, values, place).to_array();
        }
    });
}

fn look_up(params: &Params, values: &[[f32; 4]], place: &Place) -> Vec4 {
    let [across, down] = place.counts;
    let at = Vec2::from(place.at);
    let [a, b] = place.sides.map(Vec2::from);
    let reach = 0.5 * (a.abs() + b.abs()) + Vec2::ONE;
    let size = Vec2::new(params.width as f32, params.height as f32);
    if across * down == 0 || (at + reach).min_element() <= 0.0 || (at - reach - size + 1.0).max_element() >= 0.0 {
        return Vec4::ONE;
    }
    if across * down == 1 {
        return bilinear(params, values, at);
    }
    let mut sum = Vec4::ZERO;
    for j in 0..down {
        let corner = at + b * ((j as f32 + 0.5) / down as f32 - 0.5);
        for i in 0..across {
            sum += bilinear(params, values, corner + a * ((i as f32 + 0.5) / across as f32 - 0.5));
        }
    }
    sum / (across * down) as f32
}

fn bilinear(params: &Params, values: &[[f32; 4]], at: Vec2) -> Vec4 {
    // Without a call of the library, which `floor` is on processors of the least common kind.
    let floor = |x: f32| x as i32 - i32::from((x as i32) as f32 > x);
    let (x, y) = (floor(at.x), floor(at.y));
    let share = at - Vec2::new(x as f32, y as f32);
    let width = params.width as usize;
    let inside = x >= 0 && y >= 0 && x + 1 < params.width as i32 && y + 1 < params.height as i32;
    let [above, below] = if inside {
        let first = y as usize * width + x as usize;
        [first, first + width].map(|i| [Vec4::from_array(values[i]), Vec4::from_array(values[i + 1])])
    } else {
        [y, y + 1].map(|y| [fetch(params, values, x, y), fetch(params, values, x + 1, y)])
    };
    let [above, below] = [above, below].map(|[left, right]| left + (right - left) * share.x);
    above + (below - above) * share.y
}

fn fetch(params: &Params, values: &[[f32; 4]], x: i32, y: i32) -> Vec4 {
    if x < 0 || y < 0 || x >= params.width as i32 || y >= params.height as i32 {
        return Vec4::ONE;
    }
    Vec4::from_array(values[y as usize * params.width as usize + x as usize])
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, params: &Params, values: &[[f32; 4]], places: &[Place], out: &mut [[f32; 4]]) -> Result<()> {
    let source = gpu.upload(values);
    for range in pages(places.len(), gpu.page(size_of::<Place>())) {
        let params = Params { targets: range.len() as u32, ..*params };
        let warped = gpu.storage::<[f32; 4]>(range.len());
        let mut batch = gpu.batch();
        let buffers = [&source, &gpu.upload(&places[range.clone()]), &warped];
        batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(64))?;
        let [page] = batch.read([&warped])?;
        out[range].copy_from_slice(page.get());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f32, y: f32) -> Place {
        Place { at: [x, y], counts: [1, 1], ..Place::NOWHERE }
    }

    fn warp(values: &[f32], width: usize, places: &[Place]) -> Vec<f32> {
        let values: Vec<[f32; 4]> = values.iter().map(|v| [*v, *v, *v, 1.0]).collect();
        let mut warped = vec![[0.0; 4]; places.len()];
        ratio_warp(&Device::Cpu, &values, width, places, &mut warped).unwrap();
        warped.iter().map(|v| v[0]).collect()
    }

    #[test]
    fn look_ups_by_hand() {
        let picture = [0.0, 0.25, 0.5, 0.75, 0.1, 0.3];
        let places =
            [at(0.0, 0.0), at(1.0, 1.0), at(0.5, 0.0), at(2.0, 0.5), at(-0.5, 0.0), at(2.0, 2.0), at(-7.0, 0.5)];
        let expected = [0.0, 0.1, 0.125, 0.4, 0.5, 1.0, 1.0];
        let found = warp(&picture, 3, &places);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7), "{found:?}");
        assert_eq!(warp(&picture, 3, &[Place::NOWHERE]), [1.0]);
        // All six at once, and half of an area outside.
        let whole = Place { at: [1.0, 0.5], counts: [3, 2], sides: [[3.0, 0.0], [0.0, 2.0]] };
        assert!((warp(&picture, 3, &[whole])[0] - 1.9 / 6.0).abs() < 1e-6);
        let half = Place { at: [-0.5, 0.5], counts: [2, 2], sides: [[2.0, 0.0], [0.0, 2.0]] };
        assert!((warp(&picture, 3, &[half])[0] - (2.0 + 0.0 + 0.75) / 4.0).abs() < 1e-6);
    }

    #[test]
    fn bad_calls_are_refused_and_far_places_are_not() {
        let values = [[0.5; 4]; 6];
        let mut out = [[0.0; 4]];
        let mut run = |width, place| {
            let result = ratio_warp(&Device::Cpu, &values, width, &[place], &mut out);
            result.map(|()| out)
        };
        assert!(run(4, at(0.0, 0.0)).is_err());
        assert!(run(3, Place { counts: [65, 1], ..Place::NOWHERE }).is_err());
        for bad in [1e30, f32::NEG_INFINITY, f32::NAN] {
            assert!(run(3, at(0.0, bad)).is_err(), "{bad}");
            assert!(run(3, Place { counts: [1, 1], sides: [[0.0; 2], [bad, 0.0]], ..Place::NOWHERE }).is_err());
        }
        assert_eq!(run(3, at(-2e8, 2e8)).unwrap(), [[1.0; 4]]);
        ratio_warp(&Device::Cpu, &[], 0, &[at(0.0, 0.0)], &mut out).unwrap();
        assert_eq!(out, [[1.0; 4]]);
        assert!(ratio_warp(&Device::Cpu, &values, 3, &[], &mut out).is_err());
    }
}
