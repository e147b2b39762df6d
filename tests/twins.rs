//! Both bodies of every kernel on the same inputs: seeded random ones and ugly ones (0, -0, denormals, 65504, infinity,
//! NaN, one element, sizes that are no multiple of 8 or 64), in one piece and in pages.
//!
//! Runs on any adapter, a software driver included, one test at a time; without one every test is reported as ignored
//! and a line says so.

#[path = "twins/caches.rs"]
mod caches;
#[path = "twins/masks.rs"]
mod masks;
#[path = "twins/ratios.rs"]
mod ratios;
#[path = "twins/rays.rs"]
mod rays;
#[path = "twins/shadows.rs"]
mod shadows;

use chiaro::device::{Array, Choice, Device};
use chiaro::kernels::colour_edits::{ColourEdit, Knot};
use chiaro::kernels::direct_light::{View, direct_light};
use chiaro::kernels::glossy_rows::{Lobe, glossy_rows};
use chiaro::kernels::hidden_rows::{Walk, hidden_rows};
use chiaro::kernels::primary_visibility::primary_visibility;
use chiaro::kernels::run_light::{Element, Face};
use chiaro::kernels::tone_map::Operator;
use chiaro::kernels::trace_rays::{RayRecord, trace_rays};
use chiaro::kernels::transfer_points::transfer_points;
use chiaro::kernels::transfer_rows::{Starts, transfer_rows};
use chiaro::kernels::{
    self, average_pyramid, blocked_rays, colour_edits, entry_ways, haar_encode, haar2d_encode, interpolate,
    path_product, run_light, scaled_product, sparse_product, surroundings, tone_map,
};
use chiaro::memo::NoMemo;
use chiaro::scene::{Camera, Geometry, Light, LightKind, Scene, SurfacePoint, builtin, light};
use chiaro::transport::gather::Gather;
use chiaro::transport::runs::{Runs, RunsBuilder};
use chiaro::transport::sparse::{EntryFormat, SparseRows};
use chiaro::transport::ways::Factors;
use chiaro::transport::{sampling, sides};
use glam::{Mat3, Vec3};
use libtest_mimic::{Arguments, Failed, Trial};
use std::sync::Arc;

/// The CPU, the GPU, and the GPU made to work in small pages.
struct Devices {
    gpu: Device,
    paged: Device,
}

type Outcome = Result<(), String>;
type Test = fn(&Devices) -> Outcome;

const TESTS: &[(&str, Test)] = &[
    ("average_pyramid", pyramids),
    ("blocked_rays", rays::blocked),
    ("cached_light", caches::cached),
    ("colour_edits", edits),
    ("direct_light", rays::lights),
    ("entry_ways", entry_ways_of_rows),
    ("glossy_rows", rays::gloss),
    ("haar2d_encode", squares),
    ("haar_encode", haar),
    ("hidden_rows", rays::behind),
    ("interpolate", interpolation),
    ("path_product", path_products),
    ("primary_visibility", rays::views),
    ("ratio_blur", ratios::blurs),
    ("ratio_warp", ratios::warps),
    ("run_light", runs_of_light),
    ("scaled_product", scaled),
    ("shadow_filter", shadows::filters),
    ("shadow_light", shadows::light),
    ("sparse_product", products),
    ("surroundings", rays::openness),
    ("tone_map", tones),
    ("trace_rays", rays::traced),
    ("transfer_points", rays::pairs),
    ("transfer_rows", rays::rows),
    ("visibility_masks", masks::masks),
];

fn main() {
    let mut arguments = Arguments::from_args();
    arguments.test_threads = Some(1);
    let devices = open().map(Arc::new);
    if let Err(why) = &devices {
        eprintln!("GPU: no adapter, {} tests skipped ({why})", TESTS.len() + 1);
    }
    let mut trials: Vec<Trial> = TESTS
        .iter()
        .map(|&(name, test)| {
            let devices = devices.clone();
            let ignored = devices.is_err();
            let run = move || test(&*devices.map_err(|error| error.to_string())?).map_err(Failed::from);
            Trial::test(name, run).with_ignored_flag(ignored)
        })
        .collect();
    let faulty = devices.clone();
    let run = move || faults(&*faulty.map_err(|error| error.to_string())?).map_err(Failed::from);
    trials.push(Trial::test("faults_are_errors", run).with_ignored_flag(devices.is_err()));
    trials.push(Trial::test("the_comparer_can_fail", || the_comparer_can_fail().map_err(Failed::from)));
    trials.push(Trial::test("every_kernel_is_compared", || every_kernel_is_compared().map_err(Failed::from)));
    libtest_mimic::run(&arguments, trials).exit();
}

