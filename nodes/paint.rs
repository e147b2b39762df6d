//! Selects what brush strokes run over (thesis 4.4.3 to 4.4.5).

use crate::Result;
use crate::kernels::surroundings;
use crate::node::{Facet, Info, Inputs, Job, Key, Node, Port};
use crate::scene::{Geometry, SurfacePoint};
use crate::transport::Selection;
use crate::transport::selection::{Grounds, Stroke};
use crate::value::{Kind, Value};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Paint lies on surfaces: it does not get through walls, nor onto surfaces that are turned away.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Paint {
    /// Laid over each other in order; none: an empty selection. Of each: `points` on surfaces (world, m) that it runs
    /// through, `normals` there (none: the front of the nearest surface), `radius` (m; with `adaptive` a factor of the
    /// harmonic mean distance to what surrounds each point), `hardness` (0.5: the part of the radius in full), `value` (1:
    /// opacity), `mode` (add or erase), `attached` (`object`, `frame`: the stroke was painted on it then, and follows it).
    pub strokes: Vec<Stroke>,
}

/// Of each point of an adaptive stroke: in the built-in room 95 of 100 means are then within 1.2 %, half within 0.4 %.
const RAYS: u32 = 256;

impl Node for Paint {
    const INFO: Info = Info {
        name: "paint",
        category: "selection",
        summary: "Selects surfaces by brush strokes",
        inputs: &[Port::new("scene", Kind::Scene, "What is painted on").reads(&[Facet::Geometry])],
        outputs: &[Port::new("selection", Kind::Selection, "The opacity of the paint, 0 where there is none")],
        ..Info::NEW
    };

    fn frames(&self, _: &str, frame: i64) -> Vec<i64> {
        [frame].into_iter().chain(self.painted_at()).collect()
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let inputs_now = inputs;
        let at = self.painted_at().map(|frame| Ok((frame, inputs.at(frame).geometry("scene")?)));
        let grounds = Grounds { now: inputs.geometry("scene")?, at: at.collect::<Result<_>>()? };
        let around = |frame: Option<i64>, points: &[SurfacePoint]| {
            let inputs = frame.map(|frame| inputs.at(frame));
            let inputs = inputs.as_ref().unwrap_or(inputs_now);
            let place = inputs.key("scene", Facet::Geometry).expect("the scene is connected");
            remembered(job, place, &*inputs.geometry("scene")?, points)
        };
        let (selection, laid) = Selection::painted(&grounds, &self.strokes, around)?;
        laid.warnings.iter().for_each(|warning| job.warn(warning));
        job.note("strokes", self.strokes.len());
        job.note("points", laid.points);
        job.note("points_off_surfaces", laid.off);
        job.note("gaps", laid.gaps);
        Ok(vec![Value::Selection(Arc::new(selection))])
    }
}

impl Paint {
    /// Frames that attached strokes were painted at, each once.
    fn painted_at(&self) -> impl Iterator<Item = i64> {
        let frames = self.strokes.iter().filter_map(|stroke| Some(stroke.attached.as_ref()?.frame));
        frames.collect::<BTreeSet<i64>>().into_iter()
    }
}

/// Harmonic mean distances, each computed once: a stroke that grows pays for its new points alone.
fn remembered(job: &Job, place: Key, geometry: &Geometry, points: &[SurfacePoint]) -> Result<Vec<f32>> {
    let key = |point: &SurfacePoint| Key::of(&[b"surroundings", &place.0, bytemuck::bytes_of(point)]);
    let known = |point| job.memo.get(key(point)).and_then(|any| any.downcast::<f32>().ok());
    let mut distances: Vec<Option<f32>> = points.iter().map(|point| known(point).map(|known| *known)).collect();
    let new: Vec<SurfacePoint> =
        points.iter().zip(&distances).filter(|(_, known)| known.is_none()).map(|(point, _)| *point).collect();
    let mut computed = surroundings(job.device, geometry, &new, RAYS)?.into_iter();
    for (point, distance) in points.iter().zip(&mut distances).filter(|(_, distance)| distance.is_none()) {
        let value = computed.next().expect("one a point");
        job.memo.put(key(point), Arc::new(value), size_of::<f32>() as u64);
        *distance = Some(value);
    }
    job.note("surroundings_computed", new.len());
    Ok(distances.into_iter().flatten().collect())
}
