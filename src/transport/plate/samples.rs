//! A plate's own pixels as surface samples, so that edits line up with it to the pixel.

use super::edges::{Mended, Pixel, mend};
use super::passes::{Passes, UpAxis, indices};
use super::pinhole::{self, Sighting};
use crate::device::Device;
use crate::image::Image;
use crate::scene::{Camera, Geometry, SurfacePoint};
use crate::transport::Samples;
use crate::transport::nearest::nearest;
use crate::transport::shadow::kinship::pixel_angle;
use crate::{Error, Result};
use glam::{DVec2, Vec3};
use rayon::prelude::*;

/// How plates say where their surfaces are.
pub struct Layers<'a> {
    /// Empty: found by its name.
    pub position: &'a str,
    pub normal: &'a str,
    pub up: UpAxis,
    /// Metres to the plate's unit.
    pub scale: f32,
    /// More than one only on a scene.
    pub per_pixel: u32,
}

/// What was found. Pixels, unless it says otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Told {
    pub surface: usize,
    /// Between surfaces, and put on one of them.
    pub filled: usize,
    /// Between surfaces, with no whole pixel near.
    pub lost: usize,
    pub not_finite: usize,
    /// Farther from the scene than a pixel is large.
    pub off: usize,
    /// Median distance in the picture between positions and the camera that was found, pixels.
    pub residual: f64,
}

/// Positions that the camera is found from have a normal at least this long: they are of one surface.
const SURE: f32 = 0.99;
/// A camera fits when half of the positions are this near to where it sees them, pixels.
pub const FITS: f64 = 0.75;
/// Cosine of the angle between the plate's normal and that of the surface that it is taken for.
const TURNED: f32 = 0.7;

/// `camera`: of the plate, where it is known; otherwise it is found from the positions. With a scene, pixels lie on its
/// surfaces; without, on those of the plate alone.
///
/// # Errors
/// `Compute` for layers that are missing, a plate without surfaces, and one that lies nowhere on the scene.
pub fn plate_samples(
    device: &Device,
    image: &Image,
    layers: &Layers,
    camera: Option<&Camera>,
    geometry: Option<&Geometry>,
) -> Result<(Samples, Told)> {
    let passes = Passes::read(image, layers.position, layers.normal, layers.up, layers.scale)?;
    let surface = (0..passes.positions.len()).filter(|pixel| passes.exists(*pixel)).count();
    if surface == 0 {
        let message = "the normal layer is zero everywhere: the plate shows no surface";
        return Err(Error::compute(message, "render the plate with position and normal passes"));
    }
    let (camera, residual) = find_camera(&passes, camera)?;
    let mended = mend(&passes, &camera);
    let count = |kind: Pixel| mended.pixels.iter().filter(|pixel| **pixel == kind).count();
    let told = Told {
        surface,
        filled: count(Pixel::Filled),
        lost: count(Pixel::Lost),
        not_finite: passes.not_finite,
        off: 0,
        residual,
    };
    match geometry {
        Some(geometry) => {
            let scene = OnScene { geometry, camera: &camera, passes: &passes, mended: &mended };
            let (samples, off) = scene.samples(device, layers.per_pixel, residual <= FITS)?;
            if 2 * off > surface {
                return Err(elsewhere(&mended, layers, geometry, off, surface));
            }
            Ok((samples, Told { off, ..told }))
        }
        None if layers.per_pixel > 1 => {
            let message = format!("{} samples a pixel without a scene", layers.per_pixel);
            Err(Error::compute(message, "connect the scene, or set samples_per_pixel to 1"))
        }
        None => Ok((alone(image, &mended, camera), told)),
    }
}

