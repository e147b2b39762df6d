//! One animated property of a node: keys over time, and how to go from one to the next (glTF 2.0, appendix C).

use glam::{Quat, Vec4};
use gltf::animation::Interpolation;
use gltf::animation::util::ReadOutputs;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Property {
    Translation,
    /// Unit quaternions, x y z w.
    Rotation,
    Scale,
    /// Of morph targets.
    Weights,
}

#[derive(Clone, Debug)]
pub(super) struct Track {
    pub node: usize,
    pub property: Property,
    /// Seconds; they rise strictly.
    times: Vec<f32>,
    /// `width` numbers a key; with cubic splines three times as many: the tangent that comes in, the value, the tangent that
    /// goes out.
    values: Vec<f32>,
    width: usize,
    interpolation: Interpolation,
}

impl Track {
    /// `targets`: morph targets of the node's mesh.
    ///
    /// Errors: what is wrong with it.
    pub fn read(
        channel: &gltf::animation::Channel,
        buffers: &[gltf::buffer::Data],
        targets: usize,
    ) -> Result<Self, String> {
        let reader = channel.reader(|buffer| buffers.get(buffer.index()).map(|data| &data[..]));
        let times: Vec<f32> = reader.read_inputs().into_iter().flatten().collect();
        let flat3 = |values: &mut dyn Iterator<Item = [f32; 3]>| values.flatten().collect::<Vec<f32>>();
        let (property, width, values) = match reader.read_outputs() {
            Some(ReadOutputs::Translations(mut values)) => (Property::Translation, 3, flat3(&mut values)),
            Some(ReadOutputs::Scales(mut values)) => (Property::Scale, 3, flat3(&mut values)),
            Some(ReadOutputs::Rotations(values)) => (Property::Rotation, 4, values.into_f32().flatten().collect()),
            Some(ReadOutputs::MorphTargetWeights(values)) => (Property::Weights, targets, values.into_f32().collect()),
            None => return Err("has no values".to_owned()),
        };
        let interpolation = channel.sampler().interpolation();
        let node = channel.target().node().index();
        Self { node, property, times, values, width, interpolation }.checked()
    }

    fn checked(self) -> Result<Self, String> {
        let parts = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        if self.times.is_empty() || self.width == 0 {
            return Err("moves nothing".to_owned());
        }
        if let Some(at) = self.times.windows(2).position(|pair| pair[0].is_nan() || pair[0] >= pair[1]) {
            return Err(format!("has key {} at {} s, after one at {} s", at + 1, self.times[at + 1], self.times[at]));
        }
        let (found, expected) = (self.values.len(), self.times.len() * self.width * parts);
        if found != expected {
            return Err(format!("has {found} numbers for {} keys, expected {expected}", self.times.len()));
        }
        if self.times.iter().chain(&self.values).any(|number| !number.is_finite()) {
            return Err("has a time or a value that is not finite".to_owned());
        }
        let no_turn = |key: &usize| self.value(*key).iter().all(|x| x.abs() < 1e-6);
        match (0..self.times.len()).find(no_turn).filter(|_| self.property == Property::Rotation) {
            Some(key) => Err(format!("has no direction at key {key}")),
            None => Ok(self),
        }
    }

    /// First and last key, seconds.
    pub fn span(&self) -> (f32, f32) {
        (self.times[0], *self.times.last().expect("checked"))
    }

    fn key(&self, index: usize, part: usize) -> &[f32] {
        match self.interpolation {
            Interpolation::CubicSpline => &self.values[(3 * index + part) * self.width..][..self.width],
            _ => &self.values[index * self.width..][..self.width],
        }
    }

    fn value(&self, index: usize) -> &[f32] {
        self.key(index, 1)
    }

