//! Weights that follow a selection while it changes: of a stroke that grows, only what is new is computed.

use super::bounds::Bounds;
use super::{BLOCK, Selection};
use crate::device::Array;
use crate::scene::SurfacePoint;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

/// A selection, and its weights at some points.
#[derive(Clone)]
pub struct Weighed {
    selection: Arc<Selection>,
    pub weights: Array<f32>,
}

impl Weighed {
    /// The same bits as `Selection::weights`; `before` are the weights of another selection at the same points.
    pub fn new(selection: &Arc<Selection>, points: &[SurfacePoint], before: Option<&Self>) -> Self {
        let before = before.filter(|before| before.weights.len() == points.len());
        let known = before.and_then(|before| Some((&before.weights[..], selection.apart(&before.selection)?)));
        let weights = match known {
            Some((known, apart)) => renewed(selection, points, known, &apart),
            None => selection.weights(points),
        };
        Self { selection: selection.clone(), weights: weights.into() }
    }
}

fn renewed(selection: &Selection, points: &[SurfacePoint], known: &[f32], apart: &[Bounds]) -> Vec<f32> {
    let mut weights = known.to_vec();
    let corners = apart.iter().flat_map(|bounds| [bounds.low, bounds.high]);
    let Some(all) = Bounds::of(corners) else { return weights };
    weights.par_chunks_mut(BLOCK).zip(points.par_chunks(BLOCK)).for_each(|(weights, points)| {
        let is_within = |point: &SurfacePoint| {
            let at = Vec3::from(point.position);
            all.holds(at) && point.exists() && apart.iter().any(|bounds| bounds.holds(at))
        };
        let places: Vec<usize> = (0..points.len()).filter(|i| is_within(&points[*i])).collect();
        if places.is_empty() {
            return;
        }
        let within: Vec<SurfacePoint> = places.iter().map(|i| points[*i]).collect();
        let mut new = vec![0.0; within.len()];
        selection.evaluate(&within, &mut new);
        places.iter().zip(new).for_each(|(i, weight)| weights[*i] = weight);
    });
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;
    use crate::transport::sampling::{hash, shift, triangle, unit};
    use crate::transport::selection::{Grounds, Mode, Stroke, StrokeMode};

    /// The same bits as from the ground up, whatever became of the strokes; and what differs is not everything.
    #[test]
    fn what_follows_is_what_would_be_computed() {
        let geometry = builtin::scene("room").unwrap().geometry;
        let point = |i: u32| {
            let at = triangle(shift(7 * i + 1));
            geometry.surface_point((hash(i) % geometry.corners.len() as u32) as usize, at.x, at.y, hash(!i) & 1 == 0)
        };
        let points: Vec<SurfacePoint> = (0..20_000).map(point).chain([SurfacePoint::NOWHERE]).collect();
        let stroke = |seed: u32, knots: u32| Stroke {
            points: (0..knots).map(|knot| point(hash(seed) + knot / 3).position).collect(),
            normals: Vec::new(),
            radius: 0.2 + 0.3 * unit(hash(seed + 1)),
            hardness: 0.5,
            value: if seed.is_multiple_of(3) { 1.0 } else { 0.7 },
            mode: if seed % 4 == 3 { StrokeMode::Erase } else { StrokeMode::Add },
            adaptive: false,
            attached: None,
        };
        let ground = Grounds::still(geometry.clone());
        let paint = |strokes: &[Stroke]| {
            Arc::new(Selection::painted(&ground, strokes, |_, _| unreachable!("none is adaptive")).unwrap().0)
        };
        let wall = Arc::new(Selection::by_name(&geometry, &[], &[]).unwrap());
        let other = Arc::new(Selection::by_name(&geometry, &["block".to_owned()], &[]).unwrap());
        let (mut strokes, mut last, mut least) = (Vec::new(), None::<Weighed>, usize::MAX);
        for step in 0..48u32 {
            match step % 8 {
                0 | 1 => strokes.push(stroke(step, 1)),
                7 if step % 16 == 7 => drop(strokes.remove(0)),
                _ => {
                    let number = strokes.len() as u32 - 1;
                    let knots = strokes[number as usize].points.len() as u32;
                    strokes[number as usize] = stroke(step - step % 8 + number % 2, knots + 1);
                }
            }
            let painted = paint(&strokes);
            let selection = match step / 16 {
                0 => painted,
                1 => Selection::combined(Mode::Subtract, &wall, Some(&painted)).unwrap(),
                _ => Selection::combined(Mode::Union, &other, Some(&painted)).unwrap(),
            };
            let followed = Weighed::new(&selection, &points, last.as_ref());
            assert_eq!(followed.weights[..], selection.weights(&points), "step {step}");
            if let Some(boxes) = last.as_ref().and_then(|last| selection.apart(&last.selection)) {
                let within = |point: &&SurfacePoint| boxes.iter().any(|bounds| bounds.holds(point.position.into()));
                least = least.min(points.iter().filter(within).count());
            }
            last = Some(followed);
        }
        assert!(least < points.len() / 4, "at best {least} of {} points are computed again", points.len());
    }
}
