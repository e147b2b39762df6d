//! Per-sample colour edits of light that is kept apart by where it comes from (thesis Algorithm 4, made stackable).
//!
//! The light of a sample comes as atoms: A parts (one for each set of casters that edits tell apart) that add up to the
//! whole. Edits apply in order, each to the sum of the atoms in its mask. With x that sum, M its colour matrix and L
//! the Rec.709 luminance:
//!
//! ```text
//! gain = curve(L(M x)) / L(M x)             (1 without a curve, and where L(M x) is not above 1e-20)
//! atom = atom + (gain M atom - atom) w       (for each atom in the mask; w: receiver weight of the sample in [0, 1])
//! ```
//!
//! so a curve acts on what the edits before it left, and light outside the mask keeps every bit, as does a sample of
//! weight 0. The result is the sum of all atoms, in order. The fourth element of an atom is not light: the result's is
//! 0. Inputs are finite.
//!
//! Gains may be given instead of a curve, and are told: a reflection is changed by the gain that the sample's irradiance
//! asks for.

#[cfg(feature = "gpu")]
use super::pages;
#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::kernel::uniform;
use crate::device::{Array, Binding, Device, Kernel};
use crate::{Error, Result};
use glam::{Mat3, Vec3};
use rayon::prelude::*;

/// Samples that one task edits.
const BLOCK: usize = 1024;
/// Luminance up to which there is no light to scale.
const DARK: f32 = 1e-20;
/// Rec.709.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);
/// In `PackedEdit`: no such row. The edit applies everywhere; no gains are given.
#[cfg(feature = "gpu")]
const NONE: u32 = u32::MAX;

/// A knot of a tone curve on luminance.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Knot {
    /// Luminance in; knots are in rising order of x.
    pub x: f32,
    /// Luminance out.
    pub y: f32,
    /// dy/dx at the knot.
    pub slope: f32,
    pub pad: f32,
}

impl Knot {
    pub fn new(x: f32, y: f32, slope: f32) -> Self {
        Self { x, y, slope, pad: 0.0 }
    }
}

/// One edit of the list.
#[derive(Clone, Debug)]
pub struct ColourEdit {
    /// Bit a % 32 of word a / 32: the edit acts on atom a. Missing words are zero.
    pub atoms: Vec<u32>,
    /// Applied to linear Rec.709 column vectors.
    pub matrix: Mat3,
    /// Cubic Hermite pieces between knots, continued as straight lines beyond the ends, and never below 0. Empty: none.
    pub curve: Vec<Knot>,
    /// Weight of each sample, in [0, 1]; `None` is 1 everywhere.
    pub receiver: Option<Array<f32>>,
    /// Gain of each sample, instead of the curve's.
    pub gain: Option<Array<f32>>,
}

/// What edits made of N samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Edited {
    /// N sums of the atoms.
    pub light: Vec<[f32; 4]>,
    /// Of each edit with a curve of its own, in order: N gains; 1 where its weight is 0.
    pub gains: Vec<Vec<f32>>,
}

impl ColourEdit {
    /// It has a curve of its own, so its gains are told.
    pub fn tells(&self) -> bool {
        self.gain.is_none() && !self.curve.is_empty()
    }

    /// The mask of the listed atoms.
    pub fn mask(atoms: impl IntoIterator<Item = usize>) -> Vec<u32> {
        let mut words = Vec::new();
        for atom in atoms {
            words.resize(words.len().max(atom / 32 + 1), 0);
            words[atom / 32] |= 1 << (atom % 32);
        }
        words
    }
}

uniform! {
    struct Params {
        samples: u32,
        atoms: u32,
        edits: u32,
        mask_words: u32,
    }
}

/// An edit as the shader sees it.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct PackedEdit {
    /// Columns of the matrix, each with one element of padding.
    matrix: [[f32; 4]; 3],
    first_knot: u32,
    knots: u32,
    /// Row of `given` with the weights, or `NONE`.
    receiver: u32,
    /// Row of `given` with the gains, or `NONE`.
    gain: u32,
    /// Row of `gains` to write, or `NONE`.
    told: u32,
    pad: [u32; 3],
}

