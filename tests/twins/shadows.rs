//! Twins of the kernels that edit shadows.

use super::*;
use chiaro::kernels::shadow_filter::{Filter, Slot, Tap, shadow_filter};
use chiaro::kernels::shadow_light::{Beam, shadow_light};

/// One number an element, so that the common comparer serves.
fn spread(numbers: Vec<f32>) -> Vec<[f32; 4]> {
    numbers.into_iter().map(|x| [x, 0.0, 0.0, 0.0]).collect()
}

pub fn filters(devices: &Devices) -> Outcome {
    let mut random = Random(11);
    for (rows, inputs, outputs) in [(1, 1, 1), (3, 7, 5), (70, 33, 65), (5, 2, 300)] {
        let mut taps = Vec::new();
        let mut offsets = vec![0];
        for t in 0..outputs {
            let count = if t % 4 == 3 { 0 } else { t % 7 };
            taps.extend((0..count).map(|_| Tap { source: random.below(inputs) as u32, weight: random.unit() }));
            offsets.push(taps.len() as u32);
        }
        let mut slot = |t: usize| Slot {
            carry: random.below(inputs) as u32,
            always: if t.is_multiple_of(5) { 1.0 } else { 0.0 },
            mix: if t.is_multiple_of(3) { 0.0 } else { random.unit() },
        };
        let slots: Vec<Slot> = (0..outputs).map(&mut slot).collect();
        let filter = Filter { inputs, offsets: offsets.into(), taps: taps.into(), slots: slots.into() };
        let amounts: Vec<f32> = (0..rows).map(|s| if s % 2 == 0 { 0.0 } else { random.unit() }).collect();
        let ugly = [0.0, -0.0, 1e-40, 65504.0, 1e30];
        let shadows: Vec<f32> =
            (0..rows * inputs).map(|i| if i % 9 == 0 { ugly[i % 5] } else { random.unit() }).collect();
        let what = format!("{rows} samples of {inputs} and {outputs} slots");
        compare(&what, devices, ARITHMETIC, |device| Ok(spread(shadow_filter(device, &filter, &amounts, &shadows)?)))?;
    }
    Ok(())
}

pub fn light(devices: &Devices) -> Outcome {
    let mut random = Random(12);
    for (rows, directions) in [(1, 1), (3, 64), (65, 63), (2, 1000)] {
        let mut unit = || {
            let v = Vec3::new(random.unit() - 0.5, random.unit() - 0.5, random.unit() - 0.5);
            v.normalize_or(Vec3::Y).extend(0.0).to_array()
        };
        let normals: Vec<[f32; 4]> = (0..rows).map(|_| unit()).collect();
        let directions: Vec<[f32; 4]> = (0..directions).map(|_| unit()).collect();
        let beams: Vec<Beam> = directions
            .into_iter()
            .enumerate()
            .map(|(t, direction)| {
                let sun = if t % 50 == 7 { 60_000.0 } else { 1.0 };
                Beam { direction, energy: [sun * random.unit(), random.unit(), 0.0, 0.0] }
            })
            .collect();
        let beams = Array::from(beams);
        for lanes in [1, 3] {
            let change: Vec<f32> =
                (0..lanes * rows * beams.len()).map(|i| if i % 3 == 0 { 0.0 } else { random.unit() }).collect();
            let what = format!("{rows} samples, {} directions, {lanes} lanes", beams.len());
            compare(&what, devices, ARITHMETIC, |device| shadow_light(device, &beams, &normals, &change, lanes))?;
        }
    }
    Ok(())
}
