//! chiaro: a node-graph compositor for light and shadow.
//!
//! A recipe (JSON graph) goes in, an edited picture comes out. How data flows:
//!
//! ```text
//! graph/   text -> Document -> Plan            (typed, sorted, every problem named at once)
//! eval/    Plan -> keys -> values              (pull; memory cache, disk cache, progress)
//! nodes/   one file per node type              (the contract is node.rs, params.rs, value.rs)
//! scene/   files and built-in scenes -> triangles, lights, cameras, BVH
//! transport/ surface samples, gather samples, transfer rows, edits: the mathematics
//! kernels/ CPU bodies; shaders/ holds the WGSL twin of each, same stem
//! device/  Cpu | Gpu; the only folder that names wgpu
//! image/   layers, EXR, PNG, comparison metrics
//! cli/     one file per subcommand
//! editor/  the window: session, undo, evaluation off its thread
//! ```
//!
//! Dependencies point one way: `cli -> editor -> eval -> graph -> node`; `cli, nodes -> transport, scene, image, kernels`;
//! `node -> value -> transport, scene, image` (what travels on wires). `transport` lies on both sides of the kernels: what
//! a transfer is made of (`cluster`, `gather`, `sampling`, `sparse`) is their input, the rest calls them. So:
//! `transport -> kernels -> transport's data -> scene -> device`. `tests/architecture.rs` guards it.

pub mod atomic;
pub mod cli;
pub mod device;
#[cfg(feature = "editor")]
pub mod editor;
pub mod error;
pub mod eval;
pub mod fields;
pub mod graph;
pub mod image;
pub mod kernels;
pub mod memo;
pub mod memory;
pub mod names;
pub mod node;
#[path = "../nodes/mod.rs"]
pub mod nodes;
pub mod params;
pub mod progress;
pub mod scene;
pub mod stored;
pub mod transport;
pub mod value;

pub use error::{Error, Result};
