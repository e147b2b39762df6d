//! Surface materials: diffuse reflectance and emission; roughness and metalness are kept for glossy receivers.

use crate::scene::texture::Texture;

#[derive(Clone, Debug)]
pub struct Material {
    pub name: String,
    /// [0, 1] per channel, linear Rec.709; multiplied by the texture if there is one.
    pub base_colour: [f32; 3],
    pub base_colour_texture: Option<Texture>,
    /// Emitted radiance, W/(sr m²), both sides; even all over: the mean of an emissive texture.
    pub emission: [f32; 3],
    /// [0, 1]; the mean of a roughness texture.
    pub roughness: f32,
    /// [0, 1]; multiplied by the texture if there is one.
    pub metallic: f32,
    pub metallic_texture: Option<Texture<f32>>,
    /// Strength of the dielectric highlight (KHR_materials_specular); 0 for none.
    pub specular: f32,
}

impl Material {
    /// A Lambertian surface.
    pub fn matte(base_colour: [f32; 3]) -> Self {
        Self {
            name: String::new(),
            base_colour,
            base_colour_texture: None,
            emission: [0.0; 3],
            roughness: 1.0,
            metallic: 0.0,
            metallic_texture: None,
            specular: 0.0,
        }
    }

    /// Diffuse reflectance: a metal has none.
    pub fn reflectance(&self, uv: [f32; 2]) -> [f32; 3] {
        let texel = self.base_colour_texture.as_ref().map_or([1.0; 3], |texture| texture.sample(uv));
        let metallic = self.metallic * self.metallic_texture.as_ref().map_or(1.0, |texture| texture.sample(uv));
        [0, 1, 2].map(|c| (self.base_colour[c] * texel[c] * (1.0 - metallic)).clamp(0.0, 1.0))
    }

    /// Reflectance at normal incidence, and roughness, with the means of textures; what `kernels::direct_light` makes
    /// highlights from.
    pub fn gloss(&self) -> [f32; 4] {
        let metallic = self.metallic * self.metallic_texture.as_ref().map_or(1.0, |texture| texture.picture.mean);
        let texel = self.base_colour_texture.as_ref().map_or([1.0; 3], |texture| texture.picture.mean);
        let base = [0, 1, 2].map(|c| self.base_colour[c] * texel[c]);
        let [r, g, b] = base.map(|c| 0.04 * self.specular * (1.0 - metallic) + c * metallic);
        [r, g, b, self.roughness]
    }

    pub fn is_finite(&self) -> bool {
        let single = [self.roughness, self.metallic, self.specular];
        self.base_colour.iter().chain(&self.emission).chain(&single).all(|x| x.is_finite())
    }

    /// Its reflectance depends on texture coordinates.
    pub fn is_textured(&self) -> bool {
        self.base_colour_texture.is_some() || self.metallic_texture.is_some()
    }

    pub fn emits(&self) -> bool {
        self.emission.iter().any(|&e| e > 0.0)
    }

    pub fn bytes(&self) -> u64 {
        let colour = self.base_colour_texture.as_ref().map_or(0, |texture| 12 * texture.picture.texels.len() as u64);
        let metal = self.metallic_texture.as_ref().map_or(0, |texture| 4 * texture.picture.texels.len() as u64);
        colour + metal
    }
}

/// The sRGB transfer function (IEC 61966-2-1), from 8 bits to linear light.
pub fn linear_from_srgb8(value: u8) -> f32 {
    let v = f32::from(value) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}
