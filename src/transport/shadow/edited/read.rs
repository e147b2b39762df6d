//! Baked shadows of some samples at some directions.

use crate::scene::cube::FACES;
use crate::transport::shadow::visibility::{Data, Rows, Scratch};
use crate::transport::shadow::{Group, Visibility};
use std::ops::Range;

/// Which of `texels` (numbers over all faces, ascending) a group may hide from any of the samples: places in the list.
pub fn hidden(visibility: &Visibility, group: &Group, samples: &[u32], texels: &[u32]) -> Vec<u32> {
    let face_texels = visibility.size * visibility.size;
    let mut is_hidden = vec![false; FACES * face_texels];
    for (face, rows) in group.faces.iter().enumerate() {
        let Some(rows) = rows else { continue };
        let hidden = &mut is_hidden[face * face_texels..(face + 1) * face_texels];
        for &sample in samples.iter().filter(|&&sample| rows.count(sample as usize) > 0) {
            match &rows.data {
                Data::Runs(runs) => runs.spans(sample as usize).for_each(|span| hidden[span].fill(true)),
                // A wavelet rings wherever it reaches.
                Data::Haar(..) => hidden.fill(true),
            }
        }
    }
    (0..).zip(texels).filter(|(_, texel)| is_hidden[**texel as usize]).map(|(place, _)| place).collect()
}

/// Per sample, what a group hides at `texels` (numbers over all faces, ascending): one value a texel. Directions on faces
/// that were not baked count as open.
pub fn shadows(visibility: &Visibility, group: &Group, samples: &[u32], texels: &[u32]) -> Vec<f32> {
    let face_texels = visibility.size * visibility.size;
    let faces: Vec<(usize, Range<usize>)> = (0..FACES)
        .map(|face| {
            let place = |texel: usize| texels.partition_point(|&t| (t as usize) < texel);
            (face, place(face * face_texels)..place((face + 1) * face_texels))
        })
        .filter(|(face, range)| !range.is_empty() && group.faces[*face].is_some())
        .collect();
    let mut values = vec![0.0; samples.len() * texels.len()];
    let (mut scratch, mut decoded) = (Scratch::default(), vec![0.0; face_texels]);
    for (values, &sample) in values.chunks_exact_mut(texels.len().max(1)).zip(samples) {
        for (face, range) in &faces {
            let Some(rows) = &group.faces[*face] else { continue };
            let first = face * face_texels;
            let places = texels[range.clone()].iter().map(|&texel| texel as usize - first);
            read(rows, sample as usize, places, &mut values[range.clone()], &mut scratch, &mut decoded);
        }
    }
    values
}

/// One row at some texels of its face, ascending; `values` come in as 0.
fn read(
    rows: &Rows,
    row: usize,
    places: impl Iterator<Item = usize>,
    values: &mut [f32],
    scratch: &mut Scratch,
    decoded: &mut [f32],
) {
    match &rows.data {
        _ if rows.count(row) == 0 => {}
        Data::Runs(runs) => {
            let mut spans = runs.spans(row);
            let mut span = spans.next();
            for (value, place) in values.iter_mut().zip(places) {
                while span.as_ref().is_some_and(|span| span.end <= place) {
                    span = spans.next();
                }
                match &span {
                    Some(span) => *value = f32::from(u8::from(span.start <= place)),
                    None => break,
                }
            }
        }
        Data::Haar(..) => {
            rows.decode(row, scratch, decoded);
            values.iter_mut().zip(places).for_each(|(value, place)| *value = decoded[place]);
        }
    }
}
