//! The contract that every file in `nodes/` meets: what a node says of itself, and what it is handed to run.
//!
//! A node type is one struct: its fields are the parameters (names, docs, ranges, units and defaults come from serde
//! and schemars attributes), and `Node` says the ports and does the work. Help, JSON schema, the README's table and
//! the editor's inspector are made from it. Not for: caching, keys, threads, files on disk caches (see `eval`).

pub use crate::memo::{Key, Memo, NoMemo, Part};

use crate::device::Device;
use crate::progress::Progress;
use crate::stored::Stored;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// The parts of a value that change for different reasons, so that moving a lamp does not cost a new transfer.
/// Scenes have all four; samples have `Geometry` (where they lie) and `Materials` (their reflectance). Every other
/// value has the same key in each facet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Facet {
    /// Triangles, names, and which triangle belongs to which object and material.
    Geometry,
    /// Reflectance, emission, textures.
    Materials,
    Lights,
    Cameras,
}

impl Facet {
    pub const ALL: [Facet; 4] = [Facet::Geometry, Facet::Materials, Facet::Lights, Facet::Cameras];
}

#[derive(Clone, Copy, Debug)]
pub struct Port {
    pub name: &'static str,
    pub kind: Kind,
    pub optional: bool,
    /// The facets that the node reads of this input. `Inputs` refuses any other.
    pub reads: &'static [Facet],
    /// Of an output: the input without which there is none.
    pub needs: Option<&'static str>,
    pub doc: &'static str,
}

impl Port {
    pub const fn new(name: &'static str, kind: Kind, doc: &'static str) -> Self {
        Self { name, kind, optional: false, reads: &Facet::ALL, needs: None, doc }
    }

    pub const fn optional(self) -> Self {
        Self { optional: true, ..self }
    }

    pub const fn needs(self, input: &'static str) -> Self {
        Self { needs: Some(input), ..self }
    }

    pub const fn reads(self, reads: &'static [Facet]) -> Self {
        Self { reads, ..self }
    }
}

/// What one facet of the node's output depends on; a facet without a rule depends on all that the node reads.
#[derive(Clone, Copy, Debug)]
pub enum FacetRule {
    /// The facet is that of an input, untouched (when that input is connected).
    Keeps(Facet, &'static str),
    /// The facet is made by the node from the listed facets of the listed inputs only.
    From(Facet, &'static [(&'static str, &'static [Facet])]),
}

/// What a node type says of itself.
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// As written in recipes.
    pub name: &'static str,
    /// Heading under which help and palette list it.
    pub category: &'static str,
    /// Raise when the result changes for equal parameters and inputs.
    pub version: u32,
    /// One line.
    pub summary: &'static str,
    pub inputs: &'static [Port],
    /// Empty for a node that only writes files.
    pub outputs: &'static [Port],
    pub facets: &'static [FacetRule],
    /// Its value is worth keeping on disk across runs.
    pub stored: bool,
    /// `Job::part` may ask for a part of the work, which is then left in the disk cache for the whole.
    pub in_parts: bool,
    /// The result depends on the frame even when no parameter is a curve (an animated file, a file pattern).
    pub uses_frame: bool,
    /// Parameters that count only through `Node::moments`.
    pub timing: &'static [&'static str],
}

impl Info {
    /// Fill the rest in with `..Info::NEW`.
    pub const NEW: Info = Info {
        name: "",
        category: "",
        version: 1,
        summary: "",
        inputs: &[],
        outputs: &[],
        facets: &[],
        stored: false,
        in_parts: false,
        uses_frame: false,
        timing: &[],
    };
}

/// A node type; the implementing struct holds its parameters after curves are evaluated at the frame.
pub trait Node: Send + Sync + 'static {
    const INFO: Info;

    /// Input files of these parameters; their content enters the key. Paths as written in the recipe.
    fn files(&self) -> Vec<String> {
        Vec::new()
    }

    /// Files that those of `files` refer to (the buffers and textures of a .gltf); their content enters the key, too.
    /// `base` is the folder that relative paths start from. A file that cannot be read refers to none.
    fn linked_files(&self, _base: &Path) -> Vec<PathBuf> {
        Vec::new()
    }

    /// Whether the result depends on the frame with these parameters; asked only where `INFO.uses_frame`.
    fn uses_frame(&self, _base: &Path) -> bool {
        true
    }

    /// Names the state of each facet of the result at a frame, where `uses_frame`: two frames with equal keys give equal
    /// facets (a lamp that moves leaves the geometry's key as it is). The frame itself, if the node knows no better.
    ///
    /// # Errors
    /// What `run` would find wrong, too.
    fn moments(&self, when: &When) -> Result<[Key; 4]> {
        Ok([Key::of(&[&when.frame.to_le_bytes()]); 4])
    }

    /// Frames at which this node, computed at `frame`, asks for the input on a port. The first gives the port's value;
    /// all are there through `Inputs::at`. None: it does without (`moments` then says when).
    fn frames(&self, _port: &str, frame: i64) -> Vec<i64> {
        vec![frame]
    }

    /// The files that this node writes at a frame, as `Job::output` takes them; what `--skip-existing` looks for.
    fn output_files(&self, _frame: f64) -> Vec<String> {
        Vec::new()
    }

    /// The input port whose value this node would return unchanged with these parameters, if any.
    fn pass_through(&self) -> Option<&'static str> {
        None
    }

    /// Computes the outputs, in the order of `INFO.outputs`; `Value::Absent` for one whose `needs` is not connected.
    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>>;
}

