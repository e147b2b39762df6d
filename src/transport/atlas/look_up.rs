//! Values at the texels of an atlas, where a camera sees them: a free camera for shadows baked once (thesis 6.4).

use crate::scene::geometry::NONE;
use crate::transport::Samples;
use crate::{Error, Result};
use glam::Vec4;
use rayon::prelude::*;

/// What `look_up` gives.
pub struct LookedUp {
    /// One element a sample of the view.
    pub values: Vec<[f32; 4]>,
    /// Samples on surfaces that no texel near has.
    pub missed: usize,
}

/// Bilinear between the texels around each sample, of those on the same object; the nearest one within two texels where
/// none of the four is. `values`: one element a texel. Samples that see no surface get 0.
///
/// # Errors
/// `texels` are no texel samples, or of another geometry than `view`.
pub fn look_up(texels: &Samples, values: &[[f32; 4]], view: &Samples) -> Result<LookedUp> {
    let Some(atlas) = &texels.atlas else {
        let message = "these samples are of a view, not of an atlas";
        return Err(Error::compute(message, "connect the output of texel_samples"));
    };
    if texels.geometry != view.geometry {
        let message = "the atlas and the view were made for different scenes, or different states of one";
        return Err(Error::compute(message, "connect the same scene to texel_samples and view_samples"));
    }
    if values.len() != texels.points.len() {
        let message = format!("a picture of {} pixels for an atlas of {} texels", values.len(), texels.points.len());
        return Err(Error::compute(message, "connect the picture that was made with these texel samples"));
    }
    let size = atlas.size;
    let at = |x: i64, y: i64, object: u32| -> Option<Vec4> {
        let inside = (0..size as i64).contains(&x) && (0..size as i64).contains(&y);
        let texel = inside.then(|| y as usize * size + x as usize)?;
        (texels.points[texel].object == object).then(|| Vec4::from_array(values[texel]))
    };
    let one = |(point, barycentrics): (&crate::scene::SurfacePoint, &[f32; 2])| -> Option<[f32; 4]> {
        if point.object == NONE {
            return Some([0.0; 4]);
        }
        let [x, y] = atlas.place(point.triangle as usize, *barycentrics).map(|x| x - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (right_share, low_share) = (x - left, y - top);
        let (mut sum, mut total) = (Vec4::ZERO, 0.0);
        for (i, j, weight) in [
            (0, 0, (1.0 - right_share) * (1.0 - low_share)),
            (1, 0, right_share * (1.0 - low_share)),
            (0, 1, (1.0 - right_share) * low_share),
            (1, 1, right_share * low_share),
        ] {
            if let Some(value) = at(left as i64 + i, top as i64 + j, point.object) {
                sum += value * weight;
                total += weight;
            }
        }
        if total > 1e-3 {
            return Some((sum / total).to_array());
        }
        nearest(x, y, |i, j| at(i, j, point.object)).map(|value| value.to_array())
    };
    let found: Vec<Option<[f32; 4]>> =
        view.points.par_iter().zip(&view.barycentrics[..]).with_min_len(4096).map(one).collect();
    let missed = found.iter().filter(|value| value.is_none()).count();
    Ok(LookedUp { values: found.into_iter().map(Option::unwrap_or_default).collect(), missed })
}

fn nearest(x: f32, y: f32, at: impl Fn(i64, i64) -> Option<Vec4>) -> Option<Vec4> {
    let (column, row) = (x.round() as i64, y.round() as i64);
    let around = (-2..=2).flat_map(|j| (-2..=2).map(move |i| (column + i, row + j)));
    let distance = |&(i, j): &(i64, i64)| (i as f32 - x).powi(2) + (j as f32 - y).powi(2);
    around
        .filter_map(|place| at(place.0, place.1).map(|value| (distance(&place), value)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, value)| value)
}
