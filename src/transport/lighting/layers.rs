//! From light at view samples to layers of a picture: reflectance, illumination brushes, pixels.

use super::Stage;
use crate::Result;
use crate::device::Array;
use crate::image::{Content, Layer};
use crate::scene::Camera;
use crate::transport::{Edit, Edits, Sampled, Samples};
use glam::{Mat3, Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// Indirect radiance from each view sample to the camera: `reflectance / pi * irradiance + reflection`, then the brushes
/// and what is sampled of such, in order (thesis Algorithm 6); N elements. `reflection`: radiance of glossy receivers, empty for none.
pub fn indirect_radiance(
    stage: &Stage,
    reflectance: &[[f32; 4]],
    irradiance: &[[f32; 4]],
    reflection: &[[f32; 4]],
    edits: &Edits,
) -> Result<Vec<[f32; 4]>> {
    let mut changes = Vec::new();
    for edit in &edits.0 {
        match edit {
            Edit::Eye(brush) => {
                let weights = brush.selection.as_ref().map(|selection| stage.at_view(selection)).transpose()?;
                changes.push(AtEye::Brush(brush.matrix(), weights));
            }
            Edit::Sampled(sampled) => changes.push(AtEye::Sampled(sampled)),
            Edit::Source(_) | Edit::Transit(_) => {}
        }
    }
    let radiance = |i: usize| {
        let reflected = reflection.get(i).map_or(Vec3::ZERO, |light| rgb(*light));
        let mut light = rgb(reflectance[i]) * rgb(irradiance[i]) * FRAC_1_PI + reflected;
        changes.iter().for_each(|change| light = change.apply(i, light));
        light.extend(0.0).to_array()
    };
    Ok((0..irradiance.len()).into_par_iter().with_min_len(TILE).map(radiance).collect())
}

/// A change of radiance on its way to the camera.
enum AtEye<'a> {
    Brush(Mat3, Option<Arc<Array<f32>>>),
    Sampled(&'a Sampled),
}

impl AtEye<'_> {
    fn apply(&self, sample: usize, light: Vec3) -> Vec3 {
        match self {
            Self::Brush(matrix, weights) => {
                let weight = weights.as_ref().map_or(1.0, |weights| weights[sample]);
                if weight > 0.0 { light + (*matrix * light - light) * weight } else { light }
            }
            Self::Sampled(sampled) => {
                let at = |vector: &Option<Array<[f32; 4]>>| vector.as_ref().map(|vector| rgb(vector[sample]));
                light * at(&sampled.eye.scale).unwrap_or(Vec3::ONE) + at(&sampled.eye.offset).unwrap_or(Vec3::ZERO)
            }
        }
    }
}

/// What is known at each view sample when all light is there; N each.
pub struct Shading<'a> {
    pub samples: &'a Samples,
    /// Diffuse reflectance.
    pub reflectance: &'a [[f32; 4]],
    /// Irradiance straight from lights.
    pub direct: &'a [[f32; 4]],
    /// Radiance of indirect light towards the camera.
    pub indirect: &'a [[f32; 4]],
    /// Radiance of highlights, empty for none; and radiance that surfaces emit.
    pub highlight: &'a [[f32; 4]],
    pub emission: &'a (dyn Fn(usize) -> Vec3 + Sync),
}

impl Shading<'_> {
    /// The layers that change with light: beauty, `direct` and `indirect` (radiance, albedo included), box-filtered over
    /// the samples of a pixel.
    pub fn layers(&self) -> Vec<Layer> {
        light_layers(&self.resolved())
    }

    /// Direct and indirect radiance of each pixel; the fourth element of direct light is coverage.
    pub fn resolved(&self) -> [Vec<Vec4>; 2] {
        let direct = self.samples.resolve(|i| {
            let diffuse = rgb(self.reflectance[i]) * rgb(self.direct[i]) * FRAC_1_PI;
            let highlight = self.highlight.get(i).map_or(Vec3::ZERO, |h| rgb(*h));
            // The fourth element counts coverage.
            (diffuse + highlight + (self.emission)(i)).extend(self.reflectance[i][3])
        });
        [direct, self.samples.resolve(|i| rgb(self.indirect[i]).extend(0.0))]
    }
}

/// The layers of `Shading::resolved`.
pub fn light_layers([direct, indirect]: &[Vec<Vec4>; 2]) -> Vec<Layer> {
    let pixels = direct.len();
    vec![
        layer("", &["R", "G", "B", "A"], Content::Colour, pixels, |p| (direct[p] + indirect[p]).to_array()),
        layer("direct", &["R", "G", "B"], Content::Colour, pixels, |p| direct[p].truncate().to_array()),
        layer("indirect", &["R", "G", "B"], Content::Colour, pixels, |p| indirect[p].truncate().to_array()),
    ]
}

/// The layers that light does not change: `albedo`, `P`, `N`, `Z`. P, N and Z are averages over those samples of a pixel
/// that hit something; Z is the distance along the camera's axis, 0 where there is nothing.
pub fn surface_layers(samples: &Samples, reflectance: &[[f32; 4]]) -> Vec<Layer> {
    place_layers(&samples.camera, &resolved_surface(samples, reflectance))
}

/// Reflectance (with coverage), position and normal of each pixel.
pub fn resolved_surface(samples: &Samples, reflectance: &[[f32; 4]]) -> [Vec<Vec4>; 3] {
    let points = &samples.points;
    [
        samples.resolve(|i| Vec4::from_array(reflectance[i])),
        samples.resolve(|i| Vec3::from(points[i].position).extend(0.0)),
        samples.resolve(|i| Vec3::from(points[i].normal).extend(0.0)),
    ]
}

/// The layers of `resolved_surface`.
pub fn place_layers(camera: &Camera, [albedo, position, normal]: &[Vec<Vec4>; 3]) -> Vec<Layer> {
    let place = |p: usize| if albedo[p].w > 0.0 { position[p].truncate() / albedo[p].w } else { Vec3::ZERO };
    let depth = |p: usize| match albedo[p].w {
        covered if covered > 0.0 => (camera.position - place(p)).dot(camera.world_from_camera.z_axis),
        _ => 0.0,
    };
    let pixels = albedo.len();
    vec![
        layer("albedo", &["R", "G", "B"], Content::Colour, pixels, |p| albedo[p].truncate().to_array()),
        layer("P", &["X", "Y", "Z"], Content::Data, pixels, |p| place(p).to_array()),
        layer("N", &["X", "Y", "Z"], Content::Data, pixels, |p| normal[p].truncate().normalize_or_zero().to_array()),
        layer("Z", &["Z"], Content::Data, pixels, |p| [depth(p)]),
    ]
}

pub(in crate::transport) fn layer<const C: usize>(
    name: &str,
    channels: &[&str; C],
    content: Content,
    pixels: usize,
    value: impl Fn(usize) -> [f32; C] + Send + Sync,
) -> Layer {
    let texels: Vec<[f32; C]> = (0..pixels).into_par_iter().with_min_len(TILE).map(value).collect();
    Layer::new(name, channels, content, texels.into_flattened())
}

/// Pixels or samples that one task works on.
const TILE: usize = 4096;

fn rgb(value: [f32; 4]) -> Vec3 {
    Vec4::from_array(value).truncate()
}
