//! Rows of scale and offset for this frame's transfer, out of those of the keyframes.
//!
//! A row of the transfer stands for the view samples that interpolate between it and its neighbours. What the keyframes
//! have at the sample where it was computed is its mixture `m_r` of their rows, of strength `A_r` (sum of weight times norm).
//! At a view sample `v` the mixtures of its four rows go with
//!
//! ```text
//! factor_j(v) = w_j A(v) / sum_i w_i A_i        on m_j as it is
//! ```
//!
//! with `A(v)` the strength of what the keyframes have at `v` itself. So borders of edits that are finer than the transfer's
//! rows stay where they are, and where an edit is the same at `v` as at its rows the factors are the transfer's own weights.

use super::{Settings, View};
use crate::Result;
use crate::transport::sampled::UNTOUCHED;
use crate::transport::sampled::row::{self, Row};
use crate::transport::{SparseRows, Transfer};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

pub(super) struct Rows {
    pub touched: Vec<u32>,
    pub slots: Vec<[u32; 4]>,
    pub weights: Vec<[f32; 4]>,
    pub scales: SparseRows,
    pub offsets: Option<SparseRows>,
}

/// Shares of a mixture are whole numbers of this: mixtures that are nearly the same are one row.
const STEP: f32 = 1.0 / 4096.0;

/// Rows of keyframes and their share in a mixture, in `STEP`s.
type Mixture = Vec<(RowOf, i32)>;

/// Key, and row of it.
type RowOf = (u32, u32);

/// The rows of all keyframes, as far as view samples are concerned.
struct Source<'a, 'b> {
    view: &'a View<'b>,
    /// By key and view sample of it: place among the touched ones.
    place: Vec<Vec<u32>>,
    /// By key and row: norm of scale and offset.
    norms: Vec<Vec<f32>>,
}

impl<'a, 'b> Source<'a, 'b> {
    fn new(view: &'a View<'b>) -> Self {
        let place = view.keys.iter().map(|key| {
            let Some(sampled) = key.sampled else { return vec![UNTOUCHED] };
            let mut place = vec![UNTOUCHED; sampled.view.side.len()];
            sampled.touched.iter().enumerate().for_each(|(i, sample)| place[*sample as usize] = i as u32);
            place
        });
        let norms = view.keys.iter().map(|key| {
            let of = |rows: &SparseRows, number: usize| {
                let channels = (3 * number..3 * number + 3).flat_map(|row| rows.row(row));
                channels.map(|(_, value)| f64::from(value).powi(2)).sum::<f64>().sqrt() as f32
            };
            let Some(sampled) = key.sampled else { return Vec::new() };
            let norm = |number: usize| {
                let offset = sampled.offsets.as_ref().map_or(0.0, |offsets| of(offsets, number));
                of(&sampled.scales, number) + offset
            };
            (0..sampled.rows()).into_par_iter().with_min_len(64).map(norm).collect()
        });
        let (place, norms) = (place.collect(), norms.collect());
        Self { view, place, norms }
    }

    /// The rows that belong to a view sample, with their strengths: weight times norm. Each row once.
    fn at(&self, v: usize, found: &mut Vec<(RowOf, f32)>) {
        found.clear();
        self.view.sources(v, |k, sample, weight| {
            let place = self.place[k][sample];
            let Some(sampled) = self.view.keys[k].sampled.filter(|_| place != UNTOUCHED) else { return };
            let slots = sampled.slots[place as usize].iter().zip(sampled.weights[place as usize]);
            for (row, factor) in slots.filter(|(row, _)| **row != UNTOUCHED) {
                let strength = weight * factor * self.norms[k][*row as usize];
                let name = (k as u32, *row);
                match found.iter_mut().find(|(known, _)| *known == name) {
                    Some((_, sum)) => *sum += strength,
                    None if strength != 0.0 => found.push((name, strength)),
                    None => {}
                }
            }
        });
    }
}

fn strength(found: &[(RowOf, f32)]) -> f32 {
    found.iter().map(|(_, strength)| strength.abs()).sum()
}

