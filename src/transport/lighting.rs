//! From lights to the light of view samples: exitance of gather samples, bounces, edits, and layers of a picture.

use crate::Result;
use crate::device::Device;
use crate::image::{Content, Layer};
use crate::kernels::colour_edits::{ColourEdit, colour_edits};
use crate::transport::atoms::{self, Atoms};
use crate::transport::{Edit, Edits, Samples, Selection, Transfer};
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
    for _ in 1..transfer.bounces {
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
    edits: Vec<&'a crate::transport::edits::CasterReceiver>,
    /// Index into `atoms.members` of each edit's caster; `None`: everything.
    caster: Vec<Option<usize>>,
    pub atoms: Atoms,
}

impl<'a> Prepared<'a> {
    pub fn new(edits: &'a Edits, transfer: &Transfer) -> Result<Self> {
        let edits: Vec<_> =
            edits.0.iter().map(|Edit::CasterReceiver(edit)| edit).filter(|edit| !edit.changes_nothing()).collect();
        let mut distinct: Vec<&Arc<Selection>> = Vec::new();
        let caster = edits
            .iter()
            .map(|edit| {
                let caster = edit.caster.as_ref()?;
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

    /// Irradiance at view samples from each atom: `atoms` vectors of N.
    pub fn irradiance(&self, device: &Device, transfer: &Transfer, exitance: &[[f32; 4]]) -> Result<Vec<[f32; 4]>> {
        if self.atoms.shares.len() == 1 {
            return transfer.apply(device, exitance, 1);
        }
        let share = |shares: &Vec<f32>| -> Vec<[f32; 4]> {
            exitance.iter().zip(shares).map(|(b, s)| (Vec4::from_array(*b) * *s).to_array()).collect()
        };
        let parts: Vec<[f32; 4]> = self.atoms.shares.par_iter().flat_map_iter(share).collect();
        transfer.apply(device, &parts, self.atoms.shares.len())
    }

    /// The edited sum of the atoms (Algorithm 4, stacked).
    pub fn edited(&self, device: &Device, samples: &Samples, irradiance: &[[f32; 4]]) -> Result<Vec<[f32; 4]>> {
        let all: Vec<usize> = (0..self.atoms.shares.len()).collect();
        let kernel_edits: Vec<ColourEdit> = self
            .edits
            .iter()
            .zip(&self.caster)
            .map(|(edit, caster)| ColourEdit {
                atoms: ColourEdit::mask(caster.map_or(&all, |c| &self.atoms.members[c]).iter().copied()),
                matrix: edit.matrix(),
                curve: edit.knots(),
                receiver: edit.receiver.as_ref().map(|selection| selection.weights(&samples.points).into()),
            })
            .collect();
        colour_edits(device, irradiance, self.atoms.shares.len(), &kernel_edits)
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
    /// Radiance of highlights, and radiance that surfaces emit.
    pub highlight: &'a [[f32; 4]],
    pub emission: &'a (dyn Fn(usize) -> Vec3 + Sync),
}

impl Shading<'_> {
    /// Beauty and the layers `direct`, `indirect` (radiance, albedo included), `albedo`, `P`, `N`, `Z`: box-filtered
    /// over the samples of a pixel. P, N and Z are averages over those samples that hit something; Z is the distance
    /// along the camera's axis, 0 where there is nothing.
    pub fn layers(&self) -> Vec<Layer> {
        let direct = self.resolve(|i| {
            let diffuse = rgb(self.reflectance[i]) * rgb(self.direct[i]) * FRAC_1_PI;
            let highlight = self.highlight.get(i).map_or(Vec3::ZERO, |h| rgb(*h));
            (diffuse + highlight + (self.emission)(i)).extend(0.0)
        });
        let indirect = self.resolve(|i| (rgb(self.reflectance[i]) * rgb(self.indirect[i]) * FRAC_1_PI).extend(0.0));
        let albedo = self.resolve(|i| Vec4::from_array(self.reflectance[i]));
        let covered = |p: usize, v: Vec4| if albedo[p].w > 0.0 { v / albedo[p].w } else { Vec4::ZERO };
        let points = &self.samples.points;
        let camera = &self.samples.camera;
        let position = self.resolve(|i| Vec3::from(points[i].position).extend(0.0));
        let normal = self.resolve(|i| Vec3::from(points[i].normal).extend(0.0));
        let depth = |p: Vec3| (camera.position - p).dot(camera.world_from_camera.z_axis);
        let three =
            |values: &dyn Fn(usize) -> Vec3| (0..albedo.len()).flat_map(|p| values(p).to_array()).collect::<Vec<f32>>();
        let beauty =
            (0..albedo.len()).flat_map(|p| (direct[p] + indirect[p]).truncate().extend(albedo[p].w).to_array());
        let where_ = |p: usize| covered(p, position[p]).truncate();
        let z = (0..albedo.len()).map(|p| if albedo[p].w > 0.0 { depth(where_(p)) } else { 0.0 });
        let (rgb_names, xyz) = (["R", "G", "B"], ["X", "Y", "Z"]);
        vec![
            Layer::new("", &["R", "G", "B", "A"], Content::Colour, beauty.collect()),
            Layer::new("direct", &rgb_names, Content::Colour, three(&|p| direct[p].truncate())),
            Layer::new("indirect", &rgb_names, Content::Colour, three(&|p| indirect[p].truncate())),
            Layer::new("albedo", &rgb_names, Content::Colour, three(&|p| albedo[p].truncate())),
            Layer::new("P", &xyz, Content::Data, three(&where_)),
            Layer::new("N", &xyz, Content::Data, three(&|p| normal[p].truncate().normalize_or_zero())),
            Layer::new("Z", &["Z"], Content::Data, z.collect()),
        ]
    }

    /// Mean over the samples of each pixel.
    fn resolve(&self, value: impl Fn(usize) -> Vec4 + Sync) -> Vec<Vec4> {
        let per_pixel = self.samples.per_pixel();
        (0..self.samples.width * self.samples.height)
            .into_par_iter()
            .with_min_len(4096)
            .map(|pixel| (pixel * per_pixel..(pixel + 1) * per_pixel).map(&value).sum::<Vec4>() / per_pixel as f32)
            .collect()
    }
}

fn rgb(value: [f32; 4]) -> Vec3 {
    Vec4::from_array(value).truncate()
}
