//! Where kernels run: natively on the CPU, or on a GPU through wgpu. The only folder that names wgpu.

pub mod array;

pub use array::Array;

/// The device of one evaluation. On `Cpu` no wgpu instance is ever created.
pub enum Device {
    Cpu,
}
