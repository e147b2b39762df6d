//! Light of later bounces, as it arrives at gather samples: radiosity over the whole scene, as the preview has it (thesis
//! 3.1.1), with fewer samples and rays, because rays of the last bounce average over many of them.

use super::incident::Incident;
use crate::Result;
use crate::kernels::{average_pyramid, sparse_product};
use crate::memo::{Key, Memo};
use crate::progress::Progress;
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::Basis;
use crate::transport::blocks::Blocks;
use crate::transport::gather::Gather;
use crate::transport::glossy::Gloss;
use crate::transport::precompute::{Estimator, Placement, Quality, Settings, rows_between};
use crate::transport::sides::live_sides;
use glam::Vec4;
use rayon::prelude::*;

/// Gather samples, and the tolerance that their rays follow from.
const SAMPLES: usize = 16384;
const TOLERANCE: f32 = 0.04;

pub struct Bounces {
    gather: Gather,
    /// Irradiance of the gather samples from all bounces but the last, W/m².
    irradiance: Vec<Vec4>,
    pub rays: u64,
}

impl Bounces {
    /// `bounces`: 2 or more, with the last; `seen`: what the camera sees.
    ///
    /// # Errors
    /// No surface in view; too little memory; `Cancelled`.
    pub fn new(
        incident: &Incident,
        seen: &[SurfacePoint],
        bounces: u32,
        (memo, key): (&dyn Memo, Key),
        progress: Progress,
    ) -> Result<Self> {
        let Incident { device, geometry, .. } = *incident;
        let settings = Settings {
            gather_samples: SAMPLES,
            bounces,
            basis: Basis::Cut,
            coefficients: 1,
            estimator: Estimator::Rays,
            glossy: Gloss::None,
            quality: Quality::of(TOLERANCE, Placement::Adaptive),
        };
        let live = live_sides(geometry, seen, memo)?;
        let gather = Gather::place(geometry, &live, SAMPLES)?;
        let blocks = Blocks { memo, key };
        let (rows, cost) = rows_between(device, geometry, (&gather, &live), &settings, &blocks, progress)?;
        let points = &gather.points[..];
        let first = incident.direct(points.to_vec(), &gather.barycentrics, 0)?;
        let reflectance = incident.reflectance(points, &gather.barycentrics);
        let change = incident.source.at(points);
        let mut last: Vec<Vec4> = (0..points.len())
            .map(|g| {
                let light = first.from_lamps[g].with_w(0.0) + first.from_others[g];
                light * change.scale(g) + change.offset(g).extend(0.0)
            })
            .collect();
        let mut irradiance = vec![Vec4::ZERO; points.len()];
        for _ in 1..bounces {
            let light: Vec<[f32; 4]> = last.iter().map(|light| light.to_array()).collect();
            let arriving = sparse_product(device, &rows, &average_pyramid(device, &light, 1)?, 1)?;
            let scatter = |(g, arriving): (usize, &[f32; 4])| {
                (Vec4::from_array(*arriving) * Vec4::from_array(reflectance[g]) * change.scale(g)).with_w(0.0)
            };
            irradiance.iter_mut().zip(&arriving).for_each(|(sum, more)| *sum += Vec4::from_array(*more));
            last = arriving.par_iter().enumerate().with_min_len(4096).map(scatter).collect();
        }
        Ok(Self { gather, irradiance, rays: cost.rays })
    }

    /// Irradiance at a surface point, W/m².
    pub fn at(&self, geometry: &Geometry, point: &SurfacePoint, barycentrics: [f32; 2]) -> Vec4 {
        if !point.exists() {
            return Vec4::ZERO;
        }
        let front = geometry.area_vector(point.triangle as usize).dot(point.geometric_normal.into()) >= 0.0;
        let sample = self.gather.nearest(point.triangle, barycentrics, front);
        sample.map_or(Vec4::ZERO, |sample| self.irradiance[sample as usize])
    }
}
