//! Blurs a picture of ratios along rows or columns, one pass of five taps after another (thesis 6.7.5; the kernel with
//! holes of the à-trous algorithm, Holschneider et al. 1989).
//!
//! ```text
//! out = v + sum_k w_k l_k d_k (v_k - v) / (w_0 + sum_k w_k l_k d_k),   k = -2 step, -step, step, 2 step
//! ```
//! `w` is `far, near, 1 - 2 near - 2 far, near, far`; `d` is a pixel's fourth element, 1 where there is a ratio and 0
//! where there is none: such pixels neither give nor take. `l` is a link between two pixels of one surface, [0, 1], of
//! which a u32 holds four. Without links all are 1 and the picture goes on beyond its edges as it ends there; with
//! links it stops there. Constants stay to the bit, because differences are summed.

#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::{Error, Result};
use glam::Vec4;
use rayon::prelude::*;

uniform! {
    struct Params {
        width: u32,
        height: u32,
        vertical: u32,
        step: u32,
        near: f32,
        far: f32,
        linked: u32,
        pad0: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "ratio_blur",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/ratio_blur.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<[f32; 4]>("values"),
        Binding::read::<u32>("near_links"),
        Binding::read::<u32>("far_links"),
        Binding::write::<[f32; 4]>("blurred"),
    ],
};

/// One sweep over the picture.
#[derive(Clone)]
pub struct Pass {
    /// Along columns; otherwise along rows.
    pub vertical: bool,
    /// Pixels from one tap to the next.
    pub step: usize,
    /// Weights of the taps at `step` and at `2 step`; `near + far` is below 1/2.
    pub near: f32,
    pub far: f32,
    /// Links of each pixel to those `step` and `2 step` further along, a byte each; the last u32 may be part empty.
    pub links: Option<[Array<u32>; 2]>,
}

/// Runs the passes in order over a picture of rows of `width` pixels.
///
/// # Errors
/// `Compute` when values are not whole rows, links are not one a pixel, or a weight or step is out of range. Pictures
/// larger than a GPU binding are blurred on the CPU.
pub fn ratio_blur(device: &Device, values: &[[f32; 4]], width: usize, passes: &[Pass]) -> Result<Vec<[f32; 4]>> {
    check(values.len(), width, passes)?;
    if passes.is_empty() || values.is_empty() {
        return Ok(values.to_vec());
    }
    match device {
        Device::Cpu => Ok(cpu(values, width, passes)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) if values.len() <= gpu.page(16) => self::gpu(gpu, values, width, passes),
        #[cfg(feature = "gpu")]
        Device::Gpu(_) => Ok(cpu(values, width, passes)),
    }
}

fn check(pixels: usize, width: usize, passes: &[Pass]) -> Result<()> {
    let fault = |what: String| {
        let help = "this is a fault of the node that called the kernel; please report it";
        Err(Error::compute(format!("ratio_blur: {what}"), help))
    };
    if pixels >= 1 << 31 || !pixels.is_multiple_of(width.max(1)) {
        return fault(format!("{pixels} values are not rows of {width}"));
    }
    for pass in passes {
        if pass.step == 0
            || pass.step >= 1 << 29
            || !(pass.near >= 0.0 && pass.far >= 0.0 && pass.near + pass.far < 0.5)
        {
            return fault(format!("a step of {} with weights {} and {}", pass.step, pass.near, pass.far));
        }
        for links in pass.links.iter().flatten().filter(|links| links.len() != pixels.div_ceil(4)) {
            return fault(format!("{} words of links for {pixels} pixels", links.len()));
        }
    }
    Ok(())
}

fn params(pixels: usize, width: usize, pass: &Pass) -> Params {
    Params {
        width: width as u32,
        height: (pixels / width) as u32,
        vertical: u32::from(pass.vertical),
        step: pass.step as u32,
        near: pass.near,
        far: pass.far,
        linked: u32::from(pass.links.is_some()),
        pad0: 0,
    }
}

fn cpu(values: &[[f32; 4]], width: usize, passes: &[Pass]) -> Vec<[f32; 4]> {
    let mut blurred = vec![[0.0; 4]; values.len()];
    let mut before = Vec::new();
    for (turn, pass) in passes.iter().enumerate() {
        let source = if turn == 0 { values } else { &before };
        let params = params(values.len(), width, pass);
        blurred.par_chunks_mut(width).enumerate().for_each(|(y, out)| row(&params, pass, source, y, out));
        if turn + 1 < passes.len() {
            before.resize(values.len(), [0.0; 4]);
            std::mem::swap(&mut before, &mut blurred);
        }
    }
    blurred
}

