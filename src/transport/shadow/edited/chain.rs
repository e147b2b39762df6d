//! A list of shadow edits, compiled: which directions must be known, and the steps from them to the edited ones. The
//! same for all samples; how much each step does at a sample is the sample's own.

use super::taps::{Gaussian, bilinear};
use crate::kernels::shadow_filter::{Filter, Slot, Tap};
use crate::scene::Environment;
use crate::scene::cube::{self, FACES};
use crate::transport::shadow::{ShadowChange, ShadowEdit, Visibility};
use glam::Quat;
use rayon::prelude::*;

pub struct Chain {
    /// Texels whose shadow goes in, ascending.
    pub inputs: Vec<u32>,
    pub steps: Vec<Step>,
}

pub struct Step {
    /// Number in the list.
    pub edit: usize,
    pub filter: Filter,
}

/// Texels where any edit of a list may change a shadow, ascending.
pub fn reach<'a>(edits: impl Iterator<Item = &'a ShadowEdit>, size: usize) -> Vec<u32> {
    let mut reached = vec![false; FACES * size * size];
    for edit in edits {
        match &edit.lamp {
            None => reached.fill(true),
            Some(lamp) => reached.iter_mut().zip(&lamp.weights).for_each(|(reached, &weight)| *reached |= weight > 0.0),
        }
    }
    (0..reached.len() as u32).filter(|&texel| reached[texel as usize]).collect()
}

/// Directions that edits look at, of those that were never baked because no light comes from them.
pub fn unbaked(visibility: &Visibility, environment: &Environment) -> usize {
    let lit = |texel: &u32| environment.is_lit(*texel as usize);
    if !visibility.lit_only || (0..environment.radiance.len() as u32).all(|texel| lit(&texel)) {
        return 0;
    }
    let looks = |edit: &&ShadowEdit| !edit.change.is_pointwise();
    let dark = visibility.edits.iter().filter(looks).flat_map(|edit| {
        let mut after = reach([edit].into_iter(), visibility.size);
        after.retain(lit);
        let (mut before, _) = steps_of(edit, visibility.size, &after);
        before.retain(|texel| !lit(texel));
        before
    });
    dark.collect::<std::collections::HashSet<u32>>().len()
}

impl Chain {
    /// Of a list, in order, for texels `outputs` (ascending).
    pub fn new(edits: &[&ShadowEdit], size: usize, outputs: Vec<u32>) -> Self {
        let mut chain = Self { inputs: outputs, steps: Vec::new() };
        // From the last edit back: each asks for what it looks at.
        for (number, edit) in edits.iter().enumerate().rev() {
            let (before, filters) = steps_of(edit, size, &chain.inputs);
            let steps = filters.into_iter().rev().map(|filter| Step { edit: number, filter });
            chain.steps.extend(steps);
            chain.inputs = before;
        }
        chain.steps.reverse();
        chain
    }

    pub fn bytes(&self) -> u64 {
        4 * self.inputs.len() as u64 + self.steps.iter().map(|step| step.filter.bytes()).sum::<u64>()
    }
}

/// The texels that an edit needs for the texels `after`, and its filters from those to these.
fn steps_of(edit: &ShadowEdit, size: usize, after: &[u32]) -> (Vec<u32>, Vec<Filter>) {
    let mix = |texel: u32| edit.lamp.as_ref().map_or(1.0, |lamp| lamp.weights[texel as usize]);
    match edit.change {
        ShadowChange::Fade { .. } | ShadowChange::Gradient { .. } | ShadowChange::Tint { .. } => {
            let slots = (0..).zip(after).map(|(t, &texel)| Slot { carry: t, always: 0.0, mix: mix(texel) });
            (after.to_vec(), vec![filter(after.len(), slots.collect(), vec![Vec::new(); after.len()])])
        }
        ShadowChange::Move { offset } => {
            looked_up(after, size, mix, |texel| bilinear(cube::texel_point(texel, size) - offset, size))
        }
        ShadowChange::Turn { axis, angle } => {
            let back = Quat::from_axis_angle(axis, -angle);
            looked_up(after, size, mix, |texel| bilinear(back * cube::texel_point(texel, size), size))
        }
        ShadowChange::Blur { angle } => blurred(after, size, mix, angle),
    }
}