/// What `Node::moments` is asked about.
pub struct When<'a> {
    pub frame: f64,
    pub fps: f64,
    /// Folder that relative paths start from.
    pub base: &'a Path,
    /// Of the node's files.
    pub content: Key,
    /// For what was read of them.
    pub memo: &'a dyn Memo,
}

/// A value, and the key of each facet (index: `Facet as usize`).
pub type Given = (Value, [Key; 4]);

/// The values on a node's input ports, with the keys that they were asked for by.
pub struct Inputs<'a> {
    pub info: &'a Info,
    /// Per port of `info.inputs`.
    pub values: Vec<Option<Given>>,
    /// Of ports that are asked for at other frames (`Node::frames`): port, frame and value.
    pub at_frames: Vec<(usize, i64, Given)>,
    /// Ports that something is connected to, whether it is asked for or not.
    pub connected: Vec<bool>,
}

impl Inputs<'_> {
    fn index(&self, port: &str) -> usize {
        self.info
            .inputs
            .iter()
            .position(|p| p.name == port)
            .unwrap_or_else(|| panic!("node type {} declares no input {port}", self.info.name))
    }

    pub fn get(&self, port: &str) -> Option<&Value> {
        self.values[self.index(port)].as_ref().map(|(value, _)| value)
    }

    /// The inputs as they are at a frame that `Node::frames` named; ports that it did not name are as they are now.
    pub fn at(&self, frame: i64) -> Self {
        let mut values = self.values.clone();
        for (port, _, given) in self.at_frames.iter().filter(|(_, at, _)| *at == frame) {
            values[*port] = Some(given.clone());
        }
        Self { info: self.info, values, at_frames: Vec::new(), connected: self.connected.clone() }
    }

    pub fn is_connected(&self, port: &str) -> bool {
        self.connected[self.index(port)]
    }

    /// The key of one facet of an input; for `Job::memo`.
    pub fn key(&self, port: &str, facet: Facet) -> Option<Key> {
        let index = self.index(port);
        assert!(self.info.inputs[index].reads.contains(&facet), "{}.{port} does not declare {facet:?}", self.info.name);
        self.values[index].as_ref().map(|(_, keys)| keys[facet as usize])
    }

    fn reads(&self, port: &str, facet: Facet) -> bool {
        self.info.inputs[self.index(port)].reads.contains(&facet)
    }

    fn missing(&self, port: &str) -> Error {
        Error::compute(format!("input \"{port}\" has no value"), "connect it in the recipe")
    }
}

macro_rules! accessors {
    ($($name:ident, $required:ident, $variant:ident, $type:ty);* $(;)?) => {
        impl Inputs<'_> {
            $(
                /// The value of an optional port.
                pub fn $name(&self, port: &str) -> Option<&Arc<$type>> {
                    match self.get(port)? {
                        Value::$variant(value) => Some(value),
                        other => panic!("plan let a {:?} through to {}.{port}", other.kind(), self.info.name),
                    }
                }
                /// The value of a port that must be connected.
                pub fn $required(&self, port: &str) -> Result<&Arc<$type>> {
                    self.$name(port).ok_or_else(|| self.missing(port))
                }
            )*
        }
    };
}

accessors! {
    whole_scene, need_whole_scene, Scene, crate::scene::Scene;
    camera, need_camera, Camera, crate::scene::Camera;
    whole_samples, need_whole_samples, Samples, crate::transport::Samples;
    transfer, need_transfer, Transfer, crate::transport::Transfer;
    selection, need_selection, Selection, crate::transport::Selection;
    edits, need_edits, Edits, crate::transport::Edits;
    image, need_image, Image, crate::image::Image;
    environment, need_environment, Environment, crate::scene::Environment;
    visibility, need_visibility, Visibility, crate::transport::shadow::Visibility;
    transport, need_transport, Transport, crate::transport::shadow::DirectTransport;
    light, need_light, Light, crate::transport::shadow::Lamp;
    ratio, need_ratio, Ratio, crate::transport::shadow::Ratio;
}

