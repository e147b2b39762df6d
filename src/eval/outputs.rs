//! Whether what a frame would write can be written without harm: not over what the recipe reads, not twice.

use crate::graph::Plan;
use crate::node::frame_path;
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Looks at the files that `targets` write at a frame, under `out` or the recipe's folder.
///
/// # Errors
/// `Usage` when one of them is the recipe, a file that a node reads, or the output of another node.
pub fn check(plan: &Plan, targets: &[usize], frame: i64, out: Option<&Path>, recipe: &Path) -> Result<()> {
    let frame = frame as f64;
    let mut taken: Vec<(PathBuf, String)> = vec![(whole(recipe), "the recipe".to_owned())];
    for step in &plan.steps {
        let node = step.node(frame)?.node;
        let named = node.files().into_iter().map(|file| plan.base.join(frame_path(&file, frame)));
        let files = named.chain(node.linked_files(&plan.base).into_iter().map(|file| plan.base.join(file)));
        taken.extend(files.map(|file| (whole(&file), format!("read by node \"{}\"", step.name))));
    }
    let folder = out.unwrap_or(&plan.base);
    for &target in targets {
        let step = &plan.steps[target];
        for file in step.node(frame)?.node.output_files(frame) {
            let path = whole(&folder.join(&file));
            if let Some((_, what)) = taken.iter().find(|(other, _)| *other == path) {
                let message = format!("node \"{}\" would write over {}, which is {what}", step.name, path.display());
                return Err(Error::usage(message, "write to another file, or into another folder with --out"));
            }
            taken.push((path, format!("written by node \"{}\"", step.name)));
        }
    }
    Ok(())
}

/// One name for one file, however it is written: links and `..` followed as far as the path exists.
fn whole(path: &Path) -> PathBuf {
    if let Ok(found) = path.canonicalize() {
        return found;
    }
    match (path.parent(), path.file_name()) {
        (Some(parent), Some(name)) if parent != Path::new("") => whole(parent).join(name),
        (_, Some(name)) => whole(Path::new(".")).join(name),
        _ => path.to_owned(),
    }
}