fn filter(inputs: usize, slots: Vec<Slot>, taps: Vec<Vec<Tap>>) -> Filter {
    let mut offsets = Vec::with_capacity(slots.len() + 1);
    offsets.push(0);
    let mut end = 0;
    offsets.extend(taps.iter().map(|taps| {
        end += taps.len() as u32;
        end
    }));
    Filter { inputs, offsets: offsets.into(), taps: taps.concat().into(), slots: slots.into() }
}

/// Shadows that are looked up elsewhere; `taps` of a texel name texels.
fn looked_up(
    after: &[u32],
    size: usize,
    mix: impl Fn(u32) -> f32 + Sync,
    taps: impl Fn(usize) -> Vec<Tap> + Sync,
) -> (Vec<u32>, Vec<Filter>) {
    let of = |&texel: &u32| if mix(texel) > 0.0 { taps(texel as usize) } else { Vec::new() };
    let mut taps: Vec<Vec<Tap>> = after.par_iter().map(of).collect();
    let before = joined(after, taps.iter().flatten().map(|tap| tap.source), FACES * size * size);
    let place = places(&before, FACES * size * size);
    taps.iter_mut().flatten().for_each(|tap| tap.source = place[tap.source as usize]);
    let slots = after.iter().map(|&texel| Slot { carry: place[texel as usize], always: 0.0, mix: mix(texel) });
    let step = filter(before.len(), slots.collect(), taps);
    (before, vec![step])
}

/// Blurs in three steps, so that wide blurs stay cheap: means over square cells, a Gaussian over cells, and bilinear
/// look-up between them. The cells are as wide as two thirds of the Gaussian at most; what means and look-up blur is
/// taken off it.
fn blurred(after: &[u32], size: usize, mix: impl Fn(u32) -> f32, angle: f32) -> (Vec<u32>, Vec<Filter>) {
    // In the middle of a face.
    let texel_angle = 2.0 / size as f32;
    let widest = (angle / texel_angle / 1.5).max(1.0) as usize;
    let block = (1 << widest.ilog2()).min(size / 4);
    let cells = size / block;
    let cell_angle = texel_angle * block as f32;
    // Variances of a square of width w: w²/12 less that of a texel's own; of a tent: w²/6.
    let tent = if block == 1 { 0.0 } else { cell_angle.powi(2) / 6.0 };
    let mean = (cell_angle.powi(2) - texel_angle.powi(2)) / 12.0;
    let deviation = (angle.powi(2) - mean - tent).max(0.0).sqrt().max(0.1 * texel_angle);

    // Backwards: cells that texels look up, cells that those sum, texels in these.
    let up = |&texel: &u32| match mix(texel) > 0.0 {
        true => bilinear(cube::texel_point(texel as usize, size), cells),
        false => Vec::new(),
    };
    let mut up: Vec<Vec<Tap>> = after.iter().map(up).collect();
    let count = FACES * cells * cells;
    let sums = joined(&[], up.iter().flatten().map(|tap| tap.source), count);
    let gaussian = Gaussian::new(cells, deviation);
    let mut around: Vec<Vec<Tap>> = sums.par_iter().map(|&cell| gaussian.around(cell as usize)).collect();
    let means = joined(&[], around.iter().flatten().map(|tap| tap.source), count);
    let texels_of = |&cell: &u32| {
        let (x, row) = (cell as usize % cells, cell as usize / cells);
        let first = (row * block) * size + x * block;
        (0..block * block).map(move |i| (first + i / block * size + i % block) as u32)
    };
    let before = joined(after, means.iter().flat_map(texels_of), FACES * size * size);

    // Every step carries the texels that come out, in front of its cells.
    let kept = after.len();
    let carried = |t: usize| Slot { carry: t as u32, always: 0.0, mix: 0.0 };
    let cell = Slot { carry: 0, always: 1.0, mix: 0.0 };
    let with_cells = |front: Vec<Slot>, cells: usize| [front, vec![cell; cells]].concat();
    let behind = |taps: Vec<Vec<Tap>>| [vec![Vec::new(); kept], taps].concat();

    let place = places(&before, FACES * size * size);
    let share = 1.0 / (block * block) as f32;
    let down = means
        .iter()
        .map(|cell| texels_of(cell).map(|texel| Tap { source: place[texel as usize], weight: share }).collect())
        .collect();
    let front = after.iter().map(|&texel| carried(place[texel as usize] as usize)).collect();
    let first = filter(before.len(), with_cells(front, means.len()), behind(down));

    let place = places(&means, count);
    around.iter_mut().flatten().for_each(|tap| tap.source = kept as u32 + place[tap.source as usize]);
    let second = filter(kept + means.len(), with_cells((0..kept).map(carried).collect(), sums.len()), behind(around));

    let place = places(&sums, count);
    up.iter_mut().flatten().for_each(|tap| tap.source = kept as u32 + place[tap.source as usize]);
    let slots = (0..).zip(after).map(|(t, &texel)| Slot { carry: t, always: 0.0, mix: mix(texel) });
    let third = filter(kept + sums.len(), slots.collect(), up);
    (before, vec![first, second, third])
}