pub const KERNEL: Kernel = Kernel {
    name: "colour_edits",
    shared: &[include_str!("../../shaders/shared/grid.wgsl")],
    source: include_str!("../../shaders/colour_edits.wgsl"),
    workgroup: [64, 1, 1],
    uniform: Params::UNIFORM,
    bindings: &[
        Binding::read::<PackedEdit>("edits"),
        Binding::read::<u32>("masks"),
        Binding::read::<Knot>("knots"),
        Binding::read::<f32>("given"),
        Binding::write::<[f32; 4]>("atoms"),
        Binding::write::<[f32; 4]>("totals"),
        Binding::write::<f32>("gains"),
    ],
};

/// Edits atoms of light at N samples and adds them up. An atom has N elements, or none: it is dark.
///
/// `Error::Compute` when a receiver has not N weights, a curve's knots do not rise, or a mask names an atom that is not
/// there.
pub fn colour_edits(device: &Device, atoms: &[&[[f32; 4]]], samples: usize, edits: &[ColourEdit]) -> Result<Edited> {
    let count = atoms.len();
    if let Some(atom) = atoms.iter().find(|atom| !atom.is_empty() && atom.len() != samples) {
        return Err(Error::compute(
            format!("colour_edits: an atom of {} elements for {samples} samples", atom.len()),
            "this is a fault of the node that called the kernel; please report it",
        ));
    }
    for (number, edit) in edits.iter().enumerate() {
        check(edit, samples, count).map_err(|what| {
            Error::compute(format!("colour_edits: edit {}: {what}", number + 1), "correct the edit node")
        })?;
    }
    match device {
        Device::Cpu => Ok(cpu(atoms, samples, edits)),
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => self::gpu(gpu, atoms, samples, edits),
    }
}

fn check(edit: &ColourEdit, samples: usize, count: usize) -> std::result::Result<(), String> {
    let beyond = (count..32 * edit.atoms.len()).find(|&atom| in_mask(&edit.atoms, atom));
    if let Some(atom) = beyond {
        return Err(format!("it names atom {atom} of {count}"));
    }
    for (what, list) in [("receiver weights", &edit.receiver), ("gains", &edit.gain)] {
        if let Some(list) = list.as_ref().filter(|list| list.len() != samples) {
            return Err(format!("{} {what} for {samples} samples", list.len()));
        }
    }
    if edit.curve.iter().any(|knot| !(knot.x.is_finite() && knot.y.is_finite() && knot.slope.is_finite())) {
        return Err("a knot of its curve is not finite".to_owned());
    }
    if let Some(at) = edit.curve.windows(2).position(|pair| pair[0].x >= pair[1].x) {
        return Err(format!(
            "knot {} of its curve, at {}, is not right of the one before",
            at + 2,
            edit.curve[at + 1].x
        ));
    }
    Ok(())
}

