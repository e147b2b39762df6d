//! What edits were sampled for, and what is different about something else.

use super::{GatherPlaces, NOWHERE, Sampled, ViewPlaces};
use crate::scene::{Camera, Geometry, SurfacePoint};
use crate::transport::selection::Digest;
use crate::transport::{Samples, Transfer};
use crate::{Error, Result};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// The scene, the view and the transfer that edits were sampled for, in numbers and names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// `Geometry::fingerprint`, hexadecimal.
    pub geometry: String,
    pub triangles: usize,
    /// By number.
    pub objects: Vec<String>,
    /// Lower and upper corner of all triangles, metres.
    pub bounds: [Vec3; 2],
    /// Of the picture, pixels.
    pub width: usize,
    pub height: usize,
    /// Samples across and down a pixel.
    pub across: usize,
    pub down: usize,
    pub camera: View,
    /// M, a power of two.
    pub gather_samples: usize,
    /// Hashes, hexadecimal: where the gather samples lie, and between which rows of the transfer view samples interpolate.
    pub gather_layout: String,
    pub row_layout: String,
}

/// A pinhole camera that looks along its own -Z with +Y up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    pub name: String,
    /// Metres, world.
    pub position: Vec3,
    /// Columns: the camera's right, up and backward axes in world space.
    pub world_from_camera: Mat3,
    /// Vertical field of view, radians.
    pub fov_y: f32,
}

impl Origin {
    pub fn of(geometry: &Geometry, transfer: &Transfer) -> Self {
        let Samples { width, height, across, down, .. } = *transfer.samples;
        let Camera { name, position, world_from_camera, fov_y } = transfer.samples.camera.clone();
        Self {
            geometry: hex(&geometry.fingerprint),
            triangles: geometry.corners.len(),
            objects: geometry.objects.clone(),
            bounds: geometry.bounds().into(),
            width,
            height,
            across,
            down,
            camera: View { name, position, world_from_camera, fov_y },
            gather_samples: transfer.gather.count(),
            gather_layout: gather_layout(transfer),
            row_layout: row_layout(transfer),
        }
    }

    /// N; 0 where that is beyond counting.
    pub fn view_samples(&self) -> usize {
        [self.height, self.across, self.down].into_iter().try_fold(self.width, usize::checked_mul).unwrap_or(0)
    }

    pub(super) fn fault(&self) -> Option<String> {
        let gather = self.gather_samples;
        if !gather.is_power_of_two() || !(2..=1 << 20).contains(&gather) {
            return Some(format!("{gather} gather samples; expected a power of two from 2 to 1048576"));
        }
        let count = self.view_samples();
        if count == 0 || count >= 1 << 31 {
            let Self { width, height, across, down, .. } = self;
            return Some(format!("{width} x {height} pixels of {across} x {down} samples; expected 1 to 2^31"));
        }
        None
    }

    /// What is different here, in words; nothing when edits that were sampled for `self` apply.
    pub fn differences(&self, here: &Origin) -> Vec<String> {
        let mut found = self.scene_differences(&here.geometry, here.triangles, &here.objects, here.bounds);
        let mut note = |differs: bool, what: &dyn Fn() -> String| {
            if differs {
                found.push(what());
            }
        };
        let pixels = |origin: &Origin| format!("{} x {}", origin.width, origin.height);
        note(pixels(self) != pixels(here), &|| format!("resolution {}, here {}", pixels(self), pixels(here)));
        let samples = |origin: &Origin| format!("{} x {}", origin.across, origin.down);
        note(samples(self) != samples(here), &|| format!("samples a pixel {}, here {}", samples(self), samples(here)));
        let (a, b) = (&self.camera, &here.camera);
        note(a.position != b.position, &|| format!("camera at {}, here {}", a.position, b.position));
        note(a.world_from_camera != b.world_from_camera, &|| {
            format!("camera looks along {}, here {}", -a.world_from_camera.z_axis, -b.world_from_camera.z_axis)
        });
        note(a.fov_y != b.fov_y, &|| {
            format!("field of view {:.3}°, here {:.3}°", a.fov_y.to_degrees(), b.fov_y.to_degrees())
        });
        let (gather, count) = (self.gather_samples, here.gather_samples);
        note(gather != count, &|| format!("gather samples {gather}, here {count}"));
        // What follows from the above is no news.
        if found.is_empty() && self.gather_layout != here.gather_layout {
            found.push("gather samples lie elsewhere".to_owned());
        }
        if found.is_empty() && self.row_layout != here.row_layout {
            found
                .push("the transfer's rows are placed elsewhere (by another tolerance, placement or basis)".to_owned());
        }
        found
    }