    /// The value at a time; before the first key and after the last, theirs. At a key it is the key's, exactly.
    pub fn at(&self, time: f32) -> Vec<f32> {
        let after = self.times.partition_point(|key| *key <= time);
        let Some(before) = after.checked_sub(1) else { return self.value(0).to_vec() };
        if after == self.times.len() || self.times[before] == time {
            return self.value(before).to_vec();
        }
        let length = self.times[after] - self.times[before];
        let t = (time - self.times[before]) / length;
        let (a, b) = (self.value(before), self.value(after));
        match self.interpolation {
            Interpolation::Step => a.to_vec(),
            Interpolation::Linear if self.property == Property::Rotation => {
                let turn = |q: &[f32]| Quat::from_slice(q).normalize();
                turn(a).slerp(turn(b), t).to_array().to_vec()
            }
            Interpolation::Linear => a.iter().zip(b).map(|(a, b)| a * (1.0 - t) + b * t).collect(),
            Interpolation::CubicSpline => {
                let (leaves, arrives) = (self.key(before, 2), self.key(after, 0));
                let (t2, t3) = (t * t, t * t * t);
                let basis = Vec4::new(
                    2.0 * t3 - 3.0 * t2 + 1.0,
                    length * (t3 - 2.0 * t2 + t),
                    3.0 * t2 - 2.0 * t3,
                    length * (t3 - t2),
                );
                let mix = |i: usize| basis.dot(Vec4::new(a[i], leaves[i], b[i], arrives[i]));
                (0..self.width).map(mix).collect()
            }
        }
    }

    pub fn bytes(&self) -> u64 {
        4 * (self.times.len() + self.values.len()) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(property: Property, interpolation: Interpolation, times: &[f32], values: &[f32]) -> Result<Track, String> {
        let width = if property == Property::Rotation { 4 } else { 1 };
        let (times, values) = (times.to_vec(), values.to_vec());
        Track { node: 0, property, times, values, width, interpolation }.checked()
    }

    #[test]
    fn all_ways_from_key_to_key_by_hand() {
        let at = |interpolation, values: &[f32], time: f32| {
            track(Property::Weights, interpolation, &[1.0, 3.0], values).unwrap().at(time)[0]
        };
        for time in [-1.0, 1.0, 1.5, 3.0, 9.0] {
            let t = ((time - 1.0) / 2.0f32).clamp(0.0, 1.0);
            assert_eq!(at(Interpolation::Linear, &[2.0, 6.0], time), 2.0 + 4.0 * t);
            assert_eq!(at(Interpolation::Step, &[2.0, 6.0], time), if time < 3.0 { 2.0 } else { 6.0 });
            // Tangents of the straight line (2 a second) give the straight line, others the cubic of Hermite.
            let line = at(Interpolation::CubicSpline, &[9.0, 2.0, 2.0, 2.0, 6.0, 9.0], time);
            assert!((line - (2.0 + 4.0 * t)).abs() < 1e-6);
            let flat = at(Interpolation::CubicSpline, &[9.0, 2.0, 0.0, 0.0, 6.0, 9.0], time);
            assert!((flat - (2.0 + 4.0 * t * t * (3.0 - 2.0 * t))).abs() < 1e-6);
        }
    }

    #[test]
    fn turns_take_the_short_way_at_an_even_pace() {
        let (a, b) = (Quat::from_rotation_y(0.2), Quat::from_rotation_y(1.4));
        for sign in [1.0, -1.0] {
            let values = [a.to_array(), (b * sign).to_array()].concat();
            let track = track(Property::Rotation, Interpolation::Linear, &[0.0, 1.0], &values).unwrap();
            for t in [0.0, 0.25, 0.5, 0.9] {
                let found = Quat::from_slice(&track.at(t));
                assert!(found.angle_between(Quat::from_rotation_y(0.2 + 1.2 * t)) < 1e-3, "{t}");
            }
        }
    }

    #[test]
    fn what_makes_no_sense_is_said() {
        let fault =
            |times: &[f32], values: &[f32]| track(Property::Weights, Interpolation::Linear, times, values).unwrap_err();
        assert!(fault(&[0.0, 0.0], &[1.0, 2.0]).contains("key 1 at 0 s, after one at 0 s"));
        assert!(fault(&[0.0, 1.0], &[1.0]).contains("1 numbers for 2 keys, expected 2"));
        assert!(fault(&[0.0, 1.0], &[1.0, f32::NAN]).contains("not finite"));
        assert!(fault(&[], &[]).contains("nothing"));
        let turns = [[0.0, 0.0, 0.0, 1.0], [0.0; 4]].concat();
        let fault = track(Property::Rotation, Interpolation::Linear, &[0.0, 1.0], &turns).unwrap_err();
        assert!(fault.contains("no direction at key 1"), "{fault}");
    }
}
