//! Brush strokes as a recipe holds them, and how they are laid on the surfaces of a scene.

use super::paint::{Knot, Line, Segment};
use crate::names::suggest;
use crate::scene::bvh::Ray;
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::nearest::{Nearest, nearest_among};
use crate::transport::sampling;
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// One stroke of a brush: it runs without a gap from point to point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// On surfaces, in world space, metres. Each is moved to the nearest surface; one that lies farther off than half the
    /// radius is left out.
    #[schemars(length(min = 1))]
    pub points: Vec<[f32; 3]>,
    /// Of the surface at each point, of any length but 0; they say which side is painted, and which of two surfaces near
    /// a corner. Empty: those of the nearest surface's front.
    #[serde(default)]
    pub normals: Vec<[f32; 3]>,
    /// Metres; with `adaptive`, a factor of the harmonic mean distance to what surrounds each point.
    #[schemars(extend("exclusiveMinimum" = 0.0, "unit" = "m"))]
    pub radius: f32,
    /// The part of the radius that is painted in full, [0, 1]; from there the weight falls smoothly to 0 at the radius.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub hardness: f32,
    /// Opacity, [0, 1].
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub value: f32,
    /// What becomes of what strokes before this one painted.
    #[serde(default)]
    pub mode: StrokeMode,
    /// Sizes the brush by its surroundings: large in open space, small in corners, where indirect light changes quickly
    /// (thesis 4.4.5).
    #[serde(default)]
    pub adaptive: bool,
    /// The stroke was painted on this object, and goes where it goes. Without: it stays in its place in the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attached: Option<Attached>,
}

/// What a stroke follows.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Attached {
    /// Name of the object; the stroke lies on no other.
    pub object: String,
    /// The frame at which the stroke's points lie on it.
    pub frame: i64,
}

fn half() -> f32 {
    0.5
}

fn one() -> f32 {
    1.0
}

/// With `s` the stroke's own weight times its value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StrokeMode {
    /// `w + s (1 - w)`.
    #[default]
    Add,
    /// `w (1 - s)`.
    Erase,
}

/// What strokes are laid on: surfaces as they are, and as they were when attached strokes were painted.
pub struct Grounds {
    pub now: Arc<Geometry>,
    /// By the frame of `Attached`.
    pub at: Vec<(i64, Arc<Geometry>)>,
}

impl Grounds {
    /// For strokes that follow nothing.
    pub fn still(now: Arc<Geometry>) -> Self {
        Self { now, at: Vec::new() }
    }

    fn of(&self, stroke: &Stroke) -> (Option<i64>, &Arc<Geometry>) {
        let Some(Attached { frame, .. }) = stroke.attached else { return (None, &self.now) };
        let found = self.at.iter().find(|(at, _)| *at == frame);
        (Some(frame), found.map_or(&self.now, |(_, geometry)| geometry))
    }
}

/// How strokes met the surfaces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Laid {
    pub points: usize,
    /// Points too far from any surface, which are left out.
    pub off: usize,
    /// Stretches between points that lie on no surface, which are not painted.
    pub gaps: usize,
    /// Both in words, by stroke.
    pub warnings: Vec<String>,
}

/// A point or a stretch farther from all surfaces than this part of the radius is off.
const OFF: f32 = 0.5;
/// Stretches are laid on surfaces in steps of this part of the radius.
const STEP: f32 = 0.25;
const MOST_STEPS: f32 = 256.0;
/// Cosine of the turn from one knot to the next beyond which a chord would run through the edge between.
const BEND: f32 = 0.7;
/// The rays that look for obstacles run above the surface by this part of the radius, unless that is much in the scene.
const RAISE: f32 = 0.05;