    /// What of the scene is different there: its fingerprint, number of triangles, objects, bounds.
    fn scene_differences(
        &self,
        geometry: &str,
        triangles: usize,
        objects: &[String],
        bounds: [Vec3; 2],
    ) -> Vec<String> {
        let mut found = Vec::new();
        let mut note = |differs: bool, what: &dyn Fn() -> String| {
            if differs {
                found.push(what());
            }
        };
        note(self.triangles != triangles, &|| format!("triangles {}, here {triangles}", self.triangles));
        let names = |objects: &[String]| objects.iter().cloned().collect::<BTreeSet<_>>();
        let (before, now) = (names(&self.objects), names(objects));
        note(before.difference(&now).next().is_some(), &|| {
            format!("objects missing: {}", few(before.difference(&now)))
        });
        note(now.difference(&before).next().is_some(), &|| format!("objects new: {}", few(now.difference(&before))));
        note(self.bounds != bounds, &|| {
            let ([a, b], [c, d]) = (self.bounds, bounds);
            format!("bounds {a} to {b} m, here {c} to {d} m")
        });
        if found.is_empty() && self.geometry != geometry {
            found.push("surfaces have moved, or are called or made differently".to_owned());
        }
        found
    }
}

impl Sampled {
    /// # Errors
    /// `Compute` when the edits were sampled for another scene; any view and any transfer of it will do.
    pub fn check_scene(&self, geometry: &Geometry) -> Result<()> {
        let Geometry { objects, corners, .. } = geometry;
        let bounds = geometry.bounds().into();
        let differences = self.origin.scene_differences(&hex(&geometry.fingerprint), corners.len(), objects, bounds);
        if differences.is_empty() {
            return Ok(());
        }
        Err(Error::compute(
            format!("the edits were sampled for another scene: {}", differences.join("; ")),
            "connect the scene that they were sampled for, or sample them anew with scale_offset",
        ))
    }

    /// # Errors
    /// `Compute` when the edits were sampled for another scene, view or transfer: it says what differs.
    pub fn check(&self, geometry: &Geometry, transfer: &Transfer) -> Result<()> {
        let differences = self.origin.differences(&Origin::of(geometry, transfer));
        if differences.is_empty() {
            return Ok(());
        }
        Err(Error::compute(
            format!("the edits were sampled for another scene, view or transfer: {}", differences.join("; ")),
            "connect what they were sampled for, or sample them anew with scale_offset",
        ))
    }
}

impl ViewPlaces {
    pub fn of(geometry: &Geometry, samples: &Samples) -> Self {
        let points = &samples.points;
        Self {
            side: points.par_iter().map(|point| side(geometry, point)).collect::<Vec<_>>().into(),
            barycentrics: samples.barycentrics.clone(),
            position: points.par_iter().map(|point| point.position).collect::<Vec<_>>().into(),
            normal: points.par_iter().map(|point| point.normal).collect::<Vec<_>>().into(),
        }
    }
}

/// As `ViewPlaces::side` numbers them.
pub fn side(geometry: &Geometry, point: &SurfacePoint) -> u32 {
    if !point.exists() {
        return NOWHERE;
    }
    let is_front = geometry.area_vector(point.triangle as usize).dot(point.geometric_normal.into()) >= 0.0;
    2 * point.triangle + u32::from(!is_front)
}

impl GatherPlaces {
    pub fn of(geometry: &Geometry, transfer: &Transfer) -> Self {
        let points = &transfer.gather.points;
        Self {
            side: points.iter().map(|point| side(geometry, point)).collect::<Vec<_>>().into(),
            barycentrics: transfer.gather.barycentrics.clone(),
            position: points.iter().map(|point| point.position).collect::<Vec<_>>().into(),
            normal: points.iter().map(|point| point.geometric_normal).collect::<Vec<_>>().into(),
        }
    }
}

fn gather_layout(transfer: &Transfer) -> String {
    let triangles: Vec<u32> = transfer.gather.points.iter().map(|point| point.triangle).collect();
    digest(&[bytemuck::cast_slice(&triangles), bytemuck::cast_slice(&transfer.gather.barycentrics)])
}

fn row_layout(transfer: &Transfer) -> String {
    let basis = format!("{:?}", transfer.settings.basis);
    let rows = bytemuck::cast_slice(&transfer.row_samples);
    digest(&[basis.as_bytes(), rows, bytemuck::cast_slice(&transfer.indices)])
}

fn digest(parts: &[&[u8]]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes()).update_rayon(part);
    }
    hex(hasher.finalize().as_bytes()[..16].try_into().expect("16 of 32 bytes"))
}

fn hex(digest: &Digest) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The first few names.
fn few<'a>(names: impl Iterator<Item = &'a String>) -> String {
    const MOST: usize = 8;
    let names: Vec<&str> = names.map(String::as_str).collect();
    match names.len() {
        count if count > MOST => format!("{} and {} more", names[..MOST].join(", "), count - MOST),
        _ => names.join(", "),
    }
}
