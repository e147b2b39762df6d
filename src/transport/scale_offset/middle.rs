//! The edits that need rows, for the view samples that they reach (thesis eq. 5.4, Algorithms 10 and 11).

use super::classes::Touched;
use super::field::{PathField, Senders, Step};
use super::importance::Importance;
use super::shadows::Uncovered;
use super::split::Split;
use super::{Cost, Settings};
use crate::Result;
use crate::device::Array;
use crate::memo::Key;
use crate::transport::SparseRows;
use crate::transport::edits::Transit;
use crate::transport::lighting::{Indirect, Lane, Leaving, Paths, Positions, Stage};
use crate::transport::sampled::UNTOUCHED;
use crate::transport::sampled::fit::fit_towards;
use crate::transport::sampled::row::{self, Row};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Light that scales cannot give, over all that its sender sends, below which it is left out: an offset stays when lamps
/// are dimmed, so it is used where it must be.
const NEGLIGIBLE: f32 = 2e-3;

pub struct Middle<'a> {
    edits: Vec<&'a Transit>,
    steps: Vec<Step>,
    /// Of each step with a curve: its gain at each view sample.
    gains: Vec<Option<Array<f32>>>,
    touched: Arc<Touched>,
    senders: Senders,
    uncovered: Vec<Uncovered>,
}

/// Scale and offset rows with the slots that name them; see `sampled::Parts`.
pub struct Rows {
    pub touched: Vec<u32>,
    pub slots: Vec<[u32; 4]>,
    pub weights: Vec<[f32; 4]>,
    pub scales: SparseRows,
    pub offsets: Option<SparseRows>,
}

/// One row to be made: of a class, and of one row of the transfer where the class asks for that.
#[derive(Clone, Copy)]
struct Making {
    class: u32,
    transfer_row: Option<u32>,
    /// View sample that gains are taken from.
    sample: u32,
}

impl<'a> Middle<'a> {
    /// `sent`: exitance of the gather samples, edits of columns included.
    pub fn new(stage: &Stage, split: &Split<'a>, sent: &[[f32; 4]], edited: &Indirect) -> Result<Self> {
        let edits: Vec<&Transit> = split.middle.iter().map(|(_, edit)| *edit).collect();
        let steps: Vec<Step> = edits.iter().map(|edit| Step::of(edit)).collect();
        let gains = split.middle.iter().map(|(number, _)| edited.gains[*number].clone()).collect();
        let touched = Touched::new(stage, split)?;
        let senders = Senders::new(stage, &edits, sent)?;
        let uncovered = match steps.iter().any(|step| matches!(step, Step::Shadow)) {
            true => Uncovered::all(stage, &split.middle, &touched.transfer_rows(stage.transfer))?,
            false => Vec::new(),
        };
        Ok(Self { edits, steps, gains, touched, senders, uncovered })
    }

    fn acts(&self, step: usize, class: u32) -> bool {
        self.touched.classes[class as usize].weights[step] > 0.0
    }

    /// Its rows depend on where the row is.
    fn is_local(&self, class: u32) -> bool {
        let local = |s: usize| self.gains[s].is_some() || !matches!(self.steps[s], Step::Colour(_));
        (0..self.steps.len()).any(|s| self.acts(s, class) && local(s))
    }

    pub fn rows(&self, stage: &Stage, settings: Settings) -> Result<(Rows, Cost)> {
        let count = stage.transfer.gather.count();
        let (slots, weights, making) = self.slots(stage);
        let classes = 0..self.touched.classes.len() as u32;
        // As many pieces as there may be coefficients, each a linear ramp, whose error is its range over sqrt(12). Twice
        // that: most pieces turn out to vary less, and asking for them is what rows cost.
        let slack = 2.0 * settings.tolerance * (12.0 / settings.coefficients as f32).sqrt();
        let variation: Vec<Vec<f32>> = classes.into_par_iter().map(|class| self.colours(class).variation()).collect();
        let (kept, short) = (AtomicU64::new(0), AtomicU64::new(0));
        let truncate = |row: &mut Row, importance: Option<&Importance>| {
            let weight = |node: usize| {
                let span = count >> node.ilog2();
                importance.map_or(1.0, |importance| importance.share(node) / span as f32 * count as f32)
            };
            let left = row.truncate_by(settings.tolerance, settings.coefficients, weight);
            kept.fetch_add(left.coefficients as u64, Ordering::Relaxed);
            short.fetch_add(u64::from(left.error > 1.0001 * settings.tolerance), Ordering::Relaxed);
        };
        let scales = row::rows(count, making.len(), Importance::default, |number, importance, row| {
            let making = making[number];
            let Some(transfer_row) = making.transfer_row else {
                row.fill(count, &mut self.field(stage, making, slack, &variation, None));
                truncate(row, None);
                return Ok(());
            };
            importance.load(count, stage.transfer.rows.row(transfer_row as usize));
            row.fill(count, &mut self.field(stage, making, slack, &variation, Some(importance)));
            truncate(row, Some(importance));
            Ok(())
        })?;
        let offsets = match self.uncovered.is_empty() {
            true => None,
            false => Some(row::rows(
                count,
                making.len(),
                || (),
                |number, (), row| {
                    if let Some(transfer_row) = making[number].transfer_row {
                        let field = self.field(stage, making[number], slack, &variation, None);
                        self.uncovered.iter().for_each(|more| more.add(&field, transfer_row as usize, row));
                        truncate(row, None);
                    }
                    Ok(())
                },
            )?),
        };
        let (coefficients, cut_short) = (kept.into_inner(), short.into_inner());
        let cost = Cost { rows: making.len(), coefficients, cut_short, ..Cost::default() };
        Ok((Rows { touched: self.touched.samples.clone(), slots, weights, scales, offsets }, cost))
    }