fn cpu(atoms: &[&[[f32; 4]]], samples: usize, edits: &[ColourEdit]) -> Edited {
    let count = atoms.len();
    let mut light: Vec<[f32; 4]> = rayon::iter::repeat_n([0.0; 4], samples).with_min_len(BLOCK).collect();
    // The gains of a sample side by side while they are made.
    let told = edits.iter().filter(|edit| edit.tells()).count();
    let edits: Vec<Listed> = edits.iter().map(|edit| Listed::new(edit, count)).collect();
    let mut gains = vec![1.0; samples * told];
    let chunks = light.par_chunks_mut(BLOCK).zip(match told {
        0 => (0..samples.div_ceil(BLOCK)).map(|_| &mut [][..]).collect::<Vec<&mut [f32]>>(),
        _ => gains.chunks_mut(BLOCK * told).collect(),
    });
    chunks.enumerate().for_each(|(block, (totals, gains))| {
        let mut parts = vec![Vec3::ZERO; count];
        for (i, total) in totals.iter_mut().enumerate() {
            let n = block * BLOCK + i;
            for (part, atom) in parts.iter_mut().zip(atoms) {
                *part = atom.get(n).map_or(Vec3::ZERO, |&[r, g, b, _]| Vec3::new(r, g, b));
            }
            let mut tell = gains[i * told..][..told].iter_mut();
            for edit in &edits {
                let gain = apply(edit, n, &mut parts);
                if edit.edit.tells() {
                    *tell.next().expect("one for each that tells") = gain;
                }
            }
            let sum = parts.iter().fold(Vec3::ZERO, |sum, &part| sum + part);
            *total = sum.extend(0.0).to_array();
        }
    });
    let gains = match told {
        1 => vec![gains],
        _ => (0..told).into_par_iter().map(|e| gains.iter().skip(e).step_by(told).copied().collect()).collect(),
    };
    Edited { light, gains }
}

#[cfg(feature = "gpu")]
fn gpu<'a>(gpu: &Gpu, atoms: &[&[[f32; 4]]], samples: usize, edits: &'a [ColourEdit]) -> Result<Edited> {
    let count = atoms.len();
    let mask_words = count.div_ceil(32);
    let (mut packed, mut masks, mut knots) = (Vec::new(), Vec::new(), Vec::new());
    let mut given: Vec<&Array<f32>> = Vec::new();
    let mut told = 0;
    for edit in edits {
        let mut give = |list: &'a Option<Array<f32>>| {
            let row = if list.is_some() { given.len() as u32 } else { NONE };
            given.extend(list);
            row
        };
        let (receiver, gain) = (give(&edit.receiver), give(&edit.gain));
        let tells = edit.tells().then(|| {
            told += 1;
            told - 1
        });
        let matrix = [edit.matrix.x_axis, edit.matrix.y_axis, edit.matrix.z_axis].map(|c| c.extend(0.0).to_array());
        let (first_knot, count) = (knots.len() as u32, edit.curve.len() as u32);
        let tells = tells.unwrap_or(NONE);
        packed.push(PackedEdit { matrix, first_knot, knots: count, receiver, gain, told: tells, pad: [0; 3] });
        masks.extend((0..mask_words).map(|word| edit.atoms.get(word).copied().unwrap_or(0)));
        knots.extend_from_slice(&edit.curve);
    }
    let (packed, masks, knots) = (gpu.upload(&packed), gpu.upload(&masks), gpu.upload(&knots));
    let mut edited = Edited { light: Vec::with_capacity(samples), gains: vec![Vec::new(); told as usize] };
    for range in pages(samples, gpu.page((16 * count).max(4 * given.len()).max(4 * told as usize))) {
        let params = Params {
            samples: range.len() as u32,
            atoms: count as u32,
            edits: edits.len() as u32,
            mask_words: mask_words as u32,
        };
        let dark = vec![[0.0; 4]; if atoms.iter().any(|atom| atom.is_empty()) { range.len() } else { 0 }];
        let light = gpu.upload_parts(atoms.iter().map(|atom| atom.get(range.clone()).unwrap_or(&dark)));
        let lists = gpu.upload_parts(given.iter().map(|list| &list[range.clone()]));
        let totals = gpu.storage::<[f32; 4]>(range.len());
        let gains = gpu.storage::<f32>(range.len() * told as usize);
        let mut batch = gpu.batch();
        let buffers = [&packed, &masks, &knots, &lists, &light, &totals, &gains];
        batch.dispatch(&KERNEL, &params, &buffers, range.len().div_ceil(64))?;
        let [page, gains] = batch.read([&totals, &gains])?;
        edited.light.extend_from_slice(page.get());
        let parts = gains.get::<f32>().chunks_exact(range.len());
        edited.gains.iter_mut().zip(parts).for_each(|(all, part)| all.extend_from_slice(part));
    }
    Ok(edited)
}