fn row(params: &Params, pass: &Pass, values: &[[f32; 4]], y: usize, out: &mut [[f32; 4]]) {
    let width = params.width as usize;
    let (stride, length) = if pass.vertical { (width, params.height as usize) } else { (1, width) };
    let taps: [(usize, f32, Option<&[u8]>); 2] = std::array::from_fn(|k| {
        let links = pass.links.as_ref().map(|links| bytemuck::cast_slice(&links[k][..]));
        ([pass.step, 2 * pass.step][k], [pass.near, pass.far][k], links)
    });
    for (x, out) in out.iter_mut().enumerate() {
        let i = y * width + x;
        let place = if pass.vertical { y } else { x };
        let value = Vec4::from_array(values[i]);
        if value.w == 0.0 {
            *out = values[i];
            continue;
        }
        let mut sum = Vec4::ZERO;
        let mut total = 1.0 - 2.0 * (pass.near + pass.far);
        for (distance, weight, links) in taps {
            let (left, right) = (place.min(distance), (length - 1 - place).min(distance));
            let (j, k) = (i - left * stride, i + right * stride);
            let (mut back, mut ahead) = (weight * values[j][3], weight * values[k][3]);
            if let Some(links) = links {
                back *= if left == distance { f32::from(links[j]) / 255.0 } else { 0.0 };
                ahead *= if right == distance { f32::from(links[i]) / 255.0 } else { 0.0 };
            }
            sum += (Vec4::from_array(values[j]) - value) * back + (Vec4::from_array(values[k]) - value) * ahead;
            total += back + ahead;
        }
        *out = (value + sum / total).with_w(value.w).to_array();
    }
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, values: &[[f32; 4]], width: usize, passes: &[Pass]) -> Result<Vec<[f32; 4]>> {
    let mut source = gpu.upload(values);
    let mut target = gpu.storage::<[f32; 4]>(values.len());
    let none = gpu.storage::<u32>(1);
    let mut batch = gpu.batch();
    for pass in passes {
        let params = params(values.len(), width, pass);
        let [near, far] = match &pass.links {
            Some(links) => links.each_ref().map(|links| gpu.whole(links)),
            None => [none.clone(), none.clone()],
        };
        batch.dispatch(&KERNEL, &params, &[&source, &near, &far, &target], values.len().div_ceil(64))?;
        std::mem::swap(&mut source, &mut target);
    }
    let [blurred] = batch.read([&source])?;
    Ok(blurred.get().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PASS: Pass = Pass { vertical: false, step: 1, near: 0.25, far: 0.0625, links: None };

    fn grey(values: &[f32]) -> Vec<[f32; 4]> {
        values.iter().map(|v| [*v, *v, *v, 1.0]).collect()
    }

    fn blur(values: &[[f32; 4]], width: usize, passes: &[Pass]) -> Vec<f32> {
        ratio_blur(&Device::Cpu, values, width, passes).unwrap().iter().map(|v| v[0]).collect()
    }

    #[test]
    fn a_step_by_hand() {
        let step = grey(&[0.0, 0.0, 0.0, 16.0, 16.0, 16.0]);
        assert_eq!(blur(&step, 6, &[PASS]), [0.0, 1.0, 5.0, 11.0, 15.0, 16.0]);
        // A column of the same, and two rows that see nothing of each other.
        let down = Pass { vertical: true, ..PASS };
        assert_eq!(blur(&step, 1, std::slice::from_ref(&down)), [0.0, 1.0, 5.0, 11.0, 15.0, 16.0]);
        assert_eq!(blur(&step, 3, &[PASS]), [0.0, 0.0, 0.0, 16.0, 16.0, 16.0]);
        assert_eq!(blur(&step, 3, &[down]), [5.0, 5.0, 5.0, 11.0, 11.0, 11.0]);
        let wide = Pass { step: 2, ..PASS };
        assert_eq!(blur(&step, 6, &[wide]), [1.0, 5.0, 5.0, 11.0, 11.0, 15.0]);
    }

    #[test]
    fn nothing_passes_where_there_is_no_link_or_no_ratio() {
        let step = grey(&[0.0, 0.0, 0.0, 16.0, 16.0, 16.0]);
        // 255 between neighbours within each half, 0 between the halves.
        let links = [vec![0xff00_ffff_u32, 0x0000_00ff].into(), vec![0x0000_00ff_u32 | 0xff00_0000, 0].into()];
        let linked = Pass { links: Some(links), ..PASS };
        assert_eq!(blur(&step, 6, &[linked]), [0.0, 0.0, 0.0, 16.0, 16.0, 16.0]);
        let mut hole = step.clone();
        hole[2] = [1.0, 1.0, 1.0, 0.0];
        let blurred = blur(&hole, 6, &[PASS]);
        // w0 + what is left: 6/16, 4/16 (left), 1/16 and 4/16 (right).
        assert_eq!(blurred[1], 16.0 / 12.0);
        assert_eq!(blurred[2], 1.0);
    }

    #[test]
    fn bad_calls_are_refused() {
        let values = grey(&[1.0; 6]);
        let run = |width, pass: Pass| ratio_blur(&Device::Cpu, &values, width, &[pass]);
        assert!(run(4, PASS).is_err());
        assert!(run(6, Pass { step: 0, ..PASS }).is_err());
        assert!(run(6, Pass { near: f32::NAN, ..PASS }).is_err());
        assert!(run(6, Pass { far: 0.3, ..PASS }).is_err());
        assert!(run(6, Pass { links: Some([vec![0].into(), vec![0, 0].into()]), ..PASS }).is_err());
        assert!(ratio_blur(&Device::Cpu, &[], 0, &[PASS]).unwrap().is_empty());
    }
}