fn open() -> Result<Devices, String> {
    let device = || Device::open(Choice::Gpu).map_err(|error| error.to_string());
    #[allow(unused_mut)]
    let mut devices = Devices { gpu: device()?, paged: device()? };
    #[cfg(feature = "gpu")]
    if let Device::Gpu(gpu) = &mut devices.paged {
        gpu.set_page_bytes(4096);
    }
    Ok(devices)
}

/// What wgpu reports by callback comes out as an error, and the device goes on working.
#[cfg(feature = "gpu")]
fn faults(devices: &Devices) -> Outcome {
    use chiaro::device::Kernel;
    let Device::Gpu(gpu) = &devices.gpu else { return Err("not a GPU".to_owned()) };
    let broken = Kernel { name: "broken", source: "fn broken() { nonsense }", ..tone_map::KERNEL };
    let mut batch = gpu.batch();
    let params = [0u32; 4];
    match batch.dispatch(&broken, &params, &[&gpu.upload(&[[0.0f32; 4]])], 1) {
        Err(error @ chiaro::Error::Device { .. }) if error.exit_code() == 4 => tones(devices),
        other => Err(format!("a shader that does not compile gave {other:?}")),
    }
}

#[cfg(not(feature = "gpu"))]
fn faults(_: &Devices) -> Outcome {
    Err("built without GPU support".to_owned())
}

fn every_kernel_is_compared() -> Outcome {
    let tested: Vec<_> = TESTS.iter().map(|(name, _)| *name).collect();
    let kernels: Vec<_> = kernels::ALL.iter().map(|kernel| kernel.name).collect();
    if tested == kernels { Ok(()) } else { Err(format!("kernels {kernels:?}, twin tests {tested:?}")) }
}

/// Arithmetic: absolute 1e-6, relative 1e-5.
const ARITHMETIC: (f32, f32) = (1e-6, 1e-5);

/// Runs a kernel on all devices and compares with the CPU.
fn compare(
    what: &str,
    devices: &Devices,
    (absolute, relative): (f32, f32),
    run: impl Fn(&Device) -> chiaro::Result<Vec<[f32; 4]>>,
) -> Outcome {
    let run = |device: &Device| run(device).map_err(|error| format!("{what}: {error}"));
    let cpu = run(&Device::Cpu)?;
    for (which, device) in [("GPU", &devices.gpu), ("GPU in pages", &devices.paged)] {
        same(&run(device)?, &cpu, absolute, relative).map_err(|found| format!("{what}, {which}: {found}"))?;
    }
    Ok(())
}

/// Equal within tolerance; NaN equals NaN, infinities equal themselves.
fn same(gpu: &[[f32; 4]], cpu: &[[f32; 4]], absolute: f32, relative: f32) -> Outcome {
    if gpu.len() != cpu.len() {
        return Err(format!("{} elements, CPU {}", gpu.len(), cpu.len()));
    }
    for (i, (gpu, cpu)) in gpu.iter().zip(cpu).enumerate() {
        for (c, (a, b)) in gpu.iter().zip(cpu).enumerate() {
            let close = a == b || (a.is_nan() && b.is_nan()) || (a - b).abs() <= absolute + relative * b.abs();
            if !close || (a.is_infinite() != b.is_infinite()) {
                return Err(format!("element {i}.{c} is {a:e}, CPU {b:e}"));
            }
        }
    }
    Ok(())
}

/// The share of elements that may differ: rays that pass an edge within rounding see another surface.
const EDGES: f32 = 2e-3;

/// Elements equal within tolerance, but for a few; `what` names the elements in messages.
fn nearly_all<T>(what: &str, gpu: &[T], cpu: &[T], same: impl Fn(&T, &T) -> bool) -> Outcome {
    if gpu.len() != cpu.len() {
        return Err(format!("{} {what}, CPU {}", gpu.len(), cpu.len()));
    }
    let differ = gpu.iter().zip(cpu).filter(|(gpu, cpu)| !same(gpu, cpu)).count();
    if differ as f32 > EDGES * cpu.len() as f32 {
        return Err(format!("{differ} of {} {what} differ", cpu.len()));
    }
    Ok(())
}

/// Transcendental: absolute 1e-5, relative 1e-4; infinities equal themselves.
fn close(a: &[f32], b: &[f32]) -> bool {
    a.iter().zip(b).all(|(a, b)| a == b || (a - b).abs() <= 1e-5 + 1e-4 * b.abs())
}

