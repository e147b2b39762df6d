//! Samples that see nothing at all: inside of objects, where surfaces run into each other, or closed in.

use super::bake;
use super::visibility::{Data, Rows, Scratch, Visibility};
use crate::scene::Environment;
use crate::scene::cube::{self, FACES};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

/// How many samples see none of the directions that were baked (`environment`: as it was given to the bake).
pub fn blind(visibility: &Visibility, environment: Option<&Environment>) -> usize {
    let words = visibility.size * visibility.size / 32;
    let wanted: [Vec<u32>; FACES] = std::array::from_fn(|face| match environment {
        _ if visibility.face(face).is_empty() => Vec::new(),
        Some(environment) => bake::wanted(environment, face).unwrap_or_default(),
        None => vec![u32::MAX; words],
    });
    let (points, size) = (&visibility.samples.points, visibility.size);
    let bit = |mask: &[u32], texel: usize| mask.get(texel / 32).is_some_and(|word| word >> (texel % 32) & 1 == 1);
    // Most see what they face.
    let faces_light = |sample: usize| {
        let texel = cube::texel_at(Vec3::from(points[sample].normal), size);
        let (face, texel) = (texel / (size * size), texel % (size * size));
        let hides = |rows: &Arc<Rows>| match &rows.data {
            Data::Runs(runs) => runs.spans(sample).any(|span| span.contains(&texel)),
            Data::Haar(..) => rows.count(sample) > 0,
        };
        bit(&wanted[face], texel) && !visibility.face(face).into_iter().any(hides)
    };
    let samples = (0..points.len()).into_par_iter().with_min_len(1024);
    let nothing = |(scratch, mask): &mut (Scratch, Vec<u32>), sample: usize| {
        let mut sees = |face: usize| {
            visibility.open(sample, face, scratch, mask);
            wanted[face].iter().zip(mask.iter()).any(|(wanted, open)| wanted & open != 0)
        };
        points[sample].exists() && !faces_light(sample) && !(0..FACES).any(&mut sees)
    };
    let memory = || (Scratch::default(), vec![0; words]);
    samples.map_init(memory, nothing).filter(|nothing| *nothing).count()
}