/// `surroundings` gives the harmonic mean distances of points, metres; it is asked once for each of the grounds that
/// adaptive strokes lie on (`Attached::frame`, or `None`).
///
/// Errors: numbers out of range; a stroke without a point near a surface, or that follows what is not there.
pub(super) fn lay(
    grounds: &Grounds,
    strokes: &[Stroke],
    mut surroundings: impl FnMut(Option<i64>, &[SurfacePoint]) -> Result<Vec<f32>>,
) -> Result<(Vec<Line>, Laid)> {
    let mut objects = Vec::with_capacity(strokes.len());
    for (number, stroke) in strokes.iter().enumerate() {
        if let Some((field, fault)) = stroke.fault() {
            let message = format!("strokes[{number}].{field} {fault}");
            return Err(Error::compute(message, "correct the stroke, or take it out"));
        }
        objects.push(object(number, stroke, &grounds.now)?);
    }
    let points = strokes.iter().zip(&objects).flat_map(|(s, object)| (0..s.points.len()).map(move |i| (s, *object, i)));
    let points: Vec<(&Stroke, Option<u32>, usize)> = points.collect();
    let near = |(stroke, object, i): &(&Stroke, Option<u32>, usize)| {
        nearest_among(grounds.of(stroke).1, stroke.points[*i].into(), stroke.normal(*i), *object)
    };
    let found: Vec<Option<Nearest>> = points.par_iter().map(near).collect();
    let mut adaptive: BTreeMap<Option<i64>, Vec<SurfacePoint>> = BTreeMap::new();
    for ((stroke, ..), found) in points.iter().zip(&found).filter(|((stroke, ..), _)| stroke.adaptive) {
        adaptive.entry(grounds.of(stroke).0).or_default().extend(found.as_ref().map(|found| found.point));
    }
    let mut distances = BTreeMap::new();
    for (ground, points) in adaptive {
        distances.insert(ground, surroundings(ground, &points)?.into_iter());
    }

    let (mut lines, mut laid) = (Vec::new(), Laid::default());
    let mut found = found.into_iter();
    for ((number, stroke), object) in strokes.iter().enumerate().zip(objects) {
        let (ground, geometry) = grounds.of(stroke);
        let geometry: &Geometry = geometry;
        let mut distances = distances.get_mut(&ground).filter(|_| stroke.adaptive);
        let found: Vec<Option<Nearest>> = found.by_ref().take(stroke.points.len()).collect();
        let Some(found) = found.into_iter().collect::<Option<Vec<Nearest>>>() else {
            let name = stroke.attached.as_ref().map_or("", |attached| &attached.object);
            let message = format!("strokes[{number}] follows \"{name}\", which has no surface at its frame");
            return Err(Error::compute(message, "name the frame at which it was painted"));
        };
        let knots: Vec<(Knot, f32)> = (0..)
            .zip(found)
            .map(|(i, Nearest { point, distance, .. })| {
                let around = distances.as_mut().map(|distances| distances.next().expect("one a point"));
                let size = around.map_or(1.0, |around| limited(geometry, around));
                let normal = stroke.normal(i).unwrap_or(point.normal.into());
                (knot(geometry, &point, normal, stroke.radius * size), distance)
            })
            .collect();
        let on = |(knot, distance): &(Knot, f32)| *distance <= OFF * knot.radius;
        let off = knots.iter().filter(|knot| !on(knot)).count();
        if off == knots.len() {
            return Err(nowhere(number, &knots));
        }
        let runs = knots.split(|knot| !on(knot)).filter(|run| !run.is_empty());
        let parts: Vec<Vec<Vec<Knot>>> = runs.map(|run| trace(geometry, object, run)).collect();
        let gaps = parts.iter().map(|parts| parts.len() - 1).sum::<usize>();
        let mut segments: Vec<Segment> = parts.iter().flatten().flat_map(|part| segments(part)).collect();
        if geometry.fingerprint != grounds.now.fingerprint {
            let (then, now) = (geometry.corners.len(), grounds.now.corners.len());
            if then != now {
                let message =
                    format!("strokes[{number}] was painted on a scene of {then} triangles, now there are {now}");
                return Err(Error::compute(message, "attach strokes only where a file's own animation moves things"));
            }
            let go = |knot: &Knot| carried(knot, geometry, &grounds.now, object);
            segments = segments.iter().map(|segment| Segment::new(go(&segment.a), go(&segment.b))).collect();
        }
        if off > 0 {
            laid.warnings.push(format!(
                "strokes[{number}]: {off} of {} points are left out: they lie farther from any surface than half the radius",
                knots.len()
            ));
        }
        if gaps > 0 {
            laid.warnings.push(format!("strokes[{number}] leaves the surface between points {gaps} times"));
        }
        laid.points += knots.len();
        laid.off += off;
        laid.gaps += gaps;
        lines.push(Line::new(segments, stroke.hardness, stroke.value, stroke.mode));
    }
    Ok((lines, laid))
}

/// The object that a stroke lies on, if it is attached.
fn object(number: usize, stroke: &Stroke, geometry: &Geometry) -> Result<Option<u32>> {
    let Some(Attached { object, .. }) = &stroke.attached else { return Ok(None) };
    let found = geometry.objects.iter().position(|name| name == object);
    found.map(|object| Some(object as u32)).ok_or_else(|| {
        let message = format!("strokes[{number}] follows \"{object}\", which is not in the scene");
        Error::compute(message, suggest(object, geometry.objects.iter().map(String::as_str)))
    })
}

/// A knot where the surface that it lies on is now.
fn carried(knot: &Knot, then: &Geometry, now: &Geometry, object: Option<u32>) -> Knot {
    let found = nearest_among(then, knot.position, Some(knot.normal), object).expect("it lies on the object");
    let triangle = found.point.triangle as usize;
    if then.corners[triangle] == now.corners[triangle] {
        return *knot;
    }
    let front = then.area_vector(triangle).dot(found.point.geometric_normal.into()) >= 0.0;
    let [u, v] = found.barycentrics;
    let point = now.surface_point(triangle, u, v, front);
    Knot { position: point.position.into(), normal: point.normal.into(), ..*knot }
}

