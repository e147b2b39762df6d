//! Properties of small functions, on any input.

use chiaro::device::Device;
use chiaro::kernels::colour_edits::{ColourEdit, colour_edits};
use chiaro::transport::atoms;
use chiaro::transport::sample_cells::{DEAD, cell};
use chiaro::transport::sparse::{EntryFormat, SparseRows};
use chiaro::transport::tone_curve::ToneCurve;
use glam::Mat3;
use proptest::collection::vec;
use proptest::prelude::*;

/// What grey light of these luminances becomes under a curve.
fn through(curve: &ToneCurve, luminances: &[f32]) -> Vec<f32> {
    let light: Vec<[f32; 4]> = luminances.iter().map(|&x| [x, x, x, 0.0]).collect();
    let edit = ColourEdit {
        atoms: ColourEdit::mask([0]),
        matrix: Mat3::IDENTITY,
        curve: curve.knots(),
        receiver: None,
        gain: None,
    };
    colour_edits(&Device::Cpu, &[&light], light.len(), &[edit]).unwrap().light.iter().map(|light| light[1]).collect()
}

/// Points of a curve that never falls: steps to the right and up.
fn rising() -> impl Strategy<Value = Vec<[f32; 2]>> {
    vec((0.001f32..10.0, 0.0f32..10.0), 2..12).prop_map(|steps| {
        let sum = |at: &mut [f32; 2], (x, y): (f32, f32)| {
            *at = [at[0] + x, at[1] + y];
            Some(*at)
        };
        steps.into_iter().scan([0.0, 0.0], sum).collect()
    })
}

fn weights(count: usize) -> impl Strategy<Value = Vec<f32>> {
    vec(prop_oneof![Just(0.0f32), Just(1.0), 0.0f32..=1.0], count)
}