    /// The field of a row; `variation`: of each class.
    fn field<'b>(
        &'b self,
        stage: &Stage,
        Making { class, transfer_row, sample }: Making,
        slack: f32,
        variation: &'b [Vec<f32>],
        importance: Option<&'b mut Importance>,
    ) -> PathField<'b> {
        let gain = |gains: &Option<Array<f32>>| gains.as_ref().map_or(1.0, |gains| gains[sample as usize]);
        let place = transfer_row.map_or(sample, |row| stage.transfer.row_samples[row as usize]);
        PathField {
            senders: &self.senders,
            steps: &self.steps,
            weights: &self.touched.classes[class as usize].weights,
            gains: self.gains.iter().map(gain).collect(),
            point: stage.transfer.samples.points[place as usize].position.into(),
            slack,
            importance,
            variation: &variation[class as usize],
        }
    }

    /// The colour part of a class: what does not depend on where a row is.
    fn colours(&self, class: u32) -> PathField<'_> {
        PathField {
            senders: &self.senders,
            steps: &self.steps,
            weights: &self.touched.classes[class as usize].weights,
            gains: vec![1.0; self.steps.len()],
            point: glam::Vec3::NAN,
            slack: 0.0,
            importance: None,
            variation: &[],
        }
    }

    /// Rows that the touched samples need, each once: four slots of each sample, what they count, and what to make.
    fn slots(&self, stage: &Stage) -> (Vec<[u32; 4]>, Vec<[f32; 4]>, Vec<Making>) {
        let transfer = stage.transfer;
        let local: Vec<bool> = (0..self.touched.classes.len() as u32).map(|class| self.is_local(class)).collect();
        let mut known: HashMap<(u32, u32), u32> = HashMap::new();
        let mut making = Vec::new();
        let (mut slots, mut weights) = (Vec::new(), Vec::new());
        let each = self.touched.samples.iter().zip(&self.touched.class).zip(&self.touched.factor);
        for ((&sample, &class), &factor) in each {
            let (rows, share) = (transfer.indices[sample as usize], transfer.weights[sample as usize]);
            let mut slot = [UNTOUCHED; 4];
            for j in (0..4).filter(|&j| share[j] != 0.0) {
                let transfer_row = local[class as usize].then_some(rows[j]);
                slot[j] = *known.entry((class, transfer_row.unwrap_or(UNTOUCHED))).or_insert_with(|| {
                    let at_row = transfer_row.map(|row| transfer.row_samples[row as usize]);
                    // A row outside what is painted knows no gain: the sample that asks for it does.
                    let own = at_row.filter(|at| self.touched.samples.binary_search(at).is_ok());
                    making.push(Making { class, transfer_row, sample: own.unwrap_or(sample) });
                    making.len() as u32 - 1
                });
            }
            slots.push(slot);
            weights.push(share.map(|share| share * factor));
        }
        (slots, weights, making)
    }

    /// Irradiance that scales cannot give, at all view samples: light of channels that were dark before. Empty for none.
    pub fn residual(&self, stage: &Stage, light: Key) -> Result<Vec<[f32; 4]>> {
        let count = stage.transfer.gather.count();
        let mut total = Vec::new();
        for class in 0..self.touched.classes.len() as u32 {
            let field = self.colours(class);
            let left = |leaf: usize| {
                let (original, edited, grey) = field.edited(leaf);
                let left = fit_towards(original, edited, grey).1;
                let matters = left.abs().max_element() > NEGLIGIBLE * original.abs().max(edited.abs()).max_element();
                if matters { left.extend(0.0).to_array() } else { [0.0; 4] }
            };
            let exitance: Vec<[f32; 4]> = (count..2 * count).into_par_iter().map(left).collect();
            if exitance.par_iter().all(|light| *light == [0.0; 4]) {
                continue;
            }
            let places = (0..self.touched.samples.len()).filter(|&i| self.touched.class[i] == class);
            let (samples, factors): (Vec<u32>, Vec<f32>) =
                places.map(|i| (self.touched.samples[i], self.touched.factor[i])).unzip();
            let on_paths: Vec<&Transit> = (0..self.edits.len())
                .filter(|&s| self.acts(s, class) && !self.edits[s].is_colour())
                .map(|s| self.edits[s])
                .collect();
            let key = Key::of(&[b"residual", &light.0, bytemuck::cast_slice(&exitance)]);
            let (leaving, lane) = (Leaving::whole(exitance, key), Lane::diffuse(stage));
            let samples = Positions::new(samples);
            let arriving = Paths::new(stage, &lane, &leaving, None, None)?.light(&on_paths, Some(&samples))?;
            total.resize(stage.transfer.samples.points.len(), [0.0; 4]);
            for ((&sample, factor), light) in samples.iter().zip(factors).zip(arriving.iter()) {
                total[sample as usize] = light.map(|light| light * factor);
            }
        }
        Ok(total)
    }
}