fn the_comparer_can_fail() -> Outcome {
    let many = vec![1.0f32; 1000];
    let mut spoilt = many.clone();
    spoilt[..3].fill(1.1);
    let equal = |a: &f32, b: &f32| close(&[*a], &[*b]);
    nearly_all("numbers", &many, &many, equal)?;
    if nearly_all("numbers", &spoilt, &many, equal).is_ok() || nearly_all("numbers", &many[1..], &many, equal).is_ok() {
        return Err("three wrong numbers of a thousand, or a missing one, passed".to_owned());
    }
    let good = Random(1).light(100);
    same(&good, &good, ARITHMETIC.0, ARITHMETIC.1)?;
    let spoil: [fn(f32) -> f32; 4] = [|x| x + 3e-5, |_| f32::NAN, |_| f32::INFINITY, |x| -x];
    for (i, spoil) in spoil.iter().enumerate() {
        let mut bad = good.clone();
        bad[57][2] = spoil(bad[57][2]);
        if same(&bad, &good, ARITHMETIC.0, ARITHMETIC.1).is_ok()
            || same(&good, &bad, ARITHMETIC.0, ARITHMETIC.1).is_ok()
        {
            return Err(format!("perturbation {i} passed"));
        }
    }
    if same(&good[1..], &good, 1.0, 1.0).is_ok() {
        return Err("a missing element passed".to_owned());
    }
    Ok(())
}

/// A small generator (xorshift), so that every run sees the same inputs.
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (((self.0 >> 32) * end as u64) >> 32) as usize
    }

    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        self.below(1 << 24) as f32 / (1 << 24) as f32
    }

    fn light(&mut self, count: usize) -> Vec<[f32; 4]> {
        (0..count).map(|_| std::array::from_fn(|_| 0.001 + 2.0 * self.unit())).collect()
    }

    /// Light with an ugly value in every seventh element.
    fn ugly(&mut self, count: usize, ugly: &[f32]) -> Vec<[f32; 4]> {
        let mut light = self.light(count);
        for value in light.iter_mut().step_by(7) {
            value[self.below(4)] = ugly[self.below(ugly.len())];
        }
        light
    }
}

/// Values that stay finite under sums of a few hundred.
const UGLY: [f32; 8] = [0.0, -0.0, 1e-40, -1e-40, f32::MIN_POSITIVE, 65504.0, -1.0, 1e-7];
const UGLIER: [f32; 6] = [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 0.0, -0.0, 65504.0];

fn haar(devices: &Devices) -> Outcome {
    let mut random = Random(11);
    for (length, count) in [(1, 1), (1, 3), (2, 1), (8, 5), (256, 1), (512, 3), (1 << 16, 1), (1 << 17, 2)] {
        for values in [random.light(length * count), random.ugly(length * count, &UGLY)] {
            // Averages of large values leave small ones that are off by the rounding of the large.
            let tolerance = if length > 1 { (65504.0 * 1e-6, 1e-5) } else { ARITHMETIC };
            compare(&format!("{length} x {count}"), devices, tolerance, |device| haar_encode(device, &values, count))?;
        }
        let values = random.light(length * count);
        compare(&format!("plain {length} x {count}"), devices, ARITHMETIC, |device| {
            haar_encode(device, &values, count)
        })?;
    }
    let values = random.ugly(64, &UGLIER);
    compare("infinities", devices, (65504.0 * 1e-6, 1e-5), |device| haar_encode(device, &values, 1))
}

fn squares(devices: &Devices) -> Outcome {
    let mut random = Random(23);
    for (side, count) in [(1, 1), (1, 3), (2, 1), (4, 5), (32, 3), (128, 1), (256, 2)] {
        for values in [random.light(side * side * count), random.ugly(side * side * count, &UGLY)] {
            let tolerance = if side > 1 { (65504.0 * 1e-6, 1e-5) } else { ARITHMETIC };
            compare(&format!("{side} x {side}, {count}"), devices, tolerance, |device| {
                haar2d_encode(device, &values, side, count)
            })?;
        }
        let values = random.light(side * side * count);
        compare(&format!("plain {side} x {side}, {count}"), devices, ARITHMETIC, |device| {
            haar2d_encode(device, &values, side, count)
        })?;
    }
    let values = random.ugly(64, &UGLIER);
    compare("infinities", devices, (65504.0 * 1e-6, 1e-5), |device| haar2d_encode(device, &values, 8, 1))
}

