//! What a kernel declares of its WGSL body: source, entry point, uniform struct and storage bindings.
//!
//! Plain data, present without the feature `gpu` too: the source enters cache keys, and `tests/shaders.rs` holds every
//! declaration against the reflected shader. Group 0 alone is used: binding 0 is the uniform `params`, bindings 1, 2,
//! ... are the storage buffers in the order in which they are declared.

/// What a shader may do with a storage buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    Read,
    ReadWrite,
}

/// One storage buffer: a runtime-sized array.
#[derive(Clone, Copy, Debug)]
pub struct Binding {
    /// Name of the variable in WGSL.
    pub name: &'static str,
    pub access: Access,
    /// Bytes from one element to the next.
    pub stride: usize,
}

impl Binding {
    pub const fn read<T>(name: &'static str) -> Self {
        Self { name, access: Access::Read, stride: size_of::<T>() }
    }

    pub const fn write<T>(name: &'static str) -> Self {
        Self { name, access: Access::ReadWrite, stride: size_of::<T>() }
    }
}

/// A uniform struct as Rust lays it out; made by the macro `uniform!`.
#[derive(Clone, Copy, Debug)]
pub struct Uniform {
    pub name: &'static str,
    pub size: usize,
    /// Name and byte offset of each field.
    pub fields: &'static [(&'static str, usize)],
}

/// Declares a `#[repr(C)]` Pod struct that is a WGSL uniform of the same name, with its layout as `Self::UNIFORM`.
/// Its size must be a multiple of 16 bytes; bytemuck refuses padding that is not a field.
macro_rules! uniform {
    ($(#[$meta:meta])* struct $name:ident { $($(#[$field_meta:meta])* $field:ident: $type:ty),+ $(,)? }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
        struct $name { $($(#[$field_meta])* $field: $type),+ }

        impl $name {
            const UNIFORM: $crate::device::kernel::Uniform = $crate::device::kernel::Uniform {
                name: stringify!($name),
                size: size_of::<Self>(),
                fields: &[$((stringify!($field), std::mem::offset_of!(Self, $field))),+],
            };
        }

        const _: () = assert!(size_of::<$name>() % 16 == 0, "a uniform's size is a multiple of 16 bytes");
    };
}
pub(crate) use uniform;

/// One compute kernel.
#[derive(Debug)]
pub struct Kernel {
    /// Stem of `shaders/NAME.wgsl` and `src/kernels/NAME.rs`, and the name of the entry point.
    pub name: &'static str,
    /// Files of `shaders/shared/` that the shader uses, in order.
    pub shared: &'static [&'static str],
    pub source: &'static str,
    pub workgroup: [u32; 3],
    pub uniform: Uniform,
    pub bindings: &'static [Binding],
}

impl Kernel {
    /// The WGSL text that is compiled: shared files, then the kernel's own.
    pub fn wgsl(&self) -> String {
        let mut text = String::new();
        for part in self.shared.iter().chain([&self.source]) {
            text.push_str(part);
            text.push('\n');
        }
        text
    }
}