fn find_camera(passes: &Passes, given: Option<&Camera>) -> Result<(Camera, f64)> {
    let size = DVec2::new(passes.width as f64, passes.height as f64);
    let sure = (0..passes.positions.len()).filter(|pixel| passes.normals[*pixel].length() >= SURE);
    let sightings: Vec<Sighting> = sure
        .map(|pixel| Sighting {
            at: DVec2::new((pixel % passes.width) as f64 + 0.5, (pixel / passes.width) as f64 + 0.5),
            position: passes.positions[pixel].as_dvec3(),
        })
        .collect();
    if let Some(camera) = given {
        let off = sightings.iter().map(|s| match camera.project(s.position.as_vec3(), size.as_vec2()) {
            Some((at, _)) => at.as_dvec2().distance(s.at),
            None => f64::INFINITY,
        });
        let mut off: Vec<f64> = off.collect();
        off.sort_by(f64::total_cmp);
        return Ok((camera.clone(), off.get(off.len() / 2).copied().unwrap_or(0.0)));
    }
    pinhole::fit(&sightings, size).map(|fit| (fit.camera, fit.residual)).ok_or_else(|| {
        let message = "the plate's positions do not tell where its camera is: they lie in one spot, or on one line";
        Error::compute(message, "connect the camera that it was rendered through")
    })
}

/// A plate's pixels over the scene that it shows.
struct OnScene<'a> {
    geometry: &'a Geometry,
    camera: &'a Camera,
    passes: &'a Passes,
    mended: &'a Mended,
}

impl OnScene<'_> {
    /// The samples, and how many pixels are not on the scene. Rays through the camera are exact where positions are
    /// rounded to half floats, and find what is seen at an edge; they count where the plate shows the same.
    fn samples(&self, device: &Device, per_pixel: u32, camera_fits: bool) -> Result<(Samples, usize)> {
        let size = (self.passes.width as u32, self.passes.height as u32);
        let mut samples = Samples::view(device, self.geometry, self.camera, size, per_pixel)?;
        let count = samples.per_pixel();
        let angle = pixel_angle(self.camera, self.passes.height);
        let place = |i: usize| -> (SurfacePoint, [f32; 2], bool) {
            let (pixel, hit) = (i / count, &samples.points[i]);
            if self.mended.pixels[pixel] == Pixel::Nothing {
                return (SurfacePoint::NOWHERE, [0.0; 2], false);
            }
            if camera_fits && hit.exists() && self.shows(pixel, hit, angle) {
                return (*hit, samples.barycentrics[i], false);
            }
            let (position, normal) = (self.mended.positions[pixel], self.mended.normals[pixel]);
            let found = nearest(self.geometry, position, Some(normal));
            let off = found.distance > tolerance(self.camera, angle, position, normal);
            (found.point, found.barycentrics, off)
        };
        let placed: Vec<(SurfacePoint, [f32; 2], bool)> =
            (0..samples.points.len()).into_par_iter().with_min_len(1024).map(place).collect();
        let off = placed.chunks(count).filter(|pixel| pixel.iter().any(|(.., off)| *off)).count();
        samples.points = placed.iter().map(|(point, ..)| *point).collect::<Vec<_>>().into();
        samples.barycentrics = placed.iter().map(|(_, at, _)| *at).collect::<Vec<_>>().into();
        Ok((samples, off))
    }

    /// Whether the plate has that surface at a pixel, or around one that shows several.
    fn shows(&self, pixel: usize, hit: &SurfacePoint, angle: f32) -> bool {
        let is = |position: Vec3, normal: Vec3, reach: f32| {
            let near = reach * tolerance(self.camera, angle, position, normal);
            Vec3::from(hit.normal).dot(normal) > TURNED && Vec3::from(hit.position).distance(position) <= near
        };
        let (mended, passes) = (self.mended, self.passes);
        // The average itself, too: slivers at the border of the picture are taken for edges.
        let average = passes.normals[pixel];
        let at_pixel = is(mended.positions[pixel], mended.normals[pixel], 1.0)
            || (average.length() >= SURE && is(passes.positions[pixel], average.normalize(), 1.0));
        if at_pixel || mended.pixels[pixel] == Pixel::Whole {
            return at_pixel;
        }
        let (x, y, width) = (pixel % passes.width, pixel / passes.width, passes.width);
        let rows = y.saturating_sub(1)..(y + 2).min(passes.height);
        let around = rows.flat_map(|y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x));
        let mut around = around.filter(|other| mended.pixels[*other] != Pixel::Nothing);
        around.any(|other| is(mended.positions[other], mended.normals[other], 2.0))
    }
}