/// Integers: the same bits, whatever wraps on the way.
fn runs_of_light(devices: &Devices) -> Outcome {
    let mut random = Random(24);
    for (side, rows, most) in [(32, 1, 3), (64, 67, 40), (256, 1001, 300), (512, 130, 500), (128, 5, 16384)] {
        let mut tables = Vec::new();
        let mut faces: Vec<Runs> = Vec::new();
        for _ in 0..3 {
            let mut builder = RunsBuilder::new(side);
            for row in 0..rows {
                let count = if row % 4 == 1 { 0 } else { random.below(most) };
                let mut toggles: Vec<u32> = (0..count).map(|_| random.below(side * side) as u32).collect();
                toggles.sort_unstable();
                toggles.dedup();
                builder.push(&toggles).map_err(|error| error.to_string())?;
            }
            faces.push(builder.finish().map_err(|error| error.to_string())?);
            let element =
                |random: &mut Random| -> Element { std::array::from_fn(|_| random.below(1 << 32) as u32 as i32) };
            tables.push(Array::from((0..=side * side).map(|_| element(&mut random)).collect::<Vec<_>>()));
        }
        let faces: Vec<Face> = faces.iter().zip(&tables).map(|(runs, table)| Face { runs, table }).collect();
        for count in 0..=3 {
            let run = |device| run_light(device, &faces[..count], rows).map_err(|error| error.to_string());
            let cpu = run(&Device::Cpu)?;
            for (what, device) in [("GPU", &devices.gpu), ("GPU in pages", &devices.paged)] {
                if let Some(row) = run(device)?.iter().zip(&cpu).position(|(gpu, cpu)| gpu != cpu) {
                    return Err(format!("{what}: {rows} rows of {side}, {count} faces: row {row} differs"));
                }
            }
        }
    }
    Ok(())
}

fn pyramids(devices: &Devices) -> Outcome {
    let mut random = Random(12);
    for (length, count) in [(1, 1), (1, 3), (2, 1), (8, 5), (256, 1), (512, 3), (1 << 16, 1), (1 << 17, 2)] {
        for ugly in [&UGLY[..], &UGLIER] {
            let leaves = random.ugly(length * count, ugly);
            compare(&format!("{length} x {count}"), devices, ARITHMETIC, |device| {
                average_pyramid(device, &leaves, count)
            })?;
        }
    }
    Ok(())
}

fn products(devices: &Devices) -> Outcome {
    let mut random = Random(13);
    for (rows, index_bits, signed, most) in [
        (1, 1, true, 2),
        (1, 1, false, 1),
        (37, 3, false, 9),
        (300, 16, true, 200),
        (1001, 17, false, 90),
        (5, 10, true, 3000),
    ] {
        let format = EntryFormat::new(index_bits, signed).map_err(|error| error.to_string())?;
        let columns = format.columns();
        let lists: Vec<Vec<(u32, f32)>> = (0..rows)
            .map(|row| {
                // Some rows are empty; the weights of a row add up to about 1.
                let length = if row % 5 == 3 { 0 } else { 1 + random.below(most) };
                (0..length)
                    .map(|_| {
                        let sign = if signed && random.below(3) == 0 { -1.0 } else { 1.0 };
                        (random.below(columns) as u32, sign * random.unit() * 2.0 / length as f32)
                    })
                    .collect()
            })
            .collect();
        let matrix =
            SparseRows::from_rows(format, lists.iter().map(Vec::as_slice)).map_err(|error| error.to_string())?;
        for count in 1..=6 {
            let what = format!("{rows} rows, {index_bits} bits, {count} vectors");
            let vectors = random.light(columns * count);
            compare(&what, devices, ARITHMETIC, |device| sparse_product(device, &matrix, &vectors, count))?;
            let vectors = random.ugly(columns * count, &UGLIER);
            // Terms of 65504 cancel: what is left is off by their rounding.
            let tolerance = (65504.0 * 1e-6, 1e-5);
            compare(&what, devices, tolerance, |device| sparse_product(device, &matrix, &vectors, count))?;
        }
    }
    Ok(())
}