pub(super) fn rows(transfer: &Transfer, view: &View, settings: Settings) -> Result<Rows> {
    let source = Source::new(view);
    let strengths: Vec<f32> = (0..view.count())
        .into_par_iter()
        .with_min_len(1 << 10)
        .map_init(Vec::new, |found, v| {
            source.at(v, found);
            strength(found)
        })
        .collect();

    // What belongs to each row of the transfer: what its own sample has, or else what those have that it serves.
    let own = transfer.row_samples.par_iter().with_min_len(1 << 8).map_init(Vec::new, |found, sample| {
        source.at(*sample as usize, found);
        found.clone()
    });
    let mut mixtures: Vec<Vec<(RowOf, f32)>> = own.collect();
    serve(transfer, &source, &strengths, &mut mixtures);

    let mut numbers: HashMap<Mixture, u32> = HashMap::new();
    let mut distinct: Vec<Mixture> = Vec::new();
    let mut amounts = vec![0.0f32; mixtures.len()];
    let number_of: Vec<u32> = mixtures
        .iter()
        .zip(&mut amounts)
        .map(|(found, amount)| {
            *amount = strength(found);
            let mut shares: Mixture =
                found.iter().map(|(name, strength)| (*name, (strength / *amount / STEP).round() as i32)).collect();
            shares.retain(|(_, share)| *share != 0);
            shares.sort_unstable();
            if shares.is_empty() {
                return UNTOUCHED;
            }
            *numbers.entry(shares).or_insert_with_key(|shares| {
                distinct.push(shares.clone());
                distinct.len() as u32 - 1
            })
        })
        .collect();

    let touch = |v: usize| {
        let (rows, weights) = (transfer.indices[v], transfer.weights[v]);
        let served = |j: usize| weights[j] != 0.0 && number_of[rows[j] as usize] != UNTOUCHED;
        let all: f32 = (0..4).filter(|j| served(*j)).map(|j| weights[j] * amounts[rows[j] as usize]).sum();
        if strengths[v] == 0.0 || all <= 0.0 {
            return None;
        }
        let slot = |j: usize| if served(j) { number_of[rows[j] as usize] } else { UNTOUCHED };
        let factor = |j: usize| {
            if served(j) { weights[j] * amounts[rows[j] as usize] * (strengths[v] / all) } else { 0.0 }
        };
        Some((v as u32, ([0, 1, 2, 3].map(slot), [0, 1, 2, 3].map(factor))))
    };
    let touched = (0..view.count()).into_par_iter().with_min_len(1 << 12).filter_map(touch);
    let (touched, (slots, weights)) = touched.unzip();

    let columns = transfer.gather.count();
    let make = |of: fn(&crate::transport::Sampled) -> Option<&SparseRows>, number: usize, row: &mut Row| {
        for ((k, number), share) in &distinct[number] {
            let Some(rows) = view.keys[*k as usize].sampled.and_then(of) else { continue };
            let norm = source.norms[*k as usize][*number as usize];
            row.add_scaled(Vec3::splat(*share as f32 * STEP / norm), &unpacked(rows, *number as usize));
        }
        row.truncate(settings.tolerance, settings.coefficients);
        Ok(())
    };
    let mixed = |of: fn(&crate::transport::Sampled) -> Option<&SparseRows>| {
        row::rows(columns, distinct.len(), || (), |number, (), row| make(of, number, row))
    };
    let scales = mixed(|sampled| Some(&sampled.scales))?;
    let has_offsets = view.keys.iter().any(|key| key.sampled.is_some_and(|sampled| sampled.offsets.is_some()));
    let offsets = if has_offsets { Some(mixed(|sampled| sampled.offsets.as_ref())?) } else { None };
    Ok(Rows { touched, slots, weights, scales, offsets })
}

/// Rows whose own sample has no edits serve samples that have: they take the mean of those.
fn serve(transfer: &Transfer, source: &Source, strengths: &[f32], mixtures: &mut [Vec<(RowOf, f32)>]) {
    let mut means: BTreeMap<u32, (BTreeMap<RowOf, f32>, f32)> = BTreeMap::new();
    let mut found = Vec::new();
    for (v, _) in strengths.iter().enumerate().filter(|(_, strength)| **strength != 0.0) {
        let stencil = transfer.indices[v].into_iter().zip(transfer.weights[v]);
        for (row, weight) in stencil.filter(|(row, weight)| *weight != 0.0 && mixtures[*row as usize].is_empty()) {
            source.at(v, &mut found);
            let (sums, total) = means.entry(row).or_default();
            found.iter().for_each(|(name, strength)| *sums.entry(*name).or_default() += strength * weight);
            *total += weight;
        }
    }
    for (row, (sums, total)) in means {
        mixtures[row as usize] = sums.into_iter().map(|(name, sum)| (name, sum / total)).collect();
    }
}

/// Three sparse rows, red, green and blue, as one.
fn unpacked(rows: &SparseRows, number: usize) -> Row {
    let mut all: BTreeMap<u32, Vec3> = BTreeMap::new();
    for channel in 0..3 {
        for (index, value) in rows.row(3 * number + channel) {
            all.entry(index as u32).or_default()[channel] = value;
        }
    }
    Row { coefficients: all.into_iter().collect() }
}
