//! From lights to the light of view samples: exitance of gather samples, bounces, edits, and layers of a picture.

use crate::Result;
use crate::device::Device;
use crate::image::{Content, Layer};
use crate::kernels::colour_edits::{ColourEdit, colour_edits};
use crate::transport::atoms::{self, Atoms};
use crate::transport::edits::{Block, Change, Colour, Transit};
use crate::transport::{Edits, Samples, Selection, Transfer};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// Radiant exitance of the gather samples, W/m²: direct irradiance times reflectance, and as many bounces between
/// gather samples as the transfer has beyond its last (thesis 3.1.1).
pub fn exitance(
    device: &Device,
    transfer: &Transfer,
    irradiance: &[[f32; 4]],
    reflectance: &[[f32; 4]],
) -> Result<Vec<[f32; 4]>> {
    let reflect = |irradiance: &[[f32; 4]]| -> Vec<[f32; 4]> {
        let pairs = irradiance.iter().zip(reflectance);
        pairs.map(|(e, r)| (Vec4::from_array(*e) * Vec4::from_array(*r)).to_array()).collect()
    };
    let mut last = reflect(irradiance);
    let mut total = last.clone();
    for _ in 1..transfer.settings.bounces {
        last = reflect(&transfer.bounce(device, &last)?);
        total
            .iter_mut()
            .zip(&last)
            .for_each(|(sum, more)| *sum = (Vec4::from_array(*sum) + Vec4::from_array(*more)).to_array());
    }
    Ok(total)
}

/// A list of edits made ready for one transfer: which casters it tells apart, and where it applies.
pub struct Prepared<'a> {
    edits: Vec<(&'a Block, &'a Colour)>,
    /// Index into `atoms.members` of each edit's caster; `None`: everything.
    caster: Vec<Option<usize>>,
    pub atoms: Atoms,
}

impl<'a> Prepared<'a> {
    pub fn new(edits: &'a Edits, transfer: &Transfer) -> Result<Self> {
        let colour = |transit: &'a Transit| match &transit.change {
            Change::Colour(colour) => Some((&transit.block, colour)),
            _ => None,
        };
        let edits: Vec<_> = edits.transit().filter_map(colour).collect();
        let mut distinct: Vec<&Arc<Selection>> = Vec::new();
        let caster = edits
            .iter()
            .map(|(block, _)| {
                let caster = block.caster.as_ref()?;
                Some(distinct.iter().position(|known| *known == caster).unwrap_or_else(|| {
                    distinct.push(caster);
                    distinct.len() - 1
                }))
            })
            .collect();
        let weights: Vec<Vec<f32>> =
            distinct.iter().map(|selection| selection.weights(&transfer.gather.points)).collect();
        let atoms = atoms::split(transfer.gather.count(), &weights)?;
        Ok(Self { edits, caster, atoms })
    }

    /// How many casters no gather sample lies in, if any.
    pub fn empty_casters(&self) -> Option<usize> {
        Some(self.atoms.members.iter().filter(|members| members.is_empty()).count()).filter(|count| *count > 0)
    }

    /// Irradiance at view samples: of all light, then, when there is more than one atom, of each atom; vectors of N.
    ///
    /// The first atom, what lies in no caster, is what the others leave of all light: no vector of its own is multiplied.
    pub fn irradiance(&self, device: &Device, transfer: &Transfer, exitance: &[[f32; 4]]) -> Result<Vec<[f32; 4]>> {
        let count = self.atoms.shares.len();
        let share = |shares: &Vec<f32>| -> Vec<[f32; 4]> {
            exitance.iter().zip(shares).map(|(b, s)| (Vec4::from_array(*b) * *s).to_array()).collect()
        };
        let mut parts = exitance.to_vec();
        parts.par_extend(self.atoms.shares[1..].par_iter().flat_map_iter(share));
        let mut arriving = transfer.apply(device, &parts, count)?;
        if count > 1 {
            let (all, inside) = arriving.split_at(transfer.samples.points.len());
            let rest = all.par_iter().enumerate().with_min_len(TILE).map(|(i, all)| {
                let inside = inside.iter().skip(i).step_by(transfer.samples.points.len());
                inside.fold(Vec4::from_array(*all), |rest, atom| rest - Vec4::from_array(*atom)).to_array()
            });
            let rest: Vec<[f32; 4]> = rest.collect();
            let at = all.len();
            arriving.splice(at..at, rest);
        }
        Ok(arriving)
    }

    /// The edited light (Algorithm 4, stacked). Samples that no edit's receiver holds keep every bit of the whole.
    pub fn edited(&self, device: &Device, samples: &Samples, irradiance: &[[f32; 4]]) -> Result<Vec<[f32; 4]>> {
        let count = self.atoms.shares.len();
        let (whole, atoms) = irradiance.split_at(if count > 1 { samples.points.len() } else { 0 });
        let all: Vec<usize> = (0..count).collect();
        let kernel_edits: Vec<ColourEdit> = self
            .edits
            .iter()
            .zip(&self.caster)
            .map(|((block, edit), caster)| ColourEdit {
                atoms: ColourEdit::mask(caster.map_or(&all, |c| &self.atoms.members[c]).iter().copied()),
                matrix: edit.matrix(),
                curve: edit.knots(),
                receiver: block.receiver.as_ref().map(|selection| selection.weights(&samples.points).into()),
                gain: None,
            })
            .collect();
        let mut edited = colour_edits(device, atoms, count, &kernel_edits)?.light;
        let receives = |i: usize| kernel_edits.iter().any(|edit| edit.receiver.as_ref().is_none_or(|w| w[i] > 0.0));
        edited.par_iter_mut().zip(whole).enumerate().with_min_len(TILE).for_each(|(i, (edited, whole))| {
            if !receives(i) {
                *edited = *whole;
            }
        });
        Ok(edited)
    }
}

