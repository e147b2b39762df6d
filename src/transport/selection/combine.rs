//! Selections put together, by the operations of fuzzy sets (Zadeh 1965): a union with itself is itself.
//!
//! Kept as a list of steps without repeats instead of a tree, so that a selection that is used a thousand times over is
//! evaluated once.

use super::bounds::Bounds;
use super::{Digest, Selection, finish};
use crate::scene::{Fingerprint, SurfacePoint};
use crate::{Error, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How weights `a` and `b` become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// In either: `max(a, b)`.
    #[default]
    Union,
    /// In both: `min(a, b)`.
    Intersect,
    /// In `a` and not in `b`: `min(a, 1 - b)`.
    Subtract,
    /// Not in `a`: `1 - a`.
    Invert,
}

impl Mode {
    fn name(self) -> &'static str {
        match self {
            Self::Union => "union",
            Self::Intersect => "intersect",
            Self::Subtract => "subtract",
            Self::Invert => "invert",
        }
    }

    fn apply(self, a: f32, b: f32) -> f32 {
        match self {
            Self::Union => a.max(b),
            Self::Intersect => a.min(b),
            Self::Subtract => a.min(1.0 - b),
            Self::Invert => 1.0 - a,
        }
    }
}

/// Steps, each after those that it reads; the last one is the result.
#[derive(Clone, Debug, PartialEq)]
pub struct Combined {
    steps: Vec<(Digest, Step)>,
}

#[derive(Clone, Debug, PartialEq)]
enum Step {
    /// Names, paint or a matte.
    Field(Arc<Selection>),
    /// Of earlier steps; `Invert` reads the first alone.
    Of(Mode, usize, usize),
}

pub(super) fn combined(mode: Mode, a: &Arc<Selection>, b: Option<&Arc<Selection>>) -> Result<Arc<Selection>> {
    match (mode, b) {
        (Mode::Invert, None) | (Mode::Union | Mode::Intersect | Mode::Subtract, Some(_)) => {}
        (Mode::Invert, Some(_)) => {
            let help = "take b off, or set mode to subtract for what is in a and not in b";
            return Err(Error::compute("mode invert turns a alone round, but b is connected", help));
        }
        (_, None) => {
            let message = format!("mode {} needs two selections, but b is not connected", mode.name());
            return Err(Error::compute(message, "connect b, or set mode to invert"));
        }
    }
    if b.is_some_and(|b| b.geometry() != a.geometry()) {
        let message = "a and b were selected in different scenes, or in different states of one";
        return Err(Error::compute(message, "connect the same scene to all nodes that make selections"));
    }
    let mut steps = Combined { steps: Vec::new() };
    let a_step = steps.append(a);
    if let (Mode::Invert, Step::Of(Mode::Invert, twice, _)) = (mode, &steps.steps[a_step].1) {
        // Inverted back by taking the step off: 1 - (1 - w) would round.
        let twice = *twice;
        return Ok(steps.upto(twice));
    }
    let b_step = b.map_or(a_step, |b| steps.append(b));
    let last = steps.push(Step::Of(mode, a_step, b_step));
    Ok(steps.upto(last))
}

impl Combined {
    /// All steps of a selection; gives the number of its last one.
    fn append(&mut self, selection: &Arc<Selection>) -> usize {
        let Selection::Combined(other) = &**selection else { return self.push(Step::Field(selection.clone())) };
        let mut numbers: Vec<usize> = Vec::with_capacity(other.steps.len());
        for (_, step) in &other.steps {
            numbers.push(self.push(match step {
                Step::Field(field) => Step::Field(field.clone()),
                Step::Of(mode, a, b) => Step::Of(*mode, numbers[*a], numbers[*b]),
            }));
        }
        numbers.pop().expect("a combination has steps")
    }

    /// The number of a step, new if need be.
    fn push(&mut self, step: Step) -> usize {
        let digest = match &step {
            Step::Field(field) => field.digest(),
            Step::Of(mode, a, b) => {
                let mut of = [self.steps[*a].0, self.steps[*b].0];
                if *mode != Mode::Subtract {
                    of.sort();
                }
                let mut hasher = blake3::Hasher::new();
                hasher.update(mode.name().as_bytes()).update(of.as_flattened());
                finish(&hasher)
            }
        };
        self.steps.iter().position(|(known, _)| *known == digest).unwrap_or_else(|| {
            self.steps.push((digest, step));
            self.steps.len() - 1
        })
    }

    /// The selection that a step gives, with the steps before it.
    fn upto(mut self, step: usize) -> Arc<Selection> {
        self.steps.truncate(step + 1);
        match &self.steps[step].1 {
            Step::Field(field) => field.clone(),
            Step::Of(..) => Arc::new(Selection::Combined(self)),
        }
    }

    pub(super) fn geometry(&self) -> &Fingerprint {
        self.fields().next().expect("a combination is of something").geometry()
    }

    fn fields(&self) -> impl Iterator<Item = &Arc<Selection>> {
        self.steps.iter().filter_map(|(_, step)| if let Step::Field(field) = step { Some(field) } else { None })
    }

    pub(super) fn evaluate(&self, points: &[SurfacePoint], weights: &mut [f32]) {
        let count = points.len();
        let mut values = vec![0.0; self.steps.len() * count];
        for (number, (_, step)) in self.steps.iter().enumerate() {
            let (before, now) = values.split_at_mut(number * count);
            match step {
                Step::Field(field) => field.evaluate(points, &mut now[..count]),
                Step::Of(mode, a, b) => {
                    let (a, b) = (&before[a * count..][..count], &before[b * count..][..count]);
                    for ((now, a), b) in now.iter_mut().zip(a).zip(b) {
                        *now = mode.apply(*a, *b);
                    }
                }
            }
        }
        let last = &values[values.len() - count..];
        for ((weight, last), point) in weights.iter_mut().zip(last).zip(points) {
            // What is not there is in nothing, inverted or not.
            *weight = if point.exists() { *last } else { 0.0 };
        }
    }

    /// Where fields differ; `None` when they are not put together alike.
    pub(super) fn apart(&self, other: &Self) -> Option<Vec<Bounds>> {
        if self.steps.len() != other.steps.len() {
            return None;
        }
        let mut apart = Vec::new();
        for ((_, ours), (_, theirs)) in self.steps.iter().zip(&other.steps) {
            match (ours, theirs) {
                (Step::Field(a), Step::Field(b)) => apart.extend(a.apart(b)?),
                (ours, theirs) if ours == theirs => {}
                _ => return None,
            }
        }
        Some(apart)
    }

    pub(super) fn digest(&self) -> Digest {
        self.steps.last().expect("a combination has steps").0
    }

    pub(super) fn bytes(&self) -> u64 {
        let fields: u64 = self.fields().map(|field| field.bytes()).sum();
        fields + size_of_val(&self.steps[..]) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_by_hand() {
        let all = [Mode::Union, Mode::Intersect, Mode::Subtract, Mode::Invert];
        assert_eq!(all.map(|mode| mode.apply(0.75, 0.5)), [0.75, 0.5, 0.5, 0.25]);
        assert_eq!(all.map(|mode| mode.apply(0.25, 1.0)), [1.0, 0.25, 0.0, 0.75]);
        assert_eq!(all.map(|mode| mode.apply(0.25, 0.0)), [0.25, 0.0, 0.25, 0.75]);
    }
}