/// How far a position may lie from the surface that it is meant to be on: two pixels of it, and the rounding of halves.
fn tolerance(camera: &Camera, angle: f32, position: Vec3, normal: Vec3) -> f32 {
    let way = camera.position - position;
    let footprint = way.dot(camera.world_from_camera.z_axis).abs() * angle;
    let stretch = way.normalize_or_zero().dot(normal).abs().max(0.1);
    2.0 * footprint / stretch + position.abs().max_element() / 1024.0
}

/// Most positions are on no surface: whether the other axes would do.
fn elsewhere(mended: &Mended, layers: &Layers, geometry: &Geometry, off: usize, all: usize) -> Error {
    let whole: Vec<usize> = (0..mended.pixels.len()).filter(|pixel| mended.pixels[*pixel] == Pixel::Whole).collect();
    let (low, high) = geometry.bounds();
    let near = 0.002 * (high - low).length();
    let on = |turn: &dyn Fn(Vec3) -> Vec3| {
        let tried = whole.iter().step_by(whole.len().div_ceil(500).max(1));
        let on = tried.clone().filter(|pixel| nearest(geometry, turn(mended.positions[**pixel]), None).distance < near);
        on.count() as f64 / tried.count().max(1) as f64
    };
    // From our axes back to the plate's, and forth by the other rule.
    let back = |v: Vec3| match layers.up {
        UpAxis::Y => v,
        UpAxis::Z => Vec3::new(v.x, -v.z, v.y),
    };
    let other = layers.up.other();
    let message = format!("{off} of {all} positions of the plate lie on no surface of the scene");
    let (mut least, mut most) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for pixel in &whole {
        (least, most) = (least.min(mended.positions[*pixel]), most.max(mended.positions[*pixel]));
    }
    let help = if on(&|v| other.to_ours(back(v))) > 0.5 {
        format!("they do with up_axis \"{}\"", other.name())
    } else {
        let (a, b) = (most - least, high - low);
        format!("the plate spans {a:.3} m, the scene {b:.3} m: connect the scene that was rendered, or set scale")
    };
    Error::compute(message, help)
}

/// Samples that know of no scene: objects and materials are those of the plate's Cryptomattes.
fn alone(image: &Image, mended: &Mended, camera: Camera) -> Samples {
    let (objects, materials) = (indices(image, "CryptoObject"), indices(image, "CryptoMaterial"));
    let point = |pixel: usize| match mended.pixels[pixel] {
        Pixel::Nothing => SurfacePoint::NOWHERE,
        _ => SurfacePoint {
            position: mended.positions[pixel].to_array(),
            object: objects[pixel],
            normal: mended.normals[pixel].to_array(),
            material: materials[pixel],
            geometric_normal: mended.normals[pixel].to_array(),
            triangle: crate::scene::geometry::NONE,
        },
    };
    let points: Vec<SurfacePoint> = (0..mended.pixels.len()).into_par_iter().map(point).collect();
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"plate").update_rayon(bytemuck::cast_slice(&points));
    Samples {
        width: image.width,
        height: image.height,
        across: 1,
        down: 1,
        camera,
        atlas: None,
        geometry: hasher.finalize().as_bytes()[..16].try_into().expect("16 of 32 bytes"),
        barycentrics: vec![[0.0; 2]; points.len()].into(),
        points: points.into(),
    }
}
