//! Golden pictures: every recipe in `graphs/edits` is rendered and held against `tests/golden/NAME.exr`, texel by texel,
//! all layers that it writes. A recipe without a golden fails, a golden without a recipe too.
//!
//! `CHIARO_BLESS=1 cargo test --release --test golden` makes the goldens anew, on the CPU: look at them, then commit.
//! Where there is a GPU adapter, a software driver included, every recipe is also rendered there.

#[path = "support/texels.rs"]
mod texels;

use chiaro::device::{Choice, Device};
use chiaro::eval::{Context, Evaluator, Options};
use chiaro::graph::{self, Plan};
use chiaro::image::exr_write::{self, Depth};
use chiaro::image::{Image, load};
use chiaro::nodes;
use chiaro::progress::Silent;
use libtest_mimic::{Arguments, Failed, Trial};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use texels::{Tolerance, faults};

/// The CPU's bodies give every bit again for any number of threads; what is left to differ between machines is the last
/// bit of the platform's sine, power and the like. Measured with those of a processor without fused multiply-add: not
/// a bit differs.
const CPU: Tolerance = Tolerance { absolute: 1e-5, relative: 1e-4, outliers: 0.0 };

/// On the GPU a ray that meets an edge may take its other side, which changes one row of a few hundred rays and all
/// texels that are interpolated from it. Measured on llvmpipe: one recipe has 7 texels off of 3,072 (0.2 %), all others
/// none.
const GPU: Tolerance = Tolerance { outliers: 0.01, ..CPU };

type Outcome = Result<(), String>;

fn main() {
    let mut arguments = Arguments::from_args();
    // Each test takes all threads by itself.
    arguments.test_threads = Some(1);
    let bless = std::env::var_os("CHIARO_BLESS").is_some_and(|value| value != "0" && !value.is_empty());
    let (recipes, goldens) = (stems("graphs/edits", "json"), stems("tests/golden", "exr"));
    let gpu = Device::open(Choice::Gpu).map(|device| Arc::new(Evaluator::new(Options::new(device))));
    match &gpu {
        Err(error) => eprintln!("GPU: no adapter, {} goldens skipped ({error})", recipes.len()),
        Ok(_) if bless => eprintln!("GPU: {} goldens skipped, they are made on the CPU", recipes.len()),
        Ok(_) => {}
    }
    let mut trials = vec![Trial::test("every_golden_has_a_recipe", {
        let recipes = recipes.clone();
        move || every_golden_has_a_recipe(&recipes, &goldens).map_err(Failed::from)
    })];
    for name in recipes {
        let (on_gpu, gpu) = (name.clone(), gpu.as_ref().ok().cloned());
        let skipped = gpu.is_none() || bless;
        trials.push(Trial::test(format!("cpu::{name}"), move || on_cpu(&name, bless).map_err(Failed::from)));
        let run = move || {
            let evaluator = gpu.ok_or("no adapter")?;
            compare(&on_gpu, &render(&on_gpu, &evaluator)?, GPU).map_err(Failed::from)
        };
        let name = trials.last().expect("just pushed").name().replace("cpu::", "gpu::");
        trials.push(Trial::test(name, run).with_ignored_flag(skipped));
    }
    // Last: it looks at a golden that may just have been made.
    trials.push(Trial::test("the_comparer_can_fail", || the_comparer_can_fail().map_err(Failed::from)));
    libtest_mimic::run(&arguments, trials).exit();
}

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Names, without their extension, of the files of one kind in a folder; sorted.
fn stems(folder: &str, extension: &str) -> Vec<String> {
    let files = std::fs::read_dir(root(folder)).unwrap_or_else(|error| panic!("{folder}: {error}"));
    let paths = files.map(|file| file.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == extension));
    let mut stems: Vec<String> = paths.map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned()).collect();
    stems.sort();
    stems
}

fn golden(name: &str) -> PathBuf {
    root("tests/golden").join(name).with_extension("exr")
}

fn every_golden_has_a_recipe(recipes: &[String], goldens: &[String]) -> Outcome {
    let orphans: Vec<&String> = goldens.iter().filter(|golden| !recipes.contains(golden)).collect();
    match (orphans.is_empty(), recipes.is_empty()) {
        (true, false) => Ok(()),
        (_, true) => Err("no recipe in graphs/edits".to_owned()),
        (false, _) => Err(format!("no recipe in graphs/edits for {orphans:?}: take the golden out")),
    }
}