/// What is known at each view sample when all light is there; N each.
pub struct Shading<'a> {
    pub samples: &'a Samples,
    /// Diffuse reflectance.
    pub reflectance: &'a [[f32; 4]],
    /// Irradiance straight from lights, and that of indirect light.
    pub direct: &'a [[f32; 4]],
    pub indirect: &'a [[f32; 4]],
    /// Radiance of highlights, empty for none; and radiance that surfaces emit.
    pub highlight: &'a [[f32; 4]],
    pub emission: &'a (dyn Fn(usize) -> Vec3 + Sync),
}

impl Shading<'_> {
    /// The layers that change with light: beauty, `direct` and `indirect` (radiance, albedo included), box-filtered over
    /// the samples of a pixel.
    pub fn layers(&self) -> Vec<Layer> {
        let direct = resolve(self.samples, |i| {
            let diffuse = rgb(self.reflectance[i]) * rgb(self.direct[i]) * FRAC_1_PI;
            let highlight = self.highlight.get(i).map_or(Vec3::ZERO, |h| rgb(*h));
            // The fourth element counts coverage.
            (diffuse + highlight + (self.emission)(i)).extend(self.reflectance[i][3])
        });
        let indirect =
            resolve(self.samples, |i| (rgb(self.reflectance[i]) * rgb(self.indirect[i]) * FRAC_1_PI).extend(0.0));
        let pixels = direct.len();
        vec![
            layer("", &["R", "G", "B", "A"], Content::Colour, pixels, |p| (direct[p] + indirect[p]).to_array()),
            layer("direct", &["R", "G", "B"], Content::Colour, pixels, |p| direct[p].truncate().to_array()),
            layer("indirect", &["R", "G", "B"], Content::Colour, pixels, |p| indirect[p].truncate().to_array()),
        ]
    }
}

/// The layers that light does not change: `albedo`, `P`, `N`, `Z`. P, N and Z are averages over those samples of a pixel
/// that hit something; Z is the distance along the camera's axis, 0 where there is nothing.
pub fn surface_layers(samples: &Samples, reflectance: &[[f32; 4]]) -> Vec<Layer> {
    let albedo = resolve(samples, |i| Vec4::from_array(reflectance[i]));
    let points = &samples.points;
    let camera = &samples.camera;
    let position = resolve(samples, |i| Vec3::from(points[i].position).extend(0.0));
    let normal = resolve(samples, |i| Vec3::from(points[i].normal).extend(0.0));
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

fn layer<const C: usize>(
    name: &str,
    channels: &[&str; C],
    content: Content,
    pixels: usize,
    value: impl Fn(usize) -> [f32; C] + Sync,
) -> Layer {
    let mut data = vec![0.0; C * pixels];
    data.par_chunks_mut(C * TILE).enumerate().for_each(|(tile, data)| {
        for (i, out) in data.chunks_exact_mut(C).enumerate() {
            out.copy_from_slice(&value(tile * TILE + i));
        }
    });
    Layer::new(name, channels, content, data)
}

/// Pixels or samples that one task works on.
const TILE: usize = 4096;

/// Mean over the samples of each pixel.
fn resolve(samples: &Samples, value: impl Fn(usize) -> Vec4 + Sync) -> Vec<Vec4> {
    let per_pixel = samples.per_pixel();
    (0..samples.width * samples.height)
        .into_par_iter()
        .with_min_len(TILE)
        .map(|pixel| (pixel * per_pixel..(pixel + 1) * per_pixel).map(&value).sum::<Vec4>() / per_pixel as f32)
        .collect()
}

/// Adds `count` elements of vectors of light up, in order.
pub fn sum(count: usize, vectors: &[&[[f32; 4]]]) -> Vec<[f32; 4]> {
    let mut total = vec![[0.0; 4]; count];
    total.par_chunks_mut(TILE).enumerate().for_each(|(tile, total)| {
        for vector in vectors {
            for (sum, more) in total.iter_mut().zip(&vector[tile * TILE..]) {
                *sum = (Vec4::from_array(*sum) + Vec4::from_array(*more)).to_array();
            }
        }
    });
    total
}

fn rgb(value: [f32; 4]) -> Vec3 {
    Vec4::from_array(value).truncate()
}
