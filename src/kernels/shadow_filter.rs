//! One step of an edit of shadows, at many samples: `out[s][t] = c + k (sum_j w_j in[s][j] - c)`, `c = in[s][carry_t]`,
//! `k = always_t + amount_s mix_t` (see `transport::shadow::edits`).
//!
//! A sample's shadows are a row of slots: directions, or cells of directions on the way of a blur. Where a slot's `k`
//! is 0, it is carried over bit by bit. Sums run over j in order.

#[cfg(feature = "gpu")]
use super::pages;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::{Error, Result};
use rayon::prelude::*;

uniform! {
    struct Params {
        rows: u32,
        inputs: u32,
        outputs: u32,
        pad0: u32,
    }
}

pub const KERNEL: Kernel = Kernel {
    name: "shadow_filter",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/shadow_filter.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<u32>("offsets"),
        Binding::read::<Tap>("taps"),
        Binding::read::<Slot>("slots"),
        Binding::read::<f32>("amounts"),
        Binding::read::<f32>("shadows"),
        Binding::write::<f32>("filtered"),
    ],
};

/// One term of a slot's sum.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Tap {
    /// Slot that goes in.
    pub source: u32,
    pub weight: f32,
}

/// How much of a slot its sum replaces.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Slot {
    /// Slot that goes in and is kept.
    pub carry: u32,
    /// At every sample.
    pub always: f32,
    /// Times the sample's amount.
    pub mix: f32,
}

/// The step, the same for all samples.
#[derive(Clone, Debug)]
pub struct Filter {
    /// Slots of a sample that go in.
    pub inputs: usize,
    /// First tap of each slot that comes out, and the end.
    pub offsets: Array<u32>,
    pub taps: Array<Tap>,
    /// Of what comes out.
    pub slots: Array<Slot>,
}

impl Filter {
    pub fn outputs(&self) -> usize {
        self.slots.len()
    }

    /// The filter for samples whose slots are 0 but for `kept` (ascending), and the slots that may come out of it other
    /// than 0, ascending. Both are followed by one slot that is always 0.
    pub fn narrowed(&self, kept: &[u32]) -> (Self, Vec<u32>) {
        const NOWHERE: u32 = u32::MAX;
        let mut place = vec![NOWHERE; self.inputs];
        (0..).zip(kept).for_each(|(new, &slot)| place[slot as usize] = new);
        let zero = kept.len() as u32;
        let (mut offsets, mut taps, mut slots, mut out) = (vec![0], Vec::new(), Vec::new(), Vec::new());
        for (t, slot) in self.slots.iter().enumerate() {
            let first = taps.len();
            let own = &self.taps[self.offsets[t] as usize..self.offsets[t + 1] as usize];
            let found = own.iter().map(|tap| Tap { source: place[tap.source as usize], weight: tap.weight });
            taps.extend(found.filter(|tap| tap.source != NOWHERE));
            let carry = place[slot.carry as usize];
            if carry != NOWHERE || taps.len() > first {
                slots.push(Slot { carry: carry.min(zero), ..*slot });
                offsets.push(taps.len() as u32);
                out.push(t as u32);
            }
        }
        slots.push(Slot { carry: zero, always: 0.0, mix: 0.0 });
        offsets.push(taps.len() as u32);
        let inputs = kept.len() + 1;
        (Self { inputs, offsets: offsets.into(), taps: taps.into(), slots: slots.into() }, out)
    }

    pub fn bytes(&self) -> u64 {
        (4 * self.offsets.len() + 8 * self.taps.len() + 12 * self.slots.len()) as u64
    }
}

/// `amounts`: one a sample; `shadows`: `filter.inputs` a sample. The result has `filter.outputs()` a sample.
pub fn shadow_filter(device: &Device, filter: &Filter, amounts: &[f32], shadows: &[f32]) -> Result<Vec<f32>> {
    let within = |index: u32| (index as usize) < filter.inputs;
    let fits = shadows.len() == amounts.len() * filter.inputs
        && filter.offsets.len() == filter.outputs() + 1
        && filter.offsets.last().is_some_and(|&end| end as usize == filter.taps.len())
        && filter.offsets.is_sorted()
        && filter.taps.iter().all(|tap| within(tap.source))
        && filter.slots.iter().all(|slot| within(slot.carry));
    if !fits {
        let message = format!(
            "shadow_filter: {} shadows of {} samples for a filter of {} slots and {} taps",
            shadows.len(),
            amounts.len(),
            filter.inputs,
            filter.taps.len()
        );
        return Err(Error::compute(message, "this is a fault of the node that called the kernel; please report it"));
    }
    match device {
        Device::Cpu => Ok(cpu(filter, amounts, shadows)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, filter, amounts, shadows),
    }
}