/// Nothing around, or a surface that is touched, must not make a brush without bounds or without size.
fn limited(geometry: &Geometry, distance: f32) -> f32 {
    let (low, high) = geometry.bounds();
    distance.clamp(geometry.lift(), low.distance(high))
}

fn nowhere(number: usize, knots: &[(Knot, f32)]) -> Error {
    let nearest = |a: &&(Knot, f32), b: &&(Knot, f32)| (a.1 / a.0.radius).total_cmp(&(b.1 / b.0.radius));
    let (knot, distance) = knots.iter().min_by(nearest).expect("a stroke has points");
    Error::compute(
        format!(
            "strokes[{number}] touches no surface: its nearest point is {distance:.3} m away from one, and half the radius \
             is {:.3} m",
            OFF * knot.radius
        ),
        "paint on the scene as it is at this frame, raise the radius, or take the stroke out",
    )
}

impl Stroke {
    /// Unit normal of a point, if normals are given.
    fn normal(&self, point: usize) -> Option<Vec3> {
        self.normals.get(point).map(|normal| Vec3::from(*normal).normalize())
    }

    /// Field, and what is wrong with it.
    fn fault(&self) -> Option<(String, String)> {
        let finite = |p: &[f32; 3]| p.iter().all(|x| x.is_finite());
        let unit = |x: f32| (0.0..=1.0).contains(&x);
        let fault = |field: &str, fault: String| Some((field.to_owned(), fault));
        if self.points.is_empty() {
            return fault("points", "is empty; a stroke needs at least one point".into());
        }
        if let Some(at) = self.points.iter().position(|p| !finite(p)) {
            return fault(&format!("points[{at}]"), format!("is {:?}, expected finite numbers", self.points[at]));
        }
        if !self.normals.is_empty() && self.normals.len() != self.points.len() {
            return fault("normals", format!("has {} for {} points", self.normals.len(), self.points.len()));
        }
        if let Some(at) = self.normals.iter().position(|n| Vec3::from(*n).try_normalize().is_none()) {
            return fault(&format!("normals[{at}]"), format!("is {:?}, which is no direction", self.normals[at]));
        }
        if !(self.radius > 0.0 && self.radius.is_finite()) {
            return fault("radius", format!("is {}, expected a number above 0", self.radius));
        }
        if !unit(self.hardness) {
            return fault("hardness", format!("is {}, expected 0 to 1", self.hardness));
        }
        if !unit(self.value) {
            return fault("value", format!("is {}, expected 0 to 1", self.value));
        }
        None
    }
}

fn knot(geometry: &Geometry, point: &SurfacePoint, normal: Vec3, radius: f32) -> Knot {
    // A factor times a distance may overflow.
    let radius = radius.clamp(f32::MIN_POSITIVE, f32::MAX);
    let position = Vec3::from(point.position);
    let origin = sampling::lifted(position, point.geometric_normal.into(), geometry.lift());
    let headroom =
        geometry.bvh.closest(&Ray { origin, direction: point.geometric_normal.into(), t_max: f32::INFINITY }).t;
    let raise = (RAISE * radius).min(0.25 * headroom).min(1e4 * geometry.lift());
    Knot { position, normal, radius, raise }
}

/// The knots of one run of points, with those between that lay its chords on the surfaces below; in parts where a chord
/// leaves them.
fn trace(geometry: &Geometry, object: Option<u32>, run: &[(Knot, f32)]) -> Vec<Vec<Knot>> {
    let mut parts = vec![vec![run[0].0]];
    for pair in run.windows(2) {
        let (a, b) = (pair[0].0, pair[1].0);
        let steps = (a.position.distance(b.position) / (STEP * a.radius.min(b.radius))).ceil().clamp(1.0, MOST_STEPS);
        for step in 1..steps as usize {
            let between = a.between(&b, step as f32 / steps);
            let found = nearest_among(geometry, between.position, Some(between.normal), object);
            let Nearest { point, distance, .. } = found.expect("its ends lie on it");
            if distance <= OFF * between.radius {
                let next = knot(geometry, &point, point.normal.into(), between.radius);
                parts.last_mut().expect("at least one").push(next);
            } else if parts.last().is_some_and(|part| !part.is_empty()) {
                parts.push(Vec::new());
            }
        }
        parts.last_mut().expect("at least one").push(b);
    }
    parts
}

/// Joins neighbours on one surface; a knot that has none is a dab.
fn segments(knots: &[Knot]) -> impl Iterator<Item = Segment> {
    let joined = |i: usize| knots.get(i + 1).is_some_and(|next| next.normal.dot(knots[i].normal) > BEND);
    (0..knots.len()).filter_map(move |i| match joined(i) {
        true => Some(Segment::new(knots[i], knots[i + 1])),
        false if i > 0 && joined(i - 1) => None,
        false => Some(Segment::new(knots[i], knots[i])),
    })
}
