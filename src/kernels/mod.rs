//! CPU bodies of the kernels, one per file in `shaders/`.

pub mod direct_light;
pub mod primary_visibility;
pub mod transfer_rows;
