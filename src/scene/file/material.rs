//! Materials of glTF files, with the pictures that they need; each picture is decoded once and shared.

use crate::scene::Material;
use crate::scene::material::linear_from_srgb8;
use crate::scene::texture::{Picture, Texture, mean};
use gltf::image::{Data, Format};
use gltf::texture::Info;
use std::collections::HashMap;
use std::path::Path;

/// Decodes on demand: files hold pictures that nothing here uses (normal maps), or nothing at all.
pub(super) struct Pictures<'a> {
    /// The folder that names of files are relative to.
    base: Option<&'a Path>,
    buffers: &'a [gltf::buffer::Data],
    /// By the number of the image, as are all.
    colours: HashMap<usize, Picture>,
    /// Metalness, and the mean of the roughness.
    metals: HashMap<usize, (Picture<f32>, f32)>,
    means: HashMap<usize, [f32; 3]>,
}

/// The set of texture coordinates that a primitive of this material is read with: there is one to a mesh.
pub(super) fn uv_set(material: &gltf::Material) -> u32 {
    let pbr = material.pbr_metallic_roughness();
    pbr.base_color_texture().or(pbr.metallic_roughness_texture()).map_or(0, |info| set(&info))
}

fn set(info: &Info) -> u32 {
    info.texture_transform().and_then(|transform| transform.tex_coord()).unwrap_or(info.tex_coord())
}

fn uv_from_uv(info: &Info) -> [f32; 6] {
    let (offset, rotation, scale) =
        info.texture_transform().map_or(([0.0; 2], 0.0, [1.0; 2]), |t| (t.offset(), t.rotation(), t.scale()));
    let (sin, cos) = f32::sin_cos(rotation);
    [cos * scale[0], -sin * scale[0], sin * scale[1], cos * scale[1], offset[0], offset[1]]
}

impl<'a> Pictures<'a> {
    pub fn new(base: Option<&'a Path>, buffers: &'a [gltf::buffer::Data]) -> Self {
        Self { base, buffers, colours: HashMap::new(), metals: HashMap::new(), means: HashMap::new() }
    }

    /// Errors: a picture that is missing or cannot be decoded.
    pub fn material(&mut self, from: &gltf::Material) -> gltf::Result<Material> {
        let pbr = from.pbr_metallic_roughness();
        let [r, g, b, _] = pbr.base_color_factor();
        let base_colour_texture = match pbr.base_color_texture() {
            Some(info) => Some(Texture { picture: self.colour(&info)?, uv_from_uv: uv_from_uv(&info) }),
            None => None,
        };
        let (mut metallic, mut roughness) = (pbr.metallic_factor(), pbr.roughness_factor());
        let mut metallic_texture = None;
        if let Some(info) = pbr.metallic_roughness_texture() {
            let (picture, mean_roughness) = self.metal(&info)?;
            roughness *= mean_roughness;
            // Where it is the same all over, or other coordinates than those read address it, its mean has to do.
            let uniform = picture.texels.iter().all(|&texel| texel == picture.texels[0]);
            if metallic == 0.0 || uniform || set(&info) != uv_set(from) {
                metallic *= picture.mean;
            } else {
                metallic_texture = Some(Texture { picture, uv_from_uv: uv_from_uv(&info) });
            }
        }
        let strength = from.emissive_strength().unwrap_or(1.0);
        let mut emission = from.emissive_factor().map(|e| e * strength);
        if let Some(info) = from.emissive_texture()
            && emission != [0.0; 3]
        {
            let mean = self.mean(&info)?;
            emission = [0, 1, 2].map(|c| emission[c] * mean[c]);
        }
        Ok(Material {
            name: from.name().map_or_else(|| format!("material_{}", from.index().unwrap_or(0)), str::to_owned),
            base_colour: [r, g, b],
            base_colour_texture,
            emission,
            roughness,
            metallic,
            metallic_texture,
            specular: from.specular().map_or(1.0, |specular| specular.specular_factor()),
        })
    }

    fn colour(&mut self, info: &Info) -> gltf::Result<Picture> {
        let image = info.texture().source();
        if let Some(known) = self.colours.get(&image.index()) {
            return Ok(known.clone());
        }
        let (width, height, texels) = self.decoded(&image, linear_from_srgb8)?;
        let picture = Picture::colour(width, height, texels);
        self.colours.insert(image.index(), picture.clone());
        Ok(picture)
    }

    /// Of a picture of colours.
    fn mean(&mut self, info: &Info) -> gltf::Result<[f32; 3]> {
        let image = info.texture().source();
        let known = self.colours.get(&image.index()).map(|picture| picture.mean);
        if let Some(mean) = known.or_else(|| self.means.get(&image.index()).copied()) {
            return Ok(mean);
        }
        let (width, height, texels) = self.decoded(&image, linear_from_srgb8)?;
        let mean = Picture::colour(width, height, texels).mean;
        self.means.insert(image.index(), mean);
        Ok(mean)
    }

    /// Metalness is in blue, roughness in green, both linear.
    fn metal(&mut self, info: &Info) -> gltf::Result<(Picture<f32>, f32)> {
        let image = info.texture().source();
        if let Some(known) = self.metals.get(&image.index()) {
            return Ok(known.clone());
        }
        let (width, height, texels) = self.decoded(&image, |v| f32::from(v) / 255.0)?;
        let metalness = Picture::grey(width, height, texels.iter().map(|texel| texel[2]).collect());
        let both = (metalness, mean(texels.iter().map(|texel| texel[1])));
        self.metals.insert(image.index(), both.clone());
        Ok(both)
    }

