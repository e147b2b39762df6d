//! From scene-linear light to display-linear colour, with an exposure in stops. Alpha is carried along.
//!
//! With c = rgb 2^exposure and L its Rec.709 luminance:
//! - `none`: c.
//! - `reinhard`: c (1 + L / white²) / (1 + L), the global operator with a white point (Reinhard, Stark, Shirley,
//!   Ferwerda 2002, eq. 4): luminance `white` becomes 1. Black stays black; negative luminance is left as it is.
//! - `neutral`: Khronos PBR Neutral (specification of 2024): hue is kept, colours below 0.76 stay linear but for a small
//!   offset for the 4 % of light that dielectrics reflect at the surface, highlights are compressed to 1 and
//!   desaturated. Negative channels count as 0, and channels above 1e30 as 1e30.
//!
//! The result is linear display-referred with Rec.709 primaries; a writer of PNG applies the sRGB curve. NaN stays NaN.

#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Binding, Device, Kernel};
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;

/// Pixels that one task maps.
const BLOCK: usize = 4096;
/// Rec.709.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);
/// Neutral: reflectance of dielectrics at normal incidence.
const F90: f32 = 0.04;
/// Neutral: where the compression of highlights begins, before the offset.
const START: f32 = 0.8 - F90;
/// Neutral: how fast highlights lose their colour.
const DESATURATION: f32 = 0.15;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Operator {
    /// Exposure alone.
    None,
    /// The global operator of Reinhard and others, with a white point.
    #[default]
    Reinhard,
    /// Khronos PBR Neutral.
    Neutral,
}

uniform! {
    struct Params {
        pixels: u32,
        /// An `Operator`; the name is reserved in WGSL.
        mode: u32,
        gain: f32,
        white: f32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "tone_map",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/tone_map.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[Binding::write::<[f32; 4]>("pixels")],
};

/// Maps RGBA pixels. `exposure` in stops; `white` is the luminance that `Operator::Reinhard` maps to 1, above 0.
pub fn tone_map(
    device: &Device,
    pixels: &[[f32; 4]],
    operator: Operator,
    exposure: f32,
    white: f32,
) -> Result<Vec<[f32; 4]>> {
    if white.is_nan() || white <= 0.0 || !exposure.is_finite() {
        return Err(Error::compute(
            format!("tone_map: white {white}, exposure {exposure}; expected white above 0 and a finite exposure"),
            "change the parameters of the node",
        ));
    }
    let params = Params { pixels: pixels.len() as u32, mode: operator as u32, gain: exposure.exp2(), white };
    match device {
        Device::Cpu => Ok(cpu(params, pixels)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, params, pixels),
    }
}

fn cpu(params: Params, pixels: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let mut out = pixels.to_vec();
    out.par_chunks_mut(BLOCK).for_each(|pixels| {
        for pixel in pixels {
            let [r, g, b, alpha] = *pixel;
            let colour = Vec3::new(r, g, b) * params.gain;
            let colour = match params.mode {
                1 => reinhard(colour, params.white),
                2 => neutral(colour),
                _ => colour,
            };
            *pixel = colour.extend(alpha).to_array();
        }
    });
    out
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, params: Params, pixels: &[[f32; 4]]) -> Result<Vec<[f32; 4]>> {
    let mut out = Vec::with_capacity(pixels.len());
    for pixels in pixels.chunks(gpu.page(16)) {
        let params = Params { pixels: pixels.len() as u32, ..params };
        let buffer = gpu.upload(pixels);
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &[&buffer], pixels.len().div_ceil(64))?;
        let [page] = batch.read([&buffer])?;
        out.extend_from_slice(page.get());
    }
    Ok(out)
}

fn reinhard(colour: Vec3, white: f32) -> Vec3 {
    let luminance = colour.dot(LUMINANCE).max(0.0);
    colour * ((1.0 + luminance / white / white) / (1.0 + luminance))
}

