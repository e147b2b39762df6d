//! Edits of indirect light on its way to the camera (thesis Algorithm 6), at any surface point.

use super::sampled::SampledEdits;
use crate::scene::SurfacePoint;
use crate::transport::{Edit, Edits};
use glam::Vec3;
use rayon::prelude::*;

/// Changes radiance from surface points to the camera, in the order of the list.
pub fn at_eye(edits: &Edits, sampled: Option<&SampledEdits>, points: &[SurfacePoint], radiance: &mut [[f32; 4]]) {
    for edit in &edits.0 {
        match edit {
            Edit::Eye(brush) => {
                let matrix = brush.matrix();
                let weights = brush.selection.as_ref().map(|selection| selection.weights(points));
                radiance.par_iter_mut().enumerate().with_min_len(4096).for_each(|(i, light)| {
                    let weight = weights.as_ref().map_or(1.0, |weights| weights[i]);
                    if weight > 0.0 {
                        let old = Vec3::new(light[0], light[1], light[2]);
                        *light = (old + (matrix * old - old) * weight).extend(light[3]).to_array();
                    }
                });
            }
            Edit::Sampled(_) => {
                if let Some(sampled) = sampled {
                    sampled.at_eye(points, radiance);
                }
            }
            Edit::Source(_) | Edit::Transit(_) => {}
        }
    }
}