fn scaled(devices: &Devices) -> Outcome {
    let mut random = Random(19);
    let packed = |bits, signed, lists: Vec<Vec<(u32, f32)>>| {
        let format = EntryFormat::new(bits, signed).map_err(|error| error.to_string())?;
        SparseRows::from_rows(format, lists.iter().map(Vec::as_slice)).map_err(|error| error.to_string())
    };
    for (levels, rows, scales, most, signed) in
        [(1, 1, 1, 2, false), (3, 37, 5, 9, true), (12, 101, 40, 60, false), (16, 500, 30, 200, false)]
    {
        let transfer: Vec<Vec<(u32, f32)>> = (0..rows)
            .map(|row| {
                let length = if row % 5 == 3 { 0 } else { 1 + random.below(most) };
                (0..length).map(|_| (random.below(2 << levels) as u32, random.unit() / length as f32)).collect()
            })
            .collect();
        let haar: Vec<Vec<(u32, f32)>> = (0..3 * scales)
            .map(|_| {
                let length = random.below(most);
                (0..length)
                    .map(|_| {
                        // Of every level alike: up to 0.3 in the field.
                        let level = random.below(levels + 1);
                        let index = if level == 0 { 0 } else { (1 << (level - 1)) + random.below(1 << (level - 1)) };
                        let size = ((1 << levels) as f32 / (index as f32).max(1.0).log2().floor().exp2()).sqrt();
                        (index as u32, (random.unit() - 0.5) * 0.6 * size)
                    })
                    .collect()
            })
            .collect();
        let (transfer, haar) = (packed(levels as u32 + 1, signed, transfer)?, packed(levels as u32, true, haar)?);
        let pairs: Vec<[u32; 2]> = (0..3 * rows)
            .map(|p| {
                let scale = if random.below(4) == 0 { u32::MAX } else { (p * scales / (3 * rows)) as u32 };
                [random.below(rows) as u32, scale]
            })
            .collect();
        for count in 1..=5 {
            let what = format!("{rows} rows, {scales} scales, {levels} levels, {count} vectors");
            let vectors = random.light((2 * count) << levels);
            compare(&what, devices, ARITHMETIC, |device| {
                scaled_product(device, &transfer, &haar, &pairs, &vectors, count)
            })?;
        }
        let none: [[u32; 2]; 0] = [];
        compare("no pairs", devices, ARITHMETIC, |device| {
            scaled_product(device, &transfer, &haar, &none, &vec![[1.0; 4]; 2 << levels], 1)
        })?;
    }
    Ok(())
}

/// Rows of an unsigned format with places for their columns.
fn paths(random: &mut Random, rows: usize, index_bits: u32, most: usize) -> Result<SparseRows, String> {
    let format = EntryFormat::new(index_bits, false).map_err(|error| error.to_string())?;
    let lists: Vec<Vec<(u32, f32)>> = (0..rows)
        .map(|row| {
            let length = if row % 5 == 3 { 0 } else { 1 + random.below(most) };
            (0..length).map(|_| (random.below(format.columns()) as u32, random.unit() / length as f32)).collect()
        })
        .collect();
    SparseRows::from_rows(format, lists.iter().map(Vec::as_slice)).map_err(|error| error.to_string())
}

fn entry_ways_of_rows(devices: &Devices) -> Outcome {
    let mut random = Random(17);
    for (rows, index_bits, most) in [(1, 1, 2), (37, 3, 9), (300, 16, 200), (5, 10, 3000)] {
        let matrix = paths(&mut random, rows, index_bits, most)?;
        let mut points = random.ugly(rows, &[0.0, -0.0, 1e-20, 65504.0, -1.0]);
        points[0] = [0.0; 4];
        let mut places = random.ugly(matrix.columns(), &[0.0, -0.0, 1e-20, 65504.0, -1.0]);
        places[1] = [0.0; 4];
        let run = |device| entry_ways(device, &matrix, &points, &places).map_err(|error| error.to_string());
        let cpu = run(&Device::Cpu)?;
        for device in [&devices.gpu, &devices.paged] {
            // A code on the edge between two may fall to either side.
            let apart = |a: u32, b: u32, shift: u32, mask: u32| (a >> shift & mask).abs_diff(b >> shift & mask);
            nearly_all("ways", &run(device)?, &cpu, |&a, &b| {
                apart(a, b, 16, 0xffff) <= 1 && apart(a, b, 8, 255) <= 1 && apart(a, b, 0, 255) <= 1
            })?;
        }
    }
    Ok(())
}