fn neutral(colour: Vec3) -> Vec3 {
    let colour = Vec3::from(colour.to_array().map(|channel| channel.clamp(0.0, 1e30)));
    let least = colour.x.min(colour.y).min(colour.z);
    let offset = if least < 2.0 * F90 { least - least * least / (4.0 * F90) } else { F90 };
    let colour = colour - Vec3::splat(offset);
    let peak = colour.x.max(colour.y).max(colour.z);
    if peak < START {
        return colour;
    }
    let room = 1.0 - START;
    let new_peak = 1.0 - room * room / (peak + room - START);
    let keep = 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    colour * (new_peak / peak) * keep + Vec3::splat(new_peak * (1.0 - keep))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(pixel: [f32; 4], operator: Operator, exposure: f32, white: f32) -> [f32; 4] {
        tone_map(&Device::Cpu, &[pixel], operator, exposure, white).unwrap()[0]
    }

    fn near(found: [f32; 4], expected: [f32; 4]) {
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-5), "{found:?}, expected {expected:?}");
    }

    #[test]
    fn none_is_exposure_alone() {
        near(map([0.25, -1.0, 65504.0, 0.5], Operator::None, 1.0, 1.0), [0.5, -2.0, 131008.0, 0.5]);
    }

    #[test]
    fn reinhard_maps_white_to_one() {
        near(map([4.0, 4.0, 4.0, 1.0], Operator::Reinhard, 0.0, 4.0), [1.0; 4]);
        near(map([1.0, 1.0, 1.0, 1.0], Operator::Reinhard, 0.0, f32::INFINITY), [0.5, 0.5, 0.5, 1.0]);
        // A red of luminance 0.2126: 1 / 1.2126.
        near(map([0.5, 0.0, 0.0, 1.0], Operator::Reinhard, 1.0, 1e9), [0.824674, 0.0, 0.0, 1.0]);
        near(map([0.0; 4], Operator::Reinhard, 0.0, 1.0), [0.0; 4]);
    }

    /// By hand from the published formula.
    #[test]
    fn neutral_by_hand() {
        // min 0.5 >= 0.08: offset 0.04, peak below 0.76.
        near(map([0.5, 0.6, 0.7, 1.0], Operator::Neutral, 0.0, 1.0), [0.46, 0.56, 0.66, 1.0]);
        // min 0.04: offset 0.04 - 6.25 * 0.0016 = 0.03.
        near(map([0.04, 0.1, 0.2, 1.0], Operator::Neutral, 0.0, 1.0), [0.01, 0.07, 0.17, 1.0]);
        // Grey 2.04: peak 2, new peak 1 - 0.0576 / 1.48 = 0.961081, and grey stays grey.
        near(map([2.04, 2.04, 2.04, 1.0], Operator::Neutral, 0.0, 1.0), [0.961081, 0.961081, 0.961081, 1.0]);
        // Red 4: peak 4, new peak 1 - 0.0576 / 3.48 = 0.983448, keep 1 / (0.15 * 3.016552 + 1) = 0.688480.
        near(map([4.0, 0.0, 0.0, 1.0], Operator::Neutral, 0.0, 1.0), [0.983448, 0.306364, 0.306364, 1.0]);
        near(map([65504.0, f32::INFINITY, 0.0, 1.0], Operator::Neutral, 0.0, 1.0), [1.0; 4]);
    }

    #[test]
    fn nan_is_not_hidden() {
        for operator in [Operator::None, Operator::Reinhard, Operator::Neutral] {
            let mapped = map([f32::NAN, 0.5, 0.5, 1.0], operator, 0.0, 1.0);
            assert!(mapped[0].is_nan() && mapped[3] == 1.0, "{operator:?} {mapped:?}");
        }
        assert!(tone_map(&Device::Cpu, &[], Operator::None, f32::NAN, 1.0).is_err());
        assert!(tone_map(&Device::Cpu, &[], Operator::None, 0.0, 0.0).is_err());
    }
}
