//! Splits light at gather samples into atoms: the parts that a list of edits tells apart by caster.
//!
//! An edit acts on the light from its caster as the edits before it left it. If every sample's light is cut into what
//! lies in and what lies outside each caster, each part passes whole through any list of edits; parts in the same
//! casters can travel together. Hard, disjoint casters make one atom each and one for the rest, so the tenth edit costs
//! little more than the first. Soft casters are cut by weight: `b` of the light is in, `1 - b` is not, which is the
//! expansion of the product of `1 + b (M - 1)` over the edits.

use crate::{Error, Result, memory};

/// Above this, edits overlap in more ways than memory should be spent on.
pub const MOST: usize = 1024;

/// Shares of each gather sample's light; shares of a sample add up to 1.
pub struct Atoms {
    /// Per atom, one share a sample. The first atom is what lies in no caster; there may be none of it.
    pub shares: Vec<Vec<f32>>,
    /// Per caster, the atoms that lie in it.
    pub members: Vec<Vec<usize>>,
}

/// `casters`: weights in [0, 1] at `count` samples, one list per distinct caster.
///
/// Errors: more than `MOST` atoms, or more than fit into memory.
pub fn split(count: usize, casters: &[Vec<f32>]) -> Result<Atoms> {
    let mut atoms: Vec<(Vec<usize>, Vec<f32>)> = vec![(Vec::new(), vec![1.0; count])];
    for (number, weights) in casters.iter().enumerate() {
        let (bytes, what) = (12 * (atoms.len() * count) as u64, format!("{} parts of the light", 2 * atoms.len()));
        memory::require(bytes, &what, "use fewer overlapping casters in one list of edits, or fewer gather_samples")?;
        let mut next = Vec::new();
        for (inside, shares) in atoms {
            let cut = |part: &dyn Fn(f32) -> f32| -> Vec<f32> {
                shares.iter().zip(weights).map(|(s, w)| s * part(*w)).collect()
            };
            let is_dark = |shares: &[f32]| shares.iter().all(|s| *s == 0.0);
            let (within, without) = (cut(&|w| w), cut(&|w| 1.0 - w));
            if inside.is_empty() || !is_dark(&without) {
                next.push((inside.clone(), without));
            }
            if !is_dark(&within) {
                next.push((inside.iter().copied().chain([number]).collect(), within));
            }
        }
        atoms = next;
        if atoms.len() > MOST {
            let message = format!("casters of {} edits overlap in more than {MOST} ways", number + 1);
            return Err(Error::compute(message, "use fewer overlapping soft casters in one list of edits"));
        }
    }
    let members = (0..casters.len()).map(|c| (0..atoms.len()).filter(|&a| atoms[a].0.contains(&c)).collect()).collect();
    Ok(Atoms { shares: atoms.into_iter().map(|atom| atom.1).collect(), members })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disjoint_casters_make_one_atom_each() {
        let atoms = split(3, &[vec![1.0, 0.0, 0.0], vec![0.0, 1.0, 0.0]]).unwrap();
        assert_eq!(atoms.shares.len(), 3);
        assert_eq!(atoms.members, [vec![2], vec![1]]);
    }

    #[test]
    fn shares_add_up() {
        let atoms = split(2, &[vec![0.25, 1.0], vec![0.5, 0.125], vec![0.0, 0.5]]).unwrap();
        for sample in 0..2 {
            assert_eq!(atoms.shares.iter().map(|shares| shares[sample]).sum::<f32>(), 1.0);
        }
        let inside: f32 = atoms.members[0].iter().map(|&a| atoms.shares[a][0]).sum();
        assert_eq!(inside, 0.25);
    }

    #[test]
    fn the_first_atom_is_outside_even_when_nothing_is() {
        let atoms = split(2, &[vec![1.0; 2], vec![0.0; 2]]).unwrap();
        assert_eq!(atoms.shares, [[0.0; 2], [1.0; 2]]);
        assert_eq!(atoms.members, [vec![1], vec![]]);
    }
}