/// An edit with its mask as a list.
struct Listed<'a> {
    edit: &'a ColourEdit,
    atoms: Vec<usize>,
}

impl<'a> Listed<'a> {
    fn new(edit: &'a ColourEdit, count: usize) -> Self {
        Self { edit, atoms: (0..count).filter(|&atom| in_mask(&edit.atoms, atom)).collect() }
    }
}

/// Edits the atoms of one sample; the gain that the curve asked for.
fn apply(Listed { edit, atoms }: &Listed, n: usize, light: &mut [Vec3]) -> f32 {
    let weight = edit.receiver.as_ref().map_or(1.0, |receiver| receiver[n]);
    if weight == 0.0 {
        return 1.0;
    }
    let mut gain = 1.0;
    if let Some(given) = &edit.gain {
        gain = given[n];
    } else if !edit.curve.is_empty() {
        let sum = atoms.iter().fold(Vec3::ZERO, |sum, &atom| sum + light[atom]);
        let luminance = (edit.matrix * sum).dot(LUMINANCE);
        if luminance > DARK {
            gain = evaluate(&edit.curve, luminance) / luminance;
        }
    }
    for &atom in atoms {
        let edited = edit.matrix * light[atom] * gain;
        light[atom] += (edited - light[atom]) * weight;
    }
    gain
}

fn in_mask(words: &[u32], atom: usize) -> bool {
    words.get(atom / 32).is_some_and(|word| word >> (atom % 32) & 1 == 1)
}

/// The curve at `x`; at least one knot.
pub fn evaluate(curve: &[Knot], x: f32) -> f32 {
    let (first, last) = (curve[0], curve[curve.len() - 1]);
    let y = if x <= first.x {
        first.y + (x - first.x) * first.slope
    } else if x >= last.x {
        last.y + (x - last.x) * last.slope
    } else {
        // The last knot at or before x.
        let (mut i, mut end) = (0, curve.len() - 1);
        while end - i > 1 {
            let middle = (i + end) / 2;
            if curve[middle].x <= x { i = middle } else { end = middle }
        }
        hermite(curve[i], curve[i + 1], x)
    };
    y.max(0.0)
}

