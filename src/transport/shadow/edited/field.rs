//! Shadows of a few samples at some of many directions, and what groups of objects hide together.

/// Shadows of the samples of a tile: each has a value a slot, and a 0 behind them. All other slots are 0.
pub struct Field {
    /// Places in the list that a chain starts from, or ends with; ascending.
    pub slots: Vec<u32>,
    pub values: Vec<f32>,
}

impl Field {
    pub fn stride(&self) -> usize {
        self.slots.len() + 1
    }

    /// The same with more slots.
    pub fn spread(&self, slots: &[u32]) -> Vec<f32> {
        let places: Vec<usize> =
            self.slots.iter().map(|slot| slots.binary_search(slot).expect("the slots are among these")).collect();
        let mut all = vec![0.0; self.values.len() / self.stride() * (slots.len() + 1)];
        for (all, values) in all.chunks_exact_mut(slots.len() + 1).zip(self.values.chunks_exact(self.stride())) {
            places.iter().zip(values).for_each(|(&place, &value)| all[place] = value);
        }
        all
    }
}

/// What any of the groups blocks: `1 - (1 - S_1) (1 - S_2) ...`; one group's as it is, bit by bit.
pub fn together(groups: impl Iterator<Item = Field>) -> Field {
    let mut groups: Vec<Field> = groups.collect();
    if groups.len() == 1 {
        return groups.remove(0);
    }
    let slots = union(groups.iter().map(|group| &group.slots[..]));
    let mut values: Vec<f32> = Vec::new();
    for group in groups {
        let more = group.spread(&slots);
        match values.is_empty() {
            true => values = more,
            false => values.iter_mut().zip(more).for_each(|(all, other)| *all += other * (1.0 - *all)),
        }
    }
    Field { slots, values }
}

/// Slots of any of the lists, ascending.
pub fn union<'a>(lists: impl Iterator<Item = &'a [u32]>) -> Vec<u32> {
    let mut all: Vec<u32> = lists.flatten().copied().collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// The part of a field over `inputs` that lies on `outputs`, which are among these; both ascending texels.
pub fn seen(field: &Field, inputs: &[u32], outputs: &[u32]) -> Field {
    let both: Vec<(usize, u32)> = field
        .slots
        .iter()
        .enumerate()
        .filter_map(|(place, &slot)| {
            outputs.binary_search(&inputs[slot as usize]).ok().map(|output| (place, output as u32))
        })
        .collect();
    let rows = field.values.chunks_exact(field.stride());
    let values = rows.flat_map(|row| both.iter().map(|(place, _)| row[*place]).chain([0.0])).collect();
    Field { slots: both.into_iter().map(|(_, output)| output).collect(), values }
}