fn path_products(devices: &Devices) -> Outcome {
    let mut random = Random(18);
    let mut factors = Factors::default();
    factors.by_distance(|d| (1.0 + d.min(1e3)).powf(-0.7));
    factors.by_direction(|v| 1.0 + 0.8 * v.x);
    for (rows, index_bits, most) in [(1, 1, 2), (37, 3, 9), (300, 16, 200), (5, 10, 3000)] {
        let matrix = paths(&mut random, rows, index_bits, most)?;
        let ways: Array<u32> =
            (0..matrix.entries().len()).map(|_| random.below(1 << 32) as u32).collect::<Vec<_>>().into();
        for vector in [random.light(matrix.columns()), random.ugly(matrix.columns(), &UGLY)] {
            // As for sparse products: terms of 65504 leave their rounding.
            compare(&format!("{rows} rows"), devices, (65504.0 * 1e-6, 1e-5), |device| {
                path_product(device, &matrix, &ways, &factors, &vector)
            })?;
        }
    }
    Ok(())
}

fn interpolation(devices: &Devices) -> Outcome {
    let mut random = Random(14);
    for (samples, rows, count) in [(0, 3, 1), (1, 1, 1), (63, 5, 1), (1000, 77, 3), (20_001, 3000, 4)] {
        let indices: Vec<[u32; 4]> = (0..samples).map(|_| std::array::from_fn(|_| random.below(rows) as u32)).collect();
        let weights: Vec<[f32; 4]> =
            (0..samples).map(|n| std::array::from_fn(|j| if j > n % 4 { 0.0 } else { random.unit() })).collect();
        let (indices, weights) = (Array::from(indices), Array::from(weights));
        for ugly in [&UGLY[..], &UGLIER] {
            let light = random.ugly(rows * count, ugly);
            compare(&format!("{samples} samples, {rows} rows"), devices, ARITHMETIC, |device| {
                interpolate(device, &indices, &weights, &light, count)
            })?;
        }
    }
    Ok(())
}

fn edits(devices: &Devices) -> Outcome {
    let mut random = Random(15);
    for (samples, count, length) in [(1, 1, 0), (1, 1, 1), (65, 3, 4), (1009, 40, 5), (5000, 8, 12)] {
        let list: Vec<ColourEdit> = (0..length)
            .map(|e| {
                let columns: [Vec3; 3] =
                    std::array::from_fn(|_| Vec3::from_array(std::array::from_fn(|_| random.unit())));
                let knot = |i| Knot::new(i as f32 * 0.7, random.unit(), 2.0 * random.unit() - 0.5);
                let curve = (0..e % 4).map(knot).collect();
                ColourEdit {
                    atoms: ColourEdit::mask((0..count).filter(|_| random.below(2) == 0)),
                    matrix: Mat3::from_cols_array_2d(&columns.map(|column| column.to_array())),
                    curve,
                    receiver: (e % 3 != 0)
                        .then(|| (0..samples).map(|n| [0.0, 1.0, random.unit()][n % 3]).collect::<Vec<_>>().into()),
                    gain: (e % 5 == 4).then(|| (0..samples).map(|_| 2.0 * random.unit()).collect::<Vec<_>>().into()),
                }
            })
            .collect();
        let what = format!("{samples} samples, {count} atoms, {length} edits");
        let run = |device: &Device, atoms: &[[f32; 4]]| {
            // The last of many atoms is dark.
            let mut atoms: Vec<&[[f32; 4]]> = atoms.chunks(samples).collect();
            if count > 3 {
                atoms[count - 1] = &[];
            }
            let edited = colour_edits(device, &atoms, samples, &list)?;
            let gains = edited.gains.concat().into_iter().map(|gain| [gain; 4]);
            Ok(edited.light.into_iter().chain(gains).collect())
        };
        let atoms = random.light(samples * count);
        compare(&what, devices, ARITHMETIC, |device| run(device, &atoms))?;
        let atoms = random.ugly(samples * count, &[0.0, -0.0, 1e-40, f32::MIN_POSITIVE, 65504.0]);
        compare(&what, devices, ARITHMETIC, |device| run(device, &atoms))?;
    }
    Ok(())
}

fn tones(devices: &Devices) -> Outcome {
    let mut random = Random(16);
    for count in [0, 1, 63, 64, 4097] {
        for operator in [Operator::None, Operator::Reinhard, Operator::Neutral] {
            for (exposure, white) in [(0.0, 4.0), (-3.5, 1.0), (2.25, f32::INFINITY)] {
                let pixels = random.ugly(count, &UGLY);
                compare(&format!("{operator:?}, {count} pixels"), devices, ARITHMETIC, |device| {
                    tone_map(device, &pixels, operator, exposure, white)
                })?;
            }
        }
    }
    Ok(())
}