impl Inputs<'_> {
    /// What every edit node gives: the list on its port `edits`, if any, with one more edit at its end.
    pub fn edits_and(&self, edit: crate::transport::Edit) -> Vec<Value> {
        let before = self.edits("edits").map(|edits| (**edits).clone()).unwrap_or_default();
        vec![Value::Edits(Arc::new(before.and(edit)))]
    }
}

impl Inputs<'_> {
    /// What every node that edits shadows gives: the visibility on its port, with one more edit at its end.
    ///
    /// # Errors
    /// A group that the visibility does not have; a light of another size, a selection of another scene.
    pub fn visibility_and(
        &self,
        group: Option<&str>,
        change: crate::transport::shadow::ShadowChange,
    ) -> Result<Vec<Value>> {
        let (lamp, selection) = (self.light("light").cloned(), self.selection("selection").cloned());
        let edit = crate::transport::shadow::ShadowEdit { group: group.map(str::to_owned), lamp, selection, change };
        Ok(vec![Value::Visibility(Arc::new(self.need_visibility("visibility")?.and(edit)?))])
    }
}

/// Parts of a scene, handed out only to nodes that declare that they read them: hash and computation see the same.
impl Inputs<'_> {
    fn part<T>(&self, port: &str, facet: Facet, take: impl Fn(&crate::scene::Scene) -> Arc<T>) -> Result<Arc<T>> {
        assert!(self.reads(port, facet), "{}.{port} does not declare {facet:?}", self.info.name);
        Ok(take(self.need_whole_scene(port)?))
    }

    pub fn geometry(&self, port: &str) -> Result<Arc<crate::scene::Geometry>> {
        self.part(port, Facet::Geometry, |scene| scene.geometry.clone())
    }

    pub fn materials(&self, port: &str) -> Result<Arc<Vec<crate::scene::Material>>> {
        self.part(port, Facet::Materials, |scene| scene.materials.clone())
    }

    pub fn lights(&self, port: &str) -> Result<Arc<Vec<crate::scene::Light>>> {
        self.part(port, Facet::Lights, |scene| scene.lights.clone())
    }

    pub fn cameras(&self, port: &str) -> Result<Arc<Vec<crate::scene::Camera>>> {
        self.part(port, Facet::Cameras, |scene| scene.cameras.clone())
    }
}

/// What a node runs with, beside its inputs.
pub struct Job<'a> {
    pub device: &'a Device,
    pub progress: Progress<'a>,
    /// For intermediate results.
    pub memo: &'a dyn Memo,
    /// Changes only for nodes that declare `uses_frame`; 0 for all others.
    pub frame: f64,
    pub fps: f64,
    /// Folder that relative paths start from.
    pub base: &'a Path,
    /// The folder `--out` names: relative output paths start from it instead of `base`.
    pub out: Option<&'a Path>,
    /// Gives the recipe as text, for the headers of pictures.
    pub recipe: &'a (dyn Fn() -> String + Sync),
    /// Key of the value being computed.
    pub key: Key,
    /// Of the content of the node's files.
    pub content: Key,
    /// Only this part of the work is to be done and left on disk; `run` gives no values then.
    pub part: Option<Part>,
    /// Shows values before they are as good as they will be; `None` where nobody looks.
    pub show: Option<&'a (dyn Fn(Vec<Value>) + Sync)>,
    /// A node that is stopped gives the best that it has, where it has anything, and says so by `stopped_short`.
    pub keeps_best: bool,
    /// What is computed, or what it is made of, is the best that there was when the work was stopped.
    pub unfinished: &'a AtomicBool,
    /// What the node says about itself in the report: rays, coefficients kept, error bound.
    pub notes: &'a Mutex<serde_json::Map<String, serde_json::Value>>,
}

static NEVER: AtomicBool = AtomicBool::new(false);

impl<'a> Job<'a> {
    /// A run by itself, outside of any evaluation: nobody watches it, nobody stops it, and no recipe is written.
    pub fn alone(
        device: &'a Device,
        memo: &'a dyn Memo,
        notes: &'a Mutex<serde_json::Map<String, serde_json::Value>>,
    ) -> Self {
        Self {
            device,
            progress: Progress::silent(),
            memo,
            frame: 0.0,
            fps: 24.0,
            base: Path::new(""),
            out: None,
            recipe: &String::new,
            key: Key([0; 16]),
            content: Key([0; 16]),
            part: None,
            show: None,
            keeps_best: false,
            unfinished: &NEVER,
            notes,
        }
    }
}

