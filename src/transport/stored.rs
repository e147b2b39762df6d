//! A transfer in the disk cache, with the view samples that it is for.

use crate::device::Array;
use crate::scene::{Camera, Fingerprint};
use crate::stored::{SectionReader, SectionWriter, Stored};
use crate::transport::atlas::Atlas;
use crate::transport::gather::Gather;
use crate::transport::precompute::Settings;
use crate::transport::sparse::{EntryFormat, SparseRows};
use crate::transport::{Samples, Transfer};
use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Serialize, Deserialize)]
struct View {
    size: [usize; 4],
    /// Size of the atlas, and whether its coordinates are the file's own.
    atlas: Option<(usize, bool)>,
    geometry: Fingerprint,
    name: String,
    position: Vec3,
    world_from_camera: Mat3,
    fov_y: f32,
}

impl Stored for Samples {
    fn write<'a>(&'a self, sections: &mut SectionWriter<'a>) {
        let Camera { name, position, world_from_camera, fov_y } = self.camera.clone();
        let size = [self.width, self.height, self.across, self.down];
        let atlas = self.atlas.as_ref().map(|atlas| (atlas.size, atlas.from_file));
        sections.value(&View { size, atlas, geometry: self.geometry, name, position, world_from_camera, fov_y });
        sections.slice(&self.points);
        sections.slice(&self.barycentrics);
        if let Some(atlas) = &self.atlas {
            sections.slice(&atlas.uvs);
        }
    }

    fn read(sections: &mut SectionReader) -> Option<Self> {
        let View { size: [width, height, across, down], atlas, geometry, name, position, world_from_camera, fov_y } =
            sections.value()?;
        let (points, barycentrics) = (sections.vec()?, sections.vec()?);
        let atlas = match atlas {
            Some((size, from_file)) => Some(Arc::new(Atlas { size, uvs: sections.vec()?.into(), from_file })),
            None => None,
        };
        let count = [height, across, down].into_iter().try_fold(width, usize::checked_mul)?;
        let camera = Camera { name, position, world_from_camera, fov_y };
        (points.len() == count && barycentrics.len() == count).then(|| Self {
            width,
            height,
            across,
            down,
            camera,
            atlas,
            geometry,
            points: points.into(),
            barycentrics: barycentrics.into(),
        })
    }
}

pub(super) fn write_rows<'a>(rows: &'a SparseRows, sections: &mut SectionWriter<'a>) {
    sections.value(&(rows.format().index_bits, rows.format().signed));
    sections.slice(rows.offsets());
    sections.slice(rows.entries());
    sections.slice(rows.scale());
}

pub(super) fn read_rows(sections: &mut SectionReader) -> Option<SparseRows> {
    let (index_bits, signed) = sections.value()?;
    let (offsets, entries, scale) = (sections.vec::<u32>()?, Array::<u32>::read(sections)?, sections.vec::<f32>()?);
    SparseRows::new(offsets, entries, scale, EntryFormat { index_bits, signed }).ok()
}

#[derive(Serialize, Deserialize)]
struct Header {
    settings: Settings,
    area: f32,
    between: bool,
}

impl Stored for Transfer {
    fn write<'a>(&'a self, sections: &mut SectionWriter<'a>) {
        sections.value(&Header { settings: self.settings, area: self.gather.area, between: self.between.is_some() });
        self.samples.write(sections);
        sections.slice(&self.gather.points);
        sections.slice(&self.gather.barycentrics);
        sections.slice(&self.gather.radius2);
        sections.slice(&self.gather.sides);
        sections.slice(&self.gather.cells);
        sections.slice(&self.row_samples);
        sections.slice(&self.indices);
        sections.slice(&self.weights);
        write_rows(&self.rows, sections);
        self.between.iter().for_each(|between| write_rows(between, sections));
    }

    fn read(sections: &mut SectionReader) -> Option<Self> {
        let Header { settings, area, between } = sections.value()?;
        let samples = Arc::new(Samples::read(sections)?);
        let gather = Gather {
            area,
            points: sections.vec::<crate::scene::SurfacePoint>()?.into(),
            barycentrics: sections.vec::<[f32; 2]>()?.into(),
            radius2: sections.vec::<f32>()?.into(),
            sides: sections.vec::<[u32; 4]>()?.into(),
            cells: sections.vec::<u32>()?.into(),
        };
        let row_samples: Vec<u32> = sections.vec()?;
        let (indices, weights): (Vec<[u32; 4]>, Vec<[f32; 4]>) = (sections.vec()?, sections.vec()?);
        let rows = read_rows(sections)?;
        let between = if between { Some(read_rows(sections)?) } else { None };
        let count = gather.points.len();
        let fits = count.is_power_of_two()
            && gather.barycentrics.len() == count
            && gather.radius2.len() == 2 * count
            && rows.columns() == 1 << settings.basis.index_bits(count)
            && row_samples.len() == rows.rows()
            && indices.len() == samples.points.len()
            && weights.len() == indices.len();
        fits.then(|| Self {
            samples,
            gather,
            settings,
            rows,
            row_samples: row_samples.into(),
            indices: indices.into(),
            weights: weights.into(),
            between,
        })
    }
}