proptest! {
    // A failing case is printed; nothing is written beside the sources.
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn monotone_points_make_a_monotone_curve(points in rising()) {
        let curve = ToneCurve::Points(points.clone());
        prop_assert!(curve.fault().is_none());
        let end = points.last().unwrap()[0] * 1.5;
        let luminances: Vec<f32> = (1..=2000).map(|i| end * i as f32 / 2000.0).collect();
        let mapped = through(&curve, &luminances);
        // Luminance is a rounded sum of three channels; the curve makes that error as much larger as it is steep.
        let steepest = points.windows(2).map(|p| (p[1][1] - p[0][1]) / (p[1][0] - p[0][0])).fold(0.0, f32::max);
        let rounding = |x: f32| 2.0 * steepest * x * f32::EPSILON;
        for (pair, x) in mapped.windows(2).zip(&luminances) {
            let slack = 1e-5 * pair[0].abs().max(1e-3) + rounding(*x);
            prop_assert!(pair[1] >= pair[0] - slack, "falls at {x}: {pair:?}");
        }
        for [x, y] in points {
            let found = through(&curve, &[x])[0];
            prop_assert!((found - y).abs() <= 1e-4 * y.max(1.0) + 3.0 * rounding(x), "({x}, {y}) becomes {found}");
        }
    }

    #[test]
    fn gamma_curves_are_powers(gamma in 0.1f32..10.0, pivot in 0.01f32..100.0) {
        let curve = ToneCurve::Gamma { gamma, pivot };
        let luminances: Vec<f32> = (-100..=100).map(|i| pivot * 10f32.powf(i as f32 * 0.029)).collect();
        let mapped = through(&curve, &luminances);
        for (x, y) in luminances.iter().zip(&mapped) {
            let expected = pivot * (x / pivot).powf(1.0 / gamma);
            // The edited light is a sum with what it was: what is far below that loses its last bits.
            let tolerance = 2e-4 * expected + 2e-7 * x;
            prop_assert!((y - expected).abs() <= tolerance, "{x} becomes {y}, not {expected}");
        }
        prop_assert!((through(&curve, &[pivot])[0] - pivot).abs() <= 1e-5 * pivot);
    }

    #[test]
    fn entries_survive_packing(
        bits in 1u32..=24,
        signed: bool,
        row in vec((any::<u32>(), -1.0f32..1.0), 0..40),
        scale in -30i32..30,
    ) {
        let format = EntryFormat::new(bits, signed).unwrap();
        let row: Vec<(u32, f32)> = row
            .into_iter()
            .map(|(column, w)| (column % format.columns() as u32, (if signed { w } else { w.abs() }) * 2f32.powi(scale)))
            .collect();
        let packed = SparseRows::from_rows(format, [&row[..]]).unwrap();
        let largest = row.iter().map(|(_, w)| w.abs()).fold(0.0, f32::max);
        // Half a step of the fixed point (a whole one where rounding is handed on), and the last bit of scale and product.
        let steps = if signed { 0.5 } else { 1.0 };
        let step = largest * (steps / format.max_weight() as f32 + 1e-6);
        if !signed {
            let sum = |weights: &mut dyn Iterator<Item = f32>| weights.map(f64::from).sum::<f64>();
            let (kept, whole) = (sum(&mut packed.row(0).map(|e| e.1)), sum(&mut row.iter().map(|e| e.1)));
            let rounding = 1e-6 * whole;
            prop_assert!((kept - whole).abs() <= f64::from(step) + rounding, "the row's sum was {whole}, now {kept}");
        }
        let mut found = packed.row(0).peekable();
        for &(column, weight) in &row {
            // Weights that round to nothing are left out.
            let kept = match found.peek() {
                Some(&(c, w)) if c == column as usize && (w - weight).abs() <= step => found.next().map(|(_, w)| w),
                _ => None,
            };
            prop_assert!((kept.unwrap_or(0.0) - weight).abs() <= step, "{weight} at {column} of {format:?} is {kept:?}");
        }
        prop_assert!(found.next().is_none(), "an entry that nobody packed");
    }

    #[test]
    fn a_point_lies_in_its_cell(k in 1u32..200, a in 0.0f32..=1.0, b in 0.0f32..=1.0) {
        let (u, v) = if a + b <= 1.0 { (a, b) } else { (1.0 - a, 1.0 - b) };
        let index = cell(&[[0, DEAD, k, 0]], 0, [u, v], true).unwrap() as u32;
        prop_assert!(index < k * k);
        // Back from the index: row i holds 2 (k - i) - 1 cells, up and down by turns.
        let i = (0..k).take_while(|i| i * (2 * k - i) <= index).last().unwrap();
        let within = index - i * (2 * k - i);
        let (j, upper) = (within / 2, within % 2 == 1);
        let (x, y) = (u * k as f32 - i as f32, v * k as f32 - j as f32);
        let slack = 1e-4 * k as f32;
        let inside = |x: f32| (-slack..=1.0 + slack).contains(&x);
        let side = if upper { x + y >= 1.0 - slack } else { x + y <= 1.0 + slack };
        prop_assert!(inside(x) && inside(y) && side, "({u}, {v}) of {k}: cell ({i}, {j}, {upper})");
    }

    #[test]
    fn atoms_share_out_all_light((casters, count) in (1usize..20).prop_flat_map(|n| (vec(weights(n), 0..6), Just(n)))) {
        let atoms = atoms::split(count, &casters).unwrap();
        prop_assert_eq!(atoms.members.len(), casters.len());
        for sample in 0..count {
            let total: f32 = atoms.shares.iter().map(|shares| shares[sample]).sum();
            prop_assert!((total - 1.0).abs() < 1e-5, "sample {} has {} of its light", sample, total);
            prop_assert!(atoms.shares.iter().all(|shares| shares[sample] >= 0.0));
            for (caster, members) in casters.iter().zip(&atoms.members) {
                let inside: f32 = members.iter().map(|&atom| atoms.shares[atom][sample]).sum();
                prop_assert!((inside - caster[sample]).abs() < 1e-5, "{} in a caster of {}", inside, caster[sample]);
            }
        }
    }
}
