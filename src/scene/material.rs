//! Surface materials: diffuse reflectance and emission; roughness and metalness are kept for glossy receivers.

use crate::device::Array;

/// A linear-light RGB picture addressed by texture coordinates, wrapping, bilinear.
#[derive(Clone, Debug)]
pub struct Texture {
    pub width: usize,
    pub height: usize,
    pub texels: Array<[f32; 3]>,
    /// `uv' = offset + rotation-scale matrix * uv` (KHR_texture_transform), column-major.
    pub uv_from_uv: [f32; 6],
}

#[derive(Clone, Debug)]
pub struct Material {
    pub name: String,
    /// Diffuse reflectance, [0, 1] per channel, linear Rec.709; multiplied by the texture if there is one.
    pub base_colour: [f32; 3],
    pub base_colour_texture: Option<Texture>,
    /// Emitted radiance, W/(sr m²), both sides.
    pub emission: [f32; 3],
    pub roughness: f32,
    pub metallic: f32,
}

impl Material {
    pub fn bytes(&self) -> u64 {
        self.base_colour_texture.as_ref().map_or(0, |texture| 12 * texture.texels.len() as u64)
    }
}
