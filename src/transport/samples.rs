//! View samples: the surface points that a picture is made of.

use crate::device::{Array, Device};
use crate::kernels::primary_visibility::primary_visibility;
use crate::scene::{Camera, Fingerprint, Geometry, Material, SurfacePoint};
use crate::transport::atlas::Atlas;
use crate::transport::rows::Grid;
use crate::{Error, Result, memory};
use rayon::prelude::*;
use std::sync::Arc;

/// N = width x height x across x down points, row-major by pixel, samples of a pixel together.
#[derive(Clone, Debug)]
pub struct Samples {
    pub width: usize,
    pub height: usize,
    /// Samples across and down a pixel.
    pub across: usize,
    pub down: usize,
    /// Of a view; texels of an atlas are seen from nowhere.
    pub camera: Camera,
    /// Of texel samples.
    pub atlas: Option<Arc<Atlas>>,
    /// Of the geometry that they lie on.
    pub geometry: Fingerprint,
    pub points: Array<SurfacePoint>,
    /// Of the hit on its triangle (second and third corner).
    pub barycentrics: Array<[f32; 2]>,
}

impl Samples {
    /// Of one sample.
    const BYTES: u64 = 48 + 8;

    /// Shoots one ray through the middle of each part of each pixel.
    ///
    /// Errors: no pixels; more samples than 2^31, or than fit into memory.
    pub fn view(
        device: &Device,
        geometry: &Geometry,
        camera: &Camera,
        size: (u32, u32),
        per_pixel: u32,
    ) -> Result<Self> {
        let (across, down) = split(per_pixel.max(1));
        let middle = |i: u32, n: u32| (i as f32 + 0.5) / n as f32;
        let offsets: Vec<[f32; 2]> =
            (0..down).flat_map(|y| (0..across).map(move |x| [middle(x, across), middle(y, down)])).collect();
        Ok(Self {
            across: across as usize,
            down: down as usize,
            ..Self::through(device, geometry, camera, size, &offsets)?
        })
    }

    /// Shoots a ray through each of these places of every pixel, each in [0, 1)².
    ///
    /// Errors: as `view`.
    pub fn through(
        device: &Device,
        geometry: &Geometry,
        camera: &Camera,
        size: (u32, u32),
        offsets: &[[f32; 2]],
    ) -> Result<Self> {
        let per_pixel = offsets.len() as u32;
        let count = u64::from(size.0) * u64::from(size.1) * u64::from(per_pixel);
        if count >= 1 << 31 {
            let message = format!("{} x {} pixels with {per_pixel} samples are more than 2^31", size.0, size.1);
            return Err(Error::compute(message, "lower width, height or samples_per_pixel"));
        }
        // Each as it is found and as it is kept.
        let what = format!("{} x {} pixels with {per_pixel} samples", size.0, size.1);
        memory::require(2 * Self::BYTES * count, &what, "lower width, height or samples_per_pixel")?;
        let visible = primary_visibility(device, geometry, camera, size, offsets)?;
        Ok(Self {
            width: size.0 as usize,
            height: size.1 as usize,
            across: offsets.len(),
            down: 1,
            camera: camera.clone(),
            atlas: None,
            geometry: geometry.fingerprint,
            points: visible.points.into(),
            barycentrics: visible.barycentrics.into(),
        })
    }

    /// # Errors
    /// `Compute` when the samples lie on another geometry.
    pub fn check(&self, geometry: &Geometry) -> Result<()> {
        if self.geometry == geometry.fingerprint {
            return Ok(());
        }
        let message = "the view was made for another scene, or for another state of it";
        Err(Error::compute(message, "connect the same scene to view_samples, transfer and relight"))
    }

    pub fn per_pixel(&self) -> usize {
        self.across * self.down
    }

    pub fn bytes(&self) -> u64 {
        Self::BYTES * self.points.len() as u64 + self.atlas.as_ref().map_or(0, |atlas| atlas.bytes())
    }

    /// Mean over the samples of each pixel.
    pub fn resolve<T>(&self, value: impl Fn(usize) -> T + Sync) -> Vec<T>
    where
        T: Send + std::iter::Sum + std::ops::Div<f32, Output = T>,
    {
        let per_pixel = self.per_pixel();
        (0..self.width * self.height)
            .into_par_iter()
            .with_min_len(4096)
            .map(|pixel| (pixel * per_pixel..(pixel + 1) * per_pixel).map(&value).sum::<T>() / per_pixel as f32)
            .collect()
    }

    /// The samples side by side, as row placement wants them.
    pub fn grid(&self) -> Grid<'_> {
        Grid {
            points: &self.points,
            width: self.width * self.across,
            height: self.height * self.down,
            across: self.across,
            down: self.down,
        }
    }
}

/// The most nearly square way to put `count` samples into a pixel.
fn split(count: u32) -> (u32, u32) {
    let down = (1..=count.isqrt()).rev().find(|down| count.is_multiple_of(*down)).unwrap_or(1);
    (count / down, down)
}

/// Diffuse reflectance at surface points; RGB and a 1 where there is a surface.
pub fn reflectance(
    geometry: &Geometry,
    materials: &[Material],
    points: &[SurfacePoint],
    barycentrics: &[[f32; 2]],
) -> Vec<[f32; 4]> {
    let one = |(point, at): (&SurfacePoint, &[f32; 2])| {
        if !point.exists() {
            return [0.0; 4];
        }
        let material = &materials[point.material as usize];
        let uv = match material.is_textured() {
            true => geometry.uv(point.triangle as usize, at[0], at[1]),
            false => [0.0; 2],
        };
        let [r, g, b] = material.reflectance(uv);
        [r, g, b, 1.0]
    };
    points.par_iter().zip(barycentrics).with_min_len(4096).map(one).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn samples_fill_a_pixel_as_squarely_as_they_can() {
        let split = super::split;
        assert_eq!(
            [split(1), split(2), split(4), split(8), split(16), split(7)],
            [(1, 1), (2, 1), (2, 2), (4, 2), (4, 4), (7, 1)]
        );
    }
}
