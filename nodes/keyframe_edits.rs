//! Carries sampled edits from keyframes to the frame between them (thesis 5.3.4, 5.5.3, figure 5.5).

use crate::image::{Content, Image, Layer};
use crate::node::{Facet, Info, Inputs, Job, Key, Node, Port, When};
use crate::transport::keyframes::{self, Settings, carry};
use crate::transport::sampled::only;
use crate::transport::{Edit, Sampled};
use crate::value::{Kind, Value};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What is connected to `a` is asked for at the first of `frames`, `b` at the second, and so on: sample edits there with
/// `scale_offset`, or read what was. Between two keyframes their edits are blended; before the first and after the last,
/// theirs hold, on surfaces as they move.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct KeyframeEdits {
    /// Keyframes, one for each of the ports `a`, `b`, ... that is connected; rising.
    #[schemars(length(max = 8))]
    pub frames: Vec<i64>,
    /// How to go from one keyframe to the next: evenly, leaving and arriving at rest, or at once.
    pub interpolation: Pace,
    /// Haar coefficients of a row, at most.
    #[schemars(range(min = 1, max = 65536))]
    pub coefficients: u32,
    /// What a row may leave out, relative (root of the sum of squares).
    #[schemars(range(min = 0.0001, max = 1.0))]
    pub tolerance: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pace {
    #[default]
    Linear,
    Smooth,
    Hold,
}

impl Default for KeyframeEdits {
    fn default() -> Self {
        Self { frames: vec![1], interpolation: Pace::Linear, coefficients: 100, tolerance: 0.01 }
    }
}

const PORTS: [&str; 8] = ["a", "b", "c", "d", "e", "f", "g", "h"];

const fn key(port: usize) -> Port {
    Port::new(PORTS[port], Kind::Edits, "Sampled edits, asked for at their keyframe").optional()
}

impl Node for KeyframeEdits {
    const INFO: Info = Info {
        name: "keyframe_edits",
        category: "indirect light",
        summary: "Carries edits that were sampled at keyframes to the frames between",
        inputs: &[
            Port::new("scene", Kind::Scene, "Where surfaces are at this frame").reads(&[Facet::Geometry]),
            Port::new("transfer", Kind::Transfer, "That of this frame"),
            key(0),
            key(1),
            key(2),
            key(3),
            key(4),
            key(5),
            key(6),
            key(7),
            Port::new("edits", Kind::Edits, "Edits to come before").optional(),
        ],
        outputs: &[
            Port::new("edits", Kind::Edits, "The edits before, and those of the keyframes at this frame"),
            Port::new("filled", Kind::Image, "Where keyframes did not see what this frame sees: 0 to 1"),
        ],
        uses_frame: true,
        ..Info::NEW
    };

    fn moments(&self, when: &When) -> Result<[Key; 4]> {
        let blend: Vec<u8> = self
            .blend(when.frame)
            .iter()
            .flat_map(|(key, weight)| [&key.to_le_bytes()[..], &weight.to_le_bytes()].concat())
            .collect();
        Ok([Key::of(&[&blend]); 4])
    }