    fn decoded(&self, image: &gltf::Image, curve: fn(u8) -> f32) -> gltf::Result<(usize, usize, Vec<[f32; 3]>)> {
        let data = Data::from_source(image.source(), self.base, self.buffers)?;
        Ok((data.width as usize, data.height as usize, texels(&data, curve)))
    }
}

/// `curve` goes from 8 bits to the value; of 16 bits the high ones are read. Float pictures are rare, and linear.
fn texels(image: &Data, curve: fn(u8) -> f32) -> Vec<[f32; 3]> {
    let table: [f32; 256] = std::array::from_fn(|v| curve(v as u8));
    let value = |v: u8| table[usize::from(v)];
    let bytes = &image.pixels;
    let grey = |v: u8| [value(v); 3];
    let rgb = |p: &[u8]| [value(p[0]), value(p[1]), value(p[2])];
    // The high byte of little-endian 16 bits.
    let rgb16 = |p: &[u8]| [value(p[1]), value(p[3]), value(p[5])];
    let float = |p: &[u8]| [0, 4, 8].map(|i| f32::from_le_bytes([p[i], p[i + 1], p[i + 2], p[i + 3]]));
    match image.format {
        Format::R8 => bytes.iter().map(|&v| grey(v)).collect(),
        Format::R8G8 => bytes.chunks_exact(2).map(|p| grey(p[0])).collect(),
        Format::R8G8B8 => bytes.chunks_exact(3).map(rgb).collect(),
        Format::R8G8B8A8 => bytes.chunks_exact(4).map(rgb).collect(),
        Format::R16 => bytes.chunks_exact(2).map(|p| grey(p[1])).collect(),
        Format::R16G16 => bytes.chunks_exact(4).map(|p| grey(p[1])).collect(),
        Format::R16G16B16 => bytes.chunks_exact(6).map(rgb16).collect(),
        Format::R16G16B16A16 => bytes.chunks_exact(8).map(rgb16).collect(),
        Format::R32G32B32FLOAT => bytes.chunks_exact(12).map(float).collect(),
        Format::R32G32B32A32FLOAT => bytes.chunks_exact(16).map(float).collect(),
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::file;
    use serde_json::json;

    /// Left half and right half differ, so that means and texels can be told apart.
    fn picture(folder: &std::path::Path, name: &str, left: [u8; 3], right: [u8; 3]) {
        let half = |x: u32, _: u32| image::Rgb(if x < 8 { left } else { right });
        image::RgbImage::from_fn(16, 16, half).save(folder.join(name)).expect("a picture");
    }

    #[test]
    fn metalness_is_read_by_texel_and_the_rest_by_its_mean() {
        let folder = tempfile::tempdir().expect("a folder");
        picture(folder.path(), "metal.png", [9, 51, 255], [9, 255, 0]);
        picture(folder.path(), "glow.png", [255, 0, 0], [0, 0, 0]);
        picture(folder.path(), "colour.png", [255; 3], [0; 3]);
        std::fs::write(folder.path().join("normal.png"), "no picture at all").expect("a file");
        let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        std::fs::write(folder.path().join("a.bin"), bytemuck::cast_slice(&corners)).expect("a file");
        let metal =
            json!({ "metallicRoughnessTexture": { "index": 0 }, "metallicFactor": 0.5, "roughnessFactor": 0.5 });
        let glass = json!({ "baseColorTexture": { "index": 2 }, "metallicFactor": 0.0 });
        let text = json!({
            "asset": { "version": "2.0" },
            "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
            "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0],
                "max": [1, 1, 0] }],
            "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
            "buffers": [{ "uri": "a.bin", "byteLength": 36 }],
            "materials": [
                { "pbrMetallicRoughness": metal, "emissiveTexture": { "index": 1 }, "emissiveFactor": [1, 1, 1] },
                { "pbrMetallicRoughness": glass, "alphaMode": "BLEND", "normalTexture": { "index": 3 } },
                { "pbrMetallicRoughness": glass, "alphaMode": "MASK" }
            ],
            "textures": [{ "source": 0 }, { "source": 1 }, { "source": 2 }, { "source": 3 }],
            "images": [{ "uri": "metal.png" }, { "uri": "glow.png" }, { "uri": "colour.png" }, { "uri": "normal.png" }]
        });
        let path = folder.path().join("a.gltf");
        std::fs::write(&path, text.to_string()).expect("a file");

        let (scene, census) = file::read(&path, 1.0).expect("a scene");
        let [metal, glass, cut_out, _default] = &scene.materials[..] else { panic!("four materials") };
        assert_eq!(metal.reflectance([0.25, 0.5]), [0.5; 3], "half metal on the left");
        assert_eq!(metal.reflectance([0.75, 0.5]), [1.0; 3], "no metal on the right");
        assert!((metal.roughness - 0.5 * 0.6).abs() < 1e-6, "roughness {}", metal.roughness);
        assert_eq!(metal.emission, [0.5, 0.0, 0.0]);
        // A quarter metal on average.
        assert!((metal.gloss()[0] - (0.04 * 0.75 + 0.25)).abs() < 1e-6, "{:?}", metal.gloss());
        let texels = |m: &crate::scene::Material| m.base_colour_texture.as_ref().map(|t| t.picture.texels.id());
        assert!(texels(glass).is_some() && texels(glass) == texels(cut_out), "decoded once");
        assert_eq!((census.drawn_solid, census.averaged_emission), (2, 1));
    }
}
