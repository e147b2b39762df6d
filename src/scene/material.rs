//! Surface materials: diffuse reflectance and emission; roughness and metalness are kept for glossy receivers.

use crate::device::Array;

/// A linear-light RGB picture addressed by texture coordinates, wrapping, bilinear; v = 0 is the first row (glTF).
#[derive(Clone, Debug)]
pub struct Texture {
    pub width: usize,
    pub height: usize,
    pub texels: Array<[f32; 3]>,
    /// KHR_texture_transform: `uv' = [m0 m2; m1 m3] uv + [m4 m5]`.
    pub uv_from_uv: [f32; 6],
}

impl Texture {
    pub fn sample(&self, uv: [f32; 2]) -> [f32; 3] {
        let m = &self.uv_from_uv;
        let u = m[0] * uv[0] + m[2] * uv[1] + m[4];
        let v = m[1] * uv[0] + m[3] * uv[1] + m[5];
        let wrap = |x: f32, n: usize| {
            let x = if x.is_finite() { (x - x.floor()) * n as f32 - 0.5 } else { 0.0 };
            let low = x.floor();
            let index = |i: f32| (i as isize).rem_euclid(n as isize) as usize;
            (index(low), index(low + 1.0), x - low)
        };
        let (x0, x1, fx) = wrap(u, self.width);
        let (y0, y1, fy) = wrap(v, self.height);
        let row = |y: usize| {
            let (a, b) = (self.texels[y * self.width + x0], self.texels[y * self.width + x1]);
            [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * fx)
        };
        let (top, bottom) = (row(y0), row(y1));
        [0, 1, 2].map(|c| top[c] + (bottom[c] - top[c]) * fy)
    }
}

#[derive(Clone, Debug)]
pub struct Material {
    pub name: String,
    /// [0, 1] per channel, linear Rec.709; multiplied by the texture if there is one.
    pub base_colour: [f32; 3],
    pub base_colour_texture: Option<Texture>,
    /// Emitted radiance, W/(sr m²), both sides.
    pub emission: [f32; 3],
    pub roughness: f32,
    pub metallic: f32,
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
            specular: 0.0,
        }
    }

    /// Diffuse reflectance: a metal has none.
    pub fn reflectance(&self, uv: [f32; 2]) -> [f32; 3] {
        let texel = self.base_colour_texture.as_ref().map_or([1.0; 3], |texture| texture.sample(uv));
        [0, 1, 2].map(|c| (self.base_colour[c] * texel[c] * (1.0 - self.metallic)).clamp(0.0, 1.0))
    }

    /// Reflectance at normal incidence, and roughness; what `kernels::direct_light` makes highlights from.
    pub fn gloss(&self) -> [f32; 4] {
        let [r, g, b] = self.base_colour.map(|c| 0.04 * self.specular * (1.0 - self.metallic) + c * self.metallic);
        [r, g, b, self.roughness]
    }

    pub fn is_finite(&self) -> bool {
        let single = [self.roughness, self.metallic, self.specular];
        self.base_colour.iter().chain(&self.emission).chain(&single).all(|x| x.is_finite())
    }

    pub fn emits(&self) -> bool {
        self.emission.iter().any(|&e| e > 0.0)
    }

    pub fn bytes(&self) -> u64 {
        self.base_colour_texture.as_ref().map_or(0, |texture| 12 * texture.texels.len() as u64)
    }
}

/// The sRGB transfer function (IEC 61966-2-1), from 8 bits to linear light.
pub fn linear_from_srgb8(value: u8) -> f32 {
    let v = f32::from(value) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}