impl Job<'_> {
    pub fn path(&self, file: &str) -> PathBuf {
        self.base.join(file)
    }

    /// Where an output file goes. What is unfinished never takes the place of what will be finished: its name says so.
    pub fn output(&self, file: &str) -> PathBuf {
        let path = self.out.unwrap_or(self.base).join(file);
        if !self.unfinished.load(Ordering::Relaxed) {
            return path;
        }
        let extension = path.extension().map(|extension| extension.to_string_lossy().into_owned()).unwrap_or_default();
        path.with_extension(format!("unfinished.{extension}"))
    }

    /// What `run` gives is the best that there was when it was stopped; `text` says how good.
    pub fn stopped_short(&self, text: impl Into<String>) {
        self.unfinished.store(true, Ordering::Relaxed);
        self.note("unfinished", true);
        self.warn(text);
    }

    pub fn note(&self, name: &str, value: impl Into<serde_json::Value>) {
        self.notes.lock().expect("no panic while noting").insert(name.to_owned(), value.into());
    }

    /// Tells the user, and the report (its list `warnings`), that something may be other than was meant.
    pub fn warn(&self, text: impl Into<String>) {
        let text = text.into();
        tracing::warn!("{}: {text}", self.progress.node);
        let mut notes = self.notes.lock().expect("no panic while noting");
        match notes.entry("warnings").or_insert_with(|| serde_json::Value::Array(Vec::new())) {
            serde_json::Value::Array(list) => list.push(text.into()),
            other => *other = text.into(),
        }
    }

    /// Takes an intermediate result from the memory cache or computes it; `bytes` counts what the cache holds.
    pub fn memo<T: Send + Sync + 'static>(
        &self,
        key: Key,
        bytes: impl Fn(&T) -> u64,
        compute: impl FnOnce() -> Result<T>,
    ) -> Result<Arc<T>> {
        self.memo.remember(key, bytes, compute)
    }

    /// As `memo`, for what is dear to compute: looks into the disk cache too, and leaves the result there.
    pub fn keep<T: Stored + Send + Sync + 'static>(
        &self,
        key: Key,
        bytes: impl Fn(&T) -> u64,
        compute: impl FnOnce() -> Result<T>,
    ) -> Result<Arc<T>> {
        self.memo.keep(key, bytes, compute)
    }
}

/// A path with its frame filled in: `####`, `%04d` and `$F4` (four digits, zeros in front; `$F` without), rounded to a
/// whole frame. Paths without any of these stay as they are.
pub fn frame_path(pattern: &str, frame: f64) -> String {
    let number = |width: usize| {
        let sign = if frame.round() < 0.0 { "-" } else { "" };
        format!("{sign}{:0width$}", frame.round().abs() as u64)
    };
    let digits = |text: &str| text.chars().take_while(char::is_ascii_digit).count();
    let mut path = String::new();
    let mut rest = pattern;
    while let Some(first) = rest.chars().next() {
        let hashes = rest.chars().take_while(|c| *c == '#').count();
        let (width, length) = match first {
            '#' => (hashes, hashes),
            '$' if rest[1..].starts_with('F') => {
                let count = digits(&rest[2..]).min(2);
                (rest[2..2 + count].parse().unwrap_or(1), 2 + count)
            }
            '%' if rest[1..].starts_with('d') => (1, 2),
            '%' if rest[1..].starts_with('0') && rest[1 + digits(&rest[1..])..].starts_with('d') => {
                let count = digits(&rest[1..]);
                (rest[1..1 + count].parse().unwrap_or(1).min(99), 2 + count)
            }
            _ => {
                path.push(first);
                rest = &rest[first.len_utf8()..];
                continue;
            }
        };
        path.push_str(&number(width));
        rest = &rest[length..];
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_fill_patterns() {
        for (pattern, frame, path) in [
            ("a.####.exr", 7.0, "a.0007.exr"),
            ("a.#.exr", 123.0, "a.123.exr"),
            ("a.%04d.exr", -3.0, "a.-0003.exr"),
            ("a.%d.$F.$F3.exr", 12.0, "a.12.12.012.exr"),
            ("100%/$HOME/ü.exr", 1.0, "100%/$HOME/ü.exr"),
            ("%0", 1.0, "%0"),
            ("%", 1.0, "%"),
        ] {
            assert_eq!(frame_path(pattern, frame), path);
        }
    }
}
