//! Where kernels run: natively on the CPU, or on a GPU through wgpu. The only folder that names wgpu.
//!
//! Kernels take a `&Device` and pick their body; nodes hand the device through and know nothing of it. Not for: what
//! is computed (see `kernels`).

pub mod array;
#[cfg(feature = "gpu")]
mod batch;
#[cfg(feature = "gpu")]
mod gpu;
pub mod kernel;
#[cfg(feature = "gpu")]
mod memory;

pub use array::Array;
#[cfg(feature = "gpu")]
pub use batch::Batch;
#[cfg(feature = "gpu")]
pub use gpu::Gpu;
pub use kernel::{Access, Binding, Kernel};
#[cfg(feature = "gpu")]
pub use memory::Buffer;

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
    #[cfg(feature = "gpu")]
    Gpu(Box<Gpu>),
}

impl Device {
    /// Opens the device that was asked for. `Error::Device` when `Choice::Gpu` cannot be met.
    pub fn open(choice: Choice) -> Result<Self> {
        match choice {
            Choice::Cpu => Ok(Self::Cpu),
            Choice::Auto => Ok(Self::open_hardware().unwrap_or(Self::Cpu)),
            Choice::Gpu => Self::open_any(),
        }
    }

    /// One line for messages and reports.
    pub fn name(&self) -> String {
        match self {
            Self::Cpu => format!("CPU, {} threads", rayon::current_num_threads()),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => format!("GPU {}", gpu.name()),
        }
    }
}

/// One line of `chiaro devices`.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Description {
    pub name: String,
    /// `cpu`, `gpu`, or `software` for a GPU driver that runs on the CPU.
    pub kind: &'static str,
    /// Empty for the CPU.
    pub backend: String,
    pub driver: String,
    /// `--device auto` opens this one.
    pub automatic: bool,
}

/// Every device that could be opened, the CPU first.
pub fn list() -> Vec<Description> {
    #[cfg(not(feature = "gpu"))]
    let gpus = Vec::new();
    #[cfg(feature = "gpu")]
    let gpus = adapters::describe();
    let automatic = gpus.iter().all(|gpu: &Description| !gpu.automatic);
    let cpu =
        Description { name: Device::Cpu.name(), kind: "cpu", backend: String::new(), driver: String::new(), automatic };
    std::iter::once(cpu).chain(gpus).collect()
}

#[cfg(not(feature = "gpu"))]
impl Device {
    fn open_hardware() -> Option<Self> {
        None
    }

    fn open_any() -> Result<Self> {
        Err(Error::device(
            "this build of chiaro has no GPU support",
            "use --device cpu, or build with the feature on: cargo build --release --features gpu",
        ))
    }
}

#[cfg(feature = "gpu")]
impl Device {
    fn open_hardware() -> Option<Self> {
        let adapter = adapters::find().into_iter().find(adapters::is_hardware)?;
        match Gpu::open(&adapter) {
            Ok(gpu) => Some(Self::Gpu(Box::new(gpu))),
            Err(error) => {
                tracing::warn!("{error}; using the CPU");
                None
            }
        }
    }

    fn open_any() -> Result<Self> {
        let adapter = adapters::find().into_iter().next().ok_or_else(|| {
            Error::device(
                "no GPU adapter was found",
                "install a Vulkan driver (WGPU_BACKEND and VK_DRIVER_FILES narrow the search), or use --device cpu",
            )
        })?;
        Ok(Self::Gpu(Box::new(Gpu::open(&adapter)?)))
    }
}

#[cfg(feature = "gpu")]
mod adapters {
    use super::Description;
    use wgpu::DeviceType;

    /// All adapters that can run compute shaders, the fastest kind first.
    pub fn find() -> Vec<wgpu::Adapter> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        // OpenGL is there for the editor's window alone: its compute shaders are too narrow.
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
        let computes = wgpu::DownlevelFlags::COMPUTE_SHADERS;
        adapters.retain(|adapter| adapter.get_downlevel_capabilities().flags.contains(computes));
        adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
            DeviceType::DiscreteGpu => 0,
            DeviceType::IntegratedGpu => 1,
            DeviceType::VirtualGpu => 2,
            DeviceType::Other => 3,
            DeviceType::Cpu => 4,
        });
        adapters
    }

    /// False for drivers that run on the CPU, and for those that do not say.
    pub fn is_hardware(adapter: &wgpu::Adapter) -> bool {
        !matches!(adapter.get_info().device_type, DeviceType::Cpu | DeviceType::Other)
    }

    pub fn describe() -> Vec<Description> {
        let adapters = find();
        let automatic = adapters.iter().position(is_hardware);
        let describe = |(i, adapter): (usize, &wgpu::Adapter)| {
            let info = adapter.get_info();
            Description {
                kind: if info.device_type == DeviceType::Cpu { "software" } else { "gpu" },
                name: info.name,
                backend: info.backend.to_string(),
                driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
                automatic: Some(i) == automatic,
            }
        };
        adapters.iter().enumerate().map(describe).collect()
    }
}