/// A fresh evaluator without a cache on disk: everything is computed.
fn on_cpu(name: &str, bless: bool) -> Outcome {
    let image = render(name, &Evaluator::new(Options::new(Device::Cpu)))?;
    if !bless {
        return compare(name, &image, CPU);
    }
    if let Some(layer) = image.layers.iter().find(|layer| !layer.data.iter().all(|x| x.is_finite())) {
        return Err(format!("not blessed: layer {} holds what is not finite", layer.title()));
    }
    // Pixels alone: the recipe in the header would make every golden anew for a change of its layout.
    let image = Image { metadata: Vec::new(), ..image };
    exr_write::write(&golden(name), &image, Depth::Float, &[]).map_err(|error| error.to_string())?;
    eprintln!("BLESSED {}: look at it before you commit it", golden(name).display());
    Ok(())
}

/// What a recipe writes, as it reads back: the whole way from the text to the file.
fn render(name: &str, evaluator: &Evaluator) -> Result<Image, String> {
    let said = |error: chiaro::Error| format!("{name}: {error}");
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let document = graph::load(&root("graphs/edits").join(name).with_extension("json")).map_err(said)?;
    let plan = Plan::new(&document, nodes::ALL).map_err(said)?;
    let targets = plan.targets(&[]).map_err(said)?;
    let never = AtomicBool::new(false);
    let context = Context { out: Some(folder.path()), sink: &Silent, cancel: &never, ..Context::SILENT };
    evaluator.evaluate(&plan, &targets, plan.frames[0], &context, &mut Vec::new()).map_err(said)?;
    load::load(&folder.path().join(name).with_extension("exr"), None).map_err(said)
}

fn compare(name: &str, image: &Image, tolerance: Tolerance) -> Outcome {
    let path = golden(name);
    if !path.exists() {
        let path = path.display();
        return Err(format!("{path} is missing: make it with CHIARO_BLESS=1 and look at it"));
    }
    let expected = load::load(&path, None).map_err(|error| error.to_string())?;
    let found = faults(image, &expected, tolerance);
    if found.is_empty() { Ok(()) } else { Err(format!("{name}: {}", found.join("\n"))) }
}

fn the_comparer_can_fail() -> Outcome {
    let good = load::load(&golden("relight"), None).map_err(|error| error.to_string())?;
    let strict = |a: &Image, b: &Image| faults(a, b, CPU).len();
    if good.layers.len() != 7 || strict(&good, &good) != 0 {
        return Err("a picture is not itself".to_owned());
    }
    let spoil: [fn(f32) -> f32; 4] = [|x| x * 1.0003 + 3e-5, |_| f32::NAN, |_| f32::INFINITY, |x| -x - 1e-3];
    for at in 0..good.layers.len() {
        for (which, spoil) in spoil.iter().enumerate() {
            let mut bad = good.clone();
            let mut data = bad.layers[at].data.to_vec();
            let texel = data.len() / 2;
            data[texel] = spoil(data[texel]);
            bad.layers[at] = bad.layers[at].with_data(data);
            if strict(&bad, &good) != 1 || strict(&good, &bad) != 1 {
                return Err(format!("perturbation {which} of layer {} passed", good.layers[at].title()));
            }
        }
        let mut bad = good.clone();
        bad.layers.remove(at);
        if strict(&bad, &good) != 1 || strict(&good, &bad) != 1 {
            return Err("a missing layer passed".to_owned());
        }
    }
    // Outliers are counted, and never excuse what is not finite.
    let few = Tolerance { outliers: 1.5 / (64.0 * 48.0), ..CPU };
    let with = |values: &[(usize, f32)]| {
        let mut bad = good.clone();
        let mut data = bad.layers[2].data.to_vec();
        values.iter().for_each(|&(at, value)| data[at] = value);
        bad.layers[2] = bad.layers[2].with_data(data);
        faults(&bad, &good, few).len()
    };
    let found = [with(&[(0, 9.0)]), with(&[(0, 9.0), (300, 9.0)]), with(&[(0, f32::NAN)])];
    if found == [0, 1, 1] { Ok(()) } else { Err(format!("outliers: {found:?} faults, expected [0, 1, 1]")) }
}