/// `numbers` and `more`, each number below `count` once, ascending.
fn joined(numbers: &[u32], more: impl Iterator<Item = u32>, count: usize) -> Vec<u32> {
    let mut has = vec![false; count];
    numbers.iter().copied().chain(more).for_each(|number| has[number as usize] = true);
    (0..count as u32).filter(|&number| has[number as usize]).collect()
}

/// Per number below `count`, its place in `numbers`.
fn places(numbers: &[u32], count: usize) -> Vec<u32> {
    let mut places = vec![u32::MAX; count];
    (0..).zip(numbers).for_each(|(place, &number)| places[number as usize] = place);
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Device;
    use crate::kernels::shadow_filter::shadow_filter;
    use crate::transport::shadow::Lamp;
    use glam::Vec3;
    use std::sync::Arc;

    const SIZE: usize = 32;
    const ALL: usize = FACES * SIZE * SIZE;

    fn edit(change: ShadowChange, lamp: Option<Vec<f32>>) -> ShadowEdit {
        let lamp = lamp.map(|weights| Arc::new(Lamp { size: SIZE, weights: weights.into() }));
        ShadowEdit { group: None, lamp, selection: None, change }
    }

    /// Runs a list on one sample whose shadow is a function of direction; every texel comes out.
    fn run(edits: &[ShadowEdit], shadow: impl Fn(Vec3) -> f32, amount: f32) -> Vec<f32> {
        let edits: Vec<&ShadowEdit> = edits.iter().collect();
        let chain = Chain::new(&edits, SIZE, (0..ALL as u32).collect());
        let mut slots: Vec<f32> =
            chain.inputs.iter().map(|&t| shadow(cube::texel_point(t as usize, SIZE).normalize())).collect();
        for step in &chain.steps {
            slots = shadow_filter(&Device::Cpu, &step.filter, &[amount], &slots).unwrap();
        }
        slots
    }

    fn at(slots: &[f32], direction: Vec3) -> f32 {
        slots[cube::texel_at(direction, SIZE)]
    }

    fn cap(direction: Vec3) -> f32 {
        f32::from(u8::from(direction.y > 0.9))
    }

    #[test]
    fn a_turn_carries_a_cap_across_faces() {
        let turn = edit(ShadowChange::Turn { axis: Vec3::Z, angle: -std::f32::consts::FRAC_PI_2 }, None);
        let slots = run(&[turn], cap, 1.0);
        assert!(at(&slots, Vec3::X) > 0.99 && at(&slots, Vec3::Y) < 0.01);
        // Twice a half turn is nothing, but for look-ups between texels.
        let half = || edit(ShadowChange::Turn { axis: Vec3::X, angle: std::f32::consts::PI }, None);
        let slots = run(&[half(), half()], cap, 1.0);
        let wrong = (0..ALL).filter(|&t| {
            let d = cube::texel_point(t, SIZE).normalize();
            (slots[t] - cap(d)).abs() > 0.01 && (d.y - 0.9).abs() > 0.05
        });
        assert_eq!(wrong.count(), 0);
    }

    #[test]
    fn a_move_by_whole_texels_shifts_a_face() {
        let offset = Vec3::new(0.0, 0.0, 4.0 / SIZE as f32);
        let stripes = |d: Vec3| f32::from(u8::from((d.z / d.y.abs().max(0.2)) > 0.1));
        let slots = run(&[edit(ShadowChange::Move { offset }, None)], stripes, 1.0);
        for (x, y) in [(3, 3), (20, 9), (31, 31), (17, 17)] {
            let point = cube::texel_point((2 * SIZE + y) * SIZE + x, SIZE);
            let expected = stripes(point - offset);
            let found = slots[(2 * SIZE + y) * SIZE + x];
            assert!((found - expected).abs() < 1e-3, "{x} {y}: {found} {expected}");
        }
    }

    /// Of the Gaussian of deviation 1, up to `x`.
    fn normal_integral(x: f32) -> f32 {
        let step = 0.01;
        let count = ((x + 6.0) / step) as i32;
        (0..count).map(|i| (-0.5 * (-6.0 + (i as f32 + 0.5) * step).powi(2)).exp() * step).sum::<f32>() / 2.5066
    }

    #[test]
    fn blurs_keep_what_is_even_and_have_the_width_that_was_asked() {
        for angle in [0.1, 0.15, 0.22, 0.4] {
            let blur = || edit(ShadowChange::Blur { angle }, None);
            assert!(run(&[blur()], |_| 1.0, 1.0).iter().all(|s| (s - 1.0).abs() < 1e-4));
            // A half space's edge becomes the integral of a Gaussian.
            let slots = run(&[blur()], |d| f32::from(u8::from(d.x > 0.0)), 1.0);
            for outside in [-1.5, -1.0, -0.5, 0.0, 0.7, 1.2] {
                let direction = Vec3::new((outside * angle).sin(), (outside * angle).cos(), 0.01);
                let middle = cube::texel_point(cube::texel_at(direction, SIZE), SIZE).normalize();
                let found = at(&slots, direction);
                let expected = normal_integral(middle.x.asin() / angle);
                assert!((found - expected).abs() < 0.04, "{angle} {outside}: {found}, expected {expected}");
            }
        }
    }

    #[test]
    fn what_is_not_of_the_lamp_keeps_every_bit() {
        let lamp: Vec<f32> = (0..ALL).map(|t| if t % 7 == 0 { 0.5 } else { 0.0 }).collect();
        let noise = |d: Vec3| (d.x * 57.0 + d.y * 13.0).sin();
        for change in [
            ShadowChange::Fade { amount: 1.0 },
            ShadowChange::Move { offset: Vec3::new(0.3, 0.0, 0.1) },
            ShadowChange::Blur { angle: 0.2 },
        ] {
            let slots = run(&[edit(change, Some(lamp.clone()))], noise, 1.0);
            let still = run(&[edit(change, Some(lamp.clone()))], noise, 0.0);
            let mut moved = 0;
            for t in 0..ALL {
                let original = noise(cube::texel_point(t, SIZE).normalize());
                assert_eq!(still[t], original, "an amount of 0");
                assert!(lamp[t] > 0.0 || slots[t] == original, "outside of the lamp");
                moved += usize::from(slots[t] != original);
            }
            assert!(moved > ALL / 8, "{change:?} moved {moved}");
        }
    }
}
