//! The light that a change of visibility lets through: `out[s] = sum_t change[s][t] L_t A_t max(n_s . d_t, 0)`.
//!
//! Irradiance, W/m². `change` has one lane (the same for all colours) or three (red, green, blue). 64 partial sums, of
//! every 64th direction each, are added up in order.

#[cfg(feature = "gpu")]
use super::pages;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::{Error, Result};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

const PARTS: usize = 64;

uniform! {
    struct Params {
        rows: u32,
        directions: u32,
        lanes: u32,
        pad0: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "shadow_light",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/shadow_light.wgsl"),
    workgroup: [PARTS as u32, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<Beam>("beams"),
        Binding::read::<[f32; 4]>("normals"),
        Binding::read::<f32>("change"),
        Binding::write::<[f32; 4]>("light"),
    ],
};

/// Light from one direction.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Beam {
    /// Unit vector; the fourth element is 0.
    pub direction: [f32; 4],
    /// Radiance times solid angle, W/m²; the fourth element is 0.
    pub energy: [f32; 4],
}

/// `normals`: unit, one a sample; `change`: per lane, per sample, one a beam. The result has one element a sample.
pub fn shadow_light(
    device: &Device,
    beams: &Array<Beam>,
    normals: &[[f32; 4]],
    change: &[f32],
    lanes: usize,
) -> Result<Vec<[f32; 4]>> {
    if !matches!(lanes, 1 | 3) || change.len() != lanes * normals.len() * beams.len() {
        let message = format!(
            "shadow_light: {} changes in {lanes} lanes for {} samples and {} directions",
            change.len(),
            normals.len(),
            beams.len()
        );
        return Err(Error::compute(message, "this is a fault of the node that called the kernel; please report it"));
    }
    match device {
        Device::Cpu => Ok(cpu(beams, normals, change, lanes)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, beams, normals, change, lanes),
    }
}

fn cpu(beams: &[Beam], normals: &[[f32; 4]], change: &[f32], lanes: usize) -> Vec<[f32; 4]> {
    let plane = normals.len() * beams.len();
    let one = |(s, normal): (usize, &[f32; 4])| {
        let normal = Vec4::from_array(*normal).truncate();
        let lane: [&[f32]; 3] = std::array::from_fn(|c| {
            let first = c.min(lanes - 1) * plane + s * beams.len();
            &change[first..first + beams.len()]
        });
        let mut parts = [Vec4::ZERO; PARTS];
        for (t, beam) in beams.iter().enumerate() {
            let change = Vec4::new(lane[0][t], lane[1][t], lane[2][t], 0.0);
            // Most directions do not change.
            if change != Vec4::ZERO {
                let cosine = normal.dot(Vec3::from_slice(&beam.direction[..3])).max(0.0);
                parts[t % PARTS] += change * Vec4::from_array(beam.energy) * cosine;
            }
        }
        parts.iter().copied().sum::<Vec4>().to_array()
    };
    normals.par_iter().enumerate().with_min_len(16).map(one).collect()
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, beams: &Array<Beam>, normals: &[[f32; 4]], change: &[f32], lanes: usize) -> Result<Vec<[f32; 4]>> {
    if beams.is_empty() {
        return Ok(vec![[0.0; 4]; normals.len()]);
    }
    let mut light = Vec::with_capacity(normals.len());
    for range in pages(normals.len(), gpu.page(4 * lanes * beams.len())) {
        let part = gpu.storage::<[f32; 4]>(range.len());
        let params = Params { rows: range.len() as u32, directions: beams.len() as u32, lanes: lanes as u32, pad0: 0 };
        let samples = range.start * beams.len()..range.end * beams.len();
        let changes = change.chunks_exact(normals.len() * beams.len()).map(|plane| &plane[samples.clone()]);
        let buffers = [&gpu.whole(beams), &gpu.upload(&normals[range.clone()]), &gpu.upload_parts(changes), &part];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, range.len())?;
        let [page] = batch.read([&part])?;
        light.extend_from_slice(page.get());
    }
    Ok(light)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_beams_by_hand() {
        let beams = vec![
            Beam { direction: [0.0, 1.0, 0.0, 0.0], energy: [1.0, 2.0, 4.0, 0.0] },
            Beam { direction: [0.6, -0.8, 0.0, 0.0], energy: [8.0, 8.0, 8.0, 0.0] },
        ];
        let normals = [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]];
        let beams = Array::from(beams);
        let one = shadow_light(&Device::Cpu, &beams, &normals, &[0.5, 1.0, 1.0, 0.5], 1).unwrap();
        assert_eq!(one[0], [0.5, 1.0, 2.0, 0.0], "the second beam comes from below");
        assert!((one[1][0] - 2.4).abs() < 1e-6);
        let red = [[1.0; 4], [0.0; 4], [0.0; 4]].concat();
        let tinted = shadow_light(&Device::Cpu, &beams, &normals, &red, 3).unwrap();
        assert_eq!(tinted[0], [1.0, 0.0, 0.0, 0.0]);
        assert!(shadow_light(&Device::Cpu, &beams, &normals, &red, 1).is_err());
    }
}
