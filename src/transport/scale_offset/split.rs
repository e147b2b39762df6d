//! Which edits of a list become columns, which rows, and which one vector at the view (thesis 5.3.2).
//!
//! Colour edits are linear and commute with each other and with path edits; curves commute with nothing. So an edit of
//! all receivers moves to the source unless a curve comes before it, and an edit of all casters moves to the eye unless a
//! curve that stays comes after it. A curve of all casters moves to the eye when all that follow it do.

use crate::transport::edits::Transit;
use crate::transport::{Edit, Edits};

/// The transit edits of a list, each in one place; orders are kept.
pub struct Split<'a> {
    pub columns: Vec<&'a Transit>,
    /// With their numbers among the transit edits.
    pub middle: Vec<(usize, &'a Transit)>,
    /// How many there are of all others.
    pub eye: usize,
    at_eye: Vec<bool>,
}

impl<'a> Split<'a> {
    pub fn new(edits: &'a Edits) -> Self {
        let transit: Vec<&Transit> = edits.transit().collect();
        let first_curve = transit.iter().position(|edit| edit.has_curve()).unwrap_or(transit.len());
        let is_column = |i: usize| {
            let edit = transit[i];
            i < first_curve && edit.is_colour() && edit.block.receiver.is_none()
        };
        let mut at_eye = vec![false; transit.len()];
        for i in (0..transit.len()).rev() {
            let later = || (i + 1..transit.len()).filter(|&j| !is_column(j));
            let free = match transit[i].has_curve() {
                true => later().all(|j| at_eye[j]),
                false => later().all(|j| at_eye[j] || !transit[j].has_curve()),
            };
            at_eye[i] = !is_column(i) && transit[i].is_colour() && transit[i].block.caster.is_none() && free;
        }
        let numbers = 0..transit.len();
        Self {
            columns: numbers.clone().filter(|&i| is_column(i)).map(|i| transit[i]).collect(),
            middle: numbers.filter(|&i| !is_column(i) && !at_eye[i]).map(|i| (i, transit[i])).collect(),
            eye: at_eye.iter().filter(|at| **at).count(),
            at_eye,
        }
    }

    /// The list without what happens at the eye.
    pub fn without_eye(&self, edits: &Edits) -> Edits {
        let mut numbers = 0..;
        let stays = |edit: &&Edit| match edit {
            Edit::Transit(_) => numbers.next().is_some_and(|number: usize| !self.at_eye[number]),
            Edit::Eye(_) => false,
            Edit::Source(_) | Edit::Sampled(_) => true,
        };
        Edits(edits.0.iter().filter(stays).cloned().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Geometry;
    use crate::transport::Selection;
    use crate::transport::edits::{Block, Change, Colour};
    use crate::transport::tone_curve::ToneCurve;
    use std::sync::Arc;

    fn edit(caster: bool, receiver: bool, curve: bool) -> Edit {
        let some = || Arc::new(Selection::by_name(&Geometry::default(), &[], &[]).unwrap());
        let block = Block { caster: caster.then(some), receiver: receiver.then(some) };
        let curve = if curve { ToneCurve::Gamma { gamma: 2.0, pivot: 1.0 } } else { ToneCurve::None };
        let change = Change::Colour(Colour { brightness: 2.0, saturation: 1.0, hue: 0.0, curve });
        Edit::Transit(Transit { block, change })
    }

    fn places(edits: Vec<Edit>) -> (usize, Vec<usize>, usize) {
        let edits = Edits(edits);
        let split = Split::new(&edits);
        (split.columns.len(), split.middle.iter().map(|(i, _)| *i).collect(), split.eye)
    }

    #[test]
    fn each_edit_goes_where_it_costs_least_and_curves_keep_their_place() {
        let (column, row, block) = (edit(true, false, false), edit(false, true, false), edit(true, true, false));
        let (curve_all, curve_block) = (edit(false, false, true), edit(true, true, true));
        let list = vec![block.clone(), column.clone(), row.clone()];
        assert_eq!(places(list), (1, vec![0], 1));
        // A curve on a block holds back what surrounds it.
        let list = vec![row.clone(), curve_block.clone(), column.clone(), row.clone()];
        assert_eq!(places(list), (0, vec![0, 1, 2], 1));
        // A curve on everything goes to the eye if only such edits follow.
        assert_eq!(places(vec![block.clone(), curve_all.clone(), row.clone()]), (0, vec![0], 2));
        assert_eq!(places(vec![curve_all, block]), (0, vec![0, 1], 0));
    }
}
