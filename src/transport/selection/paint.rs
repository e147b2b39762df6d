//! Painted weights: brush strokes that lie on surfaces and do not get through them.
//!
//! A stroke is a chain of capsules. For a sample `x` with normal `n`, and the nearest place `c` of a capsule, with normal
//! `m` and radius `r`,
//!
//! ```text
//! s = sqrt(along² + (OFF off)²) / r      off: part of x - c along n + m (0 on planes and balls), along: the rest
//! weight = falloff(s) facing(n . m)      both smooth
//! ```
//!
//! Where something stands between `c` and `x`, `s` grows by as much as the way round it is longer; where there is no way
//! within the radius, the weight is 0. The largest weight of a stroke's capsules is the stroke's; strokes are laid over each other in order.

use super::bounds::Bounds;
use super::stroke::{self, Grounds, Laid, Stroke, StrokeMode};
use super::way::Way;
use super::{Digest, finish};
use crate::Result;
use crate::scene::{Fingerprint, Geometry, SurfacePoint};
use glam::Vec3;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub struct Painted {
    /// What stands between brush and sample.
    geometry: Arc<Geometry>,
    lines: Arc<[Line]>,
    digest: Digest,
}

/// A stroke on its surfaces.
#[derive(Clone, Debug)]
pub(super) struct Line {
    segments: Vec<Segment>,
    bounds: Bounds,
    hardness: f32,
    value: f32,
    mode: StrokeMode,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub a: Knot,
    pub b: Knot,
    bounds: Bounds,
}

/// A place of the brush.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Knot {
    pub position: Vec3,
    /// Unit.
    pub normal: Vec3,
    pub radius: f32,
    /// How far above the surface rays run that look for obstacles.
    pub raise: f32,
}

/// How many times more a distance off the surface counts than one along it.
const OFF: f32 = 4.0;
/// Cosines of the angle between normals at which paint begins to fade (30 degrees), and is gone (70).
const FACING: [f32; 2] = [0.866, 0.342];
/// Samples that are held against strokes together: neighbours miss most strokes together.
const GROUP: usize = 64;
/// Places of a stroke that a sample tries to see.
const RAYS: usize = 8;
/// Of these, the nearest to which ways round are looked for.
const DETOURS: usize = 2;
/// Once something stands before a place of the brush, places within this part of the radius are not tried.
const APART: f32 = 0.25;

impl PartialEq for Painted {
    fn eq(&self, other: &Self) -> bool {
        self.digest == other.digest
    }
}

impl Painted {
    /// Lays strokes on surfaces. `surroundings` gives the harmonic mean distances from points to the geometry, metres
    /// (`kernels::surroundings`); it is asked once for each ground that adaptive strokes lie on.
    ///
    /// Errors: numbers out of range (stroke and field are named); a stroke without a point near a surface, or that follows
    /// what is not there.
    pub(super) fn new(
        grounds: &Grounds,
        strokes: &[Stroke],
        surroundings: impl FnMut(Option<i64>, &[SurfacePoint]) -> Result<Vec<f32>>,
    ) -> Result<(Self, Laid)> {
        let (lines, laid) = stroke::lay(grounds, strokes, surroundings)?;
        let geometry = grounds.now.clone();
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"paint").update(&geometry.fingerprint);
        lines.iter().for_each(|line| line.hash(&mut hasher));
        Ok((Self { geometry, lines: lines.into(), digest: finish(&hasher) }, laid))
    }

    pub(super) fn geometry(&self) -> &Fingerprint {
        &self.geometry.fingerprint
    }

    pub(super) fn digest(&self) -> Digest {
        self.digest
    }

    pub(super) fn bytes(&self) -> u64 {
        self.lines.iter().map(|line| (size_of::<Line>() + size_of_val(&line.segments[..])) as u64).sum()
    }

    pub(super) fn evaluate(&self, points: &[SurfacePoint], weights: &mut [f32]) {
        let (mut near, mut reaches) = (Vec::new(), Vec::new());
        for (points, weights) in points.chunks(GROUP).zip(weights.chunks_mut(GROUP)) {
            let existing = points.iter().filter(|point| point.exists());
            let Some(group) = Bounds::of(existing.map(|point| Vec3::from(point.position))) else { continue };
            for line in self.lines.iter().filter(|line| line.bounds.meets(&group)) {
                near.clear();
                near.extend(line.segments.iter().filter(|segment| segment.bounds.meets(&group)));
                if near.is_empty() {
                    continue;
                }
                for (point, weight) in points.iter().zip(&mut *weights).filter(|(point, _)| point.exists()) {
                    let strength = self.strength(line, &near, point, &mut reaches) * line.value;
                    *weight = match line.mode {
                        StrokeMode::Add => *weight + strength * (1.0 - *weight),
                        StrokeMode::Erase => *weight * (1.0 - strength),
                    };
                }
            }
        }
    }

    /// Around the segments that only one of two has: at points in none of these, both find the same segments, in the same
    /// order. `None` for paint in different places.
    pub(super) fn apart(&self, other: &Self) -> Option<Vec<Bounds>> {
        if self.geometry() != other.geometry() {
            return None;
        }
        let mut apart = Vec::new();
        for number in 0..self.lines.len().max(other.lines.len()) {
            let lines = [self.lines.get(number), other.lines.get(number)];
            let [ours, theirs] = lines.map(|line| line.map_or(&[][..], |line| &line.segments[..]));
            let [a, b] = lines.map(|line| line.map(|line| (line.hardness, line.value, line.mode)));
            let is_same_brush = a == b;
            let shared = if is_same_brush { ours.iter().zip(theirs).take_while(|(a, b)| a == b).count() } else { 0 };
            apart.extend(ours[shared..].iter().chain(&theirs[shared..]).map(|segment| segment.bounds));
        }
        Some(apart)
    }

    /// The weight of one stroke: the largest of those of its segments that get to the point.
    fn strength(&self, line: &Line, near: &[&Segment], point: &SurfacePoint, reaches: &mut Vec<Reach>) -> f32 {
        reaches.clear();
        reaches.extend(near.iter().filter_map(|segment| segment.reach(line.hardness, point)));
        let mut round = 0.0f32;
        for tried in 0..RAYS {
            let order = |a: &&Reach, b: &&Reach| a.weight.total_cmp(&b.weight).then(b.distance.total_cmp(&a.distance));
            let Some(best) = reaches.iter().max_by(order).copied().filter(|best| best.weight > round) else { break };
            let way = Way::new(&self.geometry, &best.knot, point);
            if way.is_free() {
                return best.weight;
            }
            if tried < DETOURS {
                round = round.max(best.facing * falloff(best.distance * way.detour(best.distance), line.hardness));
            }
            let apart = APART * best.knot.radius;
            reaches.retain(|reach| reach.knot.position.distance(best.knot.position) > apart);
        }
        round
    }
}

