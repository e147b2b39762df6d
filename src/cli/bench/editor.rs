//! Times the editor: from the hand to the picture that shows what it did, through the window's frames.

use super::print;
use super::sliders::{RATIO_SLIDERS, SHADOW_SLIDERS, SLIDERS, stepped};
use crate::Result;
use crate::device::Device;
use crate::editor::window::{Engine, Headless, Places, Wait};
use crate::eval::{Evaluator, Options};
use crate::graph::Document;
use crate::params::NodeType;
use std::path::Path;
use std::sync::Arc;

/// Steps of a slider; the first few, which load caches, do not count.
const STEPS: usize = 60;
const FIRST: usize = 5;

/// What sliders end in, and the sliders.
type Group = (&'static str, &'static [(&'static str, &'static str, f64)]);
const GROUPS: [Group; 3] = [("relight", SLIDERS), ("synthesize_shadow", RATIO_SLIDERS), ("integrate", SHADOW_SLIDERS)];

/// One node of each type that has a slider, and a stroke for those that take selections.
pub fn run(path: &Path, document: &Document, device: Device, registry: &'static [NodeType]) -> Result<()> {
    let folder = tempfile::tempdir().map_err(|error| {
        crate::Error::output(Path::new("temporary folder"), error.to_string(), "make room, or set TMPDIR")
    })?;
    let engine = Engine { evaluator: Arc::new(Evaluator::new(Options::new(device))), registry };
    let places = Places { folder: folder.path().to_owned() };
    let mut window = Headless::open(engine, places, path.to_owned())?;
    let heads = ["median ms", "95 %", "in full", "95 %", "frame"].map(|head| format!("{head:>9}")).concat();
    print(&format!("{:<47} {heads}\n", "in the editor's window"));
    for (shown, sliders) in GROUPS {
        let Some((target, _)) = document.nodes.iter().find(|(_, entry)| entry.kind == shown) else { continue };
        window.view(target);
        for (kind, param, by) in sliders {
            let found = document.nodes.iter().find(|(name, entry)| {
                entry.kind == *kind && entry.params.contains_key(*param) && document.depends(target, name)
            });
            let Some((name, entry)) = found else { continue };
            let start = &entry.params[*param];
            let values = (1..=STEPS + FIRST).map(|step| stepped(start, by * step as f64));
            window.longest_frame();
            let waits = window.slide(name, param, values);
            tell(&format!("{target}: {name}.{param} slid"), &waits[FIRST..], &mut window);
        }
        for kind in ["illumination_brush", "caster_receiver", "remove_shadow"] {
            let brush =
                document.nodes.iter().find(|(name, entry)| entry.kind == kind && document.depends(target, name));
            let Some((name, _)) = brush else { continue };
            window.longest_frame();
            let waits = window.paint(name, STEPS);
            if let Some(waits) = waits.get(1..).filter(|waits| !waits.is_empty()) {
                tell(&format!("{target}: a stroke for {name}"), waits, &mut window);
            }
        }
    }
    Ok(())
}

fn tell(what: &str, waits: &[Wait], window: &mut Headless) {
    let share = |of: fn(&Wait) -> f64, share: f64| {
        let mut ms: Vec<f64> = waits.iter().map(|wait| of(wait) * 1e3).collect();
        ms.sort_by(f64::total_cmp);
        ms[((ms.len() - 1) as f64 * share).round() as usize]
    };
    let [first, late] = [0.5, 0.95].map(|at| share(|wait| wait.first, at));
    let [full, last] = [0.5, 0.95].map(|at| share(|wait| wait.full, at));
    let frame = window.longest_frame() * 1e3;
    print(&format!("{what:<48} {first:>8.1} {late:>8.1} {full:>8.1} {last:>8.1} {frame:>8.1}\n"));
}