fn hermite(a: Knot, b: Knot, x: f32) -> f32 {
    let width = b.x - a.x;
    let t = (x - a.x) / width;
    let u = 1.0 - t;
    a.y * (1.0 + 2.0 * t) * u * u + a.slope * width * t * u * u + b.y * (3.0 - 2.0 * t) * t * t
        - b.slope * width * u * t * t
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With the atoms one after another.
    fn edited(atoms: &[[f32; 4]], count: usize, edits: &[ColourEdit]) -> Result<Edited> {
        let samples = atoms.len() / count;
        colour_edits(&Device::Cpu, &atoms.chunks(samples).collect::<Vec<_>>(), samples, edits)
    }

    fn edit(atoms: impl IntoIterator<Item = usize>, matrix: Mat3) -> ColourEdit {
        ColourEdit { atoms: ColourEdit::mask(atoms), matrix, curve: Vec::new(), receiver: None, gain: None }
    }

    fn double() -> Mat3 {
        Mat3::from_diagonal(Vec3::splat(2.0))
    }

    #[test]
    fn edits_stack_in_order_and_only_on_their_atoms() {
        // Two samples, two atoms. The first is doubled, then both lose their green at the second sample by half.
        let atoms = [[1.0, 2.0, 3.0, 9.0], [0.0, 4.0, 0.0, 9.0], [0.5, 0.5, 0.5, 9.0], [0.0, 2.0, 1.0, 9.0]];
        let mut no_green = edit([0, 1], Mat3::from_diagonal(Vec3::new(1.0, 0.0, 1.0)));
        no_green.receiver = Some(vec![0.0, 0.5].into());
        let out = edited(&atoms, 2, &[edit([0], double()), no_green]).unwrap();
        assert_eq!(out.light, [[2.5, 4.5, 6.5, 0.0], [0.0, 5.0, 1.0, 0.0]]);
    }

    #[test]
    fn a_curve_is_a_gain_on_the_luminance_of_the_sum() {
        let mut curved = edit([0, 40], double());
        curved.curve = vec![Knot::new(1.0, 1.0, 0.0), Knot::new(3.0, 2.0, 0.5)];
        let mut atoms = vec![[0.0; 4]; 41];
        (atoms[0], atoms[7], atoms[40]) = ([1.0, 1.0, 1.0, 0.0], [5.0; 4], [0.5, 0.5, 0.5, 0.0]);
        // Luminance 2 * 1.5 = 3 -> 2; then 2 * 3 = 6 -> 2 + 3 * 0.5 = 3.5; atom 7 is left alone.
        let out = edited(&atoms, 41, &[curved.clone()]).unwrap();
        assert!((out.light[0][0] - 7.0).abs() < 1e-5, "{out:?}");
        let out = edited(&atoms, 41, &[edit([0, 40], double()), curved.clone()]).unwrap();
        assert!((out.light[0][1] - 8.5).abs() < 1e-5, "{out:?}");
        let dark = edited(&[[0.0; 4]; 41], 41, &[curved]).unwrap();
        assert_eq!(dark.light, [[0.0; 4]], "no light, nothing to scale");
    }

    #[test]
    fn gains_are_told_and_can_be_given() {
        let atoms = [[1.0, 1.0, 1.0, 0.0], [4.0, 4.0, 4.0, 0.0], [9.0, 9.0, 9.0, 0.0]];
        let mut curved = edit([0], double());
        curved.curve = vec![Knot::new(2.0, 1.0, 0.0)];
        curved.receiver = Some(vec![1.0, 1.0, 0.0].into());
        let list = [edit([0], double()), curved];
        let first = edited(&atoms, 1, &list).unwrap();
        assert_eq!(first.gains, [[1.0 / 4.0, 1.0 / 16.0, 1.0]]);
        let mut given = list.clone();
        given[1].gain = Some(first.gains[0].clone().into());
        let again = edited(&atoms, 1, &given).unwrap();
        assert_eq!((again.light, again.gains.len()), (first.light, 0));
    }

    #[test]
    fn curve_pieces() {
        let curve = [Knot::new(0.0, 0.0, 1.0), Knot::new(1.0, 1.0, 1.0), Knot::new(2.0, 0.0, -1.0)];
        for (x, y) in [(0.0, 0.0), (0.25, 0.25), (0.5, 0.5), (1.0, 1.0), (1.5, 0.75), (2.0, 0.0), (3.0, 0.0)] {
            assert!((evaluate(&curve, x) - y).abs() < 1e-6, "{x}: {}", evaluate(&curve, x));
        }
        assert_eq!(evaluate(&curve[..1], 5.0), 5.0, "one knot is a straight line");
    }

    #[test]
    fn outside_the_receiver_no_bit_changes() {
        let atoms = [[0.1, f32::MIN_POSITIVE, 65504.0, 0.0], [0.3, 1e-30, -1.0, 0.0]];
        let mut none = edit([0, 1], double());
        none.receiver = Some(vec![0.0].into());
        let out = edited(&atoms, 2, &[none]).unwrap();
        assert_eq!(out, edited(&atoms, 2, &[]).unwrap());
    }

    #[test]
    fn bad_edits_are_refused() {
        let atoms = [[1.0; 4]; 4];
        let mut short = edit([0], double());
        short.receiver = Some(vec![1.0; 3].into());
        let mut falling = edit([0], double());
        falling.curve = vec![Knot::new(1.0, 0.0, 0.0), Knot::new(1.0, 1.0, 0.0)];
        let mut infinite = edit([0], double());
        infinite.curve = vec![Knot::new(0.0, f32::INFINITY, 0.0)];
        for bad in [edit([2], double()), short, falling, infinite] {
            assert!(edited(&atoms, 2, &[bad]).is_err());
        }
    }
}