impl Line {
    pub(super) fn new(segments: Vec<Segment>, hardness: f32, value: f32, mode: StrokeMode) -> Self {
        let corners = segments.iter().flat_map(|segment| [segment.bounds.low, segment.bounds.high]);
        let bounds = Bounds::of(corners).expect("a stroke has segments");
        Self { segments, bounds, hardness, value, mode }
    }

    fn hash(&self, hasher: &mut blake3::Hasher) {
        let numbers = [self.hardness, self.value, f32::from(u8::from(self.mode == StrokeMode::Erase))];
        hasher.update(bytemuck::bytes_of(&numbers)).update(&(self.segments.len() as u64).to_le_bytes());
        for knot in self.segments.iter().flat_map(|segment| [&segment.a, &segment.b]) {
            let ([x, y, z], [nx, ny, nz]) = (knot.position.to_array(), knot.normal.to_array());
            hasher.update(bytemuck::bytes_of(&[x, y, z, nx, ny, nz, knot.radius, knot.raise]));
        }
    }
}

/// What a segment would do to a sample, if nothing stands between.
#[derive(Clone, Copy)]
struct Reach {
    /// `falloff(distance) facing`.
    weight: f32,
    facing: f32,
    /// In radii.
    distance: f32,
    /// The place of the segment that is nearest to the sample.
    knot: Knot,
}

impl Segment {
    pub(super) fn new(a: Knot, b: Knot) -> Self {
        let corners = [&a, &b].into_iter().flat_map(|knot| [knot.position - knot.radius, knot.position + knot.radius]);
        Self { a, b, bounds: Bounds::of(corners).expect("two corners") }
    }

    /// `None` where the weight is 0.
    fn reach(&self, hardness: f32, point: &SurfacePoint) -> Option<Reach> {
        let at = Vec3::from(point.position);
        if !self.bounds.holds(at) {
            return None;
        }
        let axis = self.b.position - self.a.position;
        let t = (at - self.a.position).dot(axis) / axis.length_squared();
        // A dab has no axis: NaN.
        let knot = if t > 0.0 { self.a.between(&self.b, t.min(1.0)) } else { self.a };
        let normal = Vec3::from(point.normal);
        // The triangle's own normal has a say, so that the back of a thin sheet with rounded normals is out for sure.
        let cosine = normal.dot(knot.normal);
        if cosine <= FACING[1] || knot.normal.dot(point.geometric_normal.into()) <= 0.0 {
            return None;
        }
        let apart = at - knot.position;
        let off = apart.dot((normal + knot.normal).normalize());
        let along = (apart.length_squared() - off * off).max(0.0);
        let distance = (along + (OFF * off) * (OFF * off)).sqrt() / knot.radius;
        let facing = smooth((cosine - FACING[1]) / (FACING[0] - FACING[1]));
        let weight = falloff(distance, hardness) * facing;
        (weight > 0.0).then_some(Reach { weight, facing, distance, knot })
    }
}

/// 1 up to `hardness`, from there smoothly to 0 at 1.
fn falloff(distance: f32, hardness: f32) -> f32 {
    match distance {
        _ if distance <= hardness => 1.0,
        _ if distance < 1.0 => smooth((1.0 - distance) / (1.0 - hardness)),
        _ => 0.0,
    }
}

/// From 0 at 0 to 1 at 1, level at both.
fn smooth(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

impl Knot {
    /// At `t` in [0, 1] of the way to another.
    pub(super) fn between(&self, other: &Self, t: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * t;
        Self {
            position: self.position.lerp(other.position, t),
            normal: self.normal.lerp(other.normal, t).normalize_or(self.normal),
            radius: mix(self.radius, other.radius),
            raise: mix(self.raise, other.raise),
        }
    }
}