fn cpu(filter: &Filter, amounts: &[f32], shadows: &[f32]) -> Vec<f32> {
    let mut filtered = vec![0.0; amounts.len() * filter.outputs()];
    let rows =
        filtered.par_chunks_exact_mut(filter.outputs().max(1)).zip(shadows.par_chunks_exact(filter.inputs.max(1)));
    rows.zip(amounts).for_each(|((filtered, shadows), amount)| {
        for (t, (out, slot)) in filtered.iter_mut().zip(&filter.slots).enumerate() {
            let carried = shadows[slot.carry as usize];
            let share = slot.always + amount * slot.mix;
            *out = carried;
            if share != 0.0 {
                let taps = &filter.taps[filter.offsets[t] as usize..filter.offsets[t + 1] as usize];
                let sum = taps.iter().fold(0.0, |sum, tap| sum + tap.weight * shadows[tap.source as usize]);
                *out = carried + share * (sum - carried);
            }
        }
    });
    filtered
}

#[cfg(feature = "gpu")]
fn gpu(gpu: &Gpu, filter: &Filter, amounts: &[f32], shadows: &[f32]) -> Result<Vec<f32>> {
    let (inputs, outputs) = (filter.inputs, filter.outputs());
    let mut filtered = Vec::with_capacity(amounts.len() * outputs);
    for range in pages(amounts.len(), gpu.page(4 * inputs.max(outputs))) {
        let part = gpu.storage::<f32>(range.len() * outputs);
        let params = Params { rows: range.len() as u32, inputs: inputs as u32, outputs: outputs as u32, pad0: 0 };
        let buffers = [
            &gpu.whole(&filter.offsets),
            // A buffer is never empty.
            &if filter.taps.is_empty() { gpu.storage::<Tap>(1) } else { gpu.whole(&filter.taps) },
            &gpu.whole(&filter.slots),
            &gpu.upload(&amounts[range.clone()]),
            &gpu.upload(&shadows[range.start * inputs..range.end * inputs]),
            &part,
        ];
        let mut batch = gpu.batch();
        batch.dispatch(&KERNEL, &params, &buffers, (range.len() * outputs).div_ceil(64))?;
        let [page] = batch.read([&part])?;
        filtered.extend_from_slice(page.get());
    }
    Ok(filtered)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filter() -> Filter {
        Filter {
            inputs: 3,
            offsets: vec![0, 2, 2, 3].into(),
            taps: vec![Tap { source: 0, weight: 0.5 }, Tap { source: 2, weight: 0.5 }, Tap { source: 1, weight: 1.0 }]
                .into(),
            slots: vec![
                Slot { carry: 0, always: 0.0, mix: 1.0 },
                Slot { carry: 1, always: 0.0, mix: 0.5 },
                Slot { carry: 0, always: 1.0, mix: 0.0 },
            ]
            .into(),
        }
    }

    #[test]
    fn three_slots_by_hand() {
        let shadows = [0.0, 1.0, 1.0, 0.25, 0.5, 0.75];
        let out = shadow_filter(&Device::Cpu, &filter(), &[1.0, 0.0], &shadows).unwrap();
        // First sample: a mean, half of a fade, a move; second: the amount is 0, but `always` moves.
        assert_eq!(out, [0.5, 0.5, 1.0, 0.25, 0.5, 0.5]);
    }

    #[test]
    fn narrowed_filters_give_the_same_where_anything_is() {
        let (narrow, out) = filter().narrowed(&[2]);
        // The second slot carries, and sums, what is 0.
        assert_eq!(out, [0]);
        let wide = shadow_filter(&Device::Cpu, &filter(), &[0.7], &[0.0, 0.0, 0.8]).unwrap();
        let found = shadow_filter(&Device::Cpu, &narrow, &[0.7], &[0.8, 0.0]).unwrap();
        assert_eq!(found, [wide[0], 0.0]);
        assert_eq!(wide[1..], [0.0, 0.0]);
        let (all, out) = filter().narrowed(&[0, 1, 2]);
        assert_eq!(out, [0, 1, 2]);
        let wide = shadow_filter(&Device::Cpu, &filter(), &[0.7], &[0.3, 0.1, 0.8]).unwrap();
        assert_eq!(shadow_filter(&Device::Cpu, &all, &[0.7], &[0.3, 0.1, 0.8, 0.0]).unwrap()[..3], wide);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert!(shadow_filter(&Device::Cpu, &filter(), &[1.0], &[0.0; 4]).is_err());
        let mut wrong = filter();
        wrong.slots = vec![Slot { carry: 3, always: 0.0, mix: 0.0 }; 3].into();
        assert!(shadow_filter(&Device::Cpu, &wrong, &[1.0], &[0.0; 3]).is_err());
    }
}