    fn frames(&self, port: &str, frame: i64) -> Vec<i64> {
        let Some(number) = PORTS.iter().position(|name| *name == port) else { return vec![frame] };
        let wanted = self.blend(frame as f64).iter().any(|(key, _)| *key == number);
        self.frames.get(number).copied().filter(|_| wanted).into_iter().collect()
    }

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        self.check(inputs)?;
        let geometry = inputs.geometry("scene")?;
        let transfer = inputs.need_transfer("transfer")?;
        transfer.samples.check(&geometry)?;
        let blend = self.blend(job.frame);
        let keys = blend.iter().map(|(number, weight)| {
            let edits = inputs.need_edits(PORTS[*number])?;
            let sampled = if edits.0.is_empty() { None } else { Some(only(edits)?) };
            Ok(keyframes::Key { frame: self.frames[*number], sampled, weight: *weight })
        });
        let keys: Vec<keyframes::Key> = keys.collect::<Result<_>>()?;
        let before = inputs.edits("edits").cloned().unwrap_or_default();
        let samples = &transfer.samples;
        let (width, height) = (samples.width, samples.height);
        let picture = |filled: Vec<f32>| {
            let layer =
                Layer::new("", &["R", "G", "B"], Content::Data, filled.into_iter().flat_map(|x| [x; 3]).collect());
            Value::Image(Arc::new(Image { width, height, layers: vec![layer], ..Image::default() }))
        };
        job.note("keyframes", keys.iter().map(|key| key.frame).collect::<Vec<_>>());
        job.note("weights", keys.iter().map(|key| key.weight).collect::<Vec<_>>());
        let nothing = || picture(vec![0.0; width * height]);
        // At a keyframe, and where nothing has moved since, its edits are what they are.
        let is_its_own = |sampled: &&Sampled| sampled.check(&geometry, transfer).is_ok();
        match &keys[..] {
            [key] if key.sampled.is_none_or(|sampled| is_its_own(&sampled)) => {
                job.note("disoccluded", 0.0);
                let edits = match key.sampled {
                    Some(sampled) => Arc::new(before.and(Edit::Sampled(Arc::new(sampled.clone())))),
                    None => before,
                };
                Ok(vec![Value::Edits(edits), nothing()])
            }
            _ => {
                let settings = Settings { coefficients: self.coefficients as usize, tolerance: self.tolerance };
                let (sampled, told) = carry(&geometry, transfer, &keys, settings)?;
                job.note("rows", told.rows);
                job.note("disoccluded", told.disoccluded);
                if !told.of_other_samples.is_empty() {
                    job.note("keyframes_of_other_gather_samples", told.of_other_samples);
                }
                for (frame, unseen, nothing) in told.keys {
                    job.note(&format!("not_seen_at_{frame}"), unseen);
                    job.note(&format!("objects_not_seen_at_{frame}"), nothing);
                }
                let filled = picture(samples.resolve(|v| told.filled[v]));
                Ok(vec![Value::Edits(Arc::new(before.and(Edit::Sampled(Arc::new(sampled))))), filled])
            }
        }
    }
}

impl KeyframeEdits {
    /// One or two of the keyframes, and what each counts.
    fn blend(&self, frame: f64) -> Vec<(usize, f32)> {
        let after = self.frames.partition_point(|key| *key as f64 <= frame);
        let Some(before) = after.checked_sub(1) else { return vec![(0, 1.0)] };
        let (Some(next), key) = (self.frames.get(after), self.frames[before]) else { return vec![(before, 1.0)] };
        let way = ((frame - key as f64) / (*next as f64 - key as f64)) as f32;
        let way = match self.interpolation {
            Pace::Linear => way,
            Pace::Smooth => way * way * (3.0 - 2.0 * way),
            Pace::Hold => 0.0,
        };
        if way == 0.0 { vec![(before, 1.0)] } else { vec![(before, 1.0 - way), (after, way)] }
    }

    fn check(&self, inputs: &Inputs) -> Result<()> {
        let connected: Vec<&str> = PORTS.into_iter().filter(|port| inputs.is_connected(port)).collect();
        let count = self.frames.len();
        if count == 0 || connected != PORTS[..count] {
            let ports = if connected.is_empty() { "nothing".to_owned() } else { connected.join(", ") };
            let message = format!("frames names {count} keyframes, connected are: {ports}");
            return Err(Error::compute(message, "connect a, b, ... in order, one for each keyframe"));
        }
        match self.frames.windows(2).find(|pair| pair[0] >= pair[1]) {
            Some([first, second]) => {
                let message = format!("keyframe {second} follows {first}");
                Err(Error::compute(message, "name keyframes in rising order, and connect their edits in that order"))
            }
            _ => Ok(()),
        }
    }
}
